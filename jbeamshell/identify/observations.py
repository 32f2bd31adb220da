"""Observations: the runs of the model that reproduce a measurement.

A measurement is a `Loop`, or a curve of `jbeamshell.measured.curves`.  `observe` turns it into an
`Observation`: a run of the model, and the weights that make residuals dimensionless.  Observations
hold arrays only, so those of one kind and length are compiled once.
"""

from __future__ import annotations

import abc
import functools
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.dynamics.structure.modal import ModalCurve
from jbeamshell.identify.assembly import Assembly
from jbeamshell.identify.models import FIGURES, Model, StripModel, as_model
from jbeamshell.measured.curves import (
    AmplitudeCurve,
    Backbone,
    DampingCurve,
    ForcedCurve,
    FrequencyCurve,
    SqueezeCurve,
)
from jbeamshell.measured.loops import Loop
from jbeamshell.numerics.newton import Newton

LENGTH_STEP = 32  # runs are filled up to multiples of this, where further points are cheap
APPROACH = 8  # load steps from zero to the first point of a loop
RUN_IN = 32  # approximate load steps of a closed loop's first, uncompared pass
STEPS = 48  # load steps of a branch whose drive is noisy
WRONG = 2.0  # residual over noise, in the mean, above which the model must be wrong
BEFORE = APPROACH + RUN_IN  # load steps before the compared ones then
POSITION_ROUNDING = 1e-6  # distance over L by which tables may round a position off the strip
UNSOLVED_RESIDUAL = 10.0  # residual over the range of a trial without equilibrium: never accepted
MODAL: tuple[type[AmplitudeCurve], ...] = (FrequencyCurve, DampingCurve, ForcedCurve)
LEAST_PART = 0.1  # of a frequency or damping, that its error leaves
NEGLIGIBLE = 1e-6  # least figure over the measured one, so that its logarithm exists


