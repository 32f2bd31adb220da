"""Jenkins element: a spring in series with a slider, F = clip(F + k du, -F_S, F_S).

References
----------
Jenkins, G. M. (1962). Analysis of the stress-strain relationships in reactor grade graphite. Br. J.
    Appl. Phys. 13, 30-32.
"""

from __future__ import annotations

from typing import Any, ClassVar

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.laws.masing import MasingLaw
from jbeamshell.scene.rows import number


class Jenkins(MasingLaw):
    """Spring and slider in series; no work is lost below gross slip.

    Attributes
    ----------
    slip_force, stiffness : force F_S of the slider, and stiffness k of the spring
    """

    heading: ClassVar[str] = "jenkins"

    slip_force: Array = number(1.0, "Force of gross slip, F_S.", symbol="F_S", unit="force/width")
    stiffness: Array = number(
        1.0, "Stiffness of the spring, k.", symbol="k", unit="(force/width)/length"
    )

    @property
    def capacity(self) -> Array:
        """Force of gross slip, F_S."""
        return self.slip_force

    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading, an odd function of the displacement; any shape."""
        return jnp.clip(self.stiffness * jnp.asarray(u), -self.slip_force, self.slip_force)

    def work(self, u: ArrayLike) -> Array:
        """Work on first loading, the integral of the backbone from 0 to u; any shape."""
        size, limit = jnp.abs(jnp.asarray(u)), self.slip_force / self.stiffness
        stuck = jnp.minimum(size, limit)
        return self.stiffness * stuck * (size - 0.5 * stuck)

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per steady cycle at a displacement amplitude; any shape."""
        slip = jnp.abs(jnp.asarray(amplitude)) - self.slip_force / self.stiffness
        return 4.0 * self.slip_force * jnp.maximum(slip, 0.0)

    def displacement(self, force: ArrayLike) -> Array:
        """Displacement amplitude of a force amplitude; see `Law.displacement`."""
        return self._below_capacity(force) / self.stiffness

    @staticmethod
    def _start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        """Numbers to start a fit from; see `Law.started`."""
        return {"slip_force": 0.95 * force, "stiffness": stiffness}
