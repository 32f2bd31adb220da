"""Structures of few coordinates for harmonic balance: modes and static displacements."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.common.checks import is_traced
from jbeamshell.common.precision import doubled
from jbeamshell.dynamics.structure.elements import Elements, elements_of
from jbeamshell.dynamics.structure.matrices import Structure

SMALL = 40  # largest number of degrees of freedom that are kept
MODES = 24  # of a larger structure
DEPENDENT = 1e-12  # squared size of a static displacement that the others contain


class Reduced(NamedTuple):
    """Structure of r coordinates with J force elements.

    Attributes
    ----------
    mass, damping, stiffness : (r, r); the stiffness is that with all elements stuck
    directions : (r, J) directions of the elements
    drive : (r,) forces
    elements : force elements
    """

    mass: Array
    damping: Array
    stiffness: Array
    directions: Array
    drive: Array
    elements: Elements


def reduced(structure: Structure, force: Any, mode: int = 0) -> tuple[Reduced, Any]:
    """Structure of few coordinates, and its basis (n, r).

    Small structures keep their degrees of freedom.  Others move in their lowest modes and in the
    static displacements of forces and elements (Rubin 1975): the dynamic compliance there is then
    exact to the fourth power of the frequency over that of the next mode.  The basis of traced
    structures is held fixed in their derivatives.  The modes go beyond the given one.
    """
    own, traced = structure.directions, structure.traced or is_traced(force)
    xp: Any = jnp if traced else np
    basis = basis_of(structure, xp.column_stack([own, force]), mode, xp)
    mass, stiffness = map(jnp.asarray, projected(structure, basis, xp))
    damping = jnp.asarray(basis.T @ (structure.damping @ basis))
    elements = elements_of(structure.joints if traced else doubled(structure.joints))
    drive = jnp.asarray(basis.T @ force)
    return Reduced(mass, damping, stiffness, jnp.asarray(basis.T @ own), drive, elements), basis


def projected(structure: Structure, basis: Any, xp: Any) -> tuple[Any, Any]:
    """Mass and stuck stiffness (r, r) in a basis (n, r), whose zero columns do not move."""
    mass, stiffness = (
        xp.asarray(basis.T @ (a @ basis)) for a in (structure.mass, structure.stuck_stiffness)
    )
    unused = xp.diag(xp.where(xp.all(xp.asarray(basis) == 0.0, axis=0), 1.0, 0.0))
    return mass + unused, stiffness + unused * xp.max(stiffness)


def basis_of(structure: Structure, loads: Any, mode: int, xp: Any) -> Any:
    """Modes beyond the given one, and static displacements (n, r) under loads independent of them.

    They are orthogonal in the mass; static displacements that the others contain become zero.  The
    basis of a small structure is that of its degrees of freedom.
    """
    if structure.size <= SMALL:
        return np.eye(structure.size)
    modes = structure.modes(MODES + mode).shapes
    static = structure.static_displacements(loads)
    for _ in range(2):  # the second time for rounding
        static = static - modes @ (modes.T @ (structure.mass @ static))
    size = xp.sqrt(xp.sum(static * (structure.mass @ static), axis=0))
    static = static / xp.where(size > 0.0, size, 1.0)
    values, vectors = xp.linalg.eigh(static.T @ (structure.mass @ static))
    kept = values > DEPENDENT
    scale = xp.where(kept, 1.0 / xp.sqrt(xp.where(kept, values, 1.0)), 0.0)
    found = xp.column_stack([modes, static @ (vectors * scale)])
    return lax.stop_gradient(found) if xp is jnp else found
