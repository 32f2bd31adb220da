"""Bodies joined on their contact: one potential of the relative displacements and the loads."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.bodies.substructure import Substructure
from jbeamshell.common.checks import TINY, is_traced, require
from jbeamshell.contact_line.pair import together

RIGID = 1e-6  # energy of a rigid motion over that of the nodes alone, from which on it is held


def joined(upper: Substructure, lower: Substructure | None) -> Array:
    """Second derivatives (k n + m, k n + m) of the potential of bodies on their contact.

    They are in the displacements of the upper nodes over the lower ones and in the loads.

    Raises
    ------
    InputError
        for bodies on a face that no support holds, under loads that are not in balance
    """
    if upper.on_face and lower is not None and not is_traced(upper, lower):
        lower = _grounded(upper, lower)
    return _potential(upper, lower)


@jax.jit
def _potential(upper: Substructure, lower: Substructure | None) -> Array:
    count = max(body.forces.shape[1] for body in (upper, lower) if body is not None)
    above = _of_body(upper, count)
    if lower is None:
        return above
    fixed = np.array(upper.fixed), np.array(lower.fixed)
    return together(above, _of_body(lower, count), *fixed)[0]


def _of_body(body: Substructure, count: int) -> Array:
    """Second derivatives of a body's potential, on as many loads as both bodies have."""
    missing = (0, count - body.forces.shape[1])
    forces = -jnp.pad(body.forces, ((0, 0), missing))
    return jnp.block(
        [[body.stiffness, forces], [forces.T, -jnp.pad(body.flexibility, (missing,) * 2)]]
    )


def _grounded(upper: Substructure, lower: Substructure) -> Substructure:
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