class Observation(eqx.Module):
    """Run of the model that reproduces a measurement at n points.

    Attributes
    ----------
    measured : (n,) values with which the prediction is compared
    weight : (n,) factors of the difference: 1 over the noise if that is known, else 1 over the
        measured range in the mean; 0 at points that are not compared
    """

    measured: Array
    weight: Array
    length_step: ClassVar[int] = 1  # the number of points is filled up to a multiple of this
    figures: ClassVar[tuple[str, ...]] = ()  # of a History that are compared
    own_error: ClassVar[float] = 0.0  # of the range, over the model's tolerance

    @property
    def span(self) -> float:
        """Range of the measured values, by which misfits are divided."""
        return float(np.ptp(np.asarray(self.measured)[np.asarray(self.weight) > 0.0]))

    @property
    def shares(self) -> bool:
        """True if its points share two errors, see `moved`."""
        return False

    def moved(self, errors: Array) -> Observation:
        """Copy moved by so many standard errors (2,) of the errors that all points share."""
        return self

    def excess(self, residual: Array) -> Array:
        """Size of residuals (n,) over that of right models under much noise; at least 1."""
        return jnp.ones(())

    @staticmethod
    def response_from(prediction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Column of the measurement from the prediction, which may be on another scale."""
        return prediction

    @abc.abstractmethod
    def predict(self, model: Model, solver: Newton) -> tuple[Array, Array]:
        """Run the model.

        Parameters
        ----------
        model : strip, law or structure; may hold traced leaves
        solver : settings of Newton's method

        Returns
        -------
        prediction : (n,) values to compare with ``measured``
        converged : True if every load step found equilibrium
        """

    def compared(self, model: Model, solver: Newton) -> tuple[Array, Array, Array]:
        """Prediction (n,), its difference (n,) from the data, and if every load step converged."""
        prediction, converged = self.predict(model, solver)
        return prediction, prediction - self.measured, converged

    def residual(self, model: Model, solver: Newton) -> tuple[Array, Array, Array]:
        """Weighted difference (n,), prediction (n,), and whether every load step converged."""
        prediction, off, converged = self.compared(model, solver)
        difference = off * self.weight
        # With weights of 1 over the noise, a difference of one range is a large residual itself.
        ranges = jnp.maximum(1.0, self.weight * jnp.ptp(self.measured))
        unsolved = jnp.where(self.weight > 0.0, UNSOLVED_RESIDUAL * ranges, 0.0)
        return jnp.where(converged, difference, unsolved), prediction, converged


class NoisyDrive(eqx.Module):
    r"""Points whose place along the drive is known but for its noise.

    The model runs on a path without noise, between the turns.  A point counts by its distance from
    the model's branch, in which the noise of both columns is a unit long (orthogonal distances,
    Boggs, Byrd & Schnabel, SIAM J. Sci. Stat. Comput. 8, 1987).  Beyond a turn the branch goes on
    straight, because noise alone brings points there.

    Attributes
    ----------
    sample : (n,) measured drive
    up : (n,) 0 for points of the branch from the high turn, 1 for those of the way back
    ratio : noise of the drive over that of the response
    error : standard error of the response at the first point
    turn_errors : (2,) errors of the levels of both turns, over that of the drive at the first point
    """

    sample: Array
    up: Array
    ratio: Array
    error: Array
    turn_errors: Array

    def read(self, path: Array, response: Array) -> tuple[Array, Array]:
        """Response (n,) at the samples, and its slopes (n,) there."""
        x, y = self._branches(path), self._branches(response)
        here = (
            jnp.sum(jnp.sign(x[:, -1:] - x[:, :1]) * (self.sample[:, None] - x) > 0.0, axis=1) - 1
        )
        here, rows = jnp.clip(here, 0, STEPS - 1), jnp.arange(here.size)
        (x0, x1), (y0, y1) = ((a[rows, here], a[rows, here + 1]) for a in (x, y))
        slope = (y1 - y0) / (x1 - x0)
        return y0 + slope * (self.sample - x0), slope

    def distance(self, path: Array, response: Array, measured: Array, ratio: Array) -> Array:
        """Distance (n,) of the branch above the measured points, in units of the response."""
        x, y = self._branches(path) / ratio, self._branches(response)
        dx, dy = jnp.diff(x), jnp.diff(y)
        to_x, to_y = (self.sample / ratio)[:, None] - x[:, :-1], measured[:, None] - y[:, :-1]
        length = dx**2 + dy**2
        along = (to_x * dx + to_y * dy) / length
        inner = jnp.arange(STEPS)
        part = jnp.clip(
            along, jnp.where(inner == 0, -jnp.inf, 0.0), jnp.where(inner == STEPS - 1, jnp.inf, 1.0)
        )
        square = (to_x - part * dx) ** 2 + (to_y - part * dy) ** 2
        nearest = jnp.argmin(square, axis=1)[:, None]
        off = jnp.sign(dx) * (dy * to_x - dx * to_y)
        corner = part != along
        root = jnp.sqrt(jnp.where(corner, square, 1.0))
        distance = jnp.where(corner, jnp.sign(off) * root, off / jnp.sqrt(length))
        return jnp.take_along_axis(distance, nearest, axis=1)[:, 0]

    def _branches(self, column: Array) -> Array:
        """Branch (n, steps + 1) of the path on which each point lies."""
        both = [column[BEFORE + i : BEFORE + i + STEPS + 1] for i in (0, STEPS)]
        return jnp.stack(both)[self.up]


class LoopObservation(Observation):
    """Response to the column of a loop or backbone that ``load.control`` names.

    A closed loop is run through twice, first in larger steps, so that its second pass is steady.
    Anything else is run once, from the unloaded strip.

    Attributes
    ----------
    path : (n,) load: an approach from zero, a closed loop's first pass, then the compared points
    free_zero : True if the zero of the response is unknown; the model's is then shifted to where
        it fits best
    drive : where the compared points lie along a noisy drive; None if they are those of the path
    """

    path: Array
    free_zero: bool = eqx.field(static=True)
    drive: NoisyDrive | None
    length_step: ClassVar[int] = LENGTH_STEP
    figures: ClassVar[tuple[str, ...]] = ("force", "displacement")
    own_error: ClassVar[float] = 0.1  # measured on loops of finite elements: .02 to .06

    @classmethod
    def of(cls, loop: Loop, model: Model) -> LoopObservation:
        """Run of a loop; raises `InputError` if a force exceeds gross slip."""
        control = model.control
        if loop.drive_noise is not None:
            return cls._of_noisy_drive(loop, model)
        run_in = getattr(loop.thinned(RUN_IN, control), control) if loop.closed else np.zeros(0)
        return cls._through(loop, model, run_in)

    @classmethod
    def _of_noisy_drive(cls, loop: Loop, model: Model) -> LoopObservation:
        """Run of a mean loop whose drive is noisy too."""
        control, middle = model.control, loop.middle
        responding = loop.form.response(control)
        high, low = getattr(loop, control)[[0, middle]]
        # Dense at the turns, where the branches go on beyond the end of the path.
        way = 0.5 + 0.5 * np.cos(np.pi * np.arange(2 * STEPS + 1) / STEPS)
        clean = low + (high - low) * way
        approach = np.linspace(0.0, high, APPROACH + 1)[1:]
        path = np.concatenate([approach, clean[:: 2 * STEPS // RUN_IN][:RUN_IN], clean])
        model.check_path(path)
        own = loop.without_turns
        errors, error = own.errors_of(control), own.errors_of(responding)
        response = getattr(own, responding)
        known = loop.deviations is not None
        weight = 1.0 / error if known else np.min(error) / error / np.ptp(response)

        def whole(column: Any) -> Array:
            return jnp.asarray(np.pad(column, (BEFORE, path.size - BEFORE - column.size)))

        drive = NoisyDrive(
            whole(getattr(own, control)),
            whole((np.arange(response.size) >= middle - 1).astype(int)),
            jnp.asarray(errors[0] / error[0]),
            jnp.asarray(error[0]),
            jnp.asarray(loop.errors_of(control)[[0, middle]] / errors[0]),
        )
        free = loop.free_zero
        return cls(whole(response), whole(weight), jnp.asarray(path), free, drive)

    @classmethod
    def of_backbone(cls, backbone: Backbone, model: Model) -> LoopObservation:
        """Run of a first loading; raises `InputError` if it turns back or exceeds gross slip."""
        drive = getattr(backbone, model.control)
        steps = np.diff(drive, prepend=0.0) * np.sign(drive[-1])
        back = np.flatnonzero(steps[1:] <= 0.0)
        if back.size or steps[0] < 0.0:
            at = back[0] + 2 if back.size else 1
            raise InputError(
                f"{backbone.label}: {model.control} = {drive[at - 1]:g} turns back at point "
                f"{at}, but a backbone only rises from zero; give a Loop instead"
            )
        return cls._through(backbone, model, np.zeros(0))

    @classmethod
    def _through(
        cls, measurement: Loop | Backbone, model: Model, run_in: NDArray[np.float64]
    ) -> LoopObservation:
        drive = getattr(measurement, model.control)
        responding = measurement.form.response(model.control)
        response = getattr(measurement, responding)
        approach = np.linspace(0.0, drive[0], APPROACH + 1)[1:]
        path = np.concatenate([approach, run_in, drive])
        model.check_path(path)
        uncompared = np.zeros(path.size - drive.size)
        noise = measurement.deviations
        driver = getattr(measurement, "driver", None) or model.control
        if noise is not None and driver != model.control:
            fix = f"average its cycles by steady_loops(recording, {model.control!r})"
            if isinstance(model, StripModel):
                fix = f"set load.control to {driver!r}, or {fix}"
            raise InputError(
                f"{measurement.label}: its {driver} drives, so its noise is not that of the "
                f"{driver}, by which {model.kind} answers where the {model.control} drives: {fix}"
            )
        if noise is not None and np.min(noise) >= np.ptp(response):
            raise InputError(
                f"{measurement.label}: noise = {np.min(noise):.3g} is more than the range of "
                f"{responding}, {np.ptp(response):.3g}: give the noise of that column, in its units"
            )
        weight = np.full(drive.size, 1.0 / np.ptp(response)) if noise is None else 1.0 / noise
        return cls(
            jnp.asarray(np.append(uncompared, response)),
            jnp.asarray(np.append(uncompared, weight)),
            jnp.asarray(path),
            getattr(measurement, "free_zero", False),
            None,
        )

    @property
    def shares(self) -> bool:
        """True if the levels of the turns, which all points share, are known but for an error."""
        return self.drive is not None

    def moved(self, errors: Array) -> Observation:
        """Copy whose turns (2,) are moved by so many of their standard errors."""
        assert self.drive is not None
        high, low = self.path[BEFORE], self.path[BEFORE + STEPS]
        shift = errors * self.drive.turn_errors * self.drive.ratio / self.weight[BEFORE]
        part = (self.path - low) / (high - low)
        path = self.path + part * shift[0] + (1.0 - part) * shift[1]
        return eqx.tree_at(lambda o: o.path, self, path)

    def excess(self, residual: Array) -> Array:
        """Size of residuals (n,) over that of right models under much noise; at least 1."""
        assert self.drive is not None
        square = jnp.sum(residual**2) / jnp.sum(self.weight > 0.0)
        usual = WRONG * self.weight[BEFORE] * self.drive.error
        return jnp.maximum(square / usual**2, 1.0)

    def along(self, model: Model, solver: Newton) -> tuple[Array, Array]:
        """Responding column (n,) on the path, and whether every load step converged."""
        return model.along(self.path, solver)

    def predict(self, model: Model, solver: Newton) -> tuple[Array, Array]:
        """Responding column (n,), and whether every load step converged."""
        prediction, _, converged = self.compared(model, solver)
        return prediction, converged

    def compared(self, model: Model, solver: Newton) -> tuple[Array, Array, Array]:
        response, converged = self.along(model, solver)
        drive = self.drive
        if drive is None:
            prediction = self.shifted(response, self.weight)
            return prediction, prediction - self.measured, converged
        read, slope = drive.read(self.path, response)
        prediction = self.shifted(read, self.weight / jnp.sqrt(1.0 + (drive.ratio * slope) ** 2))
        branch = response + prediction[BEFORE] - read[BEFORE]
        off = drive.distance(self.path, branch, self.measured, drive.ratio)
        # What a wrong model leaves beyond noise is an error of the response alone.
        ratio = drive.ratio / self.excess(off * self.weight)
        return prediction, drive.distance(self.path, branch, self.measured, ratio), converged

    def shifted(self, response: Array, weight: Array) -> Array:
        """Response (n,) shifted to where it fits best, if its zero is unknown."""
        if not self.free_zero:
            return response
        share = weight**2 / jnp.sum(weight**2)
        return response - jnp.sum(share * (response - self.measured))


class SqueezeObservation(Observation):
    """Squeeze stress at given positions under the scene's whole pressure.

    Every point counts with the length it represents, so the misfit is that of the curve and does
    not depend on the spacing of the points.  With measured noise every point counts by its noise.

    Attributes
    ----------
    x : (n,) positions X
    """

    x: Array
    length_step: ClassVar[int] = LENGTH_STEP
    figures: ClassVar[tuple[str, ...]] = ("squeeze_stress",)

    @classmethod
    def of(cls, curve: SqueezeCurve, model: Model) -> SqueezeObservation:
        """Run of a curve; raises `InputError` if the scene cannot reproduce it."""
        if not isinstance(model, StripModel):
            model.lacks(f"{curve.label}: squeeze stress", "a Scene")
        scene = model.scene
        if "psi" not in scene.plan.fields:
            raise InputError(
                f"{curve.label}: model.section = {scene.plan.section} has no squeeze stress: "
                "take squeeze"
            )
        length = float(scene.strip.length)
        slack = POSITION_ROUNDING * length
        off = curve.x[(curve.x < -slack) | (curve.x > length + slack)]
        if off.size:
            raise InputError(
                f"{curve.label}: x = {off[0]:g} lies off the strip, whose X runs from 0 to "
                f"{length:g}: use the scene's units and origin"
            )
        share = np.gradient(curve.x)
        weight = np.sqrt(share / np.mean(share)) / np.ptp(curve.stress)
        weight = weight if curve.noise is None else 1.0 / curve.noise
        return cls(*map(jnp.asarray, (curve.stress, weight, curve.x)))

    def predict(self, model: Model, solver: Newton) -> tuple[Array, Array]:
        """Squeeze stress (n,), linear between element midpoints, and whether it converged."""
        return model.squeeze(self.x, solver)


class LogObservation(Observation):
    """Observation whose logarithm is compared."""

    @property
    def span(self) -> float:
        """One, as a difference of logarithms is relative already."""
        return 1.0

    @staticmethod
    def response_from(prediction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Figure from its logarithm."""
        return np.exp(prediction)

    @staticmethod
    def columns(curve: AmplitudeCurve) -> tuple[Array, Array]:
        """Logarithms (n,) of a curve's figure, and their weights."""
        values = getattr(curve, curve.form.y)
        weight = np.ones(values.size) if curve.noise is None else values / curve.noise
        return jnp.asarray(np.log(values)), jnp.asarray(weight)


