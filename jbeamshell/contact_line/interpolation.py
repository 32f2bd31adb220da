"""Bodies of strips between built ones: Chebyshev polynomials of height and Poisson's ratio.

In units of E' the stiffness of a strip on its contact line depends on L/H and nu alone, and
smoothly so in ln(L/H) and ln(1 - 2 nu): some nineteen heights stand for all from .02 to .8, and ten
Poisson's ratios for all from 0 to .49.  Interpolating what a body answers with would fail, because
that is rough where the end of a slip zone passes a node.
"""

from __future__ import annotations

import functools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.common.pytrees import Tree
from jbeamshell.common.small import Small
from jbeamshell.contact_line.body import Body, Unknown
from jbeamshell.contact_line.section import section_form
from jbeamshell.contact_line.strip import (
    RULE,
    Members,
    Strip,
    condensed,
    is_pressed_evenly,
    pressing,
)
from jbeamshell.mechanics import elements
from jbeamshell.scene.scene import Scene

HEIGHT, POISSON = "strip.height_ratio", "strip.poisson_ratio"
PER_HEIGHT = 4.0  # heights that are built for each factor of e between the least and the most
PER_POISSON = 1.5  # Poisson's ratios for each factor of e between 1 - 2 nu
LEAST = 4  # of either, in a range that is more than a point
EDGE = 1e-9  # of a range, by which round-off may leave it
CLOSE = 5e-4  # of the largest entry of the stiffness, by which an interpolated body may be off
SMALL = 3e-5  # of the largest coefficient of a matrix: less is left out
MOST = 3  # times that the numbers of built bodies are doubled, at most

Range = tuple[float, float]


class Bodies(Tree):
    """Strips of a range of heights and Poisson's ratios, interpolated; see `built`.

    Attributes
    ----------
    low, high : (2,) ends of the ranges of ln(height ratio) and -ln(1 - 2 nu)
    coefficients : of the products of Chebyshev polynomials, (terms,) as leading axis; stiffness in
        units of E', positions in units of L
    terms : orders of both polynomials of each product
    """

    low: Array
    high: Array
    coefficients: Body
    terms: tuple[tuple[int, int], ...] = eqx.field(static=True)

    def strip(self, scene: Scene) -> Strip:
        """Strip of a scene that differs from the one that was built in numbers.

        Fields above the contact and energies are not known: they are NaN.  All is NaN outside the
        ranges.
        """
        section, nu = scene.strip, scene.strip.poisson_ratio
        assert nu is not None
        unit = self._body(jnp.log(section.height_ratio), -jnp.log1p(-2.0 * nu))
        modulus, x = section.plane_modulus, section.length * unit.x[::-1]
        down, up = pressing(scene, x)
        tributary = elements.tributary_lengths(RULE, x)
        body = Body(
            x=x[::-1],
            tributary=tributary[::-1],
            K_tt=modulus * unit.K_tt,
            K_tn=modulus * unit.K_tn,
            K_nn=modulus * unit.K_nn,
            f_t=unit.f_t,
            f_n=unit.f_n,
            r_0=(down - up)[::-1],
            t_0=jnp.zeros_like(unit.f_t),
            c=unit.c / modulus,
        )
        flat, form = jnp.zeros_like(x), section_form(scene)
        none = Members(Unknown.of(x.size, form.pull.size), jnp.full((2 * x.size + 2,) * 2, jnp.nan))
        settled = jnp.zeros_like(body.t_0)
        return Strip(body, form, none, none, x, tributary, down, settled, flat)

    def _body(self, height: Any, poisson: Any) -> Body:
        """Body at a height ratio's logarithm and -ln(1 - 2 nu), of NumPy's arrays or of JAX's."""
        numbers = numbers_of(height)
        at = numbers.stack([height, poisson])
        span = numbers.where(self.high > self.low, self.high - self.low, 1.0)
        at = 2.0 * (at - self.low) / span - 1.0
        inside = numbers.all((abs(at) <= 1.0 + EDGE) | (self.high == self.low))
        orders = np.max(self.terms, axis=0)
        heights, ratios = (_polynomials(x, order) for x, order in zip(at, orders, strict=True))
        ratios = [numbers.where(inside, values, numbers.nan) for values in ratios]
        weights = numbers.stack([heights[first] * ratios[second] for first, second in self.terms])
        # Products of matrices where many bodies are asked for at once.
        return jax.tree.map(lambda values: numbers.tensordot(weights, values, 1), self.coefficients)


def may_be_interpolated(scene: Scene) -> bool:
    """True if a scene's body depends on L/H and nu alone, in units of E'."""
    strip, contact, load = scene.strip, scene.contact, scene.load
    homogeneous = strip.layers is None and scene.energy is None and strip.curvature is None
    homogeneous = homogeneous and strip.poisson_ratio is not None
    alone = scene.member.support == "none" and strip.overhang is None
    pressed = is_pressed_evenly(scene) and contact.normal == "rigid"
    pulled = load.kind == "force" and load.arm is None
    return scene.plan.elastic and homogeneous and alone and pressed and pulled


