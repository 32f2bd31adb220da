"""Rig between a strip and its sensors: springs, damping, zeros and drift, which a fit may find.

A spring in series stretches under the force of the strip; a spring and a dashpot in parallel carry
force beside it.  At a point of a loop, where the strip has the force f and the displacement x,

    u = x + c f + u_0,        F = f + k (x + c f) + d s + F_0

are measured, with the phase s of the cycle: s^2 = 1 - ((u - middle)/amplitude)^2, positive as u
rises.  Hysteretic damping has this ellipse, and so has viscous damping under a sine, d = c_v omega
times the amplitude.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.identify.models import Model
from jbeamshell.identify.observations import LoopObservation, Observation, observe
from jbeamshell.identify.parameters import PREFIX, RIG, Parameter, check_rig
from jbeamshell.identify.specimens import Case
from jbeamshell.measured.curves import Backbone
from jbeamshell.measured.form import Measurement
from jbeamshell.measured.loops import Loop
from jbeamshell.measured.reversals import find_turns
from jbeamshell.numerics.newton import Newton

GRADE = 3.0  # points of a branch are dense after its turn, where a stiff strip hardly moves
PASSES = 5  # runs in which the strip's own turns are found
REACHED = 2e-3  # part of the drive's range within which a turn is reached
STARTS = {"compliance": 0.2, "stiffness": 0.05, "loss": 0.05}  # over the ranges of the loops


class Rig(eqx.Module):
    """Rig between a strip and its sensors.

    Attributes
    ----------
    compliance : displacement of a spring in series over its force
    stiffness : force of a spring in parallel over its displacement
    loss : force of the damping at the middle of the cycle
    force_zero, displacement_zero : readings of the sensors without load
    drift : change of the responding sensor's reading from the first compared point to the last
    """

    compliance: Array
    stiffness: Array
    loss: Array
    force_zero: Array
    displacement_zero: Array
    drift: Array

    def seen(self, force: Array, displacement: Array, phase: Array) -> tuple[Array, Array]:
        """Measured force and displacement of a point of the strip's loop, without drift."""
        stretched = displacement + self.compliance * force
        parallel = self.stiffness * stretched + self.loss * phase
        return force + parallel + self.force_zero, stretched + self.displacement_zero


def rig_of(values: Mapping[str, Any]) -> Rig:
    """Rig with values by dotted key; what is not named is 0.

    Raises `InputError` for unknown keys and for values that are no number in their domain.
    """
    check_rig(values)
    fields = dict.fromkeys((name.removeprefix(PREFIX) for name in RIG), 0.0)
    fields |= {key.removeprefix(PREFIX): float(value) for key, value in values.items()}
    return Rig(**{name: jnp.asarray(value) for name, value in fields.items()})


def with_starts(free: Sequence[Parameter], cases: Sequence[Case]) -> tuple[Parameter, ...]:
    """Parameters of which those of the rig have starts, and zeros and drift bounds, from loops."""
    own = [parameter for parameter in free if parameter.key in RIG]
    if not own:
        return tuple(free)
    held = {key: value for case in cases for key, value in case.rig.items()}
    loops = [
        (item, case.model.control)
        for case in cases
        for item in case.measurements
        if isinstance(item, Loop | Backbone)
    ]
    if not loops:
        raise InputError(f"free {own[0].key!r}: only loops and backbones show it; leave it out")
    force, displacement, answer = (
        max(
            float(np.ptp(getattr(loop, name or loop.form.response(control))))
            for loop, control in loops
        )
        for name in ("force", "displacement", "")
    )
    sizes = {
        "compliance": displacement / force,
        "stiffness": force / displacement,
        "loss": force,
        "force_zero": force,
        "displacement_zero": displacement,
        "drift": answer,
    }

    def started(parameter: Parameter) -> Parameter:
        name, key = parameter.key.removeprefix(PREFIX), RIG[parameter.key]
        size, start = sizes[name], parameter.start
        if start is None:
            start = float(held.get(parameter.key, 0.0)) or STARTS.get(name, 0.0) * size
        low, high = parameter.low, parameter.high
        if key.low < 0.0:
            low, high = (-size if low is None else low), (size if high is None else high)
        return dataclasses.replace(parameter, start=start, low=low, high=high)

    return tuple(started(p) if p.key in RIG else p for p in free)


