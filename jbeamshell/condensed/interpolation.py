"""Bodies of strips between built ones: Chebyshev polynomials of height and Poisson's ratio.

In units of E' the stiffness of a strip on its contact line depends on L/H and nu alone, and
smoothly so: a dozen heights and half a dozen Poisson's ratios stand for all.
"""

from __future__ import annotations

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import require
from jbeamshell.condensed.body import Body
from jbeamshell.condensed.cycles import SteadyCycles, steady_cycles
from jbeamshell.condensed.dissipation import factors, on_contact_line
from jbeamshell.condensed.entry import goes_on
from jbeamshell.condensed.strip import RULE, condensed, is_pressed_evenly, pressing, stations
from jbeamshell.mechanics import elements
from jbeamshell.scene.scene import Scene

KEYS = ("strip.height_ratio", "strip.poisson_ratio")
SIDE_BY_SIDE = 16  # lanes that are interpolated at once; their factors are found one by one
EDGE = 1e-9  # of a range, by which round-off may leave it
CHECKED = np.geomspace(0.05, 0.95, 8)  # amplitudes over gross slip, for the error


class Bodies(eqx.Module):
    """Strips of a range of heights and Poisson's ratios, interpolated; see `of`.

    Attributes
    ----------
    scene : strip, contact and pressure that they share
    low, high : (2,) ends of the ranges of ln(height ratio) and Poisson's ratio
    coefficients : of the products of Chebyshev polynomials, (points, points) as leading axes;
        stiffness in units of E'
    error : largest relative error of the dissipation at points between the built ones
    """

    scene: Scene
    low: Array
    high: Array
    coefficients: Body
    error: Array

    @classmethod
    def of(
        cls,
        scene: Scene,
        height_ratios: tuple[float, float],
        poisson_ratios: tuple[float, float],
        *,
        nodes: int | None = None,
        points: tuple[int, int] = (12, 6),
    ) -> Bodies:
        """Bodies between strips that are built at the Chebyshev points of both ranges.

        Parameters
        ----------
        scene : homogeneous strip under a uniform pressure
        height_ratios, poisson_ratios : (least, most); the same number twice for one point
        nodes : contact nodes; see `jbeamshell.condensed.dissipation`
        points : numbers of height ratios and Poisson's ratios; 12 and 6 err by some 1e-5 from .03
            to .4 and from .15 to .45, 8 and 4 by 1e-3

        Raises
        ------
        InputError
            if the strip has layers or an energy of its own or goes on beyond the contact, its
            pressure is a table, or a range is none

        Examples
        --------
        >>> bodies = jb.condensed.Bodies.of(jb.library.standard(), (0.03, 0.4), (0.2, 0.4))
        >>> eta, mu = np.array([0.05, 0.1]), np.array([0.1, 0.2])
        >>> values = {"strip.height_ratio": eta, "contact.friction": mu}
        >>> bodies.dissipation(values, [[1.0], [1.0]])  # (2, 1)
        """
        layers, pressure = scene.strip.layers, scene.contact.pressure
        require("strip.layers", layers, layers is None, "must be left out to interpolate bodies")
        support = scene.member.support
        require("member.support", support, support == "none", "must be none for bodies")
        fix = "must be left out to interpolate bodies: it has no moduli to scale with"
        require("energy", scene.energy, scene.energy is None, fix)
        fix = "must be one number to interpolate bodies"
        require("contact.pressure", pressure, is_pressed_evenly(scene), fix)
        for name, pair in (("height_ratios", height_ratios), ("poisson_ratios", poisson_ratios)):
            require(name, pair, len(pair) == 2 and pair[0] <= pair[1], "give (least, most)")
        scene = on_contact_line(scene, nodes)
        require("contact.stick_stiffness", "soft", scene.ideal_friction, "must be 1000 or more")
        fix = "opens the edge of the contact, so that no slip zones are nested: take another"
        require("load.entry", scene.load.entry, not goes_on(scene), fix)
        low = jnp.array([np.log(height_ratios[0]), poisson_ratios[0]])
        high = jnp.array([np.log(height_ratios[1]), poisson_ratios[1]])
        found = cls(scene, low, high, _coefficients(scene, low, high, points), jnp.asarray(0.0))
        return eqx.tree_at(lambda bodies: bodies.error, found, _error(found, points))

    def body(self, scene: Scene) -> Body:
        """Body of a scene that differs from the shared one in numbers; NaN outside the ranges."""
        strip = scene.strip
        at = jnp.stack([jnp.log(strip.height_ratio), jnp.asarray(strip.poisson_ratio)])
        span = jnp.where(self.high > self.low, self.high - self.low, 1.0)
        at = 2.0 * (at - self.low) / span - 1.0
        weights = jnp.where(jnp.all(jnp.abs(at) <= 1.0 + EDGE), 1.0, jnp.nan)
        for x, count in zip(at, self.coefficients.c.shape, strict=True):
            weights = jnp.multiply.outer(weights, _polynomials(x, count))
        found = jax.tree.map(lambda c: jnp.tensordot(weights, c, 2), self.coefficients)
        x, modulus = stations(scene, scene.model.nodes), strip.plane_modulus
        down, up = pressing(scene, x)
        return Body(
            x=x[::-1],
            tributary=elements.tributary_lengths(RULE, x)[::-1],
            K_tt=modulus * found.K_tt,
            K_tn=modulus * found.K_tn,
            K_nn=modulus * found.K_nn,
            f_t=found.f_t,
            f_n=found.f_n,
            r_0=(down - up)[::-1],
            t_0=jnp.zeros_like(found.f_t),
            c=found.c / modulus,
        )

    def factors(self, scene: Scene) -> SteadyCycles:
        """Factors of a scene that differs from the shared one in numbers, for steady cycles."""
        return steady_cycles(self.body(scene), scene.contact.friction)

    def dissipation(self, values: Mapping[str, ArrayLike], amplitudes: ArrayLike) -> Array:
        """Work of friction per steady cycle of many strips, each at its own amplitudes.

        Parameters
        ----------
        values : (lanes,) numbers of the scenes by key, such as "strip.height_ratio"
        amplitudes : (lanes, k) of the end force

        Returns
        -------
        (lanes, k) works per unit width; NaN where slip zones are not nested, or outside the ranges
        """
        columns = {key: jnp.asarray(column, float) for key, column in values.items()}
        return _lanes(self, columns, jnp.asarray(amplitudes, float))


