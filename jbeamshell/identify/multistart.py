"""Search of a fit from several starts, and on to a bound where it runs into one."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require, require_choice, require_count
from jbeamshell.common.errors import InputError, Status, UnconvergedError
from jbeamshell.common.progress import bar
from jbeamshell.identify.doubts import doubts_of
from jbeamshell.identify.models import LawModel
from jbeamshell.identify.parameters import is_number
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.results import Fit
from jbeamshell.identify.search import (
    SearchResult,
    StoppingRule,
    minimise,
    together,
    within_bounds,
)
from jbeamshell.identify.search_space import SearchSpace
from jbeamshell.identify.uncertainty import uncertainty_at
from jbeamshell.measured.form import FEWEST_POINTS
from jbeamshell.numerics.newton import Newton

POINTS = 96  # points of a loop at which the model is run
MAX_ITERATIONS = 40
OF_LAWS = 5  # times as many for laws, which cost little and creep to their limits
LAW_STARTS = 6
STARTS = 3  # default number of searches if all parameters have two bounds
TOGETHER = 8  # starts that move together where no search has converged
SCREENED = 4  # random points tried for each start besides the given one
NO_INFLUENCE = 1e-9  # change of a residual for a unit step below which it is rounding

Vector = NDArray[np.float64]


def _require_positive(name: str, value: Any, what: str) -> None:
    require(name, value, is_number(value) and value > 0.0, f"give a positive {what}")


@dataclasses.dataclass(frozen=True)
class Options:
    """Settings of a fit; see `jbeamshell.identify.fit` for what they mean.

    Raises
    ------
    InputError
        for a value that makes no sense
    """

    starts: int | None = None
    noise: float | None = None
    points: int = POINTS
    max_iterations: int | None = None
    tolerance: float = 1e-7
    unchecked: bool = False
    throw: bool = True
    solver: Newton | None = None

    def __post_init__(self) -> None:
        require_count("starts", 1 if self.starts is None else self.starts, 1)
        require_count("points", self.points, FEWEST_POINTS)
        most, noise = self.max_iterations, self.noise
        require_count("max_iterations", 1 if most is None else most, 1)
        _require_positive(
            "noise", 1.0 if noise is None else noise, "part of the range, such as 0.01"
        )
        _require_positive("tolerance", self.tolerance, "number, such as 1e-7")
        valid = self.solver is None or isinstance(self.solver, Newton)
        require("solver", self.solver, valid, "give a jbeamshell.Newton")
        for name in ("unchecked", "throw"):
            require_choice(name, getattr(self, name), (False, True))


DEFAULTS = Options()


class FitProgress(NamedTuple):
    """Progress of a fit; as text, it is one line.

    Attributes
    ----------
    search, searches : number of the search, 0 while starts are tried, and how many there are; what
        follows them has larger numbers
    step : number of the step in the search, or of the start that is tried
    cost : sum of the squared residuals
    values : parameters by name
    elapsed : seconds since the fit began
    left : seconds it may still take if every search uses all its iterations
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
        at = "last part, step" if self.search > self.searches else at
        values = ", ".join(f"{name} = {value:.6g}" for name, value in self.values.items())
        return f"{at} {self.step}, cost {self.cost:.4g}, at most {self.left:.0f} s left: {values}"


def found_by(
    problem: Problem,
    options: Options,
    labels: Sequence[str],
    doubts: Sequence[str] = (),
    notes: Sequence[str] = (),
    progress: Callable[[FitProgress], None] | None = None,
) -> Fit:
    """Fit of a problem.

    Parameters
    ----------
    problem : least-squares problem
    options : settings
    labels : labels of the specimens
    doubts, notes : sentences on the data; where a fit fails, they may say why
    progress : called after every step; None shows a bar where a person watches
    """
    space = problem.space
    of_law = isinstance(problem.experiment.models[0], LawModel)
    most = options.max_iterations or (OF_LAWS * MAX_ITERATIONS if of_law else MAX_ITERATIONS)
    starts = options.starts
    if starts is None:
        bounded = all(parameter.bounded for parameter in space.parameters)
        starts = LAW_STARTS if of_law else STARTS if bounded else 1
    rescue = options.max_iterations is None
    stopping = StoppingRule(most, options.tolerance)
    told = "".join(f"; {sentence}" for sentence in (*doubts, *notes))
    try:
        watched: Any = bar("fit") if progress is None else contextlib.nullcontext()
        with watched as shown:

            def show(now: FitProgress) -> None:
                shown.set_postfix_str(str(now))
                shown.update()

            ends = _search(problem, starts, stopping, rescue, progress or show)
    except KeyboardInterrupt:
        kept = (
            "nothing was saved: give save= (--save on the command line), a file, to continue later"
        )
        if problem.saved_in:
            kept = f"all are in {problem.saved_in}: fit again with the same arguments to continue"
        raise KeyboardInterrupt(f"interrupted after {problem.runs} model runs; {kept}") from None
    except UnconvergedError as error:
        raise UnconvergedError(f"{error}{told}") from None
    minima = [(space.values(own.point), problem(own.point).cost) for own in ends]
    point, converged = ends[0]
    if options.throw and not converged:
        values, cost = minima[0]
        named = ", ".join(f"{name} = {value:.6g}" for name, value in space.named(values).items())
        raise UnconvergedError(
            f"the fit has not converged after {most} iterations, at {named}, cost "
            f"{cost:.4g}: start closer, free fewer parameters, or raise max_iterations{told}"
        )
    values, uncertainty = space.values(point), uncertainty_at(problem, point)
    models = [
        model.replace(space.of(values, owner)).fitted(problem.experiment.of(owner))
        for owner, model in enumerate(problem.experiment.models)
    ]
    fit = Fit(
        problem,
        uncertainty,
        {label: model.own for label, model in zip(labels, models, strict=True)},
        Status.CONVERGED if converged else Status.MAX_ITERATIONS,
        problem.runs,
        [(space.named(point), cost) for point, cost in minima],
        notes=notes,
    )
    own = doubts_of(problem, uncertainty, models, fit.left, [c for _, c in minima])
    return dataclasses.replace(fit, doubts=[*own, *doubts])


