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
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.custom_batching import custom_vmap

from jbeamshell.mechanics.friction import SharpSlip
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.numerics.block_tridiagonal import BlockTridiagonal
from jbeamshell.numerics.newton import Newton, Problem
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


class Supported(NamedTuple):
    """Band of a strip on its supports.

    Attributes
    ----------
    band : stiffness
    press : m entries (n,) of the whole pressure, as residuals
    """

    band: Band
    press: list[Array]


class LinearStrip(NamedTuple):
    """System of equations with its constant parts.

    Attributes
    ----------
    system : its arrays may have lanes behind their nodes
    rough, smooth : bands with and without friction
    pull : m derivatives of u(L) with respect to the fields of the loaded end
    """

    system: System
    rough: Supported
    smooth: Supported
    pull: list[Array]

    def supported(self, rough: Array) -> Supported:
        """Band of a step."""
        if not self.system.ends_depend_on_friction:
            return self.rough
        return jax.tree.map(functools.partial(jnp.where, rough), self.rough, self.smooth)


class Equations(NamedTuple):
    """Equations of a step in the increments of its unknowns, (n, ...) each.

    Attributes
    ----------
    strip : system with its constant parts
    band : its band in this step
    before : state before the step
    given : reaction without the part of the increments
    load : m entries of the step's other forces, as residuals
    drawn : increment of the controlled load
    rough : True if there is friction
    """

    strip: LinearStrip
    band: Band
    before: Memory
    given: Array
    load: list[Array]
    drawn: Array
    rough: Array

    def reaction(self, change: Any) -> Array:
        """Reaction after a change (m, n)."""
        return self.given + times(self.band.normal, [*change])

    def closed(self, cap: Array) -> Array:
        """True at nodes (n,) on which friction acts."""
        return self.rough & self.strip.system.foundation.has_friction(cap)

    def linear(self, slips: Array, closed: Array) -> tuple[Band, list[Array]]:
        """Rows and right-hand side for statuses of the nodes, see `Pattern`."""
        band, foundation = self.band, self.strip.system.foundation
        sticks = closed & (slips == 0.0)
        rubbing = jnp.where(closed, foundation.friction * band.rubbing * slips, 0.0)
        lower, diagonal, upper = (
            [[a + rubbing * b for a, b in zip(blocks[V], normal, strict=True)], *blocks[1:]]
            for blocks, normal in zip(band[:3], band.normal, strict=True)
        )
        slider = band.rubbing * foundation.slip_stiffness
        diagonal[V][V] = diagonal[V][V] + jnp.where(sticks, slider, 0.0)
        slid = rubbing * self.given - band.rubbing * self.before.traction
        rows = band._replace(lower=lower, diagonal=diagonal, upper=upper)
        return self._drawn(rows, jnp.where(sticks, 0.0, slid))

    def residual(self, change: Array) -> Array:
        """Out-of-balance forces (m, n) after a change (m, n), by the friction law."""
        before, foundation = self.before.traction, self.strip.system.foundation
        traction = foundation.traction(change[V], before, self.reaction(change), self.rough)
        return -_left(*self._drawn(self.band, self.band.rubbing * (traction - before)), change)

    def problem(self) -> Problem:
        """Problem for Newton's method, in increments (n, m); for one strip, without lanes."""
        foundation, before = self.strip.system.foundation, self.before

        def evaluate(unknown: Array) -> tuple[Array, Array]:
            return self.residual(unknown.T).T, unknown

        def limit(old: Array, new: Array) -> Array:
            slip = foundation.limited_slip(old[:, V], new[:, V], before.traction, before.cap)
            return jnp.where(self.rough, jnp.column_stack([slip, new[:, V + 1 :]]), new)

        def tangent(unknown: Array, _: None) -> BlockTridiagonal:
            rows = self.linear(*self.statuses(unknown.T))[0][:3]
            return BlockTridiagonal(*(jnp.stack([jnp.stack(r) for r in each]) for each in rows))

        return Problem(evaluate, limit, tangent)

    def statuses(self, change: Array) -> tuple[Array, Array]:
        """Statuses of the nodes after a change (m, n), see `Pattern`."""
        foundation = self.strip.system.foundation
        cap = foundation.friction * self.reaction(change)
        trial = self.before.traction + foundation.slip_stiffness * change[V]
        closed = self.closed(cap)
        return jnp.where(closed & (jnp.abs(trial) > cap), jnp.sign(trial), 0.0), closed

    def _drawn(self, rows: Band, slid: Array) -> tuple[Band, list[Array]]:
        """Equations with the increment of the controlled load at the loaded end.

        Parameters
        ----------
        rows : rows without it
        slid : (n,) force of friction along v that is not in the rows
        """
        strip, drawn, last = self.strip, self.drawn, node(slid, -1)
        system, right = strip.system, [self.load[V] - slid, *self.load[V + 1 :]]
        scales = [system.residual_scale(i) for i in system.model.active]
        forces = [scale * pull for scale, pull in zip(scales, strip.pull, strict=True)]
        if system.control == "force":
            ends = [jnp.where(last, force * drawn, 0.0) for force in forces]
            return rows, [r + end for r, end in zip(right, ends, strict=True)]
        # The balance along v gives the force for the other rows; its own row prescribes u(L).
        here = last & self.rough
        shares = [jnp.where(here, force / forces[V], 0.0) for force in forces[1:]]
        stiffness = system.stiffness_scale * scales[V]

        def without_force(blocks: Blocks, own: list[Array]) -> Blocks:
            along = blocks[V]
            end = [jnp.where(here, a, b) for a, b in zip(own, along, strict=True)]
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
        return rows, [jnp.where(here, stiffness * drawn, right[V]), *others]


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

    found: StatusSteps = follow(*lax.stop_gradient((system, *_given(system, start, path))))
    return found