class AmplitudeObservation(LogObservation):
    """Logarithm of dissipation or secant stiffness of the steady cycle at several amplitudes.

    Attributes
    ----------
    amplitude : (n,) amplitudes of the column that ``load.control`` names
    figure : (n,) index of the figure in `FIGURES`, so that all kinds share one compiled program
    """

    amplitude: Array
    figure: Array
    figures: ClassVar[tuple[str, ...]] = tuple(FIGURES.values())
    own_error: ClassVar[float] = 0.5

    @classmethod
    def of(cls, curve: AmplitudeCurve, model: Model) -> AmplitudeObservation:
        """Runs of a curve; raises `InputError` if a force exceeds gross slip."""
        model.check_amplitudes(curve.amplitude)
        figure = np.full(curve.amplitude.size, list(FIGURES).index(type(curve)), dtype=np.int32)
        return cls(*cls.columns(curve), *map(jnp.asarray, (curve.amplitude, figure)))

    def predict(self, model: Model, solver: Newton) -> tuple[Array, Array]:
        """Logarithms (n,) of the figure, and whether every load step converged."""
        values, converged = model.cycles(self.amplitude, self.figure, solver)
        return _logarithm(values, self.measured)[0], jnp.all(converged)


class ModalObservation(LogObservation):
    r"""Logarithm of a figure of one mode of a structure at several amplitudes.

    The force of a response at omega is |omega_0^2 - omega^2 + 2 i zeta omega_0 omega| q / phi, with
    frequency and damping at its amplitude.

    Attributes
    ----------
    level : (m,) amplitudes of the displacement of a point, rising
    place : (n,) level of each measured point
    figure : index of the kind of curve in `MODAL`, so that all kinds share one compiled program
    omega : (n,) angular frequencies of a force; zeros without one
    """

    level: Array
    place: Array
    figure: Array
    omega: Array

    @classmethod
    def of(cls, curve: AmplitudeCurve, model: Model) -> ModalObservation:
        """Run of a curve; raises `InputError` if the model is no structure that vibrates so."""
        structure = _structure(curve.label, model)
        omega = np.zeros(curve.amplitude.size)
        if isinstance(curve, ForcedCurve):
            driven = structure.point if structure.driven is None else structure.driven
            fix = "is driven nowhere: give the assembly driven=, a degree of freedom"
            require(curve.label, "force", driven is not None, fix)
            omega = 2.0 * np.pi * curve.frequency
        level, place = np.unique(curve.amplitude, return_inverse=True)
        structure.response(level)  # raises for wrong input
        figure = MODAL.index(type(curve))
        return cls(*cls.columns(curve), *map(jnp.asarray, (level, place, figure, omega)))

    def predict(self, model: Model, solver: Newton) -> tuple[Array, Array]:
        """Logarithms (n,) of the figure, and whether all static equilibria were found."""
        values = self._figures(*_structure("modal curve", model).response(self.level))
        return _logarithm(values, self.measured)

    def without_errors(self, model: Model) -> tuple[ModalCurve, NDArray[np.float64]]:
        """Curve, and change (n,) of the logarithms if it were without the errors that it states."""
        curve, mobility = _structure("modal curve", model).response(self.level)
        parts = (1.0 - np.asarray([curve.frequency_error, curve.damping_error])).clip(LEAST_PART)
        exact = curve.but(frequency=parts[0] * curve.frequency, damping=parts[1] * curve.damping)
        own, other = (np.asarray(self._figures(each, mobility)) for each in (curve, exact))
        return curve, np.log(other / own)

    def _figures(self, curve: ModalCurve, mobility: Array) -> Array:
        """Figures (n,) of a curve over the levels."""
        frequency, damping = jnp.asarray(curve.frequency), jnp.asarray(curve.damping)
        natural, ratio = 2.0 * jnp.pi * frequency[self.place], damping[self.place]
        elastic = natural**2 - self.omega**2
        size = jnp.hypot(elastic, 2.0 * ratio * natural * self.omega)
        force = self.level[self.place] * size / mobility
        return lax.select_n(self.figure, frequency[self.place], ratio, force)


