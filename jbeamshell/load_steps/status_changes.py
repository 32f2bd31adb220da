"""Changes of the contact status, open or closed, of one node at a time.

Newton's method gives all nodes at once the status that the last iterate tells.  Where the strip
lies on the foundation almost without pressure this may go round in circles.  Without friction no
status comes back if only the first of the nodes that would change does, in any fixed order: Murty's
rule for linear complementarity problems.  With friction it may, but hardly ever in both orders.

References
----------
Murty, K. G. (1974). Note on a Bard-type scheme for solving the complementarity problem. Opsearch
    11, 123-130.
"""

from __future__ import annotations

from typing import cast

import jax
import jax.numpy as jnp
from jax import Array, lax

from jbeamshell.load_steps.system import ContactInput, System, W
from jbeamshell.load_steps.tangent import in_blocks, nodal
from jbeamshell.mechanics.normal_contact import Rigid

TURN = 25  # iterations before the order of the nodes is reversed


def applies(system: System) -> bool:
    """True if nodes have a contact status, which Newton's method must find."""
    return isinstance(system.foundation.normal_law, Rigid) and W in system.plan.active


def one_change(
    system: System, residual: Array, contact: ContactInput, tolerance: float, iterations: Array
) -> tuple[Array, ContactInput, Array]:
    """Residual and tangent's input by which a Newton step changes the status of one node.

    Parameters
    ----------
    system : equations of equilibrium
    residual : (blocks, size) out-of-balance forces
    contact : input of the foundation
    tolerance : residual up to which a node need not change
    iterations : number of iterations so far

    Returns
    -------
    residual, contact : as given at the node that changes; elsewhere with the status of the last
        step
    changes : True if there is a node that changes
    """
    law = cast(Rigid, system.foundation.normal_law)
    forces, column = nodal(system, residual), system.plan.active.index(W)
    pressed, gap = contact.lift_force / system.tributary, system.gap_from_lift(contact.w)
    changing = jax.vmap(law.changes_status)(pressed, gap)
    must = changing & (-forces[:, column] > tolerance)
    node = jnp.arange(must.size)
    # `//` and `%` would care for negative numbers.
    forwards = lax.rem(lax.div(iterations, TURN), 2) == 0
    order = jnp.where(forwards, node, -node)
    keeps = changing & (order != jnp.max(order, where=must, initial=-must.size))
    old_force, old_gap, old_residual = jax.vmap(law.kept_status)(pressed, gap)
    old_residual = old_residual * system.tributary * system.residual_scale(W)
    forces = forces.at[:, column].set(jnp.where(keeps, old_residual, forces[:, column]))
    contact = contact._replace(
        lift_force=jnp.where(keeps, old_force * system.tributary, contact.lift_force),
        w=jnp.where(keeps, contact.w + old_gap - gap, contact.w),
    )
    return in_blocks(forces, residual), contact, jnp.any(must)
