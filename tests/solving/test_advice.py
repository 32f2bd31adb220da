"""Advice on a scene's model: what a plain call takes, why, and the same words as the call."""

import json

import jax
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.scene import library
from jbeamshell.scene.plan import STEPS

ROTATING = {"contact.pressure": 5000.0, "load.amplitude": 400.0}
SLENDER = {
    "strip.height_ratio": 0.01,
    "contact.friction": 0.3,
    "contact.pressure": [[0.0, 30.0], [0.6, 30.0], [0.6, 0.0], [2.0, 0.0]],
}


@pytest.mark.parametrize(
    ("values", "section", "to", "reason"),
    [
        ({}, "plane", "plane elasticity", "all that plane elasticity needs"),
        ({"strip.far_end": "free"}, "plane", "plane elasticity", "all that plane elasticity needs"),
        ({"model.kinematics": "exact"}, "squeeze", "its own fine mesh", "no exact rotations"),
        (ROTATING, "squeeze", "its own fine mesh", "rotations are so large"),
        (SLENDER, "squeeze", "its own fine mesh", "may buckle"),
        ({"model.section": "squeeze"}, "squeeze", "its own fine mesh", "section is named"),
        ({"strip.curvature": 1e-3}, "squeeze", "its own fine mesh", "it is curved"),
        ({"contact.normal": "compliant"}, "squeeze", "its own fine mesh", "base is not rigid"),
        ({"contact.smoothing": 8.0}, "squeeze", "its own fine mesh", "friction is smooth"),
        ({"strip.kappa_s": 0.5}, "squeeze", "its own fine mesh", "strip.kappa_s"),
        ({"model.grid": "collocation"}, "squeeze", "its own fine mesh", "its grid"),
        (
            {"load.control": "arc-length", "load.amplitude": 1e-5},
            "squeeze",
            "its own fine mesh",
            "load.control = arc-length",
        ),
    ],
    ids=str,
)
def test_what_is_taken_and_why(values, section, to, reason):
    scene = jb.Scene().replace(values)
    advice = jb.advise(scene)
    assert advice.scene.model == scene.model
    assert (advice.settings["model.section"], advice.to) == (section, to)
    assert reason in advice.reason
    assert str(advice).startswith(f"{scene.plan}, for 1 % of {to}: ")
    json.dumps(advice.figures())


def test_a_scene_by_load_steps_keeps_to_its_own_mesh():
    advice = jb.advise(jb.Scene().by_load_steps())
    assert (advice.scene.plan.engine, advice.to) == (STEPS, "its own fine mesh")
    assert "to be solved in load steps" in advice.reason


def test_an_energy_of_ones_own_keeps_to_its_own_mesh():
    scene = jb.Scene(energy=lambda e, g, k, psi, dpsi: e**2 + g**2 + k**2 + psi**2 + dpsi**2)
    assert "energy of its own" in jb.advise(scene).reason


def test_a_tolerance_is_the_scenes_number():
    scene = jb.Scene().replace({"load.amplitude": 0.4})
    loose = jb.advise(scene, 0.1)
    assert loose.settings["model.nodes"] < jb.advise(scene).settings["model.nodes"]
    given = scene.replace({"model.tolerance": 0.1})
    assert loose.scene.model == given.model
    history = jb.solve(scene, tolerance=0.1, throw=False)
    assert history.scene.model.tolerance == 0.1
    fine = jb.solve(given, throw=False)
    np.testing.assert_array_equal(history.displacement, fine.displacement)


def test_a_lap_joint_is_plane_elasticity():
    named = library.double_shear()
    opened = named.replace({"model.section": "auto"})
    for joint, reason in ((named, "is named"), (opened, "all that plane")):
        advice = jb.advise(joint)
        assert (advice.scene.plan.section, advice.to) == ("plane", "plane elasticity")
        assert reason in advice.reason


@pytest.mark.parametrize("tolerance", [0.0, 1e-9, 0.2, float("nan"), "much"])
def test_a_tolerance_out_of_range(tolerance):
    for call in (jb.advise, lambda *given: jb.solve(given[0], tolerance=given[1])):
        with pytest.raises(jb.InputError, match=r"model\.tolerance = "):
            call(jb.Scene(), tolerance)


def test_a_scene_that_cannot_be_solved():
    with pytest.raises(jb.InputError, match=r"load\.amplitude = 3\.0: must stay below gross slip"):
        jb.advise(jb.Scene().replace({"load.amplitude": 3.0}))
    with pytest.raises(jb.InputError, match="scene = "):
        jb.advise("standard")
    with pytest.raises(jb.InputError, match="advice has no derivative"):
        jax.jit(lambda mu: jb.advise(jb.Scene().replace({"contact.friction": mu})))(0.1)
