"""Natural vibrations of a strip."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jax import Array

from jbeamshell.common.checks import NOT_NEGATIVE, TINY, as_leaf, require_number
from jbeamshell.dynamics.frequencies import Modes
from jbeamshell.dynamics.strip.equations import Equations, movable
from jbeamshell.dynamics.strip.excitation import Excitation
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.load_steps.system import V, W
from jbeamshell.mechanics.kinematics import FIELDS
from jbeamshell.mechanics.normal_contact import Compliance
from jbeamshell.scene.scene import Scene


def modes(
    scene: Scene, inertia: Inertia | None = None, *, payload: Any = 0.0, stuck: bool = True
) -> Modes:
    """Natural vibrations of the unloaded strip, by the linear eigenproblem.

    Parameters
    ----------
    scene : scene of the strip; a compliant contact counts as closed
    inertia : density and damping, without effect of the damping; None is density 1
    payload : mass per width that moves with u(L)
    stuck : True if the elastic slip k_t acts at every node; False is without friction

    Raises
    ------
    InputError
        for a scene that has no equations of motion, such as a curved strip

    Examples
    --------
    >>> modes(jb.Scene(), payload=20.0).frequency[0]
    """
    inertia = inertia or Inertia()
    scene = movable(scene, inertia)
    matrices = _matrices(scene, inertia, checked_payload(payload), stuck)
    blocks, stiffness, x, moves = map(np.asarray, matrices)
    free = np.flatnonzero(moves)
    pick = np.ix_(free, free)
    values, vectors = scipy.linalg.eigh(stiffness[pick], scipy.linalg.block_diag(*blocks)[pick])
    shapes = np.zeros((free.size, x.size, len(FIELDS)))
    active = np.zeros((free.size, moves.size))
    active[:, free] = vectors.T
    shapes[..., list(scene.plan.active)] = active.reshape(-1, *moves.shape)
    return Modes(np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi), shapes, x)


def checked_payload(payload: Any) -> Array:
    """Mass per width at the loaded end; raises `InputError` for a negative one."""
    require_number("payload", payload, NOT_NEGATIVE, low=-TINY)
    return as_leaf(payload, "payload")


@eqx.filter_jit
def _matrices(scene: Scene, inertia: Inertia, payload: Array, stuck: bool) -> tuple[Array, ...]:
    """Blocks of mass (n, a, a), stiffness (n a, n a), nodes (n,), and free fields (n, a)."""
    equations = Equations(scene, inertia, payload, Excitation())
    system, columns = equations.system, np.array(scene.plan.active)
    foundation = system.foundation

    def forces(active: Array) -> Array:
        q = system.embed(active)
        internal = system.elastic_forces(q, 0.0)
        if stuck and foundation.present:
            slip_stiffness = jnp.where(foundation.friction > 0.0, foundation.slip_stiffness, 0.0)
            internal = internal.at[:, V].add(system.tributary * slip_stiffness * q[:, V])
        if isinstance(foundation.normal_law, Compliance):
            stiffness = foundation.normal_law.stiffness
            internal = internal.at[:, W].add(system.tributary * stiffness * q[:, W])
        return internal[:, columns]

    rest = system.unloaded().q
    zero = rest[:, columns]
    stiffness = jax.jacfwd(forces)(zero).reshape(zero.size, zero.size)
    blocks = equations.mass.blocks(rest)[:, columns[:, None], columns]
    return blocks, 0.5 * (stiffness + stiffness.T), system.x, jnp.asarray(equations.mass.free)
