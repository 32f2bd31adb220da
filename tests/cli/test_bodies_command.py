"""`jbeamshell bodies` on a face: the lap that ships, to its loop and its backbone."""

import json
import shutil

import numpy as np
import pytest

from jbeamshell.cli.main import main
from jbeamshell.measured.example import data_folder


@pytest.fixture
def joint(tmp_path):
    """Copy of the lap that ships, of few load steps, and a way to change its file."""
    folder = tmp_path / "lap"
    shutil.copytree(data_folder() / "bolted_lap", folder)
    file = folder / "joint.toml"
    whole = file.read_text().replace("per_half_cycle = 16", "per_half_cycle = 8\ncycles = 1")

    def write(old="", new=""):
        assert old in whole
        file.write_text(whole.replace(old, new))
        return str(file)

    write()
    return write


@pytest.mark.slow
def test_a_face_has_a_loop_and_maps(joint, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["bodies", joint(), "--amplitude", "1000", "--json", "--out", str(out)]) == 0
    figures = json.loads(capsys.readouterr().out)
    names = {"loop.csv", "contact.csv", "result.json", "loop.png", "contact.png"}
    assert {path.name for path in out.iterdir()} == names
    loop = np.genfromtxt(out / "loop.csv", delimiter=",", names=True)
    last = loop[-17:]
    area = np.sum(0.5 * (last["force"][1:] + last["force"][:-1]) * np.diff(last["displacement"]))
    assert figures["dissipation"] == pytest.approx(abs(area), rel=0.02)
    face = np.genfromtxt(out / "contact.csv", delimiter=",", names=True)
    pressed = face[face["step"] == 0]
    assert len(pressed) == 288
    assert np.sum(pressed["tributary"]) == pytest.approx(1800.0)
    assert np.sum(pressed["normal_force"]) == pytest.approx(16e3)  # of both bolts


@pytest.mark.slow
def test_a_mode_has_a_backbone(joint, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["bodies", joint(), "--mode", "0", "--json", "--out", str(out)]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert len(figures["amplitude"]) == 20
    assert np.all(np.diff(figures["frequency"]) < 0.0)
    assert {path.name for path in out.iterdir()} == {"backbone.csv", "result.json", "backbone.png"}


BAD = [
    ('face = "FACE"\npress', 'face = "FLANGE"\npress', "upper.face: surface = 'FLANGE': is"),
    ('"BOLT_2"', '"BOLT_3"', "upper.press[1]: surface = 'BOLT_3': is none of the deck's: FACE"),
    ('deck = "lower.inp"', 'deck = "none.inp"', "none.inp"),
    ('deck = "lower.inp"', 'deck = "upper.inp"', "= 'a side': faces away"),
    ("direction = 1", "direction = 4", "upper.pull.direction = 4"),
    ('{ surface = "END", direction = 1 }', '"END"', "upper.pull = 'END': write pull = {"),
    ("friction = 0.2", "frictoin = 0.2", "key frictoin"),
    ('deck = "lower.inp"', 'deck = "lower.inp"\nelements = [[1]]', "lower.elements = "),
    ('deck = "lower.inp"', 'deck = "lower.inp"\ncolour = 1', "lower.colour = 1: keys are deck"),
]


def test_a_bad_file_is_refused_in_one_line(joint, tmp_path, capsys):
    for old, new, words in BAD:
        assert main(["bodies", joint(old, new)]) == 2
        assert words in capsys.readouterr().err
    joint()
    (tmp_path / "lap" / "upper.npz").unlink()
    assert main(["bodies", joint()]) == 2
    said = "upper.deck = 'upper.inp': there is no upper.sti and no upper.npz: run ccx on the deck"
    assert said in capsys.readouterr().err


def test_a_mode_needs_a_face_and_no_amplitude(joint, tmp_path, capsys):
    assert main(["bodies", joint(), "--mode", "0", "--amplitude", "1"]) == 2
    assert "--amplitude = 1.0: a mode takes" in capsys.readouterr().err
    line = tmp_path / "line.toml"
    line.write_text('[upper]\nfile = "body.npz"\n')
    assert main(["bodies", str(line), "--mode", "0"]) == 2
    assert "--mode = 0: needs bodies that touch on a face" in capsys.readouterr().err
