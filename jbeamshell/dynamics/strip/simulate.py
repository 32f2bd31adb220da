"""Transients of a scene, solved by diffrax."""

from __future__ import annotations

import math
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import POSITIVE, is_traced, require, require_choice, require_number
from jbeamshell.common.errors import warn_of_doubts
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.progress import watched
from jbeamshell.dynamics.strip import rate_friction
from jbeamshell.dynamics.strip.attached_masses import AttachedMasses
from jbeamshell.dynamics.strip.block_solver import BlockElimination
from jbeamshell.dynamics.strip.equations import Equations, MotionState, movable
from jbeamshell.dynamics.strip.excitation import Excitation
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.dynamics.strip.midpoint import Midpoint
from jbeamshell.dynamics.strip.motion import (
    Ending,
    InterruptedMotionError,
    Motion,
)
from jbeamshell.dynamics.strip.step_equations import StepMatrices
from jbeamshell.dynamics.strip.stepsize import EXPLICIT, METHODS, STIFF, longest_step
from jbeamshell.load_steps.system import System
from jbeamshell.mechanics.friction import ElasticSlip
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.solve import run

MOST_STEPS = 10_000_000
RELEASE_STEPS = 8  # load steps to the force that is released, so that the reaction is followed
NO_MOTION = "nothing happens: give an excitation, or a force to let go of in released="


def simulate(
    scene: Scene,
    span: float,
    excitation: Excitation | None = None,
    *,
    inertia: Inertia | None = None,
    attached: AttachedMasses | None = None,
    released: ArrayLike | None = None,
    samples: int = 1001,
    method: str = "midpoint",
    tolerance: float = 1e-6,
    step: float | None = None,
    most_steps: int = MOST_STEPS,
    adjoint: Any = None,
    progress: bool | None = None,
    throw: bool = True,
) -> Motion:
    """Transient of a strip that is pressed down, loaded quasi-statically and then released.

    Parameters
    ----------
    scene : scene of the strip, whose load is not used; on a rigid base the strip is held down
    span : end time
    excitation : force at the end or acceleration of the foundation; None is free vibration
    inertia : density and damping; None is density 1
    attached : payload and chain of masses at the loaded end
    released : force F, or path (k,) of forces, under which the strip rests before t = 0; None is
        no force
    samples : number of times in the result, evenly spaced from 0 to ``span``
    method : "midpoint", implicit, with the friction law of load steps, see
        `jbeamshell.dynamics.strip.midpoint`.  The other methods take friction as a rate law, see
        `jbeamshell.dynamics.strip.rate_friction`: "kvaerno3" and "kvaerno5" are implicit and choose
        their steps from the tolerance; "tsit5" and "bosh3" are explicit
    tolerance : error of a step of kvaerno3 and kvaerno5, relative to the state and to a motion at
        gross slip
    step : largest time step; None is 1/200 of the first period of the stuck strip, or 0.9 of the
        stable step for explicit methods
    most_steps : largest number of time steps
    adjoint : way in which diffrax differentiates, such as `diffrax.ForwardMode()` for forward mode
    progress : show a progress bar; None shows it where a person watches
    throw : raise if the motion ends before ``span``; otherwise see ``motion.status``

    Returns
    -------
    Motion
        times that were not reached hold NaN

    Raises
    ------
    InputError
        for a scene that has no equations of motion, neither an excitation nor a released force, or
        an explicit step above the stable one
    InterruptedMotionError
        if the solver stops before ``span``; it carries the part that was computed

    Warns
    -----
    DoubtfulWarning
        if the energies do not add up, see ``motion.doubts``

    Examples
    --------
    A mass on a strip under a harmonic force:

    >>> load = Harmonic(0.8, frequency=2.0, ramp=3.0)
    >>> motion = simulate(jb.Scene(), 5.0, load, attached=AttachedMasses(20.0))
    >>> motion.plot()
    """
    inertia, attached = inertia or Inertia(), attached or AttachedMasses()
    excitation = excitation or Excitation()
    scene = movable(scene, inertia)
    require_number("span", span, POSITIVE + " (time)")
    whole = isinstance(samples, int | np.integer) and samples >= 2
    require("samples", samples, whole, "must be a whole number of at least 2 times")
    require_number("tolerance", tolerance, POSITIVE)
    require_choice("method", method, METHODS)
    scene = scene if method == "midpoint" else smooth(scene)
    moves = is_traced(excitation) or released is not None or excitation.acts(float(span))
    require("excitation", type(excitation).__name__, moves, NO_MOTION)
    longest = longest_step(scene, inertia, attached, method, step)
    start = _start(scene, released)
    if progress is None:
        progress = watched()
    times = np.linspace(0.0, float(span), samples)
    between = 1 if longest is None else max(1, math.ceil(times[1] / longest * (1.0 - 1e-9)))
    steps = np.linspace(0.0, float(span), (samples - 1) * between + 1)
    motion = _run(
        (scene, inertia, attached, excitation),
        start,
        jnp.asarray(steps),
        None if longest is None else between,
        tolerance,
        method,
        most_steps,
        adjoint or diffrax.RecursiveCheckpointAdjoint(),
        bool(progress) and not is_traced(scene, start),
    )
    if throw and not is_traced(motion):
        _raise_if_interrupted(motion, float(span))
    if not is_traced(motion):
        warn_of_doubts(motion.doubts)
    return motion


