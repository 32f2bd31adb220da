"""Bodies between built ones: their error, ranges, batches, gradients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import condensed

SCENE = jb.library.standard()  # under an even traction, whose slip zones are nested
RANGES = (0.08, 0.16), (0.25, 0.35)


@pytest.fixture(scope="module")
def bodies():
    return condensed.Bodies.of(SCENE, *RANGES, nodes=25, points=(6, 4))


def test_lanes_are_strips_within_the_stated_error(bodies):
    random = np.random.default_rng(0)
    values = {
        "strip.height_ratio": random.uniform(*RANGES[0], 40),
        "strip.poisson_ratio": random.uniform(*RANGES[1], 40),
        "contact.friction": random.uniform(0.08, 0.12, 40),
    }
    amplitudes = values["contact.friction"][:, None] * np.array([8.0, 14.0])
    found = bodies.dissipation(values, amplitudes)
    assert 0.0 < bodies.error < 1e-3
    for i in (0, 17, 39):
        scene = SCENE.replace({key: column[i] for key, column in values.items()})
        exact = condensed.dissipation(scene, amplitudes[i], nodes=25)
        np.testing.assert_allclose(found[i], exact, rtol=3.0 * float(bodies.error))


def test_outside_of_its_range_there_is_none(bodies):
    ratios = {"strip.height_ratio": np.array([0.07, 0.08, 0.16, 0.17])}
    found = bodies.dissipation(ratios, np.ones((4, 1)))
    assert np.array_equal(np.isnan(found[:, 0]), [True, False, False, True])


def test_a_slope_is_that_of_differences(bodies):
    @jax.jit
    @jax.value_and_grad
    def work(eta):
        scene = bodies.scene.replace({"strip.height_ratio": eta})
        return bodies.factors(scene).dissipation(jnp.ones(1))[0]

    step = 1e-5
    slope = (work(0.1126 + step)[0] - work(0.1126 - step)[0]) / (2.0 * step)
    assert float(work(0.1126)[1]) == pytest.approx(float(slope), rel=1e-6)


@pytest.mark.parametrize(
    ("values", "ranges", "said"),
    [
        ({"strip.layers": [[0.1, 2.0, 0.3], [0.1, 4.0, 0.3]]}, RANGES, "strip.layers"),
        ({"contact.pressure": [[0.0, 9.0], [2.0, 10.0]]}, RANGES, "contact.pressure"),
        ({}, (RANGES[0], (0.4, 0.3)), "poisson_ratios"),
        ({"contact.stick_stiffness": 10.0}, RANGES, "stick_stiffness"),
        ({"load.entry": "member"}, RANGES, "load.entry"),
    ],
)
def test_what_it_does_not_cover_is_refused(values, ranges, said):
    with pytest.raises(jb.InputError, match=said):
        condensed.Bodies.of(SCENE.replace(values), *ranges)
