"""Invariants over random strips: every step converges, friction stays in its cone, work is lost."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb

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


def check(history):
    cap = history.scene.contact.friction * jnp.maximum(history.reaction, 0.0)
    floor = 1e-5 * float(history.scene.contact.friction) * 10.0
    assert bool(jnp.all(jnp.abs(history.traction) <= cap * (1.0 + 1e-12) + floor))
    scale = float(jnp.max(jnp.abs(history.force)) * jnp.max(jnp.abs(history.displacement)))
    assert float(jnp.min(history.slip_work)) > -1e-12 * scale
    assert abs(float(history.closure)) < 1e-6


@pytest.mark.parametrize("smoothing", ["sharp", 16.0])
def test_random_strips_converge_and_obey_friction(smoothing):
    random = np.random.default_rng(11)
    base = jb.Scene().replace(SMALL | {"contact.smoothing": smoothing})
    for _ in range(20):
        history = jb.solve(base.replace(random_values(random)))
        if smoothing == "sharp":
            check(history)


@pytest.mark.slow
@pytest.mark.parametrize("smoothing", ["sharp", 16.0])
def test_hundreds_of_random_strips_converge_without_recovery(smoothing):
    random = np.random.default_rng(3)
    base = jb.Scene().replace({"contact.smoothing": smoothing})
    run = jax.jit(lambda v: jnp.max(jb.solve(base.replace(v), throw=False).status))
    failed = sum(int(run(random_values(random))) > 0 for _ in range(400))
    assert failed == 0
