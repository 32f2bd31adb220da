"""Pictures of a strip or a lap joint as it deforms, with its pressures and its contact."""

from __future__ import annotations

from typing import Any

import numpy as np
from jax import Array
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from jbeamshell.plotting.protocols import LoadPath
from jbeamshell.plotting.steps import checked_steps, load_label
from jbeamshell.plotting.style import DATA, FAINT, POSITION, SLIPS, STICKS, below, single, style

SHARE = 0.8  # of the half height H, as which the largest displacement is drawn
STATES: dict[str, tuple[str, Any]] = {  # colour and line
    "sticks": (STICKS, "-"),
    "slips": (SLIPS, "-"),
    "is lifted": ("0.55", ":"),
}
ARROWS = 24  # of the pressure on a face, at most
BEAM = 21  # points along an overhang
FILL = ("#E8EEF4", "#F4EFE6")  # upper and lower member


def deformed(
    history: LoadPath,
    step: int | None = None,
    axes: Axes | None = None,
    *,
    scale: float | None = None,
    sections: int = 0,
) -> Axes:
    """Draw the deformed members with their pressures, and where the contact sticks, slips or lifts.

    Displacements along X are counted from the pressed members, as u(L) is.
    Overhangs of a lap joint are beams without shear from the contact's ends to theirs.

    Parameters
    ----------
    history : LoadPath
        Solved load path of a strip or of a lap joint, such as a `jbeamshell.History`.
    step : int, optional
        Index into the path; the end of the last cycle when not given.
    axes : matplotlib.axes.Axes, optional
        Where to draw; new axes when not given.
    scale : float, optional
        Factor of the displacements; when not given, one that makes them visible.
    sections : int
        Number of cross-sections to draw, dark where the contact slips.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into, with X and heights in the units of the scene.

    Raises
    ------
    InputError
        If there is no such step.
    """
    last = history.cycles[-1][2] if history.cycles else history.force.size - 1
    (step,) = checked_steps(history, [last if step is None else step])
    x, members = np.asarray(history.x), _members(history)
    height = members[0][1]
    paths = [_faces(fields, up) for fields, up in members]
    moves = [(contact[step], face[step]) for contact, face in paths]
    beyond = _overhangs(history, step, members)
    factor = visible_scale(history) if scale is None else scale
    with style():
        axes = single(axes)
        axes.grid(False)
        for (_, up), (contact, face), more, fill in zip(members, moves, beyond, FILL, strict=False):
            at, low, high = np.concatenate([more[0][0], x, more[1][0]]), contact, face
            low = np.concatenate([more[0][1], low, more[1][1]])
            high = np.concatenate([more[0][2], high, more[1][2]])
            outline = np.concatenate(
                [_moved(at, 0.0, low, factor), _moved(at, up, high, factor)[::-1]]
            )
            axes.fill(*outline.T, facecolor=fill, edgecolor=DATA, linewidth=0.8)
        _draw_supports(axes, history, members[-1][1])
        _draw_pressures(axes, history, members, moves, factor)
        for (_, up), (contact, face) in zip(members, moves, strict=True):
            faces = _moved(x, 0.0, contact, factor), _moved(x, up, face, factor)
            _draw_sections(axes, history, step, faces, sections)
        _draw_contact(axes, history, step, _moved(x, 0.0, moves[0][0], factor))
        force = float(history.force[step])
        if abs(force) > 0.0:
            corner = _moved(x, height, moves[0][1], factor)[-1:]
            tip = np.concatenate(
                [corner, _moved(beyond[0][1][0], height, beyond[0][1][2], factor)]
            )[-1]
            start = (tip[0] + 0.01 * x[-1], tip[1] - 0.5 * height)
            stop = (start[0] + 0.08 * x[-1], start[1])
            ends = (stop, start) if force > 0.0 else (start, stop)
            axes.annotate("", *ends, arrowprops={"arrowstyle": "-|>", "color": DATA})
        axes.set(xlabel=POSITION, ylabel="height  [length]", xlim=_reach(history, 0.04, 0.12))
        times = f"{factor:.0f}" if factor >= 10.0 else f"{factor:.3g}"
        axes.set_title(f"{load_label(history, step)}, displacements x {times}")
        keys = [
            Line2D([], [], color=colour, linestyle=line, linewidth=3.0, label=name)
            for name, (colour, line) in STATES.items()
        ]
        below(axes, keys)
    return axes


def visible_scale(history: LoadPath) -> float:
    """Factor of the displacements with which the largest of a path is seen."""
    members = _members(history)
    return _visible([_faces(fields, up) for fields, up in members], members[0][1])


