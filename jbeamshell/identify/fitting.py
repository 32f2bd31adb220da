"""Parameters from measurements: least squares on the response, with standard errors."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require, require_choice, require_count
from jbeamshell.common.errors import InputError, UnconvergedError
from jbeamshell.common.progress import bar
from jbeamshell.common.threads import in_one_lapack_thread
from jbeamshell.identify.assembly import Assembly
from jbeamshell.identify.copies import counted_once
from jbeamshell.identify.experiment import Experiment
from jbeamshell.identify.models import Driven
from jbeamshell.identify.parameters import Parameter, as_parameters, is_number
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.results import Fit, fit_at
from jbeamshell.identify.rig import with_starts
from jbeamshell.identify.search import ADAM_STEPS, SEARCHES, SearchResult, StoppingRule
from jbeamshell.identify.search_space import SearchSpace, search_space
from jbeamshell.identify.settling import Settled, settle
from jbeamshell.identify.specimens import Specimen, as_specimens, free_of, inspected
from jbeamshell.identify.starts import check_starts
from jbeamshell.laws import Law
from jbeamshell.measured.curves import Measurement
from jbeamshell.measured.recordings import FEWEST_POINTS
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.scene import Scene

POINTS = 96  # points of a loop at which the model is run
MAX_ITERATIONS = 40
OF_LAWS = 5  # times as many for laws, which cost little and creep to their limits
LAW_STARTS = 6
METHODS = tuple(SEARCHES)
STARTS = 3  # default number of searches if all parameters have two bounds
ADAM_STARTS = 8
SCREENED = 4  # random points tried for each start besides the given one
NO_INFLUENCE = 1e-9  # change of a residual for a unit step below which it is rounding

Vector = NDArray[np.float64]


class FitProgress(NamedTuple):
    """Progress of a fit; as text, it is one line.

    Attributes
    ----------
    search, searches : number of the search, 0 while starts are tried, and how many there are
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
        values = ", ".join(f"{name} = {value:.6g}" for name, value in self.values.items())
        return f"{at} {self.step}, cost {self.cost:.4g}, at most {self.left:.0f} s left: {values}"


