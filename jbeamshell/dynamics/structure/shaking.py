"""Transients of a structure with joints, whose sliders follow the rate law of friction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import POSITIVE, is_traced, require, require_choice, require_number
from jbeamshell.common.errors import UnconvergedError
from jbeamshell.common.progress import watched
from jbeamshell.dynamics.strip import rate_friction
from jbeamshell.dynamics.strip.motion import doubts_of_balance, warn_of_doubts
from jbeamshell.dynamics.structure.matrices import Structure, dense
from jbeamshell.dynamics.vibration.elements import CubicSpring

SOLVERS: dict[str, Callable[[], Any]] = {
    "kvaerno3": diffrax.Kvaerno3,
    "kvaerno5": diffrax.Kvaerno5,
    "tsit5": diffrax.Tsit5,
    "dopri8": diffrax.Dopri8,
}
LIMIT_FLOOR = 1e-12  # smallest slip force of a slider, over the largest one
NO_MOTION = "nothing happens: give a force, or an initial displacement or velocity"


class StructureMotion(NamedTuple):
    """Motion of a structure at T evenly spaced times; times that were not reached hold NaN.

    Attributes
    ----------
    time : (T,) times
    displacement, velocity : (T, n) displacements and velocities of the degrees of freedom
    kinetic, stored : (T,) kinetic energy; potential energy of structure and sliders
    external_work : (T,) work done by forces since t = 0
    friction_work, damping_work : (T,) work lost in joints and by C since t = 0
    complete : True if the whole span was computed
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
        """Last time that was computed."""
        known = np.isfinite(np.asarray(self.kinetic))
        return float(np.asarray(self.time)[known].max(initial=0.0))

    @property
    def imbalance(self) -> Array:
        """Error of the energy balance, (T,); zero but for errors of the time steps."""
        change = self.kinetic + self.stored - self.kinetic[0] - self.stored[0]
        return change - self.external_work + self.friction_work + self.damping_work

    @property
    def doubts(self) -> tuple[str, ...]:
        """Sentences that say what may be wrong, and the fix; none if the energies add up."""
        return doubts_of_balance(self)


class InterruptedShakingError(UnconvergedError):
    """Transient that ended before its span; ``motion`` is the part that was computed."""

    def __init__(self, message: str, motion: StructureMotion) -> None:
        super().__init__(message)
        self.motion = motion


class _State(NamedTuple):
    """Displacements and velocities (n,), forces (s,) of the sliders, and work (3,)."""

    x: Array
    v: Array
    sliders: Array
    work: Array


class _Model(NamedTuple):
    """Matrices (n, n), directions (n, joints), and stiffness, limit and joint of s sliders.

    ``cubic`` are the coefficients (joints,) of cubic springs.  The stiffness matrix has the springs
    that remain when all sliders slip.
    """

    inverse_mass: Array
    mass: Array
    damping: Array
    stiffness: Array
    directions: Array
    springs: Array
    limits: Array
    joint: Array
    cubic: Array


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
    """Transient of a structure with joints.

    Parameters
    ----------
    structure : structure with its joints
    span : end time
    force : function from the time to the forces (n,); None is no force
    displacement : (n,) displacements at t = 0, reached quasi-statically; None is 0
    velocity : (n,) velocities at t = 0; None is 0
    samples : number of times in the result, evenly spaced from 0 to ``span``
    method : "kvaerno3" or "kvaerno5", implicit, for stiff structures; "tsit5" or "dopri8", explicit
    tolerance : error of a step, relative to the state and to the size of the response
    smoothing : exponent m of the rate law, see `jbeamshell.dynamics.strip.rate_friction`
    most_steps : largest number of time steps
    progress : show a progress bar; None shows it where a person watches
    throw : raise if the motion ends before ``span``

    Returns
    -------
    StructureMotion
        times that were not reached hold NaN

    Raises
    ------
    InputError
        for a span that is not positive, displacements or velocities of another size than n, or
        neither a force nor an initial motion
    InterruptedShakingError
        if the solver stops before ``span``; it carries the part that was computed

    Warns
    -----
    DoubtfulWarning
        if the energies do not add up, see ``motion.doubts``

    Examples
    --------
    >>> motion = shake(structure, 50.0, velocity=[1.0, 0.0])
    >>> ring_down(motion.time, motion.displacement[:, 0]).damping
    """
    require_number("span", span, POSITIVE + " (time)")
    require_choice("method", method, tuple(SOLVERS))
    size, zero = structure.size, np.zeros(structure.size)
    start = [zero if v is None else np.asarray(v, float) for v in (displacement, velocity)]
    for name, values in zip(("displacement", "velocity"), start, strict=True):
        require(name, values.shape, values.shape == (size,), f"give {size} numbers")
    moves = force is not None or any(bool(np.any(values)) for values in start)
    require("force", force, moves, NO_MOTION)
    model, sliders = _model(structure, start[0])
    show = watched() if progress is None else progress
    times = jnp.linspace(0.0, span, samples)
    settings = (method, most_steps, bool(show))
    x, v = map(jnp.asarray, start)
    motion = _run(model, (x, v, sliders), force, times, tolerance, smoothing, settings)
    if throw and not bool(motion.complete):
        raise InterruptedShakingError(
            f"the motion ends at t = {motion.reached:.6g} of {span:.6g}: take a larger tolerance "
            "or more steps (most_steps)",
            motion,
        )
    if not is_traced(motion):
        warn_of_doubts(motion.doubts)
    return motion


