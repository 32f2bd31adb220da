"""Mode of two bodies whose face sticks, and the forces that bend them into it.

Loaded by M phi, a structure moves into its mode phi; with friction it does so along a loop.  The
frequency of the mode is the root of the loop's secant stiffness, the damping half of its loss
factor (quasi-static modal analysis: Festjens, Chevallier and Dion 2013; Allen, Lacayo and Brake
2016).
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy.sparse
from jax import Array
from jax.typing import ArrayLike as Number
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.linalg import eigsh

from jbeamshell.bodies.contact import solve_contact
from jbeamshell.bodies.contact_points import contact_points
from jbeamshell.bodies.face_bodies import Stiffer, stiffer
from jbeamshell.bodies.stiffness_model import StiffnessModel
from jbeamshell.bodies.substructure import Substructure
from jbeamshell.common.checks import as_leaf, is_traced, require, require_count
from jbeamshell.common.errors import UnconvergedError, warn_of_doubts
from jbeamshell.common.files import as_json, csv_text
from jbeamshell.common.progress import patience
from jbeamshell.common.summary import Summary, ranged

RIGID = 1e-7  # eigenvalue over the largest one found, below which a mode is a rigid motion
ABOVE, LEAST, POINTS = 1.2, 0.03, 20  # of the amplitudes taken: over `begins`, `slides`, how many
COLUMNS = {
    "amplitude": "modal displacement",
    "frequency": "frequency",
    "damping": "damping ratio",
    "dissipation": "lost per cycle",
}
SHIFT = 1e-9  # of the stiffest node over the lightest one, below zero, where modes are sought


class FacePart(NamedTuple):
    """Finite-element model of a body, and what its face, its bolts and its pull are.

    Attributes
    ----------
    model : stiffness and mass, which only modes need
    contact : (n, 4) node, X, Y and Z of the face's nodes
    press : for each bolt, (k, 3) node, direction and force
    pull : (k, 3) node, direction and force of a unit of the load that is cycled; modes need none
    normals, tributary, elements : of the face, see `jbeamshell.StiffnessModel.condensed`
    """

    model: StiffnessModel
    contact: ArrayLike
    press: Sequence[ArrayLike] = ()
    pull: ArrayLike | None = None
    normals: ArrayLike | None = None
    tributary: ArrayLike | None = None
    elements: Iterable[ArrayLike] | None = None

    def body(self) -> Substructure:
        """Body on its face; see `jbeamshell.StiffnessModel.condensed`."""
        return self.model.condensed(
            self.contact,
            pull=self.pull,
            press=self.press,
            normals=self.normals,
            elements=self.elements,
            tributary=self.tributary,
        )


class ModalBodies(NamedTuple):
    """Bodies that are pulled into a mode.

    The displacement conjugate to their load is the modal displacement q, for modes of unit modal
    mass.

    Attributes
    ----------
    upper, lower : bodies for `jbeamshell.solve_contact`; lower is None on a rigid base
    omega : angular frequency of the mode while the face sticks
    touching : (q,) True for the contact points that the bolts press together
    begins : modal displacement at which friction no longer bears the force on one of them
    slides : modal displacement at which friction would bear the forces on the stuck face in sum
    friction, bolts, gap : of the pressing
    """

    upper: Substructure
    lower: Substructure | None
    omega: float
    touching: NDArray[np.bool_]
    begins: float
    slides: float
    friction: Number
    bolts: Number
    gap: Number

    def __str__(self) -> str:
        pairs = f"{self.touching.size} contact points, of which {int(np.sum(self.touching))} touch"
        rows = [
            ("frequency, stuck", f"{self.omega / (2.0 * np.pi):.6g}"),
            ("slip begins at", f"{self.begins:.6g} modal displacement"),
            ("all slides at", f"{self.slides:.6g}"),
        ]
        return Summary(f"bodies pulled into a mode, {pairs}", rows).as_text()

    def __repr__(self) -> str:
        return str(self)


def modal_bodies(
    upper: FacePart,
    lower: FacePart | None = None,
    *,
    mode: int = 0,
    friction: Number = 0.1,
    bolts: Number = 1.0,
    gap: Number = 0.0,
) -> ModalBodies:
    """Bodies on their face, loaded by the inertia of a mode.

    The mode is that of the pressed bodies, whose contact points stick where they touch.

    Parameters
    ----------
    upper, lower : bodies with masses; None is a rigid base
    mode : number of the mode, counted from 0; rigid motions do not count
    friction, bolts, gap : as in `jbeamshell.solve_contact`, for the pressing

    Raises
    ------
    InputError
        for a model without mass, or a mode that does not exist
    """
    require_count("mode", mode, 0)
    parts = [part for part in (upper, lower) if part is not None]
    for key, part in zip(("upper", "lower"), parts, strict=False):
        fix = "has no mass: read the model with mass="
        require(f"{key}.model", part.model.matrix.shape, part.model.mass is not None, fix)
    pulls: list[ArrayLike | None] = [part.press[0] if part.press else None for part in parts]
    pressed = _bodies(parts, pulls)
    sizes = np.broadcast_to(np.asarray(bolts, float), max(body.bolts for body in pressed))
    history = solve_contact(
        *pressed, friction=friction, bolts=sizes, gap=gap, path=np.append(0.0, sizes)[None]
    )
    touching = np.asarray(history.touching[0])
    found = _stuck_mode(parts, pressed, touching, mode)
    bodies = _bodies(parts, found.inertia)
    borne = found.borne[touching]
    shear, normal = np.linalg.norm(borne[:, :2], axis=1), np.abs(borne[:, 2])
    rough = np.broadcast_to(history.friction, touching.shape)[touching]
    holds = rough * np.asarray(history.normal_force[0])[touching]
    # A point lets go where its shear meets the friction of what the mode leaves of its reaction.
    pulled, size = shear + rough * normal, float(np.sum(shear))
    return ModalBodies(
        upper=bodies[0],
        lower=bodies[1] if lower is not None else None,
        omega=found.omega,
        touching=touching,
        begins=float(np.min(holds[pulled > 0.0] / pulled[pulled > 0.0], initial=np.inf)),
        slides=float(np.sum(holds)) / size if size > 0.0 else np.inf,
        friction=friction,
        bolts=bolts,
        gap=gap,
    )


class FaceCurve(eqx.Module):
    """Frequency and damping of a mode over its amplitude, (k,) each.

    Attributes
    ----------
    amplitude : modal displacement q
    frequency : cycles per time
    damping : damping ratio zeta of the friction on the face
    dissipation : energy lost per cycle
    doubts : reasons to doubt a point, the first amplitude before each
    """

    amplitude: Array
    frequency: Array
    damping: Array
    dissipation: Array
    doubts: tuple[str, ...] = eqx.field(static=True)

    def figures(self) -> dict[str, Any]:
        """Points of the curve as lists of plain numbers, and the doubts."""
        columns = {name: np.asarray(getattr(self, name)).tolist() for name in COLUMNS}
        return columns | {"doubts": list(self.doubts)}

    def __str__(self) -> str:
        rows = [(word, ranged(np.asarray(getattr(self, name)))) for name, word in COLUMNS.items()]
        notes = [f"doubtful: {doubt}" for doubt in self.doubts]
        return Summary(f"mode of a face, {len(self.amplitude)} points", rows, notes).as_text()

    def plot(self, axes: Any = None) -> Any:
        """Draw frequency and damping over the amplitude; returns the axes."""
        from jbeamshell import plotting

        return plotting.modal_curve(self, axes=axes)

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write ``backbone.csv``, ``result.json`` and a picture to a folder."""
        from jbeamshell.plotting.folder import check_folder, write_folder

        rows = np.column_stack([np.asarray(getattr(self, name)) for name in COLUMNS])
        texts = {
            "backbone.csv": csv_text(tuple(COLUMNS), rows.tolist()),
            "result.json": as_json(self.figures()),
        }
        picture = {"backbone.png": np.ravel(self.plot())[0].figure}
        return write_folder(check_folder(folder), texts, picture)


