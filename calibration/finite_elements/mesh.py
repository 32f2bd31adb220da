"""Structured meshes of a strip and of the rigid base below it.

Elements are smallest, an eighth of H, at the loaded end and where the pressure steps or comes to
zero, for there the contact's stresses are singular, or nearly; they grow away from there, and
towards the top.  Where a member goes on, the contact ends like a crack, and they are four times
smaller there.  The base has a node under every node of the strip's bottom face, so that a node of
the base takes the contact forces of the node above it.
"""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.checks import POSITIVE, require, require_choice, require_number
from jbeamshell.mechanics import elements
from jbeamshell.scene.mounting import REACH
from jbeamshell.scene.scene import Scene

ORDERS = {"linear": 1, "quadratic": 2}
RULES = {1: "finite-difference", 2: "collocation"}
SHARES = {1: (0.5, 0.5), 2: (1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0)}  # of an element, by its nodes
END_SIZE = 1.0 / 8.0  # of H, where the contact is singular
FAR_SIZE = 1.0 / 20.0  # of L, away from it
GROWTH = 0.2  # of the element size over the distance
TIP_SIZE = 1.0 / 32.0  # of H, where a member goes on
ROWS = 3  # of quadratic elements over the height
STRETCH = 1.5  # logarithm of the sizes' growth from the base to the top
LARGEST = 200_000  # nodes


@dataclass(frozen=True)
class Block:
    """Rectangle of elements.

    Attributes
    ----------
    order : of the elements' displacements, 1 or 2
    x : (m,) positions of the columns of nodes
    y : (k,) heights of the rows of nodes
    number : (m, k) numbers of the nodes; 0 in the middle of a quadratic element
    elements : (e, 4 or 8) numbers of the elements' nodes, corners first, anticlockwise
    first : number of the first element; those of a column follow each other upwards
    """

    order: int
    x: np.ndarray
    y: np.ndarray
    number: np.ndarray
    elements: np.ndarray
    first: int

    @property
    def last(self) -> int:
        """Number of the last node."""
        return int(self.number[-1, -1])

    @property
    def columns(self) -> np.ndarray:
        """(nx + 1,) ends of the elements along X."""
        return self.x[:: self.order]

    @property
    def rows(self) -> np.ndarray:
        """(ny + 1,) ends of the elements over the height."""
        return self.y[:: self.order]

    @property
    def bottom_elements(self) -> np.ndarray:
        """(nx,) numbers of the elements at the bottom face."""
        return self.first + np.arange(self.columns.size - 1) * (self.rows.size - 1)

    @property
    def top_elements(self) -> np.ndarray:
        """(nx,) numbers of the elements at the top face."""
        return self.bottom_elements + self.rows.size - 2

    @property
    def shares(self) -> np.ndarray:
        """(k,) shares of an end face's nodes in an even traction; they add up to 1."""
        share = weights(self.rows, self.order)
        return share / np.sum(share)


@dataclass(frozen=True)
class Mesh(Block):
    """A strip's mesh on its contact, from 0 to L and from 0 to 2H.

    Attributes
    ----------
    base_x : (m + 2,) columns of the base, which reaches beyond the strip on both sides
    base : (m + 2, 2) numbers of the base's nodes, at the bottom and at the top
    beyond : the length on which a member goes on; its first column is a twin of the strip's last
    """

    base_x: np.ndarray
    base: np.ndarray
    beyond: Block | None

    @property
    def base_elements(self) -> np.ndarray:
        """(m + 1, 4) numbers of the nodes of the base's elements."""
        low, high = self.base.T
        return np.stack([low[:-1], low[1:], high[1:], high[:-1]], axis=1)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The strip, and the length beyond if there is one."""
        return (self,) if self.beyond is None else (self, self.beyond)

    @property
    def loaded(self) -> np.ndarray:
        """(k,) numbers of the nodes of the loaded face."""
        return self.blocks[-1].number[-1]

    @property
    def tributary(self) -> np.ndarray:
        """(m,) length of contact of each column: the integral of the base's shape function."""
        return weights(self.x, 1)


def make_mesh(scene: Scene, elements: str = "quadratic", refinement: float = 1.0) -> Mesh:
    """The mesh of a scene's strip.

    Parameters
    ----------
    scene : what is meshed
    elements : "linear" or "quadratic"; linear ones are half as large, so there are as many nodes
    refinement : divides all sizes
    """
    require_choice("elements", elements, tuple(ORDERS))
    require_number("refinement", refinement, POSITIVE)
    order = ORDERS[elements]
    finer = float(refinement) * 2.0 / order
    columns, half_height = contact_columns(scene, finer), float(scene.strip.half_height)
    rows = max(1, round(ROWS * finer))
    fix = f"makes more than {LARGEST} nodes; take less"
    require("refinement", refinement, columns.size * rows * order**2 < LARGEST, fix)
    heights = row_heights(half_height, rows)
    strip = last = block(columns, heights, order)
    beyond = None
    if scene.load.entry == "member":
        ends = columns[-1] + columns_beyond(half_height, finer)
        beyond = last = block(ends, heights, order, strip)
    base_x = np.concatenate([[-half_height], strip.x, [strip.x[-1] + half_height]])
    base = last.last + 1 + np.arange(2 * base_x.size).reshape(-1, 2)
    return Mesh(**vars(strip), base_x=base_x, base=base, beyond=beyond)


