"""Dimensions with units become a scene in SI; bolts keep their force, wherever they lie."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import jbeamshell as jb
from jbeamshell.cli.main import main
from jbeamshell.common.errors import InputError
from jbeamshell.scene.dimensions import dimensions_of
from jbeamshell.scene.pressure import check_pressure, face_resultant
from jbeamshell.scene.toml import scene_from_values

STRIP = {"length": "120 mm", "thickness": "12mm", "width": "50mm", "modulus": "210 GPa"}


def table(**further):
    """Pressure rows of the strip with bolts."""
    return np.array(scene_from_values(dimensions_of(STRIP | further).values).contact.pressure)


def test_dimensions_are_converted_to_si():
    known = dimensions_of(STRIP | {"poisson": "0.3", "pressure": "2 N/mm^2"})
    assert known.values == pytest.approx(
        {
            "strip.length": 0.12,
            "strip.width": 0.05,
            "strip.half_height": 0.006,
            "strip.youngs_modulus": 210e9,
            "strip.poisson_ratio": 0.3,
            "contact.pressure": 2e6,
        }
    )
    assert known.width == pytest.approx(0.05)
    inches = dimensions_of({"length": "5 in", "modulus": "30e6 psi", "poisson": 0.3})
    assert inches.values["strip.length"] == pytest.approx(0.127)
    assert inches.values["strip.youngs_modulus"] == pytest.approx(206.84e9, rel=1e-4)
    scene = scene_from_values(known.values)  # free sides: in plane stress
    assert float(scene.get("strip.axial_stiffness")) == pytest.approx(210e9 * 0.012 * 0.05)


def test_a_bolt_presses_evenly_on_a_patch():
    pressure = table(bolts="8kN@60mm", head="13mm")
    reach = 0.5 * math.hypot(0.013, 0.00975)
    on = pressure[pressure[:, 1] > 0.0]
    np.testing.assert_allclose(on[:, 0], [0.06 - reach, 0.06 + reach])
    np.testing.assert_allclose(on[:, 1], 8e3 / 0.05 / (2.0 * reach))


@given(
    st.lists(st.floats(1.0, 119.0), min_size=1, max_size=5),
    st.floats(0.5, 40.0),
    st.floats(5.0, 60.0),
)
def test_bolts_keep_their_force_where_patches_overlap_or_end(places, force, head):
    where = ",".join(f"{place!r}mm" for place in places)
    pressure = table(bolts=f"{len(places)}x{force!r}kN@{where}", head=f"{head!r} mm")
    check_pressure("contact.pressure", pressure)
    total, moment = face_resultant(pressure, 0.12)
    assert total == pytest.approx(len(places) * force * 1e3 / 0.05)
    reach = 0.5e-3 * head * math.hypot(1.0, 0.75)
    centres = [
        0.5 * (max(1e-3 * place - reach, 0.0) + min(1e-3 * place + reach, 0.12)) for place in places
    ]
    assert moment == pytest.approx(force * 1e3 / 0.05 * sum(centres))


def test_kinds_of_bolts_add_up_and_a_usual_head_is_told():
    both = table(bolts="2x8kN@30mm,90mm; 20 kN @ 60 mm")
    total, _ = face_resultant(both, 0.12)
    assert total == pytest.approx(36e3 / 0.05)
    np.testing.assert_array_equal(both, table(bolts=["2x8kN@30mm,90mm", "20 kN @ 60 mm"]))
    known = dimensions_of(STRIP | {"bolts": "2x8kN@30mm,90mm"})
    large, small = (jb.Bolt(size, proof=0.75).preload for size in ("M6", "M5"))
    assert large > 8e3 > small
    assert known.notes[0] == (
        "bolts 2x8kN@30mm,90mm: a head of 8.88 mm is taken, that of the smallest 8.8 bolt for this "
        "preload: give head to change it"
    )


@pytest.mark.parametrize(
    ("bolts", "width", "doubted"),
    [
        ("2xM8@30mm,90mm", "30mm", False),
        ("2xM8@30mm,90mm", "60mm", True),
        ("4xM8@30mm,30mm,90mm,90mm", "60mm", False),
    ],
)
def test_plates_that_are_wider_than_their_bolts_clamp_are_doubted(bolts, width, doubted):
    known = dimensions_of(STRIP | {"bolts": bolts, "torque": "25Nm", "width": width})
    told = [note for note in known.notes if note.startswith("doubtful: ")]
    assert bool(told) == doubted
    assert all("1 side by side at X = 30 mm clamp some 44 mm of plates 60 mm" in t for t in told)


BAD = {
    "length = 120: names no unit: write one, such as 120mm": {"length": 120},
    "length = '120': names no unit": {"length": "120"},
    "length = '120 mmm': 'mmm' is no unit that m measures": {"length": "120 mmm"},
    "length = '120 kN': 'kN' is no unit": {"length": "120 kN"},
    "modulus = 'steel': is no number with a unit": {"modulus": "steel"},
    "length = '-3 mm': must be positive": {"length": "-3 mm"},
    "poisson = 'a third': give a number": {"poisson": "a third"},
    "'lenght': is no dimension; known are length, thickness": {"lenght": "1 m"},
    "X = 130 mm lies off the strip of 120 mm": STRIP | {"bolts": "8kN@130mm"},
    "2 bolts have 1 positions": STRIP | {"bolts": "2x8kN@30mm"},
    "bolts: position = '30': names no unit": STRIP | {"bolts": "2x8kN@30,90mm"},
    "bolts: preload = '8': names no unit": STRIP | {"bolts": "2x8@30mm,90mm"},
    "write number, preload and positions": STRIP | {"bolts": "8kN"},
    "give either bolts or a pressure": STRIP | {"bolts": "8kN@30mm", "pressure": "1MPa"},
    "their pressure needs width: give it": {"length": "1m", "thickness": "1cm", "bolts": "8kN@3mm"},
    "no bolt up to M36 carries that": STRIP | {"bolts": "900kN@30mm"},
    "belongs to bolts": STRIP | {"head": "13mm"},
}


@pytest.mark.parametrize("message", BAD)
def test_bad_dimensions_are_refused_with_the_fix(message):
    with pytest.raises(InputError) as caught:
        dimensions_of(BAD[message])
    assert message in str(caught.value)


def test_a_plan_and_the_command_take_dimensions(tmp_path, capsys):
    rows = ["force [kN],displacement [um]"]
    phase = np.linspace(0.0, 2.0 * np.pi, 81)
    rows += [f"{4.0 * np.cos(p)},{3.0 * np.cos(p - 0.2)}" for p in phase]
    (tmp_path / "rig.csv").write_text("\n".join(rows), "utf-8")
    entries = [f'{name} = "{text}"' for name, text in STRIP.items()]
    entries.append('bolts = "2x8kN@30mm,90mm"')
    (tmp_path / "strip.toml").write_text("\n".join(entries), "utf-8")
    for entry in (f"{{ {', '.join(entries)} }}", "'strip.toml'"):
        text = f"[free.'contact.friction']\n[[specimen]]\ndata=['rig.csv']\ndimensions = {entry}\n"
        (tmp_path / "plan.toml").write_text(text, "utf-8")
        plan = jb.identify.read_plan(tmp_path / "plan.toml")
        (case,) = plan.cases
        assert float(case.model.own.strip.length) == pytest.approx(0.12)
        (loop,) = case.measurements
        assert np.max(loop.force) == pytest.approx(4e3, rel=0.01)
        assert loop.units["force"] == "N"
        assert any("head of 8.88 mm" in note for note in plan.notes)
    data = str(tmp_path / "rig.csv")
    assert main(["fit", data, "--specimen", str(tmp_path / "strip.toml"), "--length", "12"]) == 2
    assert "length = '12': names no unit" in capsys.readouterr().err
    (tmp_path / "rig.csv").write_text("\n".join(["force,displacement", *rows[1:]]), "utf-8")
    assert main(["fit", data, "--length", "120mm"]) == 2
    assert "its columns name no units" in capsys.readouterr().err
    assert main(["fit", data, "--width", "50 apples"]) == 2
    assert "'apples' is no unit" in capsys.readouterr().err