def _reporter(
    space: SearchSpace, searches: int, most: int, progress: Callable[[FitProgress], None]
) -> Callable[[int, int, Vector, float], None]:
    """Function that reports a search's number, its step, a point (n,) and its cost."""
    begin, count = time.perf_counter(), itertools.count(1)

    def report(search: int, step: int, point: Vector, cost: float) -> None:
        elapsed, done = time.perf_counter() - begin, next(count)
        left, named = elapsed / done * max(most - done, 0), space.named(space.values(point))
        progress(FitProgress(search, searches, step, cost, named, elapsed, left))

    return report


def _search(
    problem: Problem,
    starts: int,
    stopping: StoppingRule,
    rescue: bool,
    progress: Callable[[FitProgress], None],
) -> list[SearchResult]:
    """Ends of the searches from all starts, the best first."""
    check_start(problem)
    space = problem.space
    tried = SCREENED * (starts - 1)
    report = _reporter(space, starts, tried + starts * stopping.max_iterations, progress)

    def cost(end: SearchResult) -> float:
        return problem(end.point).cost

    def search(number: int, start: Vector) -> SearchResult:
        return minimise(problem, start, stopping, partial(report, number))

    costs, points = [], _spread(space, tried)
    for number, point in enumerate(points, 1):
        costs.append(problem(point).cost)
        report(0, number, point, costs[-1])
    best = [points[i] for i in np.argsort(costs, kind="stable")[: starts - 1]]
    first = np.zeros(len(space.names))
    ends = [search(number, start) for number, start in enumerate([first, *best], 1)]
    ends = sorted(ends, key=cost)
    if rescue and not ends[0].converged:
        many = [ends[0].point, first, *_spread(space, TOGETHER - 2)]
        moved = together(problem, many, partial(report, starts + 1))
        ends = sorted([*ends, search(starts + 2, moved)], key=cost)
    if _at_bound(space, ends[0].point):
        end = within_bounds(problem, ends[0].point, stopping)
        ends[0] = ends[0]._replace(point=min(ends[0], end, key=cost).point)
    return ends


def _at_bound(space: SearchSpace, point: Vector) -> bool:
    """True if a value ended at a bound of its parameter."""
    pairs = zip(space.bijections, space.values(point).tolist(), strict=True)
    return any(bijection.bound_at(value) is not None for bijection, value in pairs)


def check_start(problem: Problem) -> None:
    """Raise unless the model has an equilibrium at the start, and every parameter an influence."""
    space = problem.space
    start = problem(np.zeros(len(space.names)))
    if not start.converged:
        raise UnconvergedError(
            "the model finds no equilibrium at the start values: start closer, or take "
            "softer sliders (contact.stick_stiffness = 100 or less)"
        )
    data = start.jacobian[: start.prediction.size]
    for name, column in zip(space.names, data.T, strict=True):
        if not np.all(np.isfinite(column)):
            raise UnconvergedError(
                f"free {name!r}: the response has no derivative at its start: start elsewhere"
            )
        if not np.any(np.abs(column) > NO_INFLUENCE):
            raise InputError(
                f"free {name!r}: the data do not depend on it at its start; leave it out"
            )


def _spread(space: SearchSpace, count: int) -> list[Vector]:
    """Points of a Latin hypercube between the bounds."""
    random = np.random.default_rng(0)
    cells = np.stack([random.permutation(count) for _ in space.names], axis=1)
    parts = (cells + random.uniform(size=cells.shape)) / max(count, 1)
    boxed, box = space.boxed()
    near = np.clip(box, -1.0, 1.0)
    bounded = np.all(np.isfinite(box), axis=1)  # a bound of 0 is none on a logarithmic scale
    low, high = np.where(bounded[:, None], box, near).T
    return [space.point(boxed.values(low + part * (high - low))) for part in parts]
