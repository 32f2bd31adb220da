"""Quadratic energy of a section, and the element matrices that follow from it.

With the fields q of a section and their slopes q' along X, the energy per length and width is
1/2 (q, q') S (q, q').  An element is linear in X: its energy is that of its ends' mean fields with
the slope between them, and of the difference of its ends' fields.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jax import Array


class SectionForm(NamedTuple):
    """Quadratic energy of a section with m fields, the first two being v and w of the contact.

    Attributes
    ----------
    values, mixed, slopes : (m, m) blocks of S for (q, q), (q, q') and (q', q')
    pull : (m,) parts of the fields in the displacement along X that the end load moves through
    press : (m,) parts of the fields in the lift of the top face
    held : (m,) True for fields that are zero at a held far end
    means : (2, m) parts of the fields in the section's mean rotation beta and squeeze strain psi
    modes : (5, 2, m) fields and slopes that are a unit strain e, g, k, psi and psi'
    spread : (m, m) second derivatives of the energy in how far the fields at an element's ends
        differ, per length
    """

    values: Array
    mixed: Array
    slopes: Array
    pull: Array
    press: Array
    held: np.ndarray
    means: Array
    modes: Array
    spread: Array

    def element(self, lengths: Array) -> tuple[Array, Array, Array]:
        """Matrices (elements, m, m) of elements: start and start, end and end, start and end."""
        h = lengths[:, None, None]
        slope, spread = self.slopes / h, h * self.spread
        mean = 0.25 * h * self.values
        even, odd = 0.5 * (self.mixed + self.mixed.T), 0.5 * (self.mixed - self.mixed.T)
        own = mean + slope + spread
        return own - even, own + even, mean - slope - spread + odd
