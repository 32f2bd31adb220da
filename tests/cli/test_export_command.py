"""`jbeamshell export`: a file that says what it is, or one line and no file."""

import warnings

import pytest

from jbeamshell.cli.terminal import doubts_in_lines
from jbeamshell.common.errors import DoubtfulWarning
from jbeamshell.dynamics import Joint

PLANE = ["--set", "model.section=plane", "--set", "model.nodes=33"]


def test_it_writes_a_joint(cli, tmp_path):
    path = tmp_path / "joint.csv"
    scene = tmp_path / "wide.toml"
    scene.write_text(
        "[strip]\nwidth = 1.5\naxial_stiffness = 1e6\n[load]\nentry = 'traction'\n", "utf-8"
    )
    words = ["--units", "mm, N", "--force", "1.8", "--out", path]
    code, out, err = cli("export", scene, *PLANE, "--to", "table", *words)
    assert (code, out) == (0, "")
    assert err == f"wrote {path}\n"
    assert "u in mm, F in N" in path.read_text()
    joint = Joint.read(path)
    assert float(joint.forces[-1]) == pytest.approx(1.8)
    assert float(joint.width) == 1.5


def test_doubts_are_one_line_each(capsys):
    with doubts_in_lines():
        for text in ("doubtful: few\nnodes", "doubtful: few\nnodes", "doubtful: soft"):
            warnings.warn(text, DoubtfulWarning, stacklevel=1)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [f"jbeamshell: warning: doubtful: {end}" for end in ("few nodes", "soft")]
