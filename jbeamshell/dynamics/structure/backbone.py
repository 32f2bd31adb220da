r"""Backbone of sliders in parallel: forces, energies and first harmonic, and how far it is known.

The backbone is linear between its points: where its slope falls by s at u, a spring of stiffness s
starts to slip at the force s u; a spring with the last slope remains (Iwan 1966).  Beyond the last
point nothing is known, unless it is gross slip, where the slope is zero and the force stays.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require_number
from jbeamshell.common.errors import InputError
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.summary import Summary, ranged

GROSS = 0.99  # force over that of gross slip from which on the last point counts as gross slip
FLAT = 1e-9  # last slope over the first one that counts as zero
ROUNDING = 1e-6  # of a displacement at the last point


class Equivalent(NamedTuple):
    """Spring and damper in place of a joint under a mass, at an amplitude; any shape.

    Attributes
    ----------
    amplitude : displacement amplitude
    stiffness : force over displacement, of the first harmonic
    damping : damping coefficient, force over velocity
    damping_ratio : half the loss factor
    frequency : angular frequency of the mass
    """

    amplitude: Array
    stiffness: Array
    damping: Array
    damping_ratio: Array
    frequency: Array

    def __str__(self) -> str:
        columns = self._asdict()
        rows = [(name.replace("_", " "), ranged(np.asarray(columns[name]))) for name in columns]
        return Summary("spring and damper in place of a joint", rows).as_text()


class Backbone(eqx.Module):
    """Sliders in parallel, given by the points of their backbone.

    Attributes
    ----------
    displacement, force : (k,) points
    width : of the strip behind them
    capacity : force of gross slip; infinite if it is not known
    """

    displacement: Array
    force: Array
    width: Array
    capacity: Array

    @property
    def reach(self) -> Array:
        """Largest displacement at which the joint is known; infinite if it ends in gross slip."""
        slopes = self._slopes
        return jnp.where(slopes[-1] <= FLAT * slopes[0], jnp.inf, self.displacement[-1])

    @property
    def below_gross_slip(self) -> tuple[Array, Array]:
        """Displacements and forces of the points up to the largest force, without a plateau."""
        count = 1 + int(jnp.argmax(self.force >= self.force[-1]))
        return self.displacement[:count], self.force[:count]

    @property
    def _ends_in_gross_slip(self) -> bool:
        """True if the last point is gross slip, and no plateau follows yet."""
        u, f = self.displacement, self.force
        paired = u.ndim == 1 and u.shape == f.shape and u.size > 0
        if is_traced(u, f, self.capacity) or not paired or np.ndim(self.capacity):
            return False
        rising = f.size == 1 or float(f[-1]) > float(f[-2])
        return rising and float(f[-1]) >= GROSS * float(self.capacity)

    def unknown_at(self, u: float) -> str:
        """Words of an error at a displacement beyond the reach, with the fix."""
        capacity, top = float(self.capacity), float(self.force[-1])
        if np.isfinite(capacity):
            level = 0.5 * (1.0 + GROSS) * capacity / float(self.width)
            fix = f"give Joint.of the force {level:.6g} per width, or points up to there: this is "
            fix += "nearly gross slip, beyond which the force is known"
        else:
            fix = f"give more points, or capacity={top:.6g} if it slides at this force (gross slip)"
        return (
            f"{u:.4g}, beyond its backbone, which ends at {float(self.displacement[-1]):.4g} and "
            f"the force {top:.4g}, below gross slip: take less, or {fix}"
        )

    def _where_known(self, u: Array, values: Array) -> Array:
        """Values (...) at displacements within the reach; others raise, or are NaN if traced."""
        within = jnp.abs(u) <= (1.0 + ROUNDING) * self.reach
        if is_traced(within):
            return nan_unless(within, values)
        if not np.all(within):
            most = float(np.max(np.abs(np.asarray(u))))
            raise InputError(f"the joint is moved by {self.unknown_at(most)}")
        return values

    @property
    def springs(self) -> Array:
        """Stiffnesses (k,) of the k-1 sliders and of the spring that remains."""
        slopes = self._slopes
        return jnp.append(-jnp.diff(slopes), slopes[-1:])

    @property
    def limits(self) -> Array:
        """Forces (k-1,) at which the sliders slip."""
        return self.springs[:-1] * self.displacement[:-1]

    @property
    def _slopes(self) -> Array:
        """Slopes (k,) of the backbone's segments."""
        zero = jnp.zeros(1)
        rise = jnp.diff(jnp.append(zero, self.force))
        return rise / jnp.diff(jnp.append(zero, self.displacement))

    @property
    def stiffness(self) -> Array:
        """Stiffness of the stuck joint."""
        return self._slopes[0]

    def line(self, u: Array) -> Array:
        """Backbone whose last slope goes on, for searches; any shape."""
        return self.springs[-1] * u + jnp.sum(self.springs[:-1] * self._stretched(u), axis=-1)

    def tangent(self, u: ArrayLike) -> Array:
        """Slope of the `line`; any shape."""
        segment = jnp.searchsorted(self.displacement, jnp.abs(jnp.asarray(u)), side="right")
        return self._slopes[jnp.minimum(segment, self._slopes.size - 1)]

    def work(self, u: ArrayLike) -> Array:
        """Work on first loading, the integral of the backbone from 0 to u; any shape."""
        u = jnp.asarray(u)
        stored = self.springs[:-1] * self._stretched(u) ** 2 / 2.0
        slid = 0.25 * self.dissipation(jnp.abs(u))
        return 0.5 * self.springs[-1] * u**2 + jnp.sum(stored, axis=-1) + slid

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per cycle at a displacement amplitude, 4 times limit times slip; any shape.

        It equals that of Masing's rule.
        """
        size = jnp.abs(jnp.asarray(amplitude))
        return self._where_known(size, self.loss(size))

    def loss(self, amplitude: Array) -> Array:
        """Energy lost per cycle by the sliders of the `line`; any shape."""
        slip = jnp.maximum(amplitude[..., None] - self.displacement[:-1], 0.0)
        return 4.0 * jnp.sum(self.limits * slip, axis=-1)

    def first_harmonic(self, amplitude: ArrayLike) -> Array:
        """Complex stiffness, the first harmonic of the loop over the amplitude; any shape.

        The real part is elastic; the imaginary part is the energy per cycle over pi amplitude^2.
        """
        size = jnp.abs(jnp.asarray(amplitude))
        return self._where_known(size, self.harmonic(size))

    def harmonic(self, size: Array) -> Array:
        """First harmonic of the `line`; any shape."""
        springs, slip = self.springs, self.displacement[:-1]
        moves = slip < size[..., None]
        part = jnp.where(moves, slip, 0.5) / jnp.where(moves, size[..., None], 1.0)
        angle = jnp.arccos(1.0 - 2.0 * part)  # of the cycle from its turn until the slider slips
        share = jnp.where(moves, (angle - 0.5 * jnp.sin(2.0 * angle)) / jnp.pi, 1.0)
        elastic = springs[-1] + jnp.sum(springs[:-1] * share, axis=-1)
        return elastic + 1j * self.loss(size) / (jnp.pi * jnp.where(size > 0.0, size, 1.0) ** 2)

    def equivalent(self, amplitude: ArrayLike, mass: Any) -> Equivalent:
        """Spring and damper of a mass that the joint holds, at a displacement amplitude; any shape.

        They are the first harmonic of the loop (Krylov & Bogoliubov 1943).

        Parameters
        ----------
        amplitude : displacement amplitude, positive
        mass : mass on the joint

        Raises
        ------
        InputError
            for an amplitude beyond the `reach`, or a mass that is not positive

        Examples
        --------
        >>> found = Joint([1.0, 3.0], [1.0, 2.0]).equivalent(2.0, mass=4.0)
        >>> float(found.stiffness), round(float(found.damping_ratio), 4)
        (0.75, 0.1061)
        """
        require_number("mass", mass)
        complex_stiffness = self.first_harmonic(amplitude)
        stiffness, loss = jnp.real(complex_stiffness), jnp.imag(complex_stiffness)
        frequency = jnp.sqrt(stiffness / mass)
        size = jnp.abs(jnp.asarray(amplitude))
        return Equivalent(size, stiffness, loss / frequency, 0.5 * loss / stiffness, frequency)

    def _stretched(self, u: Array) -> Array:
        """Displacements (..., k-1) of the springs of the sliders on first loading."""
        slip = self.displacement[:-1]
        return jnp.clip(u[..., None], -slip, slip)
