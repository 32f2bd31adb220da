"""Map of the difference between exact and linear kinematics, over load and slenderness.

A strip is given by five numbers: the load strain A/(E' 2H), the height ratio eta = H/(L/2), the
load over gross slip A/(mu F_N L), mu and nu.  For a grid of the first four at nu = 0.3, and for
strips scattered over all five, this runs the section ``squeeze`` with both kinematics, held down,
and writes how much the dissipation of the settled second cycle, and the secant stiffness, differ;
for some strips also the section ``p3`` (St. Venant and Kirchhoff's material) and ``squeeze`` that
may lift off.

The differences grow with the strain F_N/E' of the pressure and hardly depend on the strain of the
load, up to a tenth.  With linear kinematics the ratios of a loop depend on neither.

Held down, a thin strip cannot buckle under a push.  Cells fail where Newton's method finds no
equilibrium in the plain load steps (a batch does not retry in smaller ones), or where a section is
pressed through itself, psi <= -1.

Writes map_kinematics.json beside this file, draws map_kinematics.png from it, and fits the
constants of `jbeamshell.scene.linearisation`; a quarter of an hour on one core:

    python calibration/map_kinematics.py           # --draw: only the picture, from the record
"""

import argparse
import itertools
import json
from pathlib import Path
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import equinox as eqx  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.colors import LogNorm  # noqa: E402
from provenance import provenance  # noqa: E402
from scipy.optimize import minimize  # noqa: E402
from scipy.stats import qmc  # noqa: E402
from strip import changed, in_load_steps  # noqa: E402
from tqdm import tqdm  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell import plotting  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.scene.linearisation import BEAMSHELL, SECTIONS, bound  # noqa: E402

HERE = Path(__file__).parent
RECORD = HERE / "map_kinematics.json"
STRAINS = np.logspace(-6.0, -0.5, 12)
HEIGHTS = np.geomspace(0.005, 0.4, 12)
GROSS = (0.1, 0.5, 0.9)
FRICTIONS = (0.05, 0.1, 0.5)
NU = 0.3
SHOWN = (0.5, 0.1)  # load over gross slip and mu of the map
# Of the scattered strips: strain and eta even in their logarithms, load, mu (log) and nu.
LOWEST = (1e-6, 0.005, 0.05, 0.03, 0.0)
HIGHEST = (1e-1, 0.4, 0.95, 0.6, 0.47)
LOGARITHMIC = np.array([True, True, False, True, False])
SCATTERED = {"squeeze": 256, "p3": 32, "lift": 64}  # the first of one sequence
MODELS: dict[str, dict[str, Any]] = {
    "squeeze": {"model.section": "squeeze", "end_size": 1 / 6},
    "p3": {"model.section": "p3", "end_size": 1 / 12},
    "lift": {"model.section": "squeeze", "end_size": 1 / 6, "contact.normal": "rigid"},
}
COLUMNS = ("strain", "eta", "gross", "mu", "nu", "dissipation", "stiffness", "rotation", "state")
LANES = 16  # solved at once
SETS = ("grid", "scattered", "p3", "lift")
NAMES = {
    "grid": "squeeze, grid",
    "scattered": "squeeze, scattered",
    "p3": "p3, scattered",
    "lift": "squeeze with lift, scattered",
}
LEVELS = (0.1, 1.0, 5.0)  # per cent
LABELS = ((6e-3, 0.09), (2.7e-2, 0.11), (6e-2, 0.13))  # where their labels stand
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
        "provenance": provenance(),
        "meaning": "dissipation, stiffness: exact over linear, less 1; rotation: max |beta|, rad",
        "columns": COLUMNS,
        "grid": compared(grid(), "squeeze"),
        "scattered": compared(strips, "squeeze"),
        **{name: compared(strips[: SCATTERED[name]], name) for name in ("p3", "lift")},
    }


