"""Load paths of a strip on its contact line, exact in time: a scene in, a history out."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.errors import Status
from jbeamshell.condensed.branches import pressed
from jbeamshell.condensed.drives import (
    driven_by_displacement,
    exchanged,
    spring_energy,
    with_springs,
)
from jbeamshell.condensed.events import Level
from jbeamshell.condensed.levels import Turns, levels, nested_levels, turns_of
from jbeamshell.condensed.strip import Strip, condensed, spring_stiffness, stays_flat
from jbeamshell.history.history import History
from jbeamshell.mechanics.kinematics import Strains
from jbeamshell.numerics.cycles import turning_points
from jbeamshell.scene.load_path import LoadPath
from jbeamshell.scene.rungs import general_rung
from jbeamshell.scene.scene import Scene

Cycles = tuple[tuple[int, int, int], ...]


def solve(
    scene: Scene, path: LoadPath, cycles: Cycles, *, nested: bool = False, own: bool = True
) -> History:
    """Press a strip down and walk a load path.

    Between the events at which a node starts to slip, sticks, opens or closes everything is linear
    in the load, so that load steps only say where the path is looked at.  Friction is Coulomb's,
    without elastic slip if contact.stick_stiffness is 1000 or more; contact is unilateral.
    Nodes are those of the load steps of the same section; plane elasticity resolves singular
    stresses at the loaded corner to 1e-4 H.

    Parameters
    ----------
    scene : scene on a condensed rung; may be traced
    path, cycles : whole path of the scene and its closed cycles, see
        `jbeamshell.scene.load_path.check`
    nested : True to take factors alone, whose steps are marked unconverged where slip zones are not
        nested; False walks such paths event by event
    own : True if the loads are the scene's own cycles, whose turns are always known

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
    before = scene.load.pressure_steps
    whole = is_traced(path.pressure) or bool(np.all(np.asarray(path.pressure)[before:] == 1.0))
    rung = scene.model.rung
    fix = f"must act wholly for model.rung = {rung}: take {general_rung(rung)} to change them"
    require("path", "pressures", whole, fix)
    targets = jnp.asarray(path.target[before:])
    base = scene.contact.normal == "rigid" or not targets.size
    fix = f"leaves {rung} nothing but the pressures: set load.cycles = 0, or take "
    fix += general_rung(rung)
    require("contact.normal", scene.contact.normal, base, fix)
    turns = _turns(scene, targets, own)
    strip = _strip(scene)
    if not is_traced(strip):
        down = bool(np.all(np.isfinite(np.asarray(strip.lift))))
        fix = f"must press the strip down for model.rung = {rung}"
        require("contact.pressure", scene.contact.pressure, down, fix)
    soft = not scene.ideal_friction
    found = _levels(scene, strip, targets, turns, nested, soft)
    return _history(scene, strip, found, cycles, soft)


def _turns(scene: Scene, targets: Array, own: bool) -> Turns:
    """True for each level before which the load has turned; an array if the loads are traced."""
    known = scene.load.unit_path() if own else targets
    if is_traced(known):
        return turns_of(targets)
    turns = np.zeros(known.size, bool)
    if known.size:
        turns[turning_points(np.append(0.0, known))[:-1]] = True
    return tuple(turns.tolist())


@eqx.filter_jit
def _strip(scene: Scene) -> Strip:
    return condensed(scene, scene.model.nodes)


@eqx.filter_jit
def _levels(
    scene: Scene, strip: Strip, targets: Array, turns: Turns, nested: bool, soft: bool
) -> Level:
    """Levels after the pressing."""
    body, friction = strip.body, scene.contact.friction
    lift = None if stays_flat(scene) else strip.lift
    if soft:
        body, springs = with_springs(body, spring_stiffness(scene, strip))
    if scene.load.control == "displacement":
        body = driven_by_displacement(body)
    if nested or not targets.size:
        found, sound = nested_levels(body, friction, pressed(body), targets, turns)
    else:
        found = levels(body, friction, pressed(body), targets, turns, lift)
        sound = jnp.all(jnp.isfinite(strip.lift))
    state = found.state
    if scene.load.control == "displacement":
        state = jax.vmap(exchanged)(state)
    if soft:
        risen = found.lift - strip.lift
        state = state._replace(v=jax.vmap(springs.slip)(state.v, risen, state.force))
    return found._replace(state=state, settled=found.settled & sound)


