r"""Friction laws of one contact point: traction t from an increment dv of slip.

The sharp slider (Jenkins 1962), and the same with a rounded corner (the curve of Menegotto & Pinto
1973 without hardening), as a step goes up from zero traction:

    t = min(k_t dv, cap),        t = cap S(k_t dv/cap),   S(z) = z/(1+z^m)^(1/m).

A law sees one load step of one point.  It takes the increment ``dv`` of tangential displacement,
the traction ``t_n`` at the start of the step, the Coulomb cap mu R at the end of the step and the
elastic stiffness ``k_t`` (traction per length).  It returns the new traction ``t``, positive along
dv: -t acts on the strip.  The traction is the only memory.  All arguments are scalars; `jax.vmap`
makes the field.

A new law is a subclass of `FrictionLaw` in this file, with a name in `LAWS`.

References
----------
Jenkins, G. M. (1962). Analysis of the stress-strain relationships in reactor grade graphite. Br. J.
    Appl. Phys. 13, 30-32.
Menegotto, M. & Pinto, P. E. (1973). Method of analysis for cyclically loaded R.C. plane frames.
    IABSE Reports 13, 15-22.
"""

from __future__ import annotations

import abc
import dataclasses
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jax import Array


def coulomb_cap(friction: Any, reaction: Any) -> Any:
    """Coulomb cap mu max(R, 0), for numbers and arrays of NumPy or of JAX."""
    return friction * reaction.clip(0.0)


class FrictionLaw(eqx.Module):
    """Friction law of one point; a subclass implements `traction`.

    A field ``smoothing``, if a law has one, is the exponent m of ``contact.smoothing``.

    Examples
    --------
    >>> class Stiffer(FrictionLaw):
    ...     def traction(self, dv, t_n, cap, k_t):
    ...         return jnp.clip(t_n + 2.0 * k_t * dv, -cap, cap)
    >>> scene = jb.Scene().replace({"contact.law": Stiffer()})
    """

    @abc.abstractmethod
    def traction(self, dv: Array, t_n: Array, cap: Array, k_t: Array) -> Array:
        """Traction at the end of the step.

        Parameters
        ----------
        dv : increment of tangential displacement, length
        t_n : traction at the start of the step, stress
        cap : mu R at the end of the step, stress, positive
        k_t : elastic stiffness, stress per length
        """

    @classmethod
    def sharp(cls) -> FrictionLaw:
        """Law of this kind for ``contact.smoothing`` = "sharp"."""
        return cls()

    def limit(self, old: Array, new: Array, t_n: Array, cap: Array, k_t: Array) -> Array:
        """Increment dv of Newton's next iterate, bounded so that the iteration cannot cycle.

        A point that slips one way in the iterate ``old`` and the other way in ``new`` is put to
        the middle of its sticking range instead: it may stick next, but not slip back.

        Parameters
        ----------
        old, new : dv of two successive iterates, length
        t_n, k_t : as in `traction`
        cap : mu R at the start of the step, stress
        """
        before, after = (t_n + k_t * old) / cap, (t_n + k_t * new) / cap
        thrown = ((before >= 0.5) & (after <= -1.0)) | ((before <= -0.5) & (after >= 1.0))
        return jnp.where(thrown, -t_n / k_t, new)

    def slip_work(
        self, dv: Array, t_n: Array, t: Array, cap_n: Array, cap: Array, k_t: Array
    ) -> Array:
        """Work per area dissipated in the step: mean traction times `plastic_slip`.

        Parameters
        ----------
        dv, t_n, k_t : as in `traction`
        t : traction at the end of the step
        cap_n, cap : mu R at the start and at the end of the step
        """
        return 0.5 * (t_n + t) * plastic_slip(dv, t_n, t, k_t)


def plastic_slip(dv: Array, t_n: Array, t: Array, k_t: Array) -> Array:
    """Inelastic part of the increment, dv - (t - t_n)/k_t, length."""
    return dv - (t - t_n) / k_t


def _virgin_curve(z: Array, m: Array) -> Array:
    """Virgin curve S(z) = z/(1+z^m)^(1/m) for z >= 0, in two branches that cannot overflow."""
    small, large = jnp.where(z <= 1.0, z, 1.0), jnp.where(z <= 1.0, 1.0, z)
    below, above = small / (1.0 + small**m) ** (1.0 / m), (1.0 + large**-m) ** (-1.0 / m)
    return jnp.where(z <= 1.0, below, above)


