"""One load step by Newton's method: equations, initial guess and results."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax

from jbeamshell.load_steps import status_changes
from jbeamshell.load_steps.path_state import (
    EQUAL,
    PathState,
    StepResults,
    slipping_nodes,
    status_codes,
)
from jbeamshell.load_steps.prediction import Reversal, first_to_slip, last_reversal
from jbeamshell.load_steps.system import ContactInput, LoadLevel, Prescribed, System, V
from jbeamshell.load_steps.tangent import (
    Stiffness,
    in_blocks,
    initial_stiffness,
    matrix,
    nodal,
    residual_in_blocks,
    stiffness_at,
    with_v,
)
from jbeamshell.numerics.block_tridiagonal import BlockTridiagonal
from jbeamshell.numerics.newton import Newton, Problem
from jbeamshell.scene.keys import ARC_LENGTH
from jbeamshell.scene.load_path import LoadPath


class StepGuess(NamedTuple):
    """Initial guess of a load step.

    Attributes
    ----------
    reversal : last reversal of the load, which may be at the start of the step
    change : (blocks, size) increments of the unknowns
    stiffness : tangent stiffness without the foundation's response
    """

    reversal: Reversal
    change: Array
    stiffness: Stiffness


class StepEquations(NamedTuple):
    """Equations of a load step in the increments of its unknowns, in blocks.

    Attributes
    ----------
    system : equations of equilibrium
    before : load level at the start of the step
    prescribed : quantities that the step prescribes
    """

    system: System
    before: LoadLevel
    prescribed: Prescribed

    def problem(self) -> Problem:
        """Problem for Newton's method."""
        refresh = None if self.system.linear else self.refresh
        careful = self.careful if status_changes.applies(self.system) else None
        return Problem(self.residual, self.limit, self.tangent, refresh, careful)

    def residual(self, unknown: Array) -> tuple[Array, ContactInput]:
        """Out-of-balance forces (blocks, size), and the input of the tangent."""
        _, residual, contact = self._advance(self.system, unknown)
        return residual_in_blocks(residual, unknown), contact

    def tangent(self, contact: ContactInput, stiffness: Stiffness) -> BlockTridiagonal:
        """Matrix of the residual."""
        return matrix(self.system, stiffness, contact, self.before, self.prescribed)

    def refresh(self, unknown: Array, contact: ContactInput) -> Stiffness:
        """Stiffness without the foundation's response, at the unknowns and their contact input."""
        # The barrier ties it to the unknowns: the compiler would find it before it is needed.
        system, unknown = lax.optimization_barrier((self.system, unknown))
        q = self.before.q + system.embed(nodal(system, unknown))
        response = system.contact_response(contact, self.before, self.prescribed)
        return stiffness_at(system, q, response, self.prescribed)

    def careful(
        self, residual: Array, contact: ContactInput, tolerance: float, tried: Array
    ) -> tuple[Array, ContactInput, Array]:
        """Residual and tangent's input of a step that changes one contact; see `Problem`."""
        return status_changes.one_change(self.system, residual, contact, tolerance, tried)

    def limit(self, old: Array, new: Array) -> Array:
        """Next iterate with its slips limited by the friction law."""
        system, before = self.system, self.before
        old_slip, new_slip = (nodal(system, unknown)[:, V] for unknown in (old, new))
        slip = system.foundation.limited_slip(old_slip, new_slip, before.traction, before.cap)
        return with_v(system, new, jnp.where(self.prescribed.rough > 0.0, slip, new_slip))

    def _advance(self, system: System, unknown: Array) -> tuple[LoadLevel, Array, ContactInput]:
        return system.advance(nodal(system, unknown), self.before, self.prescribed)


