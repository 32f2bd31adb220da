r"""Quinn and Segalman's bar, in closed form: a continuous series-series Iwan model.

A bar of stiffness EA and length L that friction q per length holds slips from its loaded end:

    F = F_S sqrt(u/u_S),   D = (4/3) F_S u_S (U/u_S)^(3/2),   F_S = q L,   u_S = q L^2/(2 EA).

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron, eq. 3.5-3.7, without inertia.
Quinn, D. D. & Segalman, D. J. (2005). Using series-series Iwan-type models for understanding joint
    dynamics. J. Appl. Mech. 72, 666-673.
"""

from __future__ import annotations

from typing import Any, ClassVar, Self

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.laws.masing import MasingLaw
from jbeamshell.mechanics.bar import bar_backbone, bar_force
from jbeamshell.scene.rows import number


class Bar(MasingLaw):
    """Bar on a frictional foundation, pulled at one end; it slips from the first force on.

    Attributes
    ----------
    slip_force, slip_displacement : force F_S and displacement u_S at gross slip
    """

    heading: ClassVar[str] = "bar"

    slip_force: Array = number(1.0, "Force of gross slip, F_S.", symbol="F_S", unit="force/width")
    slip_displacement: Array = number(
        1.0, "Displacement at gross slip, u_S.", symbol="u_S", unit="length"
    )

    @classmethod
    def of(cls, axial_stiffness: Any, friction_per_length: Any, length: Any) -> Self:
        """Law of a bar of stiffness EA and length L, with friction q per length."""
        force = friction_per_length * length
        return cls(force, bar_backbone(force, axial_stiffness, friction_per_length))

    @property
    def stiffness(self) -> Array:
        """Stiffness without slip: infinite."""
        return jnp.full_like(self.slip_force, jnp.inf)

    @property
    def capacity(self) -> Array:
        """Force of gross slip, F_S."""
        return self.slip_force

    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading, an odd function of the displacement; any shape."""
        u = jnp.asarray(u)
        moves = u != 0.0
        # With EA = 1 and length 1, q = F_S; so EA q of this bar is F_S^2/(2 u_S).
        stretch = jnp.where(moves, jnp.minimum(jnp.abs(u), self.slip_displacement), 1.0)
        force = bar_force(stretch, 0.5 * self.slip_force / self.slip_displacement, self.slip_force)
        return jnp.where(moves, jnp.sign(u) * force, 0.0)

    def work(self, u: ArrayLike) -> Array:
        """Work on first loading, the integral of the backbone from 0 to u; any shape."""
        size = jnp.abs(jnp.asarray(u))
        inside = jnp.minimum(size, self.slip_displacement)
        beyond = self.slip_force * (size - inside)
        return 2.0 / 3.0 * inside * self.backbone(inside) + beyond

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per steady cycle at a displacement amplitude; any shape."""
        size = jnp.abs(jnp.asarray(amplitude))
        inside = jnp.minimum(size, self.slip_displacement)
        beyond = 4.0 * self.slip_force * (size - inside)
        return 4.0 / 3.0 * inside * self.backbone(inside) + beyond

    def displacement(self, force: ArrayLike) -> Array:
        """Displacement amplitude of a force amplitude; see `Law.displacement`."""
        return self.slip_displacement * (self._below_capacity(force) / self.slip_force) ** 2

    @staticmethod
    def _start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        """Numbers to start a fit from; see `Law.started`."""
        # Beyond gross slip D = 4 F_S (U - 2 u_S/3); below it the loop tells F_S^2/u_S alone.
        slip = 1.5 * displacement - 0.375 * work / force
        slides = slip < 0.95 * displacement
        reach = max(slip, 0.02 * displacement) if slides else 1.1 * displacement
        return {"slip_force": force * (1.0 if slides else 1.1**0.5), "slip_displacement": reach}
