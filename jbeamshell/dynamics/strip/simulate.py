"""Transients: a scene set in motion, by diffrax."""

from __future__ import annotations

import math
import sys
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
from jbeamshell.dynamics.strip import rate_friction
from jbeamshell.dynamics.strip.attached_masses import AttachedMasses
from jbeamshell.dynamics.strip.block_solver import Banded
from jbeamshell.dynamics.strip.equations import Equations, MotionState, check
from jbeamshell.dynamics.strip.excitation import Excitation
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.dynamics.strip.midpoint import Midpoint, Prepared
from jbeamshell.dynamics.strip.motion import Ending, InterruptedMotionError, Motion
from jbeamshell.dynamics.strip.stepsize import EXPLICIT, METHODS, STIFF, longest_step
from jbeamshell.mechanics.friction import ElasticSlip
from jbeamshell.mechanics.normal_contact import Absent
from jbeamshell.quasistatic.solver import solve
from jbeamshell.quasistatic.system import System
from jbeamshell.scene.scene import Scene

MOST_STEPS = 10_000_000
HAPPENS = "nothing happens: give an excitation, or a force to let go of in released="


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
    """Press the strip down, load it quasi-statically, let it go, and follow its motion.

    Parameters
    ----------
    scene : the strip, its contact and its model; of its load nothing is used
    span : time that is followed
    excitation : what shakes it; None is free vibration
    inertia : density and what goes with it; None is density 1
    attached : payload and chain at the loaded end
    released : force F, or a path of forces, under which the strip rests before t = 0; None is the
        pressed strip
    samples : instants, evenly spaced from 0 to ``span``, that are kept
    method : how it is followed.  "midpoint", the default, is implicit and without damping of its
        own, with the friction law of load steps, see `jbeamshell.dynamics.strip.midpoint`.  The
        others take friction as a rate law, with the exponent `rate_friction.SHARPEST` in place of a
        sharp slider: "kvaerno3" and "kvaerno5" stiff, in steps chosen from the tolerance;
        "tsit5" and "bosh3" explicit
    tolerance : of a step's error (stiff), relative and to the sizes of a motion at gross slip
    step : largest time step; by default a `PER_PERIOD`-th of the stuck strip's first period, and
        for explicit methods `MARGIN` of the stable one
    most_steps : after which it gives up
    adjoint : diffrax's, such as `diffrax.ForwardMode()` to differentiate forwards
    progress : whether to show how far it is; None is on a terminal only
    throw : whether a motion that ends before ``span`` raises; if not, read ``motion.status``

    Returns
    -------
    Motion
        instants that were not reached hold NaN.

    Raises
    ------
    InputError
        for a scene that cannot be set in motion, a span in which nothing happens, or an explicit
        step above the stable one
    InterruptedMotionError
        if the solver gives up; it carries the part computed
    """
    inertia, attached = inertia or Inertia(), attached or AttachedMasses()
    excitation = excitation or Excitation()
    check(scene, inertia)
    require_number("span", span, POSITIVE + " (time)")
    whole = isinstance(samples, int | np.integer) and samples >= 2
    require("samples", samples, whole, "must be a whole number of at least 2 instants")
    require_number("tolerance", tolerance, POSITIVE)
    require_choice("method", method, METHODS)
    scene = scene if method == "midpoint" else smooth(scene)
    acts = is_traced(excitation) or released is not None or excitation.acts(float(span))
    require("excitation", type(excitation).__name__, acts, HAPPENS)
    longest = longest_step(scene, inertia, attached, method, step)
    start = _start(scene, released)
    if progress is None:
        progress = sys.stderr.isatty()
    times = np.linspace(0.0, float(span), samples)
    between = 1 if longest is None else max(1, math.ceil(times[1] / longest * (1.0 - 1e-9)))
    instants = np.linspace(0.0, float(span), (samples - 1) * between + 1)
    motion = _run(
        (scene, inertia, attached, excitation),
        start,
        jnp.asarray(instants),
        None if longest is None else between,
        samples,
        tolerance,
        method,
        most_steps,
        adjoint or diffrax.RecursiveCheckpointAdjoint(),
        bool(progress) and not is_traced(scene, start),
    )
    if throw and not is_traced(motion):
        _raise_if_cut(motion, float(span))
    return motion


def smooth(scene: Scene) -> Scene:
    """The scene with a friction law that has a rate."""
    m = rate_friction.exponent(scene.contact.law)
    return eqx.tree_at(lambda s: s.contact.law, scene, ElasticSlip(m))


