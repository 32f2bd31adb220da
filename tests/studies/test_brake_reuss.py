"""The fit to the ring-down of the Brake-Reuss beam, from the curves that ship; its predictions."""

from pathlib import Path

import pytest

from calibration.running import read
from calibration.studies import brake_reuss


@pytest.mark.slow
@pytest.mark.doubtful("few nodes")
def test_the_fit_follows_the_measured_damping_and_predicts_the_sweeps_within_it():
    record = read(Path(brake_reuss.__file__).with_suffix(".json"))
    found, _ = brake_reuss.figures(record)
    assert found["worst_damping"] < 0.055  # of the last point; the others are within 2 %
    assert found["worst_frequency"] < 1e-3
    key = "predicted_amplitude"
    before = [row[key] for row in record["found"]["predictions"] if key in row]
    after = [row[key] for row in found["predictions"] if key in row]
    assert after == pytest.approx(before, rel=0.01)
    assert len(after) == 6
