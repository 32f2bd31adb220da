"""Several specimens and what was measured on them: the model's residuals and their derivatives.

A specimen is a scene with its measurements.  Runs of one kind on scenes of one structure are one
batch, compiled once and walked one after the other; each knows its own few parameters only, so a
fit of many specimens costs no more per run than that of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from jbeamshell.errors import InputError
from jbeamshell.loops import Loop
from jbeamshell.measurements import Measurement, noise_of, response_of, weight_of
from jbeamshell.newton import Newton
from jbeamshell.observations import Observation, observe
from jbeamshell.scene import Scene


class Specimen(NamedTuple):
    """One strip and what was measured on it.

    Attributes
    ----------
    scene : start values, and everything that stays fixed
    data : a measurement or several
    label : for messages, and to tell values of its own from those of others
    """

    scene: Scene
    data: Measurement | Sequence[Measurement]
    label: str = ""

    @property
    def measurements(self) -> list[Measurement]:
        """What was measured, as a list."""
        # A Loop is a tuple itself.
        one = isinstance(self.data, Loop) or not isinstance(self.data, Sequence)
        return [self.data] if one else list(self.data)  # type: ignore[list-item, arg-type]


class Batch(NamedTuple):
    """Observations of one kind on scenes of one structure, stacked.

    Attributes
    ----------
    observations, scenes : arrays with a leading axis of members; shorter members wait at their end,
        which adds nothing: a path that stands still, or a position looked up again
    places : (members,) of the measurements among all
    """

    observations: Observation
    scenes: Scene
    places: tuple[int, ...]


class Answer(NamedTuple):
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
            for measurements that a scene cannot answer; if only some carry noise
        """
        if noise is not None and not (np.isfinite(noise) and noise > 0.0):
            raise InputError(f"noise = {noise}: give a positive part of the range, such as 0.01")
        self.scenes = [specimen.scene for specimen in specimens]
        self.measurements: list[Any] = []
        self.owners: list[int] = []
        observations: list[Observation] = []
        for owner, specimen in enumerate(specimens):
            driver = specimen.scene.load.control
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
        self.emphasis = np.repeat([weight_of(m) for m in self.measurements], sizes)
        self.weight = np.concatenate(
            [np.asarray(o.weight)[i] for o, i in zip(observations, self._compared, strict=True)]
        )
        spans = np.repeat([o.span for o in observations], sizes)
        own = np.repeat([noise_of(m) is not None for m in self.measurements], sizes)
        self.relative = np.where(own, 1.0 / (self.weight * spans), noise or 1.0)
        self._batches = self._stack()

    def __call__(self, keys: tuple[str, ...], table: NDArray[np.float64], solver: Newton) -> Answer:
        """The model's answer to all measurements.

        Parameters
        ----------
        keys : (k,) of the values
        table : (specimens, k) values
        solver : settings of Newton's method
        """
        columns: list[Any] = [None] * len(self.measurements)
        all_sound = True
        for batch in self._batches:
            values = jnp.asarray(table[[self.owners[place] for place in batch.places]])
            answers = _answers(values, batch.observations, batch.scenes, keys, solver)
            *arrays, sound = map(np.asarray, answers)
            all_sound &= bool(np.all(sound))
            for member, place in enumerate(batch.places):
                compared = self._compared[place]
                columns[place] = [array[member][compared] for array in arrays]
        residual, jacobian, prediction = map(np.concatenate, zip(*columns, strict=True))
        return Answer(residual, jacobian, prediction, all_sound)

    def answered(self, prediction: NDArray[np.float64]) -> list[Any]:
        """Measurements (the model's) from compared points (rows,)."""
        answers = []
        for measurement, observation, owner, rows in zip(
            self.measurements, self.observations, self.owners, self.slices, strict=True
        ):
            column = response_of(measurement, self.scenes[owner])
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

    def _stack(self) -> list[Batch]:
        alike: dict[Any, list[int]] = {}
        for place, (observation, owner) in enumerate(
            zip(self.observations, self.owners, strict=True)
        ):
            key = type(observation), _structure(self.scenes[owner])
            alike.setdefault(key, []).append(place)
        return [
            Batch(
                _stacked([self.observations[place] for place in places]),
                _stacked_scenes([self.scenes[self.owners[place]] for place in places]),
                tuple(places),
            )
            for places in alike.values()
        ]


@eqx.filter_jit
def _answers(
    values: Array, observations: Observation, scenes: Scene, keys: tuple[str, ...], solver: Newton
) -> tuple[Array, Array, Array, Array]:
    """Residuals, their derivatives, predictions and soundness of a batch, (members, ...) each."""
    arrays, rest = eqx.partition(scenes, eqx.is_array)

    def one(member: tuple[Array, Observation, Any]) -> tuple[Array, Array, Array, Array]:
        own, observation, leaves = member
        scene = eqx.combine(leaves, rest)

        def residual(own: Array) -> tuple[Array, tuple[Array, Array, Array]]:
            at = scene.replace(dict(zip(keys, own, strict=True)))
            rows, prediction, sound = observation.residual(at, solver)
            return rows, (rows, prediction, sound)

        jacobian, (rows, prediction, sound) = jax.jacfwd(residual, has_aux=True)(own)
        return rows, jacobian, prediction, sound

    return lax.map(one, (values, observations, arrays))


def _structure(scene: Scene) -> Any:
    """What must be equal for scenes to be stacked."""
    arrays, rest = eqx.partition(scene, eqx.is_array)
    shapes = tuple((leaf.shape, str(leaf.dtype)) for leaf in jax.tree.leaves(arrays))
    return jax.tree.structure(scene), tuple(jax.tree.leaves(rest)), shapes


def _stacked_scenes(scenes: Sequence[Scene]) -> Scene:
    arrays = [eqx.filter(scene, eqx.is_array) for scene in scenes]
    rest = eqx.filter(scenes[0], eqx.is_array, inverse=True)
    return eqx.combine(jax.tree.map(lambda *leaves: jnp.stack(leaves), *arrays), rest)


def _stacked(members: Sequence[Observation]) -> Observation:
    longest = max(member.weight.size for member in members)

    def filled(member: Observation) -> Observation:
        more = (0, longest - member.weight.size)
        longer = jax.tree.map(lambda a: np.pad(a, more, mode="edge"), member)
        return eqx.tree_at(lambda o: o.weight, longer, np.pad(member.weight, more))

    return jax.tree.map(lambda *arrays: jnp.stack(arrays), *map(filled, members))


def _with_column(measurement: Any, column: str, values: NDArray[np.float64]) -> Any:
    return eqx.tree_at(lambda m: getattr(m, column), measurement, values)


def _distinct(names: Sequence[str]) -> list[str]:
    """Names with a number behind those that came before."""
    seen: dict[str, int] = {}
    distinct = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        distinct.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return distinct
