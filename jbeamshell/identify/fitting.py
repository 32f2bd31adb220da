"""Parameters from measurements: least squares on the response, with standard errors."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require, shown
from jbeamshell.common.errors import InputError, UnconvergedError
from jbeamshell.identify.experiment import Experiment, Specimen
from jbeamshell.identify.parameters import Parameter, Space, as_parameters, search_space
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.results import Fit, fit_at
from jbeamshell.identify.search import ADAM_STEPS, SEARCHES, Limits
from jbeamshell.measured.curves import Measurement
from jbeamshell.measured.loops import Loop
from jbeamshell.measured.recordings import FEWEST_POINTS
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.scene import Scene

POINTS = 96  # of a loop that the model is run through
MAX_ITERATIONS = 40
METHODS = tuple(SEARCHES)
MOST = 10**6  # of anything that is counted
STARTS = 3  # of searches between bounds
ADAM_STARTS = 8
SCREENED = 4  # points tried for each start beside the given one
NO_INFLUENCE = 1e-9  # largest change of a residual, for a unit step, that is rounding


class Progress(NamedTuple):
    """How far a fit is.

    Attributes
    ----------
    search, searches : number of the search, and how many there will be; 0 while starts are tried
    step : of the search, or of the starts tried
    cost : sum of the squared residuals
    values : parameters by name
    elapsed : seconds since the fit began
    left : seconds it may still take, if every search goes on to its last iteration
    """

    search: int
    searches: int
    step: int
    cost: float
    values: dict[str, float]
    elapsed: float
    left: float

    def __str__(self) -> str:
        at = f"search {self.search} of {self.searches}, step" if self.search else "start"
        values = ", ".join(f"{name} = {value:.6g}" for name, value in self.values.items())
        return f"{at} {self.step}, cost {self.cost:.4g}, at most {self.left:.0f} s left: {values}"


def fit(
    data: Measurement | Specimen | Sequence[Measurement] | Sequence[Specimen],
    scene: Scene | None = None,
    free: Sequence[str | Parameter] = (),
    *,
    weights: Sequence[float] = (),
    method: str = METHODS[0],
    starts: int | None = None,
    noise: float | None = None,
    save: str | os.PathLike[str] | None = None,
    solver: Newton | None = None,
    points: int = POINTS,
    max_iterations: int = MAX_ITERATIONS,
    tolerance: float = 1e-7,
    progress: Callable[[Progress], None] | None = None,
    throw: bool = True,
) -> Fit:
    """Least squares of a scene's parameters on measured or computed curves.

    A loop or a backbone drives the model by the column that ``scene.load.control`` names and is
    compared in the other; a squeeze curve is compared under the scene's pressures alone;
    dissipation and stiffness are compared by their logarithms.  Where measurements carry noise, or
    ``noise`` is given, residuals are divided by it; else every measurement counts relative to its
    own range, and the noise is estimated from what is left.

    Parameters
    ----------
    data : a measurement or a list of them, mixed or not; or `Specimen`, one or several, which bring
        their own scenes
    scene : start values, and everything that stays fixed; None with specimens
    free : what to fit: keys such as "contact.friction", or `Parameter` with bounds, scale, prior,
        and whether every specimen has a value of its own
    weights : factors of the measurements' residuals, besides the curves' own; none are all 1
    method : "levenberg-marquardt"; "l-bfgs-b", which may end on a bound; or "adam", which goes down
        from all starts side by side and settles the best by Levenberg-Marquardt
    starts : searches, from the given start and from others spread between the bounds (a factor e to
        either side where there are none), for adam all of them, else the best of four times as
        many; None is 8 for adam, else 3 if all parameters have two bounds, else 1
    noise : standard deviation of measurements without noise, as a part of their range
    save : file that keeps every model run, as it ends; if it is there, the fit goes on from it
    solver : settings of Newton's method
    points : thin each loop to about so many points
    max_iterations : of each search
    tolerance : relative change of the parameters at which it stops (a flat cost stops it too)
    progress : called after every step; as text, a `Progress` is one line
    throw : whether an unfinished fit raises; if not, read ``status``

    Raises
    ------
    InputError
        for parameters that cannot be fitted, or that the data do not depend on; for measurements
        that the scene cannot answer, such as forces beyond gross slip at the start values; for a
        saved state of another fit
    UnconvergedError
        if the search does not settle, or the model finds no equilibrium at the start
    KeyboardInterrupt
        when interrupted, with a message that says what was saved
    """
    if not (isinstance(method, str) and method in METHODS):
        raise InputError(f"method = {method!r}: choose {' or '.join(map(repr, METHODS))}")
    _check_counts(
        starts=(1 if starts is None else starts, 1),
        points=(points, FEWEST_POINTS),
        max_iterations=(max_iterations, 1),
    )
    _check_sizes(
        noise=(1.0 if noise is None else noise, "a positive part of the range, such as 0.01"),
        tolerance=(tolerance, "a positive number, such as 1e-7"),
    )
    fix = "give a jbeamshell.Newton"
    require("solver", solver, solver is None or isinstance(solver, Newton), fix)
    parameters = as_parameters(free)
    specimens = _specimens(data, scene, weights)
    labels = [specimen.label for specimen in specimens]
    scenes = dict(zip(labels, [specimen.scene for specimen in specimens], strict=True))
    space, begun = search_space(parameters, scenes)
    specimens = [specimen._replace(scene=begun[specimen.label]) for specimen in specimens]
    experiment = Experiment(specimens, points=points, noise=noise)
    problem = Problem(experiment, space, solver or Newton(), save)
    if starts is None:
        bounded = all(parameter.bounded for parameter in parameters)
        starts = ADAM_STARTS if method == "adam" else STARTS if bounded else 1
    searches = 1 if method == "adam" else starts
    screened = 0 if starts == 1 else (1 if method == "adam" else SCREENED) * (starts - 1)
    noisy = experiment.weight.size if experiment.noisy else 0
    limits, begin = Limits(max_iterations, tolerance, noisy), time.perf_counter()
    done, most = 0, max_iterations + ADAM_STEPS
    if method != "adam":
        most = screened + searches * max_iterations

    def report(search: int, step: int, values: NDArray[np.float64], cost: float) -> None:
        nonlocal done
        done += 1
        elapsed = time.perf_counter() - begin
        left = elapsed / done * max(most - done, 0)
        named = dict(zip(space.names, values.tolist(), strict=True))
        if progress:
            progress(Progress(search, searches, step, cost, named, elapsed, left))

    try:
        _check_start(problem, space)
        spread = _spread(space, screened)
        if method != "adam" and spread:
            for number, point in enumerate(spread, 1):
                report(0, number, space.values(point), problem(space, point).cost)
            spread = sorted(spread, key=lambda point: problem(space, point).cost)[: starts - 1]
        begun_at = [np.zeros(len(space.names)), *spread]
        ends = SEARCHES[method](problem, space, begun_at, limits, report)
    except KeyboardInterrupt:
        kept = "nothing was saved: give save=, a file, to go on from it another time"
        if problem.saved_in:
            kept = f"all are in {problem.saved_in}: call fit again as before to go on from there"
        raise KeyboardInterrupt(f"interrupted after {problem.runs} model runs; {kept}") from None
    ends.sort(key=lambda end: problem(space, end.point).cost)
    best, status = ends[0]
    if throw and status != "converged":
        values, cost = space.values(best), problem(space, best).cost
        raise UnconvergedError(
            f"the fit has not settled after {max_iterations} iterations, at "
            f"{space.described(values)}, cost {cost:.4g}: start closer, free fewer parameters, "
            "or allow more iterations"
        )
    minima = [(space.values(end.point), problem(space, end.point).cost) for end in ends]
    return fit_at(problem, space, best, labels, status, minima)


def fit_kappa_s(curve: Measurement | Sequence[Measurement], scene: Scene, **options: Any) -> Fit:
    """`fit` of the squeeze-shear factor alone, to the squeeze stress over an edge of the pressure.

    The squeeze strain decays from there within lam = H sqrt(kappa_s (1-nu)/6) in plane strain
    (Brink 2015, section 4.7.2).  Elasticity (Filon 1903) does not decay so and turns into a little
    tension, so what is fitted is the width of a layer, and depends on where one looks.

    Parameters
    ----------
    curve : a `SqueezeCurve`, or several
    scene : start value, and everything that stays fixed
    options : of `fit`
    """
    return fit(curve, scene, ("strip.kappa_s",), **options)


def _check_counts(**given: Any) -> None:
    """Options that are whole numbers; each with the least it may be."""
    for name, (value, least) in given.items():
        whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
        if not (whole and least <= value <= MOST):
            fix = f"{least} or more" if not whole or value < least else f"{MOST} at the most"
            raise InputError(f"{name} = {shown(value)}: give a whole number, {fix}")


def _check_sizes(**given: Any) -> None:
    """Options that are positive numbers; each with what to give."""
    for name, (value, fix) in given.items():
        number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
        if not (number and 0.0 < value <= sys.float_info.max):
            raise InputError(f"{name} = {shown(value)}: give {fix}")


def _specimens(data: Any, scene: Scene | None, weights: Sequence[float]) -> list[Specimen]:
    """Specimens with labels, no two alike."""
    given = [data] if isinstance(data, Specimen) else data
    several = isinstance(given, Sequence) and not isinstance(given, Loop)
    if not (several and any(isinstance(item, Specimen) for item in given)):
        if scene is None:
            raise InputError(
                "scene: give one, or a Specimen (a scene with its data) in place of data"
            )
        require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
        return [Specimen(scene, data, weights=weights)]
    if not all(isinstance(item, Specimen) for item in given):
        raise InputError("data: mixes specimens with measurements: make each a Specimen")
    for name, brought in {"scene": scene is not None, "weights": len(weights) > 0}.items():
        if brought:
            raise InputError(f"{name}: the specimens bring their own; leave it out")
    numbered = [
        specimen._replace(label=specimen.label or f"specimen {number}")
        for number, specimen in enumerate(given, 1)
    ]
    labels = [specimen.label for specimen in numbered]
    twice = [label for label in labels if labels.count(label) > 1]
    if twice:
        raise InputError(f"specimens: two have the label {twice[0]!r}: give each its own")
    return numbered


def _check_start(problem: Problem, space: Space) -> None:
    point = problem(space, np.zeros(len(space.names)))
    if not point.sound:
        raise UnconvergedError(
            "the model finds no equilibrium at the start values: start closer, or lower "
            "contact.stick_stiffness"
        )
    data = point.jacobian[: point.prediction.size]
    for name, column in zip(space.names, data.T, strict=True):
        if not np.any(np.abs(column) > NO_INFLUENCE):
            raise InputError(
                f"free {name!r}: the data do not depend on it at its start; leave it out"
            )


def _spread(space: Space, count: int) -> list[NDArray[np.float64]]:
    """A Latin hypercube of points."""
    random = np.random.default_rng(0)
    cells = np.stack([random.permutation(count) for _ in space.names], axis=1)
    parts = (cells + random.uniform(size=cells.shape)) / max(count, 1)
    straight, box = space.straight()
    near = np.clip(box, -1.0, 1.0)
    bounded = np.array([parameter.bounded for parameter in space.parameters])
    low, high = np.where(bounded[:, None], box, near).T
    return [space.point(straight.values(low + part * (high - low))) for part in parts]
