"""How the model answers what is measured.

A measurement is what a test left behind: a `Loop`, or a curve of `jbeamshell.measured.curves`.
`observe` makes of it an `Observation`: the run of the model that answers it, and the weights that
make residuals dimensionless.  Observations hold arrays only, so those of one kind and length are
compiled once.
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

from jbeamshell.common.errors import InputError
from jbeamshell.measured.curves import (
    AmplitudeCurve,
    Backbone,
    DissipationCurve,
    SqueezeCurve,
    StiffnessCurve,
    noise_of,
)
from jbeamshell.measured.loops import Loop
from jbeamshell.numerics.newton import Newton
from jbeamshell.quasistatic.load_path import check
from jbeamshell.quasistatic.solver import solve
from jbeamshell.scene.scene import Scene

LENGTH_STEP = 32  # where points to fill up cost next to nothing
APPROACH = 8  # load steps from zero to the first point of a loop
RUN_IN = 32  # and about so many through a closed loop, before it is compared
POSITION_ROUNDING = 1e-6  # of L: so far tables may round a position off the strip
HOPELESS = 10.0  # residual, in ranges, of a trial without equilibrium: never accepted
NOTHING = 1e-6  # of what was measured: a model that dissipates less has a logarithm all the same


class Observation(eqx.Module):
    """A run of the model that answers a measurement, (n,) each.

    Attributes
    ----------
    measured : what the prediction is compared with
    weight : of the difference: 1 over the noise where that is known, else in the mean 1 over the
        range of what was measured; 0 where nothing is compared
    """

    measured: Array
    weight: Array
    length_step: ClassVar[int] = 1  # runs are filled up to multiples of it

    @property
    def span(self) -> float:
        """The range of what was measured, in which misfits are counted."""
        return float(np.ptp(np.asarray(self.measured)[np.asarray(self.weight) > 0.0]))

    @staticmethod
    def answer(prediction: NDArray[np.float64]) -> NDArray[np.float64]:
        """The measurement's column from the prediction, which may be on another scale."""
        return prediction

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
        # A weight of 1 over the noise makes the range a large residual itself.
        ranges = jnp.maximum(1.0, self.weight * jnp.ptp(self.measured))
        hopeless = jnp.where(self.weight > 0.0, HOPELESS * ranges, 0.0)
        return jnp.where(sound, difference, hopeless), prediction, sound


class LoopObservation(Observation):
    """One column of a loop as the answer to the other, which ``scene.load.control`` names.

    A closed loop is run through twice, in larger steps at first, so that its second pass is steady;
    anything else is run once, from rest.

    Attributes
    ----------
    path : (n,) the load: an approach from zero, a closed loop's run-in, then the points
    free_zero : whether the zero of what answers is unknown, so that the model's is put where it
        fits best
    """

    path: Array
    free_zero: bool = eqx.field(static=True, default=False)
    length_step: ClassVar[int] = LENGTH_STEP

    @classmethod
    def of(cls, loop: Loop, scene: Scene) -> LoopObservation:
        """The path of a loop; raises `InputError` for forces beyond gross slip."""
        control = scene.load.control
        run_in = getattr(loop.thinned(RUN_IN, control), control) if loop.closed else np.zeros(0)
        return cls._through(loop, scene, run_in)

    @classmethod
    def of_backbone(cls, backbone: Backbone, scene: Scene) -> LoopObservation:
        """The path of a first loading; raises `InputError` for one that turns back as well."""
        drive = getattr(backbone, scene.load.control)
        steps = np.diff(drive, prepend=0.0) * np.sign(drive[-1])
        back = np.flatnonzero(steps[1:] <= 0.0)
        if back.size or steps[0] < 0.0:
            at = back[0] + 2 if back.size else 1
            raise InputError(
                f"{backbone.label}: {scene.load.control} = {drive[at - 1]:g} turns back at point "
                f"{at}: a backbone only goes on from rest; give a Loop instead"
            )
        return cls._through(backbone, scene, np.zeros(0))

    @classmethod
    def _through(
        cls, measurement: Loop | Backbone, scene: Scene, run_in: NDArray[np.float64]
    ) -> LoopObservation:
        drive = getattr(measurement, scene.load.control)
        answering = measurement.form.response(scene.load.control)
        response = getattr(measurement, answering)
        approach = np.linspace(0.0, drive[0], APPROACH + 1)[1:]
        path = np.concatenate([approach, run_in, drive])
        check(scene, path)
        unseen = np.zeros(path.size - drive.size)
        noise = noise_of(measurement)
        driver = getattr(measurement, "driver", None) or scene.load.control
        if noise is not None and driver != scene.load.control:
            raise InputError(
                f"{measurement.label}: its {driver} drives, so its noise is not that of the "
                f"{driver}, which load.control = {scene.load.control!r} makes the model answer: "
                f"set load.control to {driver!r}"
            )
        if noise is not None and np.min(noise) >= np.ptp(response):
            raise InputError(
                f"{measurement.label}: noise = {np.min(noise):.3g} is more than the range of "
                f"{answering}, {np.ptp(response):.3g}: give the noise of that column, in its units"
            )
        weight = np.full(drive.size, 1.0 / np.ptp(response)) if noise is None else 1.0 / noise
        return cls(
            jnp.asarray(np.append(unseen, response)),
            jnp.asarray(np.append(unseen, weight)),
            jnp.asarray(path),
            getattr(measurement, "free_zero", False),
        )

    def predict(self, scene: Scene, solver: Newton) -> tuple[Array, Array]:
        """The column that answers, (n,)."""
        history = solve(scene, self.path, solver=solver, throw=False)
        column = "displacement" if scene.load.control == "force" else "force"
        answer = getattr(history, column)[history.pressed + 1 :]
        if self.free_zero:
            share = self.weight**2 / jnp.sum(self.weight**2)
            answer = answer - jnp.sum(share * (answer - self.measured))
        return answer, jnp.all(history.status == 0)