def newton_step(
    system: System, state: PathState, to: LoadPath, solver: Newton, guess: StepGuess
) -> tuple[PathState, StepResults]:
    """Solve a load step by Newton's method.

    Parameters
    ----------
    system : equations of equilibrium
    state : state before the step
    to : target, pressure and roughness of the step
    solver : settings of Newton's method
    guess : initial guess
    """
    before = state.level
    prescribed = _prescribed(system, state, to, guess.reversal)
    if system.control == ARC_LENGTH:
        stiffness = initial_stiffness(system, prescribed.rough, prescribed.weights)
        guess = guess._replace(stiffness=stiffness)
    problem = StepEquations(system, before, prescribed).problem()
    change, (iterations, error) = solver.solve(
        problem, guess.change, guess.stiffness, state.converged
    )
    after, *_ = system.advance(nodal(system, change), before, prescribed)
    converged = state.converged & (error <= solver.tolerance_for(system.x.dtype))
    u = system.end_displacement(after.q)
    origin = jnp.where(to.rough > 0.0, state.origin, u)
    end = PathState(
        level=jax.tree.map(lambda new, old: jnp.where(converged, new, old), after, before),
        origin=origin,
        target=to.target,
        pressure=to.pressure,
        reversal=guess.reversal,
        change=change,
        direction=_direction(system, state, before, after, origin),
        converged=converged,
    )
    return end, StepResults(
        state=end,
        displacement=u - origin,
        slipping=slipping_nodes(system, before, after, to.rough),
        slip_work=to.rough * system.slip_work(before, after),
        stored_energy=system.stored_energy(after, to.pressure),
        sinking=system.sinking(after.q),
        iterations=iterations,
        error=error,
        status=status_codes(converged, state.converged, error),
    )


def guess_from_bar(
    system: System, state: PathState, to: LoadPath, stiffness: Stiffness
) -> StepGuess:
    """Guess that takes those nodes to their caps which would slip in a bar."""
    level = state.level
    reversal = last_reversal(system, state, to)
    direction = first_to_slip(system, reversal, to.target)
    size = (2.0 * level.cap - direction * level.traction) / system.foundation.slip_stiffness
    slip = direction * jnp.maximum(size, 0.0)
    fields = jnp.zeros_like(level.q).at[:, V].set(slip)[:, list(system.plan.active)]
    bar = in_blocks(fields, state.change)
    change = lax.stop_gradient(jnp.where(to.rough > 0.0, bar, state.change))
    return StepGuess(reversal, change, stiffness)


def _prescribed(system: System, state: PathState, to: LoadPath, reversal: Reversal) -> Prescribed:
    """Quantities that a step prescribes.

    The arc length goes on in the direction of the last step, and after a reversal in one that is as
    much displacement as force.
    """
    prescribed = Prescribed(to.target, to.pressure, state.origin, to.rough)
    if system.control != ARC_LENGTH:
        return prescribed
    travel = to.target - state.target
    diagonal = jnp.where(travel >= 0.0, EQUAL, -EQUAL)
    direction = jnp.where(reversal.target == state.target, diagonal, state.direction)
    arc = jnp.sum(direction * _path_point(system, state.level, state.origin))
    controlled = jnp.where(to.rough > 0.0, arc + jnp.abs(travel), 0.0)
    return prescribed._replace(controlled=controlled, weights=direction)


def _direction(
    system: System, state: PathState, before: LoadLevel, after: LoadLevel, origin: Array
) -> Array:
    """Direction (2,) of a step; that of the state before it if the step goes nowhere."""
    travel = _path_point(system, after, origin) - _path_point(system, before, origin)
    length = jnp.linalg.norm(travel)
    moves = length > 0.0
    return jnp.where(moves, travel / jnp.where(moves, length, 1.0), state.direction)


def _path_point(system: System, level: LoadLevel, origin: Array) -> Array:
    """Point of a load level in the plane of u(L) and F L/(E' 2H), (2,)."""
    u = system.end_displacement(level.q) - origin
    return jnp.stack([u, level.force / system.stiffness_scale])
