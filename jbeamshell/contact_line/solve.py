"""Load paths of a strip on its contact line, exact in time: a scene in, a history out."""

from __future__ import annotations

import functools
from typing import Any

import jax
import numpy as np
from jax import Array

from jbeamshell.common.checks import is_staged, is_traced, require
from jbeamshell.common.errors import Status
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.numbers_of import numbers_of, pad, put
from jbeamshell.common.precision import doubled, is_single, rounded
from jbeamshell.common.small import Small
from jbeamshell.contact_line import native
from jbeamshell.contact_line.above import Movement, Unread
from jbeamshell.contact_line.bearings import bearing_energy, with_bearings, with_gaps
from jbeamshell.contact_line.contact_state import ContactState, pressed
from jbeamshell.contact_line.drives import (
    driven_by_displacement,
    exchanged,
    spring_energy,
    with_springs,
)
from jbeamshell.contact_line.kept import alike, alike_but_pressures, kept
from jbeamshell.contact_line.pressures import Press, walk_with_pressures
from jbeamshell.contact_line.strip import (
    Strip,
    Unpressed,
    spring_stiffness,
    stays_flat,
    unpressed,
)
from jbeamshell.contact_line.strip import pressed as pressed_strip
from jbeamshell.contact_line.turns import Turns, known_turns, turns_of, turns_of_cycles
from jbeamshell.contact_line.walk import Level, walk
from jbeamshell.history.history import History
from jbeamshell.scene.load_path import LoadPath
from jbeamshell.scene.scene import Scene

Cycles = tuple[tuple[int, int, int], ...]


def solve(
    scene: Scene,
    path: LoadPath,
    cycles: Cycles,
    *,
    own: bool = True,
    strip: Strip | None = None,
) -> History:
    """Press a strip down and walk a load path.

    Between the events at which a node starts to slip, sticks, opens or closes everything is linear
    in the load, so that load steps only say where the path is looked at.  Friction is Coulomb's,
    without elastic slip unless contact.stick_stiffness is given; contact is unilateral.
    Nodes are those of the load steps of the same section; plane elasticity resolves singular
    stresses at the loaded corner to 1e-4 H.  Fields above the contact are found when they are read
    first, because that takes twice as long as the walk.

    Parameters
    ----------
    scene : scene that is solved on its contact line; may be traced
    path, cycles : whole path of the scene and its closed cycles, see
        `jbeamshell.scene.load_path.check`
    own : True if the loads are the scene's own cycles, whose turns are always known
    strip : the scene's strip, if it is known

    Returns
    -------
    History
        fields v, w, beta and psi; of plane elasticity beta and psi are means over the height; NaN
        from the first step on whose events come to no end

    Raises
    ------
    InputError
        if the pressures lift the strip, or change along the path beside elastic sliders or a
        gap, or if loads act on a strip without a foundation
    """
    if is_traced(scene, path, strip) or is_staged():
        history, above = _solved(scene, path, cycles, own, strip)
        return history.but(scene=scene, above=above.found)
    single = is_single(scene)
    with jax.enable_x64(True):
        precise, loads = doubled(scene), doubled(path)
        history, above = _solved(precise, loads, cycles, own, doubled(strip))
        # Arrays of NumPy make figures and doubts ten times as quick as those of JAX.
        history = jax.device_get(history)
    history = rounded(history) if single else history
    return history.but(scene=scene, above=above.but(single=single))


def walks_pressures(scene: Scene) -> bool:
    """True if pressures that change along a path are walked on the contact line.

    Elastic sliders and a gap between two members would have to move with them.
    """
    return scene.member.gap is None and scene.contact.stick_stiffness is None


def _solved(
    scene: Scene, path: LoadPath, cycles: Cycles, own: bool, strip: Strip | None
) -> tuple[History, Unread]:
    """History without its scene, and its fields above the contact, which nobody has read."""
    before = scene.load.pressure_steps
    targets, parts = path.target[before:], path.pressure[before:]
    whole = not is_traced(parts) and bool(np.all(np.asarray(parts) == 1.0))
    fix = "must act wholly beside elastic sliders or a gap: leave these out, or take load steps "
    fix += "(by='steps') of another section than plane"
    require("path", "pressures", whole or walks_pressures(scene), fix)
    base = scene.contact.normal == "rigid" or not targets.size
    fix = "leaves plane elasticity nothing but the pressures: set load.cycles = 0, or take another "
    fix += "model.section"
    require("contact.normal", scene.contact.normal, base, fix)
    turns = _turns(scene, targets, own) if whole else ()
    same = scene.in_one_form()
    strip = strip_of(same) if strip is None else strip
    if not is_traced(strip.lift):
        down = bool(np.all(np.isfinite(np.asarray(strip.lift))))
        fix = f"must press the strip down for model.section = {scene.plan.section}"
        require("contact.pressure", scene.contact.pressure, down, fix)
    known_turns, traced = (turns, ()) if isinstance(turns, tuple) else ((), turns)
    inputs = same, strip, targets, None if whole else parts, traced
    history, movement = _walk(inputs, known_turns, cycles)
    return history, Unread(strip, movement)


