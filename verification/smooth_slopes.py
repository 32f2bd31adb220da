"""Derivatives of the dissipation beside smooth slopes of a fine grid, over the number of nodes.

A strip is walked on several grids, read on the spline of its events and on their polygon, on which
nodes slip one after the other.  The smooth slopes are those of cubics through runs on the finest
grid, over a tenth of friction or load to both sides.  Of each grid the record has the largest and
the median error of D and of its logarithmic slopes, and the chart shows D and its derivative by
friction.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

import jbeamshell as jb
from calibration.running import as_text
from jbeamshell.contact_line.body import Body
from jbeamshell.contact_line.contact_state import pressed
from jbeamshell.contact_line.solve import strip_of
from jbeamshell.contact_line.walk import walk
from jbeamshell.plotting.style import style

NODES = 33, 49, 93
FINE = 257
READ = "spline", "polygon"
CYCLES = 3
WIDTH = 0.1  # of the logarithm to both sides of a smooth slope
POINTS = 7  # in it
SEED, SCENES = 5, 8  # random strips
SHOWN = {"strip.height_ratio": 0.1, "load.amplitude": 1.0}
FRICTION = np.linspace(0.09, 0.12, 41)  # of the chart
Record = dict[str, Any]


def _work(body: Body, friction: Any, amplitude: Any, rounded: bool) -> Any:
    """Work of friction in the last of some cycles."""
    turns = jnp.asarray([1.0, *[-1.0, 1.0] * CYCLES])
    known = (True,) * turns.size
    path = pressed(body), amplitude * turns, known
    return jnp.sum(walk(body, friction, *path, rounded=rounded).slip_work[-2:])


works = jax.jit(_work, static_argnums=3)


@jax.jit
def slopes(body: Body, friction: Any, amplitude: Any) -> tuple[Any, tuple[Any, Any]]:
    """Work, and its derivatives by friction and load, as they are read on the spline."""
    return _both(body, friction, amplitude, True)


@jax.jit
def steps(body: Body, friction: Any, amplitude: Any) -> tuple[Any, tuple[Any, Any]]:
    """The same on the polygon."""
    return _both(body, friction, amplitude, False)


def _both(body: Body, friction: Any, amplitude: Any, rounded: bool) -> tuple[Any, tuple[Any, Any]]:
    def work(friction: Any, amplitude: Any) -> Any:
        return _work(body, friction, amplitude, rounded)

    at = friction, amplitude
    value, by_friction = jax.jvp(lambda mu: work(mu, amplitude), at[:1], (1.0,))
    return value, (by_friction, jax.jvp(lambda load: work(friction, load), at[1:], (1.0,))[1])


def strips() -> Iterator[dict[str, Any]]:
    """Random strips under all entries of the force."""
    random = np.random.default_rng(SEED)
    for number in range(SCENES):
        height, friction = 10 ** random.uniform(-1.4, -0.6), 10 ** random.uniform(-1.2, -0.3)
        gross = friction * 10.0 * 2.0
        yield {
            "load.entry": ("traction", "face", "member", "guided")[number % 4],
            "strip.height_ratio": height,
            "contact.friction": friction,
            "load.amplitude": random.uniform(0.25, 0.75) * gross,
        }


def _body(values: dict[str, Any], nodes: int) -> Body:
    scene = jb.Scene().replace(values | {"model.section": "plane", "model.nodes": nodes})
    return strip_of(scene).body


def _smooth(body: Body, friction: float, amplitude: float) -> tuple[float, list[float]]:
    """Work and its logarithmic slopes by friction and load of a body, from cubics."""
    shifts = np.linspace(-WIDTH, WIDTH, POINTS)
    found = []
    for by in range(2):
        at = [(friction * np.exp(s * (by == 0)), amplitude * np.exp(s * (by == 1))) for s in shifts]
        values = np.log([float(works(body, *one, True)) for one in at])
        found.append(np.polynomial.Polynomial.fit(shifts, values, 3))
    return float(np.exp(found[0](0.0))), [float(fit.deriv()(0.0)) for fit in found]


def _row(values: dict[str, Any]) -> Record:
    friction, amplitude = values["contact.friction"], values["load.amplitude"]
    fine, smooth = _smooth(_body(values, FINE), friction, amplitude)
    row: Record = {"scene": values, "D": fine, "slopes": smooth}
    for nodes in NODES:
        for name, ask in zip(READ, (slopes, steps), strict=True):
            value, (by_friction, by_load) = ask(_body(values, nodes), friction, amplitude)
            logarithmic = [float(by_friction) * friction, float(by_load) * amplitude]
            errors = [s / float(value) / t - 1.0 for s, t in zip(logarithmic, smooth, strict=True)]
            row[f"{name} {nodes}"] = [float(value) / fine - 1.0, *errors]
    return row


def _summary(rows: list[Record]) -> Record:
    summary = {}
    for name in READ:
        for nodes in NODES:
            errors = 100.0 * np.abs([row[f"{name} {nodes}"] for row in rows])
            work, slope = errors[:, 0], errors[:, 1:].ravel()
            summary[f"{nodes} nodes, {name}"] = {
                "D_largest_percent": float(np.max(work)),
                "slope_median_percent": float(np.median(slope)),
                "slope_largest_percent": float(np.max(slope)),
            }
    return summary


def _over_friction() -> Record:
    """Work and its derivative over friction, on all grids and on the fine one."""
    curves: Record = {"friction": FRICTION.tolist()}
    for name, ask in zip(READ, (slopes, steps), strict=True):
        for nodes in NODES:
            body = _body(SHOWN, nodes)
            found = [ask(body, mu, SHOWN["load.amplitude"]) for mu in FRICTION]
            curves[f"{name} {nodes}"] = [[float(v), float(s[0])] for v, s in found]
    body = _body(SHOWN, FINE)
    values = [float(works(body, mu, SHOWN["load.amplitude"], True)) for mu in FRICTION]
    fit = np.polynomial.Polynomial.fit(FRICTION, values, 4)
    curves["fine"] = [[float(fit(mu)), float(fit.deriv()(mu))] for mu in FRICTION]
    return curves


def measure() -> Record:
    """Errors of random strips on all grids, and the curves of the chart."""
    rows = [_row(values) for values in strips()]
    return {"summary": _summary(rows), "rows": rows, "curves": _over_friction()}


def tell(record: Record) -> str:
    """Errors of each grid."""
    return as_text(record["summary"])


def draw(record: Record) -> Figure:
    """D and its derivative by friction over friction, on the polygon and on the spline."""
    curves = record["curves"]
    with style():
        figure, axes = plt.subplots(2, 2, sharex=True, sharey="row", figsize=(8.0, 5.6))
        for column, name in enumerate(reversed(READ)):
            for row, label in enumerate(("D", "dD/d friction")):
                at = axes[row, column]
                fine = np.array(curves["fine"])[:, row]
                at.plot(curves["friction"], fine, "k", lw=3, alpha=0.3, label=f"{FINE}, smooth")
                for nodes in NODES:
                    values = np.array(curves[f"{name} {nodes}"])[:, row]
                    at.plot(curves["friction"], values, label=f"{nodes} nodes")
                if not column:
                    at.set_ylabel(label)
            axes[0, column].set_title(f"read on the {name} of the events")
            axes[1, column].set_xlabel("friction")
        axes[0, 1].legend()
    return figure