def _beta_series(x: Array, a: Array, b: Array) -> Array:
    """Incomplete beta function over x^a, B_x(a, b)/x^a, for 0 <= x <= 1/2 and b < 1."""
    k = jnp.arange(1, 16, dtype=jnp.result_type(x))
    return 1.0 / a + jnp.sum(jnp.cumprod((1.0 - b / k) * x) / (a + k))


def _mean_cap(slip: Array, dv: Array, t_n: Array, cap_n: Array, cap: Array, k_t: Array) -> Array:
    """Mean cap while the point slips, if slip and cap go linearly through the step."""
    along = jnp.where(slip >= 0.0, 1.0, -1.0)
    gap, approach = cap_n - along * t_n, along * k_t * dv + cap_n - cap
    ratio = gap / jnp.where(approach > 0.0, approach, 1.0)
    onset = jnp.where(approach > 0.0, jnp.clip(ratio, 0.0, 1.0), 1.0)
    return cap + 0.5 * (1.0 - onset) * (cap_n - cap)


class SharpSlip(FrictionLaw):
    """Sharp slider, t = clip(t_n + k_t dv, -cap, cap) (Jenkins 1962).

    It is exact where slip and cap change linearly, so the number of load steps does not matter.
    It neither creeps nor drifts under one-sided cycling.  Its traction has kinks.
    """

    def traction(self, dv: Array, t_n: Array, cap: Array, k_t: Array) -> Array:
        """Traction at the end of the step; see `FrictionLaw.traction`."""
        return jnp.clip(t_n + k_t * dv, -cap, cap)

    def slip_work(
        self, dv: Array, t_n: Array, t: Array, cap_n: Array, cap: Array, k_t: Array
    ) -> Array:
        """Work per area of slip at the cap, exact where dv and cap change linearly."""
        slip = plastic_slip(dv, t_n, t, k_t)
        return _mean_cap(slip, dv, t_n, cap_n, cap, k_t) * jnp.abs(slip)


class ElasticSlip(FrictionLaw):
    r"""Rate-independent elastic slip, smooth in loading and elastic in unloading.

    Loading follows the virgin curve t = cap S(z), S(z) = z/(1+z^m)^(1/m) with z = k_t x/cap, from
    the point of the curve that has the traction t_n.  Unloading is elastic down to zero traction.
    If the cap is constant, one step and a hundred steps along the same path give the same traction,
    and no motion gives no change.  abs(t) <= cap always.  The limit of large m is `SharpSlip`.

    Attributes
    ----------
    smoothing : exponent m, above 1 (8 to 32 in practice)
    """

    smoothing: Array = eqx.field(converter=jnp.asarray, default=16.0)

    def traction(self, dv: Array, t_n: Array, cap: Array, k_t: Array) -> Array:
        """Traction at the end of the step; see `FrictionLaw.traction`."""
        direction = jnp.where(dv >= 0.0, 1.0, -1.0)
        trial = direction * (t_n + k_t * dv)
        start, rise = self._loading(trial, direction * t_n, cap)
        loading = cap * _virgin_curve(start + rise, self.smoothing)
        return direction * jnp.where(trial <= 0.0, jnp.maximum(trial, -cap), loading)

    def slip_work(
        self, dv: Array, t_n: Array, t: Array, cap_n: Array, cap: Array, k_t: Array
    ) -> Array:
        """Work per area of slip along the virgin curve; exact if the cap is constant."""
        direction = jnp.where(dv >= 0.0, 1.0, -1.0)
        trial = direction * (t_n + k_t * dv)
        start, rise = self._loading(trial, direction * t_n, cap)
        slip_a, work_a = self._slip_and_work(start)
        slip_b, work_b = self._slip_and_work(start + rise)
        change = slip_b - slip_a
        tiny = 1e-12 * (1.0 + slip_b)
        ratio = jnp.where(
            change > tiny, (work_b - work_a) / jnp.maximum(change, tiny), jnp.abs(t) / cap
        )
        slip = plastic_slip(dv, t_n, t, k_t)
        return ratio * _mean_cap(slip, dv, t_n, cap_n, cap, k_t) * jnp.abs(slip)

    @classmethod
    def sharp(cls) -> FrictionLaw:
        """Sharp slider, the limit of large m."""
        return SharpSlip()

    def _loading(self, trial: Array, t_n: Array, cap: Array) -> tuple[Array, Array]:
        """Start of the step on the virgin curve and its way along it, in units of cap/k_t."""
        t = jnp.where(t_n > 0.0, t_n, 0.0)
        almost_one = 1.0 - 4.0 * jnp.finfo(jnp.result_type(cap)).eps
        ratio = jnp.clip(t / cap, 0.0, almost_one)
        start = ratio / (1.0 - ratio**self.smoothing) ** (1.0 / self.smoothing)
        return start, (jnp.maximum(trial, 0.0) - t) / cap

    def _slip_and_work(self, z: Array) -> tuple[Array, Array]:
        """Plastic slip s = z - S and dissipated work int S ds = S s - int s dS up to z."""
        m, r = self.smoothing, _virgin_curve(z, self.smoothing)
        # int s dr' of s = r' (1 - r'^m)^(-1/m) - r' by incomplete beta functions: of x = r'^m up to
        # 1/2, of y = 1 - r'^m beyond.  So the terms of their series at least halve.
        below, above = jnp.minimum(z, 1.0) ** m, jnp.maximum(z, 1.0) ** -m
        x, y = below / (1.0 + below), above / (1.0 + above)
        y = jnp.maximum(y, jnp.finfo(jnp.result_type(y)).tiny)  # y**b is steep at zero
        a, b = 2.0 / m, 1.0 - 1.0 / m
        lower = jnp.minimum(r, 0.5 ** (1.0 / m)) ** 2 * _beta_series(x, a, b)
        half = jnp.full_like(y, 0.5)
        upper = half**b * _beta_series(half, b, a) - y**b * _beta_series(y, b, a)
        integral = (lower + upper) / m - 0.5 * r**2
        slip = z - r
        return slip, r * slip - integral


