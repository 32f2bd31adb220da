"""`jbeamshell ringdown` and `export`: JSON on stdout, whole files, errors of one line."""

import json

import numpy as np
import pytest

from jbeamshell.cli import main
from jbeamshell.dynamics import Joint

COARSE = ["--set", "model.nodes=11", "--set", "model.kinematics=linear", "--cycles", "8"]
WHOLE = [*COARSE, "--strip", "whole"]
# The strip and the pull of dynamics/test_let_go.
PLANE = ["--set", "model.section=plane", "--set", "model.nodes=33", "--set", "load.entry=traction"]
PLANE += ["--cycles", "12"]


@pytest.mark.parametrize(
    "words",
    [pytest.param(WHOLE, marks=pytest.mark.slow, id="whole"), pytest.param(PLANE, id="sliders")],
)
def test_it_reports_and_writes_what_it_says(capsys, tmp_path, words):
    folder = tmp_path / "out"
    code = main.main(["ringdown", *words, "--json", "--out", str(folder), "--force", "1"])
    out, err = capsys.readouterr()
    assert code == 0
    figures = json.loads(out)
    assert figures["strip"] == ("network of sliders" if words is PLANE else "whole")
    assert figures["complete"] is True
    assert len(figures["amplitude"]) == len(figures["predicted_damping"]) > 8
    assert figures["frequency"][-1] == pytest.approx(figures["predicted_frequency"][-1], rel=0.02)
    names = {"motion.csv", "ringdown.csv", "result.json", "scene.toml", "ringdown.png"}
    assert {path.name for path in folder.iterdir()} == names
    assert "wrote" in err
    table = np.genfromtxt(folder / "motion.csv", delimiter=",", names=True)
    assert table["displacement"][0] == pytest.approx(figures["largest_displacement"])
    assert json.loads((folder / "result.json").read_text()) == figures
    table = np.genfromtxt(folder / "ringdown.csv", delimiter=",", names=True)
    for name in ("frequency", "damping"):
        low, high = table[f"{name}_low"], table[f"{name}_high"]
        assert np.all((low < table[name]) & (table[name] < high))
        assert low == pytest.approx(figures[f"{name}_low"])
        assert np.all(high - low < table[name].max())


BOLTED = [*PLANE[:4], "--cycles", "8", "--set", "contact.bolts=[[0.5, 0.5, 0.3]]"]


@pytest.mark.slow
def test_a_bolted_strip_is_pulled_below_gross_slip(capsys):
    driven = ["--set", "load.control=displacement", "--set", "load.amplitude=1e-6"]
    for words in (BOLTED, [*BOLTED, *driven]):
        assert main.main(["ringdown", *words, "--json"]) == 0
        out, err = capsys.readouterr()
        assert "gross slip, 0.05: the mass is pulled with half of it" in err
        figures = json.loads(out)
        assert figures["largest_displacement"] == pytest.approx(1.12e-6, rel=0.05)
        assert 0.0 < figures["damping"][-1] < figures["damping"][0] < 0.01
    assert main.main(["ringdown", *BOLTED, "--force", "0.08"]) == 2
    err = capsys.readouterr().err
    assert "force = 0.08: must stay below gross slip" in err
    half = err.split()[-1]
    assert main.main(["ringdown", *BOLTED, "--force", half, "--json"]) == 0


@pytest.mark.slow
def test_a_lap_joint_rings_down_by_its_sliders(capsys):
    coarse = ["ringdown", "single-lap", "--set", "model.nodes=33", "--cycles", "8"]
    assert main.main(coarse) == 0
    text = capsys.readouterr().out
    assert main.main([*coarse, "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    ends = (figures[f"damping_{end}"][0] for end in ("low", "high"))
    half = -0.5 * np.subtract(*ends)
    assert f"{figures['damping'][0]:.5g} +- {half:.2g} " in text
    assert "half of the 95 % interval" in text
    assert figures["damping"][-1] == pytest.approx(figures["predicted_damping"][-1], rel=0.1)
    assert main.main(["ringdown", "single-lap", "--strip", "whole"]) == 2
    assert "--strip auto" in capsys.readouterr().err


def test_export_writes_a_joint(cli, tmp_path):
    path, scene = tmp_path / "joint.csv", tmp_path / "wide.toml"
    scene.write_text(
        "[strip]\nwidth = 1.5\naxial_stiffness = 1e6\n[load]\nentry = 'traction'\n", "utf-8"
    )
    words = ["--units", "mm, N", "--force", "1.8", "--out", path]
    code, out, err = cli("export", scene, *PLANE[:6], "--to", "table", *words)
    assert (code, out) == (0, "")
    assert err == f"wrote {path}\n"
    assert "u in mm, F in N" in path.read_text()
    joint = Joint.read(path)
    assert float(joint.forces[-1]) == pytest.approx(1.8)
    assert float(joint.width) == 1.5
