"""Fits of friction and height ratio to single finite-element loops of five strips.

Every loop is fitted by the plain call, which is plane elasticity, and by the beamshell with a
squeeze strain.  The true values are mu = 0.1 and the eta of the file, so what is off is the bias of
the model.  Takes minutes.
"""

import itertools
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import jbeamshell as jb
from jbeamshell import identify, plotting
from jbeamshell.measured.example import HEIGHT_RATIOS, example_loops

FREE = ("contact.friction", "strip.height_ratio")
SYMBOLS = (r"$\mu$", r"$\eta$")
MODELS = {"plain call": {}, "beamshell": {"model.section": "squeeze"}}
LOADS = (0.4359, 0.7855, 1.3)  # in units of mu F_N L/2, so that gross slip is 2
TRUE_FRICTION, OFF = 0.1, 1.2  # friction, and start over truth
SHOWN = "plain call", 0.1126  # whose loops are drawn


def study(height_ratio: float, load: float, model: dict) -> dict[str, Any]:
    """Figures of a fit to one loop, with the loop."""
    truth = dict(zip(FREE, (TRUE_FRICTION, height_ratio), strict=True))
    start = {key: OFF * value for key, value in truth.items()}
    scene = jb.Scene().replace({"load.entry": "traction"} | start | model)
    loops = example_loops(height_ratio, (load,))
    fit = identify.fit(loops, scene, FREE, throw=False)  # the record says how each ended
    (loop,), (answer,) = fit.data, fit.model
    drawn = {"force": loop.force, "measured": loop.displacement, "fitted": answer.displacement}
    return {
        "values": fit.values,
        "relative_bias": {key: fit.values[key] / truth[key] - 1.0 for key in FREE},
        "interval_95": fit.intervals,
        "holds_truth": {key: _holds(fit.intervals[key], truth[key]) for key in FREE},
        "misfit": fit.misfit,
        "status": fit.status.name.lower(),
        "model_runs": fit.model_runs,
        "loop": {name: np.asarray(values).tolist() for name, values in drawn.items()},
    }


def _holds(ends: tuple[float, float], value: float) -> bool:
    return ends[0] <= value <= ends[1]


def measure() -> dict[str, Any]:
    """Run all fits; the loops of one strip are kept to be drawn."""
    found: dict[str, dict] = {name: {} for name in MODELS}
    for (name, model), eta, load in itertools.product(MODELS.items(), HEIGHT_RATIOS, LOADS):
        figures = study(eta, load, model)
        if (name, eta) != SHOWN:
            del figures["loop"]
        found[name].setdefault(f"{eta:g}", {})[f"{load:g}"] = figures
        bias = [f"{100 * value:+.2f} %" for value in figures["relative_bias"].values()]
        print(f"{name:10s} eta {eta:<7g} A {load:<7g} mu, eta {', '.join(bias)}")
    return {"true_friction": TRUE_FRICTION, "fits": found}


def draw(record: dict[str, Any]) -> plt.Figure:
    """Picture of fitted loops over finite elements, and of the bias over the load."""
    with plotting.style():
        figure, axes = plt.subplots(1, 3, figsize=(13.0, 4.2), layout="constrained")
        name, eta = SHOWN
        for colour, figures in zip(
            plotting.PALETTE, record["fits"][name][f"{eta:g}"].values(), strict=False
        ):
            loop = figures["loop"]
            axes[0].plot(loop["fitted"], loop["force"], color=colour)
            axes[0].plot(loop["measured"], loop["force"], **plotting.DOTS)
        axes[0].legend(["fit", "finite elements"])
        axes[0].set(xlabel=plotting.DISPLACEMENT, ylabel=plotting.FORCE)
        axes[0].set_title(rf"single loops of $\eta$ = {eta:g}, fitted by the {name}")
        for axis, key, symbol in zip(axes[1:], FREE, SYMBOLS, strict=True):
            for name, marker in zip(MODELS, "os", strict=True):
                rows = [
                    (load / 2.0, abs(figures["relative_bias"][key]))
                    for loads in record["fits"][name].values()
                    for load, figures in ((float(a), one) for a, one in loads.items())
                ]
                axis.semilogy(*np.transpose(rows), marker, label=name, alpha=0.7)
            axis.axhline(0.01, color="0.6", lw=0.8)
            axis.set_xticks([load / 2.0 for load in LOADS])
            axis.set(xlabel="load over gross slip  [1]", ylabel=f"bias of {symbol}  [1]")
            axis.set_title(f"{symbol} from one loop, height ratios .03 to .4")
        axes[1].legend()
    return figure
