r"""Stick-slip status iteration: load steps of sharp sliders under linear strains.

With a guess of every node's status the equilibrium of a step is linear, because a node that sticks
has t = t_n + k_t dv and one that slips has t = +-mu R.  Its solution gives every node a new status.
This is repeated until no status changes.  It is Newton's method without a residual and without a
line search.

The first axis of an array runs along the nodes.  Further axes are lanes: strips that are solved
together.  Under `jax.vmap` the lanes come last here, so that a core's vectors run along them.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.custom_batching import custom_vmap

from jbeamshell.mechanics.friction import SharpSlip
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.quasistatic.assembly import Band, Blocks, band, node, times, unheld
from jbeamshell.quasistatic.prediction import SMALLEST_SHARE, Reversal, first_to_slip, last_reversal
from jbeamshell.quasistatic.system import System, V
from jbeamshell.scene.keys import CONTROLS
from jbeamshell.scene.scene import Scene

MOST = 40  # largest number of guesses in a step
TIES = 64.0  # smallest difference of displacements that counts, in machine precisions


class Memory(NamedTuple):
    """State after a step that the next one needs; see `PathState`."""

    traction: Array
    cap: Array
    reaction: Array
    target: Array
    pressure: Array
    reversal: Reversal


class Pattern(NamedTuple):
    """Guess of the statuses in a step, and its solution.

    Attributes
    ----------
    slips : (n,) 1 and -1 for nodes that slip along and against v, 0 for those that stick
    closed : (n,) True if there is a reaction, so that friction acts
    change : (m, n) increments of the unknowns
    error : largest residual of the last solution
    solves : number of guesses so far
    settled : True if the solution has the guessed statuses
    """

    slips: Array
    closed: Array
    change: Array
    error: Array
    solves: Array
    settled: Array


class StatusSteps(NamedTuple):
    """Results of the steps of a path, stacked along the first axis.

    Attributes
    ----------
    change : (m, n) increments of the unknowns
    memory : state after the step
    slip_work : work of friction
    error : largest out-of-balance force over mu F_N L, by the assembled stiffness
    solves : number of guesses
    settled : True if the last guess was right
    """

    change: Array
    memory: Memory
    slip_work: Array
    error: Array
    solves: Array
    settled: Array


class LinearStrip(NamedTuple):
    """System of equations with its constant parts.

    Attributes
    ----------
    system : its arrays may have lanes behind their nodes
    band : stiffness with friction
    pull : m derivatives of u(L) with respect to the fields of the loaded end
    press : m entries (n,) of the whole pressure, as residuals
    pressed : (m, n) change of the unknowns by the whole pressure without friction
    """

    system: System
    band: Band
    pull: list[Array]
    press: list[Array]
    pressed: Array


def applies(scene: Scene) -> bool:
    """True if only the statuses of sharp sliders make a scene's steps nonlinear."""
    model = scene.model
    return (
        model.kinematics == "linear"
        and scene.energy is None
        and type(scene.contact.law) is SharpSlip
        and "w" not in model.fields
        and model.grid == "finite-difference"
        and model.squeeze == "field"
        and scene.load.control in CONTROLS
        and len(model.active) <= block_tridiagonal.SMALL
    )


def solve_path(system: System, start: Any, path: Any) -> StatusSteps:
    """Solve the steps of a load path by status iteration.  Derivatives do not pass.

    Parameters
    ----------
    system : equations of a scene to which the iteration `applies`
    start, path : `PathState` and `LoadPath`
    """
    follow = custom_vmap(_follow)

    @follow.def_vmap
    def _(size: int, batched: Any, *given: Any) -> tuple[Any, Any]:
        def last(along: bool, a: Array) -> Array:
            if along:
                return jnp.moveaxis(a, 0, -1)
            return jnp.broadcast_to(a[..., None], (*a.shape, size))

        found = _follow(*jax.tree.map(last, tuple(batched), given))
        first = jax.tree.map(lambda a: jnp.moveaxis(a, -1, 0), found)
        return first, jax.tree.map(lambda _: True, first)

    given = (system, *_parts(system), memory_of(start), path)
    found: StatusSteps = follow(*lax.stop_gradient(given))
    return found


