r"""Joint as a force element: a network of Jenkins sliders with the backbone of a strip.

Parallel sliders have a backbone F(u) that is linear between points: where its slope falls by s at
u, a spring of stiffness s starts to slip at the force s u; a spring with the last slope remains
(Iwan 1966).  Their loops follow Masing's rule exactly: the branch from U is F(U) - 2 F((U-u)/2).
A strip becomes one such element by the mean of its pull and its push.
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
SMALLEST_FORCE = 1e-2  # first point of a strip's backbone, over the largest force
ANGLES = 512  # quadrature points of half a cycle, for the first harmonic


class Joint(eqx.Module):
    """Force element between two points, given by its backbone.

    Attributes
    ----------
    displacement, force : (k,) points of the backbone; the last slope continues beyond them

    Raises
    ------
    InputError
        for a backbone that does not rise or that stiffens

    Examples
    --------
    >>> joint = Joint(displacement=[1.0, 3.0], force=[1.0, 2.0])
    >>> joint.springs.tolist(), joint.limits.tolist()
    ([0.5, 0.5], [0.5])
    """

    displacement: Array
    force: Array

    def __init__(self, displacement: Any, force: Any) -> None:
        self.displacement = as_leaf(displacement, "joint.displacement", BACKBONE)
        self.force = as_leaf(force, "joint.force", BACKBONE)

    def __check_init__(self) -> None:
        u, f = np.asarray(self.displacement), np.asarray(self.force)
        paired = u.ndim == 1 and u.shape == f.shape and u.size > 0
        require("joint.force", f.shape, paired, BACKBONE)
        slopes = np.diff(f, prepend=0.0) / np.diff(u, prepend=0.0)
        rising = bool(np.all(np.diff(u, prepend=0.0) > 0.0) and np.all(slopes >= 0.0))
        softening = bool(np.all(np.diff(slopes) <= 1e-9 * slopes[0]))
        require("joint.force", f, rising and softening and slopes[0] > 0.0, BACKBONE)

    @classmethod
    def of(cls, scene: Scene, force: float, *, points: int = POINTS, width: float = 1.0) -> Joint:
        """Joint with the mean backbone of a strip's pull and push.

        Parameters
        ----------
        scene : scene of the strip; its load is not used
        force : largest end force per width, below gross slip
        points : number of points of the backbone, evenly spaced in the logarithm of the force
        width : width of the strip, by which forces are multiplied

        Raises
        ------
        InputError
            for a force or a width that is not positive, or a force beyond gross slip

        Examples
        --------
        >>> joint = Joint.of(jb.Scene(), 1.2)
        >>> joint.dissipation(joint.displacement[-1])  # energy per cycle
        """
        require_number("force", force)
        require_number("width", width)
        levels = np.geomspace(SMALLEST_FORCE * force, force, points)
        pull, push = (np.asarray(solve(scene, sign * levels).displacement) for sign in (1.0, -1.0))
        u = 0.5 * (pull - push)[-points:]
        return cls(*_softening(u, width * levels))

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

    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading, an odd function of the displacement; any shape."""
        size = jnp.abs(jnp.asarray(u))
        inside = jnp.interp(size, *self._points)
        beyond = jnp.maximum(size - self.displacement[-1], 0.0) * self._slopes[-1]
        return jnp.sign(u) * (inside + beyond)

    def tangent(self, u: ArrayLike) -> Array:
        """Slope of the backbone; any shape."""
        segment = jnp.searchsorted(self.displacement, jnp.abs(jnp.asarray(u)), side="right")
        return self._slopes[jnp.minimum(segment, self._slopes.size - 1)]

    def work(self, u: ArrayLike) -> Array:
        """Work on first loading, the integral of the backbone from 0 to u; any shape."""
        x, f = self._points
        size = jnp.abs(jnp.asarray(u))
        at_points = jnp.append(0.0, jnp.cumsum(0.5 * (f[1:] + f[:-1]) * jnp.diff(x)))
        segment = jnp.clip(jnp.searchsorted(x, size, side="right") - 1, 0, x.size - 1)
        beyond = size - x[segment]
        return at_points[segment] + 0.5 * beyond * (f[segment] + self.backbone(size))

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy lost per cycle at a displacement amplitude, by Masing's rule; any shape."""
        size = jnp.asarray(amplitude)
        return 8.0 * self.work(size) - 4.0 * self.backbone(size) * size

    def first_harmonic(self, amplitude: ArrayLike) -> Array:
        """Complex stiffness, the first harmonic of the loop over the amplitude; any shape.

        The real part is elastic; the imaginary part is the energy per cycle over pi amplitude^2.
        """
        size = jnp.asarray(amplitude)
        angle = jnp.pi * (jnp.arange(ANGLES) + 0.5) / ANGLES  # from +amplitude to -amplitude
        half_swing = 0.5 * size[..., None] * (1.0 - jnp.cos(angle))
        branch = self.backbone(size)[..., None] - 2.0 * self.backbone(half_swing)
        elastic = 2.0 / ANGLES * jnp.sum(branch * jnp.cos(angle), axis=-1) / size
        return elastic + 1j * self.dissipation(size) / (jnp.pi * size**2)

    def path_forces(self, path: ArrayLike) -> NDArray[np.float64]:
        """Forces (T,) on a path (T,) of displacements, which starts with unloaded sliders."""
        springs, limits = np.asarray(self.springs), np.asarray(self.limits)
        sliders, last, forces = np.zeros(limits.size), 0.0, []
        for u in np.atleast_1d(np.asarray(path, float)):
            sliders = np.clip(sliders + springs[:-1] * (u - last), -limits, limits)
            last = u
            forces.append(sliders.sum() + springs[-1] * u)
        return np.array(forces)

    @property
    def _points(self) -> tuple[Array, Array]:
        """Points of the backbone, with the origin."""
        zero = jnp.zeros(1)
        return jnp.append(zero, self.displacement), jnp.append(zero, self.force)


def _softening(
    u: NDArray[np.float64], f: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points of the concave hull of a backbone; sliders cannot stiffen."""
    kept = [(0.0, 0.0)]
    for point in zip(u, f, strict=True):
        while len(kept) > 1 and _slope(kept[-2], kept[-1]) <= _slope(kept[-1], point):
            kept.pop()
        kept.append(point)
    x, y = np.array(kept[1:]).T
    return x, y


def _slope(a: tuple[float, float], b: tuple[float, float]) -> float:
    return (b[1] - a[1]) / (b[0] - a[0])
