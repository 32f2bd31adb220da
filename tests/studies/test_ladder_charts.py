"""Charts of the ladder: drawn from the benchmark's record alone."""

import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import jbeamshell as jb
from calibration import charts


@pytest.fixture(scope="module")
def record():
    file = Path(__file__).parents[1] / "benchmarks" / "ladder.json"
    return json.loads(file.read_text(encoding="utf-8"))


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def test_every_run_is_a_dot(record):
    axes = charts.ladder.work_precision(record)
    dots = {
        (float(line.get_xdata()[0]), float(line.get_ydata()[0]))
        for line in axes.lines
        if len(line.get_xdata()) == 1
    }
    runs = [r for r in record["work"]["runs"] if (r["eta"], r["A"]) == (0.1126, 0.7855)]
    wrong = [r for r in runs if abs(r["ratio"] - 1.0) > 1e-3]
    assert len(wrong) > 20
    for run in wrong:
        here = (run["ms_per_cycle"], 100.0 * abs(run["ratio"] - 1.0))
        assert any(np.allclose(here, dot, rtol=1e-9) for dot in dots)
    assert "[ms]" in axes.get_xlabel()
    assert "[%]" in axes.get_ylabel()


def test_what_the_record_lacks_is_said(record):
    with pytest.raises(jb.InputError, match="error = 'speed': choose one of dissipation"):
        charts.ladder.work_precision(record, error="speed")
    with pytest.raises(jb.InputError):
        charts.ladder.work_precision(record, strip=(0.3, 1.0))
    with pytest.raises(jb.InputError):
        charts.ladder.error_map(record, "p5")


def test_a_map_shows_all_cells(record):
    axes = charts.ladder.error_map(record, "masing")
    cells = record["map"]["cells"]
    drawn = np.asarray(axes.collections[0].get_array()).ravel()
    off = sorted(100.0 * abs(cell["masing"] - 1.0) for cell in cells)
    np.testing.assert_allclose(sorted(drawn), off, rtol=1e-9)