def linear_strip(system: System) -> LinearStrip:
    """System with its constant parts.  Derivatives do not pass."""
    return _linear_strip(*lax.stop_gradient((system, *_parts(system))))


def memory_of(state: Any) -> Memory:
    """Memory of a `PathState`.  Derivatives do not pass."""
    level = state.level
    memory = Memory(
        level.traction, level.cap, level.reaction, state.target, state.pressure, state.reversal
    )
    return lax.stop_gradient(memory)


def _parts(system: System) -> tuple[Array, Array, Array]:
    """Stiffness of the section, derivative of the end's displacement, forces of the pressure."""
    unloaded = system.unloaded().q
    pull = jax.grad(system.end_displacement)(unloaded)[-1]
    return system.section_stiffness(), pull, jax.grad(system.sinking)(unloaded)


def _linear_strip(system: System, section: Array, pull: Array, press: Array) -> LinearStrip:
    rough = smooth = band(system, section, True)
    if system.ends_depend_on_friction:
        smooth = band(system, section, False)
    active = system.model.active
    forces = [system.residual_scale(i) * press[:, i] for i in active]
    pressed = jnp.stack(_solve(smooth, [-each for each in unheld(system, smooth, forces)]))
    return LinearStrip(
        system, rough, [pull[i] for i in active], unheld(system, rough, forces), pressed
    )


def _follow(
    system: System, section: Array, pull: Array, press: Array, start: Memory, path: Any
) -> StatusSteps:
    strip = _linear_strip(system, section, pull, press)

    def go(memory: Memory, to: Any) -> tuple[Memory, StatusSteps]:
        found = step(strip, memory, to)
        return found.memory, found

    found: StatusSteps = lax.scan(go, start, path)[1]
    return found


def step(strip: LinearStrip, memory: Memory, to: Any) -> StatusSteps:
    """Solve one load step.

    Parameters
    ----------
    strip : system with its constant parts
    memory : state before the step
    to : target, pressure and roughness of the step
    """
    system = strip.system
    rough, reversal = to.rough > 0.0, last_reversal(system, memory, to)
    further = to.pressure - memory.pressure
    net = (system.load - system.bottom_load) / system.tributary
    given = memory.reaction + further * net
    load = [-further * each for each in strip.press]
    slips = first_to_slip(system, reversal, to.target)
    drawn = to.target - memory.target
    found = _settle(strip, memory.traction, given, drawn, load, slips, rough)
    change = jnp.where(rough, found.change, further * strip.pressed)
    reaction = given + times(strip.band.normal, [*change])
    cap = system.foundation.cap(reaction)
    slid = system.foundation.friction_law.traction(
        change[V], memory.traction, cap, system.foundation.slip_stiffness
    )
    traction = jnp.where(found.closed & rough, slid, 0.0)
    work = system.tributary * system.foundation.friction_law.slip_work(
        change[V], memory.traction, traction, memory.cap, cap, system.foundation.slip_stiffness
    )
    pressed = system.foundation.has_friction(jnp.maximum(memory.cap, cap))
    return StatusSteps(
        change,
        Memory(traction, cap, reaction, to.target, to.pressure, reversal),
        jnp.where(rough, jnp.sum(jnp.where(pressed, work, 0.0), axis=0), 0.0),
        found.error,
        found.solves,
        found.settled,
    )


