"""Transients of a scene, in time steps that diffrax drives."""

from __future__ import annotations

import math
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import POSITIVE, is_traced, require, require_count, require_number
from jbeamshell.common.errors import warn_of_doubts
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.progress import watched
from jbeamshell.dynamics.ledger import InterruptedMotionError
from jbeamshell.dynamics.strip.equations import Equations, movable
from jbeamshell.dynamics.strip.excitation import Excitation
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.dynamics.strip.midpoint import Midpoint
from jbeamshell.dynamics.strip.modes import checked_payload, modes
from jbeamshell.dynamics.strip.motion import Motion
from jbeamshell.dynamics.strip.step_equations import StepMatrices
from jbeamshell.load_steps.system import System
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.solve import run

PER_PERIOD = 200  # default number of steps in the first period of the stuck strip
MOST_STEPS = 10_000_000
RELEASE_STEPS = 8  # load steps to the force that is released, so that the reaction is followed
NO_TERM = diffrax.ODETerm(lambda time, state, args: state)  # the solver's equations are its args
NO_MOTION = "nothing happens: give an excitation, or a force to let go of in released="


def simulate(
    scene: Scene,
    span: float,
    excitation: Excitation | None = None,
    *,
    payload: Any = 0.0,
    inertia: Inertia | None = None,
    released: ArrayLike | None = None,
    samples: int = 1001,
    step: float | None = None,
    adjoint: Any = None,
    progress: bool | None = None,
    throw: bool = True,
) -> Motion:
    """Transient of a strip that is pressed down, loaded quasi-statically and then released.

    Time steps are implicit, with the friction law of load steps, see
    `jbeamshell.dynamics.strip.midpoint`.

    Parameters
    ----------
    scene : scene of the strip, whose load is not used; on a rigid base the strip is held down
    span : end time
    excitation : force at the end or acceleration of the foundation; None is free vibration
    payload : mass per width that moves with u(L)
    inertia : density and damping; None is density 1
    released : force F, or path (k,) of forces, under which the strip rests before t = 0; None is
        no force
    samples : number of times in the result, evenly spaced from 0 to ``span``
    step : largest time step; None is 1/200 of the first period of the stuck strip
    adjoint : way in which diffrax differentiates, such as `diffrax.ForwardMode()` for forward mode
    progress : show a progress bar; None shows it where a person watches
    throw : raise if the motion ends before ``span``; otherwise see ``motion.complete``

    Returns
    -------
    Motion
        times that were not reached hold NaN

    Raises
    ------
    InputError
        for a scene that has no equations of motion, neither an excitation nor a released force, or
        too many steps
    InterruptedMotionError
        if a step has no solution; it carries the part that was computed

    Warns
    -----
    DoubtfulWarning
        if the energies do not add up, see ``motion.doubts``

    Examples
    --------
    A mass on a strip under a harmonic force:

    >>> load = Harmonic(0.8, frequency=2.0, ramp=3.0)
    >>> motion = simulate(jb.Scene(), 5.0, load, payload=20.0)
    >>> motion.plot()
    """
    inertia, excitation = inertia or Inertia(), excitation or Excitation()
    scene, payload = movable(scene, inertia), checked_payload(payload)
    require_number("span", span, POSITIVE + " (time)")
    require_count("samples", samples, 2)
    moves = is_traced(excitation) or released is not None or excitation.acts(float(span))
    require("excitation", type(excitation).__name__, moves, NO_MOTION)
    if step is None:
        fix = "has no default for a traced scene: give a number"
        require("step", step, not is_traced(scene, inertia, payload), fix)
        step = 1.0 / float(modes(scene, inertia, payload=payload).frequency[0]) / PER_PERIOD
    require_number("step", step, POSITIVE + " (time)")
    between = max(1, math.ceil(float(span) / (samples - 1) / step * (1.0 - 1e-9)))
    count = (samples - 1) * between
    require("step", step, count <= MOST_STEPS, f"needs {count} steps of time: take longer ones")
    start = _start(scene, released)
    watching = watched() if progress is None else progress
    motion = _run(
        (scene, inertia, payload, excitation),
        start,
        jnp.linspace(0.0, float(span), count + 1),
        between,
        adjoint or diffrax.RecursiveCheckpointAdjoint(),
        bool(watching) and not is_traced(scene, start),
    )
    if is_traced(motion):
        return motion
    if throw and not motion.complete:
        raise InterruptedMotionError(
            f"the motion ends at t = {motion.reached:.6g} of {span:.6g}, as a time step has no "
            "solution: take shorter steps or softer sliders (contact.stick_stiffness = 100 or "
            "less)",
            motion,
        )
    warn_of_doubts(motion.doubts)
    return motion


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
    parts: tuple[Scene, Inertia, Array, Excitation],
    start: tuple[Array, Array, Array],
    steps: Array,
    between: int,
    adjoint: Any,
    progress: bool,
) -> Motion:
    """Motion from the fields, tractions and u(L) of `_start`; ``steps`` are all step times."""
    equations, times = Equations(*parts), steps[::between]
    fields, traction, pressed = start
    solution = diffrax.diffeqsolve(
        NO_TERM,
        Midpoint(),
        0.0,
        steps[-1],
        None,
        equations.initial_state(fields, traction),
        StepMatrices(equations),
        saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=diffrax.StepTo(steps),
        max_steps=steps.size,
        adjoint=adjoint,
        progress_meter=diffrax.TqdmProgressMeter() if progress else diffrax.NoProgressMeter(),
        throw=False,
    )
    reached = jnp.isfinite(solution.ys.work[:, 0])
    states = nan_unless(reached, solution.ys)
    system = equations.system

    def quantities(at: tuple[Array, Any]) -> tuple[Array, ...]:
        _, reaction = equations.response(*at)
        q, p = system.embed(at[1].q), system.embed(at[1].p)
        velocity = jnp.sum(equations.end_conjugate(q) * p[-1])
        displacement = system.end_displacement(q) - pressed
        return (q, p, reaction, displacement, velocity, *equations.energies(at[1]))

    found = jax.lax.map(quantities, (times, states))
    q, p, reaction, displacement, velocity, kinetic, stored = found
    return Motion(
        scene=parts[0],
        payload=parts[2],
        x=system.x,
        tributary=system.tributary,
        time=times,
        fields=q,
        rates=p,
        traction=float(system.foundation.present) * states.t,
        reaction=nan_unless(reached, reaction),
        displacement=displacement,
        velocity=velocity,
        force=jax.vmap(parts[3].force)(times),
        kinetic=kinetic,
        stored=stored,
        external_work=states.work[:, 0],
        friction_work=states.work[:, 1],
        damping_work=states.work[:, 2],
        steps=solution.stats["num_steps"],
    )
