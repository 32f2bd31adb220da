"""Many fits, each on its own: of the specimens of a series, or of copies of one loop.

All measurements of one kind and length share one compiled run of the model, and searches run on all
cores.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.common.progress import counting
from jbeamshell.common.summary import Summary
from jbeamshell.common.threads import on_one_core
from jbeamshell.identify.parameters import Parameter
from jbeamshell.identify.plan import Options, Plan, planned
from jbeamshell.identify.results import Fit

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

        Of copies whose noise is drawn anew they are a confidence interval.

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
        middle = {key: np.median(own[self.converged]) for key, own in self.values.items()}
        rows = [
            (key, f"median {middle[key]:.6g}, 95 % between {low:.6g} and {high:.6g}")
            for key, (low, high) in self.intervals().items()
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
    given, count = Options(**{"throw": False, **options}), len(data)

    def plan(place: int, free: Sequence[str | Parameter]) -> Plan:
        with _naming(place, count):
            return planned(data[place], scene, free, options=given)

    def fit(plans: Sequence[Plan], place: int) -> Fit:
        with _naming(place, count):
            return plans[place].found(progress=lambda _: None)

    first = plan(0, free)
    plans = [first, *(plan(place, first.free) for place in range(1, count))]
    with counting(progress, "fits", "fit") as told, ThreadPoolExecutor(os.cpu_count()) as pool:
        found = [fit(plans, 0)]  # threads that miss the same compiled code would all compile it
        told(1, count)
        for one in pool.map(partial(fit, plans), range(1, count)):
            found.append(one)
            told(len(found), count)
    return Fits(
        {key: np.array([one.values[key] for one in found]) for key in found[0].values},
        {key: np.array([one.errors[key] for one in found]) for key in found[0].values},
        np.array([one.misfit for one in found]),
        np.array([one.converged for one in found]),
        [one.doubts for one in found],
    )


@contextlib.contextmanager
def _naming(place: int, count: int) -> Iterator[None]:
    """Put the number of a fit before what is wrong with its input."""
    try:
        yield
    except InputError as error:
        raise InputError(f"fit {place + 1} of {count}: {error}") from None
