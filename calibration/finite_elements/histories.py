"""From nodal displacements and contact forces to a `History`, as the beamshell reports it.

Nodes of the history are the columns of nodes of the mesh, those in the middles of quadratic
elements too.  v and w are the displacement of the base's node, w including the contact's
penetration.  Traction and reaction are nodal forces over the lengths that belong to the nodes of
the rigid base, whose shape functions are linear.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from calibration.finite_elements.deck import Penalty, penalty, steps_before
from calibration.finite_elements.mesh import Mesh, nodal_loads
from calibration.finite_elements.results import Printed
from calibration.finite_elements.sections import fitted, section_forces
from jbeamshell.common.errors import Status
from jbeamshell.history.history import History
from jbeamshell.history.record import Above
from jbeamshell.mechanics.kinematics import Strains
from jbeamshell.scene.load_path import LoadPath
from jbeamshell.scene.scene import Scene

SLIDES = 0.99  # of the cap: a node with more traction slips
TENSION = 1e-3  # of the largest nodal force: less is none


class Contact(NamedTuple):
    """The contact of all levels at all nodes, (levels, n) each.

    Attributes
    ----------
    traction : t on the foundation
    reaction : R
    slipping : whether the node slipped in the step
    slip_work : (levels,) work of friction in each step
    stored : (levels,) elastic energy of the penalty springs
    """

    traction: np.ndarray
    reaction: np.ndarray
    slipping: np.ndarray
    slip_work: np.ndarray
    stored: np.ndarray


def make_history(
    scene: Scene,
    path: LoadPath,
    cycles: tuple[tuple[int, int, int], ...],
    mesh: Mesh,
    printed: dict[tuple[str, str], Printed],
    increments: np.ndarray,
) -> History:
    """The history of the levels that CalculiX reached; the others hold NaN.

    Parameters
    ----------
    scene, path, cycles : what was asked for
    mesh : of the strip
    printed : results by quantity and set
    increments : (increments, 2) total time at the end of each, and its iterations
    """
    reached, levels = _reached(printed), path.target.size
    printed = {key: Printed(p.nodes, p.values[:reached]) for key, p in printed.items()}
    target, pressure, rough = (np.asarray(a, dtype=float)[:reached] for a in path)
    u = _at(printed, mesh.number, reached)
    if scene.contact.normal == "none":  # held by the mean of its far face
        u[..., 1] -= u[:, :1, :1, 1].copy()
    v, w = np.moveaxis(u[:, :, 0], -1, 0)
    beta, psi = fitted(mesh, u)
    held = _held(printed, ("FAR", "GROUND"), 0, reached)
    force = target if scene.load.control == "force" else -rough * held
    end, pressed = _at(printed, mesh.loaded, reached)[..., 0], scene.load.pressure_steps - 1
    end, softness = end @ mesh.shares, _softness(scene, mesh)
    rest = end[pressed] if reached > pressed else 0.0
    displacement = np.where(rough > 0.0, end - rest - softness * force, 0.0)
    contact = _contact(scene, mesh, printed, v, rough, penalty(scene, path))
    load = nodal_loads(mesh.x, 1, scene.contact.pressure)
    sinking = _sinking(scene, mesh, u)
    strain_energy = printed["ELSE", "STRIP"].values if reached else np.zeros(0)
    strain_energy = strain_energy - 0.5 * softness * force**2

    before = steps_before(scene)
    times = np.clip(np.ceil(increments[:, 0] - 1e-6).astype(int) - before, 1, levels)
    iterations = np.bincount(times, increments[:, 1], levels + 1)[1:].astype(int)
    status = np.full(levels, Status.NOT_REACHED)
    status[reached : reached + 1] = Status.MAX_ITERATIONS
    status[:reached] = Status.CONVERGED

    def whole(values: np.ndarray) -> jnp.ndarray:
        missing = np.full((levels - reached, *values.shape[1:]), np.nan)
        return jnp.asarray(np.concatenate([values, missing]))

    slipping = np.zeros((levels, mesh.x.size), bool)
    slipping[:reached] = contact.slipping
    return History(
        scene=scene,
        x=jnp.asarray(mesh.x),
        middles=jnp.asarray(0.5 * (mesh.columns[1:] + mesh.columns[:-1])),
        tributary=jnp.asarray(mesh.tributary),
        load=jnp.asarray(load),
        force=whole(force),
        displacement=whole(displacement),
        contact_v=whole(v),
        above=Above(
            whole(np.stack([v, w, beta, psi], axis=-1)),
            Strains(*map(whole, section_forces(scene, mesh, u))),
        ),
        gap=whole(w),
        traction=whole(contact.traction),
        reaction=whole(contact.reaction),
        slipping=jnp.asarray(slipping),
        slip_work=whole(contact.slip_work),
        stored_energy=whole(strain_energy + contact.stored + pressure * sinking),
        pressure=jnp.asarray(path.pressure),
        sinking=whole(sinking),
        iterations=jnp.asarray(iterations),
        error=whole(_imbalance(scene, mesh, printed, force, pressure)),
        status=jnp.asarray(status),
        cycles=cycles,
    )


def _reached(printed: dict[tuple[str, str], Printed]) -> int:
    """Number of levels in equilibrium: printed, and without tension in the contact.

    A contact that did not settle may pass CalculiX's own tests with springs that pull.
    """
    if not printed:
        return 0
    reached = printed["U", "STRIP"].values.shape[0]
    if ("RF", "GROUND") not in printed:
        return reached
    force = printed["RF", "GROUND"].values[..., 1]
    pulled = -np.min(force, axis=1) > TENSION * np.max(force, axis=1)
    return int(np.argmax(pulled)) if np.any(pulled) else reached


def _at(printed: dict[tuple[str, str], Printed], number: np.ndarray, levels: int) -> np.ndarray:
    """Displacements (levels, ..., 2) of nodes; NaN where there is none."""
    values = np.full((levels, number.max() + 1, 2), np.nan)
    if levels > 0:
        moved = printed["U", "STRIP"]
        there = moved.nodes <= number.max()
        values[:, moved.nodes[there]] = moved.values[:, there, :2]
    return values[:, number]


def _softness(scene: Scene, mesh: Mesh) -> float:
    """Even stretch of the length beyond for each unit of load, which u leaves out."""
    if mesh.beyond is None:
        return 0.0
    strip = scene.strip
    return float(np.ptp(mesh.beyond.x) / (2.0 * strip.half_height * strip.plane_modulus))


def _contact(
    scene: Scene,
    mesh: Mesh,
    printed: dict[tuple[str, str], Printed],
    v: np.ndarray,
    rough: np.ndarray,
    springs: Penalty,
) -> Contact:
    """Traction, reaction and what slips, from the forces that hold the base."""
    length, levels = mesh.tributary, v.shape[0]
    none = np.zeros(v.shape)
    if scene.contact.normal == "none" or levels == 0:
        return Contact(none, none, none.astype(bool), np.zeros(levels), np.zeros(levels))
    held = printed["RF", "GROUND"]
    force = held.values[:, np.argsort(held.nodes), :2]
    # The base's outermost nodes take part of the end nodes' forces when the strip slides there.
    force[:, 1] += force[:, 0]
    force[:, -2] += force[:, -1]
    per_length = force[:, 1:-1] / length[:, None]
    rubs = rough[:, None] > 0.0  # the pressing's bit of friction is no result
    traction, reaction = -per_length[..., 0] * rubs, per_length[..., 1]
    cap = float(scene.contact.friction) * np.maximum(reaction, 0.0)
    slipping = (np.abs(traction) > SLIDES * cap) & (cap > 0.0) & rubs
    return Contact(
        traction,
        reaction,
        slipping,
        _slip_work(v, traction, cap, springs, length) * rubs[:, 0],
        0.5 * (traction**2 / springs.stick + reaction**2 / springs.normal) @ length,
    )


def _slip_work(
    v: np.ndarray, traction: np.ndarray, cap: np.ndarray, springs: Penalty, length: np.ndarray
) -> np.ndarray:
    """Work of friction in each step, (levels,): inelastic slip times the mean cap while it slid.

    A node that turns round within a step slides at its new cap, not at the mean of its tractions;
    where only a part of a node's length slides, its traction is the same part of the cap.
    """
    if v.shape[0] == 0:
        return np.zeros(0)
    slip = np.diff(v, axis=0) - np.diff(traction, axis=0) / springs.stick
    mean = 0.5 * (cap[1:] + cap[:-1])
    part = np.clip(traction[1:] / np.where(cap[1:] > 0.0, cap[1:], 1.0), -1.0, 1.0)
    return np.append(0.0, (part * mean * slip) @ length)


def _sinking(scene: Scene, mesh: Mesh, u: np.ndarray) -> np.ndarray:
    """Conjugate of the pressures' part that acts, (levels,)."""
    contact = scene.contact
    top = nodal_loads(mesh.columns, mesh.order, contact.pressure)
    bottom = nodal_loads(mesh.columns, mesh.order, contact.bottom_pressure)
    return u[:, :, -1, 1] @ top - u[:, :, 0, 1] @ bottom


def _imbalance(
    scene: Scene,
    mesh: Mesh,
    printed: dict[tuple[str, str], Printed],
    force: np.ndarray,
    pressure: np.ndarray,
) -> np.ndarray:
    """Resultant force on the strip over mu F_N L, the larger component, (levels,)."""
    contact, levels = scene.contact, force.size
    down, up = (
        np.sum(nodal_loads(mesh.x, 1, p)) for p in (contact.pressure, contact.bottom_pressure)
    )
    along = force + _held(printed, ("FAR", "GROUND"), 0, levels)
    across = np.zeros(levels)
    if ("RF", "GROUND") in printed:
        across = _held(printed, ("GROUND",), 1, levels) - pressure * (down - up)
    friction = float(contact.friction)
    return np.maximum(np.abs(along), np.abs(across)) / (down * (friction if friction > 0 else 1.0))


def _held(
    printed: dict[tuple[str, str], Printed], names: tuple[str, ...], component: int, levels: int
) -> np.ndarray:
    """Sum of the forces that hold sets of nodes, (levels,)."""
    sets = [printed["RF", name] for name in names if ("RF", name) in printed]
    return sum((np.sum(s.values[..., component], axis=1) for s in sets), np.zeros(levels))
