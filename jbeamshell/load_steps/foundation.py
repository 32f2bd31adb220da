"""Foundation under the strip: friction and normal contact, node by node."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.mechanics.friction import FrictionLaw, coulomb_cap
from jbeamshell.mechanics.normal_contact import Absent, Compliance, NormalLaw, Rigid
from jbeamshell.scene.scene import Scene

CAP_FLOOR = 1e-6  # smallest cap over mu F_N: gradients need a cap that is not zero
# Range in which a compliant contact closes, a part of its approach under the mean pressure.
CLOSING_RANGE = 0.05


class Foundation(eqx.Module):
    """Foundation with friction and normal contact; the nodes respond independently.

    Attributes
    ----------
    friction_law : traction of one point from its slip
    normal_law : reaction of one point from its gap and the force on it
    friction : Coulomb friction coefficient mu
    slip_stiffness : (n,) elastic stiffness k_t of the sliders, traction per slip
    cap_floor : cap of a node without reaction
    """

    friction_law: FrictionLaw
    normal_law: NormalLaw
    friction: Array
    slip_stiffness: Array
    cap_floor: Array

    def __init__(
        self, scene: Scene, normal_force: Array, force_scale: Array, tributary: Array
    ) -> None:
        """Foundation of a scene.

        Parameters
        ----------
        scene : scene with its contact
        normal_force : F_N L, resultant of the pressure on the top face
        force_scale : mu F_N L, or F_N L without friction
        tributary : (n,) contact length of each node
        """
        strip, contact = scene.strip, scene.contact
        self.friction_law, self.friction = contact.law, contact.friction
        self.slip_stiffness = scene.slip_stiffness(tributary)
        self.cap_floor = CAP_FLOOR * force_scale / jnp.sum(tributary, axis=0)
        stiffness = strip.plane_modulus / strip.half_height
        self.normal_law = Rigid(stiffness)
        if contact.normal == "none":
            self.normal_law = Absent()
        elif contact.normal == "compliant":
            stiffness = contact.normal_stiffness * stiffness
            approach = CLOSING_RANGE * normal_force / strip.length / stiffness
            self.normal_law = Compliance(stiffness, approach)

    @property
    def present(self) -> bool:
        """True if there is a foundation."""
        return not isinstance(self.normal_law, Absent)

    def cap(self, reaction: Array) -> Array:
        """Coulomb cap, never less than its floor."""
        return jnp.maximum(coulomb_cap(self.friction, reaction), self.cap_floor)

    def has_friction(self, cap: Array) -> Array:
        """True at nodes with a reaction, whose cap is well above the floor."""
        return cap > 2.0 * self.cap_floor

    def reaction(self, force: Array, gap: Array) -> Array:
        """Reaction R (n,) to the strip's forces per length (n,) at the gap (n,)."""
        return jax.vmap(self.normal_law.reaction)(force, gap)

    def normal_residual(self, force: Array, gap: Array) -> Array:
        """Pressure (n,) that is zero where normal contact is in equilibrium; see `reaction`."""
        return jax.vmap(self.normal_law.residual)(force, gap)

    def traction(
        self, slip: Array, traction_before: Array, reaction: Array, rough: ArrayLike
    ) -> Array:
        """Friction traction (n,) after an increment of slip (n,); ``rough`` = 0 is no friction."""
        cap = self.cap(reaction)
        law = jax.vmap(self.friction_law.traction)
        rough = jnp.where(self.friction > 0.0, rough, 0.0)
        # Without reaction there is no traction, not even the floor's, whose sign would alternate.
        closed = jnp.clip(cap / self.cap_floor - 1.0, 0.0, 1.0)
        return rough * closed * law(slip, traction_before, cap, self.slip_stiffness)

    def limited_slip(self, old: Array, new: Array, traction_before: Array, cap: Array) -> Array:
        """Slips (n,) of Newton's next iterate, limited by the law where there is a reaction.

        Parameters
        ----------
        old, new : (n,) increments of slip of the last and of the next iterate
        traction_before, cap : (n,) traction and cap at the start of the step
        """
        slip = jax.vmap(self.friction_law.limit)(
            old, new, traction_before, cap, self.slip_stiffness
        )
        return jnp.where(self.has_friction(cap), slip, new)

    def slip_work(
        self, slip: Array, tractions: tuple[Array, Array], caps: tuple[Array, Array]
    ) -> Array:
        """Work (n,) of friction per area in a step.

        Parameters
        ----------
        slip : (n,) increment of v
        tractions, caps : (n,) each, at the start and at the end of the step
        """
        work = jax.vmap(self.friction_law.slip_work)(slip, *tractions, *caps, self.slip_stiffness)
        acts = (self.friction > 0.0) & self.has_friction(jnp.maximum(*caps))
        return jnp.where(acts, work, 0.0)

    def stored_energy(self, gap: Array, traction: Array) -> Array:
        """Energy (n,) per area that the sliders and a compliant contact store."""
        sliders = traction**2 / (2.0 * self.slip_stiffness)
        return sliders + jax.vmap(self.normal_law.energy)(gap)
