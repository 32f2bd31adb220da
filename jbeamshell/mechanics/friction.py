r"""Friction of one contact point: from an increment of slip to a traction, with memory.

A law sees one load step of one point.  It maps the increment ``dv`` of tangential displacement,
the traction ``t_n`` at the start of the step, the Coulomb cap mu R of the *end* of the step and the
elastic stiffness ``k_t`` (traction per length) to the new traction ``t`` (positive along dv, so
that -t acts on the strip).  The traction is the only memory.  All arguments are scalars; `jax.vmap`
makes the field.
"""

from __future__ import annotations

import abc

import equinox as eqx
import jax.numpy as jnp
from jax import Array


class FrictionLaw(eqx.Module):
    """One point's friction law; subclass it and implement `traction` to bring your own."""

    @abc.abstractmethod
    def traction(self, dv: Array, t_n: Array, cap: Array, k_t: Array) -> Array:
        """Traction at the end of the step."""

    def limit(self, old: Array, new: Array, t_n: Array, cap: Array, k_t: Array) -> Array:
        """Keep Newton's method from throwing a point over its whole sticking range.

        Where the iterate ``old`` slips (or nearly: ``cap`` is that of the last load level) and
        ``new`` slips the other way, the point is put to the middle of its sticking range instead:
        a slipping point may stick next, not slip back.  Without this the iteration cycles.
        """
        before, after = (t_n + k_t * old) / cap, (t_n + k_t * new) / cap
        thrown = ((before >= 0.5) & (after <= -1.0)) | ((before <= -0.5) & (after >= 1.0))
        return jnp.where(thrown, -t_n / k_t, new)

    def slip_work(
        self, dv: Array, t_n: Array, t: Array, cap_n: Array, cap: Array, k_t: Array
    ) -> Array:
        """Work dissipated in the step: mean traction times the inelastic part of dv."""
        return 0.5 * (t_n + t) * plastic_slip(dv, t_n, t, k_t)


def plastic_slip(dv: Array, t_n: Array, t: Array, k_t: Array) -> Array:
    """Inelastic part of the increment, dv - (t - t_n)/k_t."""
    return dv - (t - t_n) / k_t


def _virgin_curve(z: Array, m: Array) -> Array:
    """S(z) = z/(1+z^m)^(1/m) for z >= 0, written so that neither branch overflows."""
    small, large = jnp.where(z <= 1.0, z, 1.0), jnp.where(z <= 1.0, 1.0, z)
    below, above = small / (1.0 + small**m) ** (1.0 / m), (1.0 + large**-m) ** (-1.0 / m)
    return jnp.where(z <= 1.0, below, above)


def _beta_series(x: Array, a: Array, b: Array) -> Array:
    """B_x(a, b)/x^a, the incomplete beta function, for 0 <= x <= 1/2 and b < 1."""
    k = jnp.arange(1, 16, dtype=jnp.result_type(x))
    return 1.0 / a + jnp.sum(jnp.cumprod((1.0 - b / k) * x) / (a + k))


def _mean_cap(slip: Array, dv: Array, t_n: Array, cap_n: Array, cap: Array, k_t: Array) -> Array:
    """Mean cap from where the elastic traction meets it to the end of the step, all on ramps."""
    along = jnp.where(slip >= 0.0, 1.0, -1.0)
    gap, closing = cap_n - along * t_n, along * k_t * dv + cap_n - cap
    ratio = gap / jnp.where(closing > 0.0, closing, 1.0)
    meeting = jnp.where(closing > 0.0, jnp.clip(ratio, 0.0, 1.0), 1.0)
    return cap + 0.5 * (1.0 - meeting) * (cap_n - cap)


class SharpSlip(FrictionLaw):
    """Elastic slip with a sharp cap: the Jenkins slider, t = clip(t_n + k_t dv, -cap, cap).

    Exact on linear ramps of slip and cap, so the number of load steps does not matter; no creep,
    no drift under one-sided cycling.  Its traction has kinks.
    """

    def traction(self, dv: Array, t_n: Array, cap: Array, k_t: Array) -> Array:
        """See `FrictionLaw.traction`."""
        return jnp.clip(t_n + k_t * dv, -cap, cap)

    def slip_work(
        self, dv: Array, t_n: Array, t: Array, cap_n: Array, cap: Array, k_t: Array
    ) -> Array:
        """Slip happens at the cap: the exact work while dv and cap ramp linearly."""
        slip = plastic_slip(dv, t_n, t, k_t)
        return _mean_cap(slip, dv, t_n, cap_n, cap, k_t) * jnp.abs(slip)


