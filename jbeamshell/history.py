"""History: what a load path did to the strip, and the figures engineers read off it."""

from __future__ import annotations

import enum
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell import closed_form
from jbeamshell.errors import InputError
from jbeamshell.scene import Scene


class Status(enum.IntEnum):
    """How a load step ended."""

    CONVERGED = 0
    MAX_ITERATIONS = 1
    NOT_FINITE = 2
    NOT_REACHED = 3


class History(eqx.Module):
    """Result of a load path; step 0 is the strip after the pressure, before any load.

    Steps that did not converge, and those after them, hold NaN.

    Attributes
    ----------
    scene : the scene that was solved
    x : (n,) node positions X, from the far end to the loaded end
    tributary : (n,) contact length of each node
    force : (steps+1,) end force F per unit width
    displacement : (steps+1,) mid-height displacement u(L) since the pressure, conjugate to F
    fields : (steps+1, n, 4) v, w, beta, psi
    traction : (steps+1, n) friction traction on the foundation (positive on a pull)
    reaction : (steps+1, n) normal reaction R, positive in compression
    slipping : (steps+1, n) whether the node slipped in the step
    slip_work : (steps+1,) work dissipated by friction in each step, per unit width
    stored_energy : (steps+1,) strain energy, pressure potential and elastic slip energy
    iterations : (steps+1,) Newton iterations
    error : (steps+1,) largest out-of-balance force over mu F_N L
    status : (steps+1,) codes of `Status`
    cycles : for each closed cycle the steps at its start, its turn and its end
    """

    scene: Scene
    x: Array
    tributary: Array
    force: Array
    displacement: Array
    fields: Array
    traction: Array
    reaction: Array
    slipping: Array
    slip_work: Array
    stored_energy: Array
    iterations: Array
    error: Array
    status: Array
    cycles: tuple[tuple[int, int, int], ...] = eqx.field(static=True)

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
        return self.v - self.v[0]

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
        strip, force = self.scene.strip, self.loop[0]
        amplitude = 0.5 * (jnp.max(force) - jnp.min(force))
        return self.dissipation / closed_form.cubic_law(
            amplitude, strip.axial_stiffness, self.friction_per_length
        )

    @property
    def friction_per_length(self) -> Array:
        """q: mean of mu F_N along the strip, force per length and width."""
        pressure = self.scene.contact.pressure_at(self.x)
        mean = jnp.sum(self.tributary * pressure) / jnp.sum(self.tributary)
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
    def reaction_min(self) -> Array:
        """Smallest normal reaction after the pressure; negative is tension (w frozen)."""
        return jnp.min(self.reaction)

    @property
    def energy_imbalance(self) -> Array:
        """External work less stored and dissipated energy since the start, (steps+1,)."""
        mean = 0.5 * (self.force[1:] + self.force[:-1])
        work = jnp.cumsum(mean * jnp.diff(self.displacement))
        kept = self.stored_energy - self.stored_energy[0] + jnp.cumsum(self.slip_work)
        return jnp.append(jnp.zeros_like(work[:1]), work) - kept

    # --- reports --------------------------------------------------------------------------------

    @property
    def converged(self) -> bool:
        """Whether every step found its equilibrium."""
        return bool(np.all(np.asarray(self.status) == Status.CONVERGED))

    def figures(self) -> dict[str, Any]:
        """The figures of the last cycle by name, as plain numbers."""
        worst = Status(int(np.max(np.asarray(self.status))))
        figures: dict[str, Any] = {name: float(getattr(self, name)) for name in FIGURES}
        figures["newton_iterations"] = int(np.sum(np.asarray(self.iterations)))
        figures["status"] = worst.name.lower()
        return figures

    def __str__(self) -> str:
        strip, load = self.scene.strip, self.scene.load
        lines = [
            f"{len(self.status) - 1} steps of {' '.join(self.scene.model.fields)} on "
            f"{self.x.size} nodes, eta = {float(strip.height_ratio):.4g}, "
            f"{load.control} amplitude {float(jnp.max(jnp.abs(self._driver))):.4g}"
        ]
        lines += [
            f"  {name.replace('_', ' '):20s} {value:.6g}"
            if isinstance(value, float)
            else f"  {name.replace('_', ' '):20s} {value}"
            for name, value in self.figures().items()
        ]
        return "\n".join(lines)

    @property
    def _driver(self) -> Array:
        return self.force if self.scene.load.control == "force" else self.displacement

    def plot(self, axes: Any = None) -> Any:
        """Draw the loop; returns the axes."""
        from jbeamshell import plotting

        return plotting.loop(self, axes)

    def plot_profiles(self, steps: Any = None, axes: Any = None) -> Any:
        """Draw slip, rotation, traction and reaction along X at chosen steps; returns the axes."""
        from jbeamshell import plotting

        return plotting.profiles(self, steps, axes)


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


def branch_work(force: Array, displacement: Array) -> Array:
    """Integral of F du along a smooth branch, exact where both are parabolas of the step number.

    Parameters
    ----------
    force, displacement : (steps+1,) along the branch; an odd last step is taken as straight
    """
    even = 2 * ((force.shape[0] - 1) // 2)
    f, u = force[: even + 1], displacement[: even + 1]
    f0, f1, f2, u0, u1, u2 = f[:-2:2], f[1::2], f[2::2], u[:-2:2], u[1::2], u[2::2]
    at0, at1, at2 = -1.5 * u0 + 2.0 * u1 - 0.5 * u2, 0.5 * (u2 - u0), 0.5 * u0 - 2.0 * u1 + 1.5 * u2
    work = jnp.sum(f0 * at0 + 4.0 * f1 * at1 + f2 * at2) / 3.0  # Simpson's rule on F du/dstep
    if even + 1 < force.shape[0]:
        work = work + 0.5 * (force[-2] + force[-1]) * (displacement[-1] - displacement[-2])
    return work


def turning_points(path: np.ndarray) -> list[int]:
    """Indices of a load path's start, reversals and end; (steps,) to a list."""
    moves = np.flatnonzero(np.diff(path)) + 1
    signs = np.sign(path[moves] - path[moves - 1])
    turns = moves[:-1][signs[1:] != signs[:-1]] if moves.size else []
    return [0, *map(int, turns), len(path) - 1]


def closed_cycles(path: np.ndarray) -> tuple[tuple[int, int, int], ...]:
    """Cycles of a load path that return to the load they started from: (start, turn, end) each."""
    turns = turning_points(path)
    close = 1e-6 * np.ptp(path)
    cycles, i = [], 0
    while i + 2 < len(turns):
        a, b, c = turns[i : i + 3]
        if abs(path[c] - path[a]) <= close:
            cycles.append((a, b, c))
            i += 2
        else:
            i += 1
    return tuple(cycles)
