"""Load cycles from backbones by Masing's rule, and the bar, whose backbone has a closed form.

The branches of a loop are the backbone, doubled (Masing 1926).  With the increments q(F) under a
pull of the pressed strip,

    q(F) = q(A) - 2 q((A - F)/2) on the way down,    q(F) = -q(A) + 2 q((A + F)/2) on the way up.

A pull and a push differ if the strip has height, because the reaction does.  The mean of the two
removes this difference from the loop at first order.  For the one-dimensional bar (Goodman 1959)
pull and push are the same and the rule is exact.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax

from jbeamshell.common.errors import Status
from jbeamshell.mechanics.bar import bar_backbone, bar_force, bar_slip_length, bar_slip_profile
from jbeamshell.mechanics.friction import coulomb_cap
from jbeamshell.numerics.newton import Newton
from jbeamshell.quasistatic.path_state import PathState, StepResults, initial_state
from jbeamshell.quasistatic.recovery import walk
from jbeamshell.quasistatic.stepping import Method, march
from jbeamshell.quasistatic.system import LoadLevel, System, V
from jbeamshell.scene.load_path import LoadPath
from jbeamshell.scene.scene import Scene


class Backbone(NamedTuple):
    """Backbone: a pull of the pressed strip in equal steps up to the amplitude.

    Attributes
    ----------
    pressed : results of the steps in which the pressure is applied
    level : increments since then, (half+1, ...) from zero to the amplitude
    displacement, sinking : (half+1,) increments since then
    slip_work : (half,) work of friction in every step
    slipping : (half, n) True if a node slips in a step
    iterations, error, converged, status : (half,) one for every step
    """

    pressed: StepResults
    level: LoadLevel
    displacement: Array
    sinking: Array
    slip_work: Array
    slipping: Array
    iterations: Array
    error: Array
    converged: Array
    status: Array


def masing(
    scene: Scene,
    start: PathState,
    path: LoadPath,
    solver: Newton,
    method: Method = Method.NEWTON,
    recovering: bool = False,
    native: bool = False,
) -> StepResults:
    """Solve the scene's own cycles by the backbones of a pull and of a push, or of a pull alone.

    Parameters
    ----------
    scene, start, path, solver, method, native : see `jbeamshell.quasistatic.stepping.march`
    recovering : True walks failed steps in pieces, which cannot be traced
    """
    signs = (1.0, -1.0) if scene.model.solution == "masing" else (1.0,)
    if recovering:
        pulls = [walk(scene, start, _backbone_path(scene, path, s), solver) for s in signs]
    else:

        def pull(sign: Array) -> StepResults:
            return march(scene, start, _backbone_path(scene, path, sign), solver, method, native)

        both = lax.map(pull, jnp.asarray(signs))  # compiled once
        pulls = [jax.tree.map(lambda a, i=i: a[i], both) for i in range(len(signs))]
    found = [_since_pressed(scene, steps) for steps in pulls]
    return _doubled(scene, path, _mean(*found) if len(found) == 2 else found[0])


def bar_cycles(scene: Scene, path: LoadPath) -> StepResults:
    """Solve the scene's own cycles of Goodman's bar in closed form."""
    return _doubled(scene, path, _bar_backbone(scene, path))


def _backbone_path(scene: Scene, path: LoadPath, sign: float | Array) -> LoadPath:
    """Load path of the pressing, and of a pull or a push to the amplitude after it."""
    pressing, half = scene.load.pressure_steps, scene.load.steps_per_half_cycle
    levels = sign * path.target[-1] * jnp.arange(1, half + 1) / half  # the path ends at A
    ones = jnp.ones_like(levels)
    after = LoadPath(levels, ones, ones)
    return jax.tree.map(lambda a, b: jnp.append(a[:pressing], b), path, after)


def _since_pressed(scene: Scene, steps: StepResults) -> Backbone:
    """Backbone as increments since the end of the pressing."""
    pressing = scene.load.pressure_steps

    def since(values: Array) -> Array:
        return values[pressing - 1 :] - values[pressing - 1]

    return Backbone(
        pressed=jax.tree.map(lambda a: a[:pressing], steps),
        level=jax.tree.map(since, steps.state.level),
        displacement=since(steps.displacement),
        sinking=since(steps.sinking),
        slip_work=steps.slip_work[pressing:],
        slipping=steps.slipping[pressing:],
        iterations=steps.iterations[pressing:],
        error=steps.error[pressing:],
        converged=steps.state.converged[pressing:],
        status=steps.status[pressing:],
    )


def _mean(pull: Backbone, push: Backbone) -> Backbone:
    """Mean of the backbones of a pull and of a push, as a pull."""

    def odd(a: Array, b: Array) -> Array:
        return 0.5 * (a - b)

    return Backbone(
        pressed=pull.pressed,
        level=jax.tree.map(odd, pull.level, push.level),
        displacement=odd(pull.displacement, push.displacement),
        sinking=odd(pull.sinking, push.sinking),
        slip_work=0.5 * (pull.slip_work + push.slip_work),
        slipping=pull.slipping | push.slipping,
        iterations=pull.iterations + push.iterations,
        error=jnp.maximum(pull.error, push.error),
        converged=pull.converged & push.converged,
        status=jnp.maximum(pull.status, push.status),
    )


def _bar_backbone(scene: Scene, path: LoadPath) -> Backbone:
    """Backbone of Goodman's bar in closed form."""
    system, strip, load = System(scene), scene.strip, scene.load
    half = load.steps_per_half_cycle
    contact = scene.contact
    resistance = contact.friction * (contact.pressure - contact.bottom_pressure)
    part = jnp.arange(half + 1) / half
    stiffness = strip.stretching_stiffness
    if load.control == "force":
        force = load.amplitude * part
        displacement = bar_backbone(force, stiffness, resistance)
    else:
        displacement = load.amplitude * part
        # The root of the part is taken alone, because its slope at zero is infinite.
        force = bar_force(load.amplitude, stiffness, resistance) * jnp.sqrt(part)
    reach = bar_slip_length(force, resistance)
    held = reach[-1] < strip.length  # the end that does not slip
    slid = jax.vmap(lambda f: bar_slip_profile(system.x, f, strip.length, stiffness, resistance))(
        force
    )
    nothing = jnp.zeros_like(slid)
    level = LoadLevel(
        q=jnp.zeros((*slid.shape, scene.model.width)).at[..., V].set(slid),
        traction=resistance * (system.x > strip.length - reach[:, None]),
        cap=nothing,
        reaction=nothing,
        force=force,
    )
    work = force**3 / (6.0 * stiffness * resistance)  # q times the integral of the slip
    return Backbone(
        pressed=_pressed_bar(scene, system, path),
        level=level,
        displacement=displacement,
        sinking=jnp.zeros_like(work),
        slip_work=jnp.diff(work),
        slipping=level.traction[1:] > 0.0,
        iterations=jnp.zeros(half, int),
        error=jnp.zeros(half),
        converged=jnp.broadcast_to(held, half),
        status=jnp.broadcast_to(jnp.where(held, Status.CONVERGED, Status.NOT_REACHED), half),
    )


