r"""Steady forces of elements on periodic displacements.

A slider's force after a displacement d is clip(s + k d, -L, L), exactly, as long as the motion does
not turn within d.  Steps end at the samples and at the turning points between them, which cubic
Hermite interpolation finds.  From rest, every slider has its steady force after half a cycle.

The onset of slip between two samples is a kink of slope J at the part theta of the interval h.  The
sum of samples differs there from the integral by (Euler-Maclaurin)

    integral - h sum = J h^2 B_2(theta)/2,     B_2 = theta^2 - theta + 1/6,

which is added to the two samples; harmonics are then exact to the third order in h.  It fades out
at turning points, so that forces are continuous in the motion.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from jbeamshell.dynamics.structure.elements import Elements


class Wave:
    """Signals of odd harmonics over half a cycle, whose end is the start with the other sign.

    A constant table, which compiled programs contain.

    Attributes
    ----------
    harmonics : (H,) numbers of the harmonics
    value, rate : (P, H) factors exp(i h theta) and i h exp(i h theta) at theta_1 ... theta_P
    step : distance of two samples
    """

    def __init__(self, harmonics: NDArray[np.int64], samples: int) -> None:
        self.harmonics, count = harmonics, samples // 2
        self.step = np.pi / count
        angle = self.step * np.arange(1, count + 1)
        self.value = np.exp(1j * np.outer(angle, harmonics))
        self.rate = 1j * harmonics * self.value

    def samples(self, coefficients: Array) -> tuple[Array, Array]:
        """Samples (P, ...) of a signal and of its rate from complex coefficients (H, ...).

        There may be fewer coefficients than harmonics.
        """
        count = coefficients.shape[0]
        value, rate = self.value[:, :count], self.rate[:, :count]
        return (
            jnp.real(jnp.tensordot(value, coefficients, 1)),
            jnp.real(jnp.tensordot(rate, coefficients, 1)),
        )

    def coefficients(self, samples: Array) -> Array:
        """Coefficients (H, ...), complex, of samples (P, ...)."""
        return jnp.tensordot(2.0 / self.value.shape[0] * self.value.conj().T, samples, 1)


def lost_forces(elements: Elements, wave: Wave, u: Array, rate: Array) -> Array:
    """Steady forces of all elements minus those of the stuck ones, (P, J).

    Parameters
    ----------
    u, rate : (P, J) displacements and their derivatives to theta at theta_1 ... theta_P
    """
    if not elements.springs.size:
        return jnp.zeros_like(u)
    of_each = jax.vmap(_slid, in_axes=(0, 1, 1), out_axes=2)
    return jnp.sum(of_each(elements, u, wave.step * rate), axis=0)


def _shifted(values: Array, places: int) -> Array:
    """Values (..., P) at samples so many places before, or after if negative."""
    moved = jnp.roll(values, places, axis=-1)
    wrapped = slice(None, places) if places > 0 else slice(places, None)
    return moved.at[..., wrapped].multiply(-1.0)


def _turning_points(u0: Array, u1: Array, m0: Array, m1: Array) -> Array:
    """Extreme values between samples; their ends where there is none.

    Values and slopes per interval at both ends of an interval make a cubic.
    """
    turns = m0 * m1 < 0.0
    rise = u1 - u0
    a, b = 3.0 * (m0 + m1 - 2.0 * rise), 6.0 * rise - 4.0 * m0 - 2.0 * m1  # a t^2 + b t + m0 = 0
    root = jnp.sqrt(jnp.maximum(b**2 - 4.0 * a * m0, 0.0))
    below = jnp.where(turns, -b + jnp.sign(m0) * root, 1.0)
    t = lax.stop_gradient(2.0 * m0 / jnp.where(below == 0.0, 1.0, below))  # flat there
    extreme = u0 + t * (m0 + t * (0.5 * b + t * a / 3.0))
    return jnp.where(turns, extreme, u1)


def _slid(law: Elements, u: Array, slope: Array) -> Array:
    """Forces (s, P) that sliders of an element lose by slip, with the corrections of their kinks.

    ``slope`` (P,) is the derivative of u per interval.
    """
    spring, limit = law.springs[:, None], law.limits[:, None]
    before, slope_before = _shifted(u, 1), _shifted(slope, 1)
    turning = _turning_points(before, u, slope_before, slope)
    points = jnp.stack([turning, u], axis=1).ravel()  # (2P,)
    steps = points - jnp.concatenate([before[:1], points[:-1]])
    slips, side, ref, carry = lax.stop_gradient(_history(law.springs, law.limits, before[0], steps))
    # Force since the last slip, which may have been in the cycle before.
    since = limit * side + spring * (points - carry * points[ref])
    at_sample = jnp.where(carry == 0.0, spring * points, since)[:, 1::2]
    # Onset of slip within an interval.
    way, rise = jnp.sign(u - before), spring * (u - before)
    part = (way * limit - _shifted(at_sample, 1)) / jnp.where(rise == 0.0, 1.0, rise)
    onset = slips[:, 0::2] & (part > 0.0) & (part < 1.0)
    first, last = _weights(slope, way)
    kink = spring * (slope_before + part * (slope - slope_before))
    kink *= first + part * (last - first)
    jump = jnp.where(onset, -0.5 * kink * (part * (part - 1.0) + 1.0 / 6.0), 0.0)
    return at_sample + part * jump + _shifted((1.0 - part) * jump, -1) - spring * u


def _weights(slope: Array, way: Array) -> tuple[Array, Array]:
    """Weights (P,) of corrections at both ends of intervals in which u goes one way.

    They fall from 1 to 0 within two samples of a turning point, where the kinks are small.  So the
    forces are continuous when an onset or a turning point passes from one interval to the next, and
    Newton's method finds the onset of slip.
    """
    slopes = [_shifted(slope, 2), _shifted(slope, 1), slope, _shifted(slope, -1)]
    rates = [jnp.maximum(way * each, 0.0) for each in slopes]

    def weight(before: Array, here: Array, after: Array) -> Array:
        least = 2.0 * jnp.minimum(before, after)
        return jnp.minimum(least / jnp.where(here > 0.0, here, 1.0), 1.0)

    return weight(*rates[:3]), weight(*rates[1:])


def _history(
    springs: Array, limits: Array, start: Array, steps: Array
) -> tuple[Array, Array, Array, Array]:
    """Steady history of sliders, (s, 2P) each, over steps (2P,) of half a cycle.

    Returns
    -------
    where a slider slips; the sign of its last slip; the point of it; and the factor of that point,
    -1 if it was in the half cycle before, 0 if the slider never slips
    """

    def walk(state: tuple[Array, ...], step: tuple[Array, Array]) -> Any:
        force, ref, side, carry = state
        trial = force + springs * step[1]
        slips = jnp.abs(trial) > limits
        side = jnp.where(slips, jnp.sign(trial), side)
        last = (jnp.where(slips, step[0], ref), side, jnp.where(slips, 1.0, carry))
        return (jnp.clip(trial, -limits, limits), *last), (slips, *last)

    numbered, never = (jnp.arange(steps.size), steps), jnp.zeros_like(springs)
    first = jnp.clip(springs * start, -limits, limits)
    begin = (first, jnp.zeros(springs.shape, int), never, never)
    (force, ref, side, carry), _ = lax.scan(walk, begin, numbered)
    _, found = lax.scan(walk, (-force, ref, -side, -carry), numbered)
    slips, ref, side, carry = (row.T for row in found)
    return slips, side, ref, carry
