r"""Dahl's law: the force approaches its limit exponentially.

    dF/du = k (1 - sgn(du) F/F_S),
    D = 4 F_S (U - u_S tanh(U/u_S)),   u_S = F_S/k.

References
----------
Dahl, P. R. (1968). A solid friction model. Report TOR-0158(3107-18)-1, The Aerospace Corporation.
"""

from __future__ import annotations

from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.laws.law import Law, as_path
from jbeamshell.scene.rows import number


class Dahl(Law):
    """Dahl's law; nested cycles do not close, as it remembers the force alone.

    Attributes
    ----------
    slip_force, stiffness : limit F_S of the force, and stiffness k at rest
    """

    heading: ClassVar[str] = "dahl"

    slip_force: Array = number(1.0, "Limit of the force, F_S.", symbol="F_S", unit="force/width")
    stiffness: Array = number(1.0, "Stiffness at rest, k.", symbol="k", unit="(force/width)/length")

    @property
    def capacity(self) -> Array:
        """Limit of the force, F_S."""
        return self.slip_force

    @property
    def slip_displacement(self) -> Array:
        """Displacement u_S = F_S/k within which the force approaches its limit."""
        return self.slip_force / self.stiffness

    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading, an odd function of the displacement; any shape."""
        u = jnp.asarray(u)
        rise = -jnp.expm1(-jnp.abs(u) / self.slip_displacement)
        return jnp.sign(u) * self.slip_force * rise

    def path_forces(self, path: ArrayLike) -> Array:
        """Forces (T,) on a path (T,) of displacements, exact, from rest."""
        return self._forces(as_path(path))

    @eqx.filter_jit
    def _forces(self, points: Array) -> Array:
        """Forces (T,) on a path (T,), compiled."""
        moves = jnp.diff(points, prepend=0.0)

        def go(force: Array, move: Array) -> tuple[Array, Array]:
            limit = jnp.sign(move) * self.slip_force
            end = limit + (force - limit) * jnp.exp(-jnp.abs(move) / self.slip_displacement)
            end = jnp.where(move == 0.0, force, end)
            return end, end

        return lax.scan(go, jnp.zeros((), points.dtype), moves)[1]

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per steady cycle at a displacement amplitude; any shape."""
        part = jnp.abs(jnp.asarray(amplitude)) / self.slip_displacement
        return 4.0 * self.slip_force * self.slip_displacement * (part - jnp.tanh(part))

    def displacement(self, force: ArrayLike) -> Array:
        """Displacement amplitude of a force amplitude; see `Law.displacement`."""
        part = self._below_capacity(force) / self.slip_force
        return self.slip_displacement * jnp.arctanh(part)

    def secant_stiffness(self, amplitude: ArrayLike) -> Array:
        """Force amplitude over displacement amplitude of the steady cycle; any shape."""
        size = jnp.asarray(amplitude)
        return self.slip_force * jnp.tanh(size / self.slip_displacement) / size

    @staticmethod
    def _start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        """Numbers to start a fit from; see `Law.started`."""
        return {"slip_force": 1.1 * force, "stiffness": stiffness}
