r"""Iwan's parallel network: n Jenkins elements and a spring side by side.

    F = k_0 u + sum_i k_i clip(u, -u_i, u_i),   D = 4 sum_i k_i u_i max(U - u_i, 0),

and the first harmonic of the loop over the amplitude is the complex stiffness

    k_0 + sum_i k_i (theta_i - sin(2 theta_i)/2)/pi + i D/(pi U^2),  cos(theta_i) = 1 - 2 u_i/U,

where theta_i is the angle of the cycle from its turn until the slider slips.

References
----------
Iwan, W. D. (1966). A distributed-element model for hysteresis and its steady-state dynamic
    response. J. Appl. Mech. 33, 893-900.
"""

from __future__ import annotations

import abc
import functools
import types
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require, require_count
from jbeamshell.laws.law import Law
from jbeamshell.laws.masing import MasingLaw
from jbeamshell.scene.rows import number

FROM = 0.02  # first slip displacement of `sliders` over the last, at the start of a fit
MOST = 32
POINTS = 160  # of a smooth backbone
HALVED = 8  # of them, which halve the way to the last one
LEAST = 1e-5  # displacement of the first of them, over the last one's
NEARLY = 1.0 - 1e-6  # part of gross slip that the last of them reaches
NO_MASING = "has no Masing memory, so no sliders hold it: take iwan4, bar, mindlin or sliders8"
ENDLESS = "rises for ever: give the largest force, Joint.of(law, force)"


class ParallelIwan(MasingLaw):
    """Sliders and a spring side by side; a subclass has the `springs` and `slips` of the sliders.

    `line`, `loss` and `harmonic` go on beyond the `reach`, for searches.
    """

    @property
    @abc.abstractmethod
    def springs(self) -> Array:
        """Stiffnesses (n,) of the sliders."""

    @property
    @abc.abstractmethod
    def slips(self) -> Array:
        """Displacements (n,) at which the sliders slip on first loading."""

    @property
    def spring(self) -> Array:
        """Stiffness of the spring, which never slips."""
        return jnp.zeros(())

    @property
    def limits(self) -> Array:
        """Slip forces (n,)."""
        return self.springs * self.slips

    @property
    def stiffness(self) -> Array:
        """Stiffness of the stuck joint."""
        return self.spring + jnp.sum(self.springs, axis=-1)

    @property
    def capacity(self) -> Array:
        """Force of gross slip, of all sliders; infinite with a spring."""
        return jnp.where(self.spring > 0.0, jnp.inf, jnp.sum(self.limits))

    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading, an odd function of the displacement; any shape.

        Raises
        ------
        InputError
            for a displacement beyond the `reach`, here and below; traced ones give NaN there
        """
        u = jnp.asarray(u)
        return self._where_known(u, self.line(u))

    def work(self, u: ArrayLike) -> Array:
        """Work on first loading, the integral of the backbone from 0 to u; any shape."""
        size = jnp.abs(jnp.asarray(u))
        stuck = jnp.minimum(size[..., None], self.slips)
        own = jnp.sum(self.springs * stuck * (size[..., None] - 0.5 * stuck), axis=-1)
        return self._where_known(size, 0.5 * self.spring * size**2 + own)

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per steady cycle at a displacement amplitude; any shape."""
        size = jnp.abs(jnp.asarray(amplitude))
        return self._where_known(size, self.loss(size))

    def first_harmonic(self, amplitude: ArrayLike) -> Array:
        """Complex stiffness, the first harmonic of the loop over the amplitude; any shape.

        The real part is elastic; the imaginary part is the energy per cycle over pi amplitude^2.
        """
        size = jnp.abs(jnp.asarray(amplitude))
        return self._where_known(size, self.harmonic(size))

    def line(self, u: Array) -> Array:
        """Backbone whose last slope goes on; any shape."""
        stretched = jnp.clip(u[..., None], -self.slips, self.slips)
        return self.spring * u + jnp.sum(self.springs * stretched, axis=-1)

    def tangent(self, u: ArrayLike) -> Array:
        """Slope of the `line`; any shape."""
        stuck = jnp.abs(jnp.asarray(u))[..., None] < self.slips
        return self.spring + jnp.sum(jnp.where(stuck, self.springs, 0.0), axis=-1)

    def loss(self, amplitude: Array) -> Array:
        """Energy lost per cycle by the sliders of the `line`; any shape."""
        slip = jnp.maximum(amplitude[..., None] - self.slips, 0.0)
        return 4.0 * jnp.sum(self.limits * slip, axis=-1)

    def harmonic(self, size: Array) -> Array:
        """First harmonic of the `line`; any shape."""
        moves = self.slips < size[..., None]
        part = jnp.where(moves, self.slips, 0.5) / jnp.where(moves, size[..., None], 1.0)
        angle = jnp.arccos(1.0 - 2.0 * part)  # of the cycle from its turn until the slider slips
        share = jnp.where(moves, (angle - 0.5 * jnp.sin(2.0 * angle)) / jnp.pi, 1.0)
        elastic = self.spring + jnp.sum(self.springs * share, axis=-1)
        return elastic + 1j * self.loss(size) / (jnp.pi * jnp.where(size > 0.0, size, 1.0) ** 2)


