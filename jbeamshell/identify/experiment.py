"""Experiments: measurements of several specimens, the model's predictions and their derivatives.

Runs of one kind and length on scenes of one structure are compiled once and run in parallel, one on
each core.  Each run knows only the few parameters of its specimen, so a fit of many specimens costs
no more per run than a fit of one.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.common.small import Small
from jbeamshell.contact_line.shared import Layout, Shared
from jbeamshell.identify.models import FINER, Model
from jbeamshell.identify.observations import Observation, observe
from jbeamshell.identify.parameters import RIG
from jbeamshell.identify.rig import rigged, with_rig
from jbeamshell.identify.specimens import Specimen
from jbeamshell.measured.form import Measurement
from jbeamshell.measured.loops import Loop
from jbeamshell.numerics.newton import Newton

GRIDS = float(np.hypot(1.0, 1.0 / FINER))  # errors of both grids over that of the finer one


class Evaluation(NamedTuple):
    """Model's response to all measurements, their compared points one after the other.

    Attributes
    ----------
    residual : (rows,) weighted differences
    jacobian : (rows, k) derivatives with respect to the values of the measurement's own specimen;
        of a problem (rows + priors, n) with respect to the point of the search space
    prediction : (rows,) response on the scale that is compared
    converged : True if every load step found equilibrium
    """

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    prediction: NDArray[np.float64]
    converged: bool

    @property
    def cost(self) -> float:
        """Sum of the squared residuals."""
        return float(self.residual @ self.residual)


class Experiment:
    """Measurements of several specimens, and the runs of the model that reproduce them.

    Attributes
    ----------
    measurements : all measurements, specimen by specimen
    labels : labels of the measurements, no two alike
    owners : specimen of each measurement
    models : model of each specimen
    observations : run of each measurement
    noisy : True if residuals are in units of measured noise; False if relative to the range
    weight : (rows,) factors from differences to residuals
    emphasis : (rows,) factors that the user gave, not contained in the residuals
    slices : rows of each measurement
    relative : (rows,) factors from residuals to parts of the measurement's range
    """

    def __init__(
        self,
        specimens: Sequence[Specimen],
        *,
        points: int,
        noise: float | None = None,
        free: Sequence[str] = (),
    ) -> None:
        """Set up the run of every measurement.

        Parameters
        ----------
        specimens : scenes with their measurements
        points : number of points to which each loop is thinned, approximately
        noise : standard deviation of measurements without noise, over their range
        free : keys of the numbers that may change

        Raises
        ------
        InputError
            if a scene cannot reproduce a measurement, if only some measurements carry noise, or if
            the weights are not positive or not as many as the measurements
        """
        weights = [specimen.checked_weights() for specimen in specimens]
        self.models = [specimen.model for specimen in specimens]
        self.measurements: list[Any] = []
        self.owners: list[int] = []
        for owner, specimen in enumerate(specimens):
            control = specimen.model.control
            for given in specimen.measurements:
                thinned = given.thinned(points, control) if isinstance(given, Loop) else given
                self.measurements.append(thinned)
                self.owners.append(owner)
        if any(getattr(item, "deviations", None) is not None for item in self.measurements):
            self.measurements = [  # beside others that know theirs, a guess is better than none
                item.but(guessed=False) if isinstance(item, Loop) else item
                for item in self.measurements
            ]
        observations = [
            _observed(measurement, specimens[owner], [key for key in free if key in RIG])
            for owner, measurement in zip(self.owners, self.measurements, strict=True)
        ]
        self.measurements = [
            item.without_turns if isinstance(item, Loop) else item for item in self.measurements
        ]
        prefixes = [f"{one.label}: " if len(specimens) > 1 else "" for one in specimens]
        self.labels = _distinct(
            [
                prefixes[owner] + measurement.label
                for owner, measurement in zip(self.owners, self.measurements, strict=True)
            ]
        )
        self.observations = self._with_noise(observations, noise)
        self._compared = [np.flatnonzero(np.asarray(o.weight)) for o in self.observations]
        self._set_rows(np.concatenate(weights), noise)
        served = [model.serving(free) for model in self.models]
        self._runs = [
            (_filled(observation), served[owner])
            for observation, owner in zip(self.observations, self.owners, strict=True)
        ]
        shapes = [_shape(run) for run in self._runs]
        self._firsts = [shapes.index(shape) for shape in dict.fromkeys(shapes)]
        self._compiled: set[Any] = set()
        self._shared: dict[Any, list[Shared | None]] = {}

    def _set_rows(self, weights: NDArray[np.float64], noise: float | None) -> None:
        """Set the rows of each measurement, and their factors."""
        sizes = [compared.size for compared in self._compared]
        ends = np.cumsum(sizes)
        self.slices = [
            slice(int(end) - size, int(end)) for end, size in zip(ends, sizes, strict=True)
        ]
        own = [measurement.weight for measurement in self.measurements]
        self.emphasis = np.repeat(np.multiply(own, weights), sizes)
        pairs = zip(self.observations, self._compared, strict=True)
        self.weight = np.concatenate([np.asarray(o.weight)[compared] for o, compared in pairs])
        spans = np.repeat([o.span for o in self.observations], sizes)
        known = np.repeat([m.deviations is not None for m in self.measurements], sizes)
        self.relative = np.where(known, 1.0 / (self.weight * spans), noise or 1.0)

    def of(self, owner: int) -> list[Any]:
        """Measurements of a specimen, by its number."""
        return [m for m, own in zip(self.measurements, self.owners, strict=True) if own == owner]

    @property
    def model_error(self) -> float:
        """Size of what a grid of plane elasticity may leave in a residual; 0 for other models.

        It counts that of data computed at the scene's own tolerance, which is coarser, as well.
        """
        left = np.zeros(self.weight.size)
        for rows, (observation, model) in zip(self.slices, self._runs, strict=True):
            left[rows] = observation.own_error * GRIDS * model.tolerance
        return float(np.sqrt(np.mean((left / self.relative) ** 2)))

    def __call__(
        self, keys: tuple[str, ...], table: NDArray[np.float64], solver: Newton
    ) -> Evaluation:
        """Evaluation of all measurements.

        Parameters
        ----------
        keys : (k,) dotted keys of the values
        table : (specimens, k) values
        solver : settings of Newton's method
        """
        return self._joined(self._run(_respond, table, keys, solver))

    def traced_cost(
        self, keys: tuple[str, ...], table: Array, solver: Newton
    ) -> tuple[Array, Array]:
        """Sum of the squared residuals and its derivatives (specimens, k), as traced functions.

        Parameters
        ----------
        keys : (k,) dotted keys of the values
        table : (specimens, k) values, which may be traced
        solver : settings of Newton's method
        """
        cost, slopes = jnp.zeros(()), jnp.zeros(table.shape)
        strips, slices = self._strips(keys), self.slices
        for run, owner, rows, strip in zip(self._runs, self.owners, slices, strips, strict=True):
            residual, jacobian, *_ = _respond(table[owner], *run, strip, keys, solver)
            emphasis = self.emphasis[rows][0] ** 2
            cost = cost + emphasis * jnp.sum(residual**2)
            slopes = slopes.at[owner].add(2.0 * emphasis * residual @ jacobian)
        return cost, slopes

    def _strips(self, keys: tuple[str, ...]) -> list[Shared | None]:
        """Strip of each run that its values share; None where each must be condensed."""
        if keys not in self._shared:
            vary = [key for key in keys if key not in RIG]
            self._shared[keys] = [
                model.shared(vary, observation.figures) for observation, model in self._runs
            ]
        return self._shared[keys]

    def _strip(
        self, place: int, keys: tuple[str, ...], values: NDArray[np.float64]
    ) -> Shared | None:
        """Strip of a run if it holds for all values (tables, k) of its specimen."""
        own, strip = self._runs[place][1].own, self._strips(keys)[place]
        held = strip is not None and all(strip.holds(own, keys, each) for each in values)
        return strip if held else None

    def _run(
        self,
        function: Callable[..., tuple[Array, ...]],
        values: NDArray[np.float64],
        keys: tuple[str, ...],
        solver: Newton,
    ) -> list[tuple[NDArray[Any], ...]]:
        """Results of a function of every run and its specimen's values, (specimens, ...)."""

        def one(place: int) -> tuple[NDArray[Any], ...]:
            own = values[self.owners[place]]
            given = *self._runs[place], self._strip(place, keys, np.atleast_2d(own))
            return tuple(map(np.asarray, function(jnp.asarray(own), *given, keys, solver)))

        # One run of each shape first: threads that miss the same compiled code all compile it.
        call, done = (function, values.shape[1:], keys, solver), {}
        if call not in self._compiled:
            done = {place: one(place) for place in self._firsts}
            self._compiled.add(call)
        rest = [place for place in range(len(self._runs)) if place not in done]
        pool = ThreadPoolExecutor(os.cpu_count())
        run_all = pool.map if len(rest) > 1 else map
        try:
            done |= dict(zip(rest, run_all(one, rest), strict=True))
        finally:
            pool.shutdown(cancel_futures=True)
        return [done[place] for place in range(len(self._runs))]

    def _joined(self, responses: Sequence[tuple[NDArray[Any], ...]]) -> Evaluation:
        """One prediction from the responses of the runs."""
        converged = all(bool(response[-1]) for response in responses)
        columns = [
            [array[compared] for array in response[:-1]]
            for response, compared in zip(responses, self._compared, strict=True)
        ]
        residual, jacobian, prediction = map(np.concatenate, zip(*columns, strict=True))
        return Evaluation(residual, jacobian, prediction, converged)

    def as_measurements(self, prediction: NDArray[np.float64]) -> list[Any]:
        """Measurements as the model predicts them, from compared points (rows,)."""
        predicted = []
        for measurement, observation, owner, rows in zip(
            self.measurements, self.observations, self.owners, self.slices, strict=True
        ):
            column = measurement.form.response(self.models[owner].control)
            values = observation.response_from(prediction[rows])
            predicted.append(measurement.but(**{column: values}))
        return predicted

    def _with_noise(
        self, observations: Sequence[Observation], noise: float | None
    ) -> list[Observation]:
        """Observations whose weights are all relative to noise, or all relative to the range."""
        known = [measurement.deviations is not None for measurement in self.measurements]
        self.noisy = noise is not None or all(known)
        if any(known) and not self.noisy:
            without = self.labels[known.index(False)]
            raise InputError(
                f"{without}: carries no noise but {self.labels[known.index(True)]} does: give "
                "noise (--noise on the command line), such as 0.01 of the range, for the others"
            )
        return [
            observation
            if noise is None or has
            else eqx.tree_at(lambda o: o.weight, observation, observation.weight / noise)
            for observation, has in zip(observations, known, strict=True)
        ]


