"""Comparison of laws: the right one loses nothing, the others what they must."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import identify, laws, plotting
from jbeamshell.common.errors import InputError
from jbeamshell.identify.comparison import Compared, Comparison
from jbeamshell.measured.curves import DissipationCurve, StiffnessCurve
from jbeamshell.measured.loops import Loop

FORCE = np.linspace(0.2, 1.9, 7)
LAW = laws.Mindlin(2.0, 50.0)


def curves():
    """Curves of a law over the force amplitude."""
    size = np.asarray(LAW.displacement(FORCE))
    return [
        DissipationCurve(FORCE, np.asarray(LAW.dissipation(size))),
        StiffnessCurve(FORCE, np.asarray(LAW.secant_stiffness(size))),
    ]


@pytest.fixture(scope="module")
def made():
    """Comparison of two models, of which one was not fitted."""
    energy = FORCE**3
    right = Compared("right", None, 1.1 * energy, 0.02, 3e-5)
    wrong = Compared("wrong", None, np.full(7, np.nan), np.nan, np.nan, "has no loop")
    return Comparison(FORCE, energy, "force", (right, right, wrong))


@pytest.mark.slow
def test_the_planted_law_loses_nothing_and_another_does():
    compared = identify.compare(curves(), ["mindlin", "bar"])
    mindlin, bar = compared.rows
    np.testing.assert_allclose(compared.error(mindlin), 0.0, atol=1e-6)
    assert np.max(np.abs(compared.error(bar))) > 0.05
    assert (mindlin.numbers, bar.numbers) == (2, 2)
    assert mindlin.seconds > 0.0
    assert compared.drive == "force"
    figures = compared.figures()
    assert figures["models"]["mindlin"]["values"]["mindlin.slip_force"] == pytest.approx(2.0)


@pytest.mark.parametrize("driver", ["force", "displacement"])
def test_a_recording_is_compared_whatever_drives_it(driver, tmp_path):
    """Laws that follow displacements alone take part, and those with gross slip in the range."""
    law, way = laws.Iwan4(1.0, 1.0, -0.4, 0.5), np.sin(np.linspace(0.0, 12.0 * np.pi, 1800))
    if driver == "force":
        columns = [0.75 * way, np.asarray(law.path_displacements(0.75 * way))]
    else:
        columns = [np.asarray(law.path_forces(0.8 * way)), 0.8 * way]
    table = np.stack(columns, axis=1) + 1e-3 * np.random.default_rng(0).normal(size=(1800, 2))
    file = str(tmp_path / "rig.csv")
    np.savetxt(file, table, delimiter=",", header="force,displacement", comments="")
    found = identify.compare(file, ["jenkins", "bouc-wen"], starts=1)
    assert [row.told for row in found.rows] == ["", ""]
    jenkins, bouc_wen = (np.max(np.abs(found.error(row))) for row in found.rows)
    # A wrong law's error depends on the weights: samples count alike, most are near the turns.
    assert bouc_wen < 0.01 < jenkins < 0.2
    for name in ("jenkins", "bouc-wen"):  # by themselves too
        assert jb.fit(file, name, starts=1).controls == ["displacement"]


def test_what_a_law_cannot_answer_is_told_without_keys_of_strips():
    """Mean loops whose force drives know the noise of their displacement alone."""
    way = np.cos(np.linspace(0.0, 2.0 * np.pi, 65))
    loop = Loop(way, 0.1 * way + 0.01 * np.sin(np.arccos(way)), noise=1e-3, driver="force")
    dissipation = DissipationCurve(FORCE, FORCE**3)
    by_path = identify.compare([loop.but(noise=None), dissipation], ["bouc-wen"])
    for told in (identify.compare([loop], ["bouc-wen"]).rows[0].told, by_path.rows[0].told):
        assert "load.control" not in told
        assert "displacement" in told


def test_a_comparison_is_printed_and_recorded(made):
    rows = (made.rows[0], made.rows[2])
    lines = str(dataclasses.replace(made, rows=rows)).splitlines()
    assert lines[1].split() == ["right", "0", "2", "%", "10", "%", "10", "%", "30", "us"]
    assert lines[2].split() == ["wrong", "has", "no", "loop"]
    figures = dataclasses.replace(made, rows=rows).figures()["models"]
    assert figures["wrong"]["misfit"] is None
    assert figures["wrong"]["energy"] == [None] * 7
    assert json.dumps(figures, allow_nan=False)


def test_no_comparison_prints_nan(made):
    """A law whose energy is not known at some amplitudes, or at none, says so instead."""
    right, _, wrong = made.rows
    some = dataclasses.replace(
        right, energy=np.append(np.nan, right.energy[1:]), told="not converged"
    )
    text = str(dataclasses.replace(made, rows=(some, dataclasses.replace(wrong, told=""))))
    assert "nan" not in text
    lines = text.splitlines()
    assert lines[1].endswith("(not converged; no energy at 1 of 7 amplitudes)")
    assert lines[1].split()[4] == "10"
    assert lines[2].endswith("no energy at 7 of 7 amplitudes")


def test_a_comparison_is_drawn(made):
    fitted = dataclasses.replace(made.rows[1], fit=SimpleNamespace(values={"a": 1.0}))
    energies, errors = dataclasses.replace(made, rows=(made.rows[0], fitted, made.rows[2])).plot()
    texts = [text.get_text() for text in energies.get_legend().get_texts()]
    assert texts == ["right: 1 numbers, 30 us", "target"]
    np.testing.assert_allclose(errors.lines[0].get_ydata(), 10.0)
    plotting.close(energies.figure)


def test_bad_input_is_one_clear_line():
    data = curves()
    with pytest.raises(InputError, match=r"^models = \[\]: give a list of names or laws"):
        identify.compare(data, [])
    with pytest.raises(InputError, match=r"^amplitudes = \[1.0\]: are the target's own"):
        identify.compare(data, ["iwan4"], amplitudes=[1.0])
    with pytest.raises(InputError, match=r"^target: give closed loops, or a curve of dissipation"):
        identify.compare(data[1], ["iwan4"])
    unknown = identify.compare(data, ["iwan5"])
    assert "choose jenkins, iwan4" in unknown.rows[0].told
    assert "choose jenkins, iwan4" in str(unknown)


@pytest.mark.slow
def test_a_strip_is_compared_with_laws_of_its_own_cycles():
    found = identify.compare(
        jb.Scene(), ["sliders8", "jenkins"], amplitudes=np.linspace(0.2, 1.9, 9)
    )
    strip, sliders, jenkins = found.rows
    assert strip.name == "strip"
    assert np.median(np.abs(found.error(sliders))) < 0.05
    assert np.median(np.abs(found.error(jenkins))) > 0.2
