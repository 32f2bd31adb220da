"""Fields of a history along X at every step, and what the bent strip shows of them."""

from __future__ import annotations

from jax import Array

from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.history.record import Record


class Profiles(Record):
    """Fields along X by their names."""

    @property
    def v(self) -> Array:
        """Tangential displacement of the contact, (steps+1, n), length."""
        return self.fields[..., 0]

    @property
    def w(self) -> Array:
        """Lift of the contact, (steps+1, n), length."""
        return self.fields[..., 1]

    @property
    def beta(self) -> Array:
        """Rotation of the sections, (steps+1, n), rad."""
        return self.fields[..., 2]

    @property
    def psi(self) -> Array:
        """Squeeze strain, (steps+1, n)."""
        return self.fields[..., 3]

    @property
    def slip(self) -> Array:
        """Tangential displacement of the contact since the pressure, (steps+1, n), length.

        That of a lap joint is relative to its second member.
        """
        return self.contact_v - self.contact_v[self.pressed]

    @property
    def squeeze_stress(self) -> Array:
        """Mean of sigma_y over the height, chi/(2H), (steps+1, elements); compression negative."""
        return self.above.found.sections.psi / (2.0 * self.scene.strip.half_height)

    @property
    def squeeze_stress_max(self) -> Array:
        """Largest compression chi/(2H) of any element, (steps+1,), positive."""
        stress = self.squeeze_stress
        return numbers_of(stress).max(-stress, axis=1)

    @property
    def squeeze_couple(self) -> Array:
        """Moment xi of the shear stress about mid-height, (steps+1, elements)."""
        return self.sections.dpsi

    @property
    def curvature(self) -> Array:
        """Curvature K = beta' at X = 0, (steps+1,), 1/length."""
        return (self.beta[:, 1] - self.beta[:, 0]) / (self.x[1] - self.x[0])

    @property
    def tip_deflection(self) -> Array:
        """Height of the bottom face at X = L over that at X = 0, (steps+1,), length."""
        alone = self.scene.member.support == "none"
        height = self.gap if alone else self.w
        return height[:, -1] - height[:, 0]

    @property
    def lift_slope(self) -> Array:
        """Angle of the end section at X = L to the foundation's normal, (steps+1,), rad."""
        strip = self.scene.strip
        before = 0.0 if strip.curvature is None else strip.curvature * strip.length
        return before + self.beta[:, -1]
