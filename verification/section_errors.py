"""Errors of every section beside plane elasticity, for each way in which the force enters.

Solves random strips and lap joints as plane elasticity and on the contact line of each section,
with the same entry of the force.  Of each run the record has the slip length over the half height,
as the section itself has it, and how far its dissipation and its secant stiffness are off, in per
cent.  Strips of all heights, frictions and
Poisson's ratios fall near one curve of the slip length over the half height.  These curves go to
jbeamshell.scene.section_errors.json, from where every run tells the error of its section.
"""

from __future__ import annotations

import functools
import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import jbeamshell as jb
from jbeamshell.common.files import write_text
from jbeamshell.plotting.style import PALETTE, style
from jbeamshell.scene.keys import ENTRIES

SHIPPED = Path(jb.__file__).parent / "scene" / "section_errors.json"
SEED = 46
FIGURES = ("dissipation", "secant_stiffness", "slip_length", "dissipation_ratio")
LOADS = np.geomspace(0.03, 0.95, 9)  # over gross slip
FINE, NODES = 257, 129  # contact nodes of plane elasticity, and of the sections
BINS = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.3, 1.6, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0)
BINS += (8.0, 10.0, 14.0, 20.0, 60.0)  # of the slip length over H
ENOUGH = 3  # rows that make a point of a curve
LITTLE = 1e-4  # of the bar's dissipation, below which rows count for no curve
EDGES, LEAST = np.geomspace(0.1, 60.0, 15), 0.02  # bins, and lower end in per cent, of the charts
SHELLS = ("shell", "squeeze")  # sections that any scene may have
Values = dict[str, Any]
Random = np.random.Generator


