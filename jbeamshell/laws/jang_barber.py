r"""Jang and Barber's node: a sliding point behind a spring, under a varying normal force.

    abs(F) <= mu max(N, 0),   F = k (u - s),   s the slip.

If N = N_0 + c u follows the displacement (in phase), the loop is a quadrangle; out of phase it has
another area.  The phase of N and u decides how much is lost.

References
----------
Jang, Y. H. & Barber, J. R. (2011). Effect of phase on the frictional dissipation in systems
    subjected to harmonically varying loads. Eur. J. Mech. A/Solids 30, 269-274.
"""

from __future__ import annotations

from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require
from jbeamshell.laws.law import Law, as_path
from jbeamshell.mechanics.friction import SharpSlip, coulomb_cap
from jbeamshell.scene.rows import number

RUN_IN = 2  # cycles before the one that counts


class JangBarber(Law):
    """Node with Coulomb friction under any history of its normal force.

    Attributes
    ----------
    stiffness, friction, normal_force : spring k, coefficient mu, and N where none is given
    """

    heading: ClassVar[str] = "jang-barber"
    fitted: ClassVar[tuple[str, ...]] = ("stiffness", "friction")

    stiffness: Array = number(
        1.0, "Stiffness of the spring, k.", symbol="k", unit="(force/width)/length"
    )
    friction: Array = number(0.1, "Coulomb friction coefficient.", symbol=r"\mu")
    normal_force: Array = number(
        10.0, "Normal force where none is given.", symbol="N", unit="force/width"
    )

    @property
    def capacity(self) -> Array:
        """Force mu N of gross slip under the constant normal force."""
        return self.friction * self.normal_force

    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading, an odd function of the displacement; any shape."""
        return jnp.clip(self.stiffness * jnp.asarray(u), -self.capacity, self.capacity)

    def path_forces(self, path: ArrayLike, normal: ArrayLike | None = None) -> Array:
        """Forces (T,) on a path (T,) of displacements, straight between its points, from rest.

        Parameters
        ----------
        path : (T,) displacements
        normal : (T,) normal forces at the points, negative where the node is off; None holds N
        """
        points = as_path(path)
        normal = self.normal_force if normal is None else jnp.asarray(normal)
        caps = coulomb_cap(self.friction, jnp.broadcast_to(normal, points.shape))
        return self._forces(jnp.diff(points, prepend=0.0), caps)

    @eqx.filter_jit
    def _forces(self, moves: Array, caps: Array) -> Array:
        """Forces (T,) after moves (T,) under Coulomb caps (T,), compiled."""

        def go(force: Array, step: tuple[Array, Array]) -> tuple[Array, Array]:
            move, cap = step
            end = SharpSlip().traction(move, force, cap, self.stiffness)
            return end, end

        return lax.scan(go, jnp.zeros((), moves.dtype), (moves, caps))[1]

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per steady cycle under the constant normal force; any shape."""
        return self.dissipation_in_phase(amplitude, 0.0)

    def dissipation_in_phase(self, amplitude: ArrayLike, slope: ArrayLike) -> Array:
        """Energy lost per steady cycle if N = N_0 + slope u; any shape.

        Raises
        ------
        InputError
            if the node lifts off, or if it never slips back: mu slope is k or more
        """
        size, slope = jnp.asarray(amplitude), jnp.asarray(slope)
        rise, k, cap = self.friction * slope, self.stiffness, self.capacity
        if not is_traced(size, rise, k, cap):
            lifts = bool(jnp.any(jnp.abs(slope) * size > self.normal_force))
            require("slope", slope, not lifts, "lifts the node off: take path_forces(path, normal)")
            locks = bool(jnp.any(jnp.abs(rise) >= k))
            require("slope", slope, not locks, f"must be below k/mu = {float(k / self.friction)}")
        top, bottom = cap + rise * size, -(cap - rise * size)
        down = ((k - rise) * size - 2.0 * cap) / (k + rise)  # where it slips back
        up = (2.0 * cap - (k + rise) * size) / (k - rise)
        slips = down > -size
        x = jnp.stack([size, down, -size, up])
        y = jnp.stack([top, -(cap + rise * down), bottom, cap + rise * up])
        area = 0.5 * jnp.abs(jnp.sum(x * jnp.roll(y, -1, axis=0) - y * jnp.roll(x, -1, axis=0), 0))
        return jnp.where(slips, area, 0.0)

    def dissipation_of_phase(
        self, amplitude: ArrayLike, swing: ArrayLike, phase: ArrayLike, points: int = 400
    ) -> Array:
        """Energy lost per steady cycle of u = U cos(t), N = N_0 + swing cos(t + phase).

        Parameters
        ----------
        amplitude, swing, phase : U, amplitude of N and phase, scalars
        points : of a cycle; the error falls as 1 over their square
        """
        time = 2.0 * jnp.pi * jnp.arange((RUN_IN + 1) * points + 1) / points
        path = amplitude * jnp.cos(time)
        normal = self.normal_force + swing * jnp.cos(time + phase)
        force = self.path_forces(path, normal)[-points - 1 :]
        return jnp.sum(0.5 * (force[1:] + force[:-1]) * jnp.diff(path[-points - 1 :]))

    def displacement(self, force: ArrayLike) -> Array:
        """Displacement amplitude of a force amplitude; see `Law.displacement`."""
        return self._below_capacity(force) / self.stiffness

    def _reached(self, size: Array) -> Array:
        """Force amplitude of a steady cycle."""
        return self.backbone(size)

    @staticmethod
    def _start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        """Numbers to start a fit from; see `Law.started`."""
        return {"stiffness": stiffness, "friction": 0.3, "normal_force": force / 0.3}
