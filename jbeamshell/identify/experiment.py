"""Several specimens and what was measured on them: the model's residuals and their derivatives.

A specimen is a scene with its measurements.  Runs of one kind and length on scenes of one structure
are compiled once and walked side by side, one on each core; each knows its own few parameters only,
so a fit of many specimens costs no more per run than that of one.
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

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.identify.observations import Observation, observe
from jbeamshell.measured.curves import Measurement, noise_of, weight_of
from jbeamshell.measured.loops import Loop
from jbeamshell.measured.recordings import as_column
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.keys import CONTROLS
from jbeamshell.scene.scene import Scene


class Specimen(NamedTuple):
    """One strip and what was measured on it.

    Attributes
    ----------
    scene : start values, and everything that stays fixed
    data : a measurement or several
    label : for messages, and to tell values of its own from those of others
    weights : factors of the measurements' residuals, besides the curves' own; none are all 1
    """

    scene: Scene
    data: Measurement | Sequence[Measurement]
    label: str = ""
    weights: Sequence[float] = ()

    @property
    def measurements(self) -> list[Measurement]:
        """What was measured, as a list."""
        # A Loop is a tuple itself.
        one = isinstance(self.data, Loop) or not isinstance(self.data, Sequence)
        return [self.data] if one else list(self.data)  # type: ignore[list-item, arg-type]


class Prediction(NamedTuple):
    """What the model says to all measurements, their compared points one after the other.

    Attributes
    ----------
    residual : (rows,) weighted differences
    jacobian : (rows, k) with respect to the values of the measurement's own specimen
    prediction : (rows,) on the scale that is compared
    sound : whether every load step found equilibrium
    """

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    prediction: NDArray[np.float64]
    sound: bool


class Experiment:
    """Measurements of several specimens, ready to be answered.

    Attributes
    ----------
    measurements : all, specimen by specimen
    labels : of the measurements, no two alike
    owners : the specimen of each
    scenes : of the specimens
    observations : the run of each measurement
    noisy : whether the residuals are in units of measured noise; else relative to the range
    weight : (rows,) of the differences in the residuals
    emphasis : (rows,) factors that the user gave, not contained in the residuals
    slices : the rows of each measurement
    relative : (rows,) turns residuals into parts of the measurement's range
    """

    def __init__(
        self,
        specimens: Sequence[Specimen],
        *,
        points: int,
        noise: float | None = None,
    ) -> None:
        """Observe all measurements.

        Parameters
        ----------
        specimens : scenes with their measurements
        points : thin each loop to about so many points
        noise : standard deviation, as a part of the range, for measurements without noise

        Raises
        ------
        InputError
            for measurements that a scene cannot answer; if only some carry noise; for weights that
            are not positive or not as many as the measurements
        """
        self.scenes = [specimen.scene for specimen in specimens]
        self.measurements: list[Any] = []
        self.owners: list[int] = []
        observations: list[Observation] = []
        weights = [_checked_weights(specimen) for specimen in specimens]
        for owner, specimen in enumerate(specimens):
            driver = specimen.scene.load.control
            fix = "does not drive a measurement: take " + " or ".join(map(repr, CONTROLS))
            require("load.control", driver, driver in CONTROLS, fix)
            if not specimen.measurements:
                where = f" of specimen {specimen.label!r}" if specimen.label else ""
                raise InputError(f"data{where}: no measurement given; read loops with read_loops")
            for given in specimen.measurements:
                thinned = given.thinned(points, driver) if isinstance(given, Loop) else given
                observations.append(observe(thinned, specimen.scene))
                self.measurements.append(thinned)
                self.owners.append(owner)
        names = [
            f"{specimens[owner].label}: {measurement.label}"
            if len(specimens) > 1
            else measurement.label
            for owner, measurement in zip(self.owners, self.measurements, strict=True)
        ]
        self.labels = _distinct(names)
        self.observations = observations = self._with_noise(observations, noise)
        self._compared = [np.flatnonzero(np.asarray(o.weight)) for o in observations]
        ends = np.cumsum([compared.size for compared in self._compared])
        self.slices = [
            slice(int(end - compared.size), int(end))
            for end, compared in zip(ends, self._compared, strict=True)
        ]
        sizes = [compared.size for compared in self._compared]
        own = [weight_of(measurement) for measurement in self.measurements]
        self.emphasis = np.repeat(np.multiply(own, np.concatenate(weights)), sizes)
        self.weight = np.concatenate(
            [np.asarray(o.weight)[i] for o, i in zip(observations, self._compared, strict=True)]
        )
        spans = np.repeat([o.span for o in observations], sizes)
        known = np.repeat([noise_of(m) is not None for m in self.measurements], sizes)
        self.relative = np.where(known, 1.0 / (self.weight * spans), noise or 1.0)
        self._runs = [
            (_filled(observation), self.scenes[owner])
            for observation, owner in zip(observations, self.owners, strict=True)
        ]
        shapes = [_shape(run) for run in self._runs]
        self._firsts = [shapes.index(shape) for shape in dict.fromkeys(shapes)]
        self._compiled: set[Any] = set()

    def __call__(
        self, keys: tuple[str, ...], table: NDArray[np.float64], solver: Newton
    ) -> Prediction:
        """The model's answer to all measurements.

        Parameters
        ----------
        keys : (k,) of the values
        table : (specimens, k) values
        solver : settings of Newton's method
        """
        return self._joined(self._walked(_answer, table, keys, solver))

    def together(
        self, keys: tuple[str, ...], tables: NDArray[np.float64], solver: Newton
    ) -> list[Prediction]:
        """The same for several tables, (tables, specimens, k), each measurement's as one batch."""
        answers = self._walked(_answers, np.swapaxes(tables, 0, 1), keys, solver)
        return [
            self._joined([tuple(array[entry] for array in arrays) for arrays in answers])
            for entry in range(len(tables))
        ]

    def _walked(
        self,
        function: Callable[..., tuple[Array, ...]],
        values: NDArray[np.float64],
        keys: tuple[str, ...],
        solver: Newton,
    ) -> list[tuple[NDArray[Any], ...]]:
        """What a function makes of every run and its specimen's values, (specimens, ...)."""

        def one(place: int) -> tuple[NDArray[Any], ...]:
            own = jnp.asarray(values[self.owners[place]])
            return tuple(map(np.asarray, function(own, *self._runs[place], keys, solver)))

        # Each shape once at first: threads that miss the same compiled code all compile it.
        asked, done = (function, values.shape[1:], keys, solver), {}
        if asked not in self._compiled:
            done = {place: one(place) for place in self._firsts}
            self._compiled.add(asked)
        rest = [place for place in range(len(self._runs)) if place not in done]
        pool = ThreadPoolExecutor(os.cpu_count())
        try:
            done |= dict(zip(rest, pool.map(one, rest), strict=True))
        finally:
            pool.shutdown(cancel_futures=True)
        return [done[place] for place in range(len(self._runs))]

    def _joined(self, answers: Sequence[tuple[NDArray[Any], ...]]) -> Prediction:
        """One answer from those of the runs."""
        sound = all(bool(answer[-1]) for answer in answers)
        columns = [
            [array[compared] for array in answer[:-1]]
            for answer, compared in zip(answers, self._compared, strict=True)
        ]
        residual, jacobian, prediction = map(np.concatenate, zip(*columns, strict=True))
        return Prediction(residual, jacobian, prediction, sound)

    def answered(self, prediction: NDArray[np.float64]) -> list[Any]:
        """Measurements (the model's) from compared points (rows,)."""
        answers = []
        for measurement, observation, owner, rows in zip(
            self.measurements, self.observations, self.owners, self.slices, strict=True
        ):
            column = measurement.form.response(self.scenes[owner].load.control)
            value = observation.answer(prediction[rows])
            answers.append(_with_column(measurement, column, value))
        return answers

    def _with_noise(
        self, observations: Sequence[Observation], noise: float | None
    ) -> list[Observation]:
        """Observations with weights of one meaning."""
        known = [noise_of(measurement) is not None for measurement in self.measurements]
        self.noisy = noise is not None or all(known)
        if any(known) and not self.noisy:
            without = self.labels[known.index(False)]
            raise InputError(
                f"{without}: carries no noise but {self.labels[known.index(True)]} does: give "
                "noise, such as 0.01 of the range, for those without"
            )
        return [
            observation
            if noise is None or has
            else eqx.tree_at(lambda o: o.weight, observation, observation.weight / noise)
            for observation, has in zip(observations, known, strict=True)
        ]


