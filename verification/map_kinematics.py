"""Map of the difference between exact and linear kinematics, over load and slenderness.

A strip is given by five numbers: the load strain A/(E' 2H), the height ratio eta = H/(L/2), the
load over gross slip A/(mu F_N L), mu and nu.  For a grid of the first four at nu = 0.3, and for
strips scattered over all five, this runs the section ``squeeze`` with both kinematics, held down,
and writes how much the dissipation of the settled second cycle, and the secant stiffness, differ;
for some strips also ``squeeze`` that may lift off.  The cells ``p3``, of displacements of third
order through the height (St. Venant and Kirchhoff's material), are those of the record: that
section is no longer a part of the library.

The differences grow with the strain F_N/E' of the pressure and hardly depend on the strain of the
load, up to a tenth.  With linear kinematics the ratios of a loop depend on neither.

Held down, a thin strip cannot buckle under a push.  Cells fail where Newton's method finds no
equilibrium in the plain load steps (a batch does not retry in smaller ones), or where a section is
pressed through itself, psi <= -1.

The constants of `jbeamshell.scene.linearisation` are fitted to it.  A quarter of an hour on one
core.
"""

import itertools
import json
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc
from tqdm import tqdm

import jbeamshell as jb
from calibration.strip import changed, in_load_steps
from jbeamshell.scene.linearisation import BEAMSHELL, ELASTICITY, bound

STRAINS = np.logspace(-6.0, -0.5, 12)
HEIGHTS = np.geomspace(0.005, 0.4, 12)
GROSS = (0.1, 0.5, 0.9)
FRICTIONS = (0.05, 0.1, 0.5)
NU = 0.3
# Of the scattered strips: strain and eta even in their logarithms, load, mu (log) and nu.
LOWEST = (1e-6, 0.005, 0.05, 0.03, 0.0)
HIGHEST = (1e-1, 0.4, 0.95, 0.6, 0.47)
LOGARITHMIC = np.array([True, True, False, True, False])
SCATTERED = {"squeeze": 256, "lift": 64}  # the first of one sequence
MODELS: dict[str, dict[str, Any]] = {
    "squeeze": {"model.section": "squeeze", "end_size": 1 / 6},
    "lift": {"model.section": "squeeze", "end_size": 1 / 6, "contact.normal": "rigid"},
}
COLUMNS = ("strain", "eta", "gross", "mu", "nu", "dissipation", "stiffness", "rotation", "state")
LANES = 16  # solved at once
SETS = ("grid", "scattered", "p3", "lift")
COVERED = 0.99  # aimed at by the fit
LEAST = 1e-4  # a smaller difference is none


# --- measuring ------------------------------------------------------------------------------------


def scene_of(strip: Any, model: str, kinematics: str) -> jb.Scene:
    """Strip of five numbers, with L = 2 and E' 2H = 1."""
    strain, eta, gross, mu, nu = strip
    return changed(
        in_load_steps(),
        {
            "strip.axial_stiffness": 1.0,
            "strip.height_ratio": eta,
            "strip.poisson_ratio": nu,
            "contact.friction": mu,
            "contact.pressure": strain / (2.0 * gross * mu),
            "load.amplitude": strain,
            "load.steps_per_half_cycle": 10,
            "model.nodes": 81,
            "model.kinematics": kinematics,
            **MODELS[model],
        },
    )