def solve_path_by_newton(system: System, start: Any, path: Any, solver: Newton) -> StatusSteps:
    """Solve the steps of a load path by Newton's method, from the result of the status iteration.

    Parameters
    ----------
    system, start, path : see `solve_path`
    solver : settings of Newton's method
    """
    *constants, memory, _ = _given(system, start, path)
    strip = _linear_strip(system, *constants)

    def go(at: tuple[Memory, Array], to: Any) -> tuple[tuple[Memory, Array], StatusSteps]:
        memory, enabled = at
        found = step(strip, memory, to, functools.partial(_root, solver, enabled))
        return (found.memory, enabled & found.settled), found

    found: StatusSteps = lax.scan(go, (memory, start.converged), path)[1]
    return found


def _given(system: System, start: Any, path: Any) -> tuple[Any, ...]:
    """Arguments of `_follow`: constants of the strip, the memory of a `PathState`, and a path.

    The constants are the stiffness of the section, the derivatives of the end's displacement, and
    the forces of the pressure.
    """
    unloaded, level = system.unloaded().q, start.level
    pull = jax.grad(system.end_displacement)(unloaded)[-1]
    constants = system.section_stiffness(), pull, jax.grad(system.sinking)(unloaded)
    memory = Memory(
        level.traction, level.cap, level.reaction, start.target, start.pressure, start.reversal
    )
    return *constants, memory, path


def _linear_strip(system: System, section: Array, pull: Array, press: Array) -> LinearStrip:
    active = system.model.active
    forces = [system.residual_scale(i) * press[:, i] for i in active]

    def supported(rough: bool) -> Supported:
        return Supported(band(system, section, rough), unheld(system, rough, forces))

    rough = supported(True)
    smooth = supported(False) if system.ends_depend_on_friction else rough
    return LinearStrip(system, rough, smooth, [pull[i] for i in active])


def _follow(
    system: System, section: Array, pull: Array, press: Array, start: Memory, path: Any
) -> StatusSteps:
    strip = _linear_strip(system, section, pull, press)

    def go(memory: Memory, to: Any) -> tuple[Memory, StatusSteps]:
        found = step(strip, memory, to, _settle)
        return found.memory, found

    found: StatusSteps = lax.scan(go, start, path)[1]
    return found