@eqx.filter_jit
def _history(scene: Scene, strip: Strip, levels: Level, cycles: Cycles, soft: bool) -> History:
    """History of the levels after the pressing, whose steps come first."""
    body, state = strip.body, levels.state
    before = scene.load.pressure_steps
    part = jnp.append(jnp.arange(1, before + 1) / before, jnp.ones_like(state.force))
    n, k = strip.x.size, body.f_t.size

    def along(values: Array) -> Array:  # (levels, n or k) to (steps, n) from the far end
        return jnp.pad(values[:, ::-1], ((before, 0), (n - values.shape[1], 0)))

    def every(values: Array) -> Array:
        return jnp.pad(values, (before, 0))

    settled = jnp.pad(strip.settled[::-1], (n - k, 0))
    driven = state.displacement if scene.load.control == "displacement" else state.force
    slip, w, force = along(state.v), along(levels.lift), every(state.force)
    w = w.at[:before].set(part[:before, None] * strip.lift[::-1])
    v = slip + part[:, None] * settled
    given = jnp.zeros((part.size, 2 * n + 2)).at[:, 0:-2:2].set(v).at[:, 1:-2:2].set(w)
    given = given.at[:, -2].set(force).at[:, -1].set(part)
    inner = jnp.moveaxis(strip.elimination.recovered(given.T), 2, 0)  # (steps, n, m-2)
    fields = jnp.concatenate([v[..., None], w[..., None], inner], axis=-1)
    further = fields @ strip.form.further.T
    reaction = along(state.r_n) / strip.tributary
    reaction = reaction.at[:before].set(part[:before, None] * body.r_0[::-1] / strip.tributary)
    slipping = along(levels.slipping).astype(bool)
    forces = given @ strip.hessian  # conjugate to v, w, minus the end load and the pressure
    energy = 0.5 * jnp.sum(forces * given, axis=1) - forces[:, -2] * given[:, -2]
    if soft:
        energy = energy + every(spring_energy(spring_stiffness(scene, strip), state.r_t))
    status = jnp.where(levels.settled, Status.CONVERGED, Status.MAX_ITERATIONS)
    sound = jnp.append(jnp.ones(before, bool), levels.settled)

    def masked(values: Array) -> Array:
        return jnp.where(sound.reshape(-1, *[1] * (values.ndim - 1)), values, jnp.nan)

    return History(
        scene=scene,
        x=strip.x,
        middles=0.5 * (strip.x[1:] + strip.x[:-1]),
        tributary=strip.tributary,
        load=strip.load,
        force=masked(force),
        displacement=masked(every(state.displacement)),
        fields=masked(jnp.concatenate([v[..., None], w[..., None], further], axis=-1)),
        gap=masked(w),
        sections=jax.tree.map(masked, _section_forces(strip, fields)),
        traction=masked(-along(state.r_t) / strip.tributary),
        reaction=masked(reaction),
        slipping=slipping,
        slip_work=masked(every(levels.slip_work)),
        stored_energy=masked(energy),
        pressure=part,
        sinking=masked(forces[:, -1]),
        iterations=jnp.zeros(part.size, int),
        error=jnp.zeros(part.size),
        status=jnp.append(jnp.full(before, Status.CONVERGED), status),
        cycles=cycles,
        target=masked(every(driven)),
    )


def _section_forces(strip: Strip, fields: Array) -> Strains:
    """N, Q, M, chi and xi of every element, (steps, elements) each."""
    form = strip.form
    mean = 0.5 * (fields[:, 1:] + fields[:, :-1])
    slope = jnp.diff(fields, axis=1) / jnp.diff(strip.x)[:, None]
    on_values = mean @ form.values.T + slope @ form.mixed.T
    on_slopes = mean @ form.mixed + slope @ form.slopes.T
    return Strains(*(on_values @ mode[0] + on_slopes @ mode[1] for mode in form.modes))