def _observed(measurement: Measurement, specimen: Specimen, rig: Sequence[str]) -> Observation:
    """Run that reproduces a measurement, through the specimen's rig if there is one."""
    plain = observe(measurement, specimen.model)
    if not (specimen.rig or rig):
        return plain
    return rigged(measurement, plain, specimen.model, specimen.rig, rig)


def _response(
    values: Array,
    observation: Observation,
    model: Model,
    numbers: Any,
    solver: Newton,
    keys: tuple[str, ...],
    layout: Layout | None,
) -> tuple[Array, Array, Array, Array]:
    """Residual (n,), its derivatives (n, k), prediction (n,) and convergence of a run."""

    def residual(own: Array, off: Array) -> tuple[Array, tuple[Array, Array, Array]]:
        given = dict(zip(keys, own, strict=True))
        at = model.replace({key: v for key, v in given.items() if key not in RIG})
        of_rig = {key: value for key, value in given.items() if key in RIG}
        through = with_rig(observation, of_rig) if of_rig else observation
        if observation.shares:
            through = through.moved(off)
        if layout is not None:
            at = at.prepared(layout.strip(numbers, at.own))
        rows, prediction, converged = through.residual(at, solver)
        return rows, (rows, prediction, converged)

    by = (0, 1) if observation.shares else (0,)
    slopes, (rows, prediction, converged) = jax.jacfwd(residual, by, has_aux=True)(
        values, jnp.zeros(2)
    )
    jacobian = slopes[0]
    if observation.shares:
        rows, jacobian = _whitened(slopes[1] / observation.excess(rows), rows, jacobian)
    return rows, jacobian, prediction, converged


