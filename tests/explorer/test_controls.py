"""Controls: which numbers a scene's sliders move, in which ranges, and the scene that they make."""

import math

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.explorer.controls import FACTOR, bolts_of, controls_of, largest_force, scene_at
from jbeamshell.scene import library


def names_of(scene):
    return [control.name for control in controls_of(scene)]


def test_a_strip_has_five_sliders_and_a_joint_its_bolts():
    strip = ["strip.height_ratio", "contact.friction", "load.amplitude"]
    strip += ["contact.pressure", "strip.poisson_ratio"]
    assert names_of(jb.Scene()) == strip
    joint = names_of(library.single_lap())
    assert {"member.height_ratio", "bolt 1 force", "bolt 1 place"} < set(joint)
    assert "contact.pressure" not in joint


def test_a_width_has_a_slider_which_spreads_the_same_force():
    scene = jb.Scene().of_width(60.0)
    (width,) = (control for control in controls_of(scene) if control.name == "strip.width")
    assert width.value == pytest.approx(60.0)
    wider = scene_at(scene, {"strip.width": 120.0})
    assert float(wider.get("load.amplitude")) == pytest.approx(float(scene.get("load.amplitude")))
    assert largest_force(wider) == pytest.approx(2.0 * largest_force(scene))


def test_a_scene_that_is_only_pressed_has_no_load_and_layers_no_height():
    assert names_of(library.receding()) == ["strip.half_height", FACTOR, "strip.poisson_ratio"]
    assert names_of(library.bimaterial()) == ["contact.pressure"]


@pytest.mark.parametrize("name", library.NAMES)
def test_ranges_hold_the_scene_and_their_ends_are_scenes(name):
    scene = library.named(name)
    for control in controls_of(scene):
        assert control.low <= control.value <= control.high
        assert 90 <= (control.high - control.low) / control.step <= 500
        for end in (control.low, control.high):
            scene_at(scene, {control.name: end})


def test_the_slider_of_a_force_ends_below_gross_slip():
    load = next(c for c in controls_of(jb.Scene()) if c.name == "load.amplitude")
    assert largest_force(jb.Scene()) == pytest.approx(2.0)
    assert 1.9 < load.high < 2.0
    held = library.single_lap().replace({"member.bolt_stiffness": 10.0})
    assert math.isinf(largest_force(held))
    by_length = {"load.control": "displacement", "load.amplitude": 1e-5}
    load = next(c for c in controls_of(jb.Scene().replace(by_length)) if "A" in c.label)
    assert load.label == "Load amplitude A [length]"
    assert load.high == pytest.approx(4e-5)


def test_a_bolt_keeps_its_width_where_it_goes_and_presses_both_faces():
    scene = library.single_lap()
    moved = scene_at(scene, {"bolt 1 place": 0.8, "bolt 1 force": 30.0})
    assert bolts_of(moved)[0] == pytest.approx([0.8, 30.0, 0.5])
    both = moved.contact.pressure, moved.contact.bottom_pressure
    assert np.array_equal(*both)
    assert bolts_of(scene)[0] == pytest.approx([1.0, 20.0, 0.5])


@pytest.mark.parametrize("stiffness", ["strip.youngs_modulus", "strip.axial_stiffness"])
def test_the_slider_of_the_height_keeps_the_stiffness_and_the_form_that_were_given(stiffness):
    """Young's modulus and H were given: E stays, and the slider moves H."""
    given = {"strip.length": 120.0, "strip.half_height": 6.0, stiffness: 2e6}
    scene = jb.Scene().replace(given | {"load.amplitude": 100.0})
    height = controls_of(scene)[0]
    assert (height.name, height.value) == ("strip.half_height", pytest.approx(6.0))
    moved = scene_at(scene, {height.name: 9.0})
    assert float(moved.get(stiffness)) == 2e6
    assert moved.strip.said == {"strip.half_height", stiffness}
    longer = moved.replace({"strip.length": 240.0})
    assert float(longer.strip.half_height) == 9.0


def test_pressures_in_tables_have_a_factor():
    scene = library.receding_rough()
    twice = scene_at(scene, {FACTOR: 2.0})
    assert np.array_equal(twice.contact.pressure[:, 0], scene.contact.pressure[:, 0])
    assert largest_force(twice) == pytest.approx(2.0 * largest_force(scene))


def test_numbers_outside_their_domain_are_refused_by_name():
    with pytest.raises(jb.InputError, match=r"strip\.poisson_ratio = 0\.6"):
        scene_at(jb.Scene(), {"strip.poisson_ratio": 0.6})
    with pytest.raises(jb.InputError, match="bolt 1 force: the scene has no bolts"):
        scene_at(jb.Scene(), {"bolt 1 force": 1.0})
