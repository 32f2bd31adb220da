"""A joint's width: its figures are the width times those of one unit of it, and so are slopes."""

import dataclasses
import json
from pathlib import Path

import jax
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.dynamics import Joint
from jbeamshell.scene.toml import scene_from_values
from jbeamshell.sweeping.lanes import lanes_of

WIDTH = 50.0
STRIP = {
    "strip.length": 120.0,
    "strip.half_height": 6.0,
    "strip.youngs_modulus": 210e3,
    "contact.friction": 0.2,
    "contact.pressure": 10.0,
    "load.amplitude": 120.0,
}
LAP = {
    "strip.length": 60.0,
    "strip.half_height": 5.0,
    "strip.youngs_modulus": 210e3,
    "strip.far_end": "free",
    "member.support": "clamped",
    "member.loaded_end": "level",
    "contact.friction": 0.2,
    "load.amplitude": 20.0,
    "load.entry": "traction",
    "model.nodes": 65,
}
STEPS = {"model.section": "squeeze", "model.by": "steps", "model.nodes": 41}
BOLTS = [[15.0, 100.0, 10.0], [45.0, 120.0, 10.0]]
TOTALS = ("dissipation", "dissipation_loop", "secant_stiffness")
SAME = ("loss_factor", "dissipation_ratio", "peak_displacement", "slip_length", "reaction_max")
SAME += ("closure", "dissipation_error", "squeeze_stress_max")


def bolts(factor):
    return [[x, factor * force, width] for x, force, width in BOLTS]


def per_unit(values):
    return jb.Scene().replace(values | {"strip.plane": "stress"})


def whole(values, width=WIDTH):
    return jb.Scene().replace(
        values | {"strip.width": width, "load.amplitude": width * values["load.amplitude"]}
    )


PAIRS = {
    "strip": (per_unit(STRIP), whole(STRIP), 1.0),
    "load steps": (
        per_unit(STRIP | STEPS),
        whole(STRIP | STEPS),
        1.0,
    ),
    "single lap": (
        per_unit(LAP | {"contact.bolts": bolts(1.0)}),
        whole(LAP | {"contact.bolts": bolts(WIDTH)}),
        1.0,
    ),
    "double lap": (
        per_unit(LAP | {"member.support": "rolling", "member.loaded_end": "free"}),
        jb.Scene()
        .replace(LAP | {"member.support": "rolling", "member.loaded_end": "free"})
        .of_width(WIDTH),
        2.0,  # both halves
    ),
}


@pytest.mark.doubtful("the dissipation may be off")
@pytest.mark.parametrize("name", PAIRS)
def test_totals_are_the_width_times_the_figures_of_one_unit(name):
    narrow, wide, halves = PAIRS[name]
    one, other = jb.solve(narrow), jb.solve(wide)
    for figure in TOTALS:
        ratio = float(getattr(other, figure)) / float(getattr(one, figure))
        assert ratio == pytest.approx(halves * WIDTH, rel=1e-12)
    for figure in SAME:
        a, b = (np.asarray(getattr(history, figure)) for history in (one, other))
        np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-14)
    assert float(other.force.max()) == pytest.approx(float(wide.get("load.amplitude")))
    assert float(wide.gross_slip) == pytest.approx(halves * WIDTH * float(narrow.gross_slip))
    imbalance = halves * WIDTH * np.asarray(one.energy_imbalance)
    scale = halves * WIDTH * float(np.max(np.abs(one.stored_energy)))
    np.testing.assert_allclose(other.energy_imbalance, imbalance, atol=1e-9 * scale)
    np.testing.assert_allclose(other.sections.e, WIDTH * np.asarray(one.sections.e), rtol=1e-9)
    assert "[force/length]" in str(other)
    assert "[force length]" in str(other)
    assert "[force/length]" not in str(one)


