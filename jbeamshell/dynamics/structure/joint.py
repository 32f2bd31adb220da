r"""Joint as a force element: a network of Jenkins sliders with the backbone of a strip.

Parallel sliders have a backbone F(u) that is linear between points: where its slope falls by s at
u, a spring of stiffness s starts to slip at the force s u; a spring with the last slope remains
(Iwan 1966).  Their loops follow Masing's rule exactly: the branch from U is F(U) - 2 F((U-u)/2).
A strip becomes one such element by the mean of its pull and its push, whose sliders are the nodes
of its contact; `jbeamshell.condensed.network` has both, and every branch between them, exactly.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from jbeamshell.common.checks import (
    as_leaf,
    is_traced,
    require,
    require_number,
)
from jbeamshell.common.jax_options import ONCE
from jbeamshell.condensed.network import Network, Response
from jbeamshell.quasistatic.solver import solve
from jbeamshell.scene.domain import gross_slip_rule
from jbeamshell.scene.scene import Scene

BACKBONE = "give as many displacements as forces, both rising from above zero, softening throughout"
POINTS = 48  # of a backbone that is walked
SMALLEST_FORCE = 1e-2  # its first point, over the largest force
ANGLES = 512  # quadrature points of half a cycle, for the first harmonic
BELOW = 1.0 - 1e-6  # thresholds nearer to the largest force are left out
TRACED = "is differentiated on the contact line only: take model.rung = plane, or plain numbers"


class Joint(eqx.Module):
    """Force element between two points, given by its backbone.

    Attributes
    ----------
    displacement, force : (k,) points of the backbone; the last slope continues beyond them
    network : sliders of the strip behind it, per width; None for a backbone alone
    width : of the strip

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
    network: Network | None
    width: Array

    def __init__(
        self, displacement: Any, force: Any, network: Network | None = None, width: Any = 1.0
    ) -> None:
        self.displacement = as_leaf(displacement, "joint.displacement", BACKBONE)
        self.force = as_leaf(force, "joint.force", BACKBONE)
        self.network, self.width = network, as_leaf(width, "joint.width")

    def __check_init__(self) -> None:
        if is_traced(self.displacement, self.force):
            return
        u, f = np.asarray(self.displacement), np.asarray(self.force)
        paired = u.ndim == 1 and u.shape == f.shape and u.size > 0
        require("joint.force", f.shape, paired, BACKBONE)
        slopes = np.diff(f, prepend=0.0) / np.diff(u, prepend=0.0)
        rising = bool(np.all(np.diff(u, prepend=0.0) > 0.0) and np.all(slopes >= 0.0))
        softening = bool(np.all(np.diff(slopes) <= 1e-9 * slopes[0]))
        require("joint.force", f, rising and softening and slopes[0] > 0.0, BACKBONE)

    @classmethod
    def of(cls, scene: Scene, force: Any = None, *, width: Any = 1.0) -> Joint:
        """Joint with the mean backbone of a strip's pull and push.

        Scenes on the rung ``plane``, or one such as ``condensed-squeeze``, give the sliders of
        their contact where slip zones are nested; the backbones of others are walked and fitted.

        Parameters
        ----------
        scene : scene of the strip, whose load path is not used.  On such a rung it may be traced;
            slip zones that are not nested then give NaN
        force : largest end force per width, below gross slip; None is ``scene.load.amplitude``
        width : width of the strip, by which forces are multiplied

        Raises
        ------
        InputError
            for a force or a width that is not positive, a force beyond gross slip, or traced
            numbers in a scene whose backbone is walked

        Examples
        --------
        >>> joint = Joint.of(jb.Scene(), 1.2)
        >>> joint.dissipation(joint.displacement[-1])  # energy per cycle
        """
        force = largest_force(scene, force)
        require_number("width", width)
        if scene.model.condensed:
            soft = not scene.ideal_friction
            inside = is_traced(scene, force, jnp.zeros(()))  # in a program of its own options
            sliders = _sliders if inside else _sliders_once
            network, u, f, count = sliders(scene, as_leaf(force, "force"), soft)
            if is_traced(u):
                return cls(u, width * f, network, width)
            if np.all(np.isfinite(u)):
                kept = np.append(np.arange(u.size - 1) < int(count), True)
                u, f = np.asarray(u)[kept], width * np.asarray(f)[kept]
                return cls(u, f, network, width)
        require("scene", "traced", not is_traced(scene, force), TRACED)
        return cls(*_walked(scene, float(force), width), width=width)

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
        """Forces (T,) on a path (T,) of displacements, which starts with unloaded sliders.

        A strip's are exact, pull and push apart, and not those of the mean backbone.

        Raises
        ------
        InputError
            for a path of a strip beyond gross slip, or on which its slip zones are not nested
        """
        points = np.atleast_1d(np.asarray(path, float))
        if self.network is not None:
            return np.asarray(self.width * _exact(self.network, points))
        springs, limits = np.asarray(self.springs), np.asarray(self.limits)
        sliders, last, forces = np.zeros(limits.size), 0.0, []
        for u in points:
            sliders = np.clip(sliders + springs[:-1] * (u - last), -limits, limits)
            last = u
            forces.append(sliders.sum() + springs[-1] * u)
        return np.array(forces)

    @property
    def _points(self) -> tuple[Array, Array]:
        """Points of the backbone, with the origin."""
        zero = jnp.zeros(1)
        return jnp.append(zero, self.displacement), jnp.append(zero, self.force)


