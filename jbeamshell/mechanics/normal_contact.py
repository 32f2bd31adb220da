r"""Normal contact of one point with the foundation.

A law sees the gap between the strip and the foundation and the force per length R* with which the
strip's own balance presses there.  It gives the reaction R that the foundation returns and the
residual that is zero in equilibrium.  All arguments are scalars; `jax.vmap` makes the field.
"""

from __future__ import annotations

import abc

import equinox as eqx
import jax.numpy as jnp
from jax import Array


class NormalLaw(eqx.Module):
    """One point's normal contact; subclass it and implement `reaction` and `residual`."""

    @abc.abstractmethod
    def reaction(self, balance: Array, gap: Array) -> Array:
        """R, pressure of the foundation on the strip; ``balance`` is R* above."""

    @abc.abstractmethod
    def residual(self, balance: Array, gap: Array) -> Array:
        """Pressure that is zero in equilibrium."""

    def energy(self, gap: Array) -> Array:
        """Energy stored in the contact per area."""
        return jnp.zeros_like(gap)


class Rigid(NormalLaw):
    """A rigid foundation that does not hold: gap >= 0, R >= 0, gap R = 0.

    The residual is the smaller of R and (stiffness times) the gap.  Newton's method on it is the
    primal-dual active-set iteration (Hintermueller, Ito & Kunisch 2002); a tie counts as contact,
    so that it starts from full contact.  Where the lift is frozen only `reaction` is used, and the
    strip is glued to the foundation.

    Attributes
    ----------
    stiffness : weighs the gap against R, stress per length; it does not change the solution
    """

    stiffness: Array

    def reaction(self, balance: Array, gap: Array) -> Array:
        """See `NormalLaw.reaction`."""
        return balance

    def residual(self, balance: Array, gap: Array) -> Array:
        """See `NormalLaw.residual`."""
        closing = self.stiffness * gap
        return jnp.where(balance < closing, balance, closing)


class Compliance(NormalLaw):
    """A layer of asperities: R = k_n times the approach -gap, rounded off around first touch.

    The corner at gap = 0 is a parabola for abs(gap) <= rounding, so that the slope of R is
    continuous and derivatives pass.

    Attributes
    ----------
    stiffness : k_n, stress per length
    rounding : half width of the parabola, length
    """

    stiffness: Array
    rounding: Array

    def reaction(self, balance: Array, gap: Array) -> Array:
        """See `NormalLaw.reaction`."""
        touch = jnp.clip(self.rounding - gap, 0.0, 2.0 * self.rounding)
        deep = jnp.maximum(-gap - self.rounding, 0.0)
        return self.stiffness * (touch**2 / (4.0 * self.rounding) + deep)

    def residual(self, balance: Array, gap: Array) -> Array:
        """See `NormalLaw.residual`."""
        return balance - self.reaction(balance, gap)

    def energy(self, gap: Array) -> Array:
        """Integral of R over the approach."""
        touch = jnp.clip(self.rounding - gap, 0.0, 2.0 * self.rounding)
        deep = jnp.maximum(-gap - self.rounding, 0.0)
        layer = touch**3 / (12.0 * self.rounding) + self.rounding * deep + 0.5 * deep**2
        return self.stiffness * layer


class Absent(NormalLaw):
    """No foundation: nothing reacts."""

    def reaction(self, balance: Array, gap: Array) -> Array:
        """See `NormalLaw.reaction`."""
        return jnp.zeros_like(gap)

    def residual(self, balance: Array, gap: Array) -> Array:
        """See `NormalLaw.residual`."""
        return balance