def _members(history: LoadPath) -> list[tuple[NDArray[np.float64], float]]:
    """Fields (steps, n, m) of each member, and the height of its outer face over the contact."""
    scene = history.scene
    members = [(_since_pressing(history, history.fields), 2.0 * float(scene.strip.half_height))]
    if history.member is not None:
        below = -2.0 * float(scene.member.beside(scene.strip).half_height)
        members.append((_since_pressing(history, history.member), below))
    return members


def _since_pressing(history: LoadPath, fields: Array) -> NDArray[np.float64]:
    """Fields of a member, with v counted from the pressed member where loads follow."""
    counted, pressed = np.array(fields), history.pressed
    if pressed + 1 < counted.shape[0]:
        counted[pressed:, :, 0] -= counted[pressed, :, 0].copy()
    return counted


def _faces(
    fields: NDArray[np.float64], up: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacements (steps, n, 2) of the contact face and of the face at a height."""
    v, w, beta, psi = (fields[..., i] for i in range(4))
    return np.stack([v, w], axis=-1), np.stack([v - up * beta, w + up * psi], axis=-1)


Part = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def _overhangs(
    history: LoadPath, step: int, members: list[tuple[NDArray[np.float64], float]]
) -> list[tuple[Part, Part]]:
    """Parts of each member before X = 0 and beyond L: X, and displacements of both its faces."""
    scene, x = history.scene, np.asarray(history.x)
    none: Part = np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2))
    found = [(none, none) for _ in members]
    if scene.strip.overhang is not None:
        fields, up = members[0]
        size = float(scene.strip.overhang)
        strain = float(history.force[step]) / float(scene.strip.stretching_stiffness)
        s = np.linspace(0.0, 1.0, BEAM)
        _, w, beta, _ = (float(value) for value in fields[step, -1, :4])
        bend = 0.0 if scene.strip.loaded_end == "free" else -(w + beta * size)
        lift = beta * size * s + bend * (1.5 * s**2 - 0.5 * s**3)  # no moment at the end
        turned = beta + bend * (3.0 * s - 1.5 * s**2) / size - beta
        part = _part(fields[step, -1], up, x[-1] + size * s, strain * size * s, lift, turned)
        found[0] = none, part
    if history.member is not None and scene.member.overhang is not None:
        fields, up = members[1]
        size = float(scene.member.overhang)
        s = np.linspace(1.0, 0.0, BEAM)  # from the clamp on
        v, w, beta, _ = (float(value) for value in fields[step, 0, :4])
        v -= 0.5 * up * beta  # at mid-height
        bends = scene.member.support == "clamped"
        whole = _clamped(w, beta * size, 1.0 - s) if bends else w
        slope = _slope(w, beta * size, 1.0 - s) / size if bends else beta * (1.0 - s)
        lift, turned = whole - w + 0.0 * s, slope - beta + 0.0 * s
        found[1] = _part(fields[step, 0], up, -size * s, -v * s, lift, turned), none
    return found


def _part(
    section: NDArray[np.float64],
    up: float,
    x: NDArray[np.float64],
    along: NDArray[np.float64],
    lift: NDArray[np.float64],
    turned: NDArray[np.float64],
) -> Part:
    """Overhang whose sections go along, lift and turn beyond the one at the contact's end."""
    v, w, beta, psi = (float(value) for value in section[:4])
    middle = v - 0.5 * up * beta + along
    turn = 0.5 * up * (beta + turned)
    low = np.stack([middle + turn, w + lift], axis=1)
    return x, low, np.stack([middle - turn, w + lift + up * psi], axis=1)


def _clamped(w: float, slope: float, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Deflection of a beam from a clamp at t = 0 to w and a slope at t = 1."""
    return w * t**2 * (3.0 - 2.0 * t) + slope * t**2 * (t - 1.0)


def _slope(w: float, slope: float, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative of `_clamped`."""
    return 6.0 * w * t * (1.0 - t) + slope * t * (3.0 * t - 2.0)


def _reach(history: LoadPath, before: float, beyond: float) -> tuple[float, float]:
    """Range of X of both members, with margins in parts of it."""
    ends = history.scene.member.overhang, history.scene.strip.overhang
    first, last = (0.0 if end is None else float(end) for end in ends)
    stop = float(history.x[-1]) + last
    return -first - before * (first + stop), stop + beyond * (first + stop)


def _visible(paths: list[tuple[NDArray[np.float64], NDArray[np.float64]]], height: float) -> float:
    """Factor with which the largest displacement of a path is seen."""
    largest = max(float(np.nanmax(np.abs(np.stack(path)))) for path in paths)
    return _rounded(SHARE * 0.5 * height / largest) if largest > 0.0 else 1.0


def _moved(
    x: NDArray[np.float64], height: float, moves: NDArray[np.float64], factor: float
) -> NDArray[np.float64]:
    """Points (n, 2) of a face with its displacements times a factor."""
    return np.stack([x, np.full_like(x, height)], axis=1) + factor * moves


def _rounded(value: float) -> float:
    """Largest of 1, 2 and 5 times a power of ten that is no larger."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(part for part in (1.0, 2.0, 5.0) if part * power <= value) * power)


def _draw_supports(axes: Axes, history: LoadPath, bottom: float) -> None:
    """Rigid base, symmetry plane, and the faces that are held or guided."""
    scene = history.scene
    support, top = scene.member.support, 2.0 * float(scene.strip.half_height)
    if support == "rolling":
        axes.axhline(bottom, color=DATA, linewidth=0.9, linestyle="-.")
    elif support == "none" and scene.contact.normal != "none":
        axes.axhline(0.0, color=DATA, linewidth=1.0)
    held = support != "none" or scene.strip.far_end != "free"
    if held:
        face = (bottom, 0.0) if support != "none" else (0.0, top)
        first = 0.0 if scene.member.overhang is None else -float(scene.member.overhang)
        axes.plot([first, first], face, color=DATA, linewidth=3.5, solid_capstyle="butt")
    if scene.strip.loaded_end == "guided":
        end = float(history.x[-1])
        end += 0.0 if scene.strip.overhang is None else float(scene.strip.overhang)
        axes.plot([end, end], [0.0, top], color=DATA, linewidth=2.5, linestyle=(0, (1, 1)))


def _draw_pressures(
    axes: Axes,
    history: LoadPath,
    members: list[tuple[NDArray[np.float64], float]],
    moves: list[tuple[NDArray[np.float64], NDArray[np.float64]]],
    factor: float,
) -> None:
    """Arrows of the pressures on the outer faces."""
    contact, x = history.scene.contact, np.asarray(history.x)
    size = 0.6 * members[0][1] / float(contact.largest_pressure)
    tables = [(np.asarray(contact.pressure), 0, 1.0)]
    if history.member is not None:
        tables.append((np.asarray(contact.bottom_pressure), 1, -1.0))
    at = np.linspace(0.0, float(x[-1]), ARROWS + 1)[:-1] + 0.5 * float(x[-1]) / ARROWS
    for table, member, way in tables:
        pressure = np.full_like(at, table) if table.ndim == 0 else _at(at, table)
        face = _moved(x, members[member][1], moves[member][1], factor)
        for place, value in zip(at, pressure, strict=True):
            if value > 0.0:
                foot = np.interp(place, x, face[:, 1])
                axes.annotate(
                    "",
                    (place, foot),
                    (place, foot + way * size * value),
                    arrowprops={"arrowstyle": "->", "color": FAINT, "linewidth": 0.8},
                )
        axes.update_datalim([(0.0, 1.7 * members[member][1])])
    axes.autoscale_view()


def _at(x: NDArray[np.float64], table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pressure of a table at positions; its end values go on beyond it."""
    return np.interp(x, table[:, 0], table[:, 1])


def _draw_sections(
    axes: Axes,
    history: LoadPath,
    step: int,
    ends: tuple[NDArray[np.float64], NDArray[np.float64]],
    count: int,
) -> None:
    """Cross-sections between two faces at evenly spaced nodes, dark where the contact slips."""
    x = np.asarray(history.x)
    nodes = np.unique(np.abs(x[:, None] - np.linspace(x[0], x[-1], count)).argmin(axis=0))
    slips = np.asarray(history.slipping[step])[nodes]
    lines = np.stack([end[nodes] for end in ends], axis=1)
    widths, shades = np.where(slips, 1.2, 0.6), np.where(slips, DATA, FAINT)
    axes.add_collection(LineCollection(list(lines), colors=list(shades), linewidths=widths))


def _draw_contact(axes: Axes, history: LoadPath, step: int, points: NDArray[np.float64]) -> None:
    """Contact face in the colours of what its nodes do."""
    if history.scene.contact.normal == "none":
        return
    touching, slipping = (np.asarray(a[step]) for a in (history.touching, history.slipping))
    middle = 0.5 * (points[1:] + points[:-1])
    begin = np.concatenate([points[:1], middle])
    end = np.concatenate([middle, points[-1:]])
    kinds = np.where(touching, np.where(slipping, 1, 0), 2)
    for kind, (colour, line) in enumerate(STATES.values()):
        parts = np.stack([begin, points, end], axis=1)[kinds == kind]
        axes.add_collection(
            LineCollection(parts, colors=colour, linestyles=line, linewidths=3.0, zorder=3)
        )
