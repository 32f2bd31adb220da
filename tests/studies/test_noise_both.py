"""Planted fits with noise in force and displacement: the record, and a row of it again."""

from pathlib import Path

import numpy as np
import pytest

from calibration.running import read
from verification import noise_both

RECORD = read(Path(noise_both.__file__).with_suffix(".json"))


def test_intervals_of_planted_fits_hold_and_nothing_is_biased():
    rows = [
        row for kind, count in noise_both.COUNTS.items() for row in RECORD[kind]["rows"][:count]
    ]
    found = noise_both.summary(rows)
    assert found["fits"] == sum(noise_both.COUNTS.values())
    assert found["without result"] == 0
    assert 0.9 <= found["inside"] <= 0.99
    assert abs(found["bias"]) < 0.3


def test_no_number_of_its_own_is_biased():
    """Mean error of friction, of stiffness and of each other number, over all its fits."""
    off: dict[str, list[float]] = {}
    for kind in noise_both.COUNTS:
        for row in RECORD[kind]["rows"]:
            for key, value in row.get("off", {}).items():
                off.setdefault(key, []).append(value)
    for key, values in off.items():
        chance = 3.0 * np.std(values) / np.sqrt(len(values))
        assert abs(np.mean(values)) < 0.3 + chance, key


@pytest.mark.slow
def test_a_row_of_the_record():
    row = RECORD["law"]["rows"][0]
    found = noise_both.row("law", row["number"])
    assert found["off"] == pytest.approx(row["off"], abs=0.05)
    assert found["inside"] == row["inside"]
