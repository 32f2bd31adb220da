"""Contact points of two faces: pairs of nodes, or quadrature points of the elements.

The elements of one face are cut by those of the other, each piece in the plane of the upper
element, so that the points integrate the shape functions of both sides: an even pressure passes
from mesh to mesh (Puso and Laursen 2004).  Where the meshes match, the points are those of Gauss.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from jbeamshell.bodies.face_elements import CORNERS, PLACES, RULES, SIX, shapes, spots
from jbeamshell.bodies.substructure import Substructure, frames_of
from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.errors import InputError

MATCH = 1e-6  # of the contact's extent, within which nodes match
OFF = 0.1  # of an element's size, within which the other face lies
COVERED = 0.9  # of an element's area, that the other face must cover
TURNED = 0.5  # cosine of the normals of both sides, from which on they face each other
INVERSE = 12  # iterations for u and v of a place on an element
SLIVER = 1e-9  # of an element's area, below which a piece is none

Vector = NDArray[np.float64]


class Shares(NamedTuple):
    """Nodes (q, k) of the points on one side, and their shares (q, k) in each point."""

    nodes: NDArray[np.int64]
    values: Vector

    def of(self, numbers: Any) -> Any:
        """Values (q, ...) at the points of values (n, ...) of the nodes."""
        factors = self.values.reshape(*self.values.shape, *[1] * (numbers.ndim - 1))
        return (factors * numbers[self.nodes]).sum(axis=1)


class ContactPoints(NamedTuple):
    """Contact points of two faces, or of one on a rigid base.

    Attributes
    ----------
    places, normals : (q, 3), from below to above
    areas : (q,); 1 where they are not known, so that pressures are forces
    upper, lower : nodes of both sides; lower is None on a rigid base
    pairs : True if the nodes match one by one, so that only their relative displacement counts
    elements : (q,) elements of the upper face; None if the points are pairs of nodes
    """

    places: Any
    normals: Any
    areas: Any
    upper: Shares
    lower: Shares | None
    pairs: bool
    elements: NDArray[np.int64] | None


def contact_points(upper: Substructure, lower: Substructure | None, pairs: bool) -> ContactPoints:
    """Contact points of two bodies on their face.

    Parameters
    ----------
    upper, lower : bodies; None is a rigid base
    pairs : True takes pairs of nodes where there are elements, too

    Raises
    ------
    InputError
        naming a node or an element that has nothing opposite
    """
    if pairs or not upper.elements or (lower is not None and not lower.elements):
        if lower is not None:
            check_match(upper, lower)
        return _node_pairs(upper, lower)
    fixed = not is_traced([(body.places, body.normals) for body in (upper, lower) if body])
    fix = "are traced: contact points of elements need numbers: take points=True, or trace the rest"
    require("places, normals", "of bodies", fixed, fix)
    made = _on_elements(upper)
    if lower is None:
        return made
    same = _same_nodes(upper, lower)
    if same is None:
        return _cut(upper, lower)
    return made._replace(lower=Shares(same[made.upper.nodes], made.upper.values))


def in_order(lower: Substructure, made: ContactPoints) -> NDArray[np.int64]:
    """Nodes (n,) of the lower body that match those of the upper one, pair by pair."""
    assert made.lower is not None
    order = np.arange(lower.places.shape[0])
    order[made.upper.nodes] = made.lower.nodes
    return order


def check_match(upper: Substructure, lower: Substructure) -> None:
    """Refuse contacts whose nodes or normals do not match in turn."""
    ours, theirs = upper.places.shape, lower.places.shape
    fix = f"does not match the {ours[0]} nodes of the upper body: mesh both contacts alike"
    fix += ", or give both bodies their elements" if upper.on_face else ""
    require("lower.places", f"{theirs[0]} nodes", ours == theirs, fix)
    if is_traced(upper, lower):
        return
    places, below = (np.asarray(b.places).reshape(ours[0], -1) for b in (upper, lower))
    apart = np.linalg.norm(places - below, axis=1)
    worst = int(np.argmax(apart))
    at = ", ".join(f"{number:.6g}" for number in places[worst])
    fix = f"does not match node {worst} of the upper body at {at}, in the same order: mesh both "
    near = apart[worst] <= MATCH * float(np.max(np.ptp(places, axis=0)))
    fix += "alike" + (", or give both bodies their elements" if upper.on_face else "")
    require(f"lower.places[{worst}]", below[worst], near, fix)
    if upper.on_face:
        turned = np.max(np.abs(np.asarray(upper.normals) - np.asarray(lower.normals)))
        fix = "must be those of the upper face, from the body below to the one above"
        require("lower.normals", f"{turned:.3g} off", bool(turned < MATCH), fix)


def _node_pairs(upper: Substructure, lower: Substructure | None) -> ContactPoints:
    """Pairs of nodes of bodies that match in turn."""
    own = np.arange(upper.places.shape[0])[:, None]
    shares = Shares(own, np.ones(own.shape))
    areas = np.ones(len(own)) if upper.tributary is None else upper.tributary
    below = None if lower is None else shares
    return ContactPoints(upper.places, upper.normals, areas, shares, below, True, None)


def _on_elements(body: Substructure) -> ContactPoints:
    """Points of Gauss on the elements of one face."""
    places, most = np.asarray(body.places), max(map(len, body.elements))
    parts = []
    for k, row in enumerate(body.elements):
        rule = RULES[len(row)]
        found = spots(places[list(row)], rule.points)
        areas = rule.weights * np.linalg.norm(found.normals, axis=1)
        parts.append((k, found.places, areas, *_wide(row, found.values, most)))
    return _points(body, parts, None, True)


def _points(
    body: Substructure, parts: list[Any], lower: Shares | None, pairs: bool
) -> ContactPoints:
    """Points of parts (element, places, areas, nodes, values)."""
    elements = np.concatenate([np.full(len(part[1]), part[0]) for part in parts])
    places, areas, nodes, values = (
        np.concatenate([part[i] for part in parts]) for i in range(1, 5)
    )
    upper = Shares(nodes, values)
    normals = upper.of(np.asarray(body.normals))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return ContactPoints(places, normals, areas, upper, lower, pairs, elements)


def _wide(row: tuple[int, ...], values: Vector, most: int) -> tuple[NDArray[np.int64], Vector]:
    """Nodes and shares of the points on an element, as wide as the largest element is."""
    nodes = np.full((len(values), most), row[0])
    nodes[:, : len(row)] = row
    wide = np.zeros(nodes.shape)
    wide[:, : len(row)] = values
    return nodes, wide


def _same_nodes(upper: Substructure, lower: Substructure) -> NDArray[np.int64] | None:
    """Lower node (n,) at the place of each upper one; None if the meshes do not match."""
    places, below = np.asarray(upper.places), np.asarray(lower.places)
    if len(places) != len(below) or len(upper.elements) != len(lower.elements):
        return None
    away, at = cKDTree(below).query(places)
    alike = np.max(away) <= MATCH * float(np.max(np.ptp(places, axis=0)))
    if not alike or np.unique(at).size != len(at):
        return None
    turned = np.abs(np.asarray(upper.normals) - np.asarray(lower.normals)[at])
    theirs = {frozenset(row) for row in lower.elements}
    ours = all(frozenset(at[list(row)].tolist()) in theirs for row in upper.elements)
    return at if ours and float(np.max(turned)) < MATCH else None


class _Flat(NamedTuple):
    """Elements of a face, for cutting: middles, sizes and normals."""

    middles: Vector
    radii: Vector
    normals: Vector

    @classmethod
    def of(cls, places: Vector, elements: tuple[tuple[int, ...], ...]) -> _Flat:
        middles, radii, normals = [], [], []
        for row in elements:
            corners = places[list(row[: CORNERS[len(row)]])]
            middle = np.mean(corners, axis=0)
            ahead = np.roll(corners, -1, axis=0)
            normal = np.sum(np.cross(corners - middle, ahead - middle), axis=0)
            middles.append(middle)
            radii.append(np.max(np.linalg.norm(places[list(row)] - middle, axis=1)))
            normals.append(normal / np.linalg.norm(normal))
        return cls(np.array(middles), np.array(radii), np.array(normals))


def _cut(upper: Substructure, lower: Substructure) -> ContactPoints:
    """Points of the pieces into which the elements of both faces cut each other."""
    above, below = np.asarray(upper.places), np.asarray(lower.places)
    ours, theirs = _Flat.of(above, upper.elements), _Flat.of(below, lower.elements)
    most = max(map(len, upper.elements)), max(map(len, lower.elements))
    tree, widest = cKDTree(theirs.middles), float(np.max(theirs.radii))
    parts, others = [], []
    covered = np.zeros(len(upper.elements)), np.zeros(len(lower.elements))
    sizes = np.zeros(len(upper.elements)), np.zeros(len(lower.elements))
    for e, row in enumerate(upper.elements):
        normal, middle = ours.normals[e], ours.middles[e]
        axes = frames_of(normal[None])[0][:2]
        flat = (above[list(row)] - middle) @ axes.T
        outline = flat[: CORNERS[len(row)]]
        sizes[0][e] = _area(outline)
        for f in tree.query_ball_point(middle, ours.radii[e] + widest):
            other = lower.elements[f]
            across = (below[list(other)] - middle) @ axes.T
            piece = _clipped(outline, across[: CORNERS[len(other)]])
            area = _area(piece)
            if not area > SLIVER * sizes[0][e]:
                continue
            at, weights = _rule(piece, len(row) > 4 or len(other) > 4)
            own, there = _shares(flat, at), _shares(across, at)
            places = own @ above[list(row)]
            apart = np.abs((there @ below[list(other)] - places) @ normal)
            if np.min(apart) > ours.radii[e] + theirs.radii[f]:
                continue  # another part of a face that turns back
            _check_near(upper, lower, e, f, float(np.max(apart)) / (2.0 * ours.radii[e]))
            fix = "faces away from the upper face: name the surface of the body below, its normals "
            facing = float(normal @ theirs.normals[f]) > TURNED
            require(_name("lower", lower, f), "a side", facing, fix + "towards the upper one")
            covered[0][e] += area
            covered[1][f] += area
            parts.append((e, places, weights, *_wide(row, own, most[0])))
            others.append(_wide(other, there, most[1]))
    for f, other in enumerate(lower.elements):
        axes = frames_of(theirs.normals[f][None])[0][:2]
        sizes[1][f] = _area(below[list(other[: CORNERS[len(other)]])] @ axes.T)
    for key, body, part, size in zip(
        ("upper", "lower"), (upper, lower), covered, sizes, strict=True
    ):
        least = int(np.argmin(part / size))
        share = float(part[least] / size[least])
        fix = "of its area has the other face opposite: name the part that touches, on both sides"
        require(_name(key, body, least), f"{100.0 * share:.0f} %", share >= COVERED, fix)
    nodes, values = (np.concatenate([other[i] for other in others]) for i in (0, 1))
    return _points(upper, parts, Shares(nodes, values), False)


def _check_near(upper: Substructure, lower: Substructure, e: int, f: int, away: float) -> None:
    """Refuse elements that lie apart."""
    if away > OFF:
        raise InputError(
            f"{_name('upper', upper, e)}: lies {100.0 * away:.0f} % of its size off "
            f"{_name('lower', lower, f)}: move the meshes onto each other, and give gap= for what "
            "is open before anything presses"
        )


def _name(key: str, body: Substructure, element: int) -> str:
    """Element of a body, with its middle."""
    middle = np.mean(np.asarray(body.places)[list(body.elements[element])], axis=0)
    return f"{key}.elements[{element}] at {', '.join(f'{x:.4g}' for x in middle)}"


def _area(outline: Vector) -> float:
    """Area of a flat polygon (k, 2) in turn around it; negative the other way round."""
    x, y = outline.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) if len(outline) > 2 else 0.0


def _clipped(outline: Vector, other: Vector) -> Vector:
    """Piece of a convex polygon inside of another one (Sutherland and Hodgman 1974)."""
    if _area(other) < 0.0:
        other = other[::-1]
    piece = outline
    for a, b in zip(other, np.roll(other, -1, axis=0), strict=True):
        if len(piece) < 3:
            break
        (dx, dy), rest = b - a, piece - a
        inside = dx * rest[:, 1] - dy * rest[:, 0]
        found = []
        for i in range(len(piece)):
            here, last = inside[i], inside[i - 1]
            if (here > 0.0) != (last > 0.0):
                part = last / (last - here)
                found.append(piece[i - 1] + part * (piece[i] - piece[i - 1]))
            if here > 0.0:
                found.append(piece[i])
        piece = np.array(found).reshape(-1, 2)
    return piece


def _rule(piece: Vector, quadratic: bool) -> tuple[Vector, Vector]:
    """Points (k, 2) of a flat polygon's quadrature, and their areas (k,)."""
    first, second, third = piece[0], piece[1:-1], piece[2:]
    (ux, uy), (vx, vy) = (second - first).T, (third - first).T
    doubled = ux * vy - uy * vx
    if quadratic:
        (u, v), weights = SIX.points.T, SIX.weights
        places = first + u[:, None, None] * (second - first) + v[:, None, None] * (third - first)
        return places.reshape(-1, 2), (weights[:, None] * doubled).ravel()
    # Three points that share the area, its middle and its second moments, exact for degree 2.
    area = 0.5 * np.sum(doubled)
    corners = np.stack([np.broadcast_to(first, second.shape), second, third])
    total = np.sum(corners, axis=0)
    middle = np.sum(doubled[:, None] * total, axis=0) / (6.0 * area)
    away = corners - middle
    squares = np.einsum("ctx,cty->txy", away, away)
    whole = np.sum(away, axis=0)
    squares = squares + whole[:, :, None] * whole[:, None, :]
    spread = np.einsum("t,txy->xy", doubled, squares) / (24.0 * area)
    angle = 2.0 * np.pi * np.arange(3) / 3.0
    round_it = np.sqrt(2.0) * np.column_stack([np.cos(angle), np.sin(angle)])
    return middle + round_it @ np.linalg.cholesky(spread).T, np.full(3, area / 3.0)


def _shares(flat: Vector, at: Vector) -> Vector:
    """Shape functions (k, nodes) at flat places (k, 2) of an element, by Newton's method."""
    nodes = len(flat)
    where = np.tile(np.mean(PLACES[nodes][: CORNERS[nodes]], axis=0), (len(at), 1))
    for _ in range(INVERSE):
        values, slopes = shapes(nodes, where)
        jacobian = np.einsum("knw,nx->kxw", slopes, flat)
        step = np.linalg.solve(jacobian, (at - values @ flat)[:, :, None])[:, :, 0]
        where = where + step
        if np.max(np.abs(step)) < 1e-14:
            break
    return shapes(nodes, where)[0]
