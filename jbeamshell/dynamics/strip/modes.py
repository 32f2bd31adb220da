"""Natural frequencies of the strip at rest: stuck or free to slide, by the linear eigenproblem."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jax import Array
from numpy.typing import NDArray

from jbeamshell.dynamics.strip.attached_masses import AttachedMasses
from jbeamshell.dynamics.strip.equations import Equations, check
from jbeamshell.dynamics.strip.excitation import Excitation
from jbeamshell.dynamics.strip.inertia import Inertia
from jbeamshell.mechanics.normal_contact import Compliance
from jbeamshell.quasistatic.system import V, W
from jbeamshell.scene.scene import Scene


class Modes(NamedTuple):
    """Natural vibrations.

    Attributes
    ----------
    frequency : (k,) angular, rising
    x : (n,) nodes
    shapes : (k, n, m) fields, of unit modal mass
    """

    frequency: NDArray[np.float64]
    x: NDArray[np.float64]
    shapes: NDArray[np.float64]


def modes(
    scene: Scene,
    inertia: Inertia | None = None,
    attached: AttachedMasses | None = None,
    *,
    stuck: bool = True,
) -> Modes:
    """Natural vibrations about the strip before anything acts on it.

    Parameters
    ----------
    scene : the strip; a compliant contact counts as closed
    inertia, attached : as of `simulate`; a chain is left out
    stuck : whether friction holds everywhere, elastically, with k_t; else it is without

    Raises
    ------
    InputError
        for a scene that cannot be set in motion
    """
    inertia, attached = inertia or Inertia(), attached or AttachedMasses()
    check(scene, inertia)
    given = _matrices(scene, inertia, AttachedMasses(attached.payload), stuck)
    mass, stiffness, x, moves = map(np.asarray, given)
    free = np.flatnonzero(moves)
    pick = np.ix_(free, free)
    values, vectors = scipy.linalg.eigh(stiffness[pick], mass[pick])
    shapes = np.zeros((free.size, x.size, scene.model.width))
    active = np.zeros((free.size, moves.size))
    active[:, free] = vectors.T
    shapes[..., list(scene.model.active)] = active.reshape(-1, *moves.shape)
    return Modes(np.sqrt(np.maximum(values, 0.0)), x, shapes)


@eqx.filter_jit
def _matrices(
    scene: Scene, inertia: Inertia, attached: AttachedMasses, stuck: bool
) -> tuple[Array, ...]:
    """Mass and stiffness of the active fields (n a, n a), the nodes, and what moves."""
    equations = Equations(scene, inertia, attached, Excitation())
    system, columns = equations.system, list(scene.model.active)
    held = stuck and equations.rubs

    def forces(active: Array) -> Array:
        q = system.embed(active)
        pull = system.elastic_forces(q, 0.0)
        if held:
            rubbed = jnp.where(
                system.foundation.friction > 0.0, system.foundation.slip_stiffness, 0.0
            )
            pull = pull.at[:, V].add(system.tributary * rubbed * q[:, V])
        if isinstance(system.foundation.normal_law, Compliance):
            pull = pull.at[:, W].add(
                system.tributary * system.foundation.normal_law.stiffness * q[:, W]
            )
        return pull[:, columns]

    rest = system.unloaded().q[:, columns]
    stiffness = jax.jacfwd(forces)(rest).reshape(rest.size, rest.size)
    symmetric = 0.5 * (stiffness + stiffness.T)
    return equations.dense_mass(), symmetric, system.x, jnp.asarray(equations.moves)


def highest_frequency(scene: Scene, inertia: Inertia, attached: AttachedMasses) -> float:
    """Highest angular frequency of the stuck strip with what rides on it, or a bound of it."""
    found = modes(scene, inertia, attached)
    own = float(found.frequency[-1])
    if not attached.count:
        return own
    # A spring can at most add its stiffness over the masses at its two ends (Gershgorin).
    springs, masses = np.asarray(attached.springs), np.asarray(attached.masses)
    height = 2.0 * float(scene.strip.half_height)
    light = float(inertia.mean_density(scene)) * height * (found.x[-1] - found.x[-2]) / 24.0
    behind = np.append(springs[1:], 0.0)
    chain = float(np.max(2.0 * (springs + behind) / masses))
    return float(np.sqrt(own**2 + chain + springs[0] / (light + float(attached.payload))))


def first_period(scene: Scene, inertia: Inertia, attached: AttachedMasses) -> float:
    """Period of the stuck strip's first vibration, its chain's masses as if they sat on its end."""
    carried = AttachedMasses(attached.payload + attached.masses.sum())
    return 2.0 * np.pi / float(modes(scene, inertia, carried).frequency[0])
