"""History of a contact between substructures: the record of every load step, and its figures."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.files import as_json, csv_text
from jbeamshell.common.summary import Summary, in_words
from jbeamshell.history.error_estimates import grid_error
from jbeamshell.history.figures import UNITS
from jbeamshell.history.loop_figures import LoopFigures
from jbeamshell.history.reliability import CLOSES, doubts_of_mesh

FIGURES = (
    "dissipation",
    "dissipation_loop",
    "secant_stiffness",
    "loss_factor",
    "peak_displacement",
    "slip_length",
    "closure",
)
OUT_OF_BALANCE = 1e-4  # force over the largest reaction, from which on a result is doubted
NO_SLIP = 1e-12  # work over that of the loop's width, taken as zero
PRESSED = {"frictionless": "pressed without friction", "frictional": "pressed with friction"}


class ContactHistory(LoopFigures, eqx.Module):
    """Result of `jbeamshell.solve_contact`: the pressing, then the loads.

    Step 0 is the contact under its pressures alone.  Steps without equilibrium hold NaN.

    Attributes
    ----------
    x, tributary : (n,) places of the contact nodes, rising, and their contact lengths
    force, displacement : (steps+1,) load, and the displacement conjugate to it since the pressing
    slip, gap : (steps+1, n) tangential displacement since the pressing and height of the body, over
        what it touches
    traction, reaction : (steps+1, n) friction traction on what is below, normal reaction
    slipping : (steps+1, n) True if the node slips at the end of the step
    slip_work : (steps+1,) work of friction in each step
    settled : (steps+1,) True where equilibrium was found
    error : (steps+1,) violation of balance, friction and contact, force over the largest reaction
    friction : Coulomb's coefficient mu
    cycles : steps at the start, the turn and the end of each closed cycle
    control : "force" or "displacement", what the amplitude is of
    assembly : "frictionless" or "frictional", how the bodies were pressed together
    points : True if the nodes are contacts of their own and no mesh, which may not be too coarse

    Examples
    --------
    >>> history = jb.solve_contact(upper, lower, friction=0.1, amplitude=0.5)
    >>> float(history.dissipation)
    """

    x: Array
    tributary: Array
    force: Array
    displacement: Array
    slip: Array
    gap: Array
    traction: Array
    reaction: Array
    slipping: Array
    slip_work: Array
    settled: Array
    error: Array
    friction: Array
    cycles: tuple[tuple[int, int, int], ...] = eqx.field(static=True)
    control: str = eqx.field(static=True)
    assembly: str = eqx.field(static=True)
    points: bool = eqx.field(static=True)

    @property
    def converged(self) -> bool:
        """True if every step found its equilibrium."""
        return bool(np.all(np.asarray(self.settled)))

    @property
    def touching(self) -> Array:
        """True if a node is in contact, (steps+1, n)."""
        return self.reaction > 0.0

    @property
    def closure(self) -> Array:
        """Distance between the ends of the last cycle over its width; 0 when steady.

        It is that of the loop or of the slip, the larger one.
        """
        start, _, stop = self._last
        force, displacement = self.loop
        answer = displacement if self.control == "force" else force
        both = (_ends_apart(each) for each in (answer[:, None], self.slip[start : stop + 1]))
        loop, slip = both
        return jnp.maximum(loop, jnp.where(self._slips, slip, 0.0))

    @property
    def _slips(self) -> Array:
        """True if slip in the last cycle is more than rounding."""
        force, displacement = self.loop
        return self.dissipation > NO_SLIP * jnp.ptp(force) * jnp.ptp(displacement)

    @property
    def dissipation_error(self) -> Array:
        """Estimated relative error of the dissipation that the mesh of the contact makes.

        See `jbeamshell.history.error_estimates.grid_error`; infinite if nothing slips.
        """
        start, _, stop = self._last
        slip, cap = self.slip[start : stop + 1], self.friction * self.reaction[start : stop + 1]
        path = jnp.abs(jnp.diff(slip, axis=0)) * 0.5 * (cap[1:] + cap[:-1])
        return grid_error(jnp.where(self._slips, jnp.sum(path, axis=0), 0.0) * self.tributary)

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons to doubt this result, each a sentence with the size of the error and the fix."""
        if not self.converged:
            return ("a load found no equilibrium: that step and all after it hold NaN",)
        wrong = float(jnp.max(self.error))
        if wrong > OUT_OF_BALANCE:
            return (
                f"forces are off by {wrong:.2g} of the largest reaction: the contact jumps where "
                "much friction meets little stiffness; take a smaller amplitude or friction",
            )
        if not self.cycles or not float(self.friction) > 0.0:
            return ()
        mesh = () if self.points else doubts_of_mesh(float(self.dissipation_error))
        return *self._unsteady, *mesh

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
            last, before = self.dissipation, jnp.sum(self.slip_work[start + 1 : stop + 1])
            percent = 100.0 * abs(float(last / before) - 1.0) if before > 0.0 else 100.0
            said += f", and the dissipation changed by {percent:.3g} % since the cycle before"
        return (f"{said}; leave cycles out, or take more than {count}",)

    def figures(self) -> dict[str, Any]:
        """Figures of the last cycle and of the contact at the last step, as plain numbers.

        Returns
        -------
        dict
            numbers by name, None where undefined (such as 0/0), and the doubts
        """
        values = {name: float(getattr(self, name)) for name in FIGURES if self.cycles}
        values |= {
            "reaction_max": float(jnp.max(self.reaction[-1])),
            "opening_max": float(jnp.max(self.gap)),
            "contact_length": float(self.touching[-1] @ self.tributary),
        }
        found: dict[str, Any] = {k: v if np.isfinite(v) else None for k, v in values.items()}
        return found | {"assembly": self.assembly, "doubts": list(self.doubts)}

    def __str__(self) -> str:
        title = f"{self.force.size} levels on {self.x.size} contact nodes, {PRESSED[self.assembly]}"
        units = UNITS | {"opening_max": "length", "contact_length": "length"}
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

        return plotting.loop(self, axes)

    def plot_contact(self, steps: Any = None, axes: Any = None) -> Any:
        """Draw slip, gap, traction and reaction along X at chosen steps; returns the axes."""
        from jbeamshell import plotting

        return plotting.contact_lines(self, steps, axes)

    def animate(self, steps: Any = None, **options: Any) -> Any:
        """Film of the last cycle, to be saved as a GIF; see `jbeamshell.plotting.animate`."""
        from jbeamshell import plotting

        return plotting.animate(self, steps, **options)

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write ``loop.csv``, ``contact.csv``, ``result.json`` and pictures to a folder."""
        from jbeamshell.plotting.folder import check_folder, write_folder

        names = ("force", "displacement", "slip_work", "settled")
        loop = np.column_stack([np.asarray(getattr(self, name)) for name in names])
        along = ("slip", "gap", "traction", "reaction", "slipping")
        size = self.gap.shape
        step, x = np.indices(size)[0], np.broadcast_to(np.asarray(self.x), size)
        rows = [step, x, *(np.asarray(getattr(self, name)) for name in along)]
        contact = np.column_stack([row.ravel() for row in rows])
        texts = {
            "loop.csv": csv_text(names, loop.tolist()),
            "contact.csv": csv_text(("step", "x", *along), contact.tolist()),
            "result.json": as_json(self.figures()),
        }
        drawn = {"loop.png": self.plot(), "contact.png": self.plot_contact()}
        pictures = {name: np.ravel(axes)[0].figure for name, axes in drawn.items()}
        return write_folder(check_folder(folder), texts, pictures)


def _ends_apart(values: Array) -> Array:
    """Largest distance between the ends of lines (levels, lines) over the largest range."""
    width = jnp.max(jnp.ptp(values, axis=0))
    apart = jnp.max(jnp.abs(values[-1] - values[0]))
    return apart / jnp.where(width > 0.0, width, 1.0)
