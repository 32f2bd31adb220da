"""Condensed strips that are kept for scenes that share them."""

import jax
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.contact_line.kept import kept

PLANE = jb.Scene().replace({"model.section": "plane", "model.nodes": 17})
LAP = {"strip.far_end": "free", "member.support": "rolling"}


@pytest.fixture
def counted():
    """Function that keeps what it builds, and the scenes that it built."""
    built = []

    def build(scene):
        built.append(scene)
        return scene

    return kept(build), built


@pytest.mark.parametrize(
    ("values", "builds"),
    [
        ({"load.amplitude": 0.3}, 1),
        ({"contact.friction": 0.3}, 1),
        ({"load.cycles": 1, "load.steps_per_half_cycle": 2}, 1),
        ({"model.tolerance": 0.02}, 1),
        ({"strip.height_ratio": 0.2}, 2),
        ({"strip.poisson_ratio": 0.2}, 2),
        ({"contact.pressure": 9.0}, 2),
        ({"load.entry": "face"}, 2),
        ({"model.nodes": 19}, 2),
    ],
    ids=str,
)
def test_a_strip_is_built_once_for_all_that_do_not_touch_it(counted, values, builds):
    found, built = counted
    found(PLANE)
    found(PLANE.replace(values))
    assert len(built) == builds


def test_a_joint_that_is_pressed_with_friction_depends_on_it(counted):
    found, built = counted
    for assembly, builds in (("frictionless", 1), ("frictional", 3)):
        joint = PLANE.replace(LAP | {"member.assembly": assembly})
        found(joint)
        found(joint.replace({"contact.friction": 0.3}))
        assert len(built) == builds


def test_other_sections_and_traced_scenes_are_built_each_time(counted):
    found, built = counted
    squeeze = PLANE.replace({"model.section": "squeeze", "model.kinematics": "linear"})
    found(squeeze)
    found(squeeze)

    def height(value):
        return found(PLANE.replace({"strip.height_ratio": value})).strip.height_ratio

    assert float(jax.grad(height)(0.1)) == 1.0
    assert len(built) == 3


def test_figures_are_those_of_a_strip_that_was_never_seen():
    scene = PLANE.replace({"load.amplitude": 0.4})
    jb.solve(scene, throw=False)
    again = jb.solve(scene.replace({"contact.friction": 0.2, "load.amplitude": 0.9}), throw=False)
    values = {"contact.friction": 0.2, "load.amplitude": 0.9}
    ask = jb.response(PLANE, list(values))
    fresh = float(ask(*values.values())["dissipation"])
    assert float(again.dissipation) == pytest.approx(fresh, rel=1e-9)
    assert again.scene.contact.friction == 0.2
    np.testing.assert_allclose(np.max(np.asarray(again.force)), 0.9)
