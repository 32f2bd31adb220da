"""Quadratic energy of a section, and the element matrices that follow from it.

With the fields q of a section and their slopes q' along X, the energy per length and width is
1/2 (q, q') S (q, q').  An element is linear in X: its energy is that of its ends' mean fields with
the slope between them, and of the difference of its ends' fields.  What differs between the ends of
an element of plane elasticity is integrated over it, or slip to and fro from node to node would
cost no shear (an hourglass mode; Flanagan & Belytschko 1981).  Incompatible modes within the
element, parabolas of X that are zero at its ends, relieve what linear fields lock in: the shear of
a section that turns, and strains across (Wilson et al. 1973; Taylor, Beresford & Wilson 1976).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.numbers_of import numbers_of, put
from jbeamshell.mechanics.kinematics import FIELDS, Section
from jbeamshell.numerics.factors import inverse_cholesky

V, W, BETA, PSI = range(len(FIELDS))
Matrices = tuple[Array, Array, Array]


class SectionForm(NamedTuple):
    """Quadratic energy of a section with m fields, the first two being v and w of the contact.

    Attributes
    ----------
    values, mixed, slopes : (m, m) blocks of S for (q, q), (q, q') and (q', q')
    pull : (m,) parts of the fields in the displacement along X that the end load moves through
    turn : (m,) parts of the fields in the mean rotation, which an end moment moves through
    press : (m,) parts of the fields in the lift of the top face
    held : (m,) True for fields that are zero at a held far end: those along X
    further : (k, m) parts of the fields in those that a history has beside v and w: the rotation
        beta and the squeeze strain psi (their means over the height, if the section bends)
    modes : (5, 2, m) fields and slopes that are a unit strain e, g, k, psi and psi'; zero for a
        strain that the section does not have
    spread : (m, m) second derivatives of the energy in how far the fields at an element's ends
        differ, per length; None for those of linear fields with incompatible modes
    masses : (layers, m, m) integrals of the squared displacement over each layer of material
    top : place of the field beyond v and w with which the top face rises most; 0 if there is none
    """

    values: Array
    mixed: Array
    slopes: Array
    pull: Array
    turn: Array
    press: Array
    held: np.ndarray
    further: Array
    modes: Array
    spread: Array | None
    masses: Array
    top: int

    def element(self, lengths: Array) -> Matrices:
        """Matrices (elements, m, m) of elements: start and start, end and end, start and end."""
        h = lengths[:, None, None]
        spread = self._relieved(h) if self.spread is None else self.spread
        slope, spread = self.slopes / h, h * spread
        mean = 0.25 * h * self.values
        even, odd = 0.5 * (self.mixed + self.mixed.T), 0.5 * (self.mixed - self.mixed.T)
        diagonal = mean + slope + spread
        return diagonal - even, diagonal + even, mean - slope - spread + odd

    def _relieved(self, h: Array) -> Array:
        """Spread (..., m, m) of linear fields, relieved by parabolas, in plane elasticity.

        Parabolas of the fields across relieve those along, and the other way round.

        Parameters
        ----------
        h : (..., 1, 1) lengths of the elements
        """
        bubbles = self.slopes + 0.1 * h**2 * self.values
        found = numbers_of(bubbles).zeros_like(bubbles)
        along, across = np.flatnonzero(self.held), np.flatnonzero(~self.held)
        for own, other in ((along, across), (across, along)):
            inverse = inverse_cholesky(bubbles[..., other[:, None], other])
            relief = inverse @ self.mixed[np.ix_(own, other)].T
            own_values = self.values[np.ix_(own, own)] - relief.mT @ relief
            found = put(found, (..., own[:, None], own), own_values / 12.0)
        return found

    def moved(self, length: Array) -> tuple[Array, Array]:
        """Forces (m, m) from fields at an element's start and end to both ends together.

        They are sums of the matrices of `element`, in which the slopes cancel.
        """
        mean = 0.5 * length * self.values
        return mean - self.mixed, mean + self.mixed


def section_stiffness(energy: Callable[[Section, Section], Array], like: Array) -> Array:
    """Second derivatives (2, m, 2, m) of a section's energy in its fields and slopes, at zero.

    Parameters
    ----------
    energy : strain energy per length and width from the fields (m,) and their slopes (m,)
    like : (m,) fields, for their number and precision
    """
    return jax.hessian(lambda fields: energy(fields[0], fields[1]))(
        jnp.zeros((2, *like.shape), like.dtype)
    )


def squeeze_at_even_force(stiffness: Array) -> Array:
    """Stiffness of a beamshell against psi where e follows so that N stays as it is.

    It is Phi_psipsi - Phi_epsi^2/Phi_ee, for a straight strip as for a curved one.

    Parameters
    ----------
    stiffness : (2, m, 2, m, ...) second derivatives, see `section_stiffness`
    """
    coupling = stiffness[0, PSI, 1, V]
    return stiffness[0, PSI, 0, PSI] - coupling**2 / stiffness[1, V, 1, V]


def on_symmetry_plane(form: SectionForm) -> SectionForm:
    """Form of a section whose top face keeps its height and slides freely.

    The field at ``form.top`` follows from the others, and is left out.  Where there is none the
    section cannot be squeezed: its w is to be held.
    """
    if form.top == 0:
        return form
    places = np.delete(np.arange(form.pull.size), form.top)
    relation = -form.press[places] / form.press[form.top]
    unit = numbers_of(relation).eye(form.pull.size, dtype=form.pull.dtype)
    fields = put(unit[:, places], form.top, relation)
    return _within(form, fields, places)._replace(press=0.0 * relation, top=0)


def without_lift(form: SectionForm) -> SectionForm:
    """Form of a section whose w is zero, and is left out."""
    places = np.delete(np.arange(form.pull.size), W)
    unit = numbers_of(form.pull).eye(form.pull.size, dtype=form.pull.dtype)
    return _within(form, unit[:, places], places)


def _within(form: SectionForm, fields: Array, places: np.ndarray) -> SectionForm:
    """Form in the fields at some places, from which all others follow as ``fields`` (m, k)."""

    def within(matrix: Array) -> Array:
        return fields.T @ matrix @ fields

    return form._replace(
        values=within(form.values),
        mixed=within(form.mixed),
        slopes=within(form.slopes),
        pull=fields.T @ form.pull,
        turn=fields.T @ form.turn,
        press=fields.T @ form.press,
        held=form.held[places],
        further=form.further @ fields,
        modes=form.modes[..., places],
        spread=None if form.spread is None else within(form.spread),
        masses=within(form.masses),
    )
