"""Drawings of the strip and of the lap joint, and the first results of the pages.

Run ``python notebooks/pictures/draw.py``: it writes its pictures beside itself.
"""

from pathlib import Path

import jax
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

import jbeamshell as jb
from jbeamshell import plotting

FOLDER = Path(__file__).parent
INK, STEEL, PALE, SLIP, LOAD = "0.15", "#b9cbdc", "#dfe6ec", "#D55E00", "#0072B2"
matplotlib.rcParams.update({"svg.hashsalt": "jbeamshell", "svg.fonttype": "path", "font.size": 11})


def arrow(axes: Axes, tail: tuple, head: tuple, colour: str = INK, both: bool = False) -> None:
    """Arrow from tail to head."""
    style = {"arrowstyle": "<|-|>" if both else "-|>", "color": colour, "lw": 1.4}
    axes.annotate("", head, tail, arrowprops={**style, "shrinkA": 0, "shrinkB": 0})


def hatched(axes: Axes, x: float, y: float, width: float, height: float) -> None:
    """Ground or wall that does not move."""
    axes.add_patch(Rectangle((x, y), width, height, fc="none", ec="0.55", hatch="/////", lw=0))


def pressure(axes: Axes, left: float, right: float, top: float, down: bool = True) -> None:
    """Row of arrows that press on a face at height `top`."""
    tail = top + (0.42 if down else -0.42)
    axes.plot([left, right], [tail, tail], color=LOAD, lw=1.2)
    for x in np.linspace(left, right, max(3, round((right - left) / 0.55) + 1)):
        arrow(axes, (x, tail), (x, top), LOAD)


def frame(width: float, height: float) -> tuple:
    """Figure and axes without a frame, of equal scales."""
    figure, axes = plt.subplots(figsize=(width, height))
    axes.set_aspect("equal")
    axes.axis("off")
    return figure, axes


def write(figure: plt.Figure, name: str) -> None:
    """Write a drawing, the same bytes at every run."""
    figure.savefig(FOLDER / name, bbox_inches="tight", metadata={"Date": None}, facecolor="white")
    plt.close(figure)


def strip() -> None:
    """Strip on a rigid rough base."""
    figure, axes = frame(8.4, 2.9)
    length, height = 6.0, 1.0
    hatched(axes, -0.5, -0.3, length + 1.6, 0.3)
    hatched(axes, -0.3, 0.0, 0.3, height + 0.15)
    axes.plot([-0.5, length + 1.1], [0, 0], color=INK, lw=1.2)
    axes.plot([0, 0], [0, height + 0.15], color=INK, lw=1.2)
    axes.add_patch(Rectangle((0, 0), length, height, fc=STEEL, ec=INK, lw=1.2))
    pressure(axes, 0.15, length - 0.05, height)
    axes.text(length / 2, height + 0.52, "contact.pressure $p$", color=LOAD, ha="center")
    axes.plot([3.6, length], [0, 0], color=SLIP, lw=5, solid_capstyle="butt")
    axes.text(4.8, 0.14, "slips", color=SLIP, ha="center")
    axes.text(1.8, 0.14, "sticks", color=INK, ha="center")
    arrow(axes, (length + 0.05, height / 2), (length + 0.95, height / 2), LOAD, both=True)
    axes.text(
        length + 1.05, height / 2, "end force $F$,\nfrom $A$ to $-A$", color=LOAD, va="center"
    )
    axes.plot([length, length], [height + 0.05, height + 0.85], color="0.5", lw=0.8)
    arrow(axes, (length, height + 0.75), (length + 0.55, height + 0.75))
    axes.text(length + 0.65, height + 0.75, "end displacement $u$", va="center")
    arrow(axes, (0.35, 0), (0.35, height), both=True)
    axes.text(0.45, 0.62, "$2H$ = thickness", va="center")
    arrow(axes, (0, -0.5), (length, -0.5), both=True)
    axes.text(length / 2, -0.6, "$L$ = strip.length", ha="center", va="top")
    axes.text(0, -0.6, "$X = 0$, held", ha="center", va="top")
    axes.text(length, -0.6, "$X = L$, pulled", ha="center", va="top")
    axes.text(length + 1.15, -0.15, "rigid rough base,\nfriction $\\mu$", va="center")
    axes.set_xlim(-0.6, length + 3.2)
    axes.set_ylim(-1.0, height + 1.05)
    write(figure, "strip.svg")


