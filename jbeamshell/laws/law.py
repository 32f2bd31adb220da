"""Law of a joint: a few numbers, and the force along any history of its displacement."""

from __future__ import annotations

import abc
import dataclasses
import math
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import as_leaf, is_traced, require
from jbeamshell.common.errors import InputError
from jbeamshell.common.failed import nan_unless
from jbeamshell.scene.rows import Key, Part, rows

BISECTIONS = 64  # halvings of the logarithm of a displacement
LONGEST = 40.0  # logarithm of the displacements tried, about that without slip
CYCLES = 3  # cycles that are run where no closed form is known; the last one counts
POINTS = 129  # of one branch of such a cycle; odd, for Simpson's rule
ROUNDING = 1e-6  # of a displacement at the end of what is known
BEYOND = "is gross slip of this law or more: ask for less than"


class Law(Part):
    """Law of a joint between two points, a pytree of its numbers.

    A subclass declares its numbers as fields, and implements `stiffness`, `capacity`, `backbone`
    and `path_forces`; one that is fitted has a start too.  Closed forms of `dissipation` and
    `displacement` replace the slow ones here.

    Attributes
    ----------
    fitted_to : largest displacement of the data that it was fitted to, if it does not slide there;
        else infinite

    Raises
    ------
    InputError
        for a number outside its bounds
    """

    fitted_to: float = eqx.field(default=math.inf, static=True, kw_only=True)
    masing: ClassVar[bool] = False  # True if loops are the backbone doubled, see `MasingLaw`
    by_force: ClassVar[bool] = False  # True if a fit may prescribe forces on a path
    fitted: ClassVar[tuple[str, ...]] = ()  # numbers that a loop tells; all if empty

    @property
    @abc.abstractmethod
    def stiffness(self) -> Array:
        """Stiffness of the stuck joint."""

    @property
    @abc.abstractmethod
    def capacity(self) -> Array:
        """Largest force, at gross slip; infinite if the force rises for ever."""

    @property
    def reach(self) -> Any:
        """Largest displacement at which the law is known: infinite, unless it is one of points."""
        return math.inf

    def unknown_at(self, u: float) -> str:
        """Words of an error at a displacement beyond the `reach`, with the fix."""
        return f"{u:.4g}, beyond {float(self.reach):.4g}, up to which {self.heading} is known"

    @abc.abstractmethod
    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading, an odd function of the displacement; any shape."""

    @abc.abstractmethod
    def path_forces(self, path: ArrayLike) -> Array:
        """Forces (T,) on a path (T,) of displacements, straight between its points, from rest."""

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per steady cycle at a displacement amplitude; any shape."""
        return self._over(amplitude, lambda size: self._cycle(size)[0])

    def displacement(self, force: ArrayLike) -> Array:
        """Displacement amplitude of the steady cycle with a force amplitude; any shape.

        Raises
        ------
        InputError
            for a force that is the law's `capacity` or more; traced, it gives NaN
        """
        force = self._below_capacity(force)
        steady = self.backbone if self.masing else lambda u: self._over(u, self._reached)
        return self._inverse(steady, force)

    def secant_stiffness(self, amplitude: ArrayLike) -> Array:
        """Force amplitude over displacement amplitude of the steady cycle; any shape."""
        size = jnp.asarray(amplitude)
        force = self.backbone(size) if self.masing else self._over(size, self._reached)
        return force / size

    def dissipation_at_force(self, force: ArrayLike) -> Array:
        """Energy lost per steady cycle at a force amplitude; see `displacement`."""
        return self.dissipation(self.displacement(force))

    @classmethod
    def table(cls) -> dict[str, Key]:
        """Rows of the law's numbers by dotted key, such as "iwan4.stiffness"."""
        return {row.name: row for row in rows(cls).values()}

    @classmethod
    def free(cls) -> tuple[str, ...]:
        """Dotted keys of the numbers that a loop tells."""
        return tuple(f"{cls.heading}.{name}" for name in cls.fitted) or tuple(cls.table())

    def get(self, key: str) -> Any:
        """Number of a dotted key."""
        return getattr(self, self._field_of(key))

    def replace(self, values: Mapping[str, Any]) -> Self:
        """Copy with other numbers, by dotted key, which were not fitted; they may be traced."""
        own = {self._field_of(key): value for key, value in values.items()}
        return dataclasses.replace(self, fitted_to=math.inf, **own)

    def as_toml(self) -> str:
        """Entries of a plan of a fit that has this law: its name, and its numbers."""
        numbers = [f'"{key}" = {np.asarray(self.get(key)).tolist()!r}' for key in self.table()]
        return "\n".join([f'model = "{self.heading}"', "", "[set]", *numbers, ""])

    @classmethod
    def started(cls, force: float, displacement: float, work: float, stiffness: float) -> Self:
        """Law to start a fit from, near a loop.

        Parameters
        ----------
        force, displacement : amplitudes of the largest loop
        work : energy per cycle of it
        stiffness : slope right after a reversal
        """
        return dataclasses.replace(cls(), **cls._start(force, displacement, work, stiffness))

    @staticmethod
    def _start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        """Numbers to start a fit from; see `started`."""
        raise InputError("the law has no start of a fit: give its numbers")

    @classmethod
    def _field_of(cls, key: str) -> str:
        if key not in cls.table():
            known = ", ".join(cls.table())
            raise InputError(f"unknown key {key!r}: the numbers of this law are {known}")
        return key.partition(".")[2]

    def _where_known(self, u: Array, values: Array) -> Array:
        """Values (...) at displacements within the reach; others raise, or are NaN if traced."""
        if isinstance(self.reach, float):  # known everywhere
            return values
        within = jnp.abs(u) <= (1.0 + ROUNDING) * self.reach
        if is_traced(within):
            return nan_unless(within, values)
        if not np.all(within):
            most = float(np.max(np.abs(np.asarray(u))))
            raise InputError(f"the {self.heading} is moved by {self.unknown_at(most)}")
        return values

    def _below_capacity(self, force: ArrayLike) -> Array:
        """Sizes of forces, checked; NaN at gross slip and beyond where they are traced."""
        size = jnp.abs(as_leaf(force, "force"))
        if not is_traced(size, self):
            beyond = np.asarray(size >= self.capacity)
            largest = float(np.max(size, initial=0.0))
            fix = f"{BEYOND} {float(self.capacity):.6g}"
            require(f"force of {self.heading}", largest, not beyond.any(), fix)
        return nan_unless(size < self.capacity, size)

    def _inverse(self, rising: Any, force: Array) -> Array:
        """Displacement at which a rising function has a value, with its derivatives."""
        least = jnp.log(jnp.maximum(force / self.stiffness, jnp.finfo(force.dtype).tiny))

        def halve(_: int, ends: tuple[Array, Array]) -> tuple[Array, Array]:
            low, high = ends
            middle = 0.5 * (low + high)
            below = rising(jnp.exp(middle)) < force
            return jnp.where(below, middle, low), jnp.where(below, high, middle)

        ends = lax.fori_loop(0, BISECTIONS, halve, (least - LONGEST, least + LONGEST))
        u = lax.stop_gradient(jnp.exp(0.5 * (ends[0] + ends[1])))
        value, slope = jax.jvp(rising, (u,), (jnp.ones_like(u),))
        step = (force - value) / jnp.where(slope > 0.0, slope, jnp.inf)
        return jnp.where(force > 0.0, u + step, jnp.where(jnp.isnan(force), jnp.nan, 0.0))

    def _cycle(self, size: Array) -> tuple[Array, Array]:
        """Energy of a steady cycle by Simpson's rule on both branches, and its force amplitude."""
        way = jnp.linspace(-1.0, 1.0, POINTS)
        cycle = jnp.concatenate([-way[1:], way[1:]])
        path = size * jnp.concatenate([way, *[cycle] * CYCLES])
        force = self.path_forces(path)[-2 * POINTS + 1 :]
        weight = jnp.where(jnp.arange(POINTS) % 2 == 1, 4.0, 2.0).at[jnp.array([0, -1])].set(1.0)
        step = 2.0 * size / (POINTS - 1) / 3.0
        down, up = force[:POINTS], force[POINTS - 1 :]
        return step * jnp.sum(weight * (up - down[::-1])), 0.5 * (force[-1] - force[POINTS - 1])

    def _reached(self, size: Array) -> Array:
        """Force amplitude of a steady cycle."""
        return self._cycle(size)[1]

    @staticmethod
    def _over(amplitude: ArrayLike, one: Any) -> Array:
        """Function of one amplitude over amplitudes of any shape."""
        size = jnp.asarray(amplitude, dtype=jnp.result_type(float))
        return jax.vmap(one)(size.ravel()).reshape(size.shape)


def as_path(path: ArrayLike) -> Array:
    """Path (T,) as an array of floating-point numbers."""
    return jnp.atleast_1d(jnp.asarray(path, dtype=jnp.result_type(float)))