def test_a_width_alone_leaves_the_scene_and_its_totals():
    scene = whole(LAP | {"contact.bolts": bolts(WIDTH)})
    wider = scene.replace({"strip.width": 80.0})
    for key in ("load.amplitude", "contact.bolts", "strip.youngs_modulus"):
        np.testing.assert_allclose(wider.get(key), scene.get(key), rtol=1e-14)
    np.testing.assert_array_equal(wider.contact.pressure, wider.contact.bottom_pressure)
    assert float(wider.load.amplitude) == pytest.approx(20.0 * WIDTH / 80.0)
    again = scene.of_width(None).of_width(WIDTH)
    assert float(again.get("load.amplitude")) == pytest.approx(20.0 * WIDTH)
    assert scene.of_width(None).strip.plane == "strain"
    assert scene.strip.plane == "stress"
    assert scene.replace({"strip.plane": "strain"}).strip.plane == "strain"


@pytest.mark.doubtful("the dissipation may be off")
def test_slopes_by_the_width_are_exact():
    """With totals given, forces of one unit fall as 1/b; of a bolted joint D is as 1/b itself."""
    scene = whole(STRIP)

    def lost(width):
        return jb.solve(scene.replace({"strip.width": width})).dissipation

    def apart(of):
        return (of(WIDTH * (1.0 + 1e-5)) - of(WIDTH * (1.0 - 1e-5))) / (2e-5 * WIDTH)

    assert float(jax.grad(lost)(WIDTH)) == pytest.approx(float(apart(lost)), rel=1e-6)
    ask = jb.response(scene, ["strip.width"])
    slope = jax.grad(lambda width: ask(width)["dissipation"])(WIDTH)
    assert float(slope) == pytest.approx(float(apart(lost)), rel=1e-6)
    bolted = whole(LAP | {"contact.bolts": bolts(WIDTH)})
    one, other = (
        float(jb.solve(bolted.replace({"strip.width": width})).dissipation)
        for width in (WIDTH, 1.1 * WIDTH)
    )
    assert other == pytest.approx(one / 1.1, rel=1e-9)


def test_sweeps_over_the_width_are_the_same_runs():
    scene, widths = whole(STRIP), np.array([6.0, 40.0, 60.0])
    result = jb.sweep(scene, {"strip.width": widths}, ["dissipation", "secant_stiffness"])
    assert result["status"].values.tolist() == [4, 0, 0]  # the narrowest slides
    for lane, width in ((1, 40.0), (2, 60.0)):
        own = jb.solve(scene.replace({"strip.width": width}))
        found = float(result["dissipation"].values[lane])
        assert found == pytest.approx(float(own.dissipation), rel=5e-3)
    assert result["strip.width"].attrs["units"] == "length"
    assert result["dissipation"].attrs["units"] == "force length"
    bolted = whole(LAP | {"contact.bolts": bolts(WIDTH)})
    lanes = lanes_of(bolted, {"strip.width": [5.0, 50.0, 500.0]})
    assert not lanes.outside().any()  # bolts hold as much in all widths
    free = lanes_of(scene, {"load.amplitude": [6e3, 13e3]})
    assert free.outside().tolist() == [False, True]


def test_a_joint_has_the_scenes_width_alone():
    scene = jb.Scene().replace({"model.section": "plane", "model.nodes": 33})
    one = Joint.of(scene, 1.2)
    wide = Joint.of(scene.replace({"strip.plane": "strain"}).of_width(30.0), 36.0)
    np.testing.assert_allclose(wide.forces, 30.0 * one.forces, rtol=1e-9)
    np.testing.assert_allclose(wide.displacements, one.displacements, rtol=1e-6)
    assert float(wide.capacity) == pytest.approx(60.0)
    u = np.array([0.5, -0.3]) * float(one.displacements[-1])
    np.testing.assert_allclose(wide.path_forces(u), 30.0 * one.path_forces(u), rtol=1e-6)
    np.testing.assert_allclose(one.times(30.0).path_forces(u), wide.path_forces(u), rtol=1e-6)
    assert "30, forces are totals" in str(wide)
    assert "1, forces per unit of width" in str(one)


