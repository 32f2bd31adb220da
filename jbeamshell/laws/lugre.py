r"""LuGre law: bristles that bend, slide and are damped; it depends on the speed v.

    F = k z + c dz/dt + b v,   dz/dt = v - k abs(v) z/g(v),
    g = F_C + (F_B - F_C) exp(-(v/v_S)^2).

Without damping and at vanishing speed it is Dahl's law with the limit F_B.  At a constant speed v a
steady cycle is that of Dahl's law with the limit g, u_S = g/k, and damping:

    D = 4 g (U - u_S tanh(U/u_S)) + 4 v (b U + c u_S tanh(U/u_S)).

References
----------
Canudas de Wit, C., Olsson, H., Astrom, K. J. & Lischinsky, P. (1995). A new model for control of
    systems with friction. IEEE Trans. Autom. Control 40, 419-425.
"""

from __future__ import annotations

from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.laws.law import Law, as_path
from jbeamshell.scene.rows import number


class LuGre(Law):
    """LuGre law; exact along paths whose speed is constant between points.

    Attributes
    ----------
    slip_force, stiffness, damping : Coulomb force F_C, stiffness k and damping c of the bristles
    breakaway, stribeck_speed : force F_B at rest over F_C, and speed v_S of its decay
    viscous : viscous damping b
    speed : speed of paths that are given without times
    """

    heading: ClassVar[str] = "lugre"
    fitted: ClassVar[tuple[str, ...]] = ("slip_force", "stiffness", "damping")

    slip_force: Array = number(1.0, "Coulomb force F_C.", symbol="F_C", unit="force/width")
    stiffness: Array = number(
        1.0, "Stiffness of the bristles, k.", symbol="k", unit="(force/width)/length"
    )
    damping: Array = number(
        0.1,
        "Damping of the bristles, c.",
        symbol="c",
        unit="(force/width) time/length",
        closed=True,
    )
    breakaway: Array = number(
        1.0,
        "Force of breakaway over the Coulomb force, F_B/F_C, 1 or more.",
        low=1.0,
        closed=True,
        fix="must be a number, 1 or more",
    )
    stribeck_speed: Array = number(
        1.0, "Speed within which it decays, v_S.", symbol="v_S", unit="length/time"
    )
    viscous: Array = number(
        0.0, "Viscous damping b.", symbol="b", unit="(force/width) time/length", closed=True
    )
    speed: Array = number(
        1.0, "Speed of paths without times.", symbol="v", unit="length/time", closed=True
    )

    @property
    def capacity(self) -> Array:
        """Force of steady sliding at the given speed."""
        return self._limit(self.speed) + self.viscous * self.speed

    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading at the given speed, an odd function of u; any shape."""
        u = jnp.asarray(u)
        limit = self._limit(self.speed)
        bent = -jnp.expm1(-jnp.abs(u) * self.stiffness / limit)
        damped = self.speed * (self.damping * (1.0 - bent) + self.viscous)
        return jnp.sign(u) * (limit * bent + damped)

    def path_forces(self, path: ArrayLike, time: ArrayLike | None = None) -> Array:
        """Forces (T,) on a path (T,) of displacements, at the end of each straight piece.

        Parameters
        ----------
        path : (T,) displacements, from 0
        time : (T,) times, rising from above 0; None moves at the law's ``speed``
        """
        moves = jnp.diff(as_path(path), prepend=0.0)
        if time is None:
            speeds = jnp.sign(moves) * self.speed
        else:
            speeds = moves / jnp.diff(jnp.asarray(time), prepend=0.0)
        return self._forces(moves, speeds)

    @eqx.filter_jit
    def _forces(self, moves: Array, speeds: Array) -> Array:
        """Forces (T,) at the end of moves (T,) of constant speeds, compiled."""

        def go(z: Array, step: tuple[Array, Array]) -> tuple[Array, Array]:
            move, v = step
            bend = jnp.sign(move) * self._limit(v) / self.stiffness
            part = self.stiffness * jnp.abs(move) / self._limit(v)
            end = jnp.where(move == 0.0, z, bend + (z - bend) * jnp.exp(-part))
            safe = jnp.where(move == 0.0, 1.0, bend)
            rate = jnp.where(move == 0.0, 0.0, v * (1.0 - end / safe))
            return end, self.stiffness * end + self.damping * rate + self.viscous * v

        return lax.scan(go, jnp.zeros((), moves.dtype), (moves, speeds))[1]

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per steady cycle at a displacement amplitude and the given speed."""
        size, limit = jnp.abs(jnp.asarray(amplitude)), self._limit(self.speed)
        bend = limit / self.stiffness
        turned = bend * jnp.tanh(size / bend)
        sliding = limit * (size - turned)
        return 4.0 * (sliding + self.speed * (self.viscous * size + self.damping * turned))

    def _reached(self, size: Array) -> Array:
        """Force amplitude of a steady cycle."""
        limit = self._limit(self.speed)
        bent = jnp.tanh(size * self.stiffness / limit)
        return limit * bent + self.speed * (self.damping * (1.0 - bent) + self.viscous)

    @staticmethod
    def _start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        """Numbers to start a fit from; see `Law.started`."""
        return {"slip_force": 1.05 * force, "stiffness": stiffness, "damping": 0.05 * force}

    def _limit(self, speed: Array) -> Array:
        """Force g(v) of steady bristles."""
        decay = jnp.exp(-jnp.square(speed / self.stribeck_speed))
        return self.slip_force * (1.0 + (self.breakaway - 1.0) * decay)
