r"""Bouc-Wen law: a differential equation of the hysteretic part z of the force.

    F = a k u + (1 - a) F_S z,   u_S dz/du = 1 - abs(z)^n (g sgn(z du) + 1 - g),   u_S = F_S/k.

With n it turns sharper, and g = 1/2 unloads straight.  A steady cycle that reaches z_m has, by
quadrature over z,

    2 U = u_S int_0^z_m dz/(1 - z^n) + dz/(1 + (2 g - 1) z^n),
    D = 2 (1 - a) F_S u_S int_0^z_m z dz/(1 - z^n) - z dz/(1 + (2 g - 1) z^n).

References
----------
Bouc, R. (1967). Forced vibration of mechanical systems with hysteresis. Proc. 4th Conf. on
    Nonlinear Oscillation, Prague, 315.
Wen, Y.-K. (1976). Method for random vibration of hysteretic systems. J. Eng. Mech. Div. ASCE 102,
    249-263.
"""

from __future__ import annotations

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.laws.law import Law, as_path
from jbeamshell.scene.rows import number

SUBSTEPS = 8  # of each piece of a path
MOST_STEP = 40.0  # longest piece over u_S: beyond it z has reached its limit
NODES = 24  # Gauss points of the quadrature over z
FARTHEST = 36.0  # of t = -log(1 - z), where 1 - z is rounding
BISECTIONS = 60


