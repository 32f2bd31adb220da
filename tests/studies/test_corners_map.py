"""The map of the corners: its record holds no silent failure, and its scenes can be drawn again."""

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

CALIBRATION = Path(__file__).parents[2] / "calibration"
RECORD = json.loads((CALIBRATION / "corners_map.json").read_text(encoding="utf-8"))["kinds"]


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(str(CALIBRATION))
    spec = importlib.util.spec_from_file_location("corners_map", CALIBRATION / "corners_map.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("kind", list(RECORD))
def test_the_record_holds_no_silent_failure(kind):
    for row in RECORD[kind]["scenes"]:
        worst = max(row.get("errors", {}).values(), default=0.0)
        assert row["outcome"] != "wrong, silently", row["values"]
        assert (worst > 0.02) == row["outcome"].startswith("wrong")


@pytest.mark.parametrize("kind", list(RECORD))
def test_the_scenes_of_the_record_are_drawn_again(kind, script):
    make, _ = script.KINDS[kind]
    random = np.random.default_rng([RECORD[kind]["seed"], list(script.KINDS).index(kind)])
    for row in RECORD[kind]["scenes"]:
        assert json.loads(json.dumps(make(random))) == row["values"]


@pytest.mark.slow
def test_a_row_of_the_record(script):
    kind = "layers that lift"
    row = RECORD[kind]["scenes"][0]
    found = script.compared(row["values"], script.KINDS[kind][1])
    assert found["outcome"] == row["outcome"]
    assert found["errors"] == pytest.approx(row["errors"], rel=1e-2)


def test_an_error_over_nothing_is_whole(script):
    assert script.off(1.0, 0.0) == 1.0
    assert script.off(0.0, 0.0) == 0.0
    assert script.off(1.1, 1.0) == pytest.approx(0.1)
