"""What is measured, and how the model answers it.

A measurement is what a test left behind: a `Loop`, or a `SqueezeCurve`.  `observe` makes of it an
`Observation`: the run of the model that answers it, and the weights that make residuals
dimensionless.  Observations hold arrays only, so those of one kind run as one batch, compiled once.
"""

from __future__ import annotations

import abc
import functools
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import ArrayLike, NDArray

from jbeamshell.errors import InputError
from jbeamshell.loops import FEWEST_POINTS, Loop
from jbeamshell.newton import Newton
from jbeamshell.quasistatic import check, solve
from jbeamshell.scene import Scene

APPROACH = 8  # load steps from zero to the first point of a loop
ROUNDING = 1e-6  # of L: so far tables may round a position off the strip
HOPELESS = 10.0  # residual, in ranges, of a trial without equilibrium: never accepted


class SqueezeCurve(eqx.Module):
    """Mean of sigma_y over the height along a strip under its pressures, before any end load.

    Attributes
    ----------
    x : (points,) increasing positions X
    stress : (points,) mean of sigma_y over the height, compression negative
    label : for pictures and messages
    """

    x: NDArray[np.float64]
    stress: NDArray[np.float64]
    label: str = eqx.field(static=True)

    def __init__(self, x: ArrayLike, stress: ArrayLike, label: str = "squeeze") -> None:
        self.x, self.stress = np.asarray(x, dtype=float), np.asarray(stress, dtype=float)
        self.label = label

    def __check_init__(self) -> None:
        for name, column in (("x", self.x), ("stress", self.stress)):
            if column.ndim != 1 or column.size < FEWEST_POINTS:
                fix = f"give {FEWEST_POINTS} points or more"
                raise InputError(f"{self.label}: {name} has shape {column.shape}: {fix}")
            bad = np.flatnonzero(~np.isfinite(column))
            if bad.size:
                raise InputError(
                    f"{self.label}: {name} is {column[bad[0]]} at point {bad[0] + 1}: remove or "
                    "repair it"
                )
        if self.x.size != self.stress.size:
            raise InputError(
                f"{self.label}: x and stress have {self.x.size} and {self.stress.size} points: "
                "give pairs"
            )
        back = np.flatnonzero(np.diff(self.x) <= 0.0)
        if back.size:
            before, after = self.x[back[0] : back[0] + 2]
            raise InputError(
                f"{self.label}: x goes from {before:g} to {after:g} at point {back[0] + 2}: it "
                "must increase; sort the points and keep one of each position"
            )
        if np.ptp(self.stress) == 0.0:
            raise InputError(
                f"{self.label}: stress is constant ({self.stress[0]:g}): measure over an edge of "
                "the pressure, where it changes"
            )
        strongest = self.stress[np.argmax(np.abs(self.stress))]
        if strongest > 0.0:
            raise InputError(
                f"{self.label}: stress is mostly tension (up to {strongest:g}): compression is "
                "negative; change the sign"
            )

    def between(self, low: float, high: float) -> SqueezeCurve:
        """The part of the curve with low < x < high."""
        inside = (self.x > low) & (self.x < high)
        return SqueezeCurve(self.x[inside], self.stress[inside], self.label)


class Observation(eqx.Module):
    """A run of the model that answers a measurement, (n,) each; batches have an axis before it.

    Attributes
    ----------
    measured : what the prediction is compared with
    weight : of the difference, in the mean 1 over the range of what was measured; 0 where nothing
        is compared
    """

    measured: Array
    weight: Array

    @staticmethod
    @abc.abstractmethod
    def column(scene: Scene) -> str:
        """Name of the measurement's column that the model answers."""

    @abc.abstractmethod
    def predict(self, scene: Scene, solver: Newton) -> tuple[Array, Array]:
        """The model's answer.

        Parameters
        ----------
        scene : what is run; may hold traced leaves
        solver : settings of Newton's method

        Returns
        -------
        prediction : (n,) in the places of ``measured``
        sound : whether every load step found equilibrium
        """

    def residual(self, scene: Scene, solver: Newton) -> tuple[Array, Array, Array]:
        """The weighted difference (n,), the prediction (n,), and whether it is sound."""
        prediction, sound = self.predict(scene, solver)
        difference = (prediction - self.measured) * self.weight
        hopeless = jnp.where(self.weight > 0.0, HOPELESS, 0.0)
        return jnp.where(sound, difference, hopeless), prediction, sound


class LoadPath(Observation):
    """One column of a loop as the answer to the other, which ``scene.load.control`` names.

    A closed loop is run twice, so that its second pass is steady; anything else is run once, from
    rest.

    Attributes
    ----------
    path : (n,) the load: an approach from zero, then the loop's points once or twice
    """

    path: Array

    @staticmethod
    def column(scene: Scene) -> str:
        """The one that does not drive."""
        return "displacement" if scene.load.control == "force" else "force"

    @classmethod
    def of(cls, loop: Loop, scene: Scene) -> LoadPath:
        """The path of a loop; raises `InputError` for forces beyond gross slip."""
        drive, response = getattr(loop, scene.load.control), getattr(loop, cls.column(scene))
        approach = np.linspace(0.0, drive[0], APPROACH + 1)[1:]
        passes = 2 if loop.closed else 1
        path = np.concatenate([approach, *[drive] * passes])
        check(scene, path)
        unseen = np.zeros(path.size - drive.size)
        weight = np.full(drive.size, 1.0 / np.ptp(response))
        columns = (np.append(unseen, response), np.append(unseen, weight), path)
        return cls(*map(jnp.asarray, columns))

    def predict(self, scene: Scene, solver: Newton) -> tuple[Array, Array]:
        """The column that answers, (n,)."""
        history = solve(scene, self.path, solver=solver, throw=False)
        answer = getattr(history, self.column(scene))[history.pressed + 1 :]
        return answer, jnp.all(history.status == 0)


