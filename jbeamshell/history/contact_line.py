"""Contact with the foundation at every step of a history: where it is, and how hard it presses."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import Array

from jbeamshell.common.numbers_of import numbers_of
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
        return _contact_ends(self.x, self.tributary, self.touching, self.reaction)

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


@jax.jit
def _contact_ends(x: Array, tributary: Array, touching: Array, reaction: Array) -> Array:
    """Positions X at which the contact ends; see `ContactLine.contact_end`."""
    last = x.size - 1
    share_begins = jnp.cumsum(tributary) - tributary

    def end(touching: Array, reaction: Array) -> Array:
        j = last - jnp.argmax(touching[::-1])
        before = jnp.maximum(j - 1, 1)
        slope = (reaction[before] - reaction[before - 1]) / (x[before] - x[before - 1])
        force, begin = reaction[j] * tributary[j], share_begins[j]
        width = tributary[j]
        for _ in range(3):
            level = reaction[before] + slope * (begin + 0.5 * width - x[before])
            width = jnp.where(level > 0.0, force / jnp.where(level > 0.0, level, 1.0), width)
            width = jnp.clip(width, 0.0, tributary[j])  # beyond it, the next node would touch
        found = jnp.where(j == last, x[last], begin + width)
        return jnp.where(jnp.any(touching), found, 0.0)

    return jax.vmap(end)(touching, reaction)
