"""Bodies joined on their contact: one potential of the relative displacements and the loads."""

from __future__ import annotations

import equinox as eqx
import jax
import numpy as np
from jax import Array

from jbeamshell.bodies.substructure import Substructure
from jbeamshell.common.checks import TINY, require
from jbeamshell.common.numbers_of import numbers_of, pad
from jbeamshell.contact_line.pair import together

RIGID = 1e-6  # energy of a rigid motion over that of the nodes alone, from which on it is held


@jax.jit
def joined(upper: Substructure, lower: Substructure | None) -> Array:
    """Second derivatives (k n + m, k n + m) of the potential of bodies on a contact line.

    They are in the displacements of the upper nodes over the lower ones and in the loads.
    """
    count = max(body.forces.shape[1] for body in (upper, lower) if body is not None)
    above = potential_of(upper, count)
    if lower is None:
        return above
    fixed = np.array(upper.fixed), np.array(lower.fixed)
    return together(above, potential_of(lower, count), *fixed)[0]


def potential_of(body: Substructure, count: int) -> Array:
    """Second derivatives of a body's potential, on as many loads as both bodies have."""
    missing = (0, count - body.forces.shape[1])
    forces, flexible = -pad(body.forces, (0, 0), missing), -pad(body.flexibility, missing, missing)
    xp = numbers_of(body)
    rows = xp.column_stack([body.stiffness, forces]), xp.column_stack([forces.T, flexible])
    found: Array = xp.concatenate(rows)
    return found


def grounded(upper: Substructure, lower: Substructure) -> Substructure:
    """Lower body on a face, on springs against the rigid motions of both that nothing holds.

    The springs carry nothing, because the loads along these motions are in balance.

    Raises
    ------
    InputError
        for bodies that no support holds, under loads that are not in balance
    """
    middle = np.mean(np.asarray(upper.places), axis=0)
    motions = [body.rigid_motions(middle) for body in (upper, lower)]
    diagonals = [np.diag(np.asarray(body.stiffness)) for body in (upper, lower)]
    stiff = max(float(np.max(diagonal)) for diagonal in diagonals)
    held, alone = np.zeros((6, 6)), np.zeros(6)
    for body, motion, diagonal in zip((upper, lower), motions, diagonals, strict=True):
        held += motion @ np.asarray(body.stiffness) @ motion.T
        held += stiff * (motion * np.array(body.fixed)) @ motion.T
        alone += motion**2 @ diagonal
    sizes = np.sqrt(alone)
    values, vectors = np.linalg.eigh(held / sizes[:, None] / sizes)
    ways = (vectors[:, values < RIGID] / sizes[:, None]).T
    if not len(ways):
        return lower
    count = max(upper.forces.shape[1], lower.forces.shape[1])
    pushed, sizes = np.zeros((len(ways), count)), np.zeros((len(ways), count))
    for body, motion in zip((upper, lower), motions, strict=True):
        forces = np.asarray(body.forces)
        pushed[:, : forces.shape[1]] += ways @ motion @ forces
        sizes[:, : forces.shape[1]] += np.abs(ways @ motion) @ np.abs(forces)
    most = float(np.max(np.abs(pushed) / (sizes + TINY)))
    fix = "no support holds them, and the loads are not in balance: hold a body, or balance them"
    require("bodies", f"pushed by {most:.2g} of the loads", most < 1e-6, fix)
    free = ways @ motions[1]
    springs = stiff * free.T @ np.linalg.inv(free @ free.T) @ free
    return eqx.tree_at(lambda body: body.stiffness, lower, lower.stiffness + springs)