def _turns(scene: Scene, targets: Array, own: bool) -> Turns:
    """True for each level before which the load has turned; an array if the loads are traced."""
    if own:
        return turns_of_cycles(scene.load.cycles, scene.plan.steps)
    return turns_of(targets) if is_traced(targets) else known_turns(np.asarray(targets))


def _unpressed(scene: Scene) -> Unpressed:
    """Strip of a scene on its contact line, condensed for pressures of any size."""
    strip = _condensed(scene)
    # What follows compiles nothing for arrays of NumPy.
    return strip if is_traced(strip) or is_staged() else jax.device_get(strip)


@functools.partial(Small, level=0, by_numpy=lambda scene: scene.plan.elastic)
def _condensed(scene: Scene) -> Unpressed:
    """Strip of a scene on its contact line, condensed for pressures of any size."""
    strip = unpressed(scene, scene.plan.nodes)
    no_masses = strip.form.masses[:0]  # of no use without inertia, and slow to compile
    return strip._replace(form=strip.form._replace(masses=no_masses))


def _is_quick(inputs: tuple[Any, ...]) -> bool:
    """True if NumPy presses and walks a strip: what walks in JAX has to be compiled."""
    _, _, *path = inputs
    return native.library() is not None and (not path or path[1] is None)


@functools.partial(Small, by_numpy=_is_quick)
def _pressed(inputs: tuple[Scene, Unpressed]) -> Strip:
    """Strip of a scene, pressed down."""
    return pressed_strip(*inputs)


unpressed_of = kept(_unpressed, alike_but_pressures)


def _strip_of(scene: Scene) -> Strip:
    """Strip of a scene on its contact line."""
    strip = unpressed_of(scene)
    # What finds the fields above the contact is large, and goes past the program.
    return _pressed((scene, strip.of_contact)).recovered_by(strip, scene)


strip_of = kept(_strip_of, alike)


@functools.partial(Small, by_numpy=_is_quick)
def _walk(
    inputs: tuple[Scene, Strip, Array, Array | None, Turns],
    known_turns: tuple[bool, ...],
    cycles: Cycles,
) -> tuple[History, Movement]:
    """History of a strip pressed down and loaded along targets; see `solve`.

    It is without its scene and the fields above the contact, which follow from the movement.

    Parameters
    ----------
    inputs : scene, its strip, loads after the pressing, parts of the pressures then if they change,
        else None, and the turns before the loads if traced, else ()
    known_turns : turns if they are known
    """
    scene, strip, targets, parts, traced = inputs
    turns = known_turns if isinstance(traced, tuple) else traced
    levels = _levels(scene, strip, targets, parts, turns)
    history, movement = _history(scene, strip, levels, parts, cycles)
    return history.but(scene=None), movement  # its numbers would be copied


def _levels(scene: Scene, strip: Strip, targets: Array, parts: Array | None, turns: Turns) -> Level:
    """Levels after the pressing; the last contact nodes are bearings, if the scene has any."""
    xp = numbers_of(scene, strip, targets)
    body, friction, member = strip.body, scene.contact.friction, scene.member
    lift, bearing = strip.lift, member.bearing_stiffness
    if bearing is not None:
        share = (strip.load / xp.sum(strip.load))[::-1]
        body = with_bearings(body, bearing, share)
        lift = with_gaps(lift, 0.0 if member.clearance is None else member.clearance)
    soft = scene.contact.stick_stiffness is not None
    if soft:
        body, springs = with_springs(body, spring_stiffness(scene, strip))
    by_displacement = scene.load.control == "displacement"
    if by_displacement:
        body = driven_by_displacement(body)
    start = pressed(body)
    # The pressures squeeze an even strip flat.
    flat = None if stays_flat(scene) else lift
    if not targets.size:
        none = Level(start, lift, start.force, start.v > 0.0, start.force >= 0.0)
        levels = jax.tree.map(lambda a: xp.zeros((0, *xp.shape(a)), a.dtype), none)
    elif parts is not None:
        press = Press.of(strip.loaded.hessian, body.f_t.size, body.f_n.size - strip.x.size)
        press = press.driven_by_displacement(body) if by_displacement else press
        levels = walk_with_pressures(body, press, friction, start, targets, parts, flat)
    else:
        levels = walk(body, friction, start, targets, turns, flat)
    sound = xp.all(xp.isfinite(strip.lift))
    state = levels.state
    if by_displacement:
        state = exchanged(state)
    if soft:
        rise = levels.lift - lift
        state = state._replace(v=springs.slip(state.v, rise, state.force))
    return levels._replace(state=state, settled=levels.settled & sound)


