"""The fit to the ring-down of the Brake-Reuss beam, from the curves that ship; its predictions."""

import json
import sys
from pathlib import Path

import pytest

CALIBRATION = Path(__file__).parents[2] / "calibration"


@pytest.mark.slow
@pytest.mark.doubtful("few nodes")
def test_the_fit_follows_the_measured_damping_and_predicts_the_sweeps_within_it(monkeypatch):
    monkeypatch.syspath_prepend(str(CALIBRATION))
    import brake_reuss as study

    record = json.loads((CALIBRATION / "brake_reuss.json").read_text("utf-8"))
    found, _ = study.figures(record)
    sys.modules.pop("brake_reuss")
    assert found["worst_damping"] < 0.05
    assert found["worst_frequency"] < 1e-3
    key = "predicted_amplitude"
    before = [row[key] for row in record["found"]["predictions"] if key in row]
    after = [row[key] for row in found["predictions"] if key in row]
    assert after == pytest.approx(before, rel=0.01)
    assert len(after) == 6
