"""The comparisons: each is whole, its record is of today's cases, and it keeps its bound."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from calibration import comparisons
from calibration.comparisons import measurements, table
from calibration.comparisons.__main__ import main
from calibration.comparisons.case import Case, Source

HERE = Path(comparisons.__file__).parent
CASES = comparisons.all_cases()
SOURCE = Source("nobody")


def case(theirs, ours, bound=0.1, **more):
    return Case("a", "closed form", SOURCE, "b", "c", theirs, lambda: ours, bound, **more)


def test_the_largest_difference_counts():
    assert case([1.0, 2.0], [1.0, 2.1]).run().difference == pytest.approx(0.05)
    assert case([0.1, 2.0], [0.2, 2.0]).run().difference == pytest.approx(1.0)
    assert case([0.1, 2.0], [0.2, 2.0], each=False).run().difference == pytest.approx(0.05)
    assert case([1.0], [1.2]).run().within is False
    assert case([1.0], [np.nan]).run().within is False
    with pytest.raises(ValueError, match="a: "):
        case([1.0, 2.0], 1.0).run()


def test_the_record_is_of_these_cases_and_explains_its_differences():
    rows = json.loads((HERE / "results.json").read_text("utf-8"))
    assert [row["name"] for row in rows] == [one.name for one in CASES]
    for row in rows:
        assert row["within"], row["name"]
        assert row["difference"] <= table.EXPLAINED or row["explained"], row["name"]


def test_the_command_names_the_cases_that_there_are(capsys):
    with pytest.raises(SystemExit):
        main(["nothing of that kind"])
    assert "preloaded M12 bolt, energy" in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_runs_a_case():
    """In a process of its own, which no import may have started JAX before it is configured."""
    words = [sys.executable, "-m", "calibration.comparisons", "Orion"]
    done = subprocess.run(words, cwd=HERE.parents[1], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "1 within their bounds" in done.stdout


def test_a_folder_without_the_files_leaves_the_record(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(measurements, "RECORD", tmp_path / "measured.json")
    measurements.record(tmp_path, ["bolt", "cable", "backbones"])
    assert not measurements.RECORD.exists()
    assert capsys.readouterr().out.count(":") >= 3


@pytest.mark.slow
@pytest.mark.parametrize("one", CASES, ids=lambda one: one.name)
def test_each_case_is_within_its_bound(one):
    result = one.run()
    assert result.within, (result.theirs, result.ours)
