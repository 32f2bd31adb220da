"""History of a contact between substructures: the record of every load step, and its figures."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np
from jax import Array

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError, Status
from jbeamshell.common.files import as_json, csv_text
from jbeamshell.common.numbers_of import numbers_of, quiet
from jbeamshell.common.summary import Summary, in_words
from jbeamshell.history.error_estimates import CLOSES, grid_error
from jbeamshell.history.figures import UNITS
from jbeamshell.history.loop_figures import LoopFigures
from jbeamshell.history.reliability import TOLERANCE, doubts_of_mesh

FIGURES = (
    "dissipation",
    "dissipation_loop",
    "secant_stiffness",
    "loss_factor",
    "peak_displacement",
    "closure",
)
OF_FACE = ("step_error", "mesh_error", "stuck_stiffness", "gross_slip")
OUT_OF_BALANCE = 1e-4  # force over the largest reaction, from which on a result is doubted
NO_SLIP = {1: 1e-12, 2: 1e-9}  # work over that of the loop's width, taken as zero
TOUCHES = 1e-9  # of the largest reaction, below which a reaction is that of an open pair, rounded
# Error of the dissipation by the mesh, over `MeshChange.loss`: of verification/face_meshes.py nine
# of ten loops are within it, but for cubes, whose loss converges slowly.
MESH = {"linear": 1.75, "cut": 1.65, "quadratic": 0.67}
COARSE = 0.1  # error by the mesh, from which on a result is doubted
SHARES = 0.8  # of the error by the mesh, that the elements bear which are named
MOST_NAMED = 8  # elements that a doubt names
HALVED = 0.25  # of its error, that an element of half the size leaves, as errors fall with h^2
PRESSED = {"frictionless": "pressed without friction", "frictional": "pressed with friction"}


class MeshChange(NamedTuple):
    """Last cycle on a mesh of twice the size, less that on the mesh itself.

    Attributes
    ----------
    loss : largest change of what is lost from a turn of the load up to a later level, over what is
        lost in that half cycle; changes of the whole cycle may cancel by chance
    works : (n,) change of the work of friction of each contact point
    kind : "quadratic" elements, "linear" ones, or "cut" for linear ones that do not match
    """

    loss: Array
    works: Array
    kind: str


class Grading(NamedTuple):
    """Elements that would have to be smaller, and what that would leave.

    Attributes
    ----------
    elements : of the upper face, those with most of the error first
    share : part of the error by the mesh that they bear
    left : relative error of the dissipation with these elements of half the size
    """

    elements: tuple[int, ...]
    share: float
    left: float


class ContactHistory(LoopFigures, eqx.Module):
    """Result of `jbeamshell.solve_contact`: the pressing, then the loads.

    Step 0 is the contact under its pressures alone.  Steps without equilibrium hold NaN.

    Attributes
    ----------
    places : (n,) X of the nodes of a contact line, or (n, 3) of the contact points of a face:
        points on its elements, or pairs of nodes where it has none
    normals : (n, 3) normals of a face; None on a line
    tributary : (n,) contact length or area of each; None on a face whose areas are not known
    elements : (n,) element of the upper face on which each point lies; None for nodes
    loads, displacements : (steps+1, m) loads, the one to and fro first, and the displacements
        conjugate to them since the pressing
    slip : (steps+1, n) slip of the upper nodes over the lower ones since the pressing; on a face
        (steps+1, n, 2), in the frames of `jbeamshell.Substructure.frames`
    gap : (steps+1, n) distance of the nodes
    friction_force : (steps+1, n) or (steps+1, n, 2) nodal forces of friction on what is below
    normal_force : (steps+1, n) nodal forces that press
    slipping : (steps+1, n) True if the node slips at the end of the step
    slip_work : (steps+1,) work of friction in each step
    status : (steps+1,) codes of `jbeamshell.Status`
    error : (steps+1,) violation of balance, friction and contact, force over the largest one
    iterations : (steps+1,) of Newton's method; 0 on a line
    friction : Coulomb's coefficient mu, a number or (n,)
    change : dissipation less that of every second load step; None where steps have no error, or it
        was not estimated
    mesh : change of the last cycle by a mesh of twice the size; None where it was not estimated
    cycles : steps at the start, the turn and the end of each closed cycle
    control : "force" or "displacement", what the amplitude is of
    assembly : "frictionless" or "frictional", how the bodies were pressed together
    points : True if the nodes are contacts of their own and no mesh, which may not be too coarse

    Examples
    --------
    >>> history = jb.solve_contact(upper, lower, friction=0.1, amplitude=0.5)
    >>> float(history.dissipation)
    """

    places: Array
    normals: Array | None
    tributary: Array | None
    elements: Array | None
    loads: Array
    displacements: Array
    slip: Array
    gap: Array
    friction_force: Array
    normal_force: Array
    slipping: Array
    slip_work: Array
    status: Array
    error: Array
    iterations: Array
    friction: Array
    change: Array | None
    mesh: MeshChange | None
    cycles: tuple[tuple[int, int, int], ...] = eqx.field(static=True)
    control: str = eqx.field(static=True)
    assembly: str = eqx.field(static=True)
    points: bool = eqx.field(static=True)

    def compared_with(
        self, fewer: ContactHistory, coarser: ContactHistory | None = None, kind: str = "linear"
    ) -> ContactHistory:
        """History with its change by half of the load steps, and by a coarser mesh in as many.

        Parameters
        ----------
        fewer : the same contact in half of the load steps
        coarser : the same on a mesh of twice the size; None if there is none
        kind : of the mesh, see `MeshChange`
        """
        lost, mesh = fewer.dissipation, None
        if coarser is not None and coarser.converged and fewer.converged:
            with np.errstate(all="ignore"):
                halves = zip(coarser._losses, fewer._losses, strict=True)
                mesh = MeshChange(
                    loss=np.max([np.max(np.abs(a - b)) / b[-1] for a, b in halves]),
                    works=coarser._friction_works - fewer._friction_works,
                    kind=kind,
                )
        return dataclasses.replace(self, change=self.dissipation - lost, mesh=mesh)

    @property
    def on_face(self) -> bool:
        """True for a contact on a face, False on a line."""
        return self.normals is not None

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
    def reaction(self) -> Array:
        """Normal reaction (steps+1, n), stress.

        Raises
        ------
        InputError
            on a face whose areas are not known, as for `traction`
        """
        return self.normal_force / self._known_areas

    @property
    def traction(self) -> Array:
        """Friction traction on what is below, (steps+1, n) or (steps+1, n, 2), stress."""
        areas = self._known_areas
        return self.friction_force / (areas[:, None] if self.on_face else areas)

    @property
    def _known_areas(self) -> Array:
        areas = self.tributary
        if areas is None:
            fix = "areas of the face are not known: read normal_force and friction_force, or give "
            raise InputError(f"tributary = None: {fix}its elements or tributary to the body")
        return areas

    @property
    def touching(self) -> Array:
        """True if a node is in contact, (steps+1, n)."""
        largest = self._numbers.max(self.normal_force, axis=-1, keepdims=True)
        return self.normal_force > TOUCHES * largest

    @property
    def contact_extent(self) -> Array:
        """Length, on a face area, of the nodes that touch, (steps+1,)."""
        return self.touching @ self._known_areas

    @property
    def slip_extent(self) -> Array:
        """Largest length, on a face area, that slipped in one step of the last cycle."""
        start, _, stop = self._last
        return self._numbers.max(self.slipping[start + 1 : stop + 1] @ self._known_areas)

    @property
    @quiet
    def dissipation(self) -> Array:
        """Work of friction in the last cycle, D; 0 if it is rounding.

        On a face it is the area of the loop.
        """
        if self.on_face:
            return self._numbers.where(self._slips, self.dissipation_loop, 0.0)
        return self._numbers.where(self._slips, super().dissipation, 0.0)

    @property
    @quiet
    def dissipation_loop(self) -> Array:
        """Area of the last loop, with each branch integrated by parabolas; 0 if it is rounding."""
        area = super().dissipation_loop
        return self._numbers.where(self._numbers.abs(area) > self._rounding, area, 0.0)

    @property
    @quiet
    def closure(self) -> Array:
        """Distance between the ends of the last cycle over its width; 0 when steady.

        It is that of the loop or of the slip, the larger one.
        """
        start, _, stop = self._last
        force, displacement = self.loop
        answer = displacement if self.control == "force" else force
        slips = self.slip[start : stop + 1].reshape(stop + 1 - start, -1)
        loop, slip = (_ends_apart(each) for each in (answer[:, None], slips))
        return self._numbers.maximum(loop, self._numbers.where(self._slips, slip, 0.0))

    @property
    @quiet
    def _slips(self) -> Array:
        """True if slip in the last cycle is more than rounding."""
        lost = self.dissipation_loop if self.on_face else super().dissipation
        return lost > self._rounding

    @property
    @quiet
    def _rounding(self) -> Array:
        """Largest work of the last cycle that is taken as zero."""
        force, displacement = self.loop
        least = NO_SLIP[2 if self.on_face else 1]
        return least * self._numbers.ptp(force) * self._numbers.ptp(displacement)

    @property
    @quiet
    def dissipation_error(self) -> Array:
        """Estimated relative error of the dissipation.

        On a line that of the mesh, see `jbeamshell.history.error_estimates.grid_error`; infinite if
        nothing slips.  On a face that of the load steps and of the mesh together; NaN if the steps
        were not estimated, and 0 if nothing slips.
        """
        if self.on_face:
            mesh = self._numbers.nan_to_num(self.mesh_error, nan=0.0)
            return self.step_error + self._numbers.where(self._slips, mesh, 0.0)
        return grid_error(self._friction_works)

    @property
    @quiet
    def step_error(self) -> Array:
        """Relative error of the dissipation by the load steps of a face.

        Half of the steps change the dissipation by as much.
        """
        change = self._numbers.nan if self.change is None else self._numbers.abs(self.change)
        lost = self._numbers.where(self._slips, self.dissipation, 1.0)
        return self._numbers.where(self._slips, change / lost, 0.0)

    @property
    @quiet
    def mesh_error(self) -> Array:
        """Relative error of the dissipation by the mesh of a face and of its bodies.

        It comes from a mesh of twice the size; NaN if that was not taken, and 0 for points that are
        contacts of their own.
        """
        if self.points:
            return self._numbers.zeros(())
        if self.mesh is None:
            return self._numbers.full((), self._numbers.nan)
        return MESH[self.mesh.kind] * self.mesh.loss

    @property
    @quiet
    def stuck_stiffness(self) -> Array:
        """Stiffness just after the load turns, while all of the contact still sticks.

        It depends on the mesh far less than the dissipation.
        """
        _, turn, _ = self._last
        return (self.force[turn + 1] - self.force[turn]) / (
            self.displacement[turn + 1] - self.displacement[turn]
        )

    @property
    def gross_slip(self) -> Array:
        """Friction that all of the contact bears at the turn of the load, mu N.

        It does not depend on the mesh where the loads alone press.
        """
        turn = self._last[1] if self.cycles else -1
        return self._numbers.sum(self.friction * self.normal_force[turn])

    @property
    def grading(self) -> Grading | None:
        """Elements that would have to be smaller; None where the mesh was not compared."""
        if self.mesh is None or self.elements is None:
            return None
        sizes = np.bincount(np.asarray(self.elements), np.abs(np.asarray(self.mesh.works)))
        total = float(np.sum(sizes))
        if not total > 0.0:
            return None
        order = np.argsort(-sizes)
        count = int(np.searchsorted(np.cumsum(sizes[order]), SHARES * total)) + 1
        named = order[:count]
        share = float(np.sum(sizes[named])) / total
        left = float(self.mesh_error) * (1.0 - share * (1.0 - HALVED))
        return Grading(tuple(named.tolist()), share, left)

    @property
    def _losses(self) -> tuple[Array, Array]:
        """Work of friction since the turn, at the levels of both halves of the last cycle."""
        begin, turn, end = self._last
        first, second = self.slip_work[begin + 1 : turn + 1], self.slip_work[turn + 1 : end + 1]
        return self._numbers.cumsum(first), self._numbers.cumsum(second)

    @property
    @quiet
    def _friction_works(self) -> Array:
        """Work of friction (n,) of each node in the last cycle; zero where nothing slips."""
        start, _, stop = self._last
        slip = self._numbers.diff(self.slip[start : stop + 1], axis=0)
        if self.on_face:
            pull = self.friction_force[start : stop + 1]
            return self._numbers.sum(0.5 * (pull[1:] + pull[:-1]) * slip, axis=(0, 2))
        # Work at the limit: what is left of rounding in stuck nodes counts for nothing.
        cap = self.friction * self.normal_force[start : stop + 1]
        path = self._numbers.abs(slip) * 0.5 * (cap[1:] + cap[:-1])
        return self._numbers.where(self._slips, self._numbers.sum(path, axis=0), 0.0)

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons to doubt this result, each a sentence with the size of the error and the fix."""
        if not self.converged:
            return ("a load found no equilibrium: that step and all after it hold NaN",)
        wrong = float(self._numbers.max(self.error))
        if wrong > OUT_OF_BALANCE:
            return (
                f"forces are off by {wrong:.2g} of the largest reaction: the contact jumps where "
                "much friction meets little stiffness; take a smaller amplitude or friction",
            )
        if not self.cycles or not float(self._numbers.max(self.friction)) > 0.0:
            return ()
        return *self._unsteady, *self._coarse

    @property
    def _unsteady(self) -> tuple[str, ...]:
        """Doubt about a cycle that does not repeat itself."""
        apart, count = float(self.closure), len(self.cycles)
        if not apart > CLOSES:
            return ()
        said = f"the last cycle is not steady: its ends are {apart:.2g} of its width apart"
        if count > 1:
            ways = np.stack([self.slip[stop] - self.slip[start] for start, _, stop in self.cycles])
            walked = float(np.max(np.abs(ways[-1])))
            if np.max(np.abs(ways[-1] - ways[-2])) <= CLOSES * walked:
                return (
                    f"the body walks: every cycle moves its contact on by {walked:.3g}; hold it, "
                    "or take a smaller amplitude, if it should stay",
                )
            start, _, stop = self.cycles[-2]
            last, before = self.dissipation, self._numbers.sum(self.slip_work[start + 1 : stop + 1])
            percent = 100.0 * abs(float(last / before) - 1.0) if before > 0.0 else 100.0
            said += f", and the dissipation changed by {percent:.3g} % since the cycle before"
        return (f"{said}; leave cycles out, or take more than {count}",)

    @property
    def _coarse(self) -> tuple[str, ...]:
        """Doubts about the load steps and the mesh."""
        if not self.on_face:
            return () if self.points else doubts_of_mesh(float(self.dissipation_error))
        doubts, error, mesh = [], float(self.step_error), float(self.mesh_error)
        if error > TOLERANCE:
            doubts.append(
                f"the dissipation may be off by {100.0 * error:.2g} %: take more "
                "steps_per_half_cycle"
            )
        if bool(self._slips) and not mesh <= COARSE and self.change is not None:
            doubts.append(self._coarse_mesh(mesh))
        return tuple(doubts)

    def _coarse_mesh(self, error: float) -> str:
        """Doubt about a mesh with such an error, or with one that is not known."""
        if np.isnan(error):
            return (
                "the mesh has an error that is not known, because it has too few nodes for a "
                "coarser one, or that has no equilibrium: mesh the bodies finer, or take "
                "points=True for nodes that are contacts of their own"
            )
        by = f"{100.0 * error:.2g} %" if error < 1.0 else "100 % or more"
        said, fix = f"the mesh may put the dissipation off by {by}", "mesh face and bodies finer"
        grading = self.grading
        if grading is None:
            return f"{said}: {fix}"
        named = ", ".join(map(str, grading.elements[:MOST_NAMED]))
        more = len(grading.elements) - MOST_NAMED
        named += f" and {more} more" if more > 0 else ""
        left = min(100.0 * grading.left, 100.0)
        return (
            f"{said}, {100.0 * grading.share:.0f} % of it in elements {named} of the upper face, "
            f"whose half size would leave about {left:.2g} %: {fix} there"
        )

    def figures(self) -> dict[str, Any]:
        """Figures of the last cycle and of the contact at the last step, as plain numbers.

        Returns
        -------
        dict
            numbers by name, None where undefined (such as 0/0), and the doubts
        """
        names = FIGURES + (OF_FACE if self.on_face else ())
        values = {name: float(getattr(self, name)) for name in names if self.cycles}
        extent = "area" if self.on_face else "length"
        if self.tributary is None:
            values["normal_force_max"] = float(self._numbers.max(self.normal_force[-1]))
        else:
            values["reaction_max"] = float(self._numbers.max(self.reaction[-1]))
            values[f"contact_{extent}"] = float(self.contact_extent[-1])
            if self.cycles:
                values[f"slip_{extent}"] = float(self.slip_extent)
        values["opening_max"] = float(self._numbers.max(self.gap))
        found: dict[str, Any] = {k: v if np.isfinite(v) else None for k, v in values.items()}
        return found | {"assembly": self.assembly, "doubts": list(self.doubts)}

    def __str__(self) -> str:
        where = f"{self.gap.shape[1]} nodes of a contact line"
        if self.on_face:
            where = f"{self.gap.shape[1]} {'pairs of nodes' if self.elements is None else 'points'}"
            where += " of a contact face"
        title = f"{self.force.size} levels on {where}, {PRESSED[self.assembly]}"
        # Forces and works on a line are per width.
        units = UNITS | {"opening_max": "length", "contact_length": "length"}
        units = {name: word for name, word in units.items() if not self.on_face}
        figures = self.figures()
        figures.pop("assembly")
        doubts = [f"doubtful: {doubt}" for doubt in figures.pop("doubts")]
        rows = [
            (
                name.replace("_", " "),
                in_words(value) + (f"  [{units[name]}]" if name in units else ""),
            )
            for name, value in figures.items()
        ]
        return Summary(title, rows, doubts).as_text()

    def plot(self, axes: Any = None) -> Any:
        """Draw force over displacement; returns the axes."""
        from jbeamshell import plotting

        drawn = plotting.loop(self, axes)
        if self.on_face:
            drawn.set(xlabel="displacement of the load", ylabel="load")
        return drawn

    def plot_contact(self, steps: Any = None, axes: Any = None) -> Any:
        """Draw slip, gap, traction and reaction along X at chosen steps; returns the axes.

        On a face they are maps of one step, the last if left out; returns the figure.
        """
        from jbeamshell import plotting

        if self.on_face:
            require("axes", axes, axes is None, "a map of a face has a figure of its own")
            return plotting.face_map(self, -1 if steps is None else steps)
        return plotting.contact_lines(self, steps, axes)

    def animate(self, steps: Any = None, **options: Any) -> Any:
        """Film of the last cycle on a line, for a GIF; see `jbeamshell.plotting.animate`.

        Raises
        ------
        InputError
            for a contact on a face
        """
        from jbeamshell import plotting

        fix = "a film shows a contact line: draw maps of a face by plot_contact"
        require("history", "of a face", not self.on_face, fix)
        return plotting.animate(self, steps, **options)

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write ``loop.csv``, ``contact.csv``, ``result.json`` and pictures to a folder.

        ``contact.csv`` has the contact at all steps.  On a face it has the pressing, and the start,
        the turn and the end of the last cycle; without one, the last step.
        """
        from jbeamshell.plotting.folder import check_folder, write_folder

        count, n = self.gap.shape
        steps = list(range(count))
        if self.on_face:
            steps = [0, *(self.cycles[-1] if self.cycles else (count - 1,))]
        loop = {"force": self.force, "displacement": self.displacement}
        loop |= {"slip_work": self.slip_work, "status": self.status}
        columns: dict[str, Any] = {"step": np.arange(count)[:, None]}
        places = np.asarray(self.places).reshape(n, -1)
        columns |= dict(zip("xyz", places.T, strict=False))
        if self.tributary is not None:
            columns["tributary"] = self.tributary
        columns |= _by_ways("slip", self.slip) | {"gap": self.gap}
        columns |= _by_ways("friction_force", self.friction_force)
        columns |= {"normal_force": self.normal_force, "slipping": self.slipping}
        every = [np.broadcast_to(values, (count, n)) for values in columns.values()]
        contact = np.column_stack([values[steps].ravel() for values in every])
        texts = {
            "loop.csv": csv_text(tuple(loop), np.column_stack(list(loop.values())).tolist()),
            "contact.csv": csv_text(tuple(columns), contact.tolist()),
            "result.json": as_json(self.figures()),
        }
        turn = steps[-2] if self.on_face and self.cycles else None
        drawn = {"loop.png": np.ravel(self.plot())[0].figure}
        maps = self.plot_contact(turn)
        drawn["contact.png"] = maps if self.on_face else np.ravel(maps)[0].figure
        return write_folder(check_folder(folder), texts, drawn)


def _by_ways(name: str, values: Array) -> dict[str, Array]:
    """Columns of a tangential field (steps, n), or of both components (steps, n, 2) on a face."""
    if values.ndim == 2:
        return {name: values}
    return {f"{name}_{way + 1}": values[..., way] for way in range(2)}


def _ends_apart(values: Array) -> Array:
    """Largest distance between the ends of lines (levels, lines) over the largest range."""
    numbers = numbers_of(values)
    width = numbers.max(numbers.ptp(values, axis=0))
    apart = numbers.max(numbers.abs(values[-1] - values[0]))
    return apart / numbers.where(width > 0.0, width, 1.0)
