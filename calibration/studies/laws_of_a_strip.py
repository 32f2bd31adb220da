"""Laws of a joint in place of the standard strip: what each loses of its dissipation.

The standard strip of five heights is cycled between forces of .2 to 1.9 (gross slip is at 2).
Segalman's four parameters, Bouc-Wen, Jenkins and some numbers of parallel sliders are fitted to the
dissipation and the secant stiffness of these cycles over the displacement, all logarithms alike.
The error of D is that at the displacement which the strip reaches.  Takes minutes.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import jbeamshell as jb
from jbeamshell import plotting
from jbeamshell.identify.comparison import Comparison

HEIGHTS = (0.01, 0.0511, 0.1126, 0.2358, 0.4)
AMPLITUDES = np.linspace(0.2, 1.9, 18)
SHOWN = "0.1126"  # height whose energies are drawn
MODELS = ("iwan4", "bouc-wen", "jenkins", "sliders4", "sliders8", "sliders16")


def compared(eta: float) -> Comparison:
    """Comparison on the strip of one height."""
    scene = jb.library.standard().replace({"strip.height_ratio": eta})
    return jb.identify.compare(scene, MODELS, amplitudes=AMPLITUDES)


def figures(eta: float) -> dict[str, Any]:
    """Values, errors of D and misfit of each model on the strip of one height."""
    found = compared(eta)
    table = {}
    for row in found.rows[1:]:
        assert row.fit is not None, row.told
        error = np.abs(found.error(row))
        table[row.name] = {
            "values": row.fit.values,
            "error": found.error(row).tolist(),
            "median": float(np.median(error)),
            "worst": float(np.max(error)),
            "misfit": row.misfit,
            "status": row.fit.status.name.lower(),
        }
    return {"energy": found.energy.tolist(), "models": table}


def measure() -> dict[str, Any]:
    """Compare on all heights."""
    heights = {}
    for eta in HEIGHTS:
        heights[f"{eta:g}"] = figures(eta)
        for name, own in heights[f"{eta:g}"]["models"].items():
            told = f"median {100 * own['median']:.3g} %, worst {100 * own['worst']:.3g} %"
            print(f"eta {eta:g}  {name:10s} {told}, misfit {100 * own['misfit']:.3g} %")
    return {"amplitude": AMPLITUDES.tolist(), "heights": heights}


def draw(record: dict[str, Any]) -> Any:
    """Draw D over the force of one height, and the errors over all heights."""
    heights, force = record["heights"], np.array(record["amplitude"])
    one = heights[SHOWN]
    names = list(one["models"])
    with plotting.style():
        figure, (energies, errors) = plt.subplots(1, 2, figsize=(10.8, 4.4))
        for name, colour in zip(names, plotting.colours(len(names)), strict=True):
            energy = np.array(one["energy"]) * (1.0 + np.array(one["models"][name]["error"]))
            energies.plot(force, np.where(energy > 0.0, energy, np.nan), color=colour, label=name)
            eta = [float(key) for key in heights]
            for figure_of, line in (("median", "-"), ("worst", ":")):
                errs = [100.0 * heights[key]["models"][name][figure_of] for key in heights]
                errors.plot(eta, errs, line, marker="o", markersize=3.5, color=colour)
        energies.plot(force, one["energy"], label=rf"strip, $\eta$ = {SHOWN}", **plotting.DOTS)
        low = 0.3 * min(one["energy"])
        energies.set(xlabel=plotting.FORCE, ylabel="$D$, work per cycle  [force]", yscale="log")
        energies.set_ylim(bottom=low)
        energies.legend(loc="lower right")
        errors.set(xlabel=r"height  $\eta$", ylabel="error of $D$: median, dotted worst  [%]")
        errors.set(xscale="log", yscale="log")
        errors.yaxis.set_major_formatter("{x:g}")
        errors.set_xticks(eta, list(heights))
        errors.minorticks_off()
    return figure
