"""Bodies of textbooks as a user would bring them: layers of Euler's beam, and a half-plane."""

from __future__ import annotations

import numpy as np

import jbeamshell as jb
from calibration.comparisons.case import Floats

FRICTION = 0.3  # of the cylinders
NODES = 40  # of a layer, besides its clamped one


def layer(length: float, height: float, stretching: float, side: float) -> jb.Substructure:
    """Layer above (side 1) or below the contact, clamped at X = 0; half the force bends its end.

    Bars and Euler's beams on the axis of the layer, moved to its face, are condensed of their
    rotations.  A pressure of 1 presses it onto the other one.
    """
    step, bend = length / NODES, stretching * height**2 / 12.0
    whole = np.zeros((3 * (NODES + 1), 3 * (NODES + 1)))  # u, w and rotation of the axis
    a, b = 12.0 * bend / step**3, 6.0 * bend / step**2
    beam = np.array(
        [
            [a, b, -a, b],
            [b, 4.0 * bend / step, -b, 2.0 * bend / step],
            [-a, -b, a, -b],
            [b, 2.0 * bend / step, -b, 4.0 * bend / step],
        ]
    )
    bar = stretching / step * np.array([[1.0, -1.0], [-1.0, 1.0]])
    for i in range(NODES):
        at = 3 * i
        whole[np.ix_([at, at + 3], [at, at + 3])] += bar
        turning = [at + 1, at + 2, at + 4, at + 5]
        whole[np.ix_(turning, turning)] += beam
    move = np.eye(whole.shape[0])  # u of the axis from that of the face
    for i in range(NODES + 1):
        move[3 * i, 3 * i + 2] = -0.5 * side * height
    whole = (move.T @ whole @ move)[3:, 3:]
    turns = np.arange(NODES) * 3 + 2
    kept = np.delete(np.arange(3 * NODES), turns)
    inner = np.linalg.solve(whole[np.ix_(turns, turns)], whole[np.ix_(turns, kept)])
    stiffness = whole[np.ix_(kept, kept)] - whole[np.ix_(kept, turns)] @ inner
    forces = np.zeros((2 * NODES, 2))
    forces[-1, 0] = 0.5
    forces[1::2, 1] = -side * step
    forces[-1, 1] *= 0.5
    x = step * np.arange(1, NODES + 1)
    lengths = np.append(np.full(NODES - 1, step), 0.5 * step)
    return jb.Substructure(x, 0.5 * (stiffness + stiffness.T), forces, tributary=lengths)


def cylinder(nodes: int = 161, reach: float = 1.25) -> tuple[jb.Substructure, Floats]:
    """Two equal cylinders as one body on a rigid base, and their gap.

    The contact is 2 long under a load of 1 per width.  The relative displacements of two
    half-planes are ``-(2/pi) int p ln|x - s| ds`` for E* = 1, along and across alike, and a rigid
    motion that the loads move.
    """
    x = np.linspace(-reach, reach, nodes)
    step = x[1] - x[0]
    distance = x[:, None] - np.append(x - 0.5 * step, x[-1] + 0.5 * step)
    potential = distance * np.log(np.abs(distance)) - distance
    far = 5.0  # a datum, without which long waves would cost a negative energy
    compliance = -(2.0 / np.pi) * (potential[:, :-1] - potential[:, 1:]) / step + far
    stiff = np.linalg.inv(0.5 * (compliance + compliance.T))
    moved = stiff.sum(axis=1)
    share, give = moved / moved.sum(), 1.0 / moved.sum()
    own = stiff - give * np.outer(moved, moved)
    stiffness, forces = np.zeros((2 * nodes, 2 * nodes)), np.zeros((2 * nodes, 2))
    stiffness[::2, ::2] = stiffness[1::2, 1::2] = 0.5 * (own + own.T)
    forces[::2, 0], forces[1::2, 1] = share, -share
    lengths = np.full(nodes, step)
    body = jb.Substructure(x, stiffness, forces, np.diag([give, give]), tributary=lengths)
    return body, 2.0 * x**2 / np.pi
