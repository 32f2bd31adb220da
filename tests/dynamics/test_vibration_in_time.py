"""Harmonic balance beside time integration: steady amplitudes, folds, stable and unstable."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest

from jbeamshell import dynamics
from jbeamshell.dynamics import Attachment, CubicSpring, Joint, Structure

U = np.geomspace(0.05, 4.0, 8)
SPRING = np.array([[3.0, -3.0], [-3.0, 3.0]])
FORCE = 0.3
CASES = 20
FOLDED = (0, 1, 2, 7, 10, 13)  # seeds; of the last three points lie close to a fold
STEPS = 400  # of a period


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
        tolerance=1e-5,
    )
    last = slice(-128, None)
    turned = np.exp(-1j * omega * np.asarray(motion.time)[last])
    amplitude = abs(np.mean(np.asarray(motion.displacement)[last, 1] * turned)) * 2.0
    assert amplitude == pytest.approx(found.amplitude[0], rel=error)


def random_structure(seed):
    """Two masses on springs with a joint on the first and a cubic spring on the second."""
    draw = np.random.default_rng(seed)
    mass, coupling = draw.uniform(0.5, 2.0, 2), draw.uniform(2.0, 6.0)
    scale = draw.uniform(0.01, 0.03)
    force = scale * np.tanh(U)
    joint = Joint(U, force, capacity=force[-1])
    cubic = CubicSpring(draw.uniform(0.2, 1.0), draw.uniform(0.1, 0.4))
    stiffness = coupling / 3.0 * SPRING
    held = [Attachment(joint, 0), Attachment(cubic, 1)]
    damping = draw.uniform(0.004, 0.01) * np.diag(mass)
    return Structure(np.diag(mass), stiffness, held, damping=damping), draw.uniform(0.03, 0.08)


def integrated(structure, force, response, points, periods):
    """First harmonics (k,) at the second mass after periods from points of the curve.

    Central differences with the exact law of the sliders, whose memory is that of the cycle before.
    """
    joint, cubic = structure.joints
    springs, limits = np.asarray(joint.springs), np.asarray(joint.limits)
    stiffness = structure.stiffness + np.diag([float(joint.spring), float(cubic.stiffness)])
    mass, damping = np.diag(structure.mass), np.diag(structure.damping)
    omega, h = response.frequency[points, None], response.harmonic
    shapes = response.coefficients[points]

    def on_curve(angle):
        return np.einsum("h,khn->kn", np.exp(1j * angle * h), shapes).real

    sliders, angles = (
        np.zeros((len(points), limits.size)),
        2.0 * np.pi * np.arange(STEPS + 1) / STEPS,
    )
    for before, after in itertools.pairwise(angles):
        moved = (on_curve(after) - on_curve(before))[:, :1]
        sliders = np.clip(sliders + springs * moved, -limits, limits)
    step = 2.0 * np.pi / STEPS / omega
    x, before = on_curve(0.0), on_curve(-2.0 * np.pi / STEPS)
    sums = np.zeros(len(points), complex)
    for number in range(periods * STEPS):
        angle = 2.0 * np.pi * number / STEPS
        inner = x @ stiffness
        inner[:, 0] += sliders.sum(axis=1)
        inner[:, 1] += float(cubic.cubic) * x[:, 1] ** 3 - force * np.cos(angle)
        inertia, drag = mass / step**2, damping / (2.0 * step)
        after = (inertia * (2.0 * x - before) + drag * before - inner) / (inertia + drag)
        sliders = np.clip(sliders + springs * (after - x)[:, :1], -limits, limits)
        before, x = x, after
        if number >= (periods - 1) * STEPS:
            sums += 2.0 / STEPS * x[:, 1] * np.exp(-1j * (angle + 2.0 * np.pi / STEPS))
    return sums


@pytest.mark.slow
@pytest.mark.parametrize("seed", FOLDED)
def test_folds_part_stable_from_unstable(seed):
    structure, force = random_structure(seed)
    first = structure.modes(1)[0][0]
    found = dynamics.forced_response(
        structure, [0.0, force], (0.5 * first, 2.5 * first), harmonics=5
    )
    assert found.folds.size == 2
    high, low = found.folds[:2]
    assert not np.any(found.stable[high + 1 : low])
    middle = (high + low) // 2
    same = np.arange(high)
    upper = same[np.argmin(np.abs(found.frequency[:high] - found.frequency[middle]))]
    assert found.stable[upper]
    points = np.array([upper, middle])
    ends = integrated(structure, force, found, points, 150)
    starts = found.at(1)[points, 0]
    assert abs(ends[0] / starts[0] - 1.0) < 0.01
    assert abs(ends[1] / starts[1] - 1.0) > 0.1


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