def test_free_sides_are_as_in_three_dimensions():
    """Bricks of calibration/finite_elements/sides.json, as wide as one thickness to as long."""
    record = Path(__file__).parents[2] / "calibration" / "finite_elements" / "sides.json"
    rows = json.loads(record.read_text("utf-8"))["rows"]
    for row in rows:
        if row["sides"] != "free" or row["load"] != 0.6:
            continue
        width = 6.0 * row["width"]
        scene = jb.Scene().replace(
            {
                "strip.length": 60.0,
                "strip.width": width,
                "strip.half_height": 3.0,
                "strip.youngs_modulus": 210e3,
                "contact.friction": 0.2,
                "contact.pressure": 10.0,
                "load.entry": "traction",
                "load.amplitude": 0.6 * 120.0 * width,
            }
        )
        history = jb.solve(scene)
        assert float(history.dissipation) / width == pytest.approx(row["dissipation"], rel=0.01)
        if row["width"] < 10.0:  # as wide as long it is stiffer by 3 %
            stiffness = float(history.secant_stiffness) / width
            assert stiffness == pytest.approx(row["secant_stiffness"], rel=0.01)


def test_a_joint_wider_than_long_is_doubted():
    wide = whole(STRIP | {"strip.length": 120.0}, width=121.0)
    with pytest.warns(jb.DoubtfulWarning, match=r"wider \(strip.width = 121\).*plane = strain"):
        jb.solve(wide)
    assert not jb.solve(wide.replace({"strip.plane": "strain"})).doubts


REFUSED = {
    r"load.amplitude = 120.0: was per unit of width .* strip.width = 60: give it too, or": {
        "strip.width": 60.0
    },
    r"strip.width = 0.0: must be a positive number": {"strip.width": 0.0, "load.amplitude": 1.0},
    r"must stay below gross slip, mu F_N L = 12000": {
        "strip.width": 50.0,
        "load.amplitude": 12001.0,
    },
}


@pytest.mark.parametrize("message", REFUSED)
def test_a_width_beside_forces_per_width_is_refused(message):
    with pytest.raises(jb.InputError, match=message):
        jb.solve(jb.Scene().replace(STRIP).replace(REFUSED[message]))


def test_no_width_leaves_forces_to_be_said():
    with pytest.raises(jb.InputError, match=r"was a total .*of_width"):
        whole(STRIP).replace({"strip.width": None})


def test_files_hold_totals(tmp_path):
    scene = whole(LAP | {"contact.bolts": bolts(WIDTH)})
    text = jb.scene_to_toml(scene)
    for entry in ("amplitude = 1000.0", "5000.0", 'plane = "auto"'):
        assert entry in text
    jb.write_scene(scene, tmp_path / "joint.toml")
    again = jb.read_scene(tmp_path / "joint.toml")
    for one, other in zip(jax.tree.leaves(scene), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(one, other)
    history = jb.solve(whole(STRIP))
    history.save(tmp_path / "run.npz")
    read = jb.read_history(tmp_path / "run.npz")
    np.testing.assert_array_equal(read.force, history.force)
    np.testing.assert_array_equal(read.sections.e, history.sections.e)


def test_vibrations_refuse_a_width():
    with pytest.raises(jb.InputError, match=r"strip.width = 50.0: masses and forces"):
        jb.dynamics.let_go(whole(STRIP))


def test_defaults_are_totals_where_nobody_gave_a_force():
    scene = scene_from_values({"strip.width": 2.0})
    assert float(scene.get("load.amplitude")) == pytest.approx(0.7855)
    assert float(scene.get("strip.axial_stiffness")) == pytest.approx(3.4e4)
    assert dataclasses.replace(scene).strip.plane == "stress"
