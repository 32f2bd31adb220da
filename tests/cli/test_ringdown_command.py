"""`jbeamshell ringdown`: JSON on stdout, whole files, errors of one line."""

import json

import numpy as np
import pytest

from jbeamshell.cli import main

COARSE = ["--set", "model.nodes=11", "--set", "model.kinematics=linear", "--cycles", "8"]
WHOLE = [*COARSE, "--strip", "whole"]
PLANE = ["--set", "model.rung=plane", "--set", "model.nodes=33", "--cycles", "8"]


@pytest.mark.parametrize(
    "words",
    [pytest.param(WHOLE, marks=pytest.mark.slow, id="whole"), pytest.param(PLANE, id="sliders")],
)
def test_it_reports_and_writes_what_it_says(capsys, tmp_path, words):
    folder = tmp_path / "out"
    code = main.main(["ringdown", *words, "--json", "--out", str(folder), "--force", "1.2"])
    out, err = capsys.readouterr()
    assert code == 0
    figures = json.loads(out)
    assert figures["strip"] == ("network of sliders" if words is PLANE else "whole")
    assert figures["status"] == "complete"
    assert len(figures["amplitude"]) == len(figures["predicted_damping"]) > 8
    assert figures["frequency"][-1] == pytest.approx(figures["predicted_frequency"][-1], rel=0.02)
    names = {"motion.csv", "ringdown.csv", "result.json", "scene.toml", "ringdown.png"}
    assert {path.name for path in folder.iterdir()} == names
    assert "wrote" in err
    table = np.genfromtxt(folder / "motion.csv", delimiter=",", names=True)
    assert table["displacement"][0] == pytest.approx(figures["largest_displacement"])
    assert json.loads((folder / "result.json").read_text()) == figures


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--density", "-1"], "inertia.density = -1.0"),
        (["--force", "5"], "gross slip"),
        (["--payload", "0"], "payload = 0.0"),
        (["--cycles", "0"], "cycles = 0.0"),
        (["--strip", "whole", "--set", "model.fields=v,w,beta,psi"], "compliant"),
        (["--strip", "sliders", "--set", "contact.smoothing=8"], "no network"),
    ],
)
def test_bad_input_is_one_line(capsys, tmp_path, words, complaint):
    code = main.main(["ringdown", *COARSE, *words, "--out", str(tmp_path / "out")])
    out, err = capsys.readouterr()
    assert code == 2
    assert out == ""
    assert complaint in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()
