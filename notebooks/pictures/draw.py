"""Drawings of the strip, of the ways a force enters it and of the lap joint, and first results.

Run ``python notebooks/pictures/draw.py``: it writes its pictures beside itself.
"""

import warnings
from pathlib import Path

import jax
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyArrowPatch, Polygon, Rectangle

import jbeamshell as jb
from jbeamshell import plotting

FOLDER = Path(__file__).parent
INK, STEEL, PALE, SLIP, LOAD = "0.15", "#b9cbdc", "#dfe6ec", "#D55E00", "#0072B2"
RIGID, TALL = "0.45", 0.95  # what does not bend; height of the strip in `entries`
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


def broken(axes: Axes, x: float, height: float, width: float, colour: str) -> None:
    """Piece of a member that goes on: from x to a wavy edge at x + width."""
    y = np.linspace(0.0, height, 41)
    edge = x + width + 0.05 * np.sin(2.0 * np.pi * y / height)
    axes.add_patch(Polygon([(x, 0), *zip(edge, y, strict=True), (x, height)], fc=colour, lw=0))
    axes.plot(edge, y, color=INK, lw=0.8)
    for side in (0.0, height):
        axes.plot([x, x + width], [side, side], color=INK, lw=1.2)


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
    hatched(axes, -0.5, -0.3, length + 0.5, 0.3)
    hatched(axes, -0.3, 0.0, 0.3, height + 0.15)
    axes.plot([-0.5, length, length], [0, 0, -0.3], color=INK, lw=1.2)
    axes.plot([0, 0], [0, height + 0.15], color=INK, lw=1.2)
    axes.add_patch(Rectangle((0, 0), length, height, fc=STEEL, ec=INK, lw=1.2))
    broken(axes, length, height, 1.2, PALE)
    pressure(axes, 0.15, length - 0.05, height)
    axes.text(length / 2, height + 0.52, "contact.pressure $p$", color=LOAD, ha="center")
    axes.plot([3.6, length], [0, 0], color=SLIP, lw=5, solid_capstyle="butt")
    axes.text(4.8, 0.14, "slips", color=SLIP, ha="center")
    axes.text(1.8, 0.14, "sticks", color=INK, ha="center")
    axes.text(length + 0.6, height / 2, "goes on", ha="center", va="center")
    end = length + 1.3
    arrow(axes, (end, height / 2), (end + 0.8, height / 2), LOAD, both=True)
    axes.text(end + 0.9, height / 2, "end force $F$,\nfrom $A$ to $-A$", color=LOAD, va="center")
    axes.plot([length, length], [height + 0.05, height + 0.85], color="0.5", lw=0.8)
    arrow(axes, (length, height + 0.75), (length + 0.55, height + 0.75))
    axes.text(length + 0.65, height + 0.75, "displacement $u$ at $X = L$", va="center")
    arrow(axes, (0.35, 0), (0.35, height), both=True)
    axes.text(0.45, 0.62, "$2H$ = thickness", va="center")
    arrow(axes, (0, -0.5), (length, -0.5), both=True)
    axes.text(length / 2, -0.6, "$L$ = strip.length", ha="center", va="top")
    axes.text(0, -0.6, "$X = 0$, held", ha="center", va="top")
    axes.text(length, -0.6, "$X = L$", ha="center", va="top")
    axes.text(length + 0.12, -0.2, "rigid rough base, friction $\\mu$", va="center")
    axes.set_xlim(-0.6, length + 3.7)
    axes.set_ylim(-1.0, height + 1.05)
    write(figure, "strip.svg")


def end_part(axes: Axes, word: str, meaning: str) -> None:
    """End of a pressed strip at X = L, which is x = 0, and what `load.entry` calls it."""
    hatched(axes, -2.3, -0.3, 2.3, 0.3)
    axes.plot([-2.3, 0, 0], [0, 0, -0.3], color=INK, lw=1.2)
    broken(axes, 0.0, TALL, -2.2, STEEL)
    pressure(axes, -2.15, -0.03, TALL)
    axes.plot([0, 0], [-0.36, -0.5], color="0.5", lw=0.8)
    axes.text(0, -0.55, "$X = L$", ha="center", va="top")
    axes.text(-2.3, 1.98, word, family="monospace", weight="bold", va="center")
    axes.text(-2.3, 1.66, meaning, va="center")


