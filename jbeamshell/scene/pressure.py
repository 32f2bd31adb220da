"""Pressures on the faces of a strip: their checks, their resultant force and its moment.

A pressure is one number, or a table (n, 2) of X and pressure with linear interpolation between its
rows and the end values beyond them; two rows of the same X make a step.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require
from jbeamshell.scene.keys import BOLTS, GAP, PRESSURE


def is_table(pressure: Any) -> bool:
    """True for a table of [X, pressure] rows.

    An array over the strips of a sweep is none: it has one axis of more than one entry at most.
    """
    return pressure.ndim == 2 and pressure.shape[1] == 2 and pressure.shape[0] >= 2


@np.errstate(over="ignore", invalid="ignore")  # the caller checks for forces that are infinite
def face_resultant(pressure: ArrayLike, length: ArrayLike) -> tuple[Any, Any]:
    """Force of a pressure on strips, per unit width, and its moment about X = 0.

    Parameters
    ----------
    pressure : a number, an array of numbers over strips, or one table (n, 2), stress
    length : L of the strips, any shape

    Returns
    -------
    force, moment
        stress times length, and stress times length squared; in double precision unless traced
    """
    numbers: Any = jnp if is_traced(pressure, length) else np
    load, span = numbers.asarray(pressure, float), numbers.asarray(length, float)
    if not is_table(load):
        return load * span, 0.5 * load * span**2
    end = span[..., None]
    x, p = (numbers.broadcast_to(column, (*span.shape, column.size)) for column in load.T)
    x = numbers.concatenate([numbers.zeros_like(end), x, end], axis=-1)
    p = numbers.concatenate([p[..., :1], p, p[..., -1:]], axis=-1)
    run, begin, stop = numbers.diff(x), p[..., :-1], p[..., 1:]
    force, middle = 0.5 * run * (begin + stop), 0.5 * (x[..., 1:] + x[..., :-1])
    moment = force * middle + run**2 * (stop - begin) / 12.0
    return numbers.sum(force, axis=-1), numbers.sum(moment, axis=-1)


@np.errstate(over="ignore", invalid="ignore")
def resultant(
    top: ArrayLike, bottom: ArrayLike, length: ArrayLike, support: str = "none"
) -> tuple[Any, Any]:
    """Force of the pressures on the contact, downwards, and its moment about X = 0.

    The bottom pressure acts on the second member of a lap joint, if ``support`` names one.  Other
    parameters and units are those of `face_resultant`.
    """
    top_force, top_moment = face_resultant(top, length)
    if support != "none":
        return top_force, top_moment
    bottom_force, bottom_moment = face_resultant(bottom, length)
    return top_force - bottom_force, top_moment - bottom_moment


def pressure_values(pressure: np.ndarray) -> np.ndarray:
    """Pressures of a table without their X, or the one number."""
    return pressure[:, 1] if pressure.ndim == 2 else pressure


def check_pressure(key: str, pressure: np.ndarray) -> None:
    """Raise `InputError` unless a pressure is a number or a table of [X, pressure] rows."""
    table = is_table(pressure)
    require(key, pressure, pressure.ndim == 0 or table, PRESSURE)
    compressive = bool(np.all(np.isfinite(pressure)) and np.all(pressure_values(pressure) >= 0.0))
    require(key, pressure, compressive, "must be finite and nowhere negative (no tension)")
    if table:
        run = np.diff(pressure[:, 0])
        require(key, pressure, bool(np.all(run >= 0.0)), "its X must not decrease from row to row")
        thrice = bool(np.any((run[1:] == 0.0) & (run[:-1] == 0.0)))
        require(key, pressure, not thrice, "gives one X three times; two rows make a step")


def bolt_pressure(bolts: Array, length: Array) -> Array:
    """Pressure table (4k, 2) of bolts, each an even pressure on a patch.

    Where patches touch the pressure steps from one to the next, which takes two rows less.

    Parameters
    ----------
    bolts : (k, 3) rows of X, force per width and width of the patch, rising in X
    length : L

    Raises
    ------
    InputError
        for a bolt off the overlap, and bolts whose patches overlap
    """
    key = "contact.bolts"
    require(key, bolts, bolts.ndim == 2 and bolts.shape[1] == 3, BOLTS)
    xp: Any = jnp if is_traced(bolts, length) else np  # much faster
    middle, force, width = xp.asarray(bolts).T
    begin, end = middle - 0.5 * width, middle + 0.5 * width
    kept = np.ones(4 * bolts.shape[0], bool)
    if xp is np:
        numbers = np.asarray(bolts)
        good = bool(np.all(np.isfinite(numbers)) and np.all(numbers[:, 1:] > 0.0))
        require(key, bolts, good, "forces and widths must be positive numbers")
        slack = 1e-12 * float(length)
        inside = bool(begin[0] >= -slack and np.all(end <= float(length) + slack))
        fix = f"a patch lies off the overlap, X from 0 to {float(length):g}: move it or narrow it"
        require(key, bolts, inside and bool(np.min(begin) >= -slack), fix)
        apart = bool(np.all(begin[1:] - end[:-1] >= -slack))
        require(key, bolts, apart, "patches overlap, or X falls: sort the rows and narrow them")
        touch = 4 * np.flatnonzero(begin[1:] - end[:-1] <= slack)
        kept[[*(touch + 3), *(touch + 4)]] = False
    pressure = force / width
    begin = xp.maximum(begin, xp.append(0.0, end[:-1]))  # round-off between patches that touch
    rows = [(begin, 0.0 * pressure), (begin, pressure), (end, pressure), (end, 0.0 * pressure)]
    table = xp.stack([xp.stack(row, axis=1) for row in rows], axis=1).reshape(-1, 2)
    return jnp.asarray(table if kept.all() else table[kept], bolts.dtype)


def check_gap(gap: np.ndarray) -> None:
    """Raise `InputError` unless a gap is a number or a table of [X, gap] rows, not negative."""
    table = is_table(gap)
    require("member.gap", gap, gap.ndim == 0 or table, GAP)
    good = bool(np.all(np.isfinite(gap)) and np.all(pressure_values(gap) >= 0.0))
    require("member.gap", gap, good, "must be finite and nowhere negative")
    rises = not table or bool(np.all(np.diff(gap[:, 0]) > 0.0))
    require("member.gap", gap, rises, "its X must rise from row to row")
