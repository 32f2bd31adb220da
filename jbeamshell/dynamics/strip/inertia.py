"""Inertia constants of a strip: density and damping."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.polynomial import legendre

from jbeamshell.common.checks import NOT_NEGATIVE, TINY, as_leaf, require
from jbeamshell.common.checks import require_number as number
from jbeamshell.scene.scene import Scene

DENSITY = "give one positive number, or one for each of strip.layers from the bottom to the top"


class Inertia(eqx.Module):
    """Density and damping of a strip.

    Attributes
    ----------
    density : rho, mass per volume; with layers one number for all, or (layers,) from the bottom
    damping_mass, damping_stiffness : coefficients a, 1/time, and b, time, of Rayleigh damping
        C = a M + b K; both are 0 by default

    Raises
    ------
    InputError
        for a density that is not positive, or negative damping

    Examples
    --------
    >>> Inertia(7.8e-9, damping_stiffness=1e-6).damped
    True
    """

    density: Array
    damping_mass: Array
    damping_stiffness: Array
    damped: bool = eqx.field(static=True)

    def __init__(
        self, density: Any = 1.0, damping_mass: Any = 0.0, damping_stiffness: Any = 0.0
    ) -> None:
        self.density = as_leaf(density, "inertia.density", DENSITY)
        self.damping_mass = as_leaf(damping_mass, "inertia.damping_mass")
        self.damping_stiffness = as_leaf(damping_stiffness, "inertia.damping_stiffness")
        coefficients = (self.damping_mass, self.damping_stiffness)
        traced = any(isinstance(c, jax.core.Tracer) for c in coefficients)
        self.damped = traced or any(bool(np.any(np.asarray(c) != 0.0)) for c in coefficients)

    def __check_init__(self) -> None:
        if not isinstance(self.density, jax.core.Tracer):
            known = np.asarray(self.density)
            shaped = known.ndim <= 1 and known.size > 0
            positive = shaped and bool(np.all(np.isfinite(known) & (known > 0.0)))
            require("inertia.density", self.density, positive, DENSITY)
        number("inertia.damping_mass", self.damping_mass, NOT_NEGATIVE, low=-TINY)
        number("inertia.damping_stiffness", self.damping_stiffness, NOT_NEGATIVE, low=-TINY)

    def check(self, scene: Scene) -> None:
        """Raise `InputError` for a scene with another number of layers, or with a width."""
        fix = "masses and forces of a strip that vibrates are per unit of width: take "
        fix += "scene.of_width(None), or Joint.of(scene) in a structure"
        require("strip.width", scene.strip.width, scene.strip.width is None, fix)
        layers = 1 if scene.strip.layers is None else scene.strip.layers.shape[0]
        fits = self.density.ndim == 0 or self.density.shape == (layers,)
        require("inertia.density", self.density, fits, DENSITY)

    def through_height(self, scene: Scene) -> tuple[Array, Array]:
        """Heights s above mid-height and weights rho ds of the integral over it, (points,) each."""
        strip, half = scene.strip, scene.strip.half_height
        points, weights = legendre.leggauss(3)
        if strip.layers is None:
            return half * jnp.asarray(points), jnp.mean(self.density) * half * jnp.asarray(weights)
        thick = strip.layers[:, 0]
        bottom = jnp.cumsum(thick) - thick - half
        density = jnp.broadcast_to(self.density, thick.shape)
        heights = bottom[:, None] + 0.5 * thick[:, None] * (1.0 + points)
        masses = (0.5 * density * thick)[:, None] * weights
        return heights.ravel(), masses.ravel()