def as_text(record: dict[str, Any]) -> str:
    """Record as JSON text, every cell on one line."""
    parts = []
    for key, value in record.items():
        text = json.dumps(value, allow_nan=False)
        if key in SETS:
            text = "[\n" + ",\n".join(json.dumps(cell, allow_nan=False) for cell in value) + "\n]"
        parts.append(f"{json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


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
    return bound(*groups(c), SECTIONS if name == "p3" else BEAMSHELL)


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


def report(record: dict[str, Any]) -> str:
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
    for some, used in zip(cells, (BEAMSHELL, SECTIONS), strict=True):
        best = ", ".join(f"{value:.3g}" for value in fitted(some, used))
        lines.append(f"constants in use: {used}; that fit best: {best}")
    return "\n".join(lines)


# --- picture --------------------------------------------------------------------------------------


def picture(record: dict[str, Any]) -> plt.Figure:
    """Picture of the map, and of the bound over the measured differences."""
    with plotting.style():
        figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.8))
        draw_map(record["grid"], left)
        draw_bound(record, right)
    return figure


def draw_map(cells: list[list[Any]], axes: plt.Axes) -> None:
    """Draw the difference of the dissipation over strain and height ratio, in per cent."""
    gross, mu = SHOWN
    c = columns([cell for cell in cells if cell[2:4] == [gross, mu]])
    strain, eta = np.unique(c["strain"]), np.unique(c["eta"])
    shape = strain.size, eta.size  # cells run over eta within strain
    percent = 100.0 * np.abs(c["dissipation"].reshape(shape).T)
    axes.set(xscale="log", yscale="log")  # before the labels of the contours turn with them
    shades = axes.pcolormesh(
        strain, eta, percent, norm=LogNorm(1e-5, 1e2), cmap="Blues", shading="nearest"
    )
    label = r"$|D_\mathrm{exact}/D_\mathrm{linear} - 1|$  [%]"
    axes.figure.colorbar(shades, ax=axes, extend="both", label=label)
    # Logarithms, in which the difference is nearly a plane.
    levels, look = np.log10(LEVELS), {"colors": "k", "linewidths": 1.1, "linestyles": "solid"}
    lines = axes.contour(strain, eta, np.log10(percent), levels, **look)
    axes.clabel(lines, fmt=lambda level: f"{10.0**level:g} %", fontsize=9, manual=LABELS)
    failed = np.ma.masked_equal((c["state"] != "ok").reshape(shape).T, False)
    axes.pcolor(strain, eta, failed, hatch="////", facecolor="none", shading="nearest")
    standard = in_load_steps()
    load = standard.load.amplitude / standard.strip.stretching_stiffness
    place = float(load), float(standard.strip.height_ratio)
    axes.plot(*place, "*", color="w", markeredgecolor="k", markersize=14.0)
    axes.annotate("standard strip", place, (8, 6), textcoords="offset points")
    axes.set(
        xlabel="strain of the load  $A\\,/\\,(E'\\,2H)$  [1]",
        ylabel=r"$\eta = H\,/\,(L/2)$  [1]",
        title=rf"(a) $A = {gross:g}\,\mu F_N L$, $\mu = {mu:g}$, $\nu = {NU:g}$",
    )


def draw_bound(record: dict[str, Any], axes: plt.Axes) -> None:
    """Draw the bound over the larger of the two differences."""
    for name, colour in zip(SETS, plotting.colours(len(SETS)), strict=True):
        c = columns(record[name])
        size = 8.0 if name == "grid" else 16.0
        axes.scatter(larger(c), limit(name, c), size, color=colour, label=NAMES[name], lw=0)
    ends = np.array([1e-9, 10.0])
    axes.plot(ends, ends, color=plotting.DATA, linewidth=1.0)
    axes.plot(ends, 5.0 * ends, "--", color=plotting.FAINT, linewidth=1.0)
    axes.set(
        xscale="log",
        yscale="log",
        xlim=ends,
        ylim=ends,
        xlabel="measured difference, the larger of $D$ and secant stiffness  [1]",
        ylabel="bound  [1]",
        title="(b) the closed-form bound: equal (line), fivefold (dashes)",
    )
    axes.legend(loc="lower right")


def main() -> None:
    """Measure, write the record, print a summary, draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draw", action="store_true", help="draw the record that is there")
    if not parser.parse_args().draw:
        write_text(RECORD, as_text(measure()))
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    print(report(record))
    plotting.save(picture(record), HERE / "map_kinematics.png")


if __name__ == "__main__":
    main()
