"""Derivatives by every number: the record holds no wrong one, and a row of it comes again."""

from pathlib import Path

import jax
import pytest

import jbeamshell as jb
from calibration.running import read
from calibration.strip import changed
from verification import gradients

RECORD = read(Path(gradients.__file__).with_suffix(".json"))
SETTINGS = [name for name in RECORD if name != "about"]


@pytest.mark.parametrize("setting", SETTINGS)
def test_the_record_holds_no_wrong_derivative(setting):
    assert set(RECORD[setting]["counts"]) <= {"right", "kink", "jump", "undefined"}
    for row in RECORD[setting]["others"]:
        assert abs(row["jax"]) < float("inf")


def test_the_record_holds_all_settings():
    assert set(SETTINGS) == set(gradients.PARTS)


@pytest.mark.slow
def test_a_setting_of_the_record():
    found = gradients.study("contact line, steps of pressure")
    assert found["counts"]["right"] > 500
    assert "wrong" not in found["counts"]


@pytest.mark.slow
@pytest.mark.parametrize("setting", ["contact line, squeeze", "load steps, sharp", "double shear"])
def test_no_nan_is_kept_for_a_gradient(setting):
    scene = changed(jb.Scene(), gradients.SETTINGS[setting])

    def dissipation(friction):
        return jb.solve(scene.replace({"contact.friction": friction})).dissipation

    with jax.debug_nans(True), jax.enable_checks(True):
        assert float(jax.grad(dissipation)(0.1)) < 0.0
