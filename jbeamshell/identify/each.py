"""Many fits, each on its own: of the specimens of a series, or of bootstrap copies of one.

All measurements of one kind and length share one compiled run of the model, and searches run on all
cores.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require, require_count
from jbeamshell.common.errors import InputError
from jbeamshell.common.progress import counting
from jbeamshell.common.summary import Summary
from jbeamshell.common.threads import in_one_lapack_thread
from jbeamshell.identify.copies import counted_once
from jbeamshell.identify.experiment import Experiment
from jbeamshell.identify.fitting import MAX_ITERATIONS, POINTS, check_start
from jbeamshell.identify.models import Model
from jbeamshell.identify.parameters import Parameter, as_parameters
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.results import Fit, fit_at
from jbeamshell.identify.rig import RiggedObservation
from jbeamshell.identify.search import StoppingRule, minimise
from jbeamshell.identify.search_space import SearchSpace, search_space
from jbeamshell.identify.settling import settle
from jbeamshell.identify.specimens import Specimen, as_specimens
from jbeamshell.identify.starts import check_starts
from jbeamshell.measured.curves import Measurement
from jbeamshell.measured.recordings import FEWEST_POINTS
from jbeamshell.numerics.newton import Newton

LEVEL = 0.95  # part of the values between the ends that a summary names


class Fits(NamedTuple):
    """Results of many fits of the same numbers.

    Attributes
    ----------
    values, errors : (fits,) fitted values and standard errors by key
    misfit : (fits,) root mean square of the residual over the range of the response
    converged : (fits,) False where a search did not converge; its values mean little
    """

    values: dict[str, NDArray[np.float64]]
    errors: dict[str, NDArray[np.float64]]
    misfit: NDArray[np.float64]
    converged: NDArray[np.bool_]

    def intervals(self, level: float = LEVEL) -> dict[str, tuple[float, float]]:
        """Ends between which this part of the converged values lies, by key.

        Of bootstrap copies they are a confidence interval.

        Raises
        ------
        InputError
            if no fit converged
        """
        good = int(np.sum(self.converged))
        require("converged", good, good > 0, "has no fit to tell from: start closer")
        sides = 0.5 - 0.5 * level, 0.5 + 0.5 * level
        known = {key: values[self.converged] for key, values in self.values.items()}
        return {key: tuple(np.quantile(own, sides).tolist()) for key, own in known.items()}

    @property
    def _summary(self) -> Summary:
        good = int(np.sum(self.converged))
        title = f"{self.converged.size:,} fits, {good:,} converged"
        if not good:
            return Summary(title, [])
        ends = self.intervals()
        rows = [
            (
                key,
                f"median {np.median(own[self.converged]):.6g}, 95 % between "
                "{:.6g} and {:.6g}".format(*ends[key]),
            )
            for key, own in self.values.items()
        ]
        return Summary(title, rows, [f"median misfit {100.0 * np.median(self.misfit):.3g} %"])

    def __str__(self) -> str:
        return self._summary.as_text(28)

    def _repr_html_(self) -> str:
        return self._summary.as_html()


@in_one_lapack_thread
def fit_each(
    data: Sequence[Measurement | Sequence[Measurement]],
    scene: Model,
    free: Sequence[str | Parameter],
    *,
    noise: float | None = None,
    points: int = POINTS,
    max_iterations: int = MAX_ITERATIONS,
    tolerance: float = 1e-7,
    progress: Callable[[int, int], None] | None = None,
) -> Fits:
    """Fit the same numbers to each of many measurements on its own.

    Parameters
    ----------
    data : measurements of one kind, or a list of measurements for each fit; loops are not
        inspected, see `jbeamshell.inspect`
    scene : start values of every fit, and all values that stay fixed
    free : what to fit, see `fit`
    noise, points, max_iterations, tolerance : see `fit`
    progress : called with the fits done and to do; None shows a bar where a person watches

    Returns
    -------
    Fits
        values and errors of all fits, in the order of the data

    Raises
    ------
    InputError
        if there are no data, or if a fit cannot be made; it names the fit
    UnconvergedError
        if the model finds no equilibrium at the start

    Examples
    --------
    ::

        fits = jb.identify.fit_each(loops, jb.Scene(), ["contact.friction"])
        fits.values["contact.friction"].std()
    """
    several = isinstance(data, Sequence) and len(data) > 0
    require("data", data if not several else "given", several, "give a list of measurements")
    require_count("points", points, FEWEST_POINTS)
    require_count("max_iterations", max_iterations, 1)
    (first,) = as_specimens(data[0], scene, ())
    space, scenes = search_space(as_parameters(free), {first.label: first.scene})
    start = scenes[first.label]
    stopping = StoppingRule(max_iterations, tolerance)

    def one(place: int) -> Fit:
        try:
            specimens, _ = counted_once([Specimen(start, data[place])])
            check_starts(specimens, space.parameters)
            experiment = Experiment(specimens, points=points, noise=noise, free=space.keys)
            return _searched(Problem(experiment, space, Newton()), space, stopping)
        except InputError as error:
            raise InputError(f"fit {place + 1} of {len(data)}: {error}") from None

    with counting(progress, "fits", "fit") as told, ThreadPoolExecutor(os.cpu_count()) as pool:
        found = [one(0)]  # threads that miss the same compiled code would all compile it
        told(1, len(data))
        for fit in pool.map(one, range(1, len(data))):
            found.append(fit)
            told(len(found), len(data))
    return Fits(
        {key: np.array([fit.values[key] for fit in found]) for key in space.names},
        {key: np.array([fit.errors[key] for fit in found]) for key in space.names},
        np.array([fit.misfit for fit in found]),
        np.array([fit.status == "converged" for fit in found]),
    )


def _searched(problem: Problem, space: SearchSpace, stopping: StoppingRule) -> Fit:
    """Fit of one search from the start."""
    check_start(problem, space)
    at_noise = problem.experiment.weight.size if problem.experiment.noisy else 0
    rule = stopping._replace(noise_cost=at_noise)
    end = minimise(lambda point: problem(space, point), np.zeros(len(space.names)), rule)
    return fit_at(problem, space, settle(problem, space, end.point), [""], end.status, [])


def bootstrap(result: Fit, copies: int = 1000, *, seed: int = 0) -> Fits:
    """Fit copies of a fit's data, whose residuals are drawn anew.

    Each copy is the fitted response with residuals that are drawn in blocks along the curve, so
    that neighbours stay as correlated as they are (Kunsch, Ann. Stat. 17, 1989).  The spread of the
    values holds what residuals make of them, and not what the model's grid may leave.

    Parameters
    ----------
    result : result of `fit` for one strip, law or structure
    copies : number of copies
    seed : seed of the draws

    Returns
    -------
    Fits
        with ``intervals()``

    Raises
    ------
    InputError
        if the result was not made by `fit`, or has several specimens

    Examples
    --------
    ::

        jb.identify.bootstrap(jb.identify.fit(loops, scene, ["contact.friction"])).intervals()
    """
    require_count("copies", copies, 2)
    problem, uncertainty = result.problem, result.uncertainty
    if problem is None or uncertainty is None:
        raise InputError("bootstrap: this result was not made by fit")
    fix = "has several specimens: fit them one by one"
    require("result", len(result.scenes), len(result.scenes) == 1, fix)
    experiment, space = problem.experiment, uncertainty.space
    rigged = any(isinstance(each, RiggedObservation) for each in experiment.observations)
    require("result", "a rig", not rigged, "has a rig, whose numbers copies do not know")
    best = problem(space, uncertainty.point)
    rows = experiment.weight.size
    residual = best.residual[:rows] / experiment.emphasis / experiment.weight
    residual = residual * np.sqrt(
        rows / max(rows - len(space.names), 1)
    )  # of which a fit took part
    random = np.random.default_rng(seed)
    data = []
    for _ in range(copies):
        drawn = np.concatenate([_blocks(residual[own], random) for own in experiment.slices])
        data.append(experiment.as_measurements(best.prediction - drawn))
    starts = zip(space.parameters, space.names, strict=True)
    free = [dataclasses.replace(own, start=result.values[name]) for own, name in starts]
    return fit_each(data, result.scene, free)


def _blocks(values: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """Blocks of values, drawn from a closed curve and joined to as many, with mean zero."""
    size = max(1, round(np.sqrt(values.size)))
    begins = random.integers(values.size, size=-(-values.size // size))
    places = (begins[:, None] + np.arange(size)).ravel()[: values.size] % values.size
    return values[places] - np.mean(values)
