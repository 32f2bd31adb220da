"""Figures of the last load cycle: dissipation, stiffness, loss factor, slip length."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from jbeamshell.common.errors import InputError
from jbeamshell.history.record import Record
from jbeamshell.history.reliability import SlipCycle, estimates
from jbeamshell.mechanics.bar import cubic_law, lap_cubic_law
from jbeamshell.numerics.cycles import branch_work

UNITS = {  # of the figures that are no pure numbers, in words
    **dict.fromkeys(("dissipation", "dissipation_loop"), "force"),
    **dict.fromkeys(("peak_displacement", "slip_length", "tip_deflection"), "length"),
    **dict.fromkeys(("contact_end", "reaction_max_at"), "length"),
    **dict.fromkeys(("secant_stiffness", "reaction_max", "reaction_min"), "stress"),
    "squeeze_stress_max": "stress",
    "curvature": "1/length",
}


class CycleFigures(Record):
    """Figures of the last cycle; scalars but for `loop` and `slip_cycle`.

    Raises
    ------
    InputError
        if the path holds no closed cycle
    """

    @property
    def _last(self) -> tuple[int, int, int]:
        """Steps at the start, the turn and the end of the last cycle."""
        if not self.cycles:
            raise InputError(
                "path: holds no closed cycle, so there is no dissipation per cycle; "
                "let it return to a load at which it turned, or sum slip_work"
            )
        return self.cycles[-1]

    @property
    def loop(self) -> tuple[Array, Array]:
        """Force and displacement along the last cycle, (levels,) each."""
        start, _, stop = self._last
        return self.force[start : stop + 1], self.displacement[start : stop + 1]

    @property
    def dissipation(self) -> Array:
        """Work of friction in the last cycle, D, per unit width."""
        start, _, stop = self._last
        return jnp.sum(self.slip_work[start + 1 : stop + 1])

    @property
    def dissipation_loop(self) -> Array:
        """Area of the last loop, with each branch integrated by parabolas."""
        start, turn, stop = self._last
        down, up = slice(start, turn + 1), slice(turn, stop + 1)
        there, back = (branch_work(self.force[b], self.displacement[b]) for b in (down, up))
        return there + back

    @property
    def dissipation_ratio(self) -> Array:
        """Dissipation over that of the one-dimensional bar, (2/3) A^3/(E'2H q) (Goodman 1959).

        That of a lap joint is over two bars', see `jbeamshell.mechanics.bar.lap_cubic_law`.
        """
        scene, force = self.scene, self.loop[0]
        stiffness, friction = scene.strip.stretching_stiffness, self.friction_per_length
        amplitude = 0.5 * (jnp.max(force) - jnp.min(force))
        if scene.member.support == "none":
            return self.dissipation / cubic_law(amplitude, stiffness, friction)
        lower = scene.member.beside(scene.strip).stretching_stiffness
        return self.dissipation / lap_cubic_law(amplitude, stiffness, lower, friction)

    @property
    def friction_per_length(self) -> Array:
        """Mean q of mu F_N where the strip is pressed, force per length and width."""
        # Weighted by the pressure itself, so that unloaded parts do not count.
        mean = jnp.sum(self.load**2 / self.tributary) / jnp.sum(self.load)
        return self.scene.contact.friction * mean

    @property
    def secant_stiffness(self) -> Array:
        """Range of force over range of displacement of the last loop."""
        force, displacement = self.loop
        return jnp.ptp(force) / jnp.ptp(displacement)

    @property
    def loss_factor(self) -> Array:
        """Loss factor D/(2 pi W), with W the energy of the secant stiffness at the amplitude."""
        force, displacement = self.loop
        return self.dissipation / (2.0 * jnp.pi * jnp.ptp(force) * jnp.ptp(displacement) / 8.0)

    @property
    def peak_displacement(self) -> Array:
        """Largest abs(u(L)) of the last loop, length."""
        return jnp.max(jnp.abs(self.loop[1]))

    @property
    def closure(self) -> Array:
        """Distance from the start to the end of the last loop over its width; 0 when steady."""
        force, displacement = self.loop
        answer = displacement if self.scene.load.control == "force" else force
        return (answer[-1] - answer[0]) / (answer.max() - answer.min())

    @property
    def slip_length(self) -> Array:
        """Largest length of contact that slipped in one step of the last cycle."""
        start, _, stop = self._last
        return jnp.max(self.slipping[start + 1 : stop + 1] @ self.tributary)

    @property
    def slip_cycle(self) -> SlipCycle:
        """Slip, traction and reaction of the contact in the last cycle."""
        start, _, stop = self._last
        cycle = slice(start, stop + 1)
        return SlipCycle(
            x=self.x,
            tributary=self.tributary,
            v=self.contact_v[cycle],
            traction=self.traction[cycle],
            reaction=self.reaction[cycle],
            friction=self.scene.contact.friction,
            slip_stiffness=self.scene.slip_stiffness,
            half_height=self.scene.strip.half_height,
        )

    @property
    def dissipation_error(self) -> Array:
        """Estimated relative error of the dissipation that the grid at the loaded end makes.

        Rather too large than too small; infinite if nothing slips.  See `History.doubts`.
        """
        errors = estimates(self.scene, self.slip_cycle)
        return jnp.max(jnp.stack(errors))