def lap_joint() -> None:
    """Two members that lap, pressed together by a bolt."""
    figure, axes = frame(8.4, 3.1)
    length, height, over = 4.0, 0.7, 1.3
    hatched(axes, -over - 0.3, -height - 0.2, 0.3, height + 0.4)
    axes.plot([-over, -over], [-height - 0.2, 0.2], color=INK, lw=1.2)
    axes.add_patch(Rectangle((-over, -height), length + over, height, fc=PALE, ec=INK, lw=1.2))
    axes.add_patch(Rectangle((0, 0), length + over, height, fc=STEEL, ec=INK, lw=1.2))
    left, right = 1.3, 2.7
    for x, away in ((left, -0.7), (right, 0.7)):  # the cone in which the bolt's force spreads
        axes.plot([x, x + away * 0.55], [height, 0], color=LOAD, lw=0.8, ls=":")
        axes.plot([x, x + away * 0.55], [-height, 0], color=LOAD, lw=0.8, ls=":")
    pressure(axes, left, right, height)
    pressure(axes, left, right, -height, down=False)
    axes.text(
        2.0, height + 0.52, "bolt: a patch of pressure on both faces", color=LOAD, ha="center"
    )
    for a, b in ((0.9, 1.35), (2.65, 3.1)):
        axes.plot([a, b], [0, 0], color=SLIP, lw=5, solid_capstyle="butt")
    axes.text(1.05, 0.13, "slips", color=SLIP, ha="center")
    axes.text(2.95, 0.13, "slips", color=SLIP, ha="center")
    axes.text(2.0, 0.13, "sticks", ha="center")
    axes.text(length + over / 2, height / 2, "strip", ha="center", va="center")
    axes.text(-over / 2, -height / 2, "second\nmember", ha="center", va="center")
    end = length + over
    arrow(axes, (end + 0.05, height / 2), (end + 0.95, height / 2), LOAD, both=True)
    axes.text(end + 1.05, height / 2, "$F$, $u$", color=LOAD, va="center")
    for x, label in ((0, "$X = 0$"), (length, "$X = L$")):
        axes.plot([x, x], [-height - 0.1, -height - 0.75], color="0.5", lw=0.8)
        axes.text(x, -height - 0.85, label, ha="center", va="top")
    arrow(axes, (0, -height - 0.66), (length, -height - 0.66), both=True)
    axes.text(2.0, -height - 0.76, "overlap", ha="center", va="top")
    axes.text(-over, -height - 0.35, "held", ha="center", va="top")
    axes.annotate(
        "strip.overhang", (length + over / 2, height), (length + 0.9, height + 0.62),
        arrowprops={"arrowstyle": "-", "color": "0.5", "lw": 0.8},
    )  # fmt: skip
    axes.annotate(
        "member.overhang", (-over / 2, 0.0), (-2.6, 0.55),
        arrowprops={"arrowstyle": "-", "color": "0.5", "lw": 0.8},
    )  # fmt: skip
    axes.set_xlim(-2.65, end + 1.6)
    axes.set_ylim(-height - 1.15, height + 1.0)
    write(figure, "lap_joint.svg")


def first_results() -> None:
    """Loop of the page "Start here", and deformed members of the page of lap joints."""
    jax.config.update("jax_enable_x64", True)
    strip = {"strip.length": 120.0, "strip.half_height": 6.0, "strip.youngs_modulus": 210e3}
    contact = {"contact.friction": 0.2, "contact.pressure": 10.0, "load.amplitude": 120.0}
    axes = jb.solve(jb.Scene().replace(strip | contact)).plot()
    names = {"length": "mm", "force/width": "N/mm"}
    plotting.in_units(axes, names)
    axes.figure.savefig(FOLDER / "first_loop.png", dpi=110)
    axes = jb.solve(jb.library.single_lap()).plot_deformed()
    axes.figure.savefig(FOLDER / "first_lap_joint.png", dpi=110)


if __name__ == "__main__":
    strip()
    lap_joint()
    first_results()
