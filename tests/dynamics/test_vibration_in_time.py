"""Harmonic balance beside time integration, and beside itself from other starts."""

import jax.numpy as jnp
import numpy as np
import pytest

from jbeamshell import dynamics
from jbeamshell.dynamics import Attachment, Joint, Structure

U = np.geomspace(0.05, 4.0, 8)
SPRING = np.array([[3.0, -3.0], [-3.0, 3.0]])
FORCE = 0.3
CASES = 8


@pytest.mark.slow
@pytest.mark.parametrize(("omega", "error"), [(0.35, 1e-4), (0.532, 1e-4), (0.8, 1e-4)])
def test_a_transient_ends_on_the_balance(omega, error):
    """Below, at and above the resonance of two masses with a joint."""
    held = [Attachment(Joint(U, np.tanh(U)), 0)]
    structure = Structure(np.eye(2), SPRING, held, damping=0.02 * np.eye(2))
    found = dynamics.steady_response(structure, [0.0, FORCE], [omega / (2.0 * np.pi)], harmonics=15)
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
        tolerance=1e-5,
    )
    last = slice(-128, None)
    turned = np.exp(-1j * omega * np.asarray(motion.time)[last])
    amplitude = abs(np.mean(np.asarray(motion.displacement)[last, 1] * turned)) * 2.0
    assert amplitude == pytest.approx(found.amplitude[0], rel=error)


@pytest.mark.slow
def test_a_load_has_one_steady_motion():
    """Up or down in frequency or from a small force, two motions under one load approach."""
    for seed in range(CASES):
        draw = np.random.default_rng(seed)
        joint = Joint(U, draw.uniform(0.5, 3.0) * np.tanh(U))
        mass = np.diag(draw.uniform(0.5, 2.0, 2))
        stiffness = draw.uniform(0.5, 2.0) * SPRING
        structure = Structure(mass, stiffness, [Attachment(joint, 0)], damping=0.01 * mass)
        ends = np.array([0.4, 1.6]) * structure.modes(1).frequency[0]
        force = [0.0, draw.uniform(0.1, 0.6)]
        up, down = (dynamics.forced_response(structure, force, e) for e in (ends, ends[::-1]))
        for found in (up, down):
            pick = np.linspace(0, found.frequency.size - 1, 7).astype(int)
            grown = dynamics.steady_response(structure, force, found.frequency[pick])
            np.testing.assert_allclose(found.amplitude[pick], grown.amplitude, rtol=1e-6)
