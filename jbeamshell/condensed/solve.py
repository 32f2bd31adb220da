"""Load paths of plane elasticity, exact in time: a scene in, a history out."""

from __future__ import annotations

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require, require_count
from jbeamshell.common.errors import Status, UnconvergedError
from jbeamshell.condensed.branches import pressed
from jbeamshell.condensed.events import Level, walk
from jbeamshell.condensed.strip import NODES, Strip, condensed
from jbeamshell.history.history import History
from jbeamshell.mechanics.friction import SharpSlip
from jbeamshell.mechanics.kinematics import Strains
from jbeamshell.numerics.cycles import closed_cycles, turning_points
from jbeamshell.scene.domain import gross_slip_rule
from jbeamshell.scene.scene import Scene

LIFTING = ("v", "w", "beta", "psi")


def solve(
    scene: Scene, loads: ArrayLike | None = None, *, nodes: int = NODES, throw: bool = True
) -> History:
    """Press a strip of plane elasticity down, walk a load path, and report what happened.

    The strip, its contact and its loads are the scene's; its model, its grid and its elastic slip
    are not used.  The strip is plane and linear, friction is Coulomb's without elastic slip, and
    contact is unilateral.  Between the events at which a node starts to slip, sticks, opens or
    closes everything is linear in the load, so that load steps only say where the path is looked
    at.  Singular stresses at the loaded corner are resolved to 1e-5 H.

    Parameters
    ----------
    scene : strip on a rigid foundation under force control, straight, pressed everywhere
    loads : (steps,) end loads after the pressing; None is the scene's own cycles
    nodes : contact nodes; 129 are within 1 % of the dissipation of converged finite elements where
        it exceeds a tenth of the bar's cubic law
    throw : True to raise where a step finds no equilibrium

    Returns
    -------
    History
        fields v, w, beta (mean rotation of the section) and psi (mean squeeze strain)

    Raises
    ------
    InputError
        if the scene is outside of what is named above, or the loads exceed gross slip
    UnconvergedError
        if the events of a load step come to no end

    Examples
    --------
    >>> history = jb.condensed.solve(jb.Scene().replace({"load.amplitude": 1.0}))
    >>> float(history.dissipation_ratio)
    """
    check(scene)
    require_count("nodes", nodes, 9)
    targets = np.asarray(scene.load.amplitude) * scene.load.unit_path() if loads is None else loads
    targets = np.asarray(targets, dtype=float)
    require("loads", targets.shape, targets.ndim == 1, "give (steps,) end loads")
    require("loads", targets, bool(np.all(np.isfinite(targets))), "must be finite")
    gross_slip_rule(scene.load, scene.number, targets).demand()
    turns = np.zeros(targets.size, bool)
    turns[turning_points(np.append(0.0, targets))[:-1]] = True
    strip = _strip(scene, nodes)
    pressing = bool(np.all(np.asarray(strip.body.r_0) > 0.0))
    fix = "must press the strip down everywhere for the condensed contact"
    require("contact.pressure", scene.contact.pressure, pressing, fix)
    levels = _walk(strip, scene.contact.friction, jnp.asarray(targets), jnp.asarray(turns))
    model = {"model.kinematics": "linear", "model.rung": "squeeze", "model.fields": LIFTING}
    solved = scene.replace(model)
    history = _history(solved, strip, levels, jnp.asarray(targets))
    first = scene.load.pressure_steps - 1
    cycles = closed_cycles(np.append(0.0, targets)) if targets.size else ()
    cycles = tuple((a + first, b + first, c + first) for a, b, c in cycles)
    settled = np.asarray(levels.settled)
    if throw and not settled.all():
        number = int(np.argmin(settled))
        raise UnconvergedError(
            f"load step {number + first + 1} (load {targets[number]:.6g}): its events come to no "
            "end; take other nodes, or model.rung = p6 with the general solver"
        )
    return dataclasses.replace(history, cycles=cycles)


def check(scene: Scene) -> None:
    """Raise `InputError` for a scene outside of what `solve` covers."""
    require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
    strip, contact, load = scene.strip, scene.contact, scene.load
    plain = not is_traced(scene)
    require("scene", "traced", plain, "give plain numbers, or take condensed.dissipation")
    straight = strip.curvature is None
    require("strip.curvature", strip.curvature, straight, "must be left out: plane strips are flat")
    require(
        "energy", scene.energy, scene.energy is None, "must be left out: elasticity has its own"
    )
    sharp = isinstance(contact.law, SharpSlip)
    require("contact.law", contact.law, sharp, "must be the sharp slider for the condensed contact")
    rigid = contact.normal == "rigid"
    require("contact.normal", contact.normal, rigid, "must be 'rigid' for the condensed contact")
    force = load.control == "force"
    require("load.control", load.control, force, "must be 'force' for the condensed contact")


@eqx.filter_jit
def _strip(scene: Scene, nodes: int) -> Strip:
    return condensed(scene, nodes)


@jax.jit
def _walk(strip: Strip, friction: Array, targets: Array, turns: Array) -> Level:
    return walk(strip.body, friction, pressed(strip.body), targets, turns)


@eqx.filter_jit
def _history(scene: Scene, strip: Strip, levels: Level, targets: Array) -> History:
    """History of the levels after the pressing, whose steps come first."""
    body, state = strip.body, levels.state
    before = scene.load.pressure_steps
    part = jnp.append(jnp.arange(1, before + 1) / before, jnp.ones_like(targets))
    n, k = strip.x.size, body.f_t.size

    def along(values: Array) -> Array:  # (levels, n or k) to (steps, n) from the far end
        return jnp.pad(values[:, ::-1], ((before, 0), (n - values.shape[1], 0)))

    def every(values: Array) -> Array:
        return jnp.pad(values, (before, 0))

    settled = jnp.pad(strip.settled[::-1], (n - k, 0))
    slip, w, force = along(state.v), along(levels.lift), every(state.force)
    v = slip + part[:, None] * settled
    given = jnp.zeros((part.size, 2 * n + 2)).at[:, 0:-2:2].set(v).at[:, 1:-2:2].set(w)
    given = given.at[:, -2].set(force).at[:, -1].set(part)
    inner = jnp.moveaxis(strip.elimination.recovered(given.T), 2, 0)  # (steps, n, m-2)
    fields = jnp.concatenate([v[..., None], w[..., None], inner], axis=-1)
    means = fields @ strip.form.means.T
    reaction = along(state.r_n) / strip.tributary
    reaction = reaction.at[:before].set(part[:before, None] * body.r_0[::-1] / strip.tributary)
    slipping = along(levels.slipping).astype(bool)
    forces = given @ strip.hessian  # conjugate to v, w, minus the end load and the pressure
    energy = 0.5 * jnp.sum(forces * given, axis=1) - forces[:, -2] * given[:, -2]
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
        fields=masked(jnp.concatenate([v[..., None], w[..., None], means], axis=-1)),
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
        cycles=(),
        target=every(targets),
    )


def _section_forces(strip: Strip, fields: Array) -> Strains:
    """N, Q, M, chi and xi of every element, (steps, elements) each."""
    form = strip.form
    mean = 0.5 * (fields[:, 1:] + fields[:, :-1])
    slope = jnp.diff(fields, axis=1) / jnp.diff(strip.x)[:, None]
    on_values = mean @ form.values.T + slope @ form.mixed.T
    on_slopes = mean @ form.mixed + slope @ form.slopes.T
    return Strains(*(on_values @ mode[0] + on_slopes @ mode[1] for mode in form.modes))
