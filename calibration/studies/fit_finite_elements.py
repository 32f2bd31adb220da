"""Fits of friction and height ratio to single finite-element loops of five strips.

Every loop is fitted by the plain call, which is plane elasticity, and by the beamshell with a
squeeze strain.  The true values are mu = 0.1 and the eta of the file, so what is off is the bias of
the model.  Writes fitted_finite_elements.json and finite_elements.png beside this file:

    python calibration/fit_finite_elements.py
"""

import itertools
import json
import time
import warnings
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from provenance import provenance  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell import identify, plotting  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.measured.example import HEIGHT_RATIOS, example_loops  # noqa: E402

HERE = Path(__file__).parent
FREE = ("contact.friction", "strip.height_ratio")
SYMBOLS = (r"$\mu$", r"$\eta$")
MODELS = {"plain call": {}, "beamshell": {"model.section": "squeeze"}}
LOADS = (0.4359, 0.7855, 1.3)  # in units of mu F_N L/2, so that gross slip is 2
TRUE_FRICTION, OFF = 0.1, 1.2  # friction, and start over truth
SHOWN = 0.1126  # height ratio whose loops are drawn


def study(height_ratio: float, load: float, model: dict) -> tuple[identify.Fit, dict]:
    """Fit one loop twice; the second time nothing is compiled."""
    truth = dict(zip(FREE, (TRUE_FRICTION, height_ratio), strict=True))
    start = {key: OFF * value for key, value in truth.items()}
    scene = jb.Scene().replace({"load.entry": "traction"} | start | model)
    loops = example_loops(height_ratio, (load,))
    for _ in range(2):
        begin = time.perf_counter()
        fit = identify.fit(loops, scene, FREE, throw=False)  # the record says how each ended
        seconds = time.perf_counter() - begin
    return fit, {
        "values": fit.values,
        "relative_bias": {key: fit.values[key] / truth[key] - 1.0 for key in FREE},
        "interval_95": fit.intervals,
        "holds_truth": {key: _holds(fit.intervals[key], truth[key]) for key in FREE},
        "misfit": fit.misfit,
        "status": fit.status,
        "model_runs": fit.model_runs,
        "wall_s_warm": seconds,
    }


def _holds(ends: tuple[float, float], value: float) -> bool:
    return ends[0] <= value <= ends[1]


def main() -> None:
    """Run all fits, print a table, write the record and the picture."""
    record: dict[str, dict] = {name: {} for name in MODELS}
    shown = []
    for (name, model), eta, load in itertools.product(MODELS.items(), HEIGHT_RATIOS, LOADS):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", jb.DoubtfulWarning)
            fit, figures = study(eta, load, model)
        record[name].setdefault(f"{eta:g}", {})[f"{load:g}"] = figures
        if name == "plain call" and eta == SHOWN:
            shown.append(fit)
        bias = [f"{100 * value:+.2f} %" for value in figures["relative_bias"].values()]
        print(f"{name:10s} eta {eta:<7g} A {load:<7g} mu, eta {', '.join(bias)}  {fit.status}")
    text = {"provenance": provenance(), "true_friction": TRUE_FRICTION, "fits": record}
    write_text(HERE / "fitted_finite_elements.json", json.dumps(text, indent=1) + "\n")
    plotting.save(picture(shown, record), HERE / "finite_elements.png")


def picture(fits: list[identify.Fit], record: dict) -> plt.Figure:
    """Picture of fitted loops over finite elements, and of the bias over the load."""
    with plotting.style():
        figure, axes = plt.subplots(1, 3, figsize=(13.0, 4.2), layout="constrained")
        for fit in fits:
            fit.plot(axes[0])
        axes[0].get_legend().remove()
        axes[0].set_title(rf"single loops of $\eta$ = {SHOWN:g}, fitted by the plain call")
        for axis, key, symbol in zip(axes[1:], FREE, SYMBOLS, strict=True):
            for name, marker in zip(MODELS, "os", strict=True):
                rows = [
                    (load / 2.0, abs(figures["relative_bias"][key]))
                    for loads in record[name].values()
                    for load, figures in ((float(a), one) for a, one in loads.items())
                ]
                axis.semilogy(*np.transpose(rows), marker, label=name, alpha=0.7)
            axis.axhline(0.01, color="0.6", lw=0.8)
            axis.set_xticks([load / 2.0 for load in LOADS])
            axis.set(xlabel="load over gross slip  [1]", ylabel=f"bias of {symbol}  [1]")
            axis.set_title(f"{symbol} from one loop, height ratios .03 to .4")
        axes[1].legend()
    return figure


if __name__ == "__main__":
    main()