@eqx.filter_jit
def _lanes(bodies: Bodies, values: dict[str, Array], amplitudes: Array) -> Array:
    def one(lane: tuple[dict[str, Array], Array]) -> Array:
        numbers, own = lane
        return bodies.factors(bodies.scene.replace(numbers)).dissipation(own)

    return lax.map(one, (values, amplitudes), batch_size=SIDE_BY_SIDE)


@eqx.filter_jit
def _built(scene: Scene, points: Array) -> Body:
    """Bodies at points (bodies, 2) of ln(height ratio) and Poisson's ratio, in units of E'."""

    def one(point: Array) -> Body:
        own = scene.replace(dict(zip(KEYS, (jnp.exp(point[0]), point[1]), strict=True)))
        body, modulus = condensed(own, own.model.nodes).body, own.strip.plane_modulus
        stiffness = {name: getattr(body, name) / modulus for name in ("K_tt", "K_tn", "K_nn")}
        return Body(**vars(body) | stiffness | {"c": body.c * modulus})

    return lax.map(one, points)


def _coefficients(scene: Scene, low: Array, high: Array, points: tuple[int, int]) -> Body:
    at = [np.cos(np.pi * (np.arange(count) + 0.5) / count) for count in points]
    places = np.stack(np.meshgrid(*at, indexing="ij"), axis=-1).reshape(-1, 2)
    bodies = _built(scene, low + 0.5 * (places + 1.0) * (high - low))
    first, second = (_transform(x) for x in at)

    def transformed(values: Array) -> Array:
        own = values.reshape(*points, *values.shape[1:])
        return jnp.einsum("pi,qj,ij...->pq...", first, second, own)

    return jax.tree.map(transformed, bodies)


def _transform(points: np.ndarray) -> np.ndarray:
    """Matrix (n, n) from values at the n Chebyshev points to coefficients."""
    order = np.arange(points.size)[:, None]
    return np.cos(order * np.arccos(points)) * np.where(order, 2.0, 1.0) / points.size


def _polynomials(x: Array, count: int) -> Array:
    """Chebyshev polynomials (count,) at x."""
    found = [jnp.ones_like(x), x]
    while len(found) < count:
        found.append(2.0 * x * found[-1] - found[-2])
    return jnp.stack(found[:count])


def _error(bodies: Bodies, points: tuple[int, int]) -> Array:
    """Largest relative error of the dissipation half way between built strips."""
    scene = bodies.scene
    between = [np.cos(np.pi * np.array([1, count // 2]) / count) for count in points]
    places = np.stack(np.meshgrid(*between, indexing="ij"), axis=-1).reshape(-1, 2)
    at = bodies.low + 0.5 * (places + 1.0) * (bodies.high - bodies.low)
    force = scene.contact.friction * scene.contact.pressure * scene.strip.length
    amplitudes = jnp.broadcast_to(CHECKED * force, (at.shape[0], CHECKED.size))
    columns = dict(zip(KEYS, (jnp.exp(at[:, 0]), at[:, 1]), strict=True))
    found = bodies.dissipation(columns, amplitudes)
    exact = _exact(scene, columns, amplitudes)
    return jnp.nanmax(jnp.abs(found / exact - 1.0))


@eqx.filter_jit
def _exact(scene: Scene, values: dict[str, Array], amplitudes: Array) -> Array:
    def one(lane: tuple[dict[str, Array], Array]) -> Array:
        numbers, own = lane
        return factors(scene.replace(numbers), nodes=scene.model.nodes).dissipation(own)

    return lax.map(one, (values, amplitudes))
