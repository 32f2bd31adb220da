"""Harmonic balance beside time integration, and of random structures."""

import jax.numpy as jnp
import numpy as np
import pytest

from jbeamshell import dynamics
from jbeamshell.dynamics import Attachment, Joint, Structure

U = np.geomspace(0.05, 4.0, 8)
SPRING = np.array([[3.0, -3.0], [-3.0, 3.0]])
FORCE = 0.3
CASES = 20


@pytest.mark.slow
@pytest.mark.parametrize(("omega", "error"), [(0.35, 1e-4), (0.532, 1e-4), (0.8, 1e-4)])
def test_a_transient_ends_on_the_balance(omega, error):
    """Below, at and above the resonance of two masses with a joint."""
    held = [Attachment(Joint(U, np.tanh(U)), 0)]
    structure = Structure(np.eye(2), SPRING, held, damping=0.02 * np.eye(2))
    found = dynamics.steady_response(structure, [0.0, FORCE], [omega], harmonics=15)
    rate = 1j * np.arange(1, 16, 2)[:, None] * omega
    start = {
        "displacement": found.coefficients[0].real.sum(axis=0),
        "velocity": (rate * found.coefficients[0]).real.sum(axis=0),
    }
    motion = dynamics.shake(
        structure,
        60.0 * 2.0 * np.pi / omega,
        force=lambda time: FORCE * jnp.array([0.0, 1.0]) * jnp.cos(omega * time),
        **start,
        samples=60 * 128 + 1,
        method="dopri8",
        tolerance=1e-8,
        smoothing=200.0,
    )
    last = slice(-128, None)
    turned = np.exp(-1j * omega * np.asarray(motion.time)[last])
    amplitude = abs(np.mean(np.asarray(motion.displacement)[last, 1] * turned)) * 2.0
    assert amplitude == pytest.approx(found.amplitude[0], rel=error)


@pytest.mark.slow
def test_sliders_alone_never_fold():
    """Two motions under one load approach each other, whatever the joint."""
    for seed in range(CASES):
        draw = np.random.default_rng(seed)
        joint = Joint(U, draw.uniform(0.5, 3.0) * np.tanh(U))
        mass = np.diag(draw.uniform(0.5, 2.0, 2))
        stiffness = draw.uniform(0.5, 2.0) * SPRING
        structure = Structure(mass, stiffness, [Attachment(joint, 0)], damping=0.01 * mass)
        first = structure.modes(1)[0][0]
        force = [0.0, draw.uniform(0.1, 0.6)]
        found = dynamics.forced_response(structure, force, (0.4 * first, 1.6 * first))
        assert found.folds.size == 0
