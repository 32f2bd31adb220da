"""Transients of a structure with joints: their sliders move by the rate law of the contact."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import POSITIVE, require, require_choice, require_number
from jbeamshell.common.errors import UnconvergedError
from jbeamshell.dynamics.strip import rate_friction
from jbeamshell.dynamics.structure.matrices import Structure, dense

SOLVERS: dict[str, Callable[[], Any]] = {
    "kvaerno3": diffrax.Kvaerno3,
    "kvaerno5": diffrax.Kvaerno5,
    "tsit5": diffrax.Tsit5,
    "dopri8": diffrax.Dopri8,
}
FLOOR = 1e-12  # of a slider's limit that is zero
HAPPENS = "nothing happens: give a force, or an initial displacement or velocity"


class StructureMotion(NamedTuple):
    """Motion of a structure, at evenly spaced instants; those not reached hold NaN.

    Attributes
    ----------
    time : (T,)
    displacement, velocity : (T, n)
    kinetic, stored : (T,) energies, the sliders' in the second
    external_work : (T,) work done by forces since t = 0
    friction_work, damping_work : (T,) work lost in joints and by C since t = 0
    complete : whether the whole span was followed
    """

    time: Array
    displacement: Array
    velocity: Array
    kinetic: Array
    stored: Array
    external_work: Array
    friction_work: Array
    damping_work: Array
    complete: Array

    @property
    def reached(self) -> float:
        """Time of the last instant that was computed."""
        known = np.isfinite(np.asarray(self.kinetic))
        return float(np.asarray(self.time)[known].max(initial=0.0))

    @property
    def imbalance(self) -> Array:
        """Energy that the ledger does not account for, (T,)."""
        change = self.kinetic + self.stored - self.kinetic[0] - self.stored[0]
        return change - self.external_work + self.friction_work + self.damping_work


class InterruptedShakingError(UnconvergedError):
    """A transient that ended too early; ``motion`` is the part computed."""

    def __init__(self, message: str, motion: StructureMotion) -> None:
        super().__init__(message)
        self.motion = motion


class _Moving(NamedTuple):
    x: Array
    v: Array
    held: Array
    work: Array


class _Parts(NamedTuple):
    inverse: Array
    mass: Array
    damping: Array
    stiffness: Array
    along: Array
    springs: Array
    limits: Array
    owner: Array


def shake(
    structure: Structure,
    span: float,
    *,
    force: Callable[[Array], Array] | None = None,
    displacement: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    samples: int = 1001,
    method: str = "kvaerno3",
    tolerance: float = 1e-6,
    smoothing: float = rate_friction.SHARPEST,
    most_steps: int = 1_000_000,
    progress: bool | None = None,
    throw: bool = True,
) -> StructureMotion:
    """Follow a structure with joints in time.

    Parameters
    ----------
    structure : matrices and joints
    span : time that is followed
    force : from the time to forces (n,); None is none
    displacement, velocity : (n,) at t = 0, reached from rest quasi-statically
    samples : instants, evenly spaced from 0 to ``span``, that are kept
    method : "kvaerno3" or "kvaerno5" for stiff structures, "tsit5" or "dopri8" explicit
    tolerance : of a step's error, relative and to the initial state's or the force's response
    smoothing : m of the sliders' rate law
    most_steps : after which it gives up
    progress : whether to show how far it is; None is on a terminal only
    throw : whether a motion that ends before ``span`` raises

    Raises
    ------
    InputError
        for a span in which nothing happens
    InterruptedShakingError
        if the solver gives up; it carries the part computed
    """
    require_number("span", span, POSITIVE + " (time)")
    require_choice("method", method, tuple(SOLVERS))
    size, still = structure.size, np.zeros(structure.size)
    begin = [still if v is None else np.asarray(v, float) for v in (displacement, velocity)]
    for name, given in zip(("displacement", "velocity"), begin, strict=True):
        require(name, given.shape, given.shape == (size,), f"give {size} numbers")
    happens = force is not None or any(bool(np.any(values)) for values in begin)
    require("force", force, happens, HAPPENS)
    parts, held = _parts(structure, begin[0])
    show = sys.stderr.isatty() if progress is None else progress
    times = jnp.linspace(0.0, span, samples)
    settings = (method, most_steps, bool(show))
    x, v = map(jnp.asarray, begin)
    shaken = _run(parts, (x, v, held), force, times, tolerance, smoothing, settings)
    if throw and not bool(shaken.complete):
        raise InterruptedShakingError(
            f"the motion ends at t = {shaken.reached:.6g} of {span:.6g}: take a larger tolerance",
            shaken,
        )
    return shaken


def _parts(structure: Structure, displacement: np.ndarray) -> tuple[_Parts, Array]:
    """Matrices and sliders as arrays, and what the sliders hold at first."""
    mass, damping, stiffness = map(dense, (structure.mass, structure.damping, structure.stiffness))
    along, springs, limits, owner = structure.directions, [], [], []
    stretch = along.T @ displacement
    for place, attached in enumerate(structure.attachments):
        own = np.asarray(attached.joint.springs)
        springs.append(own[:-1])
        limits.append(np.asarray(attached.joint.limits))
        owner += [place] * (own.size - 1)
        stiffness = stiffness + own[-1] * np.outer(along[:, place], along[:, place])
    spring, limit = (np.concatenate([*parts, np.zeros(0)]) for parts in (springs, limits))
    index = np.array(owner, int)
    held = np.clip(spring * stretch[index], -limit, limit)
    matrices = (np.linalg.inv(mass), mass, damping, stiffness, along, spring, limit, index)
    return _Parts(*map(jnp.asarray, matrices)), jnp.asarray(held)


@eqx.filter_jit
def _run(
    parts: _Parts,
    begin: tuple[Array, Array, Array],
    force: Callable[[Array], Array] | None,
    times: Array,
    tolerance: Any,
    smoothing: ArrayLike,
    settings: tuple[str, int, bool],
) -> StructureMotion:
    method, most_steps, progress = settings
    least = FLOOR * jnp.max(parts.limits, initial=1e-30)

    def rates(time: Any, y: _Moving, _: Any) -> _Moving:
        speed = (parts.along.T @ y.v)[parts.owner]
        slipping = rate_friction.traction_rate(
            y.held, speed, parts.limits, parts.springs, jnp.asarray(smoothing), least
        )
        outside = jnp.zeros_like(y.x) if force is None else force(time)
        pull = parts.along @ jax.ops.segment_sum(y.held, parts.owner, parts.along.shape[1])
        worn = parts.damping @ y.v
        gained = parts.inverse @ (outside - parts.stiffness @ y.x - worn - pull)
        soft = jnp.where(parts.springs > 0.0, parts.springs, 1.0)
        lost = jnp.sum(y.held * (speed - slipping / soft))
        return _Moving(y.v, gained, slipping, jnp.stack([outside @ y.v, lost, worn @ y.v]))

    solver = SOLVERS[method]()
    start = _Moving(*begin, jnp.zeros(3))
    sizes = _sizes(parts, start, force, times)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(
            lambda t, y, a: jax.tree.map(
                jnp.divide, rates(t, jax.tree.map(jnp.multiply, y, sizes), a), sizes
            )
        ),
        solver,
        times[0],
        times[-1],
        None,
        jax.tree.map(jnp.divide, start, sizes),
        saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
        max_steps=most_steps,
        progress_meter=diffrax.TqdmProgressMeter() if progress else diffrax.NoProgressMeter(),
        throw=False,
    )
    y = jax.tree.map(jnp.multiply, solution.ys, sizes)
    y = jax.tree.map(lambda a: jnp.where(jnp.isfinite(a), a, jnp.nan), y)
    kinetic = 0.5 * jnp.einsum("ti,ij,tj->t", y.v, parts.mass, y.v)
    soft = jnp.where(parts.springs > 0.0, parts.springs, 1.0)
    sliders = 0.5 * jnp.sum(y.held**2 / soft, axis=1)
    stored = 0.5 * jnp.einsum("ti,ij,tj->t", y.x, parts.stiffness, y.x) + sliders
    complete = (solution.result == diffrax.RESULTS.successful) & jnp.all(jnp.isfinite(kinetic))
    external, friction, damping = y.work.T
    return StructureMotion(times, y.x, y.v, kinetic, stored, external, friction, damping, complete)


def _sizes(
    parts: _Parts, start: _Moving, force: Callable[[Array], Array] | None, times: Array
) -> _Moving:
    """Sizes of the state's parts, so that one tolerance does for all."""
    stuck = (
        parts.stiffness
        + (parts.along * jax.ops.segment_sum(parts.springs, parts.owner, parts.along.shape[1]))
        @ parts.along.T
    )
    pulled = jnp.zeros(()) if force is None else jnp.max(jnp.abs(jax.vmap(force)(times)))
    slowest = jnp.sqrt(jnp.max(jnp.diag(parts.mass)) / jnp.max(jnp.diag(stuck)))
    x = jnp.maximum(jnp.max(jnp.abs(start.x)), jnp.max(jnp.abs(start.v)) * slowest)
    x = jnp.maximum(x, pulled / jnp.max(jnp.diag(stuck)))
    held = jnp.maximum(jnp.max(parts.limits, initial=0.0), 1e-30)
    energy = jnp.max(jnp.diag(stuck)) * x**2
    return jax.lax.stop_gradient(_Moving(x, x / slowest, held, energy))
