"""Curves of balanced points by pseudo-arc-length continuation, with their folds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from jbeamshell.dynamics.vibration.balance import Balance, Found, Point, Rows, solved
from jbeamshell.dynamics.vibration.reduction import Reduced

LARGEST_STEP = 0.15  # of relative changes of the motion
SPAN = 0.2  # part of the range that counts as much as the size of the motion
LEAST_STEP = 1e-7
WIDEST = 2.0  # distance of two points, over the step that was wanted
STRAIGHT = 0.8  # least cosine of the angle between two tangents
CORNER = 0.01  # step below which they may have any angle: a slider's first slip makes a corner
GROWTH = 1.4  # of the step after each success
MOST_POINTS = 3000
BISECTIONS = 30
FLAT = 1e-6  # rate of the parameter at a fold, over its scale
OMEGA, LEVEL, EXCITATION = range(3)


class Curve(NamedTuple):
    """Balanced points in their order, numbers of those that are folds, and why the curve ended.

    ``stalled`` is empty if the end of the range was reached.
    """

    points: list[Found]
    folds: list[int]
    stalled: str


class _Path:
    """Distances and conditions of one curve."""

    def __init__(self, model: Reduced, balance: Balance, along: int, span: float) -> None:
        self.model, self.balance, self.along, self.span = model, balance, along, SPAN * span
        self.held = EXCITATION, LEVEL if along == OMEGA else OMEGA

    def inner(self, one: Point, two: Point, size: float) -> float:
        """Product of two directions at a point whose motion has a size."""
        moved = float(np.real(np.vdot(one.x, two.x))) / size**2
        return moved + float(one.p[self.along] * two.p[self.along]) / self.span**2

    def rows(self, at: Point, x: Any, p: Any, target: float) -> Rows:
        """Conditions that hold two numbers of a point, and a third one on motion and number."""
        moved = np.zeros((3, *at.x.shape), complex)
        number = np.zeros((3, 3))
        held = list(self.held)
        number[[0, 1], held] = 1.0
        number[2, self.along] = p
        if x is not None:
            moved[2] = x
        return Rows(moved, number, np.array([*at.p[held], target]))  # type: ignore[arg-type]

    def stepped(self, at: Point, way: Point, step: float) -> tuple[Found, Point, float]:
        """Point at a distance along a direction of unit size, its direction, and its distance."""
        size = float(np.linalg.norm(at.x))
        weight = way.p[self.along] / self.span**2
        start = self.inner(way, at, size)
        rows = self.rows(at, way.x / size**2, weight, start + step)
        guess = Point(at.x + step * way.x, at.p + step * way.p)
        found, tangent = _numbers(solved(self.model, self.balance, guess, rows))
        new = found.point
        change = Point(new.x - at.x, new.p - at.p)
        return found, self.unit(tangent, new), self.inner(change, change, size) ** 0.5

    def unit(self, way: Point, at: Point) -> Point:
        """Direction of unit size."""
        size = self.inner(way, way, float(np.linalg.norm(at.x))) ** 0.5
        return Point(way.x / size, way.p / size)

    def at(self, guess: Point, value: float) -> tuple[Found, Point]:
        """Point with a value of the parameter, and the direction in which it grows."""
        found, tangent = _numbers(
            solved(self.model, self.balance, guess, self.rows(guess, None, 1.0, value))
        )
        return found, self.unit(tangent, found.point)


def follow(
    model: Reduced,
    balance: Balance,
    start: Point,
    along: int,
    end: float,
    check: Callable[[Found], None],
    most_points: int = MOST_POINTS,
) -> Curve:
    """Curve from a point until its parameter leaves the range between start and end.

    Parameters
    ----------
    start : guess of the first point, whose frequency or level is the start of the range
    along : `OMEGA` or `LEVEL`, which varies
    end : last value of it
    check : called with every point; raises an error for one beyond the model
    """
    first = float(start.p[along])
    path = _Path(model, balance, along, abs(end - first))
    found, way = path.at(_numbers(start), first)
    if not found.converged:
        return Curve([], [], "no solution is found there")
    check(found)
    if end < first:
        way = Point(-way.x, -way.p)
    points: list[Found] = [found]
    folds: list[int] = []
    step = 0.1 * LARGEST_STEP
    while len(points) < most_points:
        at = points[-1].point
        found, new_way, distance = path.stepped(at, way, step)
        size = float(np.linalg.norm(found.point.x))
        near = bool(found.converged) and distance < WIDEST * step
        turn = path.inner(way, new_way, size) / path.inner(way, way, size) ** 0.5
        if not near or (turn < STRAIGHT and step > CORNER):
            step *= 0.5
            if step < LEAST_STEP:
                return Curve(points, folds, "no step is small enough for Newton's method")
            continue
        value = float(found.point.p[along])
        if way.p[along] * new_way.p[along] < 0.0:
            fold = _fold(path, at, way, step)
            if fold is not None:
                folds.append(len(points))
                points.append(fold)
        if not min(first, end) < value < max(first, end):
            bound = end if abs(value - end) < abs(value - first) else first
            last, _ = path.at(_between(at, found.point, along, bound), bound)
            if last.converged:
                check(last)
                points.append(last)
                left = "it comes back to the start of the range" if bound == first else ""
                return Curve(points, folds, left)
        check(found)
        points.append(found)
        way, step = new_way, min(GROWTH * step, LARGEST_STEP)
    return Curve(points, folds, f"it takes more than {most_points} points")


def _fold(path: _Path, at: Point, way: Point, step: float) -> Found | None:
    """Point between a point and the next one where the parameter has an extremum."""
    low, high, best = 0.0, step, None
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        found, new_way, _ = path.stepped(at, way, middle)
        if not found.converged:
            return best
        best = found
        rate = float(new_way.p[path.along])
        if abs(rate) < FLAT * path.span:
            break
        same = rate * float(way.p[path.along]) > 0.0
        low, high = (middle, high) if same else (low, middle)
    return best


def _between(one: Point, two: Point, along: int, value: float) -> Point:
    """Point on the line between two, with a value of the parameter."""
    part = (value - one.p[along]) / (two.p[along] - one.p[along])
    return Point(one.x + part * (two.x - one.x), one.p + part * (two.p - one.p))


def _numbers(tree: Any) -> Any:
    """Pytree with arrays of NumPy, on which the rules of steps work quickly."""
    import jax

    return jax.tree.map(np.asarray, tree)
