r"""Steady responses over the frequency of a force, each found from the one before.

Two motions of a structure whose joints are networks of sliders never move apart: each slider's
force f = k (u - z) slips so that (f_1 - f_2) (z_1' - z_2') >= 0, and the energy of the difference
of two motions,

    (x_t^T M x_t + x^T K x + sum f^2/k)/2,

does not grow.  So there is one steady motion under each load, it is stable, and the curve never
turns back: the frequency leads it.
"""

from __future__ import annotations

from collections.abc import Callable

import jax
import numpy as np

from jbeamshell.common.errors import UnconvergedError
from jbeamshell.dynamics.vibration.balance import Balance, Found, Point, Rows, solved
from jbeamshell.dynamics.vibration.reduction import Reduced

LARGEST_STEP = 0.08  # of relative changes of the motion
SPAN = 0.2  # part of the range that counts as much as the size of the motion
LEAST_STEP = 1e-7
WIDEST = 2.0  # distance of two points, over the step that was wanted
GROWTH = 1.4  # of the step after each success
ORDER = [2, 1, 0]  # of the numbers that the conditions hold: excitation, level, frequency


def follow(
    model: Reduced, balance: Balance, start: Point, end: float, check: Callable[[Found], None]
) -> list[Found]:
    """Responses from a guess of the first one until an angular frequency; none if it is none.

    ``check`` is called with every response, and raises an error for one beyond the model.

    Raises
    ------
    UnconvergedError
        if the curve ends before
    """
    still, held = np.zeros((3, *start.x.shape), complex), np.eye(3)[ORDER]
    excitation, level = (float(start.p[number]) for number in ORDER[:2])

    def at(guess: Point, omega: float) -> tuple[Found, Point]:
        """Response at a frequency, and the direction in which it grows."""
        rows = Rows(still, held, np.array([excitation, level, omega]))  # type: ignore[arg-type]
        found: tuple[Found, Point] = jax.tree.map(np.asarray, solved(model, balance, guess, rows))
        return found

    omega = float(start.p[0])
    reach = SPAN * abs(end - omega)
    found, way = at(start, omega)
    if not found.converged:
        return []
    check(found)
    points, step = [found], 0.1 * LARGEST_STEP
    while omega != end:
        here = points[-1].point
        size = float(np.linalg.norm(here.x))
        speed = float(np.hypot(np.linalg.norm(way.x) / size, 1.0 / reach))
        change = min(step / speed, abs(end - omega)) * np.sign(end - omega)
        aim = end if change == end - omega else omega + change
        found, further = at(Point(here.x + change * way.x, here.p + change * way.p), aim)
        moved = float(np.linalg.norm(found.point.x - here.x)) / size
        if found.converged and np.hypot(moved, change / reach) <= WIDEST * step:
            check(found)
            points.append(found)
            omega, way, step = aim, further, min(GROWTH * step, LARGEST_STEP)
        elif step < LEAST_STEP:
            raise UnconvergedError(
                f"the response ends at the frequency {omega / (2.0 * np.pi):.6g}, as no step is "
                "small enough for Newton's method: take another range, more damping or more "
                "harmonics"
            )
        else:
            step *= 0.5
    return points
