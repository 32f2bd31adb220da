r"""Nodes along X and the rule that integrates an element.

One family of rules: an element of order p has p+1 Gauss-Lobatto nodes, strains are collocated at
its p Gauss points, and friction, contact and pressure act at the nodes with Lobatto weights.

* ``finite-difference``: p = 1, the midpoint (box) scheme, second order.  The squeeze strain itself
  (not its slope) is taken at the two nodes instead of the midpoint; that keeps its matrix an
  M-matrix, so that a load edge does not make it oscillate when an element is longer than its decay
  length.
* ``collocation``: p = 2, the two-point Gauss scheme, fourth order on smooth problems.

Nodes are graded at the loaded end X = L, where the traction concentrates: the element size at the
distance d from it goes linearly (which is geometric grading) from a part of H to a part of L, and
the node count scales all sizes together, so that doubling it halves every element.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.polynomial import Polynomial, legendre

ORDER = {"finite-difference": 1, "collocation": 2}

# Element sizes before scaling.  With 161 nodes the end element of the standard strips is about
# H/16: with the lift frozen a smaller one would put the shell's point reaction into tension.
END_SIZE = 1.0 / 6.0  # of H, at the loaded end
FAR_SIZE = 1.0 / 60.0  # of L, away from it
GROWTH = 0.08  # of the element size over the distance


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
    """The rule called ``finite-difference`` or ``collocation``."""
    order = ORDER[name]
    inner = legendre.Legendre.basis(order).deriv().roots()
    nodes = 0.5 * (1.0 + np.concatenate([[-1.0], np.sort(inner), [1.0]]))
    points, weights = legendre.leggauss(order)
    points, weights = 0.5 * (1.0 + points), 0.5 * weights
    shapes = []
    for i, node in enumerate(nodes):
        shape = Polynomial.fromroots(np.delete(nodes, i))
        shapes.append(shape / shape(node))
    values = np.stack([shape(points) for shape in shapes], axis=1)
    slopes = np.stack([shape.deriv()(points) for shape in shapes], axis=1)
    node_weights = np.array([shape.integ()(1.0) for shape in shapes])
    squeeze = values
    if name == "finite-difference":
        weights, squeeze = node_weights, np.eye(2)
        values, slopes = np.repeat(values, 2, axis=0), np.repeat(slopes, 2, axis=0)
    return Rule(nodes, node_weights, weights, values, squeeze, slopes)


def vertices(elements: int, length: ArrayLike, half_height: ArrayLike) -> Array:
    """End points of the elements, graded towards X = L.

    Parameters
    ----------
    elements : number of elements
    length : L
    half_height : H

    Returns
    -------
    (elements + 1,) increasing positions from 0 to L; smooth in L and H.
    """
    far, end = FAR_SIZE * jnp.asarray(length), END_SIZE * jnp.asarray(half_height)
    rate = jnp.where(far >= end, GROWTH, -GROWTH)
    # Equidistribute int dd/h(d), h = end + rate d up to far: a logarithm, then a straight line.
    turn = jnp.minimum((far - end) / rate, length)
    at_turn = jnp.log1p(rate * turn / end) / rate
    total = at_turn + (length - turn) / far
    count = total * jnp.arange(elements, -1, -1) / elements
    graded = end * jnp.expm1(rate * jnp.minimum(count, at_turn)) / rate
    distance = graded + far * jnp.maximum(count - at_turn, 0.0)
    x: Array = jnp.asarray(length) - distance
    return x.at[0].set(0.0).at[-1].set(length)


def nodes(rule: Rule, ends: Array) -> Array:
    """All nodes of the elements between ``ends``, (order * elements + 1,)."""
    inner = ends[:-1, None] + jnp.diff(ends)[:, None] * rule.nodes[:-1]
    return jnp.append(inner.ravel(), ends[-1])


def tributary_lengths(rule: Rule, ends: Array) -> Array:
    """Length l_i of contact that belongs to each node; they add up to L."""
    return scatter(jnp.diff(ends)[:, None] * rule.node_weights)


def gather(nodal: Array, order: int) -> Array:
    """Nodal values (n, ...) to element values (elements, order + 1, ...)."""
    elements = (nodal.shape[0] - 1) // order
    inner = nodal[:-1].reshape(elements, order, *nodal.shape[1:])
    return jnp.concatenate([inner, nodal[order::order, None]], axis=1)


def scatter(elementwise: Array) -> Array:
    """Element contributions (elements, order + 1, ...) summed at the nodes (n, ...)."""
    order = elementwise.shape[1] - 1
    inner = elementwise[:, :order].reshape(-1, *elementwise.shape[2:])
    total = jnp.concatenate([inner, jnp.zeros_like(elementwise[:1, 0])])
    return total.at[order::order].add(elementwise[:, order])
