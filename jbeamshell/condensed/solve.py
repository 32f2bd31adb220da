"""Load paths of a strip on its contact line, exact in time: a scene in, a history out."""

from __future__ import annotations

import functools
import math
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.checks import is_staged, is_traced, require
from jbeamshell.common.errors import Status
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.precision import in_double, is_single
from jbeamshell.common.small import Small
from jbeamshell.condensed.above import Movement, Unread
from jbeamshell.condensed.bearings import bearing_energy, with_bearings, with_gaps
from jbeamshell.condensed.branches import pressed
from jbeamshell.condensed.drives import (
    driven_by_displacement,
    exchanged,
    spring_energy,
    with_springs,
)
from jbeamshell.condensed.entry import goes_on
from jbeamshell.condensed.events import walk
from jbeamshell.condensed.kept import kept
from jbeamshell.condensed.levels import Turns, levels, nested_levels, turns_of
from jbeamshell.condensed.stretch import Level
from jbeamshell.condensed.strip import Strip, condensed, spring_stiffness, stays_flat
from jbeamshell.history.history import History
from jbeamshell.scene.load_path import LoadPath
from jbeamshell.scene.parts import Load
from jbeamshell.scene.rungs import general_rung
from jbeamshell.scene.scene import Scene

Cycles = tuple[tuple[int, int, int], ...]
Search = Literal["events", "near events", "either"]
LIFTING = 0.125  # of the nodes, that most often lift off at the loaded end
NESTED_FROM = 6  # order of a section from which on no point reaction disturbs the corner's slip