class CappedTrial(FrictionLaw):
    """Smooth cap on the trial traction of every step; a trap, kept to show its error.

    t = cap y/(1+abs(y)^m)^(1/m) with y = (t_n + k_t dv)/cap.  Every step lowers the traction a
    little, so the traction relaxes with the number of steps.

    Attributes
    ----------
    smoothing : exponent m, above 1
    """

    smoothing: Array = eqx.field(converter=jnp.asarray, default=16.0)

    def traction(self, dv: Array, t_n: Array, cap: Array, k_t: Array) -> Array:
        """Traction at the end of the step; see `FrictionLaw.traction`."""
        y = (t_n + k_t * dv) / cap
        direction = jnp.where(y >= 0.0, 1.0, -1.0)
        return cap * direction * _virgin_curve(direction * y, self.smoothing)


class TanhIncrement(FrictionLaw):
    """Law of the increment alone, t = cap tanh(k_t dv/cap); a trap, kept to show its error.

    It forgets the traction at every step.  So it creeps below the cap, and its dissipation depends
    on the number of steps.
    """

    def traction(self, dv: Array, t_n: Array, cap: Array, k_t: Array) -> Array:
        """Traction at the end of the step; see `FrictionLaw.traction`."""
        return cap * jnp.tanh(k_t * dv / cap)

    def slip_work(
        self, dv: Array, t_n: Array, t: Array, cap_n: Array, cap: Array, k_t: Array
    ) -> Array:
        """Work per area t dv: nothing is stored, so all of it is dissipated."""
        return t * dv


LAWS: dict[str, type[FrictionLaw]] = {
    "elastic-slip": ElasticSlip,
    "smooth-cap": CappedTrial,
    "tanh-increment": TanhIncrement,
}
"""Friction laws by the names that ``contact.law`` knows; a law added here needs nothing else."""


def law_name(law: FrictionLaw) -> Any:
    """Name of a friction law in `LAWS`; the law itself if it has none."""
    kind = ElasticSlip if type(law) is SharpSlip else type(law)
    return next((name for name, known in LAWS.items() if known is kind), law)


def law_named(name: str, smoothing: Array | None) -> FrictionLaw:
    """Friction law of a name in `LAWS`.

    Parameters
    ----------
    name : one of `LAWS`
    smoothing : exponent m, for a law that `takes_smoothing`; None is its sharp limit
    """
    kind = LAWS[name]
    return kind.sharp() if smoothing is None else kind(smoothing=smoothing)


def takes_smoothing(law: FrictionLaw | type[FrictionLaw]) -> bool:
    """True if a law has the exponent m, ``smoothing``."""
    return any(field.name == "smoothing" for field in dataclasses.fields(law))
