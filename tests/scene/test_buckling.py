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


def moments_at_the_contact(force, free, *, deflected, overhang=100.0, points=601):
    """Moments of a stepped column at both ends of the contact of two members of half height 5.

    They lap from 0 to 60 and touch from 15 to 45, where they bend as one that is eight times as
    stiff.  The pull acts 10 above the axis of the lower member and 5 above that of both.
    """
    first, last = -overhang, 60.0 + overhang
    x = np.linspace(first, last, points)
    step, touch = x[1] - x[0], (x > 15.0) & (x < 45.0)
    bending = np.where(touch, 8.0, 1.0) * 210e3 / (1.0 - 0.3**2) * 10.0**3 / 12.0
    arm = np.where(x <= 15.0, 10.0, np.where(touch, 5.0, 0.0))
    # B w'' = M with M = -F (arm + w(L) - w) + R (L - x), in the unknowns w and the reaction R.
    pulling = force if deflected else 0.0
    matrix, load = np.zeros((points + 1, points + 1)), np.zeros(points + 1)
    inner = np.arange(1, points - 1)
    for offset, part in ((-1, 1.0), (0, -2.0), (1, 1.0)):
        matrix[inner, inner + offset] += part / step**2
    matrix[inner, inner] -= pulling / bending[inner]
    matrix[inner, -2] += pulling / bending[inner]
    matrix[inner, -1] -= (last - x[inner]) / bending[inner]
    load[inner] = -force * arm[inner] / bending[inner]
    matrix[0, 0] = 1.0  # clamped
    matrix[-2, :2] = -1.0, 1.0
    matrix[-1, -1 if free else -2] = 1.0  # no reaction, or no deflection of the loaded end
    *w, reaction = np.linalg.solve(matrix, load)
    moment = -force * arm - pulling * (w[-1] - np.array(w)) + reaction * (last - x)
    return moment[[np.flatnonzero(touch)[0] - 1, np.flatnonzero(touch)[-1] + 1]]


@pytest.mark.parametrize(("end", "last"), [("level", 2), ("free", 1)])
@pytest.mark.parametrize("part", [0.02, 0.05])
def test_the_load_over_that_of_buckling_bounds_what_deflections_make_of_the_moments(
    end, last, part
):
    """Each way they change by less; over a cycle pull and push nearly cancel."""
    lap = jb.library.single_lap().replace(
        {"strip.length": 60.0, "strip.half_height": 5.0, "strip.youngs_modulus": 210e3}
        | {"contact.bolts": [[30.0, 1e6, 30.0]], "member.loaded_end": end, "load.entry": "member"}
        | {"strip.overhang": 100.0, "member.overhang": 100.0, "load.amplitude": 1.0}
    )
    force = part / sway(lap)
    assert sway(lap.replace({"load.amplitude": force})) == pytest.approx(part)
    changes = []
    for load in (force, -force):
        linear, exact = (
            moments_at_the_contact(load, end == "free", deflected=d)[:last] for d in (False, True)
        )
        changes.append(exact / linear - 1.0)  # the loaded end of a free joint has no moment
    assert 0.2 * part < np.max(np.abs(changes)) < part
    assert np.max(np.abs(np.mean(changes, axis=0))) < 0.1 * part
