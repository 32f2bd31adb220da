"""Single laps with two round bolts in three dimensions, beside the plane model of the same words.

Two plates of bricks with incompatible modes lap over a face with contact points in its elements.
A bolt is an even pressure below the ring of its head, equal and opposite on both plates, which
have no holes.  The plane model has the patch of `jbeamshell.scene.bolts.patch_width`.  Plates and
bolts are mirrored about the middle of the width, so half of them is computed.  Kinematics are
linear: a preload times ten bears ten times the force, and loses a hundred times the energy.

`python -m calibration bolt_patch` compares dissipation and secant stiffness.
"""

from __future__ import annotations

import itertools
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse

import jbeamshell as jb
from calibration.finite_elements.bricks import MODULUS, POISSON, Box, box

RECORD = Path(__file__).with_suffix(".json")
LAP, FREE, THICK = 60.0, 20.0, 8.0  # mm; of the lap, beyond it, of a plate
PLACES = (15.0, 45.0)  # of the bolts along the lap
FRICTION, PRELOAD = 0.2, 19e3  # N
BOLT = jb.Bolt("M8", proof=0.75)
WIDTHS, LOADS = (20.0, 30.0, 45.0, 60.0), (0.3, 0.6)  # mm; over gross slip
ALONG, THROUGH = 24, 2  # bricks along the lap, and through a plate
FINE = 16  # points along each side of a brick's face, at which a ring presses
STEPS = 24  # of a half cycle


def brick(edges: np.ndarray) -> np.ndarray:
    """Stiffness (24, 24) of a brick with incompatible modes (Wilson; Taylor et al. 1976)."""
    shear = MODULUS / (2.0 * (1.0 + POISSON))
    law = np.diag([2.0 * shear] * 3 + [shear] * 3)
    law[:3, :3] += MODULUS * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    corners = np.array([(*c, z) for z in (-1, 1) for c in corners])
    whole = np.zeros((33, 33))
    for point in itertools.product((-(3.0**-0.5), 3.0**-0.5), repeat=3):
        slopes = np.zeros((11, 3))
        for d in range(3):
            others = [k for k in range(3) if k != d]
            sides = np.prod(1.0 + corners[:, others] * np.array(point)[others], axis=1)
            slopes[:8, d] = 0.125 * corners[:, d] * sides
            slopes[8 + d, d] = -2.0 * point[d]  # of the bubble 1 - x_d^2
        slopes *= 2.0 / edges
        strain = np.zeros((6, 11, 3))
        for d in range(3):
            strain[d, :, d] = slopes[:, d]
        for row, (a, b) in enumerate(((0, 1), (1, 2), (0, 2)), start=3):
            strain[row, :, a], strain[row, :, b] = slopes[:, b], slopes[:, a]
        at = strain.reshape(6, 33)
        whole += np.prod(edges / 2.0) * at.T @ law @ at
    outer, inner = whole[:24, :24], whole[24:, 24:]
    return outer - whole[:24, 24:] @ np.linalg.solve(inner, whole[24:, :24])


