"""Standard strips, rows of finite elements, and a measurement that a formula answers."""

import csv
import dataclasses
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jax import Array

import jbeamshell as jb
from jbeamshell.identify.observations import Observation, run_of
from jbeamshell.measured.curves import Curve
from jbeamshell.measured.form import Column, Form

# What tests of the general solver change: load steps, 40 per half cycle, and exact rotations.
STRIP = jb.Scene().replace({"model.kinematics": "exact"}).by_load_steps()
DATA = Path(__file__).parents[1] / "calibration" / "data"
X = np.linspace(0.05, 1.0, 20)
TRUTH = {"contact.friction": 0.1, "strip.height_ratio": 0.2, "strip.kappa_s": 0.44}
KEYS = tuple(TRUTH)
START = {"contact.friction": 0.2, "strip.height_ratio": 0.1, "strip.kappa_s": 0.3}


def plane_strip(eta, mu=0.1, nu=0.3, amplitude=1.0):
    """Standard strip in plane elasticity with mu F_N = 1."""
    return jb.Scene().replace(
        {
            "model.section": "plane",
            "load.entry": "traction",
            "strip.height_ratio": eta,
            "strip.poisson_ratio": nu,
            "contact.friction": mu,
            "contact.pressure": 1.0 / mu,
            "load.amplitude": amplitude,
        }
    )


def rows_of(name, word=None):
    """Rows of a table of finite elements as numbers, without the column of words."""
    with (DATA / name).open(encoding="utf-8") as file:
        rows = [(row.pop(word, None), row) for row in csv.DictReader(file)]
    return [(of, {k: float(v or "nan") for k, v in row.items()}) for of, row in rows]


def formula(x, mu, eta, kappa_s):
    """Linear in mu and kappa_s, not in eta; numbers or traced."""
    return mu * (1.0 - jnp.exp(-x / eta)) + 0.2 * kappa_s * x


@dataclasses.dataclass(frozen=True, eq=False)
class Readings(Curve):
    kind = "toy"
    form = Form("toy", {"x": Column("x", ()), "y": Column("y", ())}, "x", "y", ("y",))

    x: np.ndarray
    y: np.ndarray


class Formula(Observation):
    x: Array

    def predict(self, model, solver):
        answer = formula(self.x, *(model.get(key) for key in KEYS))
        return answer, model.get(KEYS[0]) < 50.0


@run_of.register
def _(measurement: Readings, model):
    weight = 1.0 / np.ptp(measurement.y) if measurement.noise is None else 1.0 / measurement.noise
    weight = np.broadcast_to(weight, measurement.x.shape)
    return Formula(*map(jnp.asarray, (measurement.y, weight, measurement.x)))


def scene(**values):
    return STRIP.replace(START | {key: values[key] for key in values})


def readings(noise=0.0, seed=0, known=False, label="toy", weight=1.0, **truth):
    """The formula at the truth, with Gaussian noise that the measurement knows or not."""
    y = np.asarray(formula(X, *(TRUTH | truth).values()))
    y = y + noise * np.random.default_rng(seed).standard_normal(X.size)
    return Readings(X, y, label=label, noise=noise if known else None, weight=weight)
