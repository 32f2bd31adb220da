"""Derivatives by every number: the record holds no wrong one, and a row of it comes again."""

import importlib.util
import json
from pathlib import Path

import jax
import pytest

import jbeamshell as jb

CALIBRATION = Path(__file__).parents[2] / "calibration"
RECORD = json.loads((CALIBRATION / "gradients.json").read_text(encoding="utf-8"))["settings"]


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(str(CALIBRATION))
    spec = importlib.util.spec_from_file_location("gradients", CALIBRATION / "gradients.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("setting", list(RECORD))
def test_the_record_holds_no_wrong_derivative(setting):
    assert set(RECORD[setting]["counts"]) <= {"right", "kink", "jump", "undefined"}
    for row in RECORD[setting]["others"]:
        assert abs(row["jax"]) < float("inf")


def test_the_record_holds_all_settings(script):
    assert set(RECORD) == set(script.SETTINGS)


@pytest.mark.slow
def test_a_setting_of_the_record(script):
    name = "contact line, steps of pressure"
    found = script.study(script.SETTINGS[name], points=1, seed=[0])
    assert found["counts"]["right"] > 500
    assert "wrong" not in found["counts"]


@pytest.mark.slow
@pytest.mark.parametrize("setting", ["contact line, squeeze", "load steps, sharp", "double shear"])
def test_no_nan_is_kept_for_a_gradient(script, setting):
    scene = script.changed(jb.Scene(), script.SETTINGS[setting])

    def dissipation(friction):
        return jb.solve(scene.replace({"contact.friction": friction})).dissipation

    with jax.debug_nans(True), jax.enable_checks(True):
        assert float(jax.grad(dissipation)(0.1)) < 0.0
