"""Quadratic energy of a section, and the element matrices that follow from it.

With the fields q of a section and their slopes q' along X, the energy per length and width is
1/2 (q, q') S (q, q').  An element is linear in X; its energy is the sum over its strain points.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
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
    shapes : (points, 2, m) interpolation of the fields from an element's ends to its strain points
    """

    values: Array
    mixed: Array
    slopes: Array
    pull: Array
    press: Array
    held: np.ndarray
    means: Array
    modes: Array
    shapes: np.ndarray

    def element(self, lengths: Array) -> tuple[Array, Array, Array]:
        """Matrices (elements, m, m) of elements: start and start, end and end, start and end."""
        points = self.shapes.shape[0]
        parts = []
        for i, k in ((0, 0), (1, 1), (0, 1)):
            left, right = self.shapes[:, i], self.shapes[:, k]
            value = self.values * jnp.asarray(np.einsum("pa,pb->ab", left, right) / points)
            mean = jnp.asarray(np.mean(self.shapes, axis=0))
            near, far = (2 * k - 1) * self.mixed * mean[i][:, None], (2 * i - 1) * self.mixed.T
            turn = near + far * mean[k]
            slope = (2 * i - 1) * (2 * k - 1) * self.slopes
            h = lengths[:, None, None]
            parts.append(h * value + turn + slope / h)
        return parts[0], parts[1], parts[2]
