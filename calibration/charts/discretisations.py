"""Pictures of how strips are made discrete, compared: quadrature, grids, shooting, contact.

The record is that of calibration/methods, as in `jbeamshell.plotting.methods`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from jbeamshell.common.errors import InputError
from jbeamshell.plotting.style import FAINT, PALETTE, colours, single, style

Record = Mapping[str, Any]

OFF = "error of the dissipation  [1]"
SMALLEST = 1e-17  # of what is drawn on a logarithmic scale
EPS = float(np.finfo(float).eps)


def methods_locking(record: Record, axes: Axes | None = None) -> Axes:
    """Draw the deflection of a clamped strip over the exact one, by quadrature and height.

    Parameters
    ----------
    record : of calibration/methods
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into

    Raises
    ------
    InputError
        if the record has no section "grids"
    """
    section = section_of(record, "grids")
    with style():
        axes = single(axes)
        _families(axes, section["heights"], section["locking"])
        axes.set(xscale="log", xlabel=r"$\eta = H/(L/2)$  [1]", ylabel="deflection over exact  [1]")
        axes.set_title("locking of 20 elements")
        axes.legend(fontsize=7)
    return axes


def methods_oscillation(record: Record, axes: Axes | None = None) -> Axes:
    """Draw how far the squeeze overshoots at the edge of a load, by quadrature and element size.

    Parameters
    ----------
    record : of calibration/methods
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into

    Raises
    ------
    InputError
        if the record has no section "grids"
    """
    section = section_of(record, "grids")
    with style():
        axes = single(axes)
        _families(axes, section["elements_per_height"], section["oscillation"])
        axes.set(
            xscale="log", xlabel="elements per $H$  [1]", ylabel="overshoot over the load  [1]"
        )
        _ticks_at(axes, section["elements_per_height"])
        axes.set_title("oscillation of the squeeze")
        axes.legend(fontsize=7)
    return axes


def methods_grids(record: Record, axes: Axes | None = None) -> Axes:
    """Draw the error of the dissipation over the number of nodes, by grid and scene.

    Parameters
    ----------
    record : of calibration/methods
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into; dashed is the secant stiffness

    Raises
    ------
    InputError
        if the record has no section "grids"
    """
    section = section_of(record, "grids")
    rows = section["rows"]
    with style():
        axes = single(axes)
        for row, colour in zip(rows, colours(len(rows)), strict=True):
            label = f"{row['grid']}, {row['scene']}"
            nodes = section["nodes"]
            axes.loglog(nodes, sizes(row["dissipation_off"]), color=colour, marker="o", label=label)
            axes.loglog(nodes, sizes(row["stiffness_off"]), "--", color=colour, alpha=0.6)
        _ticks_at(axes, section["nodes"])
        axes.set(xlabel="nodes  [1]", ylabel=f"{OFF}\n(dashed: of the secant stiffness)")
        axes.legend(fontsize=7)
    return axes


def _ticks_at(axes: Axes, values: Sequence[float]) -> None:
    """Mark these values of a logarithmic scale, and no others."""
    axes.set_xticks(values, [f"{value:g}" for value in values])
    axes.minorticks_off()


def methods_shooting(record: Record, axes: Axes | None = None) -> Axes:
    """Draw the error of shooting over the digits by which the fastest solution grows.

    Parameters
    ----------
    record : of calibration/methods
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into, with what rounding times that growth would be

    Raises
    ------
    InputError
        if the record has no section "shooting"
    """
    section = section_of(record, "shooting")
    with style():
        axes = single(axes)
        families = {"squeezed": ([(r["growth"], r["error"]) for r in section["squeeze"]], "o")}
        for alpha in sorted({row["alpha"] for row in section["stuck"]}):
            found = [
                (r["growth"], r["path_error"])
                for r in section["stuck"]
                if r["alpha"] == alpha and r["path_error"] is not None
            ]
            families[rf"stuck, $\alpha = {alpha:g}$"] = (found, "s")
        for (label, (points, marker)), colour in zip(families.items(), PALETTE, strict=False):
            growth, error = np.array(points).T
            axes.semilogy(
                growth, np.maximum(error, SMALLEST), marker, color=colour, ms=4.0, label=label
            )
        axes.set(xlim=(0.0, 60.0), ylim=(SMALLEST, 1e6))
        digits = np.linspace(0.0, 60.0, 2)
        axes.semilogy(digits, EPS * 10.0**digits, color=FAINT, label="rounding times growth")
        axes.set(
            xlabel="growth of the fastest solution  [digits]", ylabel="error of the fields  [1]"
        )
        axes.set_title("shooting in double precision")
        axes.legend(fontsize=7)
    return axes


def methods_contacts(record: Record, axes: Axes | None = None) -> Axes:
    """Draw how a compliance comes to the active set's end of contact.

    Parameters
    ----------
    record : of calibration/methods
    axes : where to draw; new ones when not given

    Returns
    -------
    matplotlib.axes.Axes
        the axes drawn into: relative differences of three figures

    Raises
    ------
    InputError
        if the record has no section "contacts"
    """
    rigid, *soft = section_of(record, "contacts")["receding"]
    stiffness = [row["k_n"] for row in soft]
    names = {"contact_end": "end of contact", "reaction_max": "largest R", "lift_slope": "slope"}
    with style():
        axes = single(axes)
        for (key, label), colour in zip(names.items(), PALETTE, strict=False):
            off = [row[key] / rigid[key] - 1.0 for row in soft]
            axes.loglog(stiffness, sizes(off), color=colour, marker="o", label=label)
        axes.set(xlabel=r"$k_n\,H/E'$  [1]", ylabel="difference from the active set  [1]")
        low, high = min(r["iterations"] for r in soft), max(r["iterations"] for r in soft)
        axes.set_title(f"compliance: {low} to {high} iterations; active set: {rigid['iterations']}")
        axes.legend(fontsize=7)
    return axes


def _families(axes: Axes, x: Sequence[float], families: Mapping[str, Sequence[float]]) -> None:
    for (label, values), colour in zip(families.items(), PALETTE, strict=False):
        axes.plot(x, values, color=colour, marker="o", markersize=4.0, label=label)


def sizes(values: Any) -> np.ndarray:
    """Sizes to be drawn on a logarithmic scale; None and zero are gaps."""
    size = np.abs(np.asarray(values, float))
    return np.where(size > 0.0, size, np.nan)


def section_of(record: Record, name: str) -> Any:
    """A section of the record; `InputError` if it has none of that name."""
    if name not in record:
        raise InputError(f"record: has no section {name!r}")
    return record[name]
