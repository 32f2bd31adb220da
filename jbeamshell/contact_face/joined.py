"""Bodies joined on their face: one stiffness of the relative displacements, and the loads."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import TINY, as_leaf, is_traced, require
from jbeamshell.contact_face.body import RIGID, FaceBody
from jbeamshell.contact_face.face_input import checked_distance, checked_roughness, checked_softness
from jbeamshell.contact_face.pair import Pairs
from jbeamshell.contact_face.step import Face
from jbeamshell.contact_line.pair import together


class Joined(NamedTuple):
    """Bodies on their face.

    Attributes
    ----------
    face : their face, the surfaces' softness among the bodies
    flexibility : (m, m) displacements per load while the face does not move
    softness : (n, 3) displacement per force of the surfaces at each pair
    """

    face: Face
    flexibility: Array
    softness: Array

    def driven(self) -> Face:
        """Face whose first load is a displacement d = f' v + c P, solved for P."""
        face, rest = self.face, self.flexibility
        pull, soft = face.loads[:, 0], rest[0, 0]
        fix = "the pulled nodes are in the contact: take control='force'"
        require("control", "displacement", is_traced(soft) or bool(soft > 0.0), fix)
        others = face.loads[:, 1:] - jnp.outer(pull, rest[0, 1:]) / soft
        return face._replace(
            stiffness=face.stiffness + jnp.outer(pull, pull) / soft,
            loads=jnp.column_stack([pull / soft, others]),
        )


def joined(
    upper: FaceBody,
    lower: FaceBody | None,
    friction: ArrayLike,
    gap: ArrayLike,
    softness: ArrayLike,
    roughness: ArrayLike,
) -> Joined:
    """Bodies joined on their face."""
    n = upper.areas.size
    distance, soft = checked_distance(upper, gap), checked_softness(upper, softness)
    if lower is not None and not is_traced(upper, lower):
        lower = _grounded(upper, lower)
    held = np.array(upper.fixed) & (True if lower is None else np.array(lower.fixed))
    held = held.reshape(n, 3)
    soft = jnp.where(held, 0.0, soft)
    hessian, size = _potential(upper, lower), 3 * n
    stiffness, loads, rest = hessian[:size, :size], -hessian[:size, size:], -hessian[size:, size:]
    if is_traced(soft) or np.any(np.asarray(soft)):
        stiffness, loads, rest = _on_surfaces(stiffness, loads, rest, soft.ravel())
    own = jnp.diag(stiffness).reshape(n, 3)
    scale = jnp.stack([jnp.max(own[:, :2], axis=1), own[:, 2]], axis=1)
    scale = jnp.where(scale > 0.0, scale, jnp.max(own))  # of a pair that supports hold
    pairs = Pairs(
        friction=jnp.broadcast_to(as_leaf(friction), (n,)),
        gap=distance,
        roughness=checked_roughness(upper, roughness),
        scale=lax.stop_gradient(scale),
    )
    return Joined(Face(stiffness, loads, jnp.asarray(held), pairs), rest, soft)


@jax.jit
def _on_surfaces(
    stiffness: Array, loads: Array, rest: Array, soft: Array
) -> tuple[Array, Array, Array]:
    """Stiffness, loads and flexibility of bodies in series with their surfaces.

    With w the displacement of the bodies and lambda = K w - f P, the pairs move by
    v = w + c lambda.
    """
    size = soft.size
    both = jnp.column_stack([stiffness, loads])
    found = jnp.linalg.solve(jnp.eye(size) + stiffness * soft, both)
    series = 0.5 * (found[:, :size] + found[:, :size].T)
    return series, found[:, size:], rest + (loads.T * soft) @ found[:, size:]


def _grounded(upper: FaceBody, lower: FaceBody) -> FaceBody:
    """Lower body, on springs against the rigid motions of both bodies that nothing holds.

    The springs carry nothing, because the loads along these motions are in balance.
    """
    motions = upper.rigid_motions()
    loose = ~(np.array(upper.fixed) | np.array(lower.fixed))
    stiffness = np.asarray(upper.stiffness) + np.asarray(lower.stiffness)
    stiff = float(np.max(np.diag(stiffness)))
    held = np.einsum("ki,ij,lj->kl", motions, stiffness, motions)
    held += stiff * (motions * ~loose) @ motions.T
    alone = np.einsum("ki,i,li->kl", motions, np.diag(stiffness), motions)
    sizes = np.sqrt(np.diag(alone))
    values, vectors = np.linalg.eigh(held / sizes[:, None] / sizes)
    free = (vectors[:, values < RIGID] / sizes[:, None]).T @ motions
    if not len(free):
        return lower
    count = max(upper.forces.shape[1], lower.forces.shape[1])
    forces = np.zeros((free.shape[1], count))
    for body in (upper, lower):
        forces[:, : body.forces.shape[1]] += np.asarray(body.forces)
    pushed = np.abs(free @ forces) / (np.abs(free) @ np.abs(forces) + TINY)
    fix = "no support holds them, and the loads are not in balance: hold a body, or balance them"
    require(
        "bodies", f"pushed by {np.max(pushed):.2g} of the loads", bool(np.max(pushed) < 1e-6), fix
    )
    springs = stiff * free.T @ np.linalg.inv(free @ free.T) @ free
    return eqx.tree_at(lambda body: body.stiffness, lower, lower.stiffness + springs)


@jax.jit
def _potential(upper: FaceBody, lower: FaceBody | None) -> Array:
    """Second derivatives (3n + m, 3n + m) in the relative displacements and the loads."""
    count = max(body.forces.shape[1] for body in (upper, lower) if body is not None)
    above = _of_body(upper, count)
    if lower is None:
        return above
    fixed = np.array(upper.fixed), np.array(lower.fixed)
    return together(above, _of_body(lower, count), *fixed)[0]


def _of_body(body: FaceBody, count: int) -> Array:
    """Second derivatives of a body's potential, on as many loads as both bodies have."""
    missing = (0, count - body.forces.shape[1])
    forces = -jnp.pad(body.forces, ((0, 0), missing))
    return jnp.block(
        [[body.stiffness, forces], [forces.T, -jnp.pad(body.flexibility, (missing,) * 2)]]
    )