def solve(
    scene: Scene,
    path: LoadPath,
    cycles: Cycles,
    *,
    by: Search = "events",
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
    scene : scene on a condensed rung; may be traced
    path, cycles : whole path of the scene and its closed cycles, see
        `jbeamshell.scene.load_path.check`
    by : "events" walks any path event by event.  "near events" does so while only nodes near the
        loaded end lift off, and marks other steps unconverged.  "either" takes factors where slip
        zones are nested, and events elsewhere: derivatives of factors are ten times as quick
    own : True if the loads are the scene's own cycles, whose turns are always known
    strip : the scene's strip, if it is known

    Returns
    -------
    History
        fields v, w, beta and psi, and those of a section of order p; of plane elasticity beta and
        psi are means over the height; NaN from the first step on whose events come to no end

    Raises
    ------
    InputError
        if the pressures lift the strip or change along the path, or if loads act on a strip without
        a foundation
    """
    now = is_traced(scene, path, strip) or is_staged() or is_single(scene)
    return _solved(scene, path, cycles, by, own, strip, now)


@in_double
def _solved(
    scene: Scene,
    path: LoadPath,
    cycles: Cycles,
    by: Search,
    own: bool,
    strip: Strip | None,
    now: bool,
) -> History:
    """History, whose fields above the contact are found now or when they are read."""
    before = scene.load.pressure_steps
    whole = is_traced(path.pressure) or bool(np.all(np.asarray(path.pressure)[before:] == 1.0))
    rung = scene.model.rung
    fix = f"must act wholly for model.rung = {rung}: take {general_rung(rung)} to change them"
    require("path", "pressures", whole, fix)
    targets = path.target[before:]
    base = scene.contact.normal == "rigid" or not targets.size
    fix = f"leaves {rung} nothing but the pressures: set load.cycles = 0, or take "
    fix += general_rung(rung)
    require("contact.normal", scene.contact.normal, base, fix)
    turns = _turns(scene, targets, own)
    strip = strip_of(scene) if strip is None else strip
    if not is_traced(strip.lift):
        down = bool(np.all(np.isfinite(np.asarray(strip.lift))))
        fix = f"must press the strip down for model.rung = {rung}"
        require("contact.pressure", scene.contact.pressure, down, fix)
    known = isinstance(turns, tuple)
    given = (scene, strip, targets, () if known else turns)
    history, movement = _walk(given, turns if known else (), cycles, by)
    above = Unread(strip, movement)
    found: History = history.but(scene=scene, above=above.found if now else above)
    return found


def quickest(scene: Scene) -> Search:
    """Search that most often is the quickest for a scene's cycles.

    Many nodes of plane elasticity lift off, those under a member that goes on, and those of a lap
    joint at both ends.  So do elastic sliders, whose grid is fine where a strip lifts off.
    """
    warps = scene.model.solution == "plane" or scene.model.order >= NESTED_FROM
    any_may_lift = warps or goes_on(scene) or scene.member.support != "none"
    any_may_lift = any_may_lift or scene.contact.stick_stiffness is not None
    return "events" if any_may_lift else "near events"


def to_differentiate(scene: Scene) -> Search:
    """Search whose derivatives are the quickest.

    Slip zones are nested where no point reaction at the loaded corner slips and opens out of turn,
    as that of sections of low order and that of a rigid face do, and the edge of the contact under
    a member that goes on.
    """
    warps = scene.model.solution == "plane" or scene.model.order >= NESTED_FROM
    nested = warps and scene.load.entry == "traction" and scene.member.support == "none"
    return "either" if nested else "events"


def _turns(scene: Scene, targets: Array, own: bool) -> Turns:
    """True for each level before which the load has turned; an array if the loads are traced."""
    if own:
        return _turns_of_cycles(scene.load.cycles, scene.load.steps_per_half_cycle)
    return turns_of(targets) if is_traced(targets) else _known_turns(np.asarray(targets))


@functools.cache
def _turns_of_cycles(cycles: int, steps: int) -> tuple[bool, ...]:
    return _known_turns(Load(cycles=cycles, steps_per_half_cycle=steps).unit_path())


def _known_turns(loads: np.ndarray) -> tuple[bool, ...]:
    """Turns as `turns_of` finds them: where a load rests, the step that leaves it has turned."""
    turns = np.zeros(loads.size, bool)
    moves = np.sign(np.diff(loads, prepend=0.0))
    moving = np.flatnonzero(moves)
    turns[moving[np.diff(moves[moving], prepend=0.0) != 0.0]] = True
    turns[:1] = True
    return tuple(turns.tolist())


@kept
@Small
def strip_of(scene: Scene) -> Strip:
    """Strip of a scene on its contact line."""
    strip = condensed(scene, scene.model.nodes)
    no_masses = strip.form.masses[:0]  # of no use without inertia, and slow to compile
    return strip._replace(form=strip.form._replace(masses=no_masses))


@Small
def _walk(
    given: tuple[Scene, Strip, Array, Turns],
    known: tuple[bool, ...],
    cycles: Cycles,
    by: Search,
) -> tuple[History, Movement]:
    """History of a strip pressed down and loaded along targets; see `solve`.

    It is without its scene and the fields above the contact, which follow from the movement.

    Parameters
    ----------
    given : scene, its strip, loads after the pressing, and the turns before them if traced, else ()
    known : turns if they are known
    """
    scene, strip, targets, traced = given
    turns = known if isinstance(traced, tuple) else traced
    found = _levels(scene, strip, targets, turns, by)
    history, movement = _history(scene, strip, found, cycles)
    return history.but(scene=None), movement  # its numbers would be copied


def _levels(scene: Scene, strip: Strip, targets: Array, turns: Turns, by: Search) -> Level:
    """Levels after the pressing; the last contact nodes are bearings, if the scene has any."""
    body, contact, friction = strip.body, scene.contact, scene.contact.friction
    lift, bearing = strip.lift, contact.bearing_stiffness
    if bearing is not None:
        share = (strip.load / jnp.sum(strip.load))[::-1]
        body = with_bearings(body, bearing, share)
        lift = with_gaps(lift, 0.0 if contact.clearance is None else contact.clearance)
    soft = contact.stick_stiffness is not None
    if soft:
        body, springs = with_springs(body, spring_stiffness(scene, strip))
    if scene.load.control == "displacement":
        body = driven_by_displacement(body)
    start = pressed(body)
    if not targets.size:
        found, sound = nested_levels(body, friction, start, targets, turns)
    else:
        # Factors overflow in single precision.
        flat = None if stays_flat(scene) else lift
        if by == "either" and bearing is None and body.f_t.dtype == np.float64:
            found = levels(body, friction, start, targets, turns, flat)
        else:
            lifting = math.ceil(LIFTING * strip.x.size) if by == "near events" else None
            alike = not goes_on(scene)  # the edge of the contact opens at other events at each load
            loads = body, friction, start, targets, turns, flat
            found = walk(*loads, lifting=lifting, alike=alike)
        sound = jnp.all(jnp.isfinite(strip.lift))
    state = found.state
    if scene.load.control == "displacement":
        state = jax.vmap(exchanged)(state)
    if soft:
        risen = found.lift - lift
        state = state._replace(v=jax.vmap(springs.slip)(state.v, risen, state.force))
    return found._replace(state=state, settled=found.settled & sound)


def _history(scene: Scene, strip: Strip, levels: Level, cycles: Cycles) -> tuple[History, Movement]:
    """History of the levels after the pressing, whose steps come first, and the movement."""
    body, state = strip.body, levels.state
    before = scene.load.pressure_steps
    n, k, steps = strip.x.size, body.f_t.size, before + state.force.size
    part = jnp.asarray(np.minimum(np.arange(1, steps + 1) / before, 1.0), state.force.dtype)
    pressing = part[:, None] * (np.arange(steps) < before)[:, None]  # zero at the levels

    def along(values: Array) -> Array:  # (levels, n or k) to (steps, n) from the far end
        return jnp.pad(values[:, ::-1], ((before, 0), (n - values.shape[1], 0)))

    def every(values: Array) -> Array:
        return jnp.pad(values, (before, 0))

    settled, held = (jnp.pad(each[::-1], (n - k, 0)) for each in (strip.settled, body.t_0))
    driven = state.displacement if scene.load.control == "displacement" else state.force
    risen = along(levels.lift[:, :n] - strip.lift)
    w = risen + part[:, None] * strip.lift[::-1]
    force = every(state.force)
    # The pressed strip, and what the load adds to it.
    at_rest = jnp.stack([settled, strip.lift[::-1]], axis=1).ravel()
    at_rest = jnp.concatenate([at_rest, jnp.array([0.0, 1.0])])
    change = jnp.stack([along(state.v), risen], axis=2).reshape(steps, 2 * n)
    change = jnp.pad(jnp.concatenate([change, force[:, None]], axis=1), ((0, 0), (0, 1)))
    reaction = along(state.r_n[:, :n]) / strip.tributary
    reaction = reaction + pressing * body.r_0[::-1] / strip.tributary
    traction = -along(state.r_t) / strip.tributary
    traction = traction - pressing * held / strip.tributary
    slipping = along(levels.slipping).astype(bool)
    # Conjugate to v and w, minus the end load, and the pressure.
    resting, added = at_rest @ strip.pressed.hessian, change @ strip.loaded.hessian
    energy = 0.5 * part**2 * (resting @ at_rest) + change[:, :-2] @ resting[:-2]
    energy = energy + 0.5 * jnp.sum(added * change, axis=1) - added[:, -2] * force
    sinking = part * resting[-1] + added[:, -1]
    if scene.contact.stick_stiffness is not None:
        energy = energy + every(spring_energy(spring_stiffness(scene, strip), state.r_t))
    if scene.contact.bearing_stiffness is not None:
        energy = energy + every(bearing_energy(scene.contact.bearing_stiffness, state.r_n[:, n:]))
    status = jnp.where(levels.settled, Status.CONVERGED, Status.MAX_ITERATIONS)
    sound = jnp.append(jnp.ones(before, bool), levels.settled)

    def masked(values: Array) -> Array:
        return nan_unless(sound, values)

    movement = Movement(at_rest, change, part, sound)
    history = History(
        scene=scene,
        x=strip.x,
        middles=0.5 * (strip.x[1:] + strip.x[:-1]),
        tributary=strip.tributary,
        load=strip.load,
        force=masked(force),
        displacement=masked(every(state.displacement)),
        contact_v=masked(part[:, None] * at_rest[:-2:2] + change[:, :-2:2]),
        above=None,
        gap=masked(w),
        traction=masked(traction),
        reaction=masked(reaction),
        slipping=slipping,
        slip_work=masked(every(levels.slip_work)),
        stored_energy=masked(energy),
        pressure=part,
        sinking=masked(sinking),
        iterations=jnp.zeros(part.size, int),
        error=jnp.zeros(part.size),
        status=jnp.append(jnp.full(before, Status.CONVERGED), status),
        cycles=cycles,
        target=masked(every(driven)),
    )
    return history, movement
