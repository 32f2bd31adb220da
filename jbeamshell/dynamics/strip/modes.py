"""Natural frequencies and modes of a strip at rest, stuck or without friction."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jax import Array

from jbeamshell.dynamics.frequencies import Modes
from jbeamshell.dynamics.strip.attached_masses import AttachedMasses
from jbeamshell.dynamics.strip.equations import Equations, movable
from jbeamshell.dynamics.strip.excitation import Excitation
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.load_steps.system import V, W
from jbeamshell.mechanics.normal_contact import Compliance
from jbeamshell.scene.scene import Scene


def modes(
    scene: Scene,
    inertia: Inertia | None = None,
    attached: AttachedMasses | None = None,
    *,
    stuck: bool = True,
) -> Modes:
    """Natural vibrations of the unloaded strip, by the linear eigenproblem.

    Parameters
    ----------
    scene : scene of the strip; a compliant contact counts as closed
    inertia : density and damping, without effect of the damping; None is density 1
    attached : masses at the loaded end, of which the payload counts but not the chain
    stuck : True if the elastic slip k_t acts at every node; False is without friction

    Raises
    ------
    InputError
        for a scene that has no equations of motion, such as a curved strip

    Examples
    --------
    >>> modes(jb.Scene(), attached=AttachedMasses(20.0)).frequency[0]
    """
    inertia, attached = inertia or Inertia(), attached or AttachedMasses()
    scene = movable(scene, inertia)
    matrices = _matrices(scene, inertia, AttachedMasses(attached.payload), stuck)
    mass, stiffness, x, moves = map(np.asarray, matrices)
    free = np.flatnonzero(moves)
    pick = np.ix_(free, free)
    values, vectors = scipy.linalg.eigh(stiffness[pick], mass[pick])
    shapes = np.zeros((free.size, x.size, scene.plan.width))
    active = np.zeros((free.size, moves.size))
    active[:, free] = vectors.T
    shapes[..., list(scene.plan.active)] = active.reshape(-1, *moves.shape)
    return Modes(np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi), shapes, x)


@eqx.filter_jit
def _matrices(
    scene: Scene, inertia: Inertia, attached: AttachedMasses, stuck: bool
) -> tuple[Array, ...]:
    """Mass and stiffness (n a, n a) of the active fields, nodes (n,), and free fields (n, a)."""
    equations = Equations(scene, inertia, attached, Excitation())
    system, columns = equations.system, list(scene.plan.active)
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

    zero = system.unloaded().q[:, columns]
    stiffness = jax.jacfwd(forces)(zero).reshape(zero.size, zero.size)
    symmetric = 0.5 * (stiffness + stiffness.T)
    return equations.mass.dense(), symmetric, system.x, jnp.asarray(equations.mass.free)


def highest_omega(scene: Scene, inertia: Inertia, attached: AttachedMasses) -> float:
    """Upper bound of the angular frequencies of the stuck strip with its attached masses."""
    strip = modes(scene, inertia, attached)
    highest = float(strip.omega[-1])
    if not attached.count:
        return highest
    # A spring adds at most its stiffness over the masses at its two ends (Gershgorin).
    springs, masses = np.asarray(attached.springs), np.asarray(attached.masses)
    height = 2.0 * float(scene.strip.half_height)
    end_mass = float(inertia.mean_density(scene)) * height * (strip.x[-1] - strip.x[-2]) / 24.0
    next_springs = np.append(springs[1:], 0.0)
    chain = float(np.max(2.0 * (springs + next_springs) / masses))
    end = springs[0] / (end_mass + float(attached.payload))
    return float(np.sqrt(highest**2 + chain + end))


def first_period(scene: Scene, inertia: Inertia, attached: AttachedMasses) -> float:
    """Period of the stuck strip's first mode, with the masses of the chain fixed to its end."""
    fixed = AttachedMasses(attached.payload + attached.masses.sum())
    return 1.0 / float(modes(scene, inertia, fixed).frequency[0])
