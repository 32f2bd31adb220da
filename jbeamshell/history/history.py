"""History: what a load path did to the strip, and the figures engineers read off it."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError, Status
from jbeamshell.history import reliability
from jbeamshell.history.saved import write_history
from jbeamshell.mechanics import bar
from jbeamshell.mechanics.kinematics import Strains
from jbeamshell.numerics.cycles import branch_work
from jbeamshell.scene.scene import Scene


class History(eqx.Module):
    """Result of a load path: the pressing down without friction, then the loads.

    With ``load.pressure_steps`` = 1, step 0 is the strip after the pressure, before any load.

    Steps that did not converge, and those after them, hold NaN.

    Attributes
    ----------
    scene : the scene that was solved
    x : (n,) node positions X, from the far end to the loaded end
    middles : (elements,) middle of every element, where the section forces are
    tributary : (n,) contact length of each node
    load : (n,) nodal forces of the whole pressure on the top face
    force : (steps+1,) end force F per unit width
    displacement : (steps+1,) mid-height displacement u(L) since the pressure, conjugate to F
    fields : (steps+1, n, m) v, w, beta, psi, and those of a hierarchic section
    gap : (steps+1, n) height of the strip's bottom face over the foundation
    sections : (steps+1, elements) section forces N, Q, M, chi and xi in the places of e, g, k, psi
        and psi'
    traction : (steps+1, n) friction traction on the foundation (positive on a pull)
    reaction : (steps+1, n) normal reaction R, positive in compression
    slipping : (steps+1, n) whether the node slipped in the step
    slip_work : (steps+1,) work dissipated by friction in each step, per unit width
    stored_energy : (steps+1,) strain energy, pressure potential and elastic energy of the contact
    pressure : (steps+1,) part of the pressures that acts
    sinking : (steps+1,) its conjugate: the pressures' forces times their displacement
    iterations : (steps+1,) Newton iterations
    error : (steps+1,) largest out-of-balance force over mu F_N L
    status : (steps+1,) codes of `Status`
    cycles : for each closed cycle the steps at its start, its turn and its end
    target : (steps+1,) the controlled load that was prescribed
    end : where the path ended, for `continued`; None unless it was solved step by step
    """

    scene: Scene
    x: Array
    middles: Array
    tributary: Array
    load: Array
    force: Array
    displacement: Array
    fields: Array
    gap: Array
    sections: Strains
    traction: Array
    reaction: Array
    slipping: Array
    slip_work: Array
    stored_energy: Array
    pressure: Array
    sinking: Array
    iterations: Array
    error: Array
    status: Array
    cycles: tuple[tuple[int, int, int], ...] = eqx.field(static=True)
    target: Array | None = None
    end: Any = None

    @property
    def pressed(self) -> int:
        """The step at which the whole pressure acts, before any load."""
        return self.scene.load.pressure_steps - 1

    # --- profiles -------------------------------------------------------------------------------

    @property
    def v(self) -> Array:
        """Tangential displacement of the contact, (steps+1, n)."""
        return self.fields[..., 0]

    @property
    def w(self) -> Array:
        """Lift of the contact, (steps+1, n)."""
        return self.fields[..., 1]

    @property
    def beta(self) -> Array:
        """Rotation of the sections, rad, (steps+1, n)."""
        return self.fields[..., 2]

    @property
    def psi(self) -> Array:
        """Squeeze strain, (steps+1, n)."""
        return self.fields[..., 3]

    @property
    def slip(self) -> Array:
        """Tangential displacement of the contact since the pressure, (steps+1, n)."""
        return self.v - self.v[self.pressed]

    @property
    def squeeze_stress(self) -> Array:
        """Mean of sigma_y over the height, chi/(2H), compression negative, (steps+1, elements)."""
        return self.sections.psi / (2.0 * self.scene.strip.half_height)

    @property
    def squeeze_couple(self) -> Array:
        """Moment xi of the shear stress about mid-height, (steps+1, elements)."""
        return self.sections.dpsi

    # --- contact at every step --------------------------------------------------------------------

    @property
    def touching(self) -> Array:
        """Whether the node is in contact, (steps+1, n)."""
        if self.scene.contact.normal == "none":
            return jnp.zeros(self.gap.shape, bool)
        if self.scene.contact.normal == "compliant":
            return self.gap <= 0.0
        strip = self.scene.strip  # the same weight as in the search for the contact
        return self.reaction > self.gap * strip.plane_modulus / strip.half_height

    @property
    def contact_end(self) -> Array:
        """X at which the contact ends, (steps+1,).

        The nodal force of the last node that touches fills a part of its share of the contact, with
        the reaction continued from the nodes before: the shell's reaction ends in a jump.
        """
        return _contact_ends(self.x, self.tributary, self.touching, self.reaction)

    @property
    def curvature(self) -> Array:
        """K = beta' at X = 0, 1/length, (steps+1,)."""
        return (self.beta[:, 1] - self.beta[:, 0]) / (self.x[1] - self.x[0])

    @property
    def tip_deflection(self) -> Array:
        """Height of the bottom face at X = L over that at X = 0, (steps+1,)."""
        return self.gap[:, -1] - self.gap[:, 0]

    @property
    def lift_slope(self) -> Array:
        """Angle of the end section at X = L to the foundation's normal, rad, (steps+1,)."""
        strip = self.scene.strip
        before = 0.0 if strip.curvature is None else strip.curvature * strip.length
        return before + self.beta[:, -1]

    @property
    def reaction_max(self) -> Array:
        """Largest normal reaction, (steps+1,)."""
        return jnp.max(self.reaction, axis=1)

    @property
    def reaction_max_at(self) -> Array:
        """X of the largest normal reaction, (steps+1,)."""
        return self.x[jnp.argmax(self.reaction, axis=1)]

    @property
    def squeeze_stress_max(self) -> Array:
        """Largest compression chi/(2H) of any section, positive, (steps+1,)."""
        return jnp.max(-self.squeeze_stress, axis=1)

    # --- figures of the last cycle --------------------------------------------------------------

    @property
    def _last(self) -> tuple[int, int, int]:
        if not self.cycles:
            raise InputError(
                "path: holds no closed cycle, so there is no dissipation per cycle; "
                "let it return to a load it turned at, or sum slip_work"
            )
        return self.cycles[-1]

    @property
    def loop(self) -> tuple[Array, Array]:
        """Force and displacement along the last cycle."""
        start, _, stop = self._last
        return self.force[start : stop + 1], self.displacement[start : stop + 1]

    @property
    def dissipation(self) -> Array:
        """Work of friction in the last cycle, per unit width."""
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
        """Dissipation over that of the one-dimensional bar, (2/3) A^3/(E'2H q)."""
        stiffness, force = self.scene.strip.stretching_stiffness, self.loop[0]
        amplitude = 0.5 * (jnp.max(force) - jnp.min(force))
        return self.dissipation / bar.cubic_law(amplitude, stiffness, self.friction_per_length)

    @property
    def friction_per_length(self) -> Array:
        """q: mean of mu F_N where the strip is pressed, force per length and width."""
        # Weighted by the pressure itself, so that what is not pressed does not count.
        mean = jnp.sum(self.load**2 / self.tributary) / jnp.sum(self.load)
        return self.scene.contact.friction * mean

    @property
    def secant_stiffness(self) -> Array:
        """Range of force over range of displacement of the last loop."""
        force, displacement = self.loop
        return jnp.ptp(force) / jnp.ptp(displacement)

    @property
    def loss_factor(self) -> Array:
        """D/(2 pi W_max), with W_max the energy of the secant stiffness at the amplitude."""
        force, displacement = self.loop
        return self.dissipation / (2.0 * jnp.pi * jnp.ptp(force) * jnp.ptp(displacement) / 8.0)

    @property
    def peak_displacement(self) -> Array:
        """Largest displacement of the last loop, either way."""
        return jnp.max(jnp.abs(self.loop[1]))

    @property
    def closure(self) -> Array:
        """How far the last loop ends from where it starts, over its width; zero when steady."""
        force, displacement = self.loop
        answer = displacement if self.scene.load.control == "force" else force
        return (answer[-1] - answer[0]) / jnp.ptp(answer)

    @property
    def slip_length(self) -> Array:
        """Largest length of contact that slipped in one step of the last cycle."""
        start, _, stop = self._last
        return jnp.max(self.slipping[start + 1 : stop + 1] @ self.tributary)

    @property
    def dissipation_error(self) -> Array:
        """Estimate of the dissipation's relative error by the grid at the loaded end.

        Rather too large than too small; infinite where nothing slips.  See `doubts`.
        """
        return jnp.maximum(*reliability.dissipation_errors(self.rubbing))

    @property
    def rubbing(self) -> reliability.SlipCycle:
        """The last cycle at the contact."""
        start, _, stop = self._last
        cycle = slice(start, stop + 1)
        strip, contact = self.scene.strip, self.scene.contact
        return reliability.SlipCycle(
            x=self.x,
            tributary=self.tributary,
            v=self.v[cycle],
            traction=self.traction[cycle],
            reaction=self.reaction[cycle],
            friction=contact.friction,
            slip_stiffness=self.scene.slip_stiffness,
            half_height=strip.half_height,
        )

    @property
    def reaction_min(self) -> Array:
        """Smallest normal reaction after the pressure; negative is tension (w frozen)."""
        return jnp.min(self.reaction)

    @property
    def energy_imbalance(self) -> Array:
        """External work less stored and dissipated energy since the first step, (steps+1,).

        The work includes that of a change of the pressures.
        """
        force, sinking = (0.5 * (a[1:] + a[:-1]) for a in (self.force, self.sinking))
        work = jnp.cumsum(force * jnp.diff(self.displacement) + sinking * jnp.diff(self.pressure))
        kept = self.stored_energy - self.stored_energy[0] + jnp.cumsum(self.slip_work)
        return jnp.append(0.0, work) - kept

    # --- reports --------------------------------------------------------------------------------

    @property
    def converged(self) -> bool:
        """Whether every step found its equilibrium."""
        return bool(np.all(np.asarray(self.status) == Status.CONVERGED))

    @property
    def doubts(self) -> tuple[str, ...]:
        """What is doubtful about this run, by how much, and what to change; a sentence each."""
        return reliability.doubts_of(self)

    def figures(self) -> dict[str, Any]:
        """The figures of the last cycle and of the contact at the last step, as plain numbers.

        None is what means nothing here, such as nought over nought.
        """
        worst = Status(int(np.max(np.asarray(self.status))))
        names = (*(FIGURES if self.cycles else ()), *self._contact_figures)
        values = {name: float(value) for name, value in _last_values(self, names).items()}
        figures: dict[str, Any] = {k: v if np.isfinite(v) else None for k, v in values.items()}
        figures["newton_iterations"] = int(np.sum(np.asarray(self.iterations)))
        figures["status"] = worst.name.lower()
        figures["doubts"] = list(self.doubts)
        return figures

    @property
    def _contact_figures(self) -> tuple[str, ...]:
        """Names of the figures that mean something in this scene."""
        fields, founded = self.scene.model.fields, self.scene.contact.normal != "none"
        names: tuple[str, ...] = () if founded else ("tip_deflection", "curvature")
        if "w" in fields and founded:
            names += ("contact_end", "tip_deflection", "lift_slope")
        if founded:
            names += ("reaction_max", "reaction_max_at")
        return (*names, "squeeze_stress_max") if "psi" in fields else names

    def __str__(self) -> str:
        strip, load = self.scene.strip, self.scene.load
        what = f"{load.control} amplitude {float(jnp.max(jnp.abs(self._driver))):.4g}"
        if not self.cycles and not jnp.any(self._driver):
            what = f"pressed by {float(jnp.sum(self.load)):.4g}"
        lines = [
            f"{self.force.size} levels of {' '.join(self.scene.model.fields)} on "
            f"{self.x.size} nodes, eta = {float(strip.height_ratio):.4g}, {what}"
        ]
        lines += [
            f"  {name.replace('_', ' '):20s} {value:.6g}"
            if isinstance(value, float)
            else f"  {name.replace('_', ' '):20s} {'undefined' if value is None else value}"
            for name, value in self.figures().items()
            if name != "doubts"
        ]
        return "\n".join(lines + [f"  doubtful: {doubt}" for doubt in self.doubts])

    @property
    def _driver(self) -> Array:
        return self.force if self.scene.load.control == "force" else self.displacement

    # --- further -------------------------------------------------------------------------------

    def continued(self, path: Any = None, **options: Any) -> History:
        """History with further load steps.

        Parameters
        ----------
        path, options : see `jbeamshell.quasistatic.continuation.PathEnd.continued`

        Raises
        ------
        InputError
            if it was not solved step by step, or cannot go on
        """
        solution = self.scene.model.solution
        fix = "keeps no state of the contact to go on from: take 'stepwise'"
        require("model.solution", solution, solution == "stepwise", fix)
        if self.end is None:
            raise InputError("history: was made by hand and has no end to go on from: solve it")
        further: History = self.end.continued(self, path, **options)
        return further

    def save(self, path: Any) -> None:
        """Write it to an .npz file, for `jbeamshell.read_history`."""
        write_history(self, path)

    def plot(self, axes: Any = None) -> Any:
        """Draw the loop; returns the axes."""
        from jbeamshell import plotting

        return plotting.loop(self, axes)

    def plot_profiles(self, steps: Any = None, axes: Any = None) -> Any:
        """Draw slip, rotation, traction and reaction along X at chosen steps; returns the axes."""
        from jbeamshell import plotting

        return plotting.profiles(self, steps, axes)

    def plot_contact(
        self, steps: Any = None, axes: Any = None, reference: Any = None, **options: Any
    ) -> Any:
        """Draw reaction, gap, squeeze and rotation along X; see `plotting.contact`."""
        from jbeamshell import plotting

        return plotting.contact(self, steps, axes, reference, **options)

    def plot_contact_map(self, axes: Any = None, **options: Any) -> Any:
        """Draw what sticks, slips and is lifted along the path; see `plotting.contact_map`."""
        from jbeamshell import plotting

        return plotting.contact_map(self, axes, **options)


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


@eqx.filter_jit
def _last_values(history: History, names: tuple[str, ...]) -> dict[str, Array]:
    """Figures of the last cycle or, where there is one for every step, of the last step."""
    return {name: jnp.ravel(getattr(history, name))[-1] for name in names}


@jax.jit
def _contact_ends(x: Array, tributary: Array, touching: Array, reaction: Array) -> Array:
    last = x.size - 1
    share_begins = jnp.cumsum(tributary) - tributary

    def end(touching: Array, reaction: Array) -> Array:
        j = last - jnp.argmax(touching[::-1])
        before = jnp.maximum(j - 1, 1)
        slope = (reaction[before] - reaction[before - 1]) / (x[before] - x[before - 1])
        force, begin = reaction[j] * tributary[j], share_begins[j]
        width = tributary[j]
        for _ in range(3):
            level = reaction[before] + slope * (begin + 0.5 * width - x[before])
            width = jnp.where(level > 0.0, force / jnp.where(level > 0.0, level, 1.0), width)
            width = jnp.clip(width, 0.0, tributary[j])  # beyond its share the next node would touch
        found = jnp.where(j == last, x[last], begin + width)
        return jnp.where(jnp.any(touching), found, 0.0)

    return jax.vmap(end)(touching, reaction)
