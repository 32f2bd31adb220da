r"""The joint as a force element: a network of Jenkins sliders with a strip's backbone.

A backbone F(u) that is linear between its points is that of parallel sliders: where its slope falls
by s at u, a spring s slips from the force s u on, and the last slope stays a spring (Iwan 1966).
Their loops are the backbone doubled, F(U) - 2 F((U-u)/2), exactly: Masing's rule.  So a strip whose
pull and push are alike in the mean goes into a structure as one element.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from jbeamshell.common.checks import as_leaf, require, require_number
from jbeamshell.quasistatic.solver import solve
from jbeamshell.scene.scene import Scene

BACKBONE = "give as many displacements as forces, both rising from above zero, softening throughout"
POINTS = 48
LEAST = 1e-2  # of the largest force: where a strip's backbone starts
ANGLES = 512  # of a cycle, in a first harmonic


class Joint(eqx.Module):
    """A force element between two points, by its backbone.

    Attributes
    ----------
    displacement, force : (k,) the backbone's points, beyond which it goes on with its last slope
    """

    displacement: Array
    force: Array

    def __init__(self, displacement: Any, force: Any) -> None:
        self.displacement = as_leaf(displacement, "joint.displacement", BACKBONE)
        self.force = as_leaf(force, "joint.force", BACKBONE)

    def __check_init__(self) -> None:
        u, f = np.asarray(self.displacement), np.asarray(self.force)
        fits = u.ndim == 1 and u.shape == f.shape and u.size > 0
        require("joint.force", f.shape, fits, BACKBONE)
        slopes = np.diff(f, prepend=0.0) / np.diff(u, prepend=0.0)
        rising = bool(np.all(np.diff(u, prepend=0.0) > 0.0) and np.all(slopes >= 0.0))
        softening = bool(np.all(np.diff(slopes) <= 1e-9 * slopes[0]))
        require("joint.force", f, rising and softening and slopes[0] > 0.0, BACKBONE)

    @classmethod
    def of(cls, scene: Scene, force: float, *, points: int = POINTS, width: float = 1.0) -> Joint:
        """The mean backbone of a strip's pull and push.

        Parameters
        ----------
        scene : the strip; of its load nothing is used
        force : the largest end force per width, below gross slip
        points : of the backbone, evenly spaced in the logarithm of the force
        width : of the strip, which multiplies the forces
        """
        require_number("force", force)
        require_number("width", width)
        levels = np.geomspace(LEAST * force, force, points)
        pull, push = (np.asarray(solve(scene, sign * levels).displacement) for sign in (1.0, -1.0))
        u = 0.5 * (pull - push)[-points:]
        return cls(*_softening(u, width * levels))

    @property
    def springs(self) -> Array:
        """Stiffness of every slider, (k,), and of the spring that stays, (1,): (k+1,)."""
        slopes = self._slopes
        return jnp.append(-jnp.diff(slopes), slopes[-1:])

    @property
    def limits(self) -> Array:
        """Force at which every slider slips, (k,)."""
        return self.springs[:-1] * self.displacement[:-1]

    @property
    def _slopes(self) -> Array:
        zero = jnp.zeros(1)
        rise = jnp.diff(jnp.append(zero, self.force))
        return rise / jnp.diff(jnp.append(zero, self.displacement))

    @property
    def stiffness(self) -> Array:
        """Of the element that sticks."""
        return self._slopes[0]

    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading, odd in u."""
        size = jnp.abs(jnp.asarray(u))
        inside = jnp.interp(size, *self._points)
        beyond = jnp.maximum(size - self.displacement[-1], 0.0) * self._slopes[-1]
        return jnp.sign(u) * (inside + beyond)

    def tangent(self, u: ArrayLike) -> Array:
        """Slope of the backbone."""
        segment = jnp.searchsorted(self.displacement, jnp.abs(jnp.asarray(u)), side="right")
        return self._slopes[jnp.minimum(segment, self._slopes.size - 1)]

    def work(self, u: ArrayLike) -> Array:
        """Integral of the backbone from 0 to u."""
        x, f = self._points
        size = jnp.abs(jnp.asarray(u))
        whole = jnp.append(0.0, jnp.cumsum(0.5 * (f[1:] + f[:-1]) * jnp.diff(x)))
        segment = jnp.clip(jnp.searchsorted(x, size, side="right") - 1, 0, x.size - 1)
        rest = size - x[segment]
        return whole[segment] + 0.5 * rest * (f[segment] + self.backbone(size))

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per cycle of a displacement amplitude, by Masing's rule."""
        size = jnp.asarray(amplitude)
        return 8.0 * self.work(size) - 4.0 * self.backbone(size) * size

    def first_harmonic(self, amplitude: ArrayLike) -> Array:
        """Complex stiffness: the loop's first harmonic over the amplitude.

        Its real part stores, its imaginary part is the energy per cycle over pi amplitude^2.
        """
        size = jnp.asarray(amplitude)
        angle = jnp.pi * (jnp.arange(ANGLES) + 0.5) / ANGLES  # from +amplitude to -amplitude
        gone = 0.5 * size[..., None] * (1.0 - jnp.cos(angle))
        branch = self.backbone(size)[..., None] - 2.0 * self.backbone(gone)
        store = 2.0 / ANGLES * jnp.sum(branch * jnp.cos(angle), axis=-1) / size
        return store + 1j * self.dissipation(size) / (jnp.pi * size**2)

    def along(self, path: ArrayLike) -> NDArray[np.float64]:
        """Forces along a path of displacements from rest, the sliders sharp."""
        springs, limits = np.asarray(self.springs), np.asarray(self.limits)
        held, at, forces = np.zeros(limits.size), 0.0, []
        for u in np.atleast_1d(np.asarray(path, float)):
            held = np.clip(held + springs[:-1] * (u - at), -limits, limits)
            at = u
            forces.append(held.sum() + springs[-1] * u)
        return np.array(forces)

    @property
    def _points(self) -> tuple[Array, Array]:
        zero = jnp.zeros(1)
        return jnp.append(zero, self.displacement), jnp.append(zero, self.force)


def _softening(
    u: NDArray[np.float64], f: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The points of a backbone's convex hull, which is what a network can have."""
    kept = [(0.0, 0.0)]
    for point in zip(u, f, strict=True):
        while len(kept) > 1 and _slope(kept[-2], kept[-1]) <= _slope(kept[-1], point):
            kept.pop()
        kept.append(point)
    x, y = np.array(kept[1:]).T
    return x, y


def _slope(a: tuple[float, float], b: tuple[float, float]) -> float:
    return (b[1] - a[1]) / (b[0] - a[0])
