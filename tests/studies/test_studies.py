"""The command of studies and verification: what it lists, runs, writes, refuses and draws."""

import json
import re
import shutil
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import jbeamshell as jb
from calibration import running
from jbeamshell.cli.main import main
from verification.benchmarks import sections

ROOT = Path(__file__).parents[2]
FOUND = {
    f"{folder}/{name}": found
    for folder in ("calibration", "verification")
    for name, found in running.studies(folder).items()
}
STUDIES = {name: path for name, (path, _) in FOUND.items()}
RECORDED = [name for name, path in STUDIES.items() if path.with_suffix(".json").exists()]
TOY = """
'''A toy.'''
import matplotlib.pyplot as plt
def measure(count: int = 2):
    return {"rows": [1.0 / 3.0] * count}
def tell(record):
    return f"{len(record['rows'])} rows"
def draw(record):
    return plt.figure()
"""
IN_PARTS = """
'''A toy in parts.'''
calls = []
def part(name):
    calls.append(name)
    return {"value": len(calls)}
PARTS = {"a": lambda: part("a"), "b": lambda: part("b")}
"""


@pytest.fixture
def toys(tmp_path, monkeypatch):
    """Command of a folder with two studies."""
    folder = tmp_path / "toys"
    folder.mkdir()
    (folder / "whole.py").write_text(TOY, encoding="utf-8")
    (folder / "parts.py").write_text(IN_PARTS, encoding="utf-8")
    (folder / "helper.py").write_text("X = 1\n", encoding="utf-8")
    monkeypatch.setattr(running, "ROOT", tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(jb, "configure", lambda **_: None)
    yield lambda *words: running.main("toys", words)
    for name in [name for name in sys.modules if name.partition(".")[0] == "toys"]:
        del sys.modules[name]


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def test_every_study_says_in_a_line_what_it_does():
    for name, (_, line) in FOUND.items():
        assert line.endswith("."), name
    assert len(FOUND) > 20
    for name in RECORDED:  # which belongs to the code of today
        assert running.read(STUDIES[name].with_suffix(".json"))
        running.load(STUDIES[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", RECORDED)
def test_a_record_is_told_and_drawn(name):
    study = running.load(STUDIES[name])
    record = running.read(STUDIES[name].with_suffix(".json"))
    if hasattr(study, "tell"):
        assert study.tell(record)
    if hasattr(study, "draw"):
        drawn = study.draw(record)
        several = drawn.values() if isinstance(drawn, dict) else [drawn]
        assert all(figure.axes for figure in several)


@pytest.mark.slow
def test_a_list_a_run_a_picture_and_parts(toys, tmp_path, capsys):
    assert toys() == 0
    assert capsys.readouterr().out.splitlines() == ["parts  A toy in parts.", "whole  A toy."]
    assert toys("whole", "count=3") == 0
    assert "3 rows" in capsys.readouterr().out
    record = json.loads((tmp_path / "toys" / "whole.json").read_text("utf-8"))
    assert record["rows"] == [0.333333333] * 3
    assert record["about"]["jax"]
    (tmp_path / "toys" / "whole.png").unlink()
    assert toys("whole", "--draw") == 0
    assert (tmp_path / "toys" / "whole.png").exists()
    path = tmp_path / "toys" / "parts.json"
    assert toys("parts", "--only", "b") == 0
    assert json.loads(path.read_text("utf-8"))["b"] == {"value": 1}
    assert toys("parts", "--missing") == 0
    record = json.loads(path.read_text("utf-8"))
    assert (record["a"], record["b"]) == ({"value": 2}, {"value": 1})
    assert set(record["about"]) == {"a", "b"}
    capsys.readouterr()
    with pytest.raises(SystemExit):
        toys("nothing")
    assert "there is parts, whole" in capsys.readouterr().err
    assert toys("whole", "rows=3") == 2
    assert "rows: the study takes count" in capsys.readouterr().err
    assert toys("parts", "--only", "c") == 2
    assert "choose of a, b" in capsys.readouterr().err


@pytest.mark.slow
def test_a_map_of_a_section_shows_all_cells():
    record = running.read(STUDIES["verification/sections"].with_suffix(".json"))
    with pytest.raises(jb.InputError):
        sections.error_map(record, "p5")
    axes = sections.error_map(record, "squeeze")
    drawn = np.asarray(axes.collections[0].get_array()).ravel()
    off = sorted(100.0 * abs(cell["squeeze"] - 1.0) for cell in record["cells"])
    np.testing.assert_allclose(sorted(drawn), off, rtol=1e-9)


@pytest.mark.slow
def test_the_readme_takes_a_loop_to_a_fitted_joint(tmp_path, monkeypatch, capsys):
    folder = ROOT / "calibration"
    text = (folder / "README.md").read_text("utf-8")
    (shell, told), (python, printed) = (
        re.search(rf"```{kind}\n(.*?)```\n.*?```text\n(.*?)```", text, re.DOTALL).groups()
        for kind in ("sh", "python")
    )
    shutil.copytree(folder / "my_joint", tmp_path, dirs_exist_ok=True)
    (tmp_path / "fit.png").unlink()
    monkeypatch.chdir(tmp_path)
    assert main(shell.split()[1:]) == 0
    assert capsys.readouterr().out.startswith(told)
    assert (tmp_path / "out" / "overlay.png").exists()
    exec(python, {})
    assert capsys.readouterr().out == printed
    assert (tmp_path / "fit.png").exists()
