"""Bound on the error of linear kinematics, against the record it was fitted to and live runs."""

import json
from pathlib import Path

import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from jbeamshell.scene.linearisation import linear_error

RECORD = json.loads(
    (Path(__file__).parents[2] / "verification" / "map_kinematics.json").read_text(encoding="utf-8")
)
LEAST = 1e-4  # smaller differences are not worth a sharp bound


def cells(name):
    """Columns of the solved cells of a set: numbers of the strips and the differences."""
    rows = [row for row in RECORD[name] if row[-1] == "ok"]
    columns = dict(zip(RECORD["columns"], zip(*rows, strict=True), strict=True))
    return {key: np.array(column) for key, column in columns.items() if key != "state"}


def scene_of(strain, eta, gross, mu, nu, **model):
    stiffness, length = 5.0e3, 0.3  # the record has ratios only
    return STRIP.replace(
        {
            "strip.length": length,
            "strip.axial_stiffness": stiffness,
            "strip.height_ratio": eta,
            "strip.poisson_ratio": nu,
            "contact.friction": mu,
            "contact.pressure": strain * stiffness / (gross * mu * length),
            "load.amplitude": strain * stiffness,
            **{f"model.{key}": value for key, value in model.items()},
        }
    )


@pytest.mark.parametrize(
    ("name", "section", "every"),
    [
        ("grid", "squeeze", 7),
        ("scattered", "squeeze", 1),
        ("p3", "plane", 1),
        ("lift", "squeeze", 1),
    ],
)
def test_bound_covers_the_record_closely(name, section, every):
    c = {key: column[::every] for key, column in cells(name).items()}
    strips = zip(*(c[key] for key in ("strain", "eta", "gross", "mu", "nu")), strict=True)
    scenes = (
        scene_of(*map(float, strip), section=section, kinematics="linear", by="auto")
        for strip in strips
    )
    bound = np.array([linear_error(scene) for scene in scenes])
    measured = np.maximum(np.abs(c["dissipation"]), np.abs(c["stiffness"]))
    assert np.mean(bound >= measured) >= 0.97
    assert np.median((bound / measured)[measured > LEAST]) < 3.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("strain", "eta", "gross"), [(2e-3, 0.1126, 0.4), (1e-4, 0.3, 0.7), (1e-2, 0.05, 0.2)]
)
def test_bound_holds_for_a_run(strain, eta, gross):
    scene = scene_of(strain, eta, gross, 0.2, 0.25, nodes=41).replace(
        {"load.steps_per_half_cycle": 4}
    )
    exact, linear = (
        jb.solve(scene.replace({"model.kinematics": kinematics})).dissipation
        for kinematics in ("exact", "linear")
    )
    difference = abs(float(exact / linear) - 1.0)
    assert difference < linear_error(scene) < 10.0 * difference


def test_standard_strip_may_be_linear():
    assert linear_error(STRIP) < 2e-4


def test_displacement_control_means_the_force_of_the_bar():
    scene = STRIP
    force, stiffness, rub = 0.7855, 3.4e4, 1.0
    bar = {"load.control": "displacement", "load.amplitude": force**2 / (2.0 * stiffness * rub)}
    assert linear_error(scene.replace(bar)) == pytest.approx(linear_error(scene))


def test_beyond_gross_slip_the_whole_strip_slips():
    scene = STRIP.replace({"load.control": "displacement", "load.amplitude": 1.0})
    assert linear_error(scene) == pytest.approx(
        linear_error(STRIP.replace({"load.amplitude": 2.0}))
    )
    smooth = scene.replace({"contact.friction": 0.0})
    assert 0.0 < linear_error(smooth) < linear_error(scene)


def test_layers_and_plane_stress_have_a_bound():
    half = 0.1126
    layers = [[half, 1e5, 0.3], [half, 1e5, 0.3]]
    alike = {"strip.youngs_modulus": 1e5, "strip.half_height": half}
    layered, whole = (STRIP.replace(values) for values in ({"strip.layers": layers}, alike))
    assert linear_error(layered) == pytest.approx(linear_error(whole))
    assert 0.0 < linear_error(whole.replace({"strip.plane": "stress"})) < linear_error(whole)
