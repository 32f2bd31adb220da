"""Parts without pressure as columns: where they are, their Euler loads, the compression there."""

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.history.reliability import doubts_of_scene
from jbeamshell.scene.buckling import sway, unpressed_parts, weakest_column

SLENDER = (
    jb.Scene()
    .replace(
        {
            "strip.height_ratio": 0.003,
            "contact.friction": 0.3,
            "model.section": "squeeze",
        }
    )
    .by_load_steps()
)
OVERHANG = [[0, 30], [0.6, 30], [0.6, 0], [2, 0]]
GAP = [[0, 30], [0.6, 30], [0.6, 0], [1.8, 0], [1.8, 0.5], [2, 0.5]]
EULER = np.pi**2 * 34000.0 * 0.006**2 / 12.0  # pi^2 B, force times length squared


@pytest.mark.parametrize(
    ("pressure", "bottom", "parts"),
    [
        (30.0, 0.0, []),
        (OVERHANG, 0.0, [(0.6, np.inf)]),
        (GAP, 0.0, [(0.6, 1.8)]),
        ([[0, 0], [1, 0], [2, 30]], 0.0, [(-np.inf, 1.0)]),
        ([[0, 30], [0.6, 30], [0.6, 0.01], [2, 0.01]], 0.0, []),
        (30.0, [[0.5, 0], [0.5, 40], [0.8, 40], [0.8, 0]], [(0.5, 0.8)]),
    ],
)
def test_parts_that_no_pressure_holds_down(pressure, bottom, parts):
    values = {"contact.pressure": pressure, "contact.bottom_pressure": bottom}
    assert unpressed_parts(SLENDER.replace(values).contact) == parts


def test_a_thick_column_shears_too():
    """Engesser: the reciprocals of the loads of bending and of shear add up."""
    values = {"strip.height_ratio": 0.1, "contact.pressure": OVERHANG}
    limit = weakest_column(SLENDER.replace(values)).limit
    bending = np.pi**2 * 34000.0 * 0.2**2 / 12.0 / 4.0 / 1.4**2
    shear = 10.0 * 1.3 / (12.0 + 11.0 * 0.3) * 0.35 * 34000.0
    assert float(limit) == pytest.approx(1.0 / (1.0 / bending + 1.0 / shear), rel=1e-4)


def test_columns_are_clamped_by_pressures():
    overhang = weakest_column(SLENDER.replace({"contact.pressure": OVERHANG}))
    assert float(overhang.limit) == pytest.approx(EULER / 4.0 / 1.4**2, rel=1e-4)
    assert float(overhang.force) == pytest.approx(0.7855)
    gap = weakest_column(SLENDER.replace({"contact.pressure": GAP}))
    assert float(gap.limit) == pytest.approx(EULER * 4.0 / 1.2**2, rel=1e-3)
    assert float(gap.force) == pytest.approx(0.7855 - 0.3 * 0.1)  # less the friction beyond
    alone = SLENDER.replace({"contact.normal": "none", "load.amplitude": 0.01})
    assert float(weakest_column(alone).limit) == pytest.approx(EULER / 16.0, rel=1e-4)


def test_a_displacement_compresses_an_overhang_by_its_stiffness():
    u = {"load.control": "displacement", "load.amplitude": 1e-5, "contact.pressure": OVERHANG}
    assert float(weakest_column(SLENDER.replace(u)).force) == pytest.approx(34000 * 1e-5 / 1.4)


def test_two_equal_layers_buckle_as_one():
    half = [0.003, 34000.0 * (1.0 - 0.3**2) / 0.006, 0.3]
    pressed = SLENDER.replace({"contact.pressure": OVERHANG})
    layers = pressed.replace({"strip.layers": [half, half]})
    assert weakest_column(layers).limit == pytest.approx(float(weakest_column(pressed).limit))


def test_the_printed_bending_stiffness_buckles_sooner():
    pressed = SLENDER.replace({"contact.pressure": OVERHANG})
    printed = pressed.replace({"model.constants": "printed"})
    ratio = weakest_column(printed).limit / weakest_column(pressed).limit
    assert float(ratio) == pytest.approx(1.0 / 16.0, rel=1e-3)


@pytest.mark.slow
def test_exact_rotations_lose_equilibrium_at_the_euler_load_of_a_gap():
    scene = SLENDER.replace({"contact.pressure": GAP, "load.amplitude": 4.0, "model.nodes": 161})
    with pytest.warns(jb.DoubtfulWarning, match="from X = 0.6 to 1.8 may buckle"):
        jb.solve(scene.replace({"model.kinematics": "linear"}))
    with pytest.raises(jb.UnconvergedError, match=r"load -2\.8.*buckles at 2\.8"):
        jb.solve(scene.replace({"model.kinematics": "exact"}))


JOINT = {"strip.far_end": "free", "model.section": "squeeze", "strip.height_ratio": 0.003}


def test_overhangs_of_a_joint_are_columns():
    lap = jb.Scene().replace(JOINT | {"member.support": "rolling", "strip.overhang": 1.0})
    column = weakest_column(lap)
    assert (float(column.begin), float(column.end)) == (2.0, 3.0)
    assert float(column.limit) == pytest.approx(EULER / 4.0, rel=1e-3)
    level = weakest_column(lap.replace({"member.loaded_end": "level"}))
    assert float(level.limit) == pytest.approx(2.0457 * EULER, rel=1e-3)
    assert np.isinf(weakest_column(lap.replace({"strip.overhang": None})).limit)


def test_a_slender_single_lap_sways():
    values = {"member.support": "clamped", "contact.bottom_pressure": 10.0, "member.overhang": 0.5}
    lap = jb.Scene().replace(JOINT | values | {"load.amplitude": 0.1})
    assert sway(lap) == pytest.approx(0.1 / (EULER / 4.0 / 2.5**2), rel=1e-3)
    assert any("may buckle" in doubt for doubt in doubts_of_scene(lap))
    thick = lap.replace({"strip.height_ratio": 0.1})
    assert sway(thick) < 0.01
    assert not doubts_of_scene(thick)
    assert sway(lap.replace({"member.support": "rolling", "contact.bottom_pressure": 0.0})) == 0.0
