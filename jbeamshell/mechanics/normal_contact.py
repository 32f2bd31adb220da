r"""Normal contact of one point with the foundation: reaction R from the gap g.

    rigid:       g >= 0,  R >= 0,  g R = 0          (Signorini's conditions)
    compliant:   R = k_n max(-g, 0), rounded off around first touch

A law sees the gap and the force per length R* with which the strip presses onto the foundation at
this point.  It gives the reaction R and a residual that is zero in equilibrium.  All arguments are
scalars; `jax.vmap` makes the field.

References
----------
Hintermueller, M., Ito, K. & Kunisch, K. (2002). The primal-dual active set strategy as a
    semismooth Newton method. SIAM J. Optim. 13, 865-888.
"""

from __future__ import annotations

import abc

import equinox as eqx
import jax.numpy as jnp
from jax import Array


class NormalLaw(eqx.Module):
    """Normal contact of one point; a subclass implements `reaction` and `residual`."""

    @abc.abstractmethod
    def reaction(self, balance: Array, gap: Array) -> Array:
        """Reaction R of the foundation on the strip.

        Parameters
        ----------
        balance : R*, force per length with which the strip presses, stress
        gap : height of the strip over the foundation, length
        """

    @abc.abstractmethod
    def residual(self, balance: Array, gap: Array) -> Array:
        """Residual, a stress that is zero in equilibrium; see `reaction` for the parameters."""

    def energy(self, gap: Array) -> Array:
        """Energy stored in the contact, per area."""
        return jnp.zeros_like(gap)


class Rigid(NormalLaw):
    """Rigid foundation that cannot pull: gap >= 0, R >= 0, gap R = 0.

    The residual is the smaller of R* and ``stiffness`` times the gap.  Newton's method on it is
    the primal-dual active-set iteration (Hintermueller, Ito & Kunisch 2002).  A tie counts as
    contact, so the iteration starts from full contact.  If the lift w is not a field, only
    `reaction` is used, and the strip is glued to the foundation.

    Attributes
    ----------
    stiffness : weight of the gap against R*, stress per length; it does not change the solution
    """

    stiffness: Array

    def reaction(self, balance: Array, gap: Array) -> Array:
        """Reaction R; see `NormalLaw.reaction`."""
        return balance

    def residual(self, balance: Array, gap: Array) -> Array:
        """Residual; see `NormalLaw.residual`."""
        penalty = self.stiffness * gap
        return jnp.where(balance < penalty, balance, penalty)

    def changes_status(self, balance: Array, gap: Array) -> Array:
        """True if a point is not as a step of Newton's method took it to be, open or closed.

        The step makes R* zero at an open point, and the gap at a closed one.  So the sum is
        negative at an open point that overlaps, and at a closed one that pulls.
        """
        return balance + self.stiffness * gap < 0.0

    def kept_status(self, balance: Array, gap: Array) -> tuple[Array, Array, Array]:
        """R* and gap of a point with the status that it loses, and the residual with that status.

        The point is one that `changes_status`.
        """
        distance = jnp.abs(gap) + jnp.abs(balance) / self.stiffness
        was_open = self.stiffness * gap < balance
        return (
            jnp.zeros_like(balance),
            jnp.where(was_open, distance, -distance),
            -self.residual(-balance, -gap),
        )


class Compliance(NormalLaw):
    """Layer of asperities: R is k_n times the approach -gap, rounded off around first touch.

    R is a parabola for abs(gap) <= rounding, so that its slope is continuous and R can be
    differentiated.

    Attributes
    ----------
    stiffness : contact stiffness k_n, stress per length
    rounding : half width of the parabola, length
    """

    stiffness: Array
    rounding: Array

    def reaction(self, balance: Array, gap: Array) -> Array:
        """Reaction R; see `NormalLaw.reaction`."""
        touch = jnp.clip(self.rounding - gap, 0.0, 2.0 * self.rounding)
        depth = jnp.maximum(-gap - self.rounding, 0.0)
        return self.stiffness * (touch**2 / (4.0 * self.rounding) + depth)

    def residual(self, balance: Array, gap: Array) -> Array:
        """Residual; see `NormalLaw.residual`."""
        return balance - self.reaction(balance, gap)

    def energy(self, gap: Array) -> Array:
        """Energy stored in the contact, the integral of R over the approach."""
        touch = jnp.clip(self.rounding - gap, 0.0, 2.0 * self.rounding)
        depth = jnp.maximum(-gap - self.rounding, 0.0)
        layer = touch**3 / (12.0 * self.rounding) + self.rounding * depth + 0.5 * depth**2
        return self.stiffness * layer


class Absent(NormalLaw):
    """No foundation: R = 0."""

    def reaction(self, balance: Array, gap: Array) -> Array:
        """Reaction R; see `NormalLaw.reaction`."""
        return jnp.zeros_like(gap)

    def residual(self, balance: Array, gap: Array) -> Array:
        """Residual; see `NormalLaw.residual`."""
        return balance
