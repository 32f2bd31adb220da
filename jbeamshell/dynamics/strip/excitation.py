"""Excitations: forces at the loaded end, accelerations of the foundation, impacts.

An excitation is a frozen pytree with F(t) and the acceleration of the foundation.  Subclass
`Excitation` for your own.  Displacements are relative to the foundation.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.checks import (
    NOT_NEGATIVE,
    NUMBER,
    TINY,
    as_leaf,
    require,
    require_choice,
    require_number,
)

DIRECTIONS = ("along", "across")
HISTORY = "give as many increasing times as finite values, at least two"


class Excitation(eqx.Module):
    """Free vibration, and the base class of all excitations."""

    def force(self, time: Array) -> Array:
        """Force F at the loaded end at a time, per width."""
        return jnp.zeros_like(time)

    def acceleration(self, time: Array) -> tuple[Array, Array]:
        """Acceleration of the foundation along X and along Y, length per time squared."""
        return jnp.zeros_like(time), jnp.zeros_like(time)

    @property
    def initial_impulse(self) -> Array:
        """Impulse on the loaded end at t = 0, force per width times time."""
        return jnp.zeros(())

    def acts(self, span: float) -> bool:
        """True if the excitation is not zero at all of 1001 times from 0 to ``span``."""
        times = np.linspace(0.0, span, 1001)
        forces = jax.vmap(self.force)(jnp.asarray(times))
        accelerations = jax.vmap(self.acceleration)(jnp.asarray(times))
        return any(
            bool(np.any(np.asarray(values)))
            for values in (self.initial_impulse, forces, *accelerations)
        )


class Harmonic(Excitation):
    """Force A sin(2 pi f t) at the loaded end, with a smooth ramp.

    Attributes
    ----------
    amplitude : A, force per width
    frequency : f, cycles per time
    ramp : number of cycles until the amplitude is A; 0 starts with A
    """

    amplitude: Array
    frequency: Array
    ramp: Array

    def __init__(self, amplitude: Any, frequency: Any, ramp: Any = 0.0) -> None:
        self.amplitude = as_leaf(amplitude, "excitation.amplitude")
        self.frequency = as_leaf(frequency, "excitation.frequency")
        self.ramp = as_leaf(ramp, "excitation.ramp")

    def __check_init__(self) -> None:
        require_number("excitation.amplitude", self.amplitude, NUMBER, low=-np.inf)
        require_number("excitation.frequency", self.frequency)
        require_number("excitation.ramp", self.ramp, NOT_NEGATIVE, low=-TINY)

    def force(self, time: Array) -> Array:
        """See `Excitation.force`."""
        return self.amplitude * self.wave(time)

    def wave(self, time: Array) -> Array:
        """Ramped sine of unit amplitude."""
        cycles = self.frequency * time
        grown = jnp.where(self.ramp > 0.0, cycles / jnp.where(self.ramp > 0.0, self.ramp, 1.0), 1.0)
        level = jnp.clip(grown, 0.0, 1.0)
        return level**2 * (3.0 - 2.0 * level) * jnp.sin(2.0 * jnp.pi * cycles)


class Shaker(Harmonic):
    """Harmonic acceleration of the foundation.

    Attributes
    ----------
    amplitude : acceleration, length per time squared
    frequency, ramp : see `Harmonic`
    direction : "along" the strip (X) or "across" it (Y)
    """

    direction: str = eqx.field(static=True, default="along")

    def __init__(
        self, amplitude: Any, frequency: Any, ramp: Any = 0.0, direction: str = "along"
    ) -> None:
        super().__init__(amplitude, frequency, ramp)
        self.direction = direction

    def __check_init__(self) -> None:
        require_choice("excitation.direction", self.direction, DIRECTIONS)

    def force(self, time: Array) -> Array:
        """Zero; the foundation alone excites the strip."""
        return jnp.zeros_like(time)

    def acceleration(self, time: Array) -> tuple[Array, Array]:
        """See `Excitation.acceleration`."""
        return _in_direction(self.direction, self.amplitude * self.wave(time))


class Recorded(Excitation):
    """Recorded force or acceleration of the foundation, interpolated linearly.

    The first value holds before the first time, and the last value after the last time.

    Attributes
    ----------
    times : (k,) rising times
    values : (k,) forces per width, or accelerations
    what : "force" at the loaded end, or acceleration "along" or "across" the strip

    Examples
    --------
    A force of 1 that vanishes within a time of 0.1:

    >>> release = Recorded([0.0, 0.1], [1.0, 0.0])
    """

    times: Array
    values: Array
    what: str = eqx.field(static=True)

    def __init__(self, times: Any, values: Any, what: str = "force") -> None:
        self.times = as_leaf(times, "excitation.times", HISTORY)
        self.values = as_leaf(values, "excitation.values", HISTORY)
        self.what = what

    def __check_init__(self) -> None:
        require_choice("excitation.what", self.what, ("force", *DIRECTIONS))
        paired = self.times.ndim == 1 and self.times.shape == self.values.shape
        require("excitation.times", self.times.shape, paired and self.times.size > 1, HISTORY)
        if not isinstance(self.times, jax.core.Tracer):
            rising = bool(np.all(np.diff(np.asarray(self.times)) > 0.0))
            require("excitation.times", self.times, rising, HISTORY)
        if not isinstance(self.values, jax.core.Tracer):
            finite = bool(np.all(np.isfinite(np.asarray(self.values))))
            require("excitation.values", self.values, finite, HISTORY)

    def _value(self, time: Array) -> Array:
        return jnp.interp(time, self.times, self.values)

    def force(self, time: Array) -> Array:
        """See `Excitation.force`."""
        return self._value(time) if self.what == "force" else jnp.zeros_like(time)

    def acceleration(self, time: Array) -> tuple[Array, Array]:
        """See `Excitation.acceleration`."""
        if self.what == "force":
            return jnp.zeros_like(time), jnp.zeros_like(time)
        return _in_direction(self.what, self._value(time))

    def acts(self, span: float) -> bool:
        """See `Excitation.acts`."""
        times = np.unique(np.clip(np.asarray(self.times), 0.0, span))
        times = np.append(times, [0.0, span])
        return bool(np.any(np.interp(times, np.asarray(self.times), np.asarray(self.values))))


class Impact(Excitation):
    """Impact on the loaded end: a half sine of force, or an impulse at t = 0.

    Attributes
    ----------
    impulse : integral of the force over time, per width
    duration : duration of the half sine; 0 is an impulse, which sets the initial velocity
    """

    impulse: Array
    duration: Array

    def __init__(self, impulse: Any, duration: Any = 0.0) -> None:
        self.impulse = as_leaf(impulse, "excitation.impulse")
        self.duration = as_leaf(duration, "excitation.duration")

    def __check_init__(self) -> None:
        require_number("excitation.impulse", self.impulse, NUMBER, low=-np.inf)
        require_number("excitation.duration", self.duration, NOT_NEGATIVE, low=-TINY)

    def force(self, time: Array) -> Array:
        """See `Excitation.force`."""
        duration = jnp.where(self.duration > 0.0, self.duration, 1.0)
        acts = (self.duration > 0.0) & (time < duration)
        wave = jnp.sin(jnp.pi * jnp.minimum(time / duration, 1.0))
        return jnp.where(acts, 0.5 * jnp.pi * self.impulse / duration * wave, 0.0)

    @property
    def initial_impulse(self) -> Array:
        """See `Excitation.initial_impulse`."""
        return jnp.where(self.duration > 0.0, 0.0, self.impulse)

    def acts(self, span: float) -> bool:
        """See `Excitation.acts`."""
        return bool(np.any(np.asarray(self.impulse)))


def _in_direction(direction: str, value: Array) -> tuple[Array, Array]:
    """Acceleration along X and along Y."""
    zero = jnp.zeros_like(value)
    return (value, zero) if direction == "along" else (zero, value)
