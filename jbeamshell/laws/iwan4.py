r"""Segalman's four-parameter Iwan model.

Jenkins elements of stiffness one stand side by side, with a density of slip displacements phi

    rho(phi) = R phi^chi on (0, phi_max), and S delta(phi - phi_max),
    beta = S (chi + 1)/(R phi_max^(chi + 1)).

With r = u/phi_max, the backbone below gross slip and the energy of a cycle of amplitude r are

    F = K_T phi_max (r - r^(chi + 2)/((chi + 2)(1 + beta))),
    D = 4 K_T phi_max^2 (chi + 1) r^(chi + 3)/((1 + beta)(chi + 2)(chi + 3)),
    phi_max = F_S (1 + beta)/(K_T (beta + (chi + 1)/(chi + 2))).

References
----------
Segalman, D. J. (2005). A four-parameter Iwan model for lap-type joints. J. Appl. Mech. 72,
    752-760.
"""

from __future__ import annotations

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require
from jbeamshell.laws.masing import MasingLaw
from jbeamshell.scene.rows import number


class Iwan4(MasingLaw):
    """Four-parameter Iwan model: a power law of dissipation, D ~ U^(chi + 3), up to gross slip.

    Attributes
    ----------
    slip_force, stiffness, chi, beta : F_S, K_T, chi and beta of Segalman 2005

    Examples
    --------
    >>> law = Iwan4(slip_force=2.0, stiffness=100.0, chi=-0.5, beta=0.3)
    >>> law.dissipation(law.displacement(1.0))  # energy per cycle of force amplitude 1
    """

    heading: ClassVar[str] = "iwan4"

    slip_force: Array = number(1.0, "Force of gross slip, F_S.", symbol="F_S", unit="force/width")
    stiffness: Array = number(
        1.0, "Stiffness of the stuck joint, K_T.", symbol="K_T", unit="(force/width)/length"
    )
    chi: Array = number(
        -0.5,
        "Exponent of the density of slip displacements, above -1 and up to 0; D ~ U^(chi + 3).",
        symbol=r"\chi",
        low=-1.0,
        high=0.0,
        closed=True,
        scale="linear",
        fix="must lie above -1 and not above 0",
    )
    beta: Array = number(
        0.1,
        "Stiffness lost at once at gross slip, over that lost before.",
        symbol=r"\beta",
        closed=True,
    )

    def __check_init__(self) -> None:
        if not is_traced(self.chi):
            fix = self.table()["iwan4.chi"].words
            require("iwan4.chi", self.chi, bool(np.all(np.asarray(self.chi) > -1.0)), fix)

    @property
    def capacity(self) -> Array:
        """Force of gross slip, F_S."""
        return self.slip_force

    @property
    def phi_max(self) -> Array:
        """Displacement phi_max at which gross slip begins."""
        held = self.beta + (self.chi + 1.0) / (self.chi + 2.0)
        return self.slip_force * (1.0 + self.beta) / (self.stiffness * held)

    @property
    def density(self) -> tuple[Array, Array]:
        """Segalman's R and S, of the density R phi^chi and of the jump at phi_max."""
        lost = self.stiffness / (1.0 + self.beta)
        power = self.phi_max ** (self.chi + 1.0)
        return lost * (self.chi + 1.0) / power, lost * self.beta

    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading, an odd function of the displacement; any shape."""
        u = jnp.asarray(u)
        r, lost = self._part(u)
        slack = r * r ** (self.chi + 1.0) * lost
        return jnp.sign(u) * self.stiffness * self.phi_max * (r - slack)

    def work(self, u: ArrayLike) -> Array:
        """Work on first loading, the integral of the backbone from 0 to u; any shape."""
        size = jnp.abs(jnp.asarray(u))
        r, lost = self._part(size)
        inside = 0.5 * r**2 - r**2 * r ** (self.chi + 1.0) * lost / (self.chi + 3.0)
        beyond = self.slip_force * jnp.maximum(size - self.phi_max, 0.0)
        return self.stiffness * self.phi_max**2 * inside + beyond

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per steady cycle at a displacement amplitude; any shape."""
        size = jnp.abs(jnp.asarray(amplitude))
        r, lost = self._part(size)
        power = 4.0 * (self.chi + 1.0) / (self.chi + 3.0) * lost * r**2 * r ** (self.chi + 1.0)
        sliding = 4.0 * self.slip_force * jnp.maximum(size - self.phi_max, 0.0)
        return self.stiffness * self.phi_max**2 * power + sliding

    @staticmethod
    def _start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        """Numbers to start a fit from; see `Law.started`."""
        return {"slip_force": 1.2 * force, "stiffness": stiffness, "chi": -0.3, "beta": 0.3}

    def _part(self, u: Array) -> tuple[Array, Array]:
        """Displacement r over phi_max, at most 1, and the part 1/((chi + 2)(1 + beta))."""
        tiny = jnp.finfo(jnp.result_type(u, self.chi)).tiny
        r = jnp.clip(jnp.abs(u) / self.phi_max, tiny, 1.0)  # a power of 0 has no slope
        return r, 1.0 / ((self.chi + 2.0) * (1.0 + self.beta))