class BoucWen(Law):
    """Bouc-Wen law; nested cycles do not close, as it remembers z alone.

    Attributes
    ----------
    slip_force, stiffness : limit F_S of the hysteretic force, and stiffness k at rest
    exponent, unloading : n and g
    hardening : part a of the stiffness that remains
    """

    heading: ClassVar[str] = "bouc-wen"

    slip_force: Array = number(
        1.0, "Limit of the hysteretic force, F_S.", symbol="F_S", unit="force/width"
    )
    stiffness: Array = number(1.0, "Stiffness at rest, k.", symbol="k", unit="(force/width)/length")
    exponent: Array = number(
        1.5, "Sharpness n of the turn to sliding.", symbol="n", low=1.0, high=50.0, closed=True
    )
    unloading: Array = number(
        0.5, "Bend g of unloading; 1/2 is straight.", symbol="g", high=1.0, scale="linear"
    )
    hardening: Array = number(
        0.01,
        "Part a of the stiffness that remains while it slides.",
        symbol="a",
        high=1.0,
        closed=True,
    )

    @property
    def capacity(self) -> Array:
        """Largest force: F_S without hardening, else infinite."""
        return jnp.where(self.hardening > 0.0, jnp.inf, self.slip_force)

    @property
    def slip_displacement(self) -> Array:
        """Displacement u_S = F_S/k."""
        return self.slip_force / self.stiffness

    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading, an odd function of the displacement; any shape."""
        u = jnp.asarray(u)
        size = jnp.abs(u) / self.slip_displacement
        z = self._solve(lambda z: self._ways(z)[0], size)
        return jnp.sign(u) * self._force(jnp.abs(u), z)

    def path_forces(self, path: ArrayLike) -> Array:
        """Forces (T,) on a path (T,) of displacements, from rest; second order in its pieces."""
        return self._forces(as_path(path))

    @eqx.filter_jit
    def _forces(self, points: Array) -> Array:
        """Forces (T,) on a path (T,), compiled."""
        pieces = jnp.diff(points, prepend=0.0) / self.slip_displacement

        def go(z: Array, piece: Array) -> tuple[Array, Array]:
            step = jnp.clip(piece, -MOST_STEP, MOST_STEP) / SUBSTEPS

            def substep(z: Array, _: None) -> tuple[Array, None]:
                slope, change = jax.jvp(lambda z: self._slope(z, step), (z,), (jnp.ones_like(z),))
                x = step * change
                safe = jnp.where(jnp.abs(x) < 1e-5, 1.0, x)
                mean = jnp.where(jnp.abs(x) < 1e-5, 1.0 + 0.5 * x, jnp.expm1(safe) / safe)
                return jnp.clip(z + step * slope * mean, -1.0, 1.0), None

            end = lax.scan(substep, z, None, length=SUBSTEPS)[0]
            return end, end

        hysteretic = lax.scan(go, jnp.zeros((), points.dtype), pieces)[1]
        return self._force(points, hysteretic)

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per steady cycle at a displacement amplitude; any shape."""
        z = self._steady(amplitude)
        ways = self._moments(z)
        scale = 2.0 * (1.0 - self.hardening) * self.slip_force * self.slip_displacement
        return scale * (ways[0] - ways[1])

    def _reached(self, size: Array) -> Array:
        """Force amplitude of a steady cycle."""
        return self._force(size, self._steady(size))

    @staticmethod
    def _start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        """Numbers to start a fit from; see `Law.started`."""
        return {"slip_force": 1.1 * force, "stiffness": stiffness, "exponent": 1.5}

    def _force(self, u: Array, z: Array) -> Array:
        """Force of a displacement and a hysteretic part."""
        part = self.hardening
        return part * self.stiffness * u + (1.0 - part) * self.slip_force * z

    def _slope(self, z: Array, move: Array) -> Array:
        """Slope u_S dz/du in the sense of a move."""
        away = jnp.sign(z) * jnp.sign(move)
        size = jnp.maximum(jnp.abs(z), jnp.finfo(z.dtype).tiny)
        return 1.0 - size**self.exponent * (self.unloading * away + 1.0 - self.unloading)

    def _nodes(self, z: Array) -> tuple[Array, Array]:
        """Gauss points (..., NODES) from 0 to z and their weights, dense where z nears 1."""
        points, weights = np.polynomial.legendre.leggauss(NODES)
        far = -jnp.log1p(-z)
        t = 0.5 * far[..., None] * (1.0 + points)
        return -jnp.expm1(-t), 0.5 * far[..., None] * weights * jnp.exp(-t)

    def _ways(self, z: Array) -> tuple[Array, Array]:
        """Ways over u_S from z = 0 on loading, and to z = 0 on unloading."""
        at, weight = self._nodes(z)
        power = at**self.exponent
        back = 1.0 + (2.0 * self.unloading - 1.0) * power
        return jnp.sum(weight / (1.0 - power), axis=-1), jnp.sum(weight / back, axis=-1)

    def _moments(self, z: Array) -> tuple[Array, Array]:
        """Integrals of z over both ways of `_ways`."""
        at, weight = self._nodes(z)
        power = at**self.exponent
        back = 1.0 + (2.0 * self.unloading - 1.0) * power
        loading = jnp.sum(weight * at / (1.0 - power), axis=-1)
        return loading, jnp.sum(weight * at / back, axis=-1)

    def _steady(self, amplitude: ArrayLike) -> Array:
        """Part z_m that a steady cycle reaches."""
        size = jnp.abs(jnp.asarray(amplitude)) / self.slip_displacement
        return self._solve(lambda z: 0.5 * sum(self._ways(z)), size)

    def _solve(self, way: Any, size: Array) -> Array:
        """Part z at which a way, rising with z, has a size; with its derivatives."""

        def halve(_: int, ends: tuple[Array, Array]) -> tuple[Array, Array]:
            low, high = ends
            middle = 0.5 * (low + high)
            below = way(-jnp.expm1(-middle)) < size
            return jnp.where(below, middle, low), jnp.where(below, high, middle)

        size = jnp.asarray(size, dtype=jnp.result_type(float))
        far = jnp.full_like(size, FARTHEST)
        low, high = lax.fori_loop(0, BISECTIONS, halve, (jnp.zeros_like(size), far))
        t = lax.stop_gradient(0.5 * (low + high))
        value, slope = jax.jvp(lambda t: way(-jnp.expm1(-t)), (t,), (jnp.ones_like(t),))
        return -jnp.expm1(-jnp.maximum(t + (size - value) / slope, 0.0))
