"""Figures of the last load cycle: dissipation, stiffness, loss factor, slip length."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from jax import Array

from jbeamshell.common.numbers_of import quiet
from jbeamshell.history.error_estimates import CLOSES, SlipCycle, estimates
from jbeamshell.history.loop_figures import LoopFigures
from jbeamshell.history.record import Record
from jbeamshell.mechanics.bar import cubic_law, lap_cubic_law
from jbeamshell.scene.scene import Scene

UNITS = {  # of the figures that are no pure numbers, in words; forces are per unit of width
    **dict.fromkeys(("dissipation", "dissipation_loop"), "force"),
    **dict.fromkeys(("peak_displacement", "slip_length", "tip_deflection"), "length"),
    **dict.fromkeys(("contact_end", "reaction_max_at"), "length"),
    **dict.fromkeys(("secant_stiffness", "reaction_max", "reaction_min"), "stress"),
    "squeeze_stress_max": "stress",
    "curvature": "1/length",
}
TURNED_UNITS = {"peak_displacement": "rad", "secant_stiffness": "force"}  # under a moment
TOTAL_UNITS = {  # of a joint with a width
    **dict.fromkeys(("dissipation", "dissipation_loop"), "force length"),
    "secant_stiffness": "force/length",
}


def units_of(scene: Scene) -> dict[str, str]:
    """Units of the figures of a scene by name, without those of pure numbers."""
    turned, whole = scene.load.kind == "moment", scene.strip.width is not None
    units = UNITS | (TURNED_UNITS if turned else {}) | (TOTAL_UNITS if whole else {})
    return units | {"secant_stiffness": "force length"} if turned and whole else units


class CycleFigures(Record, LoopFigures):
    """Figures of the last cycle; scalars but for `slip_cycle`.

    Raises
    ------
    InputError
        if the path holds no closed cycle
    """

    @property
    @quiet
    def dissipation_ratio(self) -> Array:
        """Dissipation over that of the one-dimensional bar, (2/3) A^3/(E'2H q) (Goodman 1959).

        That of a lap joint is over two bars', see `jbeamshell.mechanics.bar.lap_cubic_law`.  NaN
        under a moment, which no bar takes.
        """
        scene, force = self.scene, self.loop[0]
        if scene.load.kind == "moment":
            return self._numbers.full_like(self.dissipation, self._numbers.nan)
        wide, friction = scene.wide, self.friction_per_length
        stiffness = wide * scene.strip.stretching_stiffness
        amplitude = 0.5 * (self._numbers.max(force) - self._numbers.min(force))
        if scene.member.support == "none":
            return self.dissipation / cubic_law(amplitude, stiffness, friction)
        lower = wide * scene.member.beside(scene.strip).stretching_stiffness
        return self.dissipation / lap_cubic_law(amplitude, stiffness, lower, friction)

    @property
    @quiet
    def friction_per_length(self) -> Array:
        """Mean q of mu F_N where the strip is pressed, force per length."""
        # Weighted by the pressure itself, so that unloaded parts do not count.
        mean = self._numbers.sum(self.load**2 / self.tributary) / self._numbers.sum(self.load)
        return self.scene.contact.friction * mean

    @property
    @quiet
    def closure(self) -> Array:
        """Distance from the start to the end of the last loop over its width; 0 when steady."""
        force, displacement = self.loop
        answer = displacement if self.scene.load.control == "force" else force
        return (answer[-1] - answer[0]) / (answer.max() - answer.min())

    @property
    def slip_length(self) -> Array:
        """Largest length of contact that slipped in one step of the last cycle."""
        start, _, stop = self._last
        return self._numbers.max(self.slipping[start + 1 : stop + 1] @ self.tributary)

    @property
    def slip_cycle(self) -> SlipCycle:
        """Slip, traction and reaction of the contact in the last cycle.

        Those of a strip on its contact line are the turning points, of which every call knows.
        Members of a joint lift so far that turning points alone would doubt it in vain.
        """
        start, turn, stop = self._last
        line = self.scene.plan.on_contact_line
        turns = line and self.scene.member.support == "none"
        cycle: Any = np.array([start, turn, stop]) if turns else slice(start, stop + 1)
        work = self.slip_work[start + 1 : stop + 1].sum()  # of NumPy or of JAX
        return SlipCycle(
            x=self.x,
            tributary=self.tributary,
            v=self.contact_v[cycle],
            traction=self.traction[cycle],
            reaction=self.reaction[cycle],
            friction=self.scene.contact.friction,
            slip_stiffness=self.scene.slip_stiffness(self.tributary),
            half_height=self.scene.strip.half_height,
            dissipation=work / self.scene.wide if line else None,
        )

    @functools.cached_property
    def errors(self) -> tuple[Array, ...]:
        """Estimated relative errors of the dissipation, see `estimates`; they are found once."""
        with np.errstate(over="ignore", invalid="ignore"):  # infinite where nothing slips
            return estimates(self.scene, self.slip_cycle, self.change)

    @property
    def dissipation_error(self) -> Array:
        """Estimated relative error of the dissipation that the grid at the loaded end makes.

        Rather too large than too small; infinite if nothing slips.  Of a refined grid it is at
        least the change by the last halving of the elements.  A loop that does not close is off by
        what it leaves open, at least.  See `History.doubts`.
        """
        numbers, apart = self._numbers, self._numbers.abs(self.closure)
        unclosed = numbers.where(apart > CLOSES, apart, 0.0)
        return numbers.max(numbers.stack([*self.errors, unclosed]))