class RiggedObservation(LoopObservation):
    """Run of the model that reproduces a loop or backbone through a rig.

    Under displacement control the strip behind a spring in series turns where spring and strip
    together reach the measured turn; Newton's method finds these turns, and between them the curve
    is read at the measured displacements.

    Attributes
    ----------
    rig : rig, whose numbers a fit may change
    phase : (n,) phase s of the cycle
    time : (n,) part of the compared points that has passed, from 0 to 1
    begin, end : (n,) turns of each point's branch: 0 for the unloaded strip, else 1 + index
    part : (n,) way of each point along its branch
    near : (n,) measured response at each turn, about
    series : True if there is a spring in series
    """

    rig: Rig
    phase: Array
    time: Array
    begin: Array
    end: Array
    part: Array
    near: Array
    series: bool = eqx.field(static=True)

    def along(self, model: Model, solver: Newton) -> tuple[Array, Array]:
        if model.control == "force":
            path = self.path - self.rig.force_zero
            response, converged = model.along(path, solver)
            _, response = self.rig.seen(path, response, self.phase)
        else:
            path = self.path - self.rig.displacement_zero
            run = partial(self._behind_spring, model) if self.series else model.along
            force, converged = run(path, solver)
            strip = path - self.rig.compliance * force
            response, _ = self.rig.seen(force, strip, self.phase)
        return response + self.rig.drift * self.time, converged

    def _behind_spring(self, model: Model, path: Array, solver: Newton) -> tuple[Array, Array]:
        """Force of the strip (n,) where spring and strip together follow a path."""
        begin, end, compliance = self.begin, self.end, self.rig.compliance
        zero = jnp.zeros(1)

        def run(turns: Array, _: None) -> tuple[Array, tuple[Array, Array, Array]]:
            known = jnp.append(zero, turns)
            strip = known[begin] + (known[end] - known[begin]) * self.part
            force, converged = model.along(strip, solver)
            together = strip + compliance * force
            moved, rise = (jnp.diff(jnp.append(zero, a)) for a in (strip, together))
            slope = jnp.where(moved == 0.0, 1.0, rise) / jnp.where(moved == 0.0, 1.0, moved)
            return turns + (path - together) / slope, (force, together, converged)

        first = path - compliance * self.near
        found = lax.scan(run, first, None, length=PASSES)[1]
        force, together, converged = (column[-1] for column in found)
        known = jnp.append(zero, together)
        way = jnp.append(zero, jnp.cumsum(jnp.abs(jnp.diff(known))))
        asked = way[begin] + jnp.abs(path - known[begin])
        missed = jnp.max(jnp.abs(jnp.append(zero, path)[end] - known[end]))
        reached = missed <= REACHED * jnp.ptp(path)
        return jnp.interp(asked, way, jnp.append(zero, force)), converged & reached


def observed(
    measurement: Measurement, model: Model, values: Mapping[str, Any], free: Sequence[str] = ()
) -> Observation:
    """Run of the model that reproduces a measurement, through a rig if there is one.

    Parameters
    ----------
    measurement : loop or backbone, or without a rig anything that `observe` knows
    model : strip, law or structure
    values : values of the rig that are not 0, by dotted key
    free : keys of the rig that a fit may change

    Raises
    ------
    InputError
        for a rig about another measurement, for unknown keys, or for a spring or damping in
        parallel where the force is prescribed
    """
    observation, given = observe(measurement, model), [*values, *free]
    if not given:
        return observation
    if not isinstance(observation, LoopObservation):
        raise InputError(f"{measurement.label}: {given[0]} changes loops and backbones only")
    rig = rig_of(values)
    parallel = [key for key in ("rig.stiffness", "rig.loss") if key in given]
    if parallel and model.control == "force":
        raise InputError(
            f"{parallel[0]}: carries a part of a prescribed force that is not known beforehand: "
            "set load.control to 'displacement', so that forces are compared"
        )
    path, weight = np.asarray(observation.path), np.asarray(observation.weight)
    compared = np.flatnonzero(weight > 0.0)
    turns = np.unique([*find_turns(path), path.size - 1])
    place = np.searchsorted(turns, np.arange(path.size))
    ends, begins = turns[place] + 1, np.append(0, turns + 1)[place]
    part = ((np.arange(path.size) + 1 - begins) / (ends - begins)) ** GRADE
    measured = np.asarray(observation.measured)[compared]
    near = measured[np.argmin(np.abs(path[:, None] - path[compared]), axis=1)]
    passed = np.clip((np.arange(path.size) - compared[0]) / max(compared.size - 1, 1), 0.0, 1.0)
    return RiggedObservation(
        observation.measured,
        observation.weight,
        observation.path,
        observation.free_zero,
        observation.drive,
        rig,
        jnp.asarray(_phase(path, path[compared], begins, ends)),
        jnp.asarray(passed),
        jnp.asarray(begins),
        jnp.asarray(ends),
        jnp.asarray(part),
        jnp.asarray(near),
        "rig.compliance" in given,
    )


def with_rig(observation: Observation, values: Mapping[str, Array]) -> RiggedObservation:
    """Observation through a rig with other values of that, by dotted key."""
    assert isinstance(observation, RiggedObservation)
    names = [key.removeprefix(PREFIX) for key in values]
    return eqx.tree_at(
        lambda o: [getattr(o.rig, name) for name in names], observation, list(values.values())
    )


def _phase(
    path: NDArray[np.float64],
    compared: NDArray[np.float64],
    begins: NDArray[np.int64],
    ends: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Phase s (n,) of points between their turns, of a cycle as wide as the compared points."""
    middle = 0.5 * (np.max(compared) + np.min(compared))
    reached = np.append(0.0, path)
    rising = np.sign(reached[ends] - reached[begins])
    off = (path - middle) / (0.5 * np.ptp(compared))
    return rising * np.sqrt(np.maximum(1.0 - off**2, 0.0))
