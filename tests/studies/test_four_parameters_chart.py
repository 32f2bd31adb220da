"""Record of the study of four parameters: figures of its page."""

import re
from pathlib import Path

import numpy as np

from calibration.running import read

ROOT = Path(__file__).parents[2]
RECORD = read(ROOT / "calibration" / "studies" / "four_parameters.json")


def errors(patch, name):
    """Median error of all heights and frictions, and the worst."""
    own = [row for row in RECORD["rows"] if row["patch"] == patch and row["nu"] == 0.3]
    pairs = np.array([row[name] for row in own if name in row])
    return np.median(pairs[:, 0]), np.max(pairs[:, 1])


def test_the_page_has_the_figures_of_the_record():
    page = (ROOT / "notebooks" / "pages" / "drawing.md").read_text("utf-8")
    for words, patch in (("single lap, one bolt", "single lap"), ("middle half of", "middle")):
        row = next(line for line in page.splitlines() if line.startswith(f"| {words}"))
        told = [float(number) / 100.0 for number in re.findall(r"(\d+) %", row)]
        np.testing.assert_allclose(told, errors(patch, "fitted_errors"), atol=0.006)


def test_iwans_model_is_right_under_bolts_alone():
    assert errors("single lap", "fitted_errors")[1] < 0.1
    assert errors("even", "fitted_errors")[1] > 100.0
    usual = [row for row in RECORD["rows"] if row["nu"] == 0.3]
    exponents = {
        patch: np.concatenate([row["exponents"] for row in usual if row["patch"] == patch])
        for patch in ("even", "middle")
    }
    assert np.max(exponents["even"]) > 6.9
    assert np.max(exponents["middle"]) < 3.6
