"""A fit of a scene with a width: forces of the data are totals, as measured."""

import json

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.cli.main import main
from jbeamshell.measured.loops import Loop

STRIP = {
    "strip.length": 120.0,
    "strip.width": 50.0,
    "strip.half_height": 6.0,
    "strip.youngs_modulus": 210e3,
    "contact.friction": 0.2,
    "contact.pressure": 10.0,
    "load.amplitude": 7000.0,
}


def loop(scene):
    history = jb.solve(scene)
    force, displacement = map(np.asarray, history.loop)
    return Loop(force, displacement, label="total")


def test_totals_are_fitted_as_they_were_measured():
    truth = jb.Scene().replace(STRIP)
    data = loop(truth)
    assert np.max(data.force) == pytest.approx(7000.0)
    start = truth.replace({"contact.friction": 0.26})
    fit = jb.fit(data, start, ["contact.friction"])
    assert float(fit.scene.contact.friction) == pytest.approx(0.2, rel=0.01)
    assert float(fit.scene.strip.width) == 50.0


LENGTHS = ["--length", "120mm", "--thickness", "12mm", "--modulus", "210GPa", "--pressure", "10MPa"]


def written(folder, data, unit):
    """File of a loop, whose force is in N or per width in N/mm."""
    force = data.force / (50.0 if unit == "N/mm" else 1.0)
    rows = zip(force.tolist(), data.displacement.tolist(), strict=True)
    text = [f"force [{unit}],displacement [mm]", *(f"{f!r},{u!r}" for f, u in rows)]
    (folder / "rig.csv").write_text("\n".join(text), "utf-8")
    return str(folder / "rig.csv")


@pytest.mark.parametrize("unit", ["N", "N/mm"])
def test_what_is_fitted_with_a_width_is_what_is_run_with_it(tmp_path, capsys, unit):
    # The same words give the same joint: free sides, so plane stress, and totals.
    file, specimen = written(tmp_path, loop(jb.Scene().replace(STRIP)), unit), [*LENGTHS, "--width"]
    asked = [*specimen, "50mm", "--free", "contact.friction", "--set", "load.entry=member"]
    assert main(["fit", file, *asked, "--json"]) == 0
    friction = json.loads(capsys.readouterr().out)["values"]["contact.friction"]["value"]
    assert friction == pytest.approx(0.2, rel=2e-3)
    run = ["run", *specimen, "50mm", "--friction", str(friction), "--force", "7kN", "--json"]
    assert main(run) == 0
    ran = json.loads(capsys.readouterr().out)
    assert ran["dissipation"] == pytest.approx(
        1e-3 * loop(jb.Scene().replace(STRIP)).work, rel=0.01
    )


def test_totals_of_a_specimen_without_a_width_are_refused(tmp_path, capsys):
    file = written(tmp_path, loop(jb.Scene().replace(STRIP)), "N")
    assert main(["fit", file, *LENGTHS]) == 2
    assert "is a total, but the specimen has no width: give --width" in capsys.readouterr().err


def test_a_width_beside_data_with_units_is_in_metres(tmp_path, capsys):
    file = written(tmp_path, loop(jb.Scene().replace(STRIP)), "N")
    assert main(["fit", str(file), "--width", "50"]) == 2
    assert "it is in metres: give 0.05, or --width 50mm" in capsys.readouterr().err


def test_a_width_refuses_forces_of_a_scene_per_width(tmp_path):
    file = written(tmp_path, loop(jb.Scene().replace(STRIP)), "N")
    values = {"strip.axial_stiffness": 2.5e9, "strip.length": 0.12}
    specimen = jb.identify.Specimen(values, file, set={"strip.width": 0.05})
    with pytest.raises(
        jb.InputError, match=r"axial_stiffness = 2500000000.0: is per unit of width in"
    ):
        jb.fit(specimen)


def test_curves_are_totals_of_a_width(tmp_path):
    table = "amplitude [{}],dissipation [{}]\n1,2\n2,9\n"
    found = []
    for units, width in (("N", "mJ"), 0.05), (("N/mm", "mJ/mm"), 0.05), (("N/mm", "mJ/mm"), None):
        (tmp_path / "work.csv").write_text(table.format(*units), "utf-8")
        ((curve, _),) = jb.measured.read_curves(tmp_path / "work.csv", "dissipation", width=width)
        found.append([curve.amplitude[0], curve.dissipation[0]])
    np.testing.assert_allclose(found, [[1.0, 2e-3], [50.0, 0.1], [1e3, 2.0]], rtol=1e-12)
