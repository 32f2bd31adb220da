"""Parameters from measurements: least squares on the response, with standard errors.

The only file that imports jaxopt.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import jaxopt
import numpy as np
from jax import Array
from numpy.typing import NDArray

from jbeamshell.errors import InputError, UnconvergedError
from jbeamshell.experiment import Experiment, Specimen
from jbeamshell.loops import Loop
from jbeamshell.measurements import Measurement
from jbeamshell.newton import Newton
from jbeamshell.parameters import FARTHEST, Parameter, Space, as_parameters, search_space
from jbeamshell.problem import Point, Problem
from jbeamshell.results import Fit, fit_at
from jbeamshell.scene import Scene
from jbeamshell.uncertainty import check_level

__all__ = ["Fit", "Parameter", "Specimen", "driver_of", "fit", "fit_kappa_s", "profile"]

POINTS = 96  # of a loop that the model is run through
MAX_ITERATIONS = 40
FLAT = 1e-6  # relative gain in cost at which a fit has settled
METHODS = ("levenberg-marquardt", "l-bfgs-b")
STARTS = 3  # of a search between bounds
SCREENED = 4  # points tried for each start beside the given one
NO_INFLUENCE = 1e-9  # largest change of a residual, for a unit step, that is rounding
PROFILE_POINTS = 8  # at most, to either side
PROFILED = 0.02  # of its root: so well the ends of a profile's interval are found

Evaluate = Callable[[NDArray[np.float64]], Point]
Report = Callable[[NDArray[np.float64], float], None]


def driver_of(loops: Sequence[Loop]) -> str:
    """Which column drove the test: the smoother one; the force where neither is rough."""

    def roughness(column: NDArray[np.float64]) -> float:
        return float(np.sqrt(np.mean(np.diff(column, 3) ** 2)) / np.ptp(column))

    force = np.mean([roughness(loop.force) for loop in loops])
    displacement = np.mean([roughness(loop.displacement) for loop in loops])
    return "displacement" if displacement < 0.5 * force and force > 1e-3 else "force"


def fit(
    data: Measurement | Specimen | Sequence[Measurement] | Sequence[Specimen],
    scene: Scene | None = None,
    free: Sequence[str | Parameter] = (),
    *,
    method: str = METHODS[0],
    starts: int | None = None,
    noise: float | None = None,
    save: str | os.PathLike[str] | None = None,
    solver: Newton | None = None,
    points: int = POINTS,
    max_iterations: int = MAX_ITERATIONS,
    tolerance: float = 1e-7,
    progress: Callable[[str], None] | None = None,
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
    method : "levenberg-marquardt", or "l-bfgs-b", which may end on a bound
    starts : searches, from the given start and from the best of some points spread between the
        bounds (a factor e to either side where there are none); None is 3 if all parameters have
        two bounds, else 1
    noise : standard deviation of measurements without noise, as a part of their range
    save : file that keeps every model run, written whole after each; if it is there, the fit goes
        on from it
    solver : settings of Newton's method
    points : thin each loop to about so many points
    max_iterations : of each search
    tolerance : relative change of the parameters at which it stops (a flat cost stops it too)
    progress : called with one line per iteration
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
    if method not in METHODS:
        raise InputError(f"method = {method!r}: choose {' or '.join(map(repr, METHODS))}")
    if starts is not None and (not isinstance(starts, int) or starts < 1):
        raise InputError(f"starts = {starts!r}: give a whole number, 1 or more")
    parameters = as_parameters(free)
    specimens = _specimens(data, scene)
    labels = [specimen.label for specimen in specimens]
    scenes = dict(zip(labels, [specimen.scene for specimen in specimens], strict=True))
    space, begun = search_space(parameters, scenes)
    specimens = [specimen._replace(scene=begun[specimen.label]) for specimen in specimens]
    experiment = Experiment(specimens, points=points, noise=noise)
    problem = Problem(experiment, space, solver or Newton(), save)
    if starts is None:
        starts = STARTS if all(parameter.bounded for parameter in parameters) else 1

    def report(values: NDArray[np.float64], cost: float) -> None:
        if progress:
            progress(f"{space.described(values)}, cost {cost:.4g}")

    search = _levenberg_marquardt if method == METHODS[0] else _l_bfgs_b
    try:
        _check_start(problem, space)
        ends = [
            search(problem, space, start, max_iterations, tolerance, report)
            for start in _starts(problem, space, starts)
        ]
    except KeyboardInterrupt:
        kept = "nothing was saved: give save=, a file, to go on from it another time"
        if problem.saved_in:
            kept = f"all are in {problem.saved_in}: call fit again as before to go on from there"
        raise KeyboardInterrupt(f"interrupted after {problem.runs} model runs; {kept}") from None
    ends.sort(key=lambda end: problem(space, end[0]).cost)
    best, status = ends[0]
    if throw and status != "converged":
        values, cost = space.values(best), problem(space, best).cost
        raise UnconvergedError(
            f"the fit has not settled after {max_iterations} iterations, at "
            f"{space.described(values)}, cost {cost:.4g}: start closer, free fewer parameters, "
            "or allow more iterations"
        )
    minima = [(space.values(end), problem(space, end).cost) for end, _ in ends]
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


class Profile(NamedTuple):
    """The profile likelihood of one parameter: the best that all others can do beside it.

    Attributes
    ----------
    name : of the parameter
    values : (points,) increasing
    rises : (points,) of the cost over that of the minimum, over the noise squared
    interval : where the rise reaches that of the level; a bound of the parameter, or infinity,
        where it never does
    level : of confidence
    """

    name: str
    values: NDArray[np.float64]
    rises: NDArray[np.float64]
    interval: tuple[float, float]
    level: float


def profile(
    result: Fit,
    name: str,
    *,
    level: float = 0.95,
    max_iterations: int = MAX_ITERATIONS,
    tolerance: float = 1e-4,
) -> Profile:
    """Profile likelihood of a fitted parameter, and the interval that it gives.

    Unlike the intervals of `Fit`, it asks the model itself how far the parameter may go, all others
    following; so it is right where these are only good for little noise.

    Parameters
    ----------
    result : of `fit`
    name : one of ``result.values``
    level : of confidence
    max_iterations, tolerance : of the fit of the others

    Raises
    ------
    InputError
        for a name that was not fitted, or that ended at its bound
    """
    check_level(level)
    if name not in result.values or result.problem is None or result.uncertainty is None:
        raise InputError(f"profile {name!r}: was not fitted; names are {', '.join(result.values)}")
    problem, uncertainty = result.problem, result.uncertainty
    space, best = uncertainty.space, uncertainty.point
    entry = space.names.index(name)
    if uncertainty.held[entry]:
        raise InputError(f"profile {name!r}: it ended at its bound; give it more room")
    others = np.delete(np.arange(best.size), entry)
    along = uncertainty.inverse[:, entry] / uncertainty.inverse[entry, entry]
    least, wanted = problem(space, best).cost, uncertainty.quantile(level)

    def root_at(step: float) -> float:
        """Square root of the rise, which is about linear in the step."""
        whole = best + step * along

        def evaluate(part: NDArray[np.float64]) -> Point:
            point = problem(space, np.insert(part, entry, whole[entry]))
            return point._replace(jacobian=point.jacobian[:, others])

        if others.size:
            end, _ = _marquardt(evaluate, whole[others], max_iterations, tolerance)
            cost = evaluate(end).cost
        else:
            cost = evaluate(np.zeros(0)).cost
        return float(np.sqrt(max(cost - least, 0.0)) / uncertainty.sigma)

    spread = float(np.sqrt(uncertainty.covariance[entry, entry]))
    known, ends = {0.0: 0.0}, []
    for side in (-1.0, 1.0):
        end = _crossing(root_at, wanted, side, min(wanted * spread, 2.0), known)
        bound = space.bijections[entry][1 if side < 0.0 else 2]
        ends.append(bound if end is None else space.bijections[entry].value(best[entry] + end))
    steps = sorted(known, key=lambda step: space.bijections[entry].value(best[entry] + step))
    values = np.array([space.bijections[entry].value(best[entry] + step) for step in steps])
    rises = np.array([known[step] ** 2 for step in steps])
    return Profile(name, values, rises, (min(ends), max(ends)), level)


def _crossing(
    root_at: Callable[[float], float],
    wanted: float,
    side: float,
    step: float,
    known: dict[float, float],
) -> float | None:
    """Signed step at which a rising function of it reaches a value; None if it never does."""
    inside, outside = (0.0, 0.0), None
    for _ in range(PROFILE_POINTS):
        if step > FARTHEST:
            return None
        root = known[side * step] = root_at(side * step)
        if abs(root - wanted) < PROFILED * wanted:
            return side * step
        if root < wanted:
            inside = (step, root)
        else:
            outside = (step, root)
        if outside is None:
            step *= 2.0
            continue
        part = (wanted - inside[1]) / (outside[1] - inside[1])
        step = inside[0] + np.clip(part, 0.1, 0.9) * (outside[0] - inside[0])
    return None if outside is None else side * float(step)


def _specimens(data: Any, scene: Scene | None) -> list[Specimen]:
    """Specimens with labels, no two alike."""
    given = [data] if isinstance(data, Specimen) else data
    several = isinstance(given, Sequence) and not isinstance(given, Loop)
    own = several and len(given) > 0 and all(isinstance(item, Specimen) for item in given)
    if not own:
        if scene is None:
            raise InputError(
                "scene: give one, or a Specimen (a scene with its data) in place of data"
            )
        return [Specimen(scene, data)]
    if scene is not None:
        raise InputError("scene: the specimens bring their own; leave it out")
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
    for name, column in zip(space.names, point.jacobian.T, strict=True):
        if not np.any(np.abs(column) > NO_INFLUENCE):
            raise InputError(f"free {name!r}: the data do not depend on it; leave it out")


def _starts(problem: Problem, space: Space, count: int) -> list[NDArray[np.float64]]:
    """The given start, and the best of a Latin hypercube of others."""
    size = len(space.names)
    start = np.zeros(size)
    if count == 1:
        return [start]
    random, tried = np.random.default_rng(0), SCREENED * (count - 1)
    cells = np.stack([random.permutation(tried) for _ in range(size)], axis=1)
    parts = (cells + random.uniform(size=cells.shape)) / tried
    straight, box = space.straight()
    low, high = np.clip(box, -1.0, 1.0).T
    bounded = np.array([parameter.bounded for parameter in space.parameters])
    low, high = np.where(bounded, box[:, 0], low), np.where(bounded, box[:, 1], high)
    spread = [space.point(straight.values(low + part * (high - low))) for part in parts]
    spread.sort(key=lambda point: problem(space, point).cost)
    return [start, *spread[: count - 1]]


def _levenberg_marquardt(
    problem: Problem,
    space: Space,
    start: NDArray[np.float64],
    max_iterations: int,
    tolerance: float,
    report: Report,
) -> tuple[NDArray[np.float64], str]:
    """Where the search ends, and how: in the unbounded space."""

    def line(params: NDArray[np.float64], cost: float) -> None:
        report(space.values(params), cost)

    return _marquardt(lambda p: problem(space, p), start, max_iterations, tolerance, line)


def _marquardt(
    evaluate: Evaluate,
    start: NDArray[np.float64],
    max_iterations: int,
    tolerance: float,
    report: Report | None = None,
) -> tuple[NDArray[np.float64], str]:
    method = jaxopt.LevenbergMarquardt(
        residual_fun=lambda p: jnp.asarray(evaluate(np.asarray(p)).residual),
        materialize_jac=True,
        solver="cholesky",
        damping_parameter=1e-3,
        jit=False,
    )
    # Its last release forgets a jac_fun argument when the Jacobian is materialised.
    method._jac_fun = lambda p: jnp.asarray(evaluate(np.asarray(p)).jacobian)
    params: Any = jnp.asarray(start)
    state = method.init_state(params)
    for _ in range(max_iterations):
        before = float(state.value)
        params, state = method.update(params, state)
        if report:
            report(np.asarray(params), float(jnp.sum(state.residual**2)))
        gained = before - float(state.value)  # nothing when the step was refused
        if float(jnp.max(jnp.abs(state.delta))) < tolerance or 0.0 < gained < FLAT * before:
            return np.asarray(params), "converged"
    return np.asarray(params), "max_iterations"


def _l_bfgs_b(
    problem: Problem,
    space: Space,
    start: NDArray[np.float64],
    max_iterations: int,
    tolerance: float,
    report: Report,
) -> tuple[NDArray[np.float64], str]:
    """Where the search ends, and how: in a box, whose sides it may reach."""
    straight, box = space.straight()
    begin = np.clip(straight.point(space.values(start)), *box.T)
    scale = 1.0 / problem(straight, begin).cost  # its tolerances are absolute

    def value_and_gradient(params: Array) -> tuple[float, NDArray[np.float64]]:
        point = problem(straight, np.asarray(params))
        return scale * point.cost, 2.0 * scale * point.residual @ point.jacobian

    def callback(params: Array) -> None:
        at = np.asarray(params)
        report(straight.values(at), problem(straight, at).cost)

    method = jaxopt.ScipyBoundedMinimize(
        fun=value_and_gradient,
        value_and_grad=True,
        method="L-BFGS-B",
        maxiter=max_iterations,
        options={"ftol": tolerance**2, "gtol": tolerance},
        callback=callback,
        jit=False,
    )
    params, state = method.run(jnp.asarray(begin), bounds=tuple(map(jnp.asarray, box.T)))
    end = space.point(straight.values(np.asarray(params)))
    return end, "converged" if bool(state.success) else "max_iterations"