def built(scene: Scene, height_ratios: Range, poisson_ratios: Range) -> Bodies | None:
    """Bodies between strips that are built at the Chebyshev points of both ranges.

    Half way between built strips they are checked.  Where they are off, more are built.

    Parameters
    ----------
    scene : scene of whose kind they are, see `may_be_interpolated`
    height_ratios, poisson_ratios : (least, most); the same number twice for one point

    Returns
    -------
    Bodies, or None
        None if too many strips would have to be built
    """
    ends = np.array([np.log(height_ratios), -np.log1p(-2.0 * np.array(poisson_ratios))])
    low, high = ends.T
    rates = np.array([PER_HEIGHT, PER_POISSON])
    counts = np.where(high > low, LEAST + np.ceil(rates * (high - low)), 1).astype(int).tolist()
    for _ in range(MOST):
        at = [np.cos(np.pi * (np.arange(count) + 0.5) / count) for count in counts]
        between = [np.cos(np.pi * np.array([1, count // 2]) / count) for count in counts]
        places, checked = (_places(one, low, high) for one in (at, between))
        # Those to check are built with the others, by one program.
        both = jax.device_get(_built((scene, np.concatenate([places, checked]))))
        parts = slice(len(places)), slice(len(places), None)
        made, exact = (jax.tree.map(lambda a, part=part: a[part], both) for part in parts)
        bodies = Bodies(low, high, *_coefficients(made, at))
        if _error(bodies, exact, checked) <= CLOSE:
            return bodies
        counts = [2 * count if count > 1 else 1 for count in counts]
    return None


@functools.partial(Small, level=0)
def _built(inputs: tuple[Scene, Array]) -> Body:
    """Bodies at points (bodies, 2) of ln(height ratio) and -ln(1 - 2 nu), in units of E' and L."""
    scene, points = inputs

    def one(point: Array) -> Body:
        variant = scene.replace({HEIGHT: jnp.exp(point[0]), POISSON: -0.5 * jnp.expm1(-point[1])})
        body, modulus = condensed(variant, variant.plan.nodes).body, variant.strip.plane_modulus
        stiffness = {name: getattr(body, name) / modulus for name in ("K_tt", "K_tn", "K_nn")}
        return body.but(**stiffness, c=body.c * modulus, x=body.x / variant.strip.length)

    return lax.map(one, points)


def _coefficients(bodies: Body, at: list[np.ndarray]) -> tuple[Body, tuple[tuple[int, int], ...]]:
    """Coefficients and terms of bodies at Chebyshev points, without terms that are small."""
    counts, (first, second) = [x.size for x in at], (_transform(x) for x in at)

    def transformed(values: np.ndarray) -> np.ndarray:
        table = values.reshape(*counts, -1)
        coefficients = np.einsum("pi,qj,ijk->pqk", first, second, table, optimize=True)
        return coefficients.reshape(-1, *values.shape[1:])

    coefficients = jax.tree.map(transformed, bodies)
    large = functools.reduce(np.logical_or, map(_is_large, jax.tree.leaves(coefficients)))
    terms = [(int(i), int(j)) for i, j in np.argwhere(large.reshape(counts))]
    return jax.tree.map(lambda values: values[large], coefficients), tuple(terms)


def _is_large(values: np.ndarray) -> np.ndarray:
    """True for terms (terms,) that matter in an array of coefficients (terms, ...)."""
    sizes = np.max(np.abs(values.reshape(len(values), -1)), axis=1)
    large: np.ndarray = sizes > SMALL * np.max(sizes)
    return large


def _places(at: list[np.ndarray], low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Points (points, 2) of the ranges, from those of each in units of -1 to 1."""
    places = np.stack(np.meshgrid(*at, indexing="ij"), axis=-1).reshape(-1, 2)
    points: np.ndarray = low + 0.5 * (places + 1.0) * (high - low)
    return points


def _transform(points: np.ndarray) -> np.ndarray:
    """Matrix (n, n) from values at the n Chebyshev points to coefficients."""
    order = np.arange(points.size)[:, None]
    return np.cos(order * np.arccos(points)) * np.where(order, 2.0, 1.0) / points.size


def _polynomials(x: Any, order: int) -> list[Any]:
    """Chebyshev polynomials up to an order, at x."""
    polynomials = [0.0 * x + 1.0, x]
    while len(polynomials) <= order:
        polynomials.append(2.0 * x * polynomials[-1] - polynomials[-2])
    return polynomials


def _error(bodies: Bodies, exact: Body, places: np.ndarray) -> float:
    """Largest error at some places: of stiffness over its largest entry, of others over theirs."""
    between = [bodies._body(*place) for place in places]
    stiffness = ("K_tt", "K_tn", "K_nn")
    stiffest = max(float(np.max(np.abs(getattr(exact, name)))) for name in stiffness)

    def error(name: str) -> float:
        one, other = getattr(exact, name), np.stack([getattr(body, name) for body in between])
        largest = stiffest if name in stiffness else max(float(np.max(np.abs(one))), 1e-300)
        return float(np.max(np.abs(one - other))) / largest

    return max(map(error, (*stiffness, "f_t", "f_n", "c", "x")))