class SqueezeObservation(Observation):
    """The squeeze stress at given positions under the scene's whole pressure.

    A point counts with the length it stands for, so that the misfit is that of the curve and does
    not hang on where a mesh or a test has its points; with measured noise every point counts by it.

    Attributes
    ----------
    x : (n,) positions X
    """

    x: Array
    length_step: ClassVar[int] = LENGTH_STEP

    @classmethod
    def of(cls, curve: SqueezeCurve, scene: Scene) -> SqueezeObservation:
        """The run for a curve; raises `InputError` if it has none."""
        if "psi" not in scene.model.fields:
            raise InputError(
                f"{curve.label}: model.fields = {list(scene.model.fields)} know no squeeze stress: "
                "add psi"
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

    def predict(self, scene: Scene, solver: Newton) -> tuple[Array, Array]:
        """Squeeze stress (n,), linear between the middles of the elements."""
        history = solve(scene.replace({"load.cycles": 0}), solver=solver, throw=False)
        stress = jnp.interp(self.x, history.middles, history.squeeze_stress[-1])
        return stress, jnp.all(history.status == 0)


FIGURES: dict[type[AmplitudeCurve], str] = {
    DissipationCurve: "dissipation",
    StiffnessCurve: "secant_stiffness",
}  # what a `History` answers to a curve over amplitude


class AmplitudeObservation(Observation):
    """Logarithm of a figure of the steady cycle at several amplitudes.

    Attributes
    ----------
    amplitude : (n,) of what ``scene.load.control`` names
    figure : (n,) place of the figure in `FIGURES`, so that all kinds share one compiled program
    """

    amplitude: Array
    figure: Array

    @property
    def span(self) -> float:
        """One: a difference of logarithms is relative already."""
        return 1.0

    @staticmethod
    def answer(prediction: NDArray[np.float64]) -> NDArray[np.float64]:
        """The figure itself."""
        return np.exp(prediction)

    @classmethod
    def of(cls, curve: AmplitudeCurve, scene: Scene) -> AmplitudeObservation:
        """The runs for a curve; raises `InputError` for forces beyond gross slip."""
        values = getattr(curve, curve.form.y)
        check(scene, np.sort(curve.amplitude))
        weight = np.ones(values.size) if curve.noise is None else values / curve.noise
        figure = np.full(values.size, list(FIGURES).index(type(curve)), dtype=np.int32)
        return cls(*map(jnp.asarray, (np.log(values), weight, curve.amplitude, figure)))

    def predict(self, scene: Scene, solver: Newton) -> tuple[Array, Array]:
        """Logarithms of the figure, (n,)."""
        cycles = max(scene.load.cycles, 1)

        def one(point: tuple[Array, Array, Array]) -> tuple[Array, Array]:
            amplitude, figure, measured = point
            to = {"load.amplitude": amplitude, "load.cycles": cycles}
            history = solve(scene.replace(to), solver=solver, throw=False)
            value = lax.select_n(figure, *(getattr(history, name) for name in FIGURES.values()))
            least = NOTHING * jnp.exp(measured)
            return jnp.log(jnp.maximum(value, least)), jnp.all(history.status == 0)

        logarithms, sound = lax.map(one, (self.amplitude, self.figure, self.measured))
        return logarithms, jnp.all(sound)


@functools.singledispatch
def observe(measurement: Any, scene: Scene) -> Observation:
    """The run of a scene that answers a measurement.

    Parameters
    ----------
    measurement : a `Loop`, or a curve of `jbeamshell.measured.curves`
    scene : what the measurement is of

    Raises
    ------
    InputError
        if the scene cannot answer it
    """
    kind = type(measurement).__name__
    *known, last = (known.__name__ for known in observe.registry if known is not object)
    raise InputError(
        f"data: a {kind} is no measurement: give a {', a '.join(known)}, a {last}, or a list"
    )


observe.register(Loop, LoopObservation.of)
observe.register(SqueezeCurve, SqueezeObservation.of)
observe.register(Backbone, LoopObservation.of_backbone)
for _curve in FIGURES:
    observe.register(_curve, AmplitudeObservation.of)