def _history(
    scene: Scene, strip: Strip, levels: Level, parts: Array | None, cycles: Cycles
) -> tuple[History, Movement]:
    """History of the levels after the pressing, whose steps come first, and the movement.

    Parameters
    ----------
    parts : parts (levels,) of the pressures that act; None is all of them
    """
    xp, before, state = numbers_of(levels.slip_work), scene.load.pressure_steps, levels.state
    steps = before + state.force.size
    part = xp.asarray(np.minimum(np.arange(1, steps + 1) / before, 1.0), state.force.dtype)
    pressure = part if parts is None else xp.append(part[:before], parts)
    sound = xp.append(xp.ones(before, bool), levels.settled)
    movement = _movement(strip, levels, part, pressure, sound)
    energy, sinking = _energy(scene, strip, movement, state)
    traction, reaction = _on_base(strip, state, part[:before])
    moved = part[:, None] * movement.at_rest + movement.change
    driven = state.displacement if scene.load.control == "displacement" else state.force
    status = xp.where(sound, Status.CONVERGED, Status.MAX_ITERATIONS)

    def every(values: Array) -> Array:
        return pad(values, (before, 0))

    def masked(values: Array) -> Array:
        return nan_unless(sound, values)

    history = History(
        scene=scene,
        x=strip.x,
        middles=0.5 * (strip.x[1:] + strip.x[:-1]),
        tributary=strip.tributary,
        load=strip.load,
        force=masked(every(state.force)),
        displacement=masked(every(state.displacement)),
        contact_v=masked(moved[:, :-2:2]),
        above=None,
        gap=masked(moved[:, 1:-2:2]),
        traction=masked(traction),
        reaction=masked(reaction),
        slipping=_along(levels.slipping, strip.x.size, before),
        slip_work=masked(every(levels.slip_work)),
        stored_energy=masked(energy),
        pressure=pressure,
        sinking=masked(sinking),
        iterations=xp.zeros(part.size, int),
        error=xp.zeros(part.size),
        status=status,
        cycles=cycles,
        target=masked(every(driven)),
    )
    return history, movement


def _along(values: Array, nodes: int, before: int) -> Array:
    """Values (levels, k) as (before + levels, nodes) from the far end, zero before the levels."""
    found: Array = pad(values[:, ::-1], (before, 0), (nodes - values.shape[1], 0))
    return found


def _movement(strip: Strip, levels: Level, part: Array, pressure: Array, sound: Array) -> Movement:
    """Movement of the strip as it is pressed, and what the levels add to it.

    Parameters
    ----------
    part : (steps,) part of the pressures that presses the strip down, 1 at the levels
    pressure : (steps,) part of the pressures that acts
    sound : (steps,) False from the first step on that has no equilibrium
    """
    xp, n, before = numbers_of(part), strip.x.size, part.size - levels.settled.size
    settled = _along(strip.settled[None], n, 0)[0]
    at_rest = xp.append(xp.stack([settled, strip.lift[::-1]], axis=1), xp.array([0.0, 1.0]))
    slip, rise = (
        _along(values, n, before) for values in (levels.state.v, levels.lift[:, :n] - strip.lift)
    )
    change = xp.stack([slip, rise], axis=2).reshape(part.size, 2 * n)
    force = pad(levels.state.force, (before, 0))
    change = xp.column_stack([change, force, pressure - part])
    return Movement(at_rest, change, part, sound)


def _energy(
    scene: Scene, strip: Strip, movement: Movement, state: ContactState
) -> tuple[Array, Array]:
    """Stored energy (steps,) with the potential of the pressures, and their sinking."""
    at_rest, change, part, _ = movement
    xp, n, before = numbers_of(change), strip.x.size, part.size - state.force.size
    # Conjugate to v and w, minus the end load, and the pressure.
    resting, added = at_rest @ strip.pressed.hessian, change @ strip.loaded.hessian
    energy = 0.5 * part**2 * (resting @ at_rest) + change @ put(resting, -2, 0.0)
    energy = energy + 0.5 * xp.sum(added * change, axis=1) - added[:, -2] * change[:, -2]
    bearing = scene.member.bearing_stiffness
    if scene.contact.stick_stiffness is not None:
        springs = spring_energy(spring_stiffness(scene, strip), state.r_t)
        energy = xp.append(energy[:before], energy[before:] + springs)
    if bearing is not None:
        bearings = bearing_energy(bearing, state.r_n[:, n:])
        energy = xp.append(energy[:before], energy[before:] + bearings)
    return energy, part * resting[-1] + added[:, -1]


def _on_base(strip: Strip, state: ContactState, pressing: Array) -> tuple[Array, Array]:
    """Traction on the strip and reaction of the base (steps, n) from the far end.

    Parameters
    ----------
    pressing : (before,) part of the pressures while they press the strip down
    """
    xp, n, share = numbers_of(state.r_t), strip.x.size, pressing[:, None]
    r_t = xp.concatenate([share * strip.body.t_0, state.r_t])
    r_n = xp.concatenate([share * strip.body.r_0, state.r_n[:, :n]])
    return -_along(r_t, n, 0) / strip.tributary, r_n[:, ::-1] / strip.tributary