def entries() -> None:
    """Four ways in which the force enters the loaded end."""
    figure, grid = plt.subplots(2, 2, figsize=(8.4, 5.4))
    for axes in grid.flat:
        axes.set_aspect("equal")
        axes.axis("off")
        axes.set_xlim(-2.4, 2.3)
        axes.set_ylim(-0.85, 2.15)
    figure.subplots_adjust(0, 0, 1, 1, 0.02, 0.02)
    member, face, guided, traction = grid.flat
    middle = TALL / 2

    end_part(member, "member", "goes on, and is pulled evenly far away")
    broken(member, 0.0, TALL, 1.4, STEEL)
    for y in np.linspace(0.1, TALL - 0.1, 4):
        arrow(member, (1.5, y), (1.9, y), LOAD)
    member.text(2.0, middle, "$F$", color=LOAD, va="center")

    end_part(face, "face", "a rigid face that may turn")
    face.add_patch(Rectangle((0, 0), 0.2, TALL, fc=RIGID, ec=INK, lw=1.2))
    lug = [(0.2, middle - 0.22), (0.2, middle + 0.22), (0.5, middle + 0.1), (0.5, middle - 0.1)]
    face.add_patch(Polygon(lug, fc=RIGID, ec=INK, lw=1.2))
    face.add_patch(Circle((0.5, middle), 0.13, fc="white", ec=INK, lw=1.2))
    arrow(face, (0.63, middle), (1.5, middle), LOAD)
    face.text(1.6, middle, "$F$", color=LOAD, va="center")
    turn = {"arrowstyle": "<|-|>", "mutation_scale": 10, "color": INK, "lw": 1.3}
    ends = (0.25, TALL + 0.14), (1.04, middle + 0.3)
    face.add_patch(FancyArrowPatch(*ends, connectionstyle="arc3,rad=-0.38", **turn))

    end_part(guided, "guided", "a rigid face that may not turn")
    guided.add_patch(Rectangle((0, 0), 1.1, TALL, fc=RIGID, ec=INK, lw=1.2))
    for rail, way in ((-0.2, -1.0), (TALL + 0.2, 1.0)):
        hatched(guided, 0.12, min(rail, rail + 0.2 * way), 1.5, 0.2)
        guided.plot([0.12, 1.62], [rail, rail], color=INK, lw=1.2)
        for x in (0.28, 0.9):
            guided.add_patch(Circle((x, rail - 0.1 * way), 0.1, fc="white", ec=INK, lw=1.1))
    arrow(guided, (1.1, middle), (1.9, middle), LOAD)
    guided.text(2.0, middle, "$F$", color=LOAD, va="center")

    end_part(traction, "traction", "spread evenly over the face")
    traction.plot([0, 0], [0, TALL], color=INK, lw=1.2)
    for y in np.linspace(0.06, TALL - 0.06, 6):
        arrow(traction, (0.03, y), (0.6, y), LOAD)
    traction.text(0.72, middle, "$F/2H$", color=LOAD, va="center")
    write(figure, "entries.svg")


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
    jb.solve(jb.Scene()).plot().figure.savefig(FOLDER / "standard_loop.png", dpi=110)
    axes = jb.solve(jb.library.single_lap()).plot_deformed()
    axes.figure.savefig(FOLDER / "first_lap_joint.png", dpi=110)
    bolted_joint()


def bolted_joint() -> None:
    """Bolted lap joint of the page "A drawing and no test"."""
    jax.config.update("jax_enable_x64", True)
    plates = {"length": "100 mm", "thickness": "8 mm", "width": "30 mm", "overhang": "100 mm"}
    bolts = {"bolts": "2xM8@30mm,70mm", "torque": "25 N m", "friction": 0.2, "force": "4 kN"}
    joint = jb.LapJoint("single-lap", modulus="210 GPa", **plates, **bolts)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jb.DoubtfulWarning)
        axes = joint.solve().plot_joint()
    plotting.in_units(axes, {"length": "m", "force": "N", "stress": "Pa"})
    axes[0, 0].figure.savefig(FOLDER / "bolted_joint.png", dpi=110)


if __name__ == "__main__":
    strip()
    entries()
    lap_joint()
    first_results()