@patience("following the mode")
def face_curve(
    bodies: ModalBodies,
    amplitudes: ArrayLike | None = None,
    *,
    throw: bool = True,
    **options: Any,
) -> FaceCurve:
    """Frequency and damping of a mode over its amplitude, from the loops of its contact.

    All numbers may be traced: friction, bolts, gap, softness and the amplitudes.

    Parameters
    ----------
    bodies : of `modal_bodies`
    amplitudes : (k,) modal displacements, positive; None is 20 of them, from where the first pair
        slips to where nearly all of the face slides
    throw : as in `jbeamshell.solve_contact`
    options : softness, steps_per_half_cycle and the like, as `jbeamshell.solve_contact` takes them;
        friction, bolts and gap are those of `modal_bodies` if left out

    Raises
    ------
    InputError
        for amplitudes that are not positive, or options that make no sense
    UnconvergedError
        if a loop has no equilibrium
    """
    if amplitudes is None:
        fix = "the mode does not shear the face, so that nothing slides: give amplitudes"
        require("amplitudes", None, bool(np.isfinite(bodies.slides)), fix)
        begin = min(max(ABOVE * bodies.begins, LEAST * bodies.slides), 0.5 * bodies.slides)
        amplitudes = np.geomspace(begin, bodies.slides, POINTS)
    sizes = jnp.atleast_1d(as_leaf(amplitudes, "amplitudes"))
    fix = "give positive modal displacements"
    positive = is_traced(sizes) or bool(np.all(np.asarray(sizes) > 0.0))
    require("amplitudes", sizes, positive and sizes.ndim == 1, fix)
    options = {name: getattr(bodies, name) for name in ("friction", "bolts", "gap")} | options
    options |= {"control": "displacement", "throw": False}
    loops = []
    for size in sizes:
        loop = solve_contact(bodies.upper, bodies.lower, amplitude=size, **options)
        if throw and not is_traced(loop) and not loop.converged:
            raise UnconvergedError(
                f"amplitude {size:.6g}: a step has no equilibrium; take more steps"
            )
        loops.append(loop)
    said: dict[str, list[str]] = {}  # alike but for their size
    for size, loop in [] if is_traced(loops) else zip(sizes, loops, strict=True):
        for doubt in loop.doubts:
            said.setdefault(re.split("[:;]", doubt)[-1], []).append(f"at {size:.4g}: {doubt}")
    more = {fix: f" (and at {len(words) - 1} more)" for fix, words in said.items() if words[1:]}
    stiffness = jnp.stack([loop.secant_stiffness for loop in loops])
    curve = FaceCurve(
        amplitude=sizes,
        frequency=jnp.sqrt(stiffness) / (2.0 * np.pi),
        damping=0.5 * jnp.stack([loop.loss_factor for loop in loops]),
        dissipation=jnp.stack([loop.dissipation for loop in loops]),
        doubts=tuple(words[0] + more.get(fix, "") for fix, words in said.items()),
    )
    if throw:
        warn_of_doubts(curve.doubts)
    return curve