class Squeezed(Observation):
    """The squeeze stress at given positions under the scene's whole pressure.

    A point counts with the length it stands for, so that the misfit is that of the curve and does
    not hang on where a mesh or a test has its points.

    Attributes
    ----------
    x : (n,) positions X
    """

    x: Array

    @staticmethod
    def column(scene: Scene) -> str:
        """The stress, whatever drives."""
        return "stress"

    @classmethod
    def of(cls, curve: SqueezeCurve, scene: Scene) -> Squeezed:
        """The run for a curve; raises `InputError` if it has none."""
        if "psi" not in scene.model.fields:
            raise InputError(
                f"{curve.label}: model.fields = {list(scene.model.fields)} know no squeeze stress: "
                "add psi"
            )
        length = float(scene.strip.length)
        slack = ROUNDING * length
        off = curve.x[(curve.x < -slack) | (curve.x > length + slack)]
        if off.size:
            raise InputError(
                f"{curve.label}: x = {off[0]:g} lies off the strip, whose X runs from 0 to "
                f"{length:g}: use the scene's units and origin"
            )
        share = np.gradient(curve.x)
        weight = np.sqrt(share / np.mean(share)) / np.ptp(curve.stress)
        return cls(*map(jnp.asarray, (curve.stress, weight, curve.x)))

    def predict(self, scene: Scene, solver: Newton) -> tuple[Array, Array]:
        """Squeeze stress (n,), linear between the middles of the elements."""
        history = solve(scene.replace({"load.cycles": 0}), solver=solver, throw=False)
        stress = jnp.interp(self.x, history.middles, history.squeeze_stress[-1])
        return stress, jnp.all(history.status == 0)


@functools.singledispatch
def observe(measurement: Any, scene: Scene) -> Observation:
    """The run of a scene that answers a measurement.

    Parameters
    ----------
    measurement : a `Loop` or a `SqueezeCurve`
    scene : what the measurement is of

    Raises
    ------
    InputError
        if the scene cannot answer it
    """
    kind = type(measurement).__name__
    raise InputError(f"data: a {kind} is no measurement: give a Loop, a SqueezeCurve, or a list")


observe.register(Loop, LoadPath.of)
observe.register(SqueezeCurve, Squeezed.of)


class Experiment(eqx.Module):
    """Several observations of one scene, run kind by kind.

    Attributes
    ----------
    batches : one observation per kind, its arrays (members, n); shorter members wait at their end,
        which adds nothing: a path that stands still, or a position looked up again
    places : for every member of every batch its place among the observations
    """

    batches: list[Observation]
    places: tuple[int, ...] = eqx.field(static=True)

    def __init__(self, observations: Sequence[Observation]) -> None:
        kinds: dict[type, list[int]] = {}
        for place, observation in enumerate(observations):
            kinds.setdefault(type(observation), []).append(place)
        self.batches = [_stacked([observations[i] for i in of_kind]) for of_kind in kinds.values()]
        self.places = tuple(place for of_kind in kinds.values() for place in of_kind)

    def residual(self, scene: Scene, solver: Newton) -> tuple[Array, Array, Array]:
        """Weighted differences and predictions, (observations, n) each, and whether all is sound.

        Parameters
        ----------
        scene : what is run; may hold traced leaves
        solver : settings of Newton's method
        """
        answers = [lax.map(lambda o: o.residual(scene, solver), batch) for batch in self.batches]
        residuals, predictions, sound = zip(*answers, strict=True)
        all_sound = jnp.all(jnp.concatenate(sound))
        return self._in_order(residuals), self._in_order(predictions), all_sound

    def _in_order(self, batches: Sequence[Array]) -> Array:
        """Rows of all batches, filled up with zeros, in the order of the observations."""
        longest = max(batch.shape[1] for batch in batches)
        rows = [jnp.pad(batch, ((0, 0), (0, longest - batch.shape[1]))) for batch in batches]
        return jnp.concatenate(rows)[np.argsort(self.places)]


def _stacked(members: Sequence[Observation]) -> Observation:
    longest = max(member.weight.size for member in members)

    def filled(member: Observation) -> Observation:
        more = (0, longest - member.weight.size)
        longer = jax.tree.map(lambda a: np.pad(a, more, mode="edge"), member)
        return eqx.tree_at(lambda o: o.weight, longer, np.pad(member.weight, more))

    return jax.tree.map(lambda *arrays: jnp.stack(arrays), *map(filled, members))
