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


def test_what_the_record_lacks_is_said(record):
    with pytest.raises(jb.InputError):
        charts.ladder.error_map(record, "p5")


def test_a_map_shows_all_cells(record):
    axes = charts.ladder.error_map(record, "squeeze")
    cells = record["map"]["cells"]
    drawn = np.asarray(axes.collections[0].get_array()).ravel()
    off = sorted(100.0 * abs(cell["squeeze"] - 1.0) for cell in cells)
    np.testing.assert_allclose(sorted(drawn), off, rtol=1e-9)
