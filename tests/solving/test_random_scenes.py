"""Invariants of random strips: steps converge, friction stays in its cone, work is lost."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from jbeamshell.scene import library

SMALL = {"model.nodes": 41, "load.steps_per_half_cycle": 20}


def random_values(random):
    """A strip from thin to thick, with soft to stiff sliders, stuck to nearly sliding."""

    def between(low, high):
        return float(np.exp(random.uniform(np.log(low), np.log(high))))

    friction = between(0.02, 1.0)
    return {
        "strip.height_ratio": between(0.005, 0.5),
        "contact.friction": friction,
        "load.amplitude": random.uniform(0.02, 0.98) * friction * 20.0,
        "strip.poisson_ratio": random.uniform(0.0, 0.49),
        "strip.kappa_s": between(0.05, 3.0),
        "contact.stick_stiffness": between(2.0, 1e4),
    }


def check(history, steady=1e-6):
    cap = history.scene.contact.friction * jnp.maximum(history.reaction, 0.0)
    floor = 1e-5 * float(history.scene.contact.friction) * 10.0
    assert bool(jnp.all(jnp.abs(history.traction) <= cap * (1.0 + 1e-12) + floor))
    scale = float(jnp.max(jnp.abs(history.force)) * jnp.max(jnp.abs(history.displacement)))
    assert float(jnp.min(history.slip_work)) > -1e-12 * scale
    assert abs(float(history.closure)) < steady


@pytest.mark.parametrize("smoothing", ["sharp", pytest.param(16.0, marks=pytest.mark.slow)])
@pytest.mark.doubtful(
    "in the corner", "few nodes", "single nodes", "nothing slips", "lock", "the section squeeze"
)
def test_random_strips_converge_and_obey_friction(smoothing):
    random = np.random.default_rng(11)
    base = STRIP.replace(SMALL | {"contact.smoothing": smoothing})
    for _ in range(20):
        history = jb.solve(base.replace(random_values(random)))
        if smoothing == "sharp":
            check(history)


def test_random_linear_steps_converge_without_recovery():
    random = np.random.default_rng(3)
    linear = {"model.kinematics": "linear", "load.cycles": 1}
    stepped = {"contact.pressure": [[0.0, 8.0], [0.9, 12.0], [0.9, 9.0], [2.0, 11.0]]}
    base = STRIP.replace(SMALL | linear | stepped)
    run = jax.jit(lambda v: jnp.max(jb.solve(base.replace(v), throw=False).status))
    for _ in range(40):
        values = random_values(random)
        assert int(run(values)) == 0, values


@pytest.mark.slow(minutes=5)
@pytest.mark.parametrize("smoothing", ["sharp", 16.0])
def test_hundreds_of_random_strips_converge_without_recovery(smoothing):
    random = np.random.default_rng(3)
    base = STRIP.replace({"contact.smoothing": smoothing})
    run = jax.jit(lambda v: jnp.max(jb.solve(base.replace(v), throw=False).status))
    failed = sum(int(run(random_values(random))) > 0 for _ in range(400))
    assert failed == 0


def random_clamp(random):
    """A strip under a bolt-like patch, its end sticking out, pulled to and fro below buckling."""
    length = random.uniform(8.0, 80.0)
    patch, pressure = length * random.uniform(0.3, 0.95), 10 ** random.uniform(0.0, 2.3)
    friction = 10 ** random.uniform(-2.0, 0.0)
    buckling = np.pi**2 * (2.0 / 3.0 * 2.09e5) / (4.0 * (length - patch) ** 2)
    amplitude = min(random.uniform(0.02, 0.98) * friction * pressure * patch, 0.5 * buckling)
    return {
        "strip.length": length,
        "strip.half_height": 1.0,
        "strip.poisson_ratio": random.uniform(0.0, 0.49),
        "strip.kappa_s": 10 ** random.uniform(-1.3, 0.5),
        "contact.stick_stiffness": 10 ** random.uniform(0.3, 4.0),
        "contact.friction": friction,
        "contact.pressure": [[0, pressure], [patch, pressure], [patch, 0.0], [length, 0.0]],
        "load.amplitude": amplitude,
    }


def test_a_contact_that_goes_round_in_circles_is_found_node_by_node():
    # The overhang lies on the foundation almost without pressure, with a gap of 1e-9 H at most.
    length, patch, pressure = 74.14693231686438, 28.683243705831167, 7.221957102710951
    clamp = {
        "strip.length": length,
        "strip.half_height": 1.0,
        "strip.poisson_ratio": 0.2008159601237034,
        "strip.kappa_s": 1.386771473292275,
        "contact.stick_stiffness": 2.3475173273096646,
        "contact.friction": 0.7971740930774074,
        "contact.pressure": [[0, pressure], [patch, pressure], [patch, 0.0], [length, 0.0]],
        "model.kinematics": "linear",
    }
    scene = library.receding_rough().replace(clamp).by_load_steps().on_grid(41, 0.02)
    history = jax.jit(lambda load: jb.solve(scene, load[None], throw=False))(7.090942609)
    assert history.converged
    assert int(history.iterations[-1]) > 100
    assert float(jnp.min(history.gap)) > -1e-9
    assert float(jnp.min(history.reaction)) > -1e-6 * float(jnp.max(history.reaction))


@pytest.mark.slow(minutes=2)
def test_random_clamps_lift_and_touch_again_and_balance_their_energy():
    random = np.random.default_rng(1)
    base = library.receding_rough().by_load_steps().on_grid(201, 0.02)
    for _ in range(100):
        history = jb.solve(base.replace(random_clamp(random)))
        assert float(jnp.min(history.gap)) > -1e-9
        assert float(jnp.min(history.reaction)) > -1e-6 * float(jnp.max(history.reaction))
        scale = float(history.peak_displacement * jnp.max(history.force))
        # What is left of the balance comes from touching down within a load step.
        difference = float(history.dissipation_loop - history.dissipation)
        assert abs(difference) < max(0.01 * float(history.dissipation), 1e-5 * scale)
        check(history, steady=1e-4)
