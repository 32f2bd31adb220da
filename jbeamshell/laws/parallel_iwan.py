"""Iwan's parallel-series network: n Jenkins elements side by side, F = sum clip(k_i u, -f_i, f_i).

References
----------
Iwan, W. D. (1966). A distributed-element model for hysteresis and its steady-state dynamic
    response. J. Appl. Mech. 33, 893-900.
"""

from __future__ import annotations

import abc
import functools
import types
from typing import Any, ClassVar, Self

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require, require_count
from jbeamshell.laws.masing import MasingLaw
from jbeamshell.scene.rows import number

FROM = 0.02  # first slip displacement of `sliders` over the last, at the start of a fit
MOST = 32


class Network(MasingLaw):
    """Jenkins elements side by side; a subclass has their `springs` and `limits`."""

    @property
    @abc.abstractmethod
    def springs(self) -> Array:
        """Stiffnesses (n,)."""

    @property
    @abc.abstractmethod
    def limits(self) -> Array:
        """Slip forces (n,)."""

    @property
    def stiffness(self) -> Array:
        """Stiffness of the stuck joint."""
        return jnp.sum(self.springs)

    @property
    def capacity(self) -> Array:
        """Force of gross slip, of all sliders."""
        return jnp.sum(self.limits)

    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading, an odd function of the displacement; any shape."""
        stretched = self.springs * jnp.asarray(u)[..., None]
        return jnp.sum(jnp.clip(stretched, -self.limits, self.limits), axis=-1)

    def work(self, u: ArrayLike) -> Array:
        """Work on first loading, the integral of the backbone from 0 to u; any shape."""
        size = jnp.abs(jnp.asarray(u))[..., None]
        stuck = jnp.minimum(size, self.limits / self.springs)
        return jnp.sum(self.springs * stuck * (size - 0.5 * stuck), axis=-1)

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per steady cycle at a displacement amplitude; any shape."""
        slips = jnp.abs(jnp.asarray(amplitude))[..., None] - self.limits / self.springs
        return 4.0 * jnp.sum(self.limits * jnp.maximum(slips, 0.0), axis=-1)


class ParallelIwan(Network):
    """Parallel Jenkins elements of any stiffness and slip force.

    Attributes
    ----------
    springs, limits : (n,) stiffness k_i and slip force f_i of each element
    """

    heading: ClassVar[str] = "parallel-iwan"

    springs: Array = number(
        1.0, "Stiffnesses k_i.", symbol="k_i", unit="(force/width)/length", table=True
    )
    limits: Array = number(1.0, "Slip forces f_i.", symbol="f_i", unit="force/width", table=True)

    def __check_init__(self) -> None:
        for name in ("springs", "limits"):
            value, key = getattr(self, name), self.table()[f"{self.heading}.{name}"]
            if not is_traced(value):
                require(key.name, value, bool(np.all(key.holds(np.asarray(value)))), key.words)
        shapes = jnp.shape(self.springs), jnp.shape(self.limits)
        require("parallel-iwan.limits", shapes[1], shapes[0] == shapes[1], "give one per spring")

    @classmethod
    def of_points(cls, displacement: ArrayLike, force: ArrayLike) -> Self:
        """Network with a backbone that is straight between points (n,), and slips from the last.

        The points rise from the first one above zero, and soften throughout.
        """
        u, f = jnp.asarray(displacement), jnp.asarray(force)
        slopes = jnp.diff(f, prepend=0.0) / jnp.diff(u, prepend=0.0)
        springs = slopes - jnp.append(slopes[1:], 0.0)
        return cls(springs, springs * u)

    @staticmethod
    def _start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        """Numbers to start a fit from; see `Law.started`."""
        return {"springs": stiffness, "limits": force}


class Sliders(Network):
    """Sliders whose slip displacements are spread evenly on a logarithmic scale.

    Attributes
    ----------
    first, reach : slip displacements of the first slider and of the last
    force1, force2, ... : slip forces, of the first slider first
    """

    first: Array = number(FROM, "First slip displacement.", symbol="u_1", unit="length")
    reach: Array = number(1.0, "Largest slip displacement.", symbol="u_n", unit="length")
    count: ClassVar[int]

    @property
    def slips(self) -> Array:
        """Slip displacements (n,)."""
        part = jnp.linspace(0.0, 1.0, self.count)
        return self.first * (self.reach / self.first) ** part

    @property
    def limits(self) -> Array:
        """Slip forces (n,)."""
        return jnp.stack([getattr(self, f"force{i}") for i in range(1, self.count + 1)])

    @property
    def springs(self) -> Array:
        """Stiffnesses (n,)."""
        return self.limits / self.slips


@functools.cache
def sliders(count: int) -> type[Sliders]:
    """Law of some sliders, with a number for the slip force of each, called "sliders4" and so on.

    Parameters
    ----------
    count : number of sliders, 2 to 32
    """
    require_count("sliders", count, 2, MOST)
    names = [f"force{i}" for i in range(1, count + 1)]

    def start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        # A bar's backbone softens like a root; its points give positive sliders.
        slips = 1.05 * displacement * np.geomspace(FROM, 1.0, count)
        rise = 1.05 * force * np.sqrt(slips / slips[-1])
        network = ParallelIwan.of_points(slips, rise)
        ends = {"first": slips[0], "reach": slips[-1]}
        return ends | dict(zip(names, np.asarray(network.limits), strict=True))

    sentence = "Slip force of slider {}."
    fields = {
        name: number(
            1.0 / count, sentence.format(name[5:]), symbol=f"f_{{{name[5:]}}}", unit="force/width"
        )
        for name in names
    }
    body: dict[str, Any] = {
        "__annotations__": dict.fromkeys(names, "Array"),
        "__doc__": f"Parallel network of {count} sliders; see `Sliders`.",
        "__module__": __name__,
        "heading": f"sliders{count}",
        "count": count,
        "_start": staticmethod(start),
    }
    return types.new_class(
        f"Sliders{count}", (Sliders,), exec_body=lambda names: names.update(body | fields)
    )
