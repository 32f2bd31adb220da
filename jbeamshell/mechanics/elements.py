r"""Elements along X: their nodes, and the rule that integrates over one of them.

An element of order p has p+1 Gauss-Lobatto nodes.  Strains are taken at its p Gauss points;
friction, contact and pressure act at the nodes with Lobatto weights.

* ``finite-difference``: p = 1, the midpoint (box) scheme, second order.  The squeeze strain itself
  (not its slope) is taken at the two nodes instead of the midpoint.  That keeps its matrix an
  M-matrix: psi does not oscillate at a load edge even if an element is longer than the decay
  length of psi.  The extension e has the same mean, and differs at the two nodes by so much that
  the normal force N does not vary with psi.  With an even e a thin strip would lock as nu nears
  1/2 (enhanced assumed strains; Simo & Rifai 1990).
* ``collocation``: p = 2, the two-point Gauss scheme, fourth order on smooth problems.

Elements are graded towards the loaded end X = L, where the traction concentrates, and towards
steps of the pressure.  Their size grows linearly with the distance from there (geometric grading),
from a fraction of H to a fraction of L.  If the smallest elements serve the last node alone, the
size grows faster below H/48, because the fields around that node need few of them.  The number of
nodes scales all sizes together: twice the nodes halve every element.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.numbers_of import numbers_of, put, without_slopes

ORDER = {"finite-difference": 1, "collocation": 2}

# Element sizes before scaling.  With 161 nodes the end element of the standard strip is about H/16.
# If the strip may not lift, a smaller one would turn its point reaction there into tension.
END_SIZE = 1.0 / 6.0  # of H, at the loaded end
FAR_SIZE = 1.0 / 60.0  # of L, far from it
CONTACT_LINE_FAR_SIZE = 1.0 / 15.0  # the same for sections on their contact line
GROWTH = 0.08  # of the element size per distance
SMALL = 1.0 / 48.0  # of H, below which elements may grow faster:
SMALL_GROWTH = 1.0  # of their size per distance, where they serve the last node alone
TINY = 1e-4  # of H, below which the smallest elements do so


class Rule(NamedTuple):
    """Element rule on [0, 1]: p+1 nodes, Q strain points.

    Attributes
    ----------
    nodes : (p+1,) node positions
    node_weights : (p+1,) Lobatto weights
    weights : (Q,) weights of the strain points
    values : (Q, p+1) interpolation of v, w and beta to the strain points
    squeeze : (Q, p+1) interpolation of psi to the strain points
    slopes : (Q, p+1) derivatives at the strain points, to be divided by the element's length
    """

    nodes: np.ndarray
    node_weights: np.ndarray
    weights: np.ndarray
    values: np.ndarray
    squeeze: np.ndarray
    slopes: np.ndarray


@functools.cache
def element_rule(name: str) -> Rule:
    """Element rule of a name, ``finite-difference`` or ``collocation``."""
    order = ORDER[name]
    inner = np.polynomial.Legendre.basis(order).deriv().roots()
    nodes = 0.5 * (1.0 + np.concatenate([[-1.0], np.sort(inner), [1.0]]))
    points, weights = _gauss(order)
    shapes = _shapes(nodes)
    values = np.stack([shape(points) for shape in shapes], axis=1)
    slopes = np.stack([shape.deriv()(points) for shape in shapes], axis=1)
    node_weights = np.array([shape.integ()(1.0) for shape in shapes])
    squeeze = values
    if name == "finite-difference":
        weights, squeeze = node_weights, np.eye(2)
        values, slopes = np.repeat(values, 2, axis=0), np.repeat(slopes, 2, axis=0)
    return Rule(nodes, node_weights, weights, values, squeeze, slopes)


def _gauss(order: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss points and weights on [0, 1]."""
    points, weights = np.polynomial.legendre.leggauss(order)
    return 0.5 * (1.0 + points), 0.5 * weights


