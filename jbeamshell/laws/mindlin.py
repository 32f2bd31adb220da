r"""Cattaneo's and Mindlin's spheres in contact as a law of a joint.

    F = F_S (1 - (1 - r)^(3/2)),   r = u/u_S,   u_S = 3 F_S/(2 K),
    D = F_S u_S (4 r - 16/5 + (16/5) (1 - r)^(5/2) + 4 r (1 - r)^(3/2)).

The contact of two spheres under a constant normal force, see `jbeamshell.reference.mindlin`.  Its
energy per cycle is that of Mindlin and Deresiewicz.

References
----------
Mindlin, R. D. (1949). Compliance of elastic bodies in contact. J. Appl. Mech. 16, 259-268.
Mindlin, R. D. & Deresiewicz, H. (1953). Elastic spheres in contact under varying oblique forces.
    J. Appl. Mech. 20, 327-344.
"""

from __future__ import annotations

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from scipy.special import binom

from jbeamshell.laws.masing import MasingLaw
from jbeamshell.scene.rows import number

SMALL = 0.1  # displacement over that of gross slip below which the energy is a series
TERMS = np.arange(3, 19)
SERIES = ((-1.0) ** TERMS * (3.2 * binom(2.5, TERMS) - 4.0 * binom(1.5, TERMS - 1)))[::-1]


class Mindlin(MasingLaw):
    """Two elastic spheres, pressed together and sheared.

    Attributes
    ----------
    slip_force, stiffness : force F_S = mu P of gross slip, and stiffness K without slip
    """

    heading: ClassVar[str] = "mindlin"

    slip_force: Array = number(1.0, "Force of gross slip, mu P.", symbol="F_S", unit="force/width")
    stiffness: Array = number(
        1.0, "Stiffness without slip, K.", symbol="K", unit="(force/width)/length"
    )

    @property
    def capacity(self) -> Array:
        """Force of gross slip, F_S."""
        return self.slip_force

    @property
    def slip_displacement(self) -> Array:
        """Displacement u_S at gross slip."""
        return 1.5 * self.slip_force / self.stiffness

    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading, an odd function of the displacement; any shape."""
        u = jnp.asarray(u)
        return jnp.sign(u) * self.slip_force * (1.0 - self._left(u) ** 1.5)

    def work(self, u: ArrayLike) -> Array:
        """Work on first loading, the integral of the backbone from 0 to u; any shape."""
        size = jnp.abs(jnp.asarray(u))
        stored = 0.4 * self.slip_displacement * (1.0 - self._left(size) ** 2.5)
        return self.slip_force * (size - stored)

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per steady cycle at a displacement amplitude; any shape."""
        size = jnp.abs(jnp.asarray(amplitude))
        r = size / self.slip_displacement
        left = self._left(size)
        closed = 4.0 * r - 3.2 + 3.2 * left**2.5 + 4.0 * r * left**1.5
        small = r < SMALL  # the sum cancels down to a cube
        near = jnp.where(small, r, 0.0)
        series = near**3 * jnp.polyval(jnp.asarray(SERIES, r.dtype), near)
        energy = jnp.where(small, series, closed)
        return self.slip_force * self.slip_displacement * energy

    def displacement(self, force: ArrayLike) -> Array:
        """Displacement amplitude of a force amplitude; see `Law.displacement`."""
        part = self._below_capacity(force) / self.slip_force
        return -self.slip_displacement * jnp.expm1(2.0 / 3.0 * jnp.log1p(-part))

    @staticmethod
    def _start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        """Numbers to start a fit from; see `Law.started`."""
        return {"slip_force": 1.1 * force, "stiffness": stiffness}

    def _left(self, u: Array) -> Array:
        """Part 1 - u/u_S of the way to gross slip that is left."""
        return jnp.maximum(1.0 - jnp.abs(u) / self.slip_displacement, 0.0)
