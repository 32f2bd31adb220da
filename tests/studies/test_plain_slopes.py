"""Slopes and losses of plain calls beside a fine grid: the record, and a row of it again."""

from pathlib import Path

import pytest

import jbeamshell as jb
from calibration.running import read
from verification import plain_slopes

RECORD = read(Path(plain_slopes.__file__).with_suffix(".json"))


def test_slopes_of_strips_are_smooth_ones():
    found = RECORD["strip"]["summary"]
    assert found["scenes"] == plain_slopes.STRIPS
    assert found["D"]["largest_percent"] < 1.2
    every = found["all slopes"]
    assert every["median_percent"] < 0.8
    assert every["percent_95"] < 3.0


def test_a_slope_does_not_jump_from_step_to_step():
    for key, jumps in RECORD["steps"].items():
        assert jumps["plain"] < 1.0, key
        assert "polygon" not in jumps or jumps["plain"] < 0.1 * jumps["polygon"], key


def test_no_thick_strip_that_hardly_slips_is_wrong_in_silence():
    found = RECORD["thick"]["summary"]
    assert len(RECORD["thick"]["rows"]) == plain_slopes.THICK
    assert found["wrong and not doubted"] == 0
    assert found["doubted in vain"] <= 0.1 * plain_slopes.THICK


@pytest.mark.slow
def test_a_row_of_the_record():
    row = RECORD["strip"]["rows"][0]
    scene = jb.Scene().replace(row["values"])
    loss, _, slopes = plain_slopes.plain(scene, plain_slopes.KEYS)
    assert loss == pytest.approx(row["D"], rel=1e-6)
    assert slopes == pytest.approx(row["slopes"], abs=1e-5)
