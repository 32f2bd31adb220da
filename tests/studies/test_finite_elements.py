"""The model against plane-strain finite elements, without calibration."""

import csv
import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from calibration.finite_elements import sides
from jbeamshell.measured.example import data_folder, example_loops

# Dissipation over that of finite elements by section: eta, then A = .3247, .5851, 1.0, 1.6, from an
# independent prototype with 40 steps per half cycle, 82 to 95 nodes and alpha = 1000.
PROTOTYPE_AMPLITUDES = (0.3247, 0.5851, 1.0, 1.6)
PROTOTYPE = {
    "shell": {
        0.0511: (1.14, 1.03, 1.01, 1.00),
        0.1126: (2.59, 1.26, 1.06, 1.02),
        0.2358: (16, 3.3, 1.49, 1.12),
        0.4: (90, 14, 3.4, 1.67),
    },
    "squeeze": {
        0.0511: (1.013, 1.003, 1.001, 1.000),
        0.1126: (1.31, 1.023, 1.005, 1.002),
        0.2358: (13, 1.73, 1.044, 1.009),
        0.4: (108, 11, 1.78, 1.065),
    },
}


def test_a_strip_of_three_dimensions_is_in_plane_strain_or_plane_stress():
    rows = json.loads(Path(sides.__file__).with_suffix(".json").read_text())
    for row in rows["rows"]:
        if row["width"] > 4.0:
            continue
        kind = "strain" if row["sides"] == "held" else "stress"
        found = sides.plane(kind, row["load"])
        assert float(found.dissipation) == pytest.approx(row["dissipation"], rel=0.01)
        assert float(found.secant_stiffness) == pytest.approx(row["secant_stiffness"], rel=0.03)


def reference() -> dict[tuple[float, float], float]:
    """Dissipation over the cubic law by (eta, A)."""
    with open(data_folder() / "energy.csv", newline="") as file:
        return {(float(r["eta"]), float(r["A"])): float(r["ratio"]) for r in csv.DictReader(file)}


def sweep(section, cells):
    """Ratio to the cubic law, the same by loop area, and what tells of trouble, of held strips."""
    settings = {"model.kinematics": "linear", "model.tolerance": 0.005}
    scene = STRIP.replace({"model.section": section, "contact.normal": "held"} | settings)
    keys = ("strip.height_ratio", "load.amplitude")
    names = ("dissipation", "dissipation_loop", "dissipation_ratio", "reaction_min", "closure")
    ask = jb.response(scene, keys, names)
    found = jax.lax.map(lambda cell: ask(*cell), jnp.asarray(cells))
    by_loop = found["dissipation_loop"] * found["dissipation_ratio"] / found["dissipation"]
    rest = (found[name] for name in ("reaction_min", "status", "closure"))
    return found["dissipation_ratio"], by_loop, *rest


@pytest.fixture(scope="module")
def squeeze():
    cells = sorted(reference())
    return cells, [np.asarray(a) for a in sweep("squeeze", cells)]


def test_dissipation_within_three_percent_where_the_joint_dissipates(squeeze):
    cells, (ratio, _, reaction, status, _) = squeeze
    truth = np.array([reference()[cell] for cell in cells])
    strong = truth > 0.55
    assert strong.sum() > 30
    assert not status.any()
    assert np.max(np.abs(ratio / truth - 1.0)[strong]) < 0.03
    assert np.all(reaction > 0.0)  # the default grid keeps the frozen end out of tension


def test_loop_area_is_the_work_of_friction_over_the_standard_range(squeeze):
    _, (ratio, by_loop, _, _, closure) = squeeze
    slips = ratio > 1e-6  # below, the strip only sticks and both are round-off
    steady = np.abs(closure) < 1e-9
    assert np.max(np.abs(by_loop / ratio - 1.0)[slips & steady]) < 1e-3
    assert steady.all()


@pytest.mark.parametrize("section", [pytest.param("shell", marks=pytest.mark.slow), "squeeze"])
def test_dissipation_reproduces_the_prototype(section, squeeze):
    table = PROTOTYPE[section]
    cells = [(eta, amplitude) for eta in table for amplitude in PROTOTYPE_AMPLITUDES]
    if section == "squeeze":
        known = dict(zip(squeeze[0], squeeze[1][0], strict=True))
        ratio = np.array([known[cell] for cell in cells])
    else:
        ratio, _, _, status, _ = map(np.asarray, sweep(section, cells))
        assert not status.any()
    truth = np.array([reference()[cell] for cell in cells])
    expected = np.array([value for row in table.values() for value in row])
    # Within 1 % where the entry is below 1.2, 5 % above, and half a unit of its last digit.
    digits = np.where(expected >= 10, 0.5, np.where(expected >= 3, 0.05, 0.005))
    allowed = np.where(expected < 1.2, 0.01, 0.05) * expected + digits * (expected > 1.2)
    assert np.all(np.abs(ratio / truth - expected) < allowed)


def test_a_plain_fit_finds_the_friction_and_the_height_that_made_a_loop():
    """At a fifth of gross slip, where the beamshell's friction is off by factors."""
    (loop,) = example_loops(0.2358, (0.4359,))
    start = {"load.entry": "traction", "contact.friction": 0.12, "strip.height_ratio": 0.28}
    keys = ("contact.friction", "strip.height_ratio")
    fit = jb.identify.fit(loop, jb.Scene().replace(start), keys, points=48)
    np.testing.assert_allclose([fit.values[key] for key in keys], [0.1, 0.2358], rtol=0.002)


def test_the_record_of_fits_says_so_for_all_loops():
    record = json.loads((data_folder().parent / "studies" / "fit_finite_elements.json").read_text())
    plain = [own for loads in record["fits"]["plain call"].values() for own in loads.values()]
    friction, height = np.abs([list(own["relative_bias"].values()) for own in plain]).T
    assert len(plain) == 15
    assert friction.max() < 0.002
    assert height.max() < 0.03  # of a thin strip, which the loop hardly tells: .019 to .052
    assert np.sum(height < 0.01) >= 13
    assert all(own["status"] == "converged" for own in plain)


def test_first_loading_follows_the_finite_element_backbone():
    with open(data_folder() / "backbones.csv", newline="") as file:
        rows = [r for r in csv.DictReader(file) if float(r["eta"]) == 0.1126]
    force = np.array([float(r["force"]) for r in rows])
    displacement = np.array([float(r["displacement"]) for r in rows])
    path = np.linspace(0.05, 1.5, 30)
    held = {"model.kinematics": "linear", "contact.normal": "held"}
    for sign in (1.0, -1.0):
        history = jb.solve(STRIP.replace(held), sign * path)
        there = sign * force > 0.0
        order = np.argsort(sign * force[there])
        truth = np.interp(path, sign * force[there][order], sign * displacement[there][order])
        error = sign * np.asarray(history.displacement[1:]) - truth
        assert np.max(np.abs(error)) < 0.01 * truth[-1]