def smooth(scene: Scene) -> Scene:
    """Scene with a friction law that has a rate."""
    m = rate_friction.exponent(scene.contact.law)
    return eqx.tree_at(lambda s: s.contact.law, scene, ElasticSlip(m))


def _start(scene: Scene, released: ArrayLike | None) -> tuple[Array, Array, Array]:
    """Fields and tractions at t = 0, and u(L) after the pressure."""
    path = np.zeros(1) if released is None else np.atleast_1d(np.asarray(released, float))
    if path.size == 1:
        path = float(path[0]) * np.arange(1, RELEASE_STEPS + 1) / RELEASE_STEPS
    history = run(scene, path)
    pressed = _end_displacement(scene, history.fields[history.pressed])
    return history.fields[-1], history.traction[-1], pressed


@eqx.filter_jit
def _end_displacement(scene: Scene, q: Array) -> Array:
    return System(scene).end_displacement(q)


@eqx.filter_jit
def _run(
    parts: tuple[Scene, Inertia, AttachedMasses, Excitation],
    start: tuple[Array, Array, Array],
    steps: Array,
    between: int | None,
    tolerance: Any,
    method: str,
    most_steps: int,
    adjoint: Any,
    progress: bool,
) -> Motion:
    """Motion from the fields, tractions and u(L) of `_start`; ``steps`` are all step times."""
    equations = Equations(*parts)
    scales, time_scale = equations.scales, equations.time_scale
    times = steps[:: between or 1]
    fields, traction, pressed = start
    state = equations.initial_state(fields, traction, parts[3].initial_impulse)
    matrices = None
    if method == "midpoint":
        time_scale, scales = jnp.ones_like(time_scale), jax.tree.map(jnp.ones_like, scales)
        matrices = StepMatrices(equations)

    def rates(time: Any, scaled: MotionState, _: Any) -> MotionState:
        state = jax.tree.map(lambda a, u: a * u, scaled, scales)
        return jax.tree.map(
            lambda a, u: a * time_scale / u, equations(time_scale * time, state), scales
        )

    controller: Any = diffrax.StepTo(steps / time_scale)
    if between is None:
        controller = diffrax.PIDController(rtol=tolerance, atol=tolerance)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rates),
        _solver(method, parts[1].mass, tolerance),
        0.0,
        steps[-1] / time_scale,
        None,
        jax.tree.map(lambda a, u: a / u, state, scales),
        matrices,
        saveat=diffrax.SaveAt(ts=times / time_scale),
        stepsize_controller=controller,
        max_steps=min(most_steps, 10 * steps.size) if between else most_steps,
        adjoint=adjoint,
        progress_meter=diffrax.TqdmProgressMeter() if progress else diffrax.NoProgressMeter(),
        throw=False,
    )
    states = jax.tree.map(lambda a, u: a * u, solution.ys, scales)
    return _motion(equations, parts, times, states, pressed, solution)


