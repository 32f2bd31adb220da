"""Strips that scenes share: one where load and friction vary, interpolated ones elsewhere."""

import jax
import numpy as np
import pytest
from scenes import FEW
from scenes import PLANE as SCENE

import jbeamshell as jb
from jbeamshell.contact_line.interpolation import CLOSE, Bodies, built
from jbeamshell.contact_line.shared import shared
from jbeamshell.scene.keys import ENTRIES

PLANE = SCENE.replace({"load.amplitude": 0.5})
HEIGHT, POISSON, FRICTION, LOAD = (
    "strip.height_ratio",
    "strip.poisson_ratio",
    "contact.friction",
    "load.amplitude",
)
FIGURES = ("dissipation", "secant_stiffness", "peak_displacement", "reaction_min")
TABLE = {"contact.pressure": [[0.0, 0.5], [1.0, 2.0], [2.0, 1.0]]}


@pytest.mark.parametrize(
    "entry",
    [
        "member",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ENTRIES if name != "member"),
    ],
)
def test_interpolated_strips_are_condensed_ones(entry):
    scene = PLANE.replace({"load.entry": entry})
    random = np.random.default_rng(3)
    over = {
        HEIGHT: random.uniform(0.05, 0.3, 40),
        POISSON: random.uniform(0.1, 0.45, 40),
        FRICTION: random.uniform(0.1, 0.4, 40),
        LOAD: random.uniform(0.1, 0.9, 40) * 0.1,
        "contact.pressure": random.uniform(1.0, 2.0, 40),
        "strip.axial_stiffness": random.uniform(50.0, 200.0, 40),
    }
    found = jb.sweep(scene, over, FIGURES, paired=True)
    assert np.all(found["status"] == 0)
    for lane in (0, 17, 39):
        own = {key: values[lane] for key, values in over.items()}
        one = jb.solve(scene.replace(own), throw=False)
        for name in FIGURES:
            exact = float(getattr(one, name))
            assert float(found[name][lane]) == pytest.approx(exact, rel=2e-3), name


def test_it_is_checked_and_refined_until_it_is_close():
    bodies = built(PLANE, (0.05, 0.2), (0.3, 0.3))
    own = PLANE.replace({HEIGHT: 0.083})
    assert isinstance(bodies, Bodies)
    assert len(bodies.terms) < 12
    condensed = shared(own, [LOAD], FIGURES)
    body = jax.jit(lambda own: bodies.strip(own).body)(own)
    strip = jax.jit(condensed.layout.strip)(condensed.numbers, own)
    stiffest = float(np.max(np.abs(strip.body.K_tt)))
    for name in ("K_tt", "K_tn", "K_nn", "f_t", "f_n"):
        one, other = np.asarray(getattr(body, name)), np.asarray(getattr(strip.body, name))
        largest = stiffest if name.startswith("K") else np.max(np.abs(other))
        assert np.max(np.abs(one - other)) <= CLOSE * largest, name


def test_a_slope_over_the_height_is_that_of_differences():
    ask = jb.response(PLANE, [HEIGHT, LOAD])
    force = 0.55  # of slopes without corners around it
    found = jax.grad(lambda height: ask(height, force)["dissipation"])(0.1126)
    step = 1e-5
    two = [float(ask(0.1126 + way * step, force)["dissipation"]) for way in (1.0, -1.0)]
    assert float(found) == pytest.approx((two[0] - two[1]) / (2.0 * step), rel=1e-6)


def test_heights_that_were_not_built_are_condensed_or_unconverged():
    ask = jb.response(PLANE, [HEIGHT])
    alone = jb.solve(PLANE.replace({HEIGHT: 0.9}), throw=False)
    assert float(ask(0.9)["dissipation"]) == pytest.approx(float(alone.dissipation), rel=1e-9)
    inside = jax.jit(lambda height: ask(height))(0.9)
    assert int(inside["status"]) != 0
    assert np.isnan(inside["dissipation"])


@pytest.mark.parametrize(
    "scene",
    [PLANE.replace(TABLE), jb.library.single_lap().replace(FEW)],
    ids=["strip", "lap joint"],
)
def test_one_strip_serves_all_loads(scene):
    ask = jb.response(scene, [LOAD, FRICTION])
    size = 0.7 * float(scene.load.amplitude)
    alone = jb.solve(scene.replace({LOAD: size, FRICTION: 0.13}), throw=False)
    found = float(ask(size, 0.13)["dissipation"])
    assert found == pytest.approx(float(alone.dissipation), rel=1e-9)


@pytest.mark.parametrize(
    ("values", "over", "figures"),
    [
        (TABLE, [HEIGHT], ["dissipation"]),
        ({"strip.layers": [[0.1126, 2.0, 0.3], [0.1126, 4.0, 0.3]]}, [HEIGHT], ["dissipation"]),
        ({"strip.overhang": 0.1}, [HEIGHT], ["dissipation"]),
        ({}, ["strip.kappa_s"], ["dissipation"]),
        ({}, [LOAD], ["beta"]),
    ],
)
def test_what_depends_on_more_is_condensed_each_time(values, over, figures):
    assert shared(PLANE.replace(values), over, figures) is None