class ElasticSlip(FrictionLaw):
    r"""Rate-independent elastic slip: smooth in loading, elastic in unloading.

    Loading follows the virgin curve t = cap S(z), S(z) = z/(1+z^m)^(1/m) with z = k_t x/cap,
    entered where the traction t_n stands on it; unloading is elastic down to zero traction.  For a
    constant cap one step or a hundred along the same path give the same traction, no motion gives
    no change, and abs(t) <= cap always.  m -> infinity is `SharpSlip`.

    Attributes
    ----------
    smoothing : m, the exponent (8 to 32 in practice)
    """

    smoothing: Array = eqx.field(converter=jnp.asarray, default=16.0)

    def traction(self, dv: Array, t_n: Array, cap: Array, k_t: Array) -> Array:
        """See `FrictionLaw.traction`."""
        direction = jnp.where(dv >= 0.0, 1.0, -1.0)
        trial = direction * (t_n + k_t * dv)
        start, rise = self._loading(trial, direction * t_n, cap)
        loading = cap * _virgin_curve(start + rise, self.smoothing)
        return direction * jnp.where(trial <= 0.0, jnp.maximum(trial, -cap), loading)

    def slip_work(
        self, dv: Array, t_n: Array, t: Array, cap_n: Array, cap: Array, k_t: Array
    ) -> Array:
        """Slip follows the virgin curve: its exact mean traction, with the mean cap of the slip."""
        direction = jnp.where(dv >= 0.0, 1.0, -1.0)
        trial = direction * (t_n + k_t * dv)
        start, rise = self._loading(trial, direction * t_n, cap)
        slip_a, work_a = self._slip_and_work(start)
        slip_b, work_b = self._slip_and_work(start + rise)
        moved = slip_b - slip_a
        tiny = 1e-12 * (1.0 + slip_b)
        relative = jnp.where(
            moved > tiny, (work_b - work_a) / jnp.maximum(moved, tiny), jnp.abs(t) / cap
        )
        slip = plastic_slip(dv, t_n, t, k_t)
        return relative * _mean_cap(slip, dv, t_n, cap_n, cap, k_t) * jnp.abs(slip)

    def _loading(self, trial: Array, along: Array, cap: Array) -> tuple[Array, Array]:
        """Where on the virgin curve the step starts and how far it climbs, in units of cap/k_t."""
        held = jnp.where(along > 0.0, along, 0.0)
        almost_one = 1.0 - 4.0 * jnp.finfo(jnp.result_type(cap)).eps
        ratio = jnp.clip(held / cap, 0.0, almost_one)
        start = ratio / (1.0 - ratio**self.smoothing) ** (1.0 / self.smoothing)
        return start, (jnp.maximum(trial, 0.0) - held) / cap

    def _slip_and_work(self, z: Array) -> tuple[Array, Array]:
        """Plastic slip s = z - S and dissipated work int S ds = S s - int s dS up to z."""
        m, r = self.smoothing, _virgin_curve(z, self.smoothing)
        # int s dr' of s = r' (1 - r'^m)^(-1/m) - r' by incomplete beta functions of x = r'^m up to
        # 1/2 and of y = 1 - r'^m beyond it, where their series at least halve at every term.
        below, above = jnp.minimum(z, 1.0) ** m, jnp.maximum(z, 1.0) ** -m
        x, y = below / (1.0 + below), above / (1.0 + above)
        y = jnp.maximum(y, jnp.finfo(jnp.result_type(y)).tiny)  # its root has no slope at zero
        a, b = 2.0 / m, 1.0 - 1.0 / m
        rising = jnp.minimum(r, 0.5 ** (1.0 / m)) ** 2 * _beta_series(x, a, b)
        half = jnp.full_like(y, 0.5)
        capped = half**b * _beta_series(half, b, a) - y**b * _beta_series(y, b, a)
        stored = (rising + capped) / m - 0.5 * r**2
        slip = z - r
        return slip, r * slip - stored


class CappedTrial(FrictionLaw):
    """A trap, kept to be measured: a smooth cap on the trial traction of every step.

    t = cap y/(1+abs(y)^m)^(1/m) with y = (t_n + k_t dv)/cap.  Every step rounds the traction a
    little lower, so it relaxes with the number of steps.
    """

    smoothing: Array = eqx.field(converter=jnp.asarray, default=16.0)

    def traction(self, dv: Array, t_n: Array, cap: Array, k_t: Array) -> Array:
        """See `FrictionLaw.traction`."""
        y = (t_n + k_t * dv) / cap
        direction = jnp.where(y >= 0.0, 1.0, -1.0)
        return cap * direction * _virgin_curve(direction * y, self.smoothing)


class TanhIncrement(FrictionLaw):
    """A trap, kept to be measured: t = cap tanh(k_t dv/cap), a law of the increment alone.

    It forgets the traction at every step, so it creeps inside the Coulomb cone and its dissipation
    depends on the number of steps.
    """

    def traction(self, dv: Array, t_n: Array, cap: Array, k_t: Array) -> Array:
        """See `FrictionLaw.traction`."""
        return cap * jnp.tanh(k_t * dv / cap)

    def slip_work(
        self, dv: Array, t_n: Array, t: Array, cap_n: Array, cap: Array, k_t: Array
    ) -> Array:
        """Nothing is stored: all work is dissipated."""
        return t * dv


LAWS = ("elastic-slip", "smooth-cap", "tanh-increment")