def _solver(method: str, mass: str, tolerance: Any) -> Any:
    """Solver of diffrax."""
    if method == "midpoint":
        return Midpoint()
    if method in EXPLICIT:
        return EXPLICIT[method]()
    linear: Any = BlockElimination()
    if mass == "consistent":
        linear = lx.AutoLinearSolver(well_posed=None)
    finder = diffrax.VeryChord(
        rtol=10.0 * tolerance, atol=10.0 * tolerance, norm=optx.rms_norm, linear_solver=linear
    )
    return STIFF[method](root_finder=finder)


def _motion(
    equations: Equations,
    parts: tuple[Scene, Inertia, AttachedMasses, Excitation],
    times: Array,
    states: MotionState,
    pressed: Array,
    solution: Any,
) -> Motion:
    """Motion from its states; times that were not reached hold NaN."""
    reached = jnp.isfinite(states.work[:, 0])

    states = nan_unless(reached, states)

    def quantities(pair: tuple[Array, MotionState]) -> tuple[Array, ...]:
        time, state = pair
        reaction = equations.response(time, state).reaction
        q, p = equations.nodal(state.q), equations.nodal(state.p)
        velocity = jnp.sum(equations.end_conjugate(q) * p[-1])
        displacement = equations.system.end_displacement(q) - pressed
        return (q, p, reaction, displacement, velocity, *equations.energies(state))

    found = jax.lax.map(quantities, (times, states))
    q, p, reaction, displacement, velocity, kinetic, stored = found
    n, has_contact = equations.n, float(equations.system.foundation.present)
    return Motion(
        scene=parts[0],
        inertia=parts[1],
        attached=parts[2],
        excitation=parts[3],
        x=equations.system.x,
        tributary=equations.system.tributary,
        time=times,
        fields=q,
        rates=p,
        traction=has_contact * states.t[:, :n],
        reaction=nan_unless(reached, reaction),
        displacement=displacement,
        velocity=velocity,
        chain=states.q[:, n:, 0],
        force=jax.vmap(parts[3].force)(times),
        kinetic=kinetic,
        stored=stored,
        external_work=states.work[:, 0],
        friction_work=states.work[:, 1],
        damping_work=states.work[:, 2],
        steps=solution.stats["num_steps"],
        rejected=solution.stats["num_rejected_steps"],
        status=_status(solution, reached),
    )


def _status(solution: Any, reached: Array) -> Array:
    """Code of `Ending`."""
    too_many = solution.result == diffrax.RESULTS.max_steps_reached
    interrupted = jnp.where(too_many, Ending.TOO_MANY_STEPS, Ending.GAVE_UP)
    complete = (solution.result == diffrax.RESULTS.successful) & jnp.all(reached)
    return jnp.where(complete, Ending.COMPLETE, interrupted)


def _raise_if_interrupted(motion: Motion, span: float) -> None:
    """Raise `InterruptedMotionError` unless the motion is complete."""
    if motion.complete:
        return
    reason = Ending(int(motion.status)).name.lower().replace("_", " ")
    raise InterruptedMotionError(
        f"the motion ends at t = {motion.reached:.6g} of {span:.6g} ({reason}, {int(motion.steps)} "
        "steps): take a larger tolerance, a shorter step or softer sliders "
        "(contact.stick_stiffness = 100 or less)",
        motion,
    )
