"""History of a contact on a face: the record of every load step, and its figures."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.errors import Status
from jbeamshell.common.files import as_json, csv_text
from jbeamshell.common.summary import Summary, in_words
from jbeamshell.history.loop_figures import LoopFigures

FIGURES = (
    "dissipation",
    "dissipation_loop",
    "secant_stiffness",
    "loss_factor",
    "peak_displacement",
)
SLIDES = 1e-9  # of friction times reaction, within which a pair is at its limit
TOUCHES = 1e-9  # of the largest reaction, below which a reaction is that of an open pair, rounded
STEADY = 5e-3  # slip left over by a cycle, over its range, up to which D has settled
FEW = 10.0  # pairs that share the work of friction, below which the mesh decides about it
MESH = 3.0  # error of the dissipation over one per pair that shares it: measured .5 to 3, and up to
# 10 where nearly all of the face slides
NO_SLIP = 1e-9  # dissipation over the loop's extents, up to which nothing slips
COARSE = 0.02  # error of the dissipation, from which on it is doubted


class FaceHistory(LoopFigures, eqx.Module):
    """Result of `jbeamshell.solve_faces`: the pressing, then the loads.

    Step 0 is the contact under its pressures alone.  Steps without equilibrium hold NaN.

    Attributes
    ----------
    places, normals : (n, 3) contact nodes, and normals of the face
    tributary : (n,) contact areas
    loads, displacements : (steps+1, m) loads, the one to and fro first, and the displacements
        conjugate to them since the pressing
    slip : (steps+1, n, 2) slip of the upper nodes over the lower ones since the pressing, in the
        frames of `jbeamshell.FaceBody.frames`
    gap : (steps+1, n) distance of the pairs
    traction : (steps+1, n, 2) force of friction on what is below
    reaction : (steps+1, n) normal force
    status : (steps+1,) of the search for equilibrium, see `jbeamshell.Status`
    error : (steps+1,) force out of balance, over the largest load of a node
    iterations : (steps+1,) of Newton's method
    friction : (n,) Coulomb's coefficient mu
    change : dissipation less that of every second load step; NaN where it was not computed
    cycles : steps at the start, the turn and the end of each closed cycle
    control : "force" or "displacement", what the amplitude is of
    assembly : "frictional" or "frictionless", how the bodies were pressed together
    """

    places: Array
    normals: Array
    tributary: Array
    loads: Array
    displacements: Array
    slip: Array
    gap: Array
    traction: Array
    reaction: Array
    status: Array
    error: Array
    iterations: Array
    friction: Array
    change: Array
    cycles: tuple[tuple[int, int, int], ...] = eqx.field(static=True)
    control: str = eqx.field(static=True)
    assembly: str = eqx.field(static=True)

    @property
    def converged(self) -> bool:
        """True if every step found its equilibrium."""
        return bool(np.all(np.asarray(self.status) == Status.CONVERGED))

    @property
    def force(self) -> Array:  # type: ignore[override]
        """Load to and fro (steps+1,)."""
        return self.loads[:, 0]

    @property
    def displacement(self) -> Array:  # type: ignore[override]
        """Displacement (steps+1,) conjugate to the load to and fro."""
        return self.displacements[:, 0]

    @property
    def touching(self) -> Array:
        """True if a pair is in contact, (steps+1, n)."""
        return self.reaction > TOUCHES * jnp.max(self.reaction, axis=-1, keepdims=True)

    @property
    def slipping(self) -> Array:  # type: ignore[override]
        """True if a pair slips at the end of the step, (steps+1, n)."""
        limit = self.friction * self.reaction
        at_limit = jnp.linalg.norm(self.traction, axis=-1) >= (1.0 - SLIDES) * limit
        return self.touching & at_limit & (self.friction > 0.0)

    @property
    def slip_work(self) -> Array:  # type: ignore[override]
        """Work of friction in each step (steps+1,)."""
        mean = 0.5 * (self.traction[1:] + self.traction[:-1])
        work = jnp.sum(mean * jnp.diff(self.slip, axis=0), axis=(1, 2))
        return jnp.append(0.0, work)

    @property
    def sharing(self) -> Array:
        """Pairs that share the work of friction of the last cycle, W_i: (sum W_i)^2 / sum W_i^2."""
        start, _, stop = self._last
        pull, slip = self.traction[start : stop + 1], self.slip[start : stop + 1]
        work = jnp.sum(0.5 * (pull[1:] + pull[:-1]) * jnp.diff(slip, axis=0), axis=(0, 2))
        squares = jnp.sum(work**2)
        return jnp.sum(work) ** 2 / jnp.where(squares > 0.0, squares, 1.0)

    @property
    def dissipation(self) -> Array:
        """Area of the last loop, D; 0 if it is rounding."""
        return jnp.where(self._slips, self.dissipation_loop, 0.0)

    @property
    def _slips(self) -> Array:
        """True if slip in the last cycle is more than rounding."""
        force, displacement = self.loop
        return self.dissipation_loop > NO_SLIP * jnp.ptp(force) * jnp.ptp(displacement)

    @property
    def dissipation_error(self) -> Array:
        """Estimated relative error of the dissipation by the load steps; NaN if not estimated.

        The error falls with the steps, so that half of them change it by as much as is left.  It is
        0 if nothing slips.
        """
        known = jnp.where(self._slips, self.dissipation, 1.0)
        return jnp.where(self._slips, jnp.abs(self.change) / known, 0.0 * self.change)

    @property
    def closure(self) -> Array:
        """Distance between the ends of the slip of the last cycle over its range; 0 when steady."""
        start, _, stop = self._last
        slip = self.slip[start : stop + 1]
        width = jnp.max(jnp.ptp(slip, axis=0))
        apart = jnp.max(jnp.abs(slip[-1] - slip[0]))
        return apart / jnp.where(width > 0.0, width, 1.0)

    @property
    def open_area(self) -> Array:
        """Area (steps+1,) of the pairs that do not touch."""
        return ~self.touching @ self.tributary

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons to doubt this result, each a sentence with the size of the error and the fix."""
        if not self.converged:
            return ("a load found no equilibrium: that step and all after it hold NaN",)
        if not self.cycles:
            return ()
        doubts = []
        apart = float(self.closure)
        if apart > STEADY:
            doubts.append(
                f"the last cycle is not steady: its ends are {apart:.2g} of its width apart; take "
                f"more than {len(self.cycles)} cycles"
            )
        error = float(self.dissipation_error)
        if error > COARSE:
            doubts.append(
                f"the dissipation may be off by {100.0 * error:.2g} %: take more "
                "steps_per_half_cycle"
            )
        pairs = float(self.sharing)
        if bool(self._slips) and pairs < FEW:
            doubts.append(
                f"only {pairs:.1f} pairs share the slip, so that the mesh may put the dissipation "
                f"off by {min(100.0 * MESH / pairs, 100.0):.0f} %: mesh the face finer"
            )
        return tuple(doubts)

    def figures(self) -> dict[str, Any]:
        """Figures of the last cycle and of the contact at the last step, as plain numbers."""
        values = {name: float(getattr(self, name)) for name in FIGURES if self.cycles}
        values["reaction_max"] = float(jnp.max(self.reaction[-1]))
        values["opening_max"] = float(jnp.max(self.gap))
        values["open_area"] = float(self.open_area[-1])
        found: dict[str, Any] = {k: v if np.isfinite(v) else None for k, v in values.items()}
        return found | {"assembly": self.assembly, "doubts": list(self.doubts)}

    def __str__(self) -> str:
        title = f"contact on a face: {self.force.size} levels, {self.tributary.size} pairs"
        figures = self.figures()
        doubts = [f"doubtful: {doubt}" for doubt in figures.pop("doubts")]
        rows = [(name.replace("_", " "), in_words(value)) for name, value in figures.items()]
        return Summary(title, rows, doubts).as_text()

    def plot(self, axes: Any = None) -> Any:
        """Draw force over displacement; returns the axes."""
        from jbeamshell import plotting

        drawn = plotting.loop(self, axes)
        drawn.set(xlabel="displacement of the load", ylabel="load")
        return drawn

    def plot_face(self, step: int = -1) -> Any:
        """Draw where the face sticks, slips and opens, its pressure, slip and gap, at a step."""
        from jbeamshell import plotting

        return plotting.face_map(self, step)

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write ``loop.csv``, ``face.csv``, ``result.json`` and pictures to a folder.

        ``face.csv`` is the face at the pressing, and at the start, the turn and the end of the last
        cycle; without one, at the last step.
        """
        from jbeamshell.plotting.folder import check_folder, write_folder

        names = ("force", "displacement", "slip_work")
        loop = np.column_stack([np.asarray(getattr(self, name)) for name in names])
        steps = [0, *(self.cycles[-1] if self.cycles else (self.force.size - 1,))]
        along = {
            "tributary": self.tributary,
            "slip_1": self.slip[..., 0],
            "slip_2": self.slip[..., 1],
            "gap": self.gap,
            "traction_1": self.traction[..., 0],
            "traction_2": self.traction[..., 1],
            "reaction": self.reaction,
            "slipping": self.slipping,
        }
        size = self.gap.shape
        columns = [np.indices(size)[0], *(np.broadcast_to(p, size) for p in self.places.T)]
        columns += [np.broadcast_to(np.asarray(values), size) for values in along.values()]
        face = np.column_stack([column[steps].ravel() for column in columns])
        texts = {
            "loop.csv": csv_text(names, loop.tolist()),
            "face.csv": csv_text(("step", "x", "y", "z", *along), face.tolist()),
            "result.json": as_json(self.figures()),
        }
        pictures = {
            "loop.png": np.ravel(self.plot())[0].figure,
            "face.png": self.plot_face(steps[-2] if self.cycles else -1),
        }
        return write_folder(check_folder(folder), texts, pictures)