@in_one_lapack_thread
def fit(
    data: Measurement | Specimen | Sequence[Measurement] | Sequence[Specimen],
    scene: Scene | Law | Driven | Assembly | str | None = None,
    free: Sequence[str | Parameter] = (),
    *,
    weights: Sequence[float] = (),
    method: str = METHODS[0],
    starts: int | None = None,
    noise: float | None = None,
    save: str | os.PathLike[str] | None = None,
    solver: Newton | None = None,
    points: int = POINTS,
    max_iterations: int | None = None,
    tolerance: float = 1e-7,
    progress: Callable[[FitProgress], None] | None = None,
    throw: bool = True,
    unchecked: bool = False,
) -> Fit:
    """Fit parameters of a scene to measured or computed curves by least squares.

    A loop or a backbone drives the model by the column that ``scene.load.control`` names, and is
    compared in the other column.  A squeeze curve is compared under the scene's pressures alone.
    Dissipation and stiffness are compared by their logarithms.  If the measurements carry noise, or
    if ``noise`` is given, residuals are divided by it.  Otherwise every measurement counts relative
    to its own range, and the noise is estimated from the residual.

    Parameters
    ----------
    data : a measurement or a list of them, of one kind or several; or one `Specimen` or several,
        which bring their own scenes
    scene : start values, and all values that stay fixed; None with specimens.  Or a law of a joint
        in place of the strip: a `jbeamshell.laws.Law`, or its name, such as "iwan4", to start it
        from the data.  Or a structure with joints, see `Assembly` and `jointed`, for its frequency
        and damping over amplitude and its forced responses
    free : what to fit: keys such as "contact.friction" or "structure.damping_ratio", or `Parameter`
        with bounds, scale, prior, and whether every specimen has a value of its own; if empty, the
        numbers of a law that loops tell
    weights : factors of the measurements' residuals, besides the curves' own; all 1 if empty
    method : "levenberg-marquardt"; "l-bfgs-b", which may end on a bound; or "adam", which starts
        from all points at once and finishes the best by Levenberg-Marquardt
    starts : number of starts: the given one, and others spread between the bounds (a factor e to
        either side of a missing bound).  "adam" uses all of them, the other methods the best of
        four times as many.  None means 8 for "adam"; else 6 for a law, 3 if all parameters of a
        strip have two bounds, or 1
    noise : standard deviation of measurements without noise, over their range
    save : file that keeps every model run; if it exists, the fit continues from it
    solver : settings of Newton's method; None takes the defaults
    points : number of points to which each loop is thinned, approximately
    max_iterations : largest number of iterations of each search; None is 40, for laws 200
    tolerance : relative change of the parameters at which a search stops; a flat cost stops it too
    progress : called after every step with a `FitProgress`; None shows a bar where a person watches
    throw : True to raise if the fit did not converge; if False, read ``status``
    unchecked : True to fit loops that an inspection refuses too; its findings are then warnings

    Returns
    -------
    Fit
        the fitted scene, values with standard errors and 95 % intervals, misfits and warnings

    Raises
    ------
    InputError
        if a parameter cannot be fitted, or the data do not depend on it; if an inspection refuses a
        loop, see `jbeamshell.inspect`; if the scene cannot reproduce a measurement, such as a force
        beyond gross slip at the start values; if ``save`` belongs to another fit
    UnconvergedError
        if the search does not converge, or the model finds no equilibrium at the start
    KeyboardInterrupt
        if interrupted, with a message that says what was saved

    Examples
    --------
    ::

        loops = jb.measured.read_loops("rig.csv")
        fit = jb.identify.fit(loops, jb.library.standard(), ["contact.friction"])
        fit.values["contact.friction"], fit.errors["contact.friction"]

        law = jb.identify.fit(loops, "iwan4").law  # four parameters in place of the strip
        law.dissipation_at_force(0.5)
    """
    require_choice("method", method, METHODS)
    require_count("starts", 1 if starts is None else starts, 1)
    require_count("points", points, FEWEST_POINTS)
    _require_positive("noise", 1.0 if noise is None else noise, "part of the range, such as 0.01")
    _require_positive("tolerance", tolerance, "number, such as 1e-7")
    valid = solver is None or isinstance(solver, Newton)
    require("solver", solver, valid, "give a jbeamshell.Newton")
    require_choice("unchecked", unchecked, (False, True))
    specimens, copies = counted_once(as_specimens(data, scene, weights))
    if max_iterations is None:
        of_law = isinstance(specimens[0].scene, Driven)
        max_iterations = OF_LAWS * MAX_ITERATIONS if of_law else MAX_ITERATIONS
    require_count("max_iterations", max_iterations, 1)
    chosen = not isinstance(free, list | tuple) or len(free) > 0
    parameters = as_parameters(free if chosen else free_of(specimens))
    doubts = inspected(specimens, [parameter.key for parameter in parameters], unchecked)
    parameters = with_starts(parameters, specimens)
    space, scenes = search_space(parameters, {one.label: one.scene for one in specimens})
    specimens = [one._replace(scene=scenes[one.label]) for one in specimens]
    check_starts(specimens, parameters)
    experiment = Experiment(specimens, points=points, noise=noise, free=space.keys)
    problem = Problem(experiment, space, solver or Newton(), save)
    if starts is None:
        bounded = all(parameter.bounded for parameter in parameters)
        of_law = isinstance(specimens[0].scene, Driven)
        few = LAW_STARTS if of_law else STARTS if bounded else 1
        starts = ADAM_STARTS if method == "adam" else few
    noise_cost = experiment.weight.size if experiment.noisy else 0
    stopping = StoppingRule(max_iterations, tolerance, noise_cost)
    told = "".join(f"; {doubt}" for doubt in doubts)  # where a fit fails, they may say why
    try:
        with bar("fit") as shown:

            def show(now: FitProgress) -> None:
                shown.set_postfix_str(str(now))
                shown.update()

            end, ends = _search(problem, space, method, starts, stopping, progress or show)
    except KeyboardInterrupt:
        kept = (
            "nothing was saved: give save= (--save on the command line), a file, to continue later"
        )
        if problem.saved_in:
            kept = f"all are in {problem.saved_in}: fit again with the same arguments to continue"
        raise KeyboardInterrupt(f"interrupted after {problem.runs} model runs; {kept}") from None
    except UnconvergedError as error:
        raise UnconvergedError(f"{error}{told}") from None
    minima = [(space.values(own.point), problem(space, own.point).cost) for own in ends]
    status = ends[0].status
    if throw and status != "converged":
        values, cost = minima[0]
        named = ", ".join(f"{name} = {value:.6g}" for name, value in space.named(values).items())
        raise UnconvergedError(
            f"the fit has not converged after {max_iterations} iterations, at {named}, cost "
            f"{cost:.4g}: start closer, free fewer parameters, or raise max_iterations{told}"
        )
    found = fit_at(problem, space, end, list(scenes), status, minima)
    return found._replace(warnings=[*found.warnings, *copies, *doubts])