def block(columns: np.ndarray, rows: np.ndarray, order: int, before: Block | None = None) -> Block:
    """Elements between columns and rows, numbered on from the block before."""
    x, y = _with_middles(columns, order), _with_middles(rows, order)
    here = np.ones((x.size, y.size), bool)
    if order == 2:
        here[1::2, 1::2] = False
    nodes, first = (0, 1) if before is None else (before.last, after(before))
    number = np.where(here, nodes + np.cumsum(here).reshape(here.shape), 0)
    left, low = slice(0, -order, order), slice(order, None, order)
    corners = [number[left, left], number[low, left], number[low, low], number[left, low]]
    if order == 2:
        odd = slice(1, None, 2)
        corners += [number[odd, left], number[low, odd], number[odd, low], number[left, odd]]
    return Block(order, x, y, number, np.stack([c.ravel() for c in corners], axis=1), first)


def after(before: Block) -> int:
    """Number of the first element after a block."""
    return before.first + len(before.elements)


def row_heights(half_height: float, rows: int) -> np.ndarray:
    """Heights (rows + 1,) of the elements' ends, from 0 at the contact to 2H."""
    rise = np.expm1(STRETCH * np.arange(rows + 1) / rows) / np.expm1(STRETCH)
    return 2.0 * half_height * rise


def weights(ends: np.ndarray, order: int) -> np.ndarray:
    """Integrals of the nodes' shape functions of order 1 or 2 between element ends."""
    size = np.diff(ends)
    total = np.zeros(order * size.size + 1)
    for node, share in enumerate(SHARES[order]):
        total[node : node + order * size.size : order] += share * size
    return total


def nodal_loads(ends: np.ndarray, order: int, pressure: Array) -> np.ndarray:
    """Work-equivalent nodal forces of a pressure (a number or a table), however its steps fall."""
    if pressure.ndim == 0:
        return float(pressure) * weights(ends, order)
    rule = elements.element_rule(RULES[order])
    loads = jax.jit(lambda ends, table: elements.nodal_loads(rule, ends, table))
    return np.asarray(loads(jnp.asarray(ends), pressure))


def foci(scene: Scene) -> np.ndarray:
    """Positions (k,) towards which the mesh is refined."""
    length = float(scene.strip.length)
    found = [length] if scene.strip.far_end == "guided" else [0.0, length]
    for pressure in (scene.contact.pressure, scene.contact.bottom_pressure):
        if pressure.ndim == 2:
            x, p = np.asarray(pressure).T
            steps = np.diff(x) == 0.0
            found += x[1:][steps].tolist()
            for zero, other in ((slice(1, None), slice(-1)), (slice(-1), slice(1, None))):
                found += x[zero][(p[zero] == 0.0) & (p[other] > 0.0)].tolist()
    return np.unique(found)


def contact_columns(scene: Scene, finer: float) -> np.ndarray:
    """Ends of the elements along the contact, whose sizes are divided by ``finer``."""
    strip, near = scene.strip, foci(scene)
    length, half_height = float(strip.length), float(strip.half_height)
    tips = [length] if scene.member.support == "none" else [0.0, length]
    sharp = np.isin(near, tips) & (scene.load.entry == "member")
    sizes = np.where(sharp, TIP_SIZE, END_SIZE) * half_height
    return _graded(length, near, sizes, FAR_SIZE * length, finer)


def columns_beyond(half_height: float, finer: float) -> np.ndarray:
    """Ends of the elements beyond the contact, as distances from it."""
    sizes = np.array([TIP_SIZE * half_height])
    return _graded(REACH * half_height, np.zeros(1), sizes, half_height, finer)


def _graded(
    length: float, near: np.ndarray, sizes: np.ndarray, largest: float, finer: float
) -> np.ndarray:
    """Ends of elements that are small near some places, where their sizes are given."""
    # A place is as dense as it is near a focus: sampled as finely as the smallest element there.
    end = min(float(np.min(sizes)), largest)
    away = end * np.expm1(np.linspace(0.0, np.log1p(length / end), 2000))
    samples = np.unique(
        np.concatenate([[0.0, length], *(near + s * away[:, None] for s in (-1, 1))], None)
    )
    samples = samples[(samples >= 0.0) & (samples <= length)]
    middle = 0.5 * (samples[1:] + samples[:-1])
    grown = np.min(sizes + GROWTH * np.abs(middle[:, None] - near), axis=1)
    size = np.minimum(grown, largest) / finer
    count = np.append(0.0, np.cumsum(np.diff(samples) / size))
    elements = max(2, int(np.ceil(count[-1])))
    return np.interp(np.linspace(0.0, count[-1], elements + 1), count, samples)


def _with_middles(ends: np.ndarray, order: int) -> np.ndarray:
    if order == 1:
        return ends
    return np.insert(ends, np.arange(1, ends.size), 0.5 * (ends[1:] + ends[:-1]))
