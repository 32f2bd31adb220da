"""Rounded punch on a block of the same material, beside the closed form of Cattaneo and Mindlin.

Pressed by P per width, a cylinder of radius R touches over 2a, a^2 = 4 P R / (pi E*), with
E* = E / 2 for two bodies without Poisson's ratio.  Normal and tangential displacements of the
surface follow from pressures and tractions by one law, and equal bodies do not couple them.  So a
tangential force Q moves the punch by

    u(Q) = mu (f(P) - f(P - Q / mu)),    f(P) = c P - P ln P / (pi E*)

(Jaeger 1998), where c is the far field's and adds no loss.  The loop follows Masing's rule.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse

import jbeamshell as jb
from calibration.finite_elements.boxes import on_grid, side

RADIUS, HALF_WIDTH, FRICTION = 100.0, 1.0, 0.3
STAR = 0.5  # of E = 1
FORCE = np.pi * STAR * HALF_WIDTH**2 / (4.0 * RADIUS)
WIDTH = 0.5  # of the slice of both bodies
FAR = 12.0  # half widths, from which on nothing changes any more


def spaced(size: float) -> np.ndarray:
    """Lines that grow from a size on, until they are far."""
    sizes = [size]
    while sum(sizes) < FAR:
        sizes.append(1.5 * sizes[-1])
    return np.cumsum(sizes)


def bodies(elements: int, quadratic: bool = True) -> tuple[jb.Substructure, jb.Substructure]:
    """Punch and block of bricks with so many elements over the contact."""
    size = 2.0 * HALF_WIDTH / elements
    near = size * np.arange(round(1.25 * HALF_WIDTH / size) + 1)
    x = np.append(near, near[-1] + spaced(1.5 * size))
    x, z = np.concatenate([-x[:0:-1], x]), np.append(0.0, spaced(0.7 * size))
    found = []
    for upper, heights in ((True, z), (False, -z[::-1])):
        model, places = on_grid((x, [0.0, WIDTH], heights), 1.0, 0.0, quadratic=quadratic)
        nodes, faces = side(places, 2, 0.0, quadratic)
        nodes = nodes[np.abs(nodes[:, 1]) < near[-1] + 0.1 * size]
        faces = [face for face in faces if np.isin(face, nodes[:, 0]).all()]
        far = 1 + np.flatnonzero(np.isclose(np.abs(places[:, 2]), z[-1]))
        model = on_rigid_plate(model, far)
        model = model if upper else model.without([[far[0], 1], [far[0], 3]])
        found.append(
            model.condensed(
                nodes,
                elements=faces,
                pull=[[far[0], 1, 1.0]] if upper else None,
                press=[[[far[0], 3, -1.0] if upper else [nodes[0, 0], 3, 0.0]]],
            )
        )
    above, below = found
    return above, below


def on_rigid_plate(model: jb.StiffnessModel, nodes: np.ndarray) -> jb.StiffnessModel:
    """Model in which nodes move as the first of them along X and Z, and not along Y."""
    dofs, there = model.dofs.copy(), np.isin(model.dofs[:, 0], nodes)
    dofs[there, 0] = nodes[0]
    kept = np.flatnonzero(~there | (dofs[:, 1] != 2))
    dofs, place = np.unique(dofs[kept], axis=0, return_inverse=True)
    shape = len(there), len(dofs)
    moves = scipy.sparse.csc_array((np.ones(kept.size), (kept, place.ravel())), shape=shape)
    return jb.StiffnessModel(scipy.sparse.csc_array(moves.T @ model.matrix @ moves), dofs)


def loop(
    made: tuple[jb.Substructure, jb.Substructure], force: float, **values: Any
) -> jb.ContactHistory:
    """History of a punch under a tangential force per width to and fro."""
    upper, lower = made
    load = {"bolts": FORCE * WIDTH, "gap": 0.5 * upper.places[:, 0] ** 2 / RADIUS}
    options = {"friction": FRICTION, "amplitude": force * WIDTH, "throw": False}
    return jb.solve_contact(upper, lower, **load, **options, **values)


def loss(force: float) -> float:
    """Loss per cycle and width of the closed form, between two forces."""
    rest = FORCE - force / FRICTION

    def approach(load: float) -> float:
        return -load * np.log(load) / (np.pi * STAR)

    def integral(load: float) -> float:
        return -(load**2) * (0.5 * np.log(load) - 0.25) / (np.pi * STAR)

    displacement = FRICTION * (approach(FORCE) - approach(rest))
    backbone = FRICTION * (force * approach(FORCE) - FRICTION * (integral(FORCE) - integral(rest)))
    return float(8.0 * (0.5 * force * displacement - backbone))
