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
    for now, then in zip(found["predictions"], record["found"]["predictions"], strict=True):
        assert now.get("predicted_amplitude") == pytest.approx(
            then.get("predicted_amplitude"), 0.01
        )
