"""Shape of a deformed strip or lap joint: outlines of its members, and what its contact does."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jax import Array
from numpy.typing import NDArray

SHARE = 0.8  # of the half height H, as which the largest displacement is drawn
ARROWS = 24  # of the pressure on a face, at most
BEAM = 21  # points along an overhang
KINDS = ("sticks", "slips", "is lifted")


class Shape(NamedTuple):
    """Deformed members at one step, in the units of the scene.

    Attributes
    ----------
    factor : factor of the displacements
    heights : height of the outer face of each member before loading; the contact is at zero
    outlines : closed outline (k, 2) of each member
    inner, outer : contact face (n, 2) and outer face of each member
    kinds : (n,) 0 where the contact sticks, 1 where it slips, 2 where it is lifted
    tip : upper corner at the loaded end
    """

    factor: float
    heights: tuple[float, ...]
    outlines: tuple[NDArray[np.float64], ...]
    inner: tuple[NDArray[np.float64], ...]
    outer: tuple[NDArray[np.float64], ...]
    kinds: NDArray[np.int64]
    tip: NDArray[np.float64]


def shape_of(history: Any, step: int, scale: float | None = None) -> Shape:
    """Shape of the members at a step.

    Displacements along X are counted from the pressed members, as u(L) is.
    Overhangs of a lap joint are beams without shear from the contact's ends to theirs.

    Parameters
    ----------
    history : solved load path
    step : index into the path
    scale : factor of the displacements; None is one that makes them visible
    """
    x, members = np.asarray(history.x), _members(history)
    height = members[0][1]
    paths = [_faces(fields, up) for fields, up in members]
    factor = _visible(paths, height) if scale is None else scale
    beyond = _overhangs(history, step, members)
    outlines = []
    for (_, up), (contact, face), (before, after) in zip(members, paths, beyond, strict=True):
        at = np.concatenate([before[0], x, after[0]])
        low = np.concatenate([before[1], contact[step], after[1]])
        high = np.concatenate([before[2], face[step], after[2]])
        sides = _moved(at, 0.0, low, factor), _moved(at, up, high, factor)[::-1]
        outlines.append(np.concatenate(sides))
    inner = [_moved(x, 0.0, contact[step], factor) for contact, _ in paths]
    outer = [
        _moved(x, up, face[step], factor) for (_, up), (_, face) in zip(members, paths, strict=True)
    ]
    _, after = beyond[0]
    touching, slipping = (np.asarray(a[step]) for a in (history.touching, history.slipping))
    return Shape(
        factor=factor,
        heights=tuple(up for _, up in members),
        outlines=tuple(outlines),
        inner=tuple(inner),
        outer=tuple(outer),
        kinds=np.where(touching, np.where(slipping, 1, 0), 2),
        tip=np.concatenate([outer[0][-1:], _moved(after[0], height, after[2], factor)])[-1],
    )


def reach_of(history: Any, before: float, beyond: float) -> tuple[float, float]:
    """Range of X of both members, with margins in parts of it."""
    ends = history.scene.member.overhang, history.scene.strip.overhang
    first, last = (0.0 if end is None else float(end) for end in ends)
    stop = float(history.x[-1]) + last
    return -first - before * (first + stop), stop + beyond * (first + stop)


def pressure_arrows(history: Any, shape: Shape) -> NDArray[np.float64]:
    """Arrows (k, 3) of the pressures on the outer faces: X, height of the head, of the tail."""
    contact, x = history.scene.contact, np.asarray(history.x)
    size = 0.6 * shape.heights[0] / float(contact.largest_pressure)
    tables = [(np.asarray(contact.pressure), 1.0), (np.asarray(contact.bottom_pressure), -1.0)]
    at = np.linspace(0.0, float(x[-1]), ARROWS + 1)[:-1] + 0.5 * float(x[-1]) / ARROWS
    rows = [np.zeros((0, 3))]
    for (table, way), face in zip(tables, shape.outer, strict=False):
        even = table.ndim == 0
        pressure = np.full_like(at, table) if even else np.interp(at, table[:, 0], table[:, 1])
        head = np.interp(at, x, face[:, 1])
        arrows = np.stack([at, head, head + way * size * pressure], axis=1)
        rows.append(arrows[pressure > 0.0])
    return np.concatenate(rows)


def visible_scale(history: Any) -> float:
    """Factor of the displacements with which the largest of a path is seen."""
    members = _members(history)
    return _visible([_faces(fields, up) for fields, up in members], members[0][1])


def _members(history: Any) -> list[tuple[NDArray[np.float64], float]]:
    """Fields (steps, n, m) of each member, and the height of its outer face over the contact."""
    scene = history.scene
    members = [(_since_pressing(history, history.fields), 2.0 * float(scene.strip.half_height))]
    if history.member is not None:
        below = -2.0 * float(scene.member.beside(scene.strip).half_height)
        members.append((_since_pressing(history, history.member), below))
    return members


def _since_pressing(history: Any, fields: Array) -> NDArray[np.float64]:
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
    history: Any, step: int, members: list[tuple[NDArray[np.float64], float]]
) -> list[tuple[Part, Part]]:
    """Parts of each member before X = 0 and beyond L: X, and displacements of both its faces."""
    scene, x = history.scene, np.asarray(history.x)
    none: Part = np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2))
    found = [(none, none) for _ in members]
    if scene.strip.overhang is not None:
        fields, up = members[0]
        size = float(scene.strip.overhang)
        stiffness = float(scene.wide) * float(scene.strip.stretching_stiffness)
        strain = float(history.force[step]) / stiffness
        s = np.linspace(0.0, 1.0, BEAM)
        _, w, beta, _ = (float(value) for value in fields[step, -1, :4])
        bend = 0.0 if scene.member.loaded_end == "free" else -(w + beta * size)
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


def _visible(paths: list[tuple[NDArray[np.float64], NDArray[np.float64]]], height: float) -> float:
    """Factor with which the largest displacement of a path is seen."""
    largest = max(float(np.nanmax(np.abs(np.stack(path)))) for path in paths)
    return round_down(SHARE * 0.5 * height / largest) if largest > 0.0 else 1.0


def _moved(
    x: NDArray[np.float64], height: float, moves: NDArray[np.float64], factor: float
) -> NDArray[np.float64]:
    """Points (n, 2) of a face with its displacements times a factor."""
    return np.stack([x, np.full_like(x, height)], axis=1) + factor * moves


def round_down(value: float) -> float:
    """Largest of 1, 2 and 5 times a power of ten that is no larger."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(part for part in (1.0, 2.0, 5.0) if part * power <= value) * power)