def _bodies(parts: list[FacePart], pulls: Sequence[ArrayLike | None]) -> list[Substructure]:
    """Bodies with other pulls; those without elements have the areas and normals of the first."""
    first = parts[0]._replace(pull=pulls[0]).body()
    bodies = [first]
    for part, pull in zip(parts[1:], pulls[1:], strict=True):
        if part.elements is None:
            part = part._replace(tributary=first.tributary, normals=first.normals)
        bodies.append(part._replace(pull=pull).body())
    return bodies


class Stuck(NamedTuple):
    """Mode while the face sticks.

    Attributes
    ----------
    omega : angular frequency
    inertia : for each body the rows (node, direction, force) of M phi
    borne : (q, 3) force of the contact points on the upper face, in their frames, per modal
        displacement
    """

    omega: float
    inertia: list[NDArray[np.float64]]
    borne: NDArray[np.float64]


def _stuck_mode(
    parts: list[FacePart], bodies: list[Substructure], touching: NDArray[np.bool_], mode: int
) -> Stuck:
    """Mode of a number, rigid motions not counted."""
    below = bodies[1] if len(bodies) > 1 else None
    made = contact_points(bodies[0], below, False)
    stiffness = scipy.sparse.block_diag([part.model.matrix for part in parts], format="csc")
    mass = scipy.sparse.block_diag([part.model.mass for part in parts], format="csc")
    if made.elements is None:
        ties = _ties(parts, touching)
        moved = None
        k, m = (scipy.sparse.csc_array(ties.T @ each @ ties) for each in (stiffness, mass))
    else:
        added = stiffer(bodies[0], below, made)
        turned = [_onto_face(part, body) for part, body in zip(parts, bodies, strict=True)]
        moved = _moves_of(added, turned)
        held = moved[np.repeat(touching, 3)]
        springs = scipy.sparse.diags_array(added.springs[touching].ravel())
        more = [turn.T @ extra @ turn for turn, extra in zip(turned, added.bodies, strict=True)]
        k = stiffness + scipy.sparse.block_diag(more, format="csc") + held.T @ springs @ held
        k, m, ties = scipy.sparse.csc_array(k), mass, scipy.sparse.eye_array(mass.shape[0])
    count = mode + 7
    fix = f"must be less than {k.shape[0] - 7}, the free displacements"
    require("mode", mode, count < k.shape[0], fix)
    shift = -SHIFT * np.max(k.diagonal()) / np.min(m.diagonal())
    start = np.ones(k.shape[0])  # the same digits in every run
    values, vectors = eigsh(k, count, m, sigma=shift, v0=start)
    order = np.argsort(values)
    elastic = order[values[order] > RIGID * np.max(values)]
    at = elastic[mode]
    shape = ties @ vectors[:, at]
    shape *= np.sign(shape[np.argmax(np.abs(shape))])
    inertia, begin, tables = mass @ shape, 0, []
    for part in parts:
        rows = inertia[begin : begin + len(part.model.dofs)]
        tables.append(np.column_stack([part.model.dofs, rows]))
        begin += len(part.model.dofs)
    if moved is not None:
        borne = -added.springs * (moved @ shape).reshape(-1, 3)
        return Stuck(float(np.sqrt(values[at])), tables, borne)
    force = stiffness @ shape - values[at] * inertia
    on_upper = force[: len(parts[0].model.dofs)]
    borne = (_onto_face(parts[0], bodies[0]) @ on_upper).reshape(-1, 3)
    return Stuck(float(np.sqrt(values[at])), tables, borne)


