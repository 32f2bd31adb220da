"""History of a load path: the record of every step, and what engineers read from it."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Self

import jax
import numpy as np
from jax import Array

from jbeamshell.common.errors import Status
from jbeamshell.common.frames import frame
from jbeamshell.common.numbers_of import quiet
from jbeamshell.common.summary import Summary, in_words, with_unit
from jbeamshell.history.contact_line import ContactLine
from jbeamshell.history.figures import CycleFigures, units_of
from jbeamshell.history.profiles import Profiles
from jbeamshell.history.reliability import doubts_of_run
from jbeamshell.history.saved import write_history
from jbeamshell.scene import mounting, planning, section_error

FIGURES = (
    "dissipation",
    "dissipation_loop",
    "dissipation_ratio",
    "secant_stiffness",
    "loss_factor",
    "peak_displacement",
    "slip_length",
    "reaction_min",
    "closure",
)
"""Figures of a cycle that `History.figures` reports."""


class History(Profiles, ContactLine, CycleFigures):
    """Result of a load path: pressing down without friction, then the loads.

    Its arrays are the attributes of `Record`.  Figures are properties: those of `Profiles` along X,
    of `ContactLine` at every step, of `CycleFigures` for the last cycle, and those below.  Units
    are those of the scene; forces, works and stiffnesses are per unit width, or totals where the
    scene has a ``strip.width``.  A run on the contact line has arrays of NumPy, and within a
    transformation those of JAX.

    Examples
    --------
    >>> history = jb.solve(jb.Scene())
    >>> float(history.dissipation)
    >>> history.slip[-1]  # along history.x
    """

    @property
    @quiet
    def energy_imbalance(self) -> Array:
        """External work less stored and dissipated energy since the first step, (steps+1,).

        The work includes that of changing pressures.  Works are trapezoids over the load steps.
        """
        force, sinking = (0.5 * (a[1:] + a[:-1]) for a in (self.force, self.sinking))
        numbers = self._numbers
        pulled, sank = (numbers.diff(a) for a in (self.displacement, self.pressure))
        work = numbers.append(0.0, numbers.cumsum(force * pulled + sinking * sank))
        return work - (self.stored_energy - self.stored_energy[0] + numbers.cumsum(self.slip_work))

    @property
    def converged(self) -> bool:
        """True if every step found its equilibrium."""
        return bool(np.all(np.asarray(self.status) == Status.CONVERGED))

    @functools.cached_property
    def plain(self) -> Self:
        """The same in arrays of NumPy, which are quicker where nothing is compiled."""
        plain: Self = jax.tree.map(np.asarray, self.but(above=None))
        return plain

    @functools.cached_property
    def doubts(self) -> tuple[str, ...]:
        """Reasons to doubt this run, each a sentence with the size of the error and the remedy."""
        return doubts_of_run(self.plain)

    @quiet
    def figures(self) -> dict[str, Any]:
        """Figures of the last cycle and of the contact at the last step, as plain numbers.

        Returns
        -------
        dict
            numbers by name, None where undefined (such as 0/0); the sum of Newton iterations, the
            worst status, the mounting of a lap joint in words, and the doubts.
        """
        worst = Status(int(np.max(np.asarray(self.status))))
        turned = self.scene.load.kind == "moment"  # which no bar can be
        of_cycle = [name for name in FIGURES if not (turned and name == "dissipation_ratio")]
        names = (*(of_cycle if self.cycles else ()), *self._contact_figures)
        one = self.scene.in_one_form()
        one = one.but(strip=one.strip.but(width=self.scene.strip.width))
        read = self.but(above=self.above.found, scene=one)
        plain = jax.tree.map(np.asarray, read)
        values = {name: float(np.ravel(getattr(plain, name))[-1]) for name in names}
        figures: dict[str, Any] = {k: v if np.isfinite(v) else None for k, v in values.items()}
        figures["newton_iterations"] = int(np.sum(np.asarray(self.iterations)))
        figures["status"] = worst.name.lower()
        if mounted := mounting.in_words(self.scene):
            figures["mounting"] = mounted
        figures["doubts"] = list(self.doubts)
        return figures

    @property
    def _contact_figures(self) -> tuple[str, ...]:
        """Names of the figures of the contact that this scene has."""
        fields, founded = self.scene.plan.fields, self.scene.contact.normal != "none"
        names: tuple[str, ...] = () if founded else ("tip_deflection", "curvature")
        if "w" in fields and founded:
            names += ("contact_end", "tip_deflection", "lift_slope")
        if founded:
            names += ("reaction_max", "reaction_max_at")
        return (*names, "squeeze_stress_max") if "psi" in fields else names

    def summary(self, named: Mapping[str, str] = MappingProxyType({})) -> Summary:
        """Figures in lines.

        Parameters
        ----------
        named : names of the scene's units by words such as "length" or "force length", with which
            numbers get prefixes; without them numbers and these words are printed
        """
        strip, control = self.scene.strip, self.scene.load.control
        driver = np.asarray(self.force if control == "force" else self.displacement)
        if self.scene.load.kind == "moment":
            control = "moment" if control == "force" else "rotation"
        what = f"{control} amplitude {float(np.max(np.abs(driver))):.4g}"
        pulled = bool(self.cycles or np.any(driver))
        if not pulled:
            what = f"pressed by {float(np.sum(self.load)):.4g}"
        if strip.width is not None:
            what += f", width {float(strip.width):.4g} in plane {strip.plane}"
        title = (
            f"{self.force.size} levels, eta = {float(strip.height_ratio):.4g}, {what}: "
            f"{self.scene.plan}"
        )
        chosen = planning.in_words(self.scene)
        if self.change is not None and np.isfinite(self.change):  # something slips
            percent = 100.0 * float(self.change)
            chosen += f"; halving the elements changed the loop by {percent:.2g} %"
        figures = self.figures()
        entered = section_error.in_words(self.scene, figures.get("slip_length")) if pulled else ""
        mounted = figures.pop("mounting", "")
        doubts = [f"doubtful: {doubt}" for doubt in figures.pop("doubts")]
        units = units_of(self.scene)
        rows = [
            (name.replace("_", " "), _with_unit(value, units.get(name, ""), named))
            for name, value in figures.items()
        ]
        return Summary("\n".join(filter(None, (title, chosen, entered, mounted))), rows, doubts)

    def __str__(self) -> str:
        return self.summary().as_text()

    def _repr_html_(self) -> str:
        from jbeamshell import plotting

        return self.summary().as_html(plotting.thumbnail(self.plot()))

    def table(self) -> dict[str, np.ndarray]:
        """Columns (steps+1,) of the load path by name.

        They are the step, force, displacement, part of the pressure, accumulated work of friction,
        end of the contact (with unilateral contact only), Newton iterations and error.
        """
        scene = self.scene
        columns: dict[str, Any] = {
            "step": np.arange(self.force.size),
            "force": self.force,
            "displacement": self.displacement,
            "pressure": self.pressure,
            "friction_work": np.cumsum(self.slip_work),
        }
        if scene.plan.lifts and scene.contact.normal != "none":
            columns["contact_end"] = self.contact_end
        columns |= {"newton_iterations": self.iterations, "error": self.error}
        return {name: np.asarray(column) for name, column in columns.items()}

    def to_dataframe(self) -> Any:
        """Load path as a `pandas.DataFrame`, a row for every step; see `table`.

        Examples
        --------
        >>> history.to_dataframe().plot("displacement", "force")
        """
        return frame(self.table())

    def save(self, path: Any) -> None:
        """Write to an .npz file that `jbeamshell.read_history` reads.

        Raises
        ------
        InputError
            for another suffix, and for a scene with an energy or a law of the user's own
        """
        write_history(self, path)

    def plot(self, axes: Any = None) -> Any:
        """Draw force over displacement; returns the axes."""
        from jbeamshell import plotting

        return plotting.loop(self, axes, moment=self.scene.load.kind == "moment")

    def plot_profiles(self, steps: Any = None, axes: Any = None) -> Any:
        """Draw slip, rotation, traction and reaction along X at chosen steps; returns the axes."""
        from jbeamshell import plotting

        return plotting.profiles(self, steps, axes)

    def plot_contact(
        self, steps: Any = None, axes: Any = None, reference: Any = None, **options: Any
    ) -> Any:
        """Draw reaction, gap, squeeze and rotation along X; see `jbeamshell.plotting.contact`."""
        from jbeamshell import plotting

        return plotting.contact(self, steps, axes, reference, **options)

    def plot_contact_map(self, axes: Any = None, **options: Any) -> Any:
        """Draw stick, slip and lift-off over X and step; see `jbeamshell.plotting.contact_map`."""
        from jbeamshell import plotting

        return plotting.contact_map(self, axes, **options)

    def plot_deformed(self, step: int | None = None, axes: Any = None, **options: Any) -> Any:
        """Draw the deformed members at a step; see `jbeamshell.plotting.deformed`."""
        from jbeamshell import plotting

        return plotting.deformed(self, step, axes, **options)

    def plot_joint(self, step: int | None = None, axes: Any = None) -> Any:
        """Draw a lap joint, its loop, slip and pressure; see `jbeamshell.plotting.lap_joint`."""
        from jbeamshell import plotting

        return plotting.lap_joint(self, step, axes)

    def animate(self, steps: Any = None, **options: Any) -> Any:
        """Film of the last cycle, to be saved as a GIF; see `jbeamshell.plotting.animate`."""
        from jbeamshell import plotting

        return plotting.animate(self, steps, **options)


def _with_unit(value: Any, unit: str, named: Mapping[str, str]) -> str:
    """Figure with its unit, by its name where there is one."""
    if unit in named and isinstance(value, float):
        return with_unit(value, named[unit], 6)
    return in_words(value) + (f"  [{unit}]" if unit else "")