def _model(structure: Structure, displacement: np.ndarray) -> tuple[_Model, Array]:
    """Matrices and sliders as arrays, and the forces of the sliders at t = 0."""
    mass, damping, stiffness = map(dense, (structure.mass, structure.damping, structure.stiffness))
    directions, joint = structure.directions, []
    springs: list[float] = []
    limits: list[float] = []
    for place, attached in enumerate(structure.attachments):
        *own, remaining = np.asarray(attached.joint.springs).tolist()
        springs += own
        limits += np.asarray(attached.joint.limits).tolist()
        joint += [place] * len(own)
        stiffness = stiffness + remaining * np.outer(directions[:, place], directions[:, place])
    spring, limit, index = np.array(springs), np.array(limits), np.array(joint, int)
    sliders = np.clip(spring * (directions.T @ displacement)[index], -limit, limit)
    elements = [attached.joint for attached in structure.attachments]
    cubic = np.array([float(e.cubic) if isinstance(e, CubicSpring) else 0.0 for e in elements])
    sizes = (spring, limit, index, cubic)
    arrays = (np.linalg.inv(mass), mass, damping, stiffness, directions, *sizes)
    return _Model(*map(jnp.asarray, arrays)), jnp.asarray(sliders)


@eqx.filter_jit
def _run(
    model: _Model,
    start: tuple[Array, Array, Array],
    force: Callable[[Array], Array] | None,
    times: Array,
    tolerance: Any,
    smoothing: ArrayLike,
    settings: tuple[str, int, bool],
) -> StructureMotion:
    method, most_steps, progress = settings
    floor = LIMIT_FLOOR * jnp.max(model.limits, initial=1e-30)
    count = model.directions.shape[1]
    springs = jnp.where(model.springs > 0.0, model.springs, 1.0)  # a spring of 0 stores no energy

    def rates(time: Any, y: _State) -> _State:
        speed = (model.directions.T @ y.v)[model.joint]
        stiffening = model.cubic * (model.directions.T @ y.x) ** 3
        slider_rates = rate_friction.traction_rate(
            y.sliders, speed, model.limits, model.springs, jnp.asarray(smoothing), floor
        )
        external = jnp.zeros_like(y.x) if force is None else force(time)
        sliding = jax.ops.segment_sum(y.sliders, model.joint, count)
        joints = model.directions @ (sliding + stiffening)
        damping = model.damping @ y.v
        acceleration = model.inverse_mass @ (external - model.stiffness @ y.x - damping - joints)
        friction_power = jnp.sum(y.sliders * (speed - slider_rates / springs))
        power = jnp.stack([external @ y.v, friction_power, damping @ y.v])
        return _State(y.v, acceleration, slider_rates, power)

    initial = _State(*start, jnp.zeros(3))
    scales = _scales(model, initial, force, times)

    def scaled_rates(time: Any, y: _State, _: Any) -> _State:
        found = rates(time, jax.tree.map(jnp.multiply, y, scales))
        return jax.tree.map(jnp.divide, found, scales)

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(scaled_rates),
        SOLVERS[method](),
        times[0],
        times[-1],
        None,
        jax.tree.map(jnp.divide, initial, scales),
        saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
        max_steps=most_steps,
        progress_meter=diffrax.TqdmProgressMeter() if progress else diffrax.NoProgressMeter(),
        throw=False,
    )
    y = jax.tree.map(jnp.multiply, solution.ys, scales)
    y = jax.tree.map(lambda a: jnp.where(jnp.isfinite(a), a, jnp.nan), y)
    kinetic = 0.5 * jnp.einsum("ti,ij,tj->t", y.v, model.mass, y.v)
    sliders = 0.5 * jnp.sum(y.sliders**2 / springs, axis=1)
    stretched = 0.25 * jnp.sum(model.cubic * (y.x @ model.directions) ** 4, axis=1)
    stored = 0.5 * jnp.einsum("ti,ij,tj->t", y.x, model.stiffness, y.x) + sliders + stretched
    complete = (solution.result == diffrax.RESULTS.successful) & jnp.all(jnp.isfinite(kinetic))
    external, friction, damping = y.work.T
    return StructureMotion(times, y.x, y.v, kinetic, stored, external, friction, damping, complete)


def _scales(
    model: _Model, initial: _State, force: Callable[[Array], Array] | None, times: Array
) -> _State:
    """Scales of the state, by which one tolerance fits all its parts."""
    springs = jax.ops.segment_sum(model.springs, model.joint, model.directions.shape[1])
    stuck = model.stiffness + (model.directions * springs) @ model.directions.T
    stiffness = jnp.max(jnp.diag(stuck))
    largest_force = jnp.zeros(()) if force is None else jnp.max(jnp.abs(jax.vmap(force)(times)))
    time = jnp.sqrt(jnp.max(jnp.diag(model.mass)) / stiffness)
    x = jnp.maximum(jnp.max(jnp.abs(initial.x)), jnp.max(jnp.abs(initial.v)) * time)
    x = jnp.maximum(x, largest_force / stiffness)
    sliders = jnp.maximum(jnp.max(model.limits, initial=0.0), 1e-30)
    return jax.lax.stop_gradient(_State(x, x / time, sliders, stiffness * x**2))
