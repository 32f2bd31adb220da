r"""Load steps of sharp sliders under linear strains: who sticks, who slips, one linear solve.

With a guess of every node's status the equilibrium of a step is linear, because a node that sticks
has t = t_n + k_t dv and one that slips has t = +-mu R, and its solution says what every node does:
again, until nothing changes.  That is Newton's method without a residual, a line search, or
anything evaluated twice.

Arrays have their nodes (and what else is said) first; any further axes are lanes that are solved
together.  Under `jax.vmap` the lanes come last here, where a core's vectors run along them.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.custom_batching import custom_vmap

from jbeamshell.mechanics.friction import SharpSlip
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.numerics.newton import Newton
from jbeamshell.quasistatic.assembly import Band, Blocks, band, node, times, unheld
from jbeamshell.quasistatic.prediction import SMALLEST_SHARE, Reversal, first_to_slip, last_reversal
from jbeamshell.quasistatic.system import System, V
from jbeamshell.scene.keys import CONTROLS
from jbeamshell.scene.scene import Scene

MOST = 40  # guesses of one step
TIES = 64.0  # machine precisions of a displacement: less than this decides nothing


class Memory(NamedTuple):
    """What a step leaves to the next one; see `jbeamshell.quasistatic.stepping.PathState`."""

    traction: Array
    cap: Array
    reaction: Array
    target: Array
    pressure: Array
    turn: Reversal


class Pattern(NamedTuple):
    """A guess and its answer.

    Attributes
    ----------
    slips : (n,) 1 and -1 for nodes that slip along and against v, 0 for those that stick
    closed : (n,) whether there is a reaction to rub
    change : (m, n) increments of the unknowns
    error : largest residual of the answer; of the last one only
    solves : guesses so far
    settled : whether the answer is what was guessed
    """

    slips: Array
    closed: Array
    change: Array
    error: Array
    solves: Array
    settled: Array


class Foreseen(NamedTuple):
    """Steps of a path, stacked along the first axis.

    Attributes
    ----------
    change : (m, n) increments of the unknowns
    memory : what the step leaves
    slip_work : work of friction
    error : largest out-of-balance force over mu F_N L, by the assembled stiffness
    solves : guesses it took
    settled : whether the last one was right
    """

    change: Array
    memory: Memory
    slip_work: Array
    error: Array
    solves: Array
    settled: Array


class LinearStrip(NamedTuple):
    """A system with what is constant in it.

    Attributes
    ----------
    system : its arrays may have lanes behind their nodes
    band : its stiffness with friction
    pull : m fields' parts in the displacement of the loaded end
    press : m entries (n,) of the whole pressure, as residuals
    pressed : (m, n) change of the unknowns by the whole pressure without friction
    """

    system: System
    band: Band
    pull: list[Array]
    press: list[Array]
    pressed: Array


class Foresight(Newton):
    """Takes what is foreseen for the answer where it can be; derivatives do not pass.

    It is for runs whose failures are walked again with Newton's method, which is only compiled
    then.

    Attributes
    ----------
    checked : whether the answer's residual is evaluated like any other; else by the assembled
        stiffness
    """

    checked: bool = eqx.field(static=True, default=True)

    @classmethod
    def of(cls, solver: Newton | None, *, checked: bool) -> Foresight:
        """With the settings of a solver."""
        return cls(**(vars(solver or Newton()) | {"checked": checked}))


def applies(scene: Scene) -> bool:
    """Whether only the statuses of sharp sliders make a scene's steps nonlinear."""
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


def foresee(system: System, start: Any, path: Any) -> Foreseen:
    """Walk a load path.  Derivatives do not pass.

    Parameters
    ----------
    system : of a scene to which this `applies`
    start, path : `stepping.PathState` and `load_path.LoadPath`
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
    found: Foreseen = follow(*lax.stop_gradient(given))
    return found


def known(system: System) -> LinearStrip:
    """What is constant in a system.  Derivatives do not pass."""
    return _known(*lax.stop_gradient((system, *_parts(system))))


def memory_of(state: Any) -> Memory:
    """Memory of a `stepping.PathState` for the next step.  Derivatives do not pass."""
    level = state.level
    memory = Memory(
        level.traction, level.cap, level.reaction, state.target, state.pressure, state.turn
    )
    return lax.stop_gradient(memory)


def _parts(system: System) -> tuple[Array, Array, Array]:
    """Stiffness of the section, fields' part in the end's displacement, forces of the pressure."""
    rest = system.unloaded().q
    pull = jax.grad(system.end_displacement)(rest)[-1]
    return system.section_stiffness(), pull, jax.grad(system.sinking)(rest)


def _known(system: System, section: Array, pull: Array, press: Array) -> LinearStrip:
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
) -> Foreseen:
    strip = _known(system, section, pull, press)

    def go(memory: Memory, to: Any) -> tuple[Memory, Foreseen]:
        found = step(strip, memory, to)
        return found.memory, found

    found: Foreseen = lax.scan(go, start, path)[1]
    return found


def step(strip: LinearStrip, memory: Memory, to: Any) -> Foreseen:
    """One load step.

    Parameters
    ----------
    strip : what is loaded
    memory : of the step before
    to : has the target, the pressure and the roughness of this one
    """
    system = strip.system
    rubs, turn = to.rough > 0.0, last_reversal(system, memory, to)
    further = to.pressure - memory.pressure
    net = (system.load - system.bottom_load) / system.tributary
    given = memory.reaction + further * net
    load = [-further * each for each in strip.press]
    slips = first_to_slip(system, turn, to.target)
    drawn = to.target - memory.target
    found = _settle(strip, memory.traction, given, drawn, load, slips, rubs)
    change = jnp.where(rubs, found.change, further * strip.pressed)
    reaction = given + times(strip.band.normal, [*change])
    cap = system.foundation.cap(reaction)
    slid = system.foundation.friction_law.traction(
        change[V], memory.traction, cap, system.foundation.slip_stiffness
    )
    traction = jnp.where(found.closed & rubs, slid, 0.0)
    work = system.tributary * system.foundation.friction_law.slip_work(
        change[V], memory.traction, traction, memory.cap, cap, system.foundation.slip_stiffness
    )
    pressed = system.foundation.has_friction(jnp.maximum(memory.cap, cap))
    return Foreseen(
        change,
        Memory(traction, cap, reaction, to.target, to.pressure, turn),
        jnp.where(rubs, jnp.sum(jnp.where(pressed, work, 0.0), axis=0), 0.0),
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
    """Find who sticks and who slips in a step.

    Parameters
    ----------
    strip : what is loaded
    traction, given : (n,) friction before the step, and R but for what the step adds
    drawn : the step of the controlled load
    load : m entries (n,) of the step's other forces, as residuals
    slips : (n,) a first guess
    rough : whether there is friction; if not, nothing is done
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
        # A node that slips may stick next, but not slip back: else the search goes in circles.
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
    """The equations with the step of the controlled load at the loaded end."""
    system, last = strip.system, node(strip.system.x, -1)
    scales = [system.residual_scale(i) for i in system.model.active]
    forces = [scale * pull for scale, pull in zip(scales, strip.pull, strict=True)]
    if system.control == "force":
        ends = [jnp.where(last, force * drawn, 0.0) for force in forces]
        return rows, [r + end for r, end in zip(right, ends, strict=True)]
    # The balance along v says what the force is, for the other rows; its own says u(L).
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
