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
from jbeamshell.identify.models import Model, is_rigid
from jbeamshell.identify.observations import Observation, observe
from jbeamshell.identify.rig import rigged, with_rig
from jbeamshell.identify.rig_keys import RIG
from jbeamshell.identify.specimens import Specimen
from jbeamshell.measured.curves import Measurement, noise_of, weight_of
from jbeamshell.measured.loops import Loop
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.scene import Scene


class Prediction(NamedTuple):
    """Model's response to all measurements, their compared points one after the other.

    Attributes
    ----------
    residual : (rows,) weighted differences
    jacobian : (rows, k) derivatives with respect to the values of the measurement's own specimen
    prediction : (rows,) response on the scale that is compared
    converged : True if every load step found equilibrium
    """

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    prediction: NDArray[np.float64]
    converged: bool


class Experiment:
    """Measurements of several specimens, and the runs of the model that reproduce them.

    Attributes
    ----------
    measurements : all measurements, specimen by specimen
    labels : labels of the measurements, no two alike
    owners : specimen of each measurement
    scenes : scene of each specimen
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
        rig: Sequence[str] = (),
    ) -> None:
        """Set up the run of every measurement.

        Parameters
        ----------
        specimens : scenes with their measurements
        points : number of points to which each loop is thinned, approximately
        noise : standard deviation of measurements without noise, over their range
        rig : keys of the rig that may change

        Raises
        ------
        InputError
            if a scene cannot reproduce a measurement, if only some measurements carry noise, or if
            the weights are not positive or not as many as the measurements
        """
        weights = [specimen.checked_weights() for specimen in specimens]
        self.scenes = [specimen.scene for specimen in specimens]
        self.measurements: list[Any] = []
        self.owners: list[int] = []
        for owner, specimen in enumerate(specimens):
            specimen.check()
            control = specimen.scene.load.control
            for given in specimen.measurements:
                thinned = given.thinned(points, control) if isinstance(given, Loop) else given
                self.measurements.append(thinned)
                self.owners.append(owner)
        observations = [
            _observed(measurement, specimens[owner], rig)
            for owner, measurement in zip(self.owners, self.measurements, strict=True)
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
        self._runs = [
            (_filled(observation), self.scenes[owner])
            for observation, owner in zip(self.observations, self.owners, strict=True)
        ]
        shapes = [_shape(run) for run in self._runs]
        self._firsts = [shapes.index(shape) for shape in dict.fromkeys(shapes)]
        self._compiled: set[Any] = set()

    def _set_rows(self, weights: NDArray[np.float64], noise: float | None) -> None:
        """Set the rows of each measurement, and their factors."""
        sizes = [compared.size for compared in self._compared]
        ends = np.cumsum(sizes)
        self.slices = [
            slice(int(end) - size, int(end)) for end, size in zip(ends, sizes, strict=True)
        ]
        own = [weight_of(measurement) for measurement in self.measurements]
        self.emphasis = np.repeat(np.multiply(own, weights), sizes)
        pairs = zip(self.observations, self._compared, strict=True)
        self.weight = np.concatenate([np.asarray(o.weight)[compared] for o, compared in pairs])
        spans = np.repeat([o.span for o in self.observations], sizes)
        known = np.repeat([noise_of(m) is not None for m in self.measurements], sizes)
        self.relative = np.where(known, 1.0 / (self.weight * spans), noise or 1.0)

    def __call__(
        self, keys: tuple[str, ...], table: NDArray[np.float64], solver: Newton
    ) -> Prediction:
        """Prediction of all measurements.

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
        for run, owner, rows in zip(self._runs, self.owners, self.slices, strict=True):
            residual, jacobian, *_ = _respond(table[owner], *run, keys, solver)
            emphasis = self.emphasis[rows][0] ** 2
            cost = cost + emphasis * jnp.sum(residual**2)
            slopes = slopes.at[owner].add(2.0 * emphasis * residual @ jacobian)
        return cost, slopes

    def batch(
        self, keys: tuple[str, ...], tables: NDArray[np.float64], solver: Newton
    ) -> list[Prediction]:
        """Predictions for several tables, (tables, specimens, k); each measurement is one batch."""
        responses = self._run(_respond_batch, np.swapaxes(tables, 0, 1), keys, solver)
        return [
            self._joined([tuple(array[entry] for array in arrays) for arrays in responses])
            for entry in range(len(tables))
        ]

    def _run(
        self,
        function: Callable[..., tuple[Array, ...]],
        values: NDArray[np.float64],
        keys: tuple[str, ...],
        solver: Newton,
    ) -> list[tuple[NDArray[Any], ...]]:
        """Results of a function of every run and its specimen's values, (specimens, ...)."""

        def one(place: int) -> tuple[NDArray[Any], ...]:
            own = jnp.asarray(values[self.owners[place]])
            return tuple(map(np.asarray, function(own, *self._runs[place], keys, solver)))

        # One run of each shape first: threads that miss the same compiled code all compile it.
        call, done = (function, values.shape[1:], keys, solver), {}
        if call not in self._compiled:
            done = {place: one(place) for place in self._firsts}
            self._compiled.add(call)
        rest = [place for place in range(len(self._runs)) if place not in done]
        pool = ThreadPoolExecutor(os.cpu_count())
        try:
            done |= dict(zip(rest, pool.map(one, rest), strict=True))
        finally:
            pool.shutdown(cancel_futures=True)
        return [done[place] for place in range(len(self._runs))]

    def _joined(self, responses: Sequence[tuple[NDArray[Any], ...]]) -> Prediction:
        """One prediction from the responses of the runs."""
        converged = all(bool(response[-1]) for response in responses)
        columns = [
            [array[compared] for array in response[:-1]]
            for response, compared in zip(responses, self._compared, strict=True)
        ]
        residual, jacobian, prediction = map(np.concatenate, zip(*columns, strict=True))
        return Prediction(residual, jacobian, prediction, converged)

    def as_measurements(self, prediction: NDArray[np.float64]) -> list[Any]:
        """Measurements as the model predicts them, from compared points (rows,)."""
        predicted = []
        for measurement, observation, owner, rows in zip(
            self.measurements, self.observations, self.owners, self.slices, strict=True
        ):
            column = measurement.form.response(self.scenes[owner].load.control)
            values = observation.response_from(prediction[rows])
            predicted.append(_with_column(measurement, column, values))
        return predicted

    def _with_noise(
        self, observations: Sequence[Observation], noise: float | None
    ) -> list[Observation]:
        """Observations whose weights are all relative to noise, or all relative to the range."""
        known = [noise_of(measurement) is not None for measurement in self.measurements]
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
    plain = observe(measurement, specimen.scene)
    if not (specimen.rig or rig):
        return plain
    return rigged(measurement, plain, specimen.scene, specimen.rig, rig)


