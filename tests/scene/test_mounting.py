"""Mounting of a lap joint: the words that say how it is held and loaded, and what is left open."""

import jax
import pytest
from scenes import FEW, PLANE

import jbeamshell as jb
from jbeamshell.scene.mounting import in_words, left_open

BOTH = {"member.overhang": 0.5, "strip.overhang": 1.5}


def lap(**values):
    named = {key.replace("__", "."): value for key, value in values.items()}
    return jb.library.single_lap().replace({"load.entry": "member"} | named)


def test_a_strip_on_a_base_has_no_mounting():
    assert in_words(jb.Scene()) == ""
    assert "mounting" not in jb.solve(PLANE).figures()


def test_one_line_says_supports_overhangs_and_the_loaded_end():
    assert in_words(lap()) == (
        "single lap: held 2 H before X = 0, with no member.overhang, loaded 2 H beyond X = L, with "
        "no strip.overhang (load.entry = member); the loaded end keeps its height "
        "(member.loaded_end = level) and may turn; overhangs change what it loses"
    )
    assert in_words(lap(member__loaded_end="free").replace(BOTH)) == (
        "single lap: held at the end of member.overhang = 0.5, loaded at the end of "
        "strip.overhang = 1.5 (load.entry = member); the loaded end may deflect "
        "(member.loaded_end = free) and may turn"
    )
    guided = in_words(lap(load__entry="guided"))
    assert guided.startswith("single lap: held at X = 0, loaded at X = L (load.entry = guided); ")
    assert guided.endswith("does not turn")
    double = in_words(jb.library.double_shear())
    assert double.startswith("double shear, its middle on a symmetry plane: held at X = 0")


def test_numbers_that_vary_or_are_traced_have_no_size():
    scene = lap().replace(BOTH)
    assert "at the end of strip.overhang = varied" in in_words(scene, ["strip.overhang"])
    found = []

    @jax.jit
    def traced(length):
        found.append(in_words(scene.replace({"strip.overhang": length})))
        return length

    traced(1.0)
    assert "strip.overhang = traced" in found[0]


@pytest.mark.parametrize(
    ("values", "keys"),
    [
        ({}, ("member.overhang", "strip.overhang")),
        ({"strip.overhang": 1.0}, ("member.overhang",)),
        (BOTH, ()),
        ({"member.loaded_end": "free"}, ()),
        ({"load.entry": "traction"}, ()),
        ({"load.cycles": 0}, ()),
    ],
)
def test_a_single_lap_that_goes_on_leaves_its_overhangs_open(values, keys):
    assert left_open(lap().replace(values)) == keys


@pytest.mark.doubtful("few nodes", "lanes may be off")
def test_every_print_of_a_joint_says_it(tmp_path):
    scene = jb.library.single_lap().replace(FEW)
    line = in_words(scene)
    history = jb.solve(scene, throw=False)
    assert line in str(scene)
    assert line in str(history)
    assert history.figures()["mounting"] == line
    assert line in str(jb.advise(scene))
    assert jb.advise(scene).figures()["mounting"] == line
    joint = jb.dynamics.Joint.of(scene)
    for one in (joint, joint.in_series(1e5)):
        assert line in str(one)
        path = one.export("table", tmp_path / "joint.csv")
        assert f"# Mounting: {line}.\n" in path.read_text("utf-8")
    swept = jb.sweep(scene, {"load.amplitude": [0.5, 0.6]}, ["secant_stiffness"])
    assert swept.attrs["mounting"] == line
    title = jb.plotting.sweep_sheet(swept)._suptitle
    assert title.get_text() == line
