"""What shakes the strip: forces at the loaded end, motions of the foundation, an impact.

An excitation is a frozen pytree with F(t) and the foundation's acceleration; subclass `Excitation`
to bring your own.  Motions are counted from the foundation, which may itself move.
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
    """What acts from outside; this one is nothing: free vibration."""

    def force(self, time: Array) -> Array:
        """F at the loaded end, force per width."""
        return jnp.zeros_like(time)

    def acceleration(self, time: Array) -> tuple[Array, Array]:
        """Acceleration of the foundation along and across the strip, length per time squared."""
        return jnp.zeros_like(time), jnp.zeros_like(time)

    @property
    def push(self) -> Array:
        """Impulse on the loaded end at t = 0, force per width times time."""
        return jnp.zeros(())

    def acts(self, span: float) -> bool:
        """Whether anything happens between 0 and ``span``; a user's own is asked at some times."""
        times = np.linspace(0.0, span, 1001)
        forces = jax.vmap(self.force)(jnp.asarray(times))
        shaken = jax.vmap(self.acceleration)(jnp.asarray(times))
        return bool(np.any(np.asarray(self.push))) or any(
            bool(np.any(np.asarray(values))) for values in (forces, *shaken)
        )


class Harmonic(Excitation):
    """A force A sin(2 pi f t), which grows to its full size within some cycles.

    Attributes
    ----------
    amplitude : A, force per width
    frequency : f, cycles per time
    ramp : cycles until it has its full size, with a smooth start; 0 is at once
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
        """The force over its amplitude."""
        cycles = self.frequency * time
        grown = jnp.where(self.ramp > 0.0, cycles / jnp.where(self.ramp > 0.0, self.ramp, 1.0), 1.0)
        part = jnp.clip(grown, 0.0, 1.0)
        return part**2 * (3.0 - 2.0 * part) * jnp.sin(2.0 * jnp.pi * cycles)


class Shaker(Harmonic):
    """A harmonic acceleration of the foundation; see `Harmonic` for the wave.

    Attributes
    ----------
    direction : "along" the strip or "across" it
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
        """Nothing but inertia acts."""
        return jnp.zeros_like(time)

    def acceleration(self, time: Array) -> tuple[Array, Array]:
        """See `Excitation.acceleration`."""
        return _in_direction(self.direction, self.amplitude * self.wave(time))


class Recorded(Excitation):
    """A force or an acceleration of the foundation as a record, linear in between.

    Before the first time the first value holds, after the last one the last.

    Attributes
    ----------
    times, values : (k,) instants and values
    what : "force", or the foundation's acceleration "along" or "across" the strip
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
    """A blow on the loaded end: a half sine of force, or an impulse at t = 0.

    Attributes
    ----------
    impulse : the force's integral over time
    duration : of the blow; 0 is an impulse, which gives the end its velocity at once
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
        long = jnp.where(self.duration > 0.0, self.duration, 1.0)
        acting = (self.duration > 0.0) & (time < long)
        wave = jnp.sin(jnp.pi * jnp.minimum(time / long, 1.0))
        return jnp.where(acting, 0.5 * jnp.pi * self.impulse / long * wave, 0.0)

    @property
    def push(self) -> Array:
        """See `Excitation.push`."""
        return jnp.where(self.duration > 0.0, 0.0, self.impulse)

    def acts(self, span: float) -> bool:
        """See `Excitation.acts`."""
        return bool(np.any(np.asarray(self.impulse)))


def _in_direction(direction: str, value: Array) -> tuple[Array, Array]:
    nothing = jnp.zeros_like(value)
    return (value, nothing) if direction == "along" else (nothing, value)