def _response(
    values: Array,
    observation: Observation,
    scene: Model,
    keys: tuple[str, ...],
    solver: Newton,
    rigid: bool,
) -> tuple[Array, Array, Array, Array]:
    """Residual (n,), its derivatives (n, k), prediction (n,) and convergence of a run."""
    if rigid and isinstance(scene, Scene):
        scene = scene.with_rigid_sliders()

    def residual(own: Array) -> tuple[Array, tuple[Array, Array, Array]]:
        given = dict(zip(keys, own, strict=True))
        at = scene.replace({key: value for key, value in given.items() if key not in RIG})
        of_rig = {key: value for key, value in given.items() if key in RIG}
        through = with_rig(observation, of_rig) if of_rig else observation
        rows, prediction, converged = through.residual(at, solver)
        return rows, (rows, prediction, converged)

    jacobian, (rows, prediction, converged) = jax.jacfwd(residual, has_aux=True)(values)
    return rows, jacobian, prediction, converged


@Small
def _respond_small(
    given: tuple[Array, Observation, Model, Newton], keys: tuple[str, ...], rigid: bool
) -> tuple[Array, Array, Array, Array]:
    values, observation, scene, solver = given
    return _response(values, observation, scene, keys, solver, rigid)


_respond_whole = eqx.filter_jit(_response)


def _respond(
    values: Array, observation: Observation, scene: Model, keys: tuple[str, ...], solver: Newton
) -> tuple[Array, Array, Array, Array]:
    """Compiled response; that of a strip on its contact line is a small program."""
    if isinstance(scene, Scene) and scene.model.condensed:
        found: tuple[Array, Array, Array, Array] = _respond_small(
            (values, observation, scene, solver), keys, is_rigid(scene)
        )
        return found
    return _respond_whole(values, observation, scene, keys, solver, False)


def _respond_batch(
    values: Array, observation: Observation, scene: Model, keys: tuple[str, ...], solver: Newton
) -> tuple[Array, ...]:
    """Compiled responses to several values (tables, k)."""
    rigid = is_rigid(scene)
    found: tuple[Array, ...] = _batch(values, observation, scene, keys, solver, rigid)
    return found


_batch = eqx.filter_jit(eqx.filter_vmap(_response, in_axes=(0, None, None, None, None, None)))


def _shape(run: tuple[Observation, Model]) -> Any:
    """Key that runs have in common if they share one compiled program."""
    arrays, rest = eqx.partition(run, eqx.is_array)
    shapes = tuple((leaf.shape, str(leaf.dtype)) for leaf in jax.tree.leaves(arrays))
    return jax.tree.structure(run), tuple(jax.tree.leaves(rest)), shapes


def _filled(observation: Observation) -> Observation:
    """Observation filled up to its length step with points that are not compared.

    Loops are thinned to about as many points; equal lengths let them share one compiled program.
    """
    more = (0, -observation.weight.size % observation.length_step)
    longer = jax.tree.map(
        lambda leaf: jnp.pad(leaf, more, mode="edge") if leaf.ndim else leaf, observation
    )
    return eqx.tree_at(lambda o: o.weight, longer, jnp.pad(observation.weight, more))


def _with_column(measurement: Any, column: str, values: NDArray[np.float64]) -> Any:
    return eqx.tree_at(lambda m: getattr(m, column), measurement, values)


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