def _pressed_bar(scene: Scene, system: System, path: LoadPath) -> StepResults:
    """Results of pressing the bar, in which only the reaction changes."""
    count = scene.load.pressure_steps
    start, none = initial_state(scene), jnp.zeros(count)
    part = path.pressure[:count]
    state: PathState = jax.tree.map(lambda a: jnp.broadcast_to(a, (count, *a.shape)), start)
    reaction = part[:, None] * ((system.load - system.bottom_load) / system.tributary)
    level = state.level._replace(
        reaction=reaction, cap=coulomb_cap(scene.contact.friction, reaction)
    )
    return StepResults(
        state=state._replace(level=level, pressure=part),
        displacement=none,
        slipping=jnp.zeros((count, system.x.size), bool),
        slip_work=none,
        stored_energy=none,
        sinking=none,
        iterations=none.astype(int),
        error=none,
        status=jnp.full(count, Status.CONVERGED),
    )


def _doubled(scene: Scene, path: LoadPath, backbone: Backbone) -> StepResults:
    """Results of the scene's own cycles from a backbone, by Masing's rule."""
    pressed, cycles = backbone.pressed, scene.load.cycles

    def joined(before: Array, first: Array, down: Array, up: Array) -> Array:
        return jnp.concatenate([before, first, *[down, up] * cycles])

    def doubled(before: Array, pull: Array) -> Array:
        """Values of the branches from the increments of the backbone."""
        up = 2.0 * pull[1:] - pull[-1]
        return joined(before, *(before[-1] + part for part in (pull[2::2], -up, up)))

    def steps(before: Array, first: Array, branch: Array) -> Array:
        """Values that are the same on both branches."""
        return joined(before, first, branch, branch)

    def reached(before: Array, each: Array) -> Array:
        """Values of the branches that depend on the whole backbone."""
        return steps(before, each[1::2], jnp.broadcast_to(each[-1], each.shape))

    level = jax.tree.map(doubled, pressed.state.level, backbone.level)
    level = level._replace(cap=coulomb_cap(scene.contact.friction, level.reaction))
    converged = reached(pressed.state.converged, backbone.converged)
    count = converged.size
    last: PathState = jax.tree.map(
        lambda a: jnp.broadcast_to(a[-1], (count, *a.shape[1:])), pressed.state
    )
    work, slips, taken = backbone.slip_work, backbone.slipping, backbone.iterations
    return StepResults(
        state=last._replace(
            level=level, target=path.target, pressure=path.pressure, converged=converged
        ),
        displacement=doubled(pressed.displacement, backbone.displacement),
        slipping=steps(pressed.slipping, slips[::2] | slips[1::2], slips),
        slip_work=steps(pressed.slip_work, work[::2] + work[1::2], 2.0 * work),
        stored_energy=jax.vmap(System(scene).stored_energy)(level, path.pressure),
        sinking=doubled(pressed.sinking, backbone.sinking),
        iterations=steps(pressed.iterations, taken[::2] + taken[1::2], jnp.zeros_like(taken)),
        error=reached(pressed.error, lax.cummax(backbone.error)),
        status=reached(pressed.status, backbone.status),
    )