def fit_kappa_s(curve: Measurement | Sequence[Measurement], scene: Scene, **options: Any) -> Fit:
    """Fit the squeeze-shear factor alone to the squeeze stress beside an edge of the pressure.

    The squeeze strain decays from the edge within lam = H sqrt(kappa_s (1-nu)/6) in plane strain
    (Brink 2015, section 4.7.2).  In elasticity (Filon 1903) the stress does not decay so: it turns
    into a little tension.  What is fitted is the width of a layer, and depends on the window of
    positions.

    Parameters
    ----------
    curve : a `SqueezeCurve`, or several
    scene : start value, and all values that stay fixed
    options : further arguments of `fit`

    Returns
    -------
    Fit
        with the one value "strip.kappa_s"; errors as for `fit`
    """
    return fit(curve, scene, ("strip.kappa_s",), **options)


def _require_positive(name: str, value: Any, what: str) -> None:
    require(name, value, is_number(value) and value > 0.0, f"give a positive {what}")


class _Monitor:
    """Counter of the steps of a fit, which reports each with the time left."""

    def __init__(
        self,
        space: SearchSpace,
        searches: int,
        most_steps: int,
        progress: Callable[[FitProgress], None],
    ) -> None:
        self._space, self._searches, self._most = space, searches, most_steps
        self._progress, self._steps, self._begin = progress, 0, time.perf_counter()
        self._last = (0, 0)

    def __call__(self, search: int, step: int, values: Vector, cost: float) -> None:
        """Count one step and report it."""
        self._steps += 1
        self._last = (search, step)
        elapsed = time.perf_counter() - self._begin
        left = elapsed / self._steps * max(self._most - self._steps, 0)
        named = self._space.named(values)
        self._progress(FitProgress(search, self._searches, step, cost, named, elapsed, left))

    def settling(self, point: Vector, cost: float) -> None:
        """Count a step after the last search and report it."""
        search, step = self._last
        self(search, step + 1, self._space.values(point), cost)


def _search(
    problem: Problem,
    space: SearchSpace,
    method: str,
    starts: int,
    stopping: StoppingRule,
    progress: Callable[[FitProgress], None],
) -> tuple[Settled, list[SearchResult]]:
    """Ends of the searches from all starts, the best first, and where that settles."""
    check_start(problem, space)
    first = np.zeros(len(space.names))
    if method == "adam":
        report = _Monitor(space, 1, stopping.max_iterations + ADAM_STEPS, progress)
        points = _spread(space, starts - 1)
    else:
        tried = SCREENED * (starts - 1)
        most = tried + starts * stopping.max_iterations
        report = _Monitor(space, starts, most, progress)
        costs, points = [], _spread(space, tried)
        for number, point in enumerate(points, 1):
            costs.append(problem(space, point).cost)
            report(0, number, space.values(point), costs[-1])
        points = [points[i] for i in np.argsort(costs, kind="stable")[: starts - 1]]
    ends = SEARCHES[method](problem, space, [first, *points], stopping, report)
    ends = sorted(ends, key=lambda end: problem(space, end.point).cost)
    best = settle(problem, space, ends[0].point, report.settling)
    status = ends[0].status if best.settled else "max_iterations"
    return best, [SearchResult(best.point, status), *ends[1:]]


def check_start(problem: Problem, space: SearchSpace) -> None:
    """Raise unless the model has an equilibrium at the start, and every parameter an influence."""
    start = problem(space, np.zeros(len(space.names)))
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