def _onto_face(part: FacePart, body: Substructure) -> scipy.sparse.csr_array:
    """Displacements (3n, N) of a face's nodes in their frames, from those of its model."""
    row = {(int(a), int(b)): i for i, (a, b) in enumerate(part.model.dofs)}
    nodes = np.asarray(part.contact, float)[:, 0].astype(int).tolist()
    at = np.array([[row.get((node, way), -1) for way in (1, 2, 3)] for node in nodes])
    rows = np.broadcast_to(np.arange(3 * len(nodes)).reshape(-1, 3, 1), (len(nodes), 3, 3))
    columns = np.broadcast_to(at[:, None], rows.shape)
    there = columns >= 0
    shape = (3 * len(nodes), len(part.model.dofs))
    return scipy.sparse.csr_array((body.frames[there], (rows[there], columns[there])), shape=shape)


def _moves_of(added: Stiffer, turned: list[scipy.sparse.csr_array]) -> scipy.sparse.csr_array:
    """Displacements (3q, N) of the contact points, upper ones over lower ones, from all models."""
    parts = []
    for sign, (nodes, shares), turn in zip((1.0, -1.0), added.shares, turned, strict=False):
        q, k = nodes.shape
        rows = np.broadcast_to(np.arange(3 * q).reshape(q, 1, 3, 1), (q, k, 3, 3))
        columns = np.broadcast_to((3 * nodes[:, :, None] + np.arange(3))[:, :, None], rows.shape)
        shape = (3 * q, turn.shape[0])
        entries = sign * shares.ravel(), (rows.ravel(), columns.ravel())
        parts.append(scipy.sparse.csr_array(entries, shape=shape) @ turn)
    return scipy.sparse.csr_array(scipy.sparse.hstack(parts))


def _ties(parts: list[FacePart], touching: NDArray[np.bool_]) -> scipy.sparse.csc_array:
    """Matrix from the free displacements to those of all bodies, pairs that touch moving as one."""
    dofs = [part.model.dofs.tolist() for part in parts]
    names = [(side, node, way) for side, rows in enumerate(dofs) for node, way in rows]
    row = {name: i for i, name in enumerate(names)}
    column = np.arange(len(names))
    faces = [np.asarray(part.contact, float)[:, 0].astype(int) for part in parts]
    for pair in np.flatnonzero(touching):
        for way in (1, 2, 3):
            ends = [row.get((side, int(face[pair]), way)) for side, face in enumerate(faces)]
            free = [end for end in ends if end is not None]
            held = len(parts) == 1 or len(free) < len(parts)
            for end in free:
                column[end] = -1 if held else min(free)
    kept, place = np.unique(column[column >= 0], return_inverse=True)
    rows = np.flatnonzero(column >= 0)
    shape = (len(names), kept.size)
    return scipy.sparse.csc_array((np.ones(rows.size), (rows, place)), shape=shape)
