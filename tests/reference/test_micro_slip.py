"""Short formulas of micro-slip's energy, against finite elements and their own limits."""

import csv
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.reference import cubic_law, energy_exponent, height_factor, slip_energy

DATA = Path(__file__).parents[2] / "calibration" / "data" / "energy.csv"
X = jnp.geomspace(0.1, 100.0, 40)


def test_the_energy_is_that_of_finite_elements():
    with DATA.open(encoding="utf-8") as file:
        rows = [{key: float(text) for key, text in row.items()} for row in csv.DictReader(file)]
    force, eta, exact, ratio = (
        np.array([row[key] for row in rows]) for key in ("A", "eta", "D", "ratio")
    )
    off = np.abs(slip_energy(force, 1.0, 3.4e4, eta) / exact - 1.0)
    assert len(rows) == 60
    assert np.median(off) < 0.025
    assert np.quantile(off, 0.9) < 0.09
    assert np.max(off[ratio > 0.03]) < 0.25
    assert np.max(off) < 0.45  # D is 1e-5 of the bar's there


@pytest.mark.parametrize("edge", ["loaded-end", "inside"])
def test_a_thin_strip_is_a_bar(edge):
    assert float(height_factor(1e4, edge)) == pytest.approx(1.0, abs=1e-4)
    assert float(energy_exponent(1e4, edge)) == pytest.approx(3.0, abs=1e-4)
    bar = cubic_law(0.8, 3.4e4, 1.5)
    assert float(slip_energy(0.8, 1.5, 3.4e4, 1e-6, edge)) == pytest.approx(float(bar), rel=1e-6)


@pytest.mark.parametrize("edge", ["loaded-end", "inside"])
def test_the_exponent_is_the_slope_of_the_energy(edge):
    energy = slip_energy(X, 1.0, 1.0, 1.0, edge)
    slope = np.diff(np.log(energy)) / np.diff(np.log(X))
    middle = energy_exponent(jnp.sqrt(X[1:] * X[:-1]), edge)
    np.testing.assert_allclose(middle, slope, rtol=1e-2)
    assert np.all(np.asarray(height_factor(X, edge)) < 1.0)


def test_a_power_law_is_the_wrong_form_at_the_loaded_end_alone():
    at_end, inside = (energy_exponent(X, edge) for edge in ("loaded-end", "inside"))
    assert (float(jnp.min(at_end)), float(jnp.max(at_end))) == pytest.approx((3.0, 7.4), abs=0.05)
    assert float(jnp.max(inside)) < 3.4


def test_another_edge_is_refused():
    with pytest.raises(jb.InputError, match="edge = 'free': choose 'loaded-end' or 'inside'"):
        height_factor(1.0, "free")
