"""Jenkins element: a spring in series with a slider, F = clip(F + k du, -F_S, F_S).

References
----------
Jenkins, G. M. (1962). Analysis of the stress-strain relationships in reactor grade graphite. Br. J.
    Appl. Phys. 13, 30-32.
"""

from __future__ import annotations

from typing import Any, ClassVar

from jax import Array
from jax.typing import ArrayLike

from jbeamshell.laws.parallel_iwan import ParallelIwan
from jbeamshell.scene.rows import number


class Jenkins(ParallelIwan):
    """Spring and slider in series; no work is lost below gross slip.

    Attributes
    ----------
    slip_force, stiffness : force F_S of the slider, and stiffness k of the spring
    """

    heading: ClassVar[str] = "jenkins"
    by_force: ClassVar[bool] = False  # below gross slip it tells nothing but its stiffness

    slip_force: Array = number(1.0, "Force of gross slip, F_S.", symbol="F_S", unit="force/width")
    stiffness: Array = number(
        1.0, "Stiffness of the spring, k.", symbol="k", unit="(force/width)/length"
    )

    @property
    def springs(self) -> Array:
        """Stiffness (1,) of the spring."""
        return self.stiffness[None]

    @property
    def slips(self) -> Array:
        """Displacement (1,) at which it slips."""
        return (self.slip_force / self.stiffness)[None]

    def displacement(self, force: ArrayLike) -> Array:
        """Displacement amplitude of a force amplitude; see `Law.displacement`."""
        return self._below_capacity(force) / self.stiffness

    @staticmethod
    def _start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        """Numbers to start a fit from; see `Law.started`."""
        return {"slip_force": 0.95 * force, "stiffness": stiffness}
