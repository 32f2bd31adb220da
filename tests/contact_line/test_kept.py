"""Condensed strips that are kept for scenes that share them."""

import importlib

import jax
import numpy as np
import pytest
from scenes import FEW

import jbeamshell as jb
from jbeamshell.contact_line.kept import alike, alike_but_pressures, kept

PLANE = jb.Scene().replace(FEW | {"model.section": "plane"})
solving = importlib.import_module("jbeamshell.contact_line.solve")
LAP = {"strip.far_end": "free", "member.support": "rolling"}


@pytest.fixture
def counted():
    """Function that keeps what it builds, and the scenes that it built."""
    built = []

    def build(scene):
        built.append(scene)
        return scene

    return kept(build, alike), built


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


@pytest.mark.parametrize(
    ("key", "values", "builds"),
    [
        ("contact.pressure", [10.0, 9.0, 4.0], 1),
        ("contact.pressure", [[[0.0, 1.0], [2.0, 3.0]], [[0.0, 5.0], [2.0, 2.0]]], 1),
        ("contact.pressure", [[[0.0, 1.0], [2.0, 3.0]], [[0.5, 1.0], [2.0, 3.0]]], 2),
        ("contact.bolts", [[[0.6, 4.0, 0.3]], [[0.6, 9.0, 0.3]]], 1),
        ("contact.bolts", [[[0.6, 4.0, 0.3]], [[0.7, 4.0, 0.3]]], 2),
    ],
    ids=str,
)
def test_the_sizes_of_pressures_are_of_no_matter_to_what_is_condensed(key, values, builds):
    built = []
    found = kept(lambda scene: built.append(scene), alike_but_pressures)
    for value in values:
        found(PLANE.replace(LAP | {key: value}))
    assert len(built) == builds


@pytest.fixture
def fresh(monkeypatch):
    """Function that solves a scene as if none had been solved before."""

    def solved(scene):
        with monkeypatch.context() as patch:
            patch.setattr(solving, "unpressed_of", solving._unpressed)
            patch.setattr(solving, "strip_of", solving._strip_of)
            return jb.solve(scene, throw=False)

    return solved


def assert_same(again, fresh):
    for name in ("dissipation", "secant_stiffness"):
        assert float(getattr(again, name)) == pytest.approx(float(getattr(fresh, name)), rel=1e-9)


def test_a_bolts_force_gives_what_a_joint_that_was_never_seen_gives(fresh):
    joint = PLANE.replace(LAP | {"contact.bolts": [[0.6, 8.0, 0.4], [1.4, 8.0, 0.4]]})
    first = jb.solve(joint, throw=False)
    other = joint.replace({"contact.bolts": [[0.6, 12.0, 0.4], [1.4, 5.0, 0.4]]})
    again = jb.solve(other, throw=False)
    assert_same(again, fresh(other))
    assert float(again.dissipation) != float(first.dissipation)
    assert np.all(np.isfinite(again.fields[-1]))
    assert np.sum(again.load) == pytest.approx(17.0, rel=1e-12)


def test_other_sections_and_traced_scenes_are_built_each_time(counted):
    found, built = counted
    squeeze = PLANE.replace({"model.section": "squeeze", "model.kinematics": "linear"})
    found(squeeze)
    found(squeeze)

    def height(value):
        return found(PLANE.replace({"strip.height_ratio": value})).strip.height_ratio

    assert float(jax.grad(height)(0.1)) == 1.0
    assert len(built) == 3


def test_figures_are_those_of_a_strip_that_was_never_seen(fresh):
    jb.solve(PLANE.replace({"load.amplitude": 0.4}), throw=False)
    other = PLANE.replace({"contact.friction": 0.2, "load.amplitude": 0.9})
    again = jb.solve(other, throw=False)
    assert_same(again, fresh(other))
    assert again.scene.contact.friction == 0.2
    np.testing.assert_allclose(np.max(np.asarray(again.force)), 0.9)