def model_of(made: Box, edges: np.ndarray) -> jb.StiffnessModel:
    """Stiffness model of a box of even bricks."""
    rows = (3 * (made.bricks - made.number[0, 0, 0])[:, :, None] + np.arange(3)).reshape(-1, 24)
    own = np.broadcast_to(brick(edges), (len(rows), 24, 24))
    pairs = np.broadcast_to(rows[:, :, None], own.shape), np.broadcast_to(rows[:, None], own.shape)
    size = 3 * len(made.places)
    matrix = scipy.sparse.coo_matrix((own.ravel(), tuple(p.ravel() for p in pairs)), (size, size))
    names = np.column_stack(
        [
            np.repeat(np.arange(len(made.places)) + made.number[0, 0, 0], 3),
            np.tile([1, 2, 3], size // 3),
        ]
    )
    return jb.StiffnessModel(matrix.tocsr(), names)


def ring(made: Box, outer: np.ndarray, place: float, sign: float) -> np.ndarray:
    """Half of a bolt's force (k, 3) along Z below the ring of its head, by shape functions."""
    at = made.at(outer)
    edges = at[1, 1, :2] - at[0, 0, :2]
    s = (np.arange(FINE) + 0.5) / FINE
    found = np.zeros(outer.shape)
    for i, j in np.ndindex(outer.shape[0] - 1, outer.shape[1] - 1):
        x, y = at[i, j, 0] + edges[0] * s[:, None], at[i, j, 1] + edges[1] * s
        r = np.hypot(x - place, y)  # the middle of the width is Y = 0
        pressed = (2.0 * r > BOLT.holed) & (2.0 * r < BOLT.bearing)
        for a, b in itertools.product((0, 1), repeat=2):
            share = (s if a else 1.0 - s)[:, None] * (s if b else 1.0 - s)
            found[i + a, j + b] += np.sum(share * pressed)
    nodes = np.flatnonzero(found.ravel())
    forces = found.ravel()[nodes] / np.sum(found)
    return np.column_stack(
        [outer.ravel()[nodes], np.full(nodes.size, 3), 0.5 * PRELOAD * sign * forces]
    )


def bodies(width: float, along: int, through: int) -> tuple[jb.Substructure, jb.Substructure]:
    """Upper and lower plate of half of the width, on their faces."""
    edge = LAP / along
    beyond, across = round(FREE / edge), round(0.5 * width / edge)
    counts = along + beyond, across, through
    sizes = np.array([LAP + FREE, 0.5 * width, THICK])
    above = box(counts, tuple(sizes))
    below = box(counts, tuple(sizes), (-FREE, 0.0, -THICK), first=int(above.number.max()) + 1)
    pull_at = above.number[-1]
    shares = np.outer(*(np.convolve(np.full(n, 1.0 / n), [0.5, 0.5]) for n in counts[1:]))
    pull = np.column_stack([pull_at.ravel(), np.full(pull_at.size, 1), shares.ravel()])
    found = []
    for made, on, outer, end, sign in (
        (above, above.number[: along + 1, :, 0], above.number[: along + 1, :, -1], pull_at, -1.0),
        (below, below.number[beyond:, :, -1], below.number[beyond:, :, 0], below.number[0], 1.0),
    ):
        first = 2 if made is above else 1
        middle = made.number[:, 0].ravel()
        held = {(int(n), d) for n in end.ravel() for d in range(first, 4)}
        held |= {(int(n), 2) for n in middle}
        quads = [
            [on[i, j], on[i + 1, j], on[i + 1, j + 1], on[i, j + 1]]
            for i, j in np.ndindex(on.shape[0] - 1, on.shape[1] - 1)
        ]
        presses = [ring(made, outer, place, sign) for place in PLACES]
        found.append(
            model_of(made, sizes / counts).condensed(
                np.column_stack([on.ravel(), made.at(on.ravel())]),
                elements=quads,
                press=presses,
                pull=pull if made is above else None,
                held=sorted(held),
            )
        )
    return found[0], found[1]


def measure(along: int = ALONG, through: int = THROUGH) -> dict[str, Any]:
    """Energy of a cycle and secant stiffness of the whole joint, over width and load."""
    rows = []
    for width in WIDTHS:
        upper, lower = bodies(width, along, through)
        for load in LOADS:
            force = load * FRICTION * 2.0 * PRELOAD
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", jb.DoubtfulWarning)  # doubts are printed
                history = jb.solve_contact(
                    upper,
                    lower,
                    friction=FRICTION,
                    amplitude=0.5 * force,
                    steps_per_half_cycle=STEPS,
                )
            figures = {
                "dissipation": 2.0 * float(history.dissipation),
                "secant_stiffness": 2.0 * float(history.secant_stiffness),
                "mesh_error": float(history.mesh_error),
            }
            rows.append({"width": width, "load": load, "bricks": [along, through]} | figures)
    return {"bolt": str(BOLT), "rows": rows}


def plane(width: float, load: float, patch: float = BOLT.patch) -> jb.History:
    """The same joint in the plane, its bolts with an even patch."""
    values = {
        "strip.length": LAP,
        "strip.width": width,
        "strip.half_height": 0.5 * THICK,
        "strip.youngs_modulus": MODULUS,
        "strip.poisson_ratio": POISSON,
        "strip.far_end": "free",
        "strip.overhang": FREE,
        "member.support": "clamped",
        "member.loaded_end": "level",
        "member.height_ratio": 0.5 * THICK / (0.5 * LAP),
        "member.overhang": FREE,
        "member.assembly": "frictional",
        "contact.friction": FRICTION,
        "contact.bolts": [[x, PRELOAD, patch] for x in PLACES],
        "load.amplitude": load * FRICTION * 2.0 * PRELOAD,
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jb.DoubtfulWarning)
        return jb.solve(jb.Scene().replace(values))


def beside(row: dict[str, Any], patch: float = BOLT.patch) -> tuple[float, float]:
    """Energy and stiffness of the plane model over those of bricks, less one."""
    found = plane(row["width"], row["load"], patch)
    names = "dissipation", "secant_stiffness"
    energy, stiffness = (float(getattr(found, name)) / row[name] - 1.0 for name in names)
    return energy, stiffness


def tell(record: dict[str, Any]) -> str:
    """Table of the differences."""
    lines = []
    for row in record["rows"]:
        energy, stiffness = beside(row)
        words = f"{row['width']:4.0f} mm wide, {row['load']:.1f} of gross slip, {row['bricks']}:"
        lines.append(
            f"{words} energy {energy:+.1%}, stiffness {stiffness:+.1%} beside bricks, whose mesh "
            f"leaves {row['mesh_error']:.1%}"
        )
    return "\n".join(lines)