def _whitened(common: Array, rows: Array, jacobian: Array) -> tuple[Array, Array]:
    """Residual (n,) and its derivatives (n, k) without what some common errors do to them.

    Common errors of unit variance, with the derivatives B (n, 2), leave the covariance I + B B' of
    residuals; these are multiplied by its inverse root, I - B V w V' B' with the eigenvectors V and
    eigenvalues s of B' B and w = (1 - (1 + s)^(-1/2))/s.
    """
    values, vectors = jnp.linalg.eigh(common.T @ common)
    root = jnp.sqrt(1.0 + jnp.maximum(values, 0.0))
    part = common @ (vectors / jnp.sqrt(root * (root + 1.0)))
    part = jnp.where(jnp.all(jnp.isfinite(common)), part, 0.0)  # else no equilibrium was found
    return rows - part @ (part.T @ rows), jacobian - part @ (part.T @ jacobian)


@Small
def _respond_small(given: tuple[Any, ...], *static: Any) -> tuple[Array, Array, Array, Array]:
    return _response(*given, *static)


_respond_whole = eqx.filter_jit(_response)


def _respond(
    values: Array,
    observation: Observation,
    model: Model,
    strip: Shared | None,
    keys: tuple[str, ...],
    solver: Newton,
) -> tuple[Array, Array, Array, Array]:
    """Compiled response; that of a strip on its contact line is a small program."""
    numbers, layout = (None, None) if strip is None else (strip.numbers, strip.layout)
    given = values, observation, model, numbers, solver
    if model.small:
        found: tuple[Array, Array, Array, Array] = _respond_small(given, keys, layout)
        return found
    return _respond_whole(*given, keys, None)


def _shape(run: tuple[Observation, Model]) -> Any:
    """Key that runs have in common if they share one compiled program."""
    arrays, rest = eqx.partition(run, eqx.is_array)
    shapes = tuple((leaf.shape, str(leaf.dtype)) for leaf in jax.tree.leaves(arrays))
    return jax.tree.structure(run), tuple(jax.tree.leaves(rest)), shapes


def _filled(observation: Observation) -> Observation:
    """Observation filled up to its length step with points that are not compared.

    Loops are thinned to about as many points; equal lengths let them share one compiled program.
    """
    points = observation.weight.size
    more = (0, -points % observation.length_step)
    longer = jax.tree.map(
        lambda leaf: jnp.pad(leaf, more, mode="edge") if leaf.shape == (points,) else leaf,
        observation,
    )
    return eqx.tree_at(lambda o: o.weight, longer, jnp.pad(observation.weight, more))


def _distinct(names: Sequence[str]) -> list[str]:
    """Names with a number appended to those that came before."""
    distinct: list[str] = []
    for name in names:
        fresh, number = name, 1
        while fresh in distinct:
            number += 1
            fresh = f"{name} ({number})"
        distinct.append(fresh)
    return distinct