def _answer_of(
    values: Array, observation: Observation, scene: Scene, keys: tuple[str, ...], solver: Newton
) -> tuple[Array, Array, Array, Array]:
    """Residual (n,), its derivatives (n, k), prediction (n,) and soundness of a run."""

    def residual(own: Array) -> tuple[Array, tuple[Array, Array, Array]]:
        at = scene.replace(dict(zip(keys, own, strict=True)))
        rows, prediction, sound = observation.residual(at, solver)
        return rows, (rows, prediction, sound)

    jacobian, (rows, prediction, sound) = jax.jacfwd(residual, has_aux=True)(values)
    return rows, jacobian, prediction, sound


_answer = eqx.filter_jit(_answer_of)
_answers = eqx.filter_jit(eqx.filter_vmap(_answer_of, in_axes=(0, None, None, None, None)))


def _shape(run: tuple[Observation, Scene]) -> Any:
    """What must be equal for runs to share what is compiled."""
    arrays, rest = eqx.partition(run, eqx.is_array)
    shapes = tuple((leaf.shape, str(leaf.dtype)) for leaf in jax.tree.leaves(arrays))
    return jax.tree.structure(run), tuple(jax.tree.leaves(rest)), shapes


def _filled(observation: Observation) -> Observation:
    """Longer by what adds nothing: a path that stands still, or a position looked up again.

    Loops thin to about as many points; lengths of one step let them share what is compiled.
    """
    more = (0, -observation.weight.size % observation.length_step)
    longer = jax.tree.map(lambda column: jnp.pad(column, more, mode="edge"), observation)
    return eqx.tree_at(lambda o: o.weight, longer, jnp.pad(observation.weight, more))


def _with_column(measurement: Any, column: str, values: NDArray[np.float64]) -> Any:
    return eqx.tree_at(lambda m: getattr(m, column), measurement, values)


def _checked_weights(specimen: Specimen) -> NDArray[np.float64]:
    """One factor for each of the measurements."""
    count, where = len(specimen.measurements), f" of {specimen.label!r}" if specimen.label else ""
    fix = "give one positive number for each of the measurements"
    several = isinstance(specimen.weights, list | tuple | np.ndarray)
    require(f"weights{where}", specimen.weights, several, fix)
    given = as_column(specimen.weights, f"weights{where}", "data")
    weights = given if given.size else np.ones(count)
    if weights.shape != (count,) or not np.all(np.isfinite(weights) & (weights > 0.0)):
        raise InputError(
            f"weights{where} = {given.tolist()}: give one positive number for each of the "
            f"{count} measurements"
        )
    return weights


def _distinct(names: Sequence[str]) -> list[str]:
    """Names with a number behind those that came before."""
    distinct: list[str] = []
    for name in names:
        fresh, number = name, 1
        while fresh in distinct:
            number += 1
            fresh = f"{name} ({number})"
        distinct.append(fresh)
    return distinct
