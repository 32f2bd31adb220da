r"""Bouc-Wen law: a differential equation of the hysteretic part z of the force.

    F = a k u + (1 - a) F_S z,   u_S dz/du = 1 - abs(z)^n (g sgn(z du) + 1 - g),   u_S = F_S/k.

With n it turns sharper, and g = 1/2 unloads straight.  The equation separates.  In one sense of
motion the way over u_S from z = 0 on loading and to z = 0 on unloading is

    s_L(z) = int_0^z dz/(1 - z^n),    s_U(z) = int_0^z dz/(1 + (2 g - 1) z^n),

so that any straight piece of a path is exact, however long.  A steady cycle that reaches z_m has

    2 U = u_S (s_L + s_U)(z_m),    D = 2 (1 - a) F_S u_S int_0^z_m z (ds_L - ds_U).

References
----------
Bouc, R. (1967). Forced vibration of mechanical systems with hysteresis. Proc. 4th Conf. on
    Nonlinear Oscillation, Prague, 315.
Wen, Y.-K. (1976). Method for random vibration of hysteretic systems. J. Eng. Mech. Div. ASCE 102,
    249-263.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.laws.law import Law, as_path
from jbeamshell.scene.rows import number

FARTHEST = 36.0  # of t = -log(1 - z), where 1 - z is rounding
CELLS = 512  # of the table of ways
IN_CELL = 4  # Gauss points of a cell
NODES = 64  # Gauss points of the energy of a cycle


class Way(NamedTuple):
    """Way over u_S as a table over t = -log(1 - z).

    Attributes
    ----------
    t : (CELLS + 1,) dense near 0
    value, slope : (CELLS + 1,) way from z = 0, and its slope over t
    """

    t: Array
    value: Array
    slope: Array

    def at(self, t: Array) -> Array:
        """Way at a t; any shape."""
        return _hermite(t, self.t, self.value, self.slope)

    def reached(self, way: Array) -> Array:
        """Part t that is reached after a way; any shape."""
        return _hermite(way, self.value, self.t, 1.0 / self.slope)


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
        u = jnp.asarray(u, dtype=jnp.result_type(float))
        loading, _ = self._ways()
        t = loading.reached(jnp.abs(u) / self.slip_displacement)
        return jnp.sign(u) * self._force(jnp.abs(u), -jnp.expm1(-t))

    def path_forces(self, path: ArrayLike) -> Array:
        """Forces (T,) on a path (T,) of displacements, from rest; exact on its straight pieces."""
        return self._forces(as_path(path))

    @eqx.filter_jit
    def _forces(self, points: Array) -> Array:
        """Forces (T,) on a path (T,), compiled."""
        loading, unloading = self._ways()
        pieces = jnp.diff(points, prepend=0.0) / self.slip_displacement

        def go(now: tuple[Array, Array], piece: Array) -> tuple[tuple[Array, Array], Array]:
            sense, t = now
            move, way = jnp.sign(piece), jnp.abs(piece)
            left = unloading.at(t) - way  # until z = 0
            loads = (sense * move >= 0.0) | (left < 0.0)
            gone = jnp.where(sense * move >= 0.0, loading.at(t) + way, -left)
            loaded = loading.reached(jnp.maximum(gone, 0.0))
            unloaded = unloading.reached(jnp.maximum(left, 0.0))
            rests = move == 0.0
            end = jnp.where(rests, t, jnp.where(loads, loaded, unloaded))
            sense = jnp.where(loads & ~rests, move, sense)
            return (sense, end), sense * -jnp.expm1(-end)

        zero = jnp.zeros((), points.dtype)
        hysteretic = lax.scan(go, (zero, zero), pieces)[1]
        return self._force(points, hysteretic)

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per steady cycle at a displacement amplitude; any shape."""
        t = self._steady(amplitude)
        points, weights = np.polynomial.legendre.leggauss(NODES)
        # Over the root of t, in which powers of z are smooth.
        part = 0.5 * (1.0 + points)
        bent = jnp.minimum(t, FARTHEST)
        at = bent[..., None] * part**2
        power, ahead = self._power(at)
        back = ahead + 2.0 * self.unloading * power
        lost = -jnp.expm1(-at) * jnp.exp(-at) * 2.0 * self.unloading * power / (ahead * back)
        energy = bent * jnp.sum(lost * part * weights, axis=-1) + (t - bent) / self.exponent
        scale = 2.0 * (1.0 - self.hardening) * self.slip_force * self.slip_displacement
        return scale * energy

    def _reached(self, size: Array) -> Array:
        """Force amplitude of a steady cycle."""
        return self._force(size, -jnp.expm1(-self._steady(size)))

    @staticmethod
    def _start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        """Numbers to start a fit from; see `Law.started`."""
        return {"slip_force": 1.1 * force, "stiffness": stiffness, "exponent": 1.5}

    def _force(self, u: Array, z: Array) -> Array:
        """Force of a displacement and a hysteretic part."""
        part = self.hardening
        return part * self.stiffness * u + (1.0 - part) * self.slip_force * z

    def _power(self, t: Array) -> tuple[Array, Array]:
        """Powers z^n and 1 - z^n at a t, without the difference of two like numbers."""
        logarithm = self.exponent * jax.nn.log1mexp(jnp.maximum(t, jnp.finfo(t.dtype).tiny))
        return jnp.exp(logarithm), -jnp.expm1(logarithm)

    def _ways(self) -> tuple[Way, Way]:
        """Ways on loading and on unloading."""
        root = jnp.linspace(0.0, FARTHEST**0.5, CELLS + 1)
        points, weights = np.polynomial.legendre.leggauss(IN_CELL)
        half = 0.5 * root[1]
        inner = root[:-1, None] + half * (1.0 + points)

        def slopes(t: Array) -> tuple[Array, Array]:
            power, ahead = self._power(t)
            shrink = jnp.exp(-t)
            return shrink / ahead, shrink / (ahead + 2.0 * self.unloading * power)

        def way(inside: Array, slope: Array) -> Way:
            cells = half * jnp.sum(2.0 * inner * weights * inside, axis=1)
            return Way(root**2, jnp.pad(jnp.cumsum(cells), (1, 0)), slope)

        loading, unloading = map(way, slopes(inner**2), slopes(root**2))
        return loading, unloading

    def _steady(self, amplitude: ArrayLike) -> Array:
        """Part t of z_m that a steady cycle reaches."""
        size = jnp.abs(jnp.asarray(amplitude, dtype=jnp.result_type(float)))
        mean = jax.tree.map(lambda a, b: 0.5 * (a + b), *self._ways())
        return mean.reached(size / self.slip_displacement)


def _hermite(x: Array, at: Array, value: Array, slope: Array) -> Array:
    """Cubic Hermite interpolant of values and slopes at rising points; straight beyond the last."""
    x, beyond = jnp.minimum(x, at[-1]), jnp.maximum(x - at[-1], 0.0)
    j = jnp.clip(jnp.searchsorted(at, x, side="right") - 1, 0, at.size - 2)
    width = at[j + 1] - at[j]
    p = (x - at[j]) / width
    q = 1.0 - p
    ends = q**2 * (1.0 + 2.0 * p) * value[j] + p**2 * (1.0 + 2.0 * q) * value[j + 1]
    return ends + width * p * q * (q * slope[j] - p * slope[j + 1]) + beyond * slope[-1]
