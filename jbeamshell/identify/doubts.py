"""Doubts about a fit: what to know before its values are used.

A small misfit is not enough.  A loop is narrow where a joint slips little, so that a law without
any loss may run through its middle; a free stiffness takes a wrong unit as a whole; and values that
lie between those of two measurements describe neither.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jbeamshell.dynamics.structure.modal import DOUBTED
from jbeamshell.identify.models import LawModel, Model
from jbeamshell.identify.observations import ModalObservation
from jbeamshell.identify.parameters import Coordinate
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.search import ROUNDING
from jbeamshell.identify.search_space import SearchSpace
from jbeamshell.identify.starts import FRICTIONS, STIFFNESS
from jbeamshell.identify.uncertainty import Uncertainty, independent_points, white_noise
from jbeamshell.measured.findings import TOO_LARGE, TOO_SMALL, TOO_SOFT, TOO_STIFF, UNIT_ERROR
from jbeamshell.measured.loops import Loop

LIMITS = {"linear": 0.05, "log": 0.3}  # misfit by the model above which it does not describe data
ENERGY, STIFFNESS_ERROR = 0.2, 0.1  # errors of a closed loop above which it does not either
LOCAL = {  # errors of two neighbours of a curve over the amplitude, likewise
    "dissipation": ENERGY,
    "damping": ENERGY,
    "stiffness": STIFFNESS_ERROR,
    "frequency": 0.5 * STIFFNESS_ERROR,
}
FEWEST = 4  # points of such a curve
NORMAL = 0.6745  # median of the size of a normal number of unit variance
SURE = 2.0  # standard errors by which noise may move energy and stiffness
APART = 0.5  # of the misfit of all together, left by each alone, below which they contradict
MANY = 5.0  # standard errors of each alone between what they would have
LEAST = 1e-12  # eigenvalue over the largest, below which a measurement does not tell a direction
ROUNDED = 1.0 - 5e-4  # of an amplitude, so that its four digits are no larger
WRONG_MODEL = 2.0  # misfit over noise above which the model must be wrong
WORTH_SAYING = 1e-3  # of the range, left by the model

Vector = NDArray[np.float64]


def doubts_of(
    problem: Problem,
    uncertainty: Uncertainty,
    models: Sequence[Model],
    left: Sequence[float],
    minima: Sequence[float],
) -> list[str]:
    """Sentences on what to know before using the values of a fit.

    ``left`` are the misfits of the measurements that are no white noise, ``minima`` the costs at
    the ends of the searches, the best first.
    """
    space, rows, point = problem.space, problem.weight.size, uncertainty.point
    values, best = space.values(point).tolist(), problem(point)
    doubts = [
        *undescribed(problem, left, best.prediction),
        *_contradictions(problem, point),
        *doubt_of_units(space, values),
    ]
    for model in models:
        if isinstance(model, LawModel) and np.isfinite(model.law.fitted_to):
            law, far = model.law, model.law.fitted_to
            doubts.append(
                f"the data do not reach gross slip of {law.heading}, {float(law.capacity):.4g}, "
                f"which its form adds: they tell it up to the displacement {far:.4g} and the force "
                f"{float(law.backbone(far)):.4g}"
            )
    if best.converged:
        doubts += _of_statics(problem, models, uncertainty, best.jacobian)
    for name, bound, value in zip(space.names, space.bounds_at(point), values, strict=True):
        if bound is not None:
            doubts.append(
                f"{name} = {value:.6g} ends at its bound {bound:g}: it has no error, and the "
                "errors of the others take it as fixed"
            )
    if problem.noisy and uncertainty.scatter > WRONG_MODEL:
        doubts.append(
            f"the model leaves {uncertainty.scatter:.2g} times the measured noise "
            "unexplained: it is wrong in some way, and the errors include what it leaves"
        )
    if uncertainty.independent < rows and max(left) > WORTH_SAYING:
        doubts.append(
            f"what the model leaves is correlated along the curve: the errors count {rows} points "
            f"as {uncertainty.independent:.2g} independent ones"
        )
    rounding = rows * ROUNDING**2
    others = [cost for cost in minima if cost > 1.01 * minima[0] + rounding]
    if others:
        doubts.append(
            f"{len(others)} of {len(minima)} starts ended in worse minima (cost {others[0]:.4g} or "
            f"more, against {minima[0]:.4g}): the problem has several minima"
        )
    return doubts + uncertainty.limitations()


def undescribed(problem: Problem, left: Sequence[float], prediction: Vector) -> list[str]:
    """Sentence on what a model does not describe; none if it describes all data."""
    limits = [LIMITS[measurement.form.scale] for measurement in problem.measurements]
    worst = int(np.argmax(np.divide(left, limits)))
    said = []
    if left[worst] > limits[worst]:
        linear = problem.measurements[worst].form.scale == "linear"
        said.append(
            f"it leaves {100.0 * left[worst]:.3g} % of the {'range' if linear else 'value'} of "
            f"{problem.labels[worst]} that is no white noise, more than "
            f"{100.0 * limits[worst]:g} %"
        )
    beyond: dict[str, tuple[float, str]] = {}
    models = problem.as_measurements(prediction)
    for label, data, model, control in zip(
        problem.labels, problem.measurements, models, problem.controls(), strict=True
    ):
        figures = _local if data.form.scale == "log" else partial(_figures, control=control)
        for name, limit, own, wanted, chance in figures(data, model):
            error = abs(own / wanted - 1.0) - SURE * chance - limit
            kind = name.partition(" at ")[0]
            if error > beyond.get(kind, (0.0, ""))[0]:
                beyond[kind] = error, f"its {name} is {own:.3g} where {label} has {wanted:.3g}"
    said += [text for _, text in beyond.values()]
    return [f"this model does not describe these data: {'; '.join(said)}"] if said else []


def _figures(
    data: Any, model: Any, control: str
) -> Iterator[tuple[str, float, float, float, float]]:
    """Figures of a closed loop: name, limit of error, the model's, the loop's, and error by noise.

    None of anything else, and none that noise hides.
    """
    if not (isinstance(data, Loop) and data.closed):
        return
    drive, answer = getattr(data, control), data.form.response(control)
    measured, computed = getattr(data, answer), getattr(model, answer)
    noise = white_noise(computed - measured)
    # The work is a sum over the points of the answer times half the way of the drive about each.
    lost = noise * float(np.linalg.norm(np.gradient(drive)))
    if data.work > SURE * lost:
        yield "energy per cycle", ENERGY, model.work, data.work, lost / data.work
    high, low = int(np.argmax(drive)), int(np.argmin(drive))
    own, wanted = (float(column[high] - column[low]) for column in (computed, measured))
    if min(own, wanted) > 0.0:
        width, chance = float(drive[high] - drive[low]), np.sqrt(2.0) * noise / wanted
        own, wanted = (width / s if control == "force" else s / width for s in (own, wanted))
        yield "secant stiffness", STIFFNESS_ERROR, own, wanted, float(chance)


def _local(data: Any, model: Any) -> Iterator[tuple[str, float, float, float, float]]:
    """Figures of a curve over the amplitude where two neighbours in a row are farthest off.

    Its noise, where that is not known, is told by the second differences of what the model leaves,
    in the median, so that a few large ones may be the model's.
    """
    if data.kind not in LOCAL or data.amplitude.size < FEWEST:
        return
    order = np.argsort(data.amplitude, kind="stable")
    wanted, own = (getattr(curve, data.form.y)[order] for curve in (data, model))
    left = np.log(own / wanted)
    if data.noise is None:
        spread = float(np.median(np.abs(np.diff(left, 2)))) / (NORMAL * np.sqrt(6.0))
        noise = np.full(left.size, spread)
    else:
        noise = data.noise[order] / wanted
    pairs = 0.5 * (left[1:] + left[:-1])
    chances = 0.5 * np.hypot(noise[1:], noise[:-1])
    at = int(np.argmax(np.abs(np.expm1(pairs)) - SURE * chances))
    middle = float(np.sqrt(wanted[at] * wanted[at + 1]))
    name = f"{data.kind} at the amplitude {data.amplitude[order][at]:.3g}"
    yield name, LOCAL[data.kind], middle * float(np.exp(pairs[at])), middle, float(chances[at])


def _contradictions(problem: Problem, point: Vector) -> list[str]:
    """Sentence on two measurements that contradict each other; none if they agree."""
    best = problem(point)
    found = contradiction(best.residual, best.jacobian, problem.slices)
    if found is None:
        return []
    axis, *places = found[:3]
    said = []
    for place, step in zip(places, found[3:], strict=True):
        moved = np.where(np.arange(point.size) == axis, point + step, point)
        said.append(f"{problem.labels[place]} about {problem.space.values(moved)[axis]:.3g}")
    return [
        f"the measurements contradict each other: alone, {' and '.join(said)} would have for "
        f"{problem.space.names[axis]}, and each would be described at least twice as well: the "
        "values lie between them and describe none; fit them apart"
    ]


def contradiction(
    residual: Vector, jacobian: Vector, slices: Sequence[slice]
) -> tuple[int, int, int, float, float] | None:
    """Worst contradiction of two measurements; None if there is none.

    Each measurement alone would move the fit by the Gauss-Newton step of its own rows.  A model
    that is wrong leaves about as much of each measurement alone as of all; contradicting
    measurements leave much less, and their steps part by many of their own standard errors.

    Parameters
    ----------
    residual, jacobian : (rows,) and (rows, n) at the minimum of all together
    slices : rows of each measurement

    Returns
    -------
    Axis, the numbers of the measurements that would have it least and most, and their steps
    """
    wishes = [_wish(residual[own], jacobian[own]) for own in slices]
    steps, deviations, left = map(np.array, zip(*wishes, strict=True))
    together = sum(float(residual[own] @ residual[own]) for own in slices)
    if len(wishes) < 2 or np.sum(left) > APART**2 * together:
        return None
    apart = np.abs(steps[:, None] - steps[None])
    errors = np.sqrt(deviations[:, None] ** 2 + deviations[None] ** 2)
    some = np.isfinite(errors) & (apart != 0.0)  # 0 over 0 where both are met exactly
    ratio = np.divide(apart, errors, out=np.zeros_like(apart), where=some)
    axis = int(np.argmax(np.max(ratio, axis=(0, 1))))
    if np.max(ratio[..., axis]) < MANY:
        return None
    sure = np.where(ratio[..., axis] >= MANY, apart[..., axis], 0.0)
    pair = np.unravel_index(int(np.argmax(sure)), sure.shape)
    low, high = sorted(map(int, pair), key=lambda i: steps[i, axis])
    return axis, low, high, float(steps[low, axis]), float(steps[high, axis])


def _wish(residual: Vector, jacobian: Vector) -> tuple[Vector, Vector, float]:
    """Step (n,) that a measurement alone asks for, its standard errors, and the cost it leaves.

    An error is infinite where the measurement does not tell the parameter.
    """
    values, vectors = np.linalg.eigh(jacobian.T @ jacobian)
    told = values > LEAST * max(float(values[-1]), np.finfo(float).tiny)
    inverse = (vectors[:, told] / values[told]) @ vectors[:, told].T
    step = -inverse @ (jacobian.T @ residual)
    rest = residual + jacobian @ step
    left = float(rest @ rest)
    worth = min(independent_points([rest]), residual.size - float(np.sum(told)))
    variance = left / max(worth, 1.0)
    untold = np.sum(vectors[:, ~told] ** 2, axis=1) > LEAST
    deviation = np.sqrt(variance * np.maximum(np.diag(inverse), np.finfo(float).tiny))
    return step, np.where(untold, np.inf, deviation), left


def doubt_of_units(space: SearchSpace, values: Sequence[float]) -> list[str]:
    """Sentences on fitted values (n,) that only a wrong unit explains; none if all may be right.

    A loop in a wrong unit has the shape of a right one.  Where a stiffness is free, that takes the
    whole factor, and the misfit tells nothing.
    """
    stiff: list[str] = []
    slippery: list[str] = []
    for name, one, coordinate, value in zip(
        space.names, space.parameters, space.coordinates, values, strict=True
    ):
        if one.key in STIFFNESS:
            side, where = _off(coordinate, value)
            units = TOO_STIFF if side > 0 else TOO_SOFT
            told = f"{name} = {value:.4g}, {where}: {units}; if all are right, start nearer"
            stiff += [told] * (side != 0)
        elif one.key == "contact.friction" and not FRICTIONS[0] <= value <= FRICTIONS[1]:
            units = TOO_LARGE if value > FRICTIONS[1] else TOO_SMALL
            slippery.append(f"{name} = {value:.4g}, which no surface has: {units}")
    return stiff or slippery  # a stiffness tells which of the two units is wrong


def _off(coordinate: Coordinate, value: float) -> tuple[int, str]:
    """1 if a stiffness ended at its upper bound or far above its start, -1 below, else 0; words."""
    bound, ratio = coordinate.bound_at(value), value / coordinate.start
    if bound is not None:
        return (1 if bound == coordinate.high else -1), "at its bound"
    far = f"{max(ratio, 1.0 / ratio):.4g} times {'above' if ratio > 1.0 else 'below'} its start"
    side = (ratio > UNIT_ERROR) - (ratio < 1.0 / UNIT_ERROR)
    return side, f"{far}, which no other material explains"


def _of_statics(
    problem: Problem, models: Sequence[Model], uncertainty: Uncertainty, jacobian: Vector
) -> list[str]:
    """Sentence on how far values of a structure may be off; none if little, or without structure.

    Frequency and damping of a structure follow from statics, whose errors a curve estimates, see
    `jbeamshell.dynamics.modal_curve`.  A Gauss-Newton step tells how the values would change if the
    response were without them.
    """
    change, curves = np.zeros(jacobian.shape[0]), []
    pairs = zip(problem.observations, problem.slices, problem.owners, strict=True)
    for observation, rows, owner in pairs:
        if isinstance(observation, ModalObservation):
            curve, more = observation.without_errors(models[owner])
            change[rows] = problem.emphasis[rows] * problem.weight[rows] * more
            curves.append(curve)
    if not any(curve.doubts for curve in curves):
        return []
    sizes, *errors = (
        np.concatenate([np.asarray(getattr(curve, name)) for curve in curves])
        for name in ("amplitude", "frequency_error", "damping_error")
    )
    frequency, damping = np.max(np.abs(errors), axis=1).tolist()
    first = ROUNDED * np.min(sizes[np.max(np.abs(errors), axis=0) > DOUBTED])
    inside, step = ~uncertainty.at_bound, np.zeros(uncertainty.point.size)
    step[inside] = np.linalg.lstsq(jacobian[:, inside], change)[0]
    off = np.abs(uncertainty.space.slopes(uncertainty.point) * step)
    moved = " and ".join(f"{k} by {size:.2g}" for k, size in uncertainty.space.named(off).items())
    fix = "compare the fitted structure with nonlinear_mode"
    fix = f"fit smaller amplitudes alone, or {fix}" if np.any(sizes < first) else fix
    return [
        f"from the amplitude {first:.4g} on, the fitted damping may be off by up to {damping:.0%} "
        f"and the frequency by {frequency:.1%}, as statics know no inertia and no shape of the "
        f"loop, which may move {moved}: {fix}"
    ]