def _shapes(nodes: np.ndarray) -> list[np.polynomial.Polynomial]:
    """Lagrange polynomials of the nodes of an element."""
    shapes = [np.polynomial.Polynomial.fromroots(np.delete(nodes, i)) for i in range(nodes.size)]
    return [shape / shape(node) for shape, node in zip(shapes, nodes, strict=True)]


def vertices(
    elements: int,
    length: ArrayLike,
    half_height: ArrayLike,
    end_size: ArrayLike = END_SIZE,
    steps: Array | None = None,
    growth: ArrayLike = GROWTH,
    far_size: float = FAR_SIZE,
    small_growth: float = GROWTH,
) -> Array:
    """End points of the elements, graded towards X = L and towards steps of the pressure.

    Parameters
    ----------
    elements : number of elements
    length : length L of the strip
    half_height : half height H
    end_size : size of the smallest elements before scaling, over H; or (k + 1,) sizes at the steps
        and at the loaded end
    steps : (k,) increasing positions X of the steps, in [0, L]; nodes need not lie on them
    growth : growth of the element size with the distance from a focus, before scaling; or (k + 1,)
    far_size : size of the largest elements before scaling, over L
    small_growth : growth of elements smaller than H times `SMALL`, before scaling

    Returns
    -------
    (elements + 1,) increasing positions from 0 to L, differentiable in L, H and the steps

    Examples
    --------
    >>> vertices(4, length=2.0, half_height=0.1)
    """
    xp = numbers_of(length, half_height, end_size, steps, growth)
    whole, high = xp.asarray(length), xp.asarray(half_height)
    foci = whole[None] if steps is None else xp.append(steps, whole)
    far = far_size * whole
    end = xp.asarray(end_size) * high
    small = xp.maximum(end, xp.minimum(SMALL * high, far))
    rate = xp.where(far >= end, xp.asarray(growth), -xp.asarray(growth))
    # At the distance d from a focus the size h(d) grows along a straight line from end to small, a
    # flatter one to far, and stays so.  The number of elements within d, int dd/h(d), is a
    # logarithm along each of the two, and then a straight line.
    first, second = (small - end) / small_growth, (far - small) / rate
    first_count = xp.log1p(small_growth * first / end) / small_growth
    second_count = xp.log1p(rate * second / small) / rate

    def at(values: Array, i: ArrayLike) -> Array:
        # Where all foci are alike nothing is gathered: programs then agree on x to the last bit.
        return values[i] if values.ndim else values

    def count(distance: Array, i: ArrayLike) -> Array:
        slope, near = at(rate, i), xp.minimum(distance, at(first, i))
        middle = xp.minimum(distance - near, at(second, i))
        elements = xp.log1p(small_growth * near / at(end, i)) / small_growth
        elements = elements + xp.log1p(slope * middle / at(small, i)) / slope
        return elements + (distance - near - middle) / far

    def reach(elements: Array, i: ArrayLike) -> Array:
        slope, near = at(rate, i), xp.minimum(elements, at(first_count, i))
        middle = xp.minimum(elements - near, at(second_count, i))
        distance = at(end, i) * xp.expm1(small_growth * near) / small_growth
        distance = distance + at(small, i) * xp.expm1(slope * middle) / slope
        return distance + far * (elements - near - middle)

    # Pieces run alternately towards a focus and away from one: from 0 to the first focus, from
    # there half way to the next focus, and so on.
    half_way = 0.5 * (foci[:-1] + foci[1:])
    edges = xp.append(0.0, xp.append(xp.stack([foci[:-1], half_way], 1).ravel(), whole))
    pieces = np.arange(edges.size - 1)
    counts = xp.append(0.0, xp.cumsum(count(xp.diff(edges), pieces // 2)))
    target = counts[-1] * xp.arange(elements + 1) / elements
    # The search is a loop, which nothing is fused with: programs then agree on x to the last bit.
    piece = xp.clip(xp.searchsorted(counts, target, side="right") - 1, 0, edges.size - 2)
    away = edges[piece] + reach(target - counts[piece], piece // 2)
    towards = edges[piece + 1] - reach(counts[piece + 1] - target, piece // 2)
    inner = xp.where(piece % 2 == 1, away, towards)[1:-1]
    return xp.concatenate([0.0 * whole[None], inner, whole[None]])


def table_steps(table: Array, length: ArrayLike) -> Array:
    """Positions X at which a table of (X, value) jumps, (rows - 1,); L where it does not."""
    xp = numbers_of(table, length)
    return xp.sort(xp.where(xp.diff(table[:, 0]) > 0.0, length, table[1:, 0]))


def nodal_loads(rule: Rule, ends: Array, load: Array) -> Array:
    """Nodal forces of a distributed load: its integrals with the shape functions, (n,).

    The integrals are exact, wherever the steps of the load lie.

    Parameters
    ----------
    rule : rule of the elements
    ends : (elements + 1,) end points of the elements
    load : load per length, as one number or as a table (rows, 2) of X and value, linear in between;
        two rows of the same X make a step
    """
    if load.ndim == 0:
        return load * tributary_lengths(rule, ends)
    xp = numbers_of(ends, load)
    value = xp.concatenate([load[:1, 1], load[:, 1], load[-1:, 1]])  # end values go on beyond
    before = xp.minimum(load[0, 0], ends[0]) + ends[0] - ends[-1]
    after = xp.maximum(load[-1, 0], ends[-1]) + ends[-1] - ends[0]
    outer = without_slopes(xp.stack([before, after]))  # wherever they are
    x = xp.concatenate([outer[:1], load[:, 0], outer[1:]])
    run = xp.where(xp.diff(x) > 0.0, xp.diff(x), 1.0)
    begin, end, size = ends[:-1, None], ends[1:, None], xp.diff(ends)[:, None]
    # A row at the end of two elements lies in the second one, so that derivatives are one-sided.
    low = xp.where(x[:-1] >= begin, x[:-1], begin)
    high = xp.where(x[1:] < end, x[1:], end)
    cut = xp.where((high >= low) & (low < end), high - low, 0.0)  # (elements, rows + 1)
    total = xp.zeros((ends.size - 1, rule.nodes.size), ends.dtype)
    for point, weight in zip(*_gauss(2), strict=True):  # exact for linear times quadratic
        points = low + point * cut
        along = xp.clip((points - x[:-1]) / run, 0.0, 1.0)
        part = weight * cut * (value[:-1] + along * xp.diff(value))
        local = (points - begin) / size
        shapes = xp.stack([xp.polyval(s.coef[::-1], local) for s in _shapes(rule.nodes)], -1)
        total = total + xp.sum(part[..., None] * shapes, axis=1)
    return scatter(total)


def nodes(rule: Rule, ends: Array) -> Array:
    """Positions of all nodes of the elements between ``ends``, (order * elements + 1,)."""
    inner = ends[:-1, None] + jnp.diff(ends)[:, None] * rule.nodes[:-1]
    return jnp.append(inner.ravel(), ends[-1])


def tributary_lengths(rule: Rule, ends: Array) -> Array:
    """Contact length l_i of each node, (n,); they add up to L."""
    lengths = numbers_of(ends).diff(ends)
    return scatter(lengths[:, None] * rule.node_weights.astype(ends.dtype))


def gather(nodal: Array, order: int) -> Array:
    """Nodal values (n, ...) to element values (elements, order + 1, ...)."""
    elements = (nodal.shape[0] - 1) // order
    inner = nodal[:-1].reshape(elements, order, *nodal.shape[1:])
    return jnp.concatenate([inner, nodal[order::order, None]], axis=1)


def scatter(elementwise: Array) -> Array:
    """Element contributions (elements, order + 1, ...) summed at the nodes (n, ...)."""
    order = elementwise.shape[1] - 1
    xp, ends = numbers_of(elementwise), slice(order, None, order)
    inner = elementwise[:, :order].reshape(-1, *elementwise.shape[2:])
    total = xp.concatenate([inner, xp.zeros_like(elementwise[:1, 0])])
    return put(total, ends, total[ends] + elementwise[:, order])