def _start(scene: Scene, released: ArrayLike | None) -> tuple[Array, Array, Array]:
    """Fields, tractions and u(L) after the pressure, of the strip at rest before t = 0."""
    path = np.zeros(1) if released is None else np.atleast_1d(np.asarray(released, float))
    if path.size == 1:  # walked in some steps, so that friction sees where the reaction goes
        path = float(path[0]) * np.arange(1, 9) / 8.0
    history = solve(scene, path)
    rest = _end(scene, history.fields[history.pressed])
    return history.fields[-1], history.traction[-1], rest


@eqx.filter_jit
def _end(scene: Scene, q: Array) -> Array:
    return System(scene).end_displacement(q)


@eqx.filter_jit
def _run(
    parts: tuple[Scene, Inertia, AttachedMasses, Excitation],
    start: tuple[Array, Array, Array],
    instants: Array,
    between: int | None,
    samples: int,
    tolerance: Any,
    method: str,
    most_steps: int,
    adjoint: Any,
    progress: bool,
) -> Motion:
    equations = Equations(*parts)
    units, unit = equations.units, equations.time_unit
    times = instants[:: between or 1]
    fields, traction, rest = start
    state = equations.initial_state(fields, traction, parts[3].push)
    args = None
    if method == "midpoint":
        unit, units, args = (
            jnp.ones_like(unit),
            jax.tree.map(jnp.ones_like, units),
            Prepared(equations),
        )

    def rates(time: Any, scaled: MotionState, _: Any) -> MotionState:
        inside = jax.tree.map(lambda a, u: a * u, scaled, units)
        return jax.tree.map(lambda a, u: a * unit / u, equations(unit * time, inside), units)

    stepping: Any = diffrax.StepTo(instants / unit)
    if between is None:
        stepping = diffrax.PIDController(rtol=tolerance, atol=tolerance)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rates),
        _solver(method, parts[1].mass, tolerance),
        0.0,
        instants[-1] / unit,
        None,
        jax.tree.map(lambda a, u: a / u, state, units),
        args,
        saveat=diffrax.SaveAt(ts=times / unit),
        stepsize_controller=stepping,
        max_steps=min(most_steps, 10 * instants.size) if between else most_steps,
        adjoint=adjoint,
        progress_meter=diffrax.TqdmProgressMeter() if progress else diffrax.NoProgressMeter(),
        throw=False,
    )
    states = jax.tree.map(lambda a, u: a * u, solution.ys, units)
    return _motion(equations, parts, times, states, rest, solution)


def _solver(method: str, mass: str, tolerance: Any) -> Any:
    if method == "midpoint":
        return Midpoint()
    if method in EXPLICIT:
        return EXPLICIT[method]()
    linear: Any = lx.AutoLinearSolver(well_posed=None) if mass == "consistent" else Banded()
    finder = diffrax.VeryChord(
        rtol=10.0 * tolerance, atol=10.0 * tolerance, norm=optx.rms_norm, linear_solver=linear
    )
    return STIFF[method](root_finder=finder)


def _motion(
    equations: Equations,
    parts: tuple[Scene, Inertia, AttachedMasses, Excitation],
    times: Array,
    states: MotionState,
    rest: Array,
    solution: Any,
) -> Motion:
    """What the states say, instants that were not reached as NaN."""
    reached = jnp.isfinite(states.work[:, 0])

    def masked(values: Array) -> Array:
        return jnp.where(reached.reshape(-1, *[1] * (values.ndim - 1)), values, jnp.nan)

    states = jax.tree.map(masked, states)

    def seen(pair: tuple[Array, MotionState]) -> tuple[Array, ...]:
        time, state = pair
        answer = equations.response(time, state)
        q, p = equations.nodal(state.q), equations.nodal(state.p)
        speed = jnp.sum(equations.conjugate(q) * p[-1])
        ends = (equations.system.end_displacement(q) - rest, speed)
        return (q, p, answer.reaction, *ends, *equations.energies(state))

    q, p, reaction, displacement, velocity, kinetic, stored = jax.lax.map(seen, (times, states))
    rubs = 0.0 if isinstance(equations.system.foundation.normal_law, Absent) else 1.0
    n = equations.n
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
        traction=rubs * states.t[:, :n],
        reaction=masked(reaction),
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
    spent = solution.result == diffrax.RESULTS.max_steps_reached
    cut = jnp.where(spent, Ending.TOO_MANY_STEPS, Ending.GAVE_UP)
    whole = (solution.result == diffrax.RESULTS.successful) & jnp.all(reached)
    return jnp.where(whole, Ending.COMPLETE, cut)


def _raise_if_cut(motion: Motion, span: float) -> None:
    if int(motion.status) == Ending.COMPLETE:
        return
    reason = Ending(int(motion.status)).name.lower().replace("_", " ")
    raise InterruptedMotionError(
        f"the motion ends at t = {motion.reached:.6g} of {span:.6g} ({reason}, {int(motion.steps)} "
        "steps): take a larger tolerance, a shorter step or a lower contact.stick_stiffness",
        motion,
    )