def backbone_points(law: Law, force: Any = None) -> tuple[Array, Array]:
    """Points (k,) of a law's backbone whose chords are sliders: displacements and forces.

    Sliders give their own points, exactly.  Other laws of Masing's rule give 160 points from 1e-5
    of the displacement at gross slip on, or of that of the force; sliders on them lose the law's
    energy within 1 % from 1e-3 of that displacement on.  The last point lies on the plateau of
    gross slip, unless a force is given.  All numbers of the law may be traced; but within a
    thousandth of gross slip, derivatives are within 3 % too.

    Raises
    ------
    InputError
        for a law without Masing's memory, or one whose force rises for ever
    """
    require("law", law.heading, isinstance(law, MasingLaw), NO_MASING)
    endless = not is_traced(law) and force is None and not np.isfinite(law.capacity)
    require("law", law.heading, not endless, ENDLESS)
    if isinstance(law, ParallelIwan) and force is None:
        u = jnp.sort(law.slips)
    else:
        end = law.displacement(NEARLY * law.capacity if force is None else force)
        # Only the last point moves with the law, so its neighbours are close.  Chords between
        # moving points have slopes, by the law's numbers, that swing about the law's by a fifth.
        inner = jnp.geomspace(LEAST, 1.0, POINTS - HALVED)[:-1]
        near = 1.0 - (1.0 - inner[-1]) * 0.5 ** jnp.arange(1, HALVED + 1)
        u = jnp.append(lax.stop_gradient(end) * jnp.append(inner, near), end)
    f = law.backbone(u)
    if force is not None:
        return u, f
    return jnp.append(u, 2.0 * u[-1]), jnp.append(f, f[-1])


class Sliders(ParallelIwan):
    """Sliders whose slip displacements are spread evenly on a logarithmic scale.

    Attributes
    ----------
    first, last : slip displacements of the first slider and of the last
    force1, force2, ... : slip forces, of the first slider first
    """

    first: Array = number(FROM, "First slip displacement.", symbol="u_1", unit="length")
    last: Array = number(1.0, "Last slip displacement.", symbol="u_n", unit="length")
    count: ClassVar[int]

    @property
    def slips(self) -> Array:
        """Slip displacements (n,)."""
        part = jnp.linspace(0.0, 1.0, self.count)
        return self.first * (self.last / self.first) ** part

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
        slopes = np.diff(1.05 * force * np.sqrt(slips / slips[-1]), prepend=0.0)
        slopes = np.append(slopes / np.diff(slips, prepend=0.0), 0.0)
        limits = -np.diff(slopes) * slips
        return {"first": slips[0], "last": slips[-1]} | dict(zip(names, limits, strict=True))

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