def largest_force(scene: Scene, force: Any = None) -> Any:
    """Force up to which a joint is wanted, checked; None is the scene's amplitude."""
    if force is None:
        control = scene.load.control
        fix = "is no force: give force=, or take load.control = 'force'"
        require("load.amplitude", scene.load.amplitude, control == "force", fix)
        force = scene.load.amplitude
    require_number("force", force)
    if not is_traced(scene, force):
        by_force = dataclasses.replace(scene.load, control="force")
        gross_slip_rule(by_force, scene.member, scene.number, force)._replace(key="force").demand()
    return force


def _sliders(scene: Scene, force: Array, soft: bool) -> tuple[Network, Array, Array, Array]:
    """Network, mean backbone (k + 1,) of pull and push, and its count of points below the force.

    The points are the means of the thresholds, and the force; those beyond are laid evenly on the
    straight line from the last one below it.  The displacements are NaN where the slip zones are
    not nested.
    """
    network = Network.of(scene, soft)
    ways = jnp.asarray([1.0, -1.0])
    sides = jax.vmap(lambda way: network.sliders(network.rest, way))(ways)
    levels = jnp.mean(sides.force, axis=0)[1:]
    below = levels < BELOW * force
    count, last = jnp.sum(below), jnp.max(jnp.where(below, levels, 0.0), initial=0.0)
    number = jnp.arange(levels.size)
    part = (number + 1 - count) / (levels.size + 1 - count)

    def mean(forces: Array) -> Array:
        return jnp.mean(jax.vmap(lambda side: side.displacement_after(forces))(sides), axis=0)

    def points(inside: Array, begin: Array, end: Array) -> Array:
        return jnp.append(jnp.where(number < count, inside, begin + (end - begin) * part), end)

    f = points(levels, last, force)
    u = points(mean(levels), mean(last), mean(force))
    nested = jax.vmap(lambda way: network.branch(network.rest, way * force)[2])(ways)
    rising = jnp.all(jnp.diff(f, prepend=0.0) > 0.0)
    return network, jnp.where(jnp.all(nested) & rising, u, jnp.nan), f, count


_sliders_once = jax.jit(_sliders, static_argnums=2, compiler_options=ONCE)


def _exact(network: Network, path: NDArray[np.float64]) -> Array:
    """Forces (T,) per width of a network on a path (T,) of displacements."""
    found = _along(network, jnp.asarray(path))
    reached, limit = jnp.max(jnp.abs(found.state.force), initial=0.0), network.gross_slip
    fix = f"must stay below gross slip, mu F_N L = {float(limit):.6g} per width"
    require("force on the path", float(reached), bool(reached < limit), fix)
    first = int(np.argmin(found.valid))
    nested = bool(np.all(np.asarray(found.valid)))
    fix = "slip zones are not nested from here on: take jbeamshell.condensed.solve"
    require(f"path[{first}]", path[first], nested, fix)
    return found.state.force


@jax.jit
def _along(network: Network, path: Array) -> Response:
    return network.along(path)


def _walked(
    scene: Scene, force: float, width: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Backbone of load steps under pull and push."""
    levels = np.geomspace(SMALLEST_FORCE * force, force, POINTS)
    pull, push = (np.asarray(solve(scene, sign * levels).displacement) for sign in (1.0, -1.0))
    u = 0.5 * (pull - push)[-POINTS:]
    return _softening(u, width * levels)


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