def step(
    strip: LinearStrip, memory: Memory, to: Any, solve: Callable[[Equations, Array], Pattern]
) -> StatusSteps:
    """Solve one load step.

    Parameters
    ----------
    strip : system with its constant parts
    memory : state before the step
    to : target, pressure and roughness of the step
    solve : from the equations and a first guess of the slips to the pattern of the step
    """
    system, law = strip.system, strip.system.foundation.friction_law
    rough, reversal = to.rough > 0.0, lax.stop_gradient(last_reversal(system, memory, to))
    further, supported = to.pressure - memory.pressure, strip.supported(rough)
    equations = Equations(
        strip,
        supported.band,
        memory,
        given=memory.reaction + further * (system.load - system.bottom_load) / system.tributary,
        load=[-further * each for each in supported.press],
        drawn=to.target - memory.target,
        rough=rough,
    )
    found = solve(equations, lax.stop_gradient(first_to_slip(system, reversal, to.target)))
    change, slider = found.change, system.foundation.slip_stiffness
    reaction = equations.reaction(change)
    cap = system.foundation.cap(reaction)
    slid = law.traction(change[V], memory.traction, cap, slider)
    traction = jnp.where(found.closed, slid, 0.0)
    work = law.slip_work(change[V], memory.traction, traction, memory.cap, cap, slider)
    rubs = equations.closed(jnp.maximum(memory.cap, cap))
    return StatusSteps(
        change,
        Memory(traction, cap, reaction, to.target, to.pressure, reversal),
        jnp.sum(jnp.where(rubs, system.tributary * work, 0.0), axis=0),
        found.error,
        found.solves,
        found.settled,
    )


def _settle(equations: Equations, slips: Array) -> Pattern:
    """Find which nodes stick and which slip in a step, from a first guess of the slips (n,)."""
    traction, given = equations.before.traction, equations.given
    foundation = equations.strip.system.foundation
    slider, friction = foundation.slip_stiffness, foundation.friction

    def again(at: Pattern) -> Pattern:
        change = jnp.stack(_solve(*equations.linear(at.slips, at.closed)))
        cap = friction * equations.reaction(change)
        trial = traction + slider * change[V]
        largest = jnp.max(jnp.abs(change[V]), axis=0)
        little = SMALLEST_SHARE * cap + TIES * jnp.finfo(cap.dtype).eps * slider * largest
        beyond = jnp.where(jnp.abs(trial) > cap + little, jnp.sign(trial), 0.0)
        # A node that slips may stick next, but not slip back, or the search would go in circles.
        on = jnp.where(at.slips * trial >= cap - little, at.slips, 0.0)
        closed = equations.closed(cap)
        slips = jnp.where(closed, jnp.where(at.slips == 0.0, beyond, on), 0.0)
        same = jnp.all((slips == at.slips) & (closed == at.closed), axis=0)
        return Pattern(slips, closed, change, at.error, at.solves + ~at.settled, same)

    closed, zero = equations.closed(friction * given), jnp.zeros_like(equations.drawn)
    nothing = jnp.zeros((len(equations.load), *traction.shape), traction.dtype)
    count, settled = jnp.zeros(zero.shape, int), jnp.zeros(zero.shape, bool)
    first = Pattern(jnp.where(closed, slips, 0.0), closed, nothing, zero, count, settled)
    found = lax.while_loop(lambda at: jnp.any(~at.settled & (at.solves < MOST)), again, first)
    left = jnp.abs(_left(*equations.linear(found.slips, found.closed), found.change))
    return found._replace(error=jnp.max(left, axis=(0, 1)))


def _root(solver: Newton, enabled: Array, equations: Equations, slips: Array) -> Pattern:
    """Pattern of a step by Newton's method, from that of the status iteration."""
    found = _settle(*lax.stop_gradient((equations, slips)))
    root, (iterations, error) = solver.solve(equations.problem(), found.change.T, enabled=enabled)
    slips, closed = equations.statuses(root.T)
    settled = error <= solver.tolerance_for(root.dtype)
    return Pattern(slips, closed, root.T, error, found.solves + iterations, settled)


def _left(rows: Band, right: list[Array], change: Array) -> Array:
    """Forces (m, n) that a change (m, n) leaves on the right-hand side."""
    near = zip(*rows[:3], strict=True)
    left = [r - times(blocks, [*change]) for r, blocks in zip(right, near, strict=True)]
    return jnp.stack(left)


def _solve(rows: Band, right: list[Array]) -> list[Array]:
    return block_tridiagonal.solve_entries(rows[:3], right)