def _settle(
    strip: LinearStrip,
    traction: Array,
    given: Array,
    drawn: Array,
    load: list[Array],
    slips: Array,
    rough: Array,
) -> Pattern:
    """Find which nodes stick and which slip in a step.

    Parameters
    ----------
    strip : system with its constant parts
    traction, given : (n,) traction before the step, and R without the part of the increments
    drawn : increment of the controlled load
    load : m entries (n,) of the step's other forces, as residuals
    slips : (n,) first guess
    rough : True if there is friction; if not, nothing is done
    """
    system, band = strip.system, strip.band
    slider, friction = system.foundation.slip_stiffness, system.foundation.friction

    def equations(slips: Array, closed: Array) -> tuple[Band, list[Array]]:
        sticks = closed & (slips == 0.0)
        rubbing = jnp.where(closed, friction * band.rubbing * slips, 0.0)
        lower, diagonal, upper = (
            [[a + rubbing * b for a, b in zip(blocks[V], normal, strict=True)], *blocks[1:]]
            for blocks, normal in zip(band[:3], band.normal, strict=True)
        )
        diagonal[V][V] = diagonal[V][V] + jnp.where(sticks, band.rubbing * slider, 0.0)
        slid = jnp.where(sticks, 0.0, rubbing * given - band.rubbing * traction)
        rows = band._replace(lower=lower, diagonal=diagonal, upper=upper)
        return _drawn(strip, rows, [load[V] - slid, *load[1:]], drawn)

    def again(at: Pattern) -> Pattern:
        change = _solve(*equations(at.slips, at.closed))
        cap = friction * (given + times(band.normal, change))
        trial = traction + slider * change[V]
        largest = jnp.max(jnp.abs(change[V]), axis=0)
        little = SMALLEST_SHARE * cap + TIES * jnp.finfo(cap.dtype).eps * slider * largest
        beyond = jnp.where(jnp.abs(trial) > cap + little, jnp.sign(trial), 0.0)
        # A node that slips may stick next, but not slip back, or the search would go in circles.
        on = jnp.where(at.slips * trial >= cap - little, at.slips, 0.0)
        closed = system.foundation.has_friction(cap)
        slips = jnp.where(closed, jnp.where(at.slips == 0.0, beyond, on), 0.0)
        same = jnp.all((slips == at.slips) & (closed == at.closed), axis=0)
        return Pattern(slips, closed, jnp.stack(change), at.error, at.solves + ~at.settled, same)

    closed = system.foundation.has_friction(friction * given)
    nothing, zero = jnp.zeros((len(load), *traction.shape), traction.dtype), jnp.zeros_like(drawn)
    none = jnp.zeros(rough.shape, int)
    first = Pattern(jnp.where(closed, slips, 0.0), closed, nothing, zero, none, ~rough)
    found = lax.while_loop(lambda at: jnp.any(~at.settled & (at.solves < MOST)), again, first)
    rows, right = equations(found.slips, found.closed)
    left = [
        r - times(near, list(found.change))
        for r, near in zip(right, zip(*rows[:3], strict=True), strict=True)
    ]
    error = jnp.max(functools.reduce(jnp.maximum, map(jnp.abs, left)), axis=0)
    return found._replace(error=jnp.where(rough, error, 0.0))


def _drawn(
    strip: LinearStrip, rows: Band, right: list[Array], drawn: Array
) -> tuple[Band, list[Array]]:
    """Equations with the increment of the controlled load at the loaded end."""
    system, last = strip.system, node(strip.system.x, -1)
    scales = [system.residual_scale(i) for i in system.model.active]
    forces = [scale * pull for scale, pull in zip(scales, strip.pull, strict=True)]
    if system.control == "force":
        ends = [jnp.where(last, force * drawn, 0.0) for force in forces]
        return rows, [r + end for r, end in zip(right, ends, strict=True)]
    # The balance along v gives the force for the other rows; its own row prescribes u(L).
    shares = [jnp.where(last, force / forces[V], 0.0) for force in forces[1:]]
    stiffness = system.stiffness_scale * scales[V]

    def without_force(blocks: Blocks, own: list[Array]) -> Blocks:
        along = blocks[V]
        end = [jnp.where(last, a, b) for a, b in zip(own, along, strict=True)]
        others = [
            [a - share * b for a, b in zip(row, along, strict=True)]
            for row, share in zip(blocks[1:], shares, strict=True)
        ]
        return [end, *others]

    ends = [stiffness * pull for pull in strip.pull]
    rows = rows._replace(
        lower=without_force(rows.lower, [jnp.zeros_like(drawn)] * len(right)),
        diagonal=without_force(rows.diagonal, ends),
    )
    others = [r - share * right[V] for r, share in zip(right[1:], shares, strict=True)]
    return rows, [jnp.where(last, stiffness * drawn, right[V]), *others]


def _solve(rows: Band, right: list[Array]) -> list[Array]:
    return block_tridiagonal.solve_entries(rows[:3], right)
