"""Contact with the foundation at every step of a history: where it is, and how hard it presses."""

from __future__ import annotations

import functools

import numpy as np
from jax import Array

from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.common.small import Small, always
from jbeamshell.history.record import Record


class ContactLine(Record):
    """Extent and reaction of the contact."""

    @property
    def touching(self) -> Array:
        """True if a node is in contact, (steps+1, n)."""
        if self.scene.contact.normal == "none":
            return numbers_of(self.gap).zeros(self.gap.shape, bool)
        if self.scene.contact.normal == "compliant":
            return self.gap <= 0.0
        strip = self.scene.strip  # the weight of `jbeamshell.mechanics.normal_contact.Rigid`
        return self.reaction > self.gap * strip.plane_modulus / strip.half_height

    @property
    def contact_end(self) -> Array:
        """Position X at which the contact ends, (steps+1,); zero if nothing touches.

        The contact ends inside the tributary length of the last node that touches.  The reaction
        is continued linearly from the nodes before; the contact reaches as far as the nodal force
        of that last node needs.
        """
        ends: Array = _contact_ends((self.x, self.tributary, self.touching, self.reaction))
        return ends

    @property
    def reaction_max(self) -> Array:
        """Largest normal reaction, (steps+1,), stress.

        In plane elasticity it may lie in the corner of a body, where it grows with the mesh.
        """
        return numbers_of(self.reaction).max(self.reaction, axis=1)

    @property
    def reaction_max_at(self) -> Array:
        """Position X of the largest normal reaction, (steps+1,)."""
        return self.x[numbers_of(self.reaction).argmax(self.reaction, axis=1)]

    @property
    def reaction_min(self) -> Array:
        """Smallest normal reaction of the path, stress; negative is tension (w frozen)."""
        return numbers_of(self.reaction).min(self.reaction)


@functools.partial(Small, by_numpy=always)
def _contact_ends(inputs: tuple[Array, Array, Array, Array]) -> Array:
    """Positions X at which the contact ends; see `ContactLine.contact_end`."""
    x, tributary, touching, reaction = inputs
    xp, last, step = numbers_of(inputs), x.size - 1, np.arange(len(touching))
    j = last - xp.argmax(touching[:, ::-1], axis=1)
    before = xp.maximum(j - 1, 1)
    near = reaction[step, before]
    slope = (near - reaction[step, before - 1]) / (x[before] - x[before - 1])
    force, whole = reaction[step, j] * tributary[j], tributary[j]
    begin, width = (xp.cumsum(tributary) - tributary)[j], whole
    for _ in range(3):
        level = near + slope * (begin + 0.5 * width - x[before])
        width = xp.where(level > 0.0, force / xp.where(level > 0.0, level, 1.0), width)
        width = xp.clip(width, 0.0, whole)  # beyond it, the next node would touch
    found = xp.where(j == last, x[last], begin + width)
    return xp.where(xp.any(touching, axis=1), found, 0.0)