def _log(random: Random, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def even(random: Random) -> tuple[Values, float]:
    """Homogeneous strip under an even pressure, and its force of gross slip."""
    mu = _log(random, 0.05, 1.0)
    nu = float(random.choice([0.0, 0.3, 0.3, 0.45, 0.49]))
    eta = _log(random, 0.03, 0.4)
    found = {"strip.height_ratio": eta, "strip.poisson_ratio": nu, "contact.friction": mu}
    return found, 20.0 * mu


def table(random: Random) -> tuple[Values, float]:
    """Pressure that changes along the strip without a jump."""
    found, _ = even(random)
    rows = np.column_stack([[0.0, 1.0, 2.0], random.uniform(3.0, 20.0, 3)])
    force = np.sum(0.5 * (rows[1:, 1] + rows[:-1, 1]))
    return found | {"contact.pressure": rows}, found["contact.friction"] * force


def patch(random: Random) -> tuple[Values, float]:
    """Pressure of one bolt, away from the loaded end."""
    found, _ = even(random)
    begin, end = random.uniform(0.0, 0.8), random.uniform(1.0, 1.8)
    rows = np.array([[begin, 0.0], [begin, 10.0], [end, 10.0], [end, 0.0]])
    return found | {"contact.pressure": rows}, found["contact.friction"] * 10.0 * (end - begin)


def laminate(random: Random) -> tuple[Values, float]:
    """Two layers of other stiffness."""
    mu, eta = _log(random, 0.05, 1.0), _log(random, 0.03, 0.4)
    share, ratio = random.uniform(0.3, 0.7), _log(random, 0.2, 5.0)
    layers = [[2.0 * eta * share, 1e5, 0.3], [2.0 * eta * (1.0 - share), 1e5 * ratio, 0.25]]
    found = {"strip.height_ratio": eta, "strip.layers": np.array(layers), "contact.friction": mu}
    return found, 20.0 * mu


def double_shear(random: Random) -> tuple[Values, float]:
    """Half of a lap joint in double shear, with members of other heights."""
    mu, eta = _log(random, 0.05, 0.6), _log(random, 0.03, 0.3)
    thinner = _log(random, 0.5, 2.0)
    found = {"strip.height_ratio": eta, "contact.friction": mu}
    found |= {"member.height_ratio": thinner * eta, "member.axial_stiffness": 3.4e4 * thinner}
    return found, 20.0 * mu


def single_lap(random: Random) -> tuple[Values, float]:
    """Single lap under one bolt."""
    mu, eta = _log(random, 0.05, 0.6), _log(random, 0.03, 0.2)
    begin, end = random.uniform(0.4, 0.8), random.uniform(1.2, 1.6)
    rows = np.array([[begin, 0.0], [begin, 10.0], [end, 10.0], [end, 0.0]])
    found = {"strip.height_ratio": eta, "contact.friction": mu}
    found |= {"contact.pressure": rows, "contact.bottom_pressure": rows}
    return found, 10.0 * (end - begin) * mu


LAP = {"strip.far_end": "free"}
DOUBLE = LAP | {"member.support": "rolling"}
SINGLE = LAP | {"member.support": "clamped", "member.loaded_end": "level"}
SINGLE |= {"member.assembly": "frictional"}
Draw = Callable[[Random], tuple[Values, float]]
KINDS: dict[str, tuple[Draw, Values, int]] = {  # how one is drawn, words of all, number of scenes
    "even": (even, {}, 40),
    "table": (table, {}, 12),
    "patch": (patch, {}, 12),
    "laminate": (laminate, {}, 12),
    "double shear": (double_shear, DOUBLE, 12),
    "single lap": (single_lap, SINGLE, 8),
}


def scenes_of(kind: str) -> tuple[list[Values], np.ndarray]:
    """Values of the scenes of a kind, and their forces of gross slip."""
    draw, words, count = KINDS[kind]
    random = np.random.default_rng([SEED, list(KINDS).index(kind)])
    drawn = [draw(random) for _ in range(count)]
    return [words | values for values, _ in drawn], np.array([force for _, force in drawn])


def runs(scenes: list[Values], gross: np.ndarray, model: Values) -> np.ndarray:
    """Figures (scenes, parts, figures) of a model; NaN where a run has no equilibrium."""
    numbers = [key for key, value in scenes[0].items() if not isinstance(value, str)]
    begin = scenes[0] | model | {"load.amplitude": 0.1 * gross[0]}
    ask = jb.response(jb.Scene().replace(begin), (*numbers, "load.amplitude"), FIGURES)
    found = np.full((len(scenes), LOADS.size, len(FIGURES)), np.nan)
    for i, values in enumerate(scenes):
        for j, part in enumerate(LOADS):
            answer = ask(*(values[key] for key in numbers), part * gross[i])
            if int(answer["status"]) == 0:
                found[i, j] = [float(answer[name]) for name in FIGURES]
    return found


def sections(kind: str) -> tuple[str, ...]:
    """Sections that a kind of scenes may have; a bar is known under an even pressure alone."""
    return ("bar", *SHELLS) if kind == "even" else SHELLS


def beside_elasticity(kind: str, entry: str) -> Values:
    """Rows of one kind and one entry, by section."""
    scenes, gross = scenes_of(kind)
    height, friction, poisson = (
        np.array([values.get(key, default) for values in scenes])[:, None]
        for key, default in (
            ("strip.height_ratio", None),  # of strips of length 2, it is H
            ("contact.friction", None),
            ("strip.poisson_ratio", 0.3),
        )
    )
    plane = {"model.section": "plane", "load.entry": entry}
    exact = runs(scenes, gross, plane | {"model.nodes": FINE})
    coarse = runs(scenes, gross, plane | {"model.nodes": NODES})
    found: Values = {}
    for section in ("plane", *sections(kind)):
        model = {"model.section": section, "load.entry": entry}
        if section != "bar":
            model["model.kinematics"] = "linear"
        own = coarse
        if section != "plane":
            own = runs(scenes, gross, model | {"model.nodes": NODES})
        with np.errstate(all="ignore"):
            off = 100.0 * (own[..., :2] / exact[..., :2] - 1.0)
        rows = [own[..., 2] / height, off[..., 0], off[..., 1], exact[..., 3]]
        rows += [np.broadcast_to(constant, rows[0].shape) for constant in (friction, poisson)]
        kept = np.all(np.isfinite(rows), axis=0)
        names = ("slip_over_H", "D_percent", "K_percent", "D_over_bar", "mu", "nu")
        found[section] = {
            name: [float(f"{value:.4g}") for value in row[kept]]
            for name, row in zip(names, rows, strict=True)
        }
    return found


def curve(rows: Values) -> Values:
    """Errors of the dissipation over the slip length, as a run tells them.

    They are the median, the size that nine strips in ten keep, and the largest size.
    """
    slip, off, share = (np.array(rows[key]) for key in ("slip_over_H", "D_percent", "D_over_bar"))
    points = []
    for low, high in itertools.pairwise(BINS):
        own = (slip >= low) & (slip < high) & (share > LITTLE)
        if np.sum(own) >= ENOUGH:
            middle = np.exp(np.mean(np.log(slip[own])))
            size = np.abs(off[own])
            usual = np.quantile(size, 0.9, method="lower")
            points.append(
                (middle, *(each / 100.0 for each in (np.median(off[own]), usual, np.max(size))))
            )
    places, typical, *sizes = np.reshape(points, (-1, 4)).T
    # A section that fails at much slip is not to be trusted at less.
    usual, largest = (np.maximum.accumulate(size[::-1])[::-1] for size in sizes)
    named = {"slip_over_H": places, "typical": typical, "usual": usual, "largest": largest}
    return {key: [float(f"{value:.3g}") for value in values] for key, values in named.items()}


def ship(record: Values) -> None:
    """Write the curves that the package reads."""
    curves = {
        kind: {
            entry: {name: curve(rows) for name, rows in sections.items() if name != "plane"}
            for entry, sections in entries.items()
        }
        for kind, entries in record.items()
        if kind != "about"
    }
    write_text(SHIPPED, json.dumps(curves, separators=(",", ":")) + "\n")


def of_kind(kind: str) -> Values:
    """Rows of a kind by entry."""
    return {entry: beside_elasticity(kind, entry) for entry in ENTRIES}


PARTS = {kind: functools.partial(of_kind, kind) for kind in KINDS}


# --- chart ----------------------------------------------------------------------------------------


def draw(record: Values) -> plt.Figure:
    """Sections under an even pressure above, the section squeeze of other kinds below."""
    entries = record["even"]
    with style():
        figure, panels = plt.subplots(
            2, len(entries), figsize=(10.2, 5.4), sharex=True, sharey=True, layout="constrained"
        )
        for entry, above, below in zip(entries, *panels, strict=True):
            for section, colour in zip(SHELLS, PALETTE, strict=False):
                rows = entries[entry][section]
                _draw(above, rows, colour, section, dots=section == "squeeze")
            for kind, colour in zip([k for k in KINDS if k != "even"], PALETTE, strict=False):
                _draw(below, record[kind][entry]["squeeze"], colour, kind, dots=False)
            above.set(title=entry, xscale="log", yscale="log", xlim=(0.1, 60.0), ylim=(LEAST, 1e3))
            below.set_xlabel("slip length over $H$")
        panels[0, 0].set_ylabel("error of $D$, even pressure  [%]")
        panels[1, 0].set_ylabel("error of $D$, squeeze  [%]")
        for row in panels:
            row[-1].legend(fontsize=7)
    return figure


def _draw(axes: Axes, rows: Values, colour: str, label: str, dots: bool) -> None:
    """Draw the median size of the error of D [%] in bins of the slip length, and its rows."""
    slip, off, share = (np.array(rows[key]) for key in ("slip_over_H", "D_percent", "D_over_bar"))
    kept = share > LITTLE
    slip, off = slip[kept], np.maximum(np.abs(off[kept]), LEAST)
    if dots:
        axes.plot(slip, off, ".", color=colour, markersize=2, alpha=0.4)
    bins = np.digitize(slip, EDGES)
    points = [
        (np.exp(np.mean(np.log(slip[bins == i]))), np.median(off[bins == i]))
        for i in range(1, EDGES.size)
        if np.sum(bins == i) >= ENOUGH
    ]
    axes.plot(*np.reshape(points, (-1, 2)).T, color=colour, label=label)