def _logarithm(values: Array, measured: Array) -> tuple[Array, Array]:
    """Logarithms of values that are not far below the measured ones, and if all are numbers."""
    least = NEGLIGIBLE * jnp.exp(measured)
    return jnp.log(jnp.maximum(values, least)), jnp.all(jnp.isfinite(values))


def _structure(what: str, model: Model) -> Assembly:
    """Structure; raises `InputError` for a strip or a law."""
    if not isinstance(model, Assembly):
        model.lacks(what, "a jbeamshell.identify.Assembly")
    return model


def observe(measurement: Any, model: Any) -> Observation:
    """Run of a model that reproduces a measurement.

    Parameters
    ----------
    measurement : a `Loop`, or a curve of `jbeamshell.measured.curves`
    model : strip and load that were measured, or law, or structure

    Raises
    ------
    InputError
        if the model cannot reproduce the measurement, or if it is of an unknown kind
    """
    return run_of(measurement, as_model(model))


@functools.singledispatch
def run_of(measurement: Any, model: Model) -> Observation:
    """Run of a model for a kind of measurement, registered by the measurement's class."""
    kind = type(measurement).__name__
    *known, last = (known.__name__ for known in run_of.registry if known is not object)
    raise InputError(
        f"data: a {kind} is no measurement: give a {', a '.join(known)}, a {last}, or a list"
    )


run_of.register(Loop, LoopObservation.of)
run_of.register(SqueezeCurve, SqueezeObservation.of)
run_of.register(Backbone, LoopObservation.of_backbone)
for _curve in FIGURES:
    run_of.register(_curve, AmplitudeObservation.of)
for _curve in MODAL:
    run_of.register(_curve, ModalObservation.of)
