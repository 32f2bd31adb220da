"""Many fits, each on its own: of the specimens of a series, or of bootstrap copies of one fit.

All measurements of one kind and length share one compiled run of the model, and searches run on all
cores.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require, require_count
from jbeamshell.common.errors import InputError
from jbeamshell.common.progress import counting
from jbeamshell.common.summary import Summary
from jbeamshell.common.threads import on_one_core
from jbeamshell.identify.multistart import Options
from jbeamshell.identify.parameters import Parameter
from jbeamshell.identify.plan import Plan, planned
from jbeamshell.identify.results import Fit
from jbeamshell.identify.rig import RiggedObservation
from jbeamshell.identify.specimens import Specimen

LEVEL = 0.95  # part of the values between the ends that a summary names


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Fits:
    """Results of many fits of the same numbers.

    Attributes
    ----------
    values, errors : (fits,) fitted values and standard errors by key
    misfit : (fits,) root mean square of the residual over the range of the response
    converged : (fits,) False where a search did not converge; its values mean little
    doubts : sentences on what to know before using the values, of each fit
    """

    values: dict[str, NDArray[np.float64]]
    errors: dict[str, NDArray[np.float64]]
    misfit: NDArray[np.float64]
    converged: NDArray[np.bool_]
    doubts: Sequence[Sequence[str]] = ()

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

    def __repr__(self) -> str:
        return self._summary.as_text(28)

    def _repr_html_(self) -> str:
        return self._summary.as_html()


@on_one_core
def fit_each(
    data: Sequence[Any],
    scene: Any = None,
    free: Sequence[str | Parameter] = (),
    *,
    progress: Callable[[int, int], None] | None = None,
    **options: Any,
) -> Fits:
    """Fit the same numbers to each of many measurements on its own, as `fit` does.

    Parameters
    ----------
    data : what to fit, or a list of measurements for each fit
    scene, free : see `fit`; what the first of the data tell is fitted to all
    progress : called with the fits done and to do; None shows a bar where a person watches
    options : further arguments of `fit`, such as ``noise``

    Returns
    -------
    Fits
        ``values`` and ``errors`` (fits,) by key, ``misfit``, ``converged`` and ``doubts`` of each,
        in the order of the data, and ``intervals()``

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
    given = Options(**{"throw": False, **options})

    def one(place: int, free: Sequence[str | Parameter]) -> Plan:
        with _naming(place, len(data)):
            return planned(data[place], scene, free, options=given)

    first = one(0, free)
    plans = [first, *(one(place, first.free) for place in range(1, len(data)))]
    return _found(plans, progress)


def _found(
    plans: Sequence[Plan],
    progress: Callable[[int, int], None] | None = None,
    unseen: bool = False,
) -> Fits:
    """Fits of plans, on all cores."""

    def one(place: int) -> Fit:
        with _naming(place, len(plans)):
            return plans[place].found(progress=lambda _: None, unseen=unseen)

    with counting(progress, "fits", "fit") as told, ThreadPoolExecutor(os.cpu_count()) as pool:
        found = [one(0)]  # threads that miss the same compiled code would all compile it
        told(1, len(plans))
        for fit in pool.map(one, range(1, len(plans))):
            found.append(fit)
            told(len(found), len(plans))
    return Fits(
        {key: np.array([fit.values[key] for fit in found]) for key in found[0].values},
        {key: np.array([fit.errors[key] for fit in found]) for key in found[0].values},
        np.array([fit.misfit for fit in found]),
        np.array([fit.converged for fit in found]),
        [fit.doubts for fit in found],
    )


@contextlib.contextmanager
def _naming(place: int, count: int) -> Iterator[None]:
    """Put the number of a fit before what is wrong with its input."""
    try:
        yield
    except InputError as error:
        raise InputError(f"fit {place + 1} of {count}: {error}") from None


@on_one_core
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
        if the result has several specimens, or a rig

    Examples
    --------
    ::

        jb.identify.bootstrap(jb.fit(loops, scene, ["contact.friction"])).intervals()
    """
    require_count("copies", copies, 2)
    problem, uncertainty = result.problem, result.uncertainty
    fix = "has several specimens: fit them one by one"
    require("result", len(result.scenes), len(result.scenes) == 1, fix)
    experiment, space = problem.experiment, uncertainty.space
    rigged = any(isinstance(each, RiggedObservation) for each in experiment.observations)
    require("result", "a rig", not rigged, "has a rig, whose numbers copies do not know")
    best = problem(uncertainty.point)
    rows = experiment.weight.size
    residual = best.residual[:rows] / experiment.emphasis / experiment.weight
    residual = residual * np.sqrt(
        rows / max(rows - len(space.names), 1)
    )  # of which a fit took part
    random = np.random.default_rng(seed)
    free = [
        dataclasses.replace(own, start=result.values[name])
        for own, name in zip(space.parameters, space.names, strict=True)
    ]
    options = Options(starts=1, throw=False)
    plans = []
    for _ in range(copies):
        drawn = np.concatenate([_blocks(residual[own], random) for own in experiment.slices])
        data = experiment.as_measurements(best.prediction - drawn)
        plans.append(Plan([Specimen(result.scene, data)], free, options=options))
    return _found(plans, unseen=True)


def _blocks(values: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """Blocks of values, drawn from a closed curve and joined to as many, with mean zero."""
    size = max(1, round(np.sqrt(values.size)))
    begins = random.integers(values.size, size=-(-values.size // size))
    places = (begins[:, None] + np.arange(size)).ravel()[: values.size] % values.size
    return values[places] - np.mean(values)
