"""Cycles of joints beside those of their strips: the record, and a row of it again."""

from pathlib import Path

import pytest

from calibration.running import read
from verification import joints

RECORD = read(Path(joints.__file__).with_suffix(".json"))


def test_joints_lose_what_their_strips_lose():
    assert len(RECORD["rows"]) == joints.COUNT  # none refused
    for found in RECORD["summary"]:
        assert found["slipping"] > 0.7 * joints.COUNT
        assert found["D"]["percent_98"] < 1.5
        assert found["D"]["largest"] < 2.0  # one of 544, at a tenth of the force, is beyond 1.5
        assert found["u"]["largest"] < 1.5


@pytest.mark.slow
def test_a_row_of_the_record():
    row = RECORD["rows"][3]
    again = joints.row(row["values"])
    for one, other in zip(again["cycles"], row["cycles"], strict=True):
        assert one == pytest.approx(other, abs=1e-6)
