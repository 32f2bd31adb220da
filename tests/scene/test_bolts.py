"""Bolts from size, class and torque: published preloads, proof loads and patches."""

import math

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.scene.bolts import PROOF, SIZES

# Size, friction, preload [kN] and torque [N m] of class 8.8 at 90 % of its yield point, as VDI 2230
# (2001, 2003) tabulates them with three digits.
VDI = [
    ("M8", 0.12, 18.6, 24.6),
    ("M8x1", 0.10, 20.7, 22.8),
    ("M8x1", 0.12, 20.2, 26.1),
    ("M8x1", 0.14, 19.7, 29.2),
    ("M10x1.25", 0.12, 31.6, 51.0),
    ("M12x1.25", 0.12, 48.0, 90.0),
    ("M16x1.5", 0.12, 87.6, 218.0),
    ("M20x1.5", 0.12, 148.0, 454.0),
    ("M24x2", 0.14, 204.0, 865.0),
]


@pytest.mark.parametrize(("size", "friction", "force", "torque"), VDI)
def test_torques_are_those_of_published_tables(size, friction, force, torque):
    bolt = jb.Bolt(size, "12.9", torque=f"{torque} N m", friction=friction)
    assert bolt.preload == pytest.approx(1e3 * force, rel=0.01)


def test_the_bolt_of_the_command_line():
    bolt = jb.Bolt("M8", "8.8", torque="25 N m")
    assert bolt.stress_area == pytest.approx(36.6, rel=2e-3)
    assert bolt.proof_load == pytest.approx(21.2e3, rel=3e-3)
    assert bolt.preload == pytest.approx(19.0e3, rel=2e-3)
    low, high = bolt.interval
    assert high / low == pytest.approx(1.6)
    assert 0.5 * (low + high) == pytest.approx(bolt.preload)
    assert str(bolt) == ("M8 of class 8.8: preload 19.01 kN, 14.6 to 23.4 kN by the tightening")
    assert jb.Bolt("M8", proof=0.75).preload == pytest.approx(0.75 * bolt.proof_load)
    assert jb.Bolt("M8", force="8 kN", tightening=1.0).interval == (8e3, 8e3)
    assert jb.Bolt("M8", torque=25.0).preload == bolt.preload


@pytest.mark.parametrize("diameter", SIZES)
def test_stress_areas_rise_and_heads_cover_holes(diameter):
    bolt = jb.Bolt(f"M{diameter}", proof=0.5)
    size = SIZES[diameter]
    assert diameter < size.hole < size.head < 2.0 * diameter
    assert 0.55 < bolt.stress_area / (0.25 * math.pi * diameter**2) < 0.85
    assert bolt.bearing < bolt.patch < 1.4 * bolt.bearing


def test_rows_press_a_scene_with_their_force():
    bolt = jb.Bolt("M8", torque="25 N m")
    joint = {
        "strip.length": 100.0,
        "strip.width": 60.0,
        "strip.half_height": 4.0,
        "strip.youngs_modulus": 210e3,
        "strip.far_end": "free",
        "member.support": "clamped",
        "contact.friction": 0.2,
        "contact.bolts": bolt.rows([30.0, 70.0]),
        "load.amplitude": 4000.0,
    }
    scene = jb.Scene().replace(joint)
    assert float(scene.gross_slip) == pytest.approx(2.0 * 0.2 * bolt.preload)
    np.testing.assert_allclose(bolt.rows([0.03], "m")[0], [0.03, bolt.preload, 1e-3 * bolt.patch])


BAD = {
    "bolt = 'M7': give M3, M4": {"size": "M7", "torque": 1.0},
    "bolt = 8: give M3": {"size": 8, "torque": 1.0},
    "grade = '8': choose 4.6": {"grade": "8", "torque": 1.0},
    r"torque = '40 N m': loads M8 of class 8.8 to 30.4 kN, beyond its proof load of 21.2 kN: take "
    "27.9 N m or less": {"torque": "40 N m"},
    "preload = '30 kN': loads M8 of class 8.8 to 30 kN": {"force": "30 kN"},
    "torque = '25': names no unit: write one, such as 25 N m": {"torque": "25"},
    "torque = '25 kg': 'kg' is no unit that N m measures": {"torque": "25 kg"},
    "give one of torque, such as 25 N m": {},
    "proof = 1.2: must be a part of the proof load": {"proof": 1.2},
    "tightening = 0.9: is the largest preload over": {"torque": 25.0, "tightening": 0.9},
    "hole = 12.0: must be smaller than the head": {"torque": 25.0, "hole": "12 mm"},
}


@pytest.mark.parametrize("message", BAD)
def test_impossible_bolts_are_refused_with_the_fix(message):
    with pytest.raises(jb.InputError) as caught:
        jb.Bolt(**BAD[message])
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_proof_stresses_rise_with_the_class():
    steels = [PROOF[grade][0] for grade in ("4.6", "5.6", "8.8", "10.9", "12.9")]
    assert steels == sorted(steels)