def answers(strips: np.ndarray, model: str, kinematics: str) -> np.ndarray:
    """Dissipation, secant stiffness, largest rotation, least psi and convergence, (n, 5)."""

    @eqx.filter_jit
    def many(strips: jax.Array) -> jax.Array:
        def one(strip: jax.Array) -> jax.Array:
            history = jb.solve(scene_of(strip, model, kinematics), throw=False)
            rotation = jnp.max(jnp.abs(history.beta))
            sound = jnp.all(history.status == jb.Status.CONVERGED)
            loop = history.dissipation, history.secant_stiffness
            return jnp.stack([*loop, rotation, jnp.min(history.psi), sound])

        return jax.vmap(one)(strips)

    padded = np.concatenate([strips, np.repeat(strips[-1:], -len(strips) % LANES, axis=0)])
    batches = np.split(padded, len(padded) // LANES)
    found = [many(batch) for batch in tqdm(batches, f"{model}, {kinematics}", disable=None)]
    return np.concatenate(found)[: len(strips)]


def compared(strips: np.ndarray, model: str) -> list[list[Any]]:
    """Changes by exact kinematics in every strip, in rows of `COLUMNS`."""
    exact, linear = (answers(strips, model, kinematics) for kinematics in ("exact", "linear"))
    cells = []
    for strip, one, other in zip(strips, exact, linear, strict=True):
        state = "ok" if one[3] > -1.0 else "crushed"
        if not (one[4] and other[4]):
            state = "no equilibrium"
        figures = [*(one[:2] / other[:2] - 1.0), one[2]] if state == "ok" else [None] * 3
        rounded = [v if v is None else float(f"{v:.5g}") for v in (*strip, *figures)]
        cells.append([*rounded, state])
    return cells


def grid() -> np.ndarray:
    """Strips of the map, (n, 5)."""
    return np.array(list(itertools.product(STRAINS, HEIGHTS, GROSS, FRICTIONS, [NU])))


def scattered() -> np.ndarray:
    """Random strips over all five numbers, (n, 5)."""
    low, high = (np.where(LOGARITHMIC, np.log(np.maximum(b, 1e-9)), b) for b in (LOWEST, HIGHEST))
    points = qmc.scale(qmc.Sobol(5, seed=0).random(SCATTERED["squeeze"]), low, high)
    return np.where(LOGARITHMIC, np.exp(points), points)


def measure() -> dict[str, Any]:
    """Record of the map and of the random strips."""
    strips = scattered()
    return {
        "meaning": "dissipation, stiffness: exact over linear, less 1; rotation: max |beta|, rad",
        "columns": COLUMNS,
        "grid": compared(grid(), "squeeze"),
        "scattered": compared(strips, "squeeze"),
        "p3": json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))["p3"],
        "lift": compared(strips[: SCATTERED["lift"]], "lift"),
    }


# --- the bound ------------------------------------------------------------------------------------


def columns(cells: list[list[Any]]) -> dict[str, np.ndarray]:
    """Cells by column; figures of failed cells are NaN."""
    values = zip(*cells, strict=True)
    kinds = [*[float] * (len(COLUMNS) - 1), str]
    return {
        name: np.array(column, kind)
        for name, column, kind in zip(COLUMNS, values, kinds, strict=True)
    }


def groups(c: dict[str, np.ndarray]) -> tuple[np.ndarray, ...]:
    """Arguments of the bound: F_N/E', slip length over H, mu, E'/(2G)."""
    pressed = c["strain"] * c["eta"] / (c["gross"] * c["mu"])
    return pressed, 2.0 * c["gross"] / c["eta"], c["mu"], 1.0 / (1.0 - c["nu"])


def larger(c: dict[str, np.ndarray]) -> np.ndarray:
    """Larger of the two differences."""
    return np.maximum(np.abs(c["dissipation"]), np.abs(c["stiffness"]))


def limit(name: str, c: dict[str, np.ndarray]) -> np.ndarray:
    """Bound for a set of cells."""
    return bound(*groups(c), ELASTICITY if name == "p3" else BEAMSHELL)


def fitted(cells: list[list[Any]], start: tuple[float, ...]) -> np.ndarray:
    """Smallest constants whose bound covers the part `COVERED` of the cells."""
    c = columns(cells)
    fair = (c["state"] == "ok") & (c["strain"] <= HIGHEST[0])
    known, measured = [group[fair] for group in groups(c)], np.log(larger(c)[fair])

    def loss(factors: np.ndarray) -> float:
        short = measured - np.log(bound(*known, start * np.exp(factors)))
        return float(np.mean(np.maximum(COVERED * short, (COVERED - 1.0) * short)))

    options = {"maxiter": 4000, "maxfev": 4000}
    guess = np.full(len(start), 0.1)
    return start * np.exp(minimize(loss, guess, method="Nelder-Mead", options=options).x)


def tell(record: dict[str, Any]) -> str:
    """Text on how the bound holds on every set of cells, with the constants that fit best."""
    lines = ["set        cells  failed  covered  over (median)  of D alone: covered  over (median)"]
    for name in SETS:
        c = columns(record[name])
        sound, most = c["state"] == "ok", limit(name, c)
        marks = []
        for measured in (larger(c), np.abs(c["dissipation"])):
            over = np.median((most / measured)[sound & (measured > LEAST)])
            marks.append(f"{np.mean((most >= measured)[sound]):7.3f}  {over:13.2f}")
        row = f"{name:10s} {sound.size:5d}  {np.sum(~sound):6d}  {marks[0]}  {marks[1]:>34s}"
        lines.append(row)
    cells = record["grid"] + record["scattered"], record["p3"]
    for some, used in zip(cells, (BEAMSHELL, ELASTICITY), strict=True):
        best = ", ".join(f"{value:.3g}" for value in fitted(some, used))
        lines.append(f"constants in use: {used}; that fit best: {best}")
    return "\n".join(lines)
