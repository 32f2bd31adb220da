r"""Curves of balanced points over frequency or level, each found from the one before.

Two motions of a structure whose joints are networks of sliders never move apart: each slider's
force f = k (u - z) slips so that (f_1 - f_2) (z_1' - z_2') >= 0, and the energy of the difference
of two motions,

    (x_t^T M x_t + x^T K x + sum f^2/k)/2,

does not grow.  So there is one steady motion under each load, it is stable, and the curve never
turns back: frequency or level may lead it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np

from jbeamshell.dynamics.vibration.balance import Balance, Found, Point, Rows, solved
from jbeamshell.dynamics.vibration.reduction import Reduced

LARGEST_STEP = 0.08  # of relative changes of the motion
SPAN = 0.2  # part of the range that counts as much as the size of the motion
LEAST_STEP = 1e-7
WIDEST = 2.0  # distance of two points, over the step that was wanted
GROWTH = 1.4  # of the step after each success
MOST_POINTS = 3000
OMEGA, LEVEL, EXCITATION = range(3)


class Curve(NamedTuple):
    """Balanced points in their order, and why the curve ended; empty at the end of its range."""

    points: list[Found]
    stalled: str


def follow(
    model: Reduced,
    balance: Balance,
    start: Point,
    along: int,
    end: float,
    check: Callable[[Found], None],
    most_points: int = MOST_POINTS,
) -> Curve:
    """Curve from a point until its parameter reaches an end.

    Parameters
    ----------
    start : guess of the first point, whose frequency or level is the start of the range
    along : `OMEGA` or `LEVEL`, which varies
    end : last value of it
    check : called with every point; raises an error for one beyond the model
    """
    held = [EXCITATION, LEVEL if along == OMEGA else OMEGA, along]
    still = np.zeros((3, *start.x.shape), complex)

    def at(guess: Point, value: float) -> tuple[Found, Point]:
        """Point with a value of the parameter, and the direction in which it grows."""
        target = np.append(np.asarray(guess.p)[held[:2]], value)
        rows = Rows(still, np.eye(3)[held], target)  # type: ignore[arg-type]
        found: tuple[Found, Point] = jax.tree.map(np.asarray, solved(model, balance, guess, rows))
        return found

    value = float(start.p[along])
    reach = SPAN * abs(end - value)
    found, way = at(start, value)
    if not found.converged:
        return Curve([], "no solution is found there")
    check(found)
    points, step = [found], 0.1 * LARGEST_STEP
    while len(points) < most_points:
        here = points[-1].point
        size = float(np.linalg.norm(here.x))
        speed = float(np.hypot(np.linalg.norm(way.x) / size, 1.0 / reach))
        change = min(step / speed, abs(end - value)) * np.sign(end - value)
        guess = Point(here.x + change * way.x, here.p + change * way.p)
        last = change == end - value
        found, further = at(guess, end if last else value + change)
        moved = float(np.linalg.norm(found.point.x - here.x)) / size
        if not found.converged or np.hypot(moved, change / reach) > WIDEST * step:
            step *= 0.5
            if step < LEAST_STEP:
                return Curve(points, "no step is small enough for Newton's method")
            continue
        check(found)
        points.append(found)
        if last:
            return Curve(points, "")
        value, way, step = value + change, further, min(GROWTH * step, LARGEST_STEP)
    return Curve(points, f"it takes more than {most_points} points")
