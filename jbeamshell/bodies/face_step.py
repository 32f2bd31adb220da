"""One load step of a face: Newton's method on the contact, differentiable at the equilibrium.

With u the displacements of the face's nodes, B their part in the displacement of each contact point
and lambda = k (s - B u) the force of the points, whose slip s follows from the contact law
(`face_law.slip_at`),

    K u - f P - B' lambda = 0,    that is    u = C (f P + B' k s),    C = (K + B' k B)^-1.

Where a point sticks its slip stays, so that all that changes in a step is the slip of the points
that slide or open.  The law has kinks and no other nonlinearity, so that Newton's method ends after
a few iterations; a step that does not lower the residual is shortened.  Where that goes on and on,
as on strongly coupled faces of much friction, sweeps u = C (f P + B' k s(B u)) lead elsewhere.
Where the displacement of the load is prescribed, P follows from it, d = f' u + c P.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.bodies.face import Drive, Face, Sticking
from jbeamshell.bodies.face_law import slip_at, slip_slopes
from jbeamshell.bodies.face_part import part_of_step
from jbeamshell.common.numbers_of import cond, numbers_of, while_loop

TOLERANCE = 1e-11  # force out of balance over the largest load of a node
BALANCED = 1e-9  # the same at the end of a step: a body that walks is in balance to fewer digits
ITERATIONS = 80
ROUND = 20  # iterations after which Newton's method starts anew, from where sweeps have led
SWEEPS = 400  # between two such rounds
ROUGHLY = 1e-2  # error of a Newton step over the residual, which is less near the solution
ENOUGH = 0.3  # of `TOLERANCE`, below which no Newton step need go
TURNS = 2  # of Newton's method, the second one with the bodies in balance again
SHORTER = 0.5 ** np.arange(1.0, 7.0)  # lengths that are tried where a whole Newton step fails


class Found(NamedTuple):
    """End of a step: displacements (N,), force out of balance over the loads, iterations."""

    u: Array
    error: Array
    iterations: Array


def take_step(face: Face, sticking: Sticking, slip: Array, drive: Drive, guess: Array) -> Found:
    """Equilibrium after a step.

    Parameters
    ----------
    face, sticking : bodies and points
    slip : (q, 3) slip at the end of the last step
    drive : loads
    guess : (q, 3) slip from which the search starts
    """
    if numbers_of(face.loads) is np:
        return Found(*_newton(face, sticking, guess, slip, drive))

    def off_balance(u: Array) -> Array:
        return _off_balance(face, u, slip, drive)

    def solve(residual: Any, begin: Array) -> tuple[Array, tuple[Array, Array]]:
        u, error, count = _newton(*lax.stop_gradient((face, sticking, guess, slip, drive)))
        return u, (error, count)

    def tangent(linear: Any, right: Array) -> Array:
        return jnp.linalg.solve(jax.vmap(linear)(jnp.eye(right.size)).T, right)

    begin = jnp.zeros(len(face.loads))
    u, (error, count) = lax.custom_root(off_balance, begin, solve, tangent, has_aux=True)
    return Found(u, error, count)


def forces(face: Face, u: Array, slip: Array) -> tuple[Array, Array]:
    """Forces and slip (q, 3) of the contact, by the slip at the end of the last step."""
    moved = face.moves(u)
    now = slip_at(moved, slip, face.points)
    return face.points.stiffness * (now - moved), now


def _off_balance(face: Face, u: Array, slip: Array, drive: Drive) -> Array:
    """Residual (N,), a force."""
    pushed = face.on_nodes(forces(face, u, slip)[0])
    return face.stiffness @ u - face.loads @ face.load(u, drive) - pushed


class _State(NamedTuple):
    """Iterate of Newton's method.

    Attributes
    ----------
    u, held : displacements (N,) in balance with nodal forces (N,), those of the springs' other ends
    moves : (q, 3) of the points
    off, error : (N,) force out of balance: those forces by the contact law, less these; over the
        largest load
    taken : iterations
    """

    u: Array
    held: Array
    moves: Array
    off: Array
    error: Array
    taken: Array


def _newton(
    face: Face, sticking: Sticking, guess: Array, slip: Array, drive: Drive
) -> tuple[Array, Array, Array]:
    """Displacements where the residual vanishes, its size, and the iterations."""
    xp = numbers_of(guess)
    points, springs = face.points, face.points.stiffness
    driven, pull = drive.driven, face.loads[:, 0]

    def by_law(moves: Array) -> Array:
        return face.on_nodes(springs * slip_at(moves, slip, points))

    def at(u: Array, held: Array, moves: Array, count: Array) -> _State:
        off = by_law(moves) - held
        return _State(u, held, moves, off, relative(u, off), count)

    def relative(u: Array, off: Array) -> Array:
        largest = xp.max(xp.abs(face.loads @ face.load(u, drive)))
        return xp.max(xp.abs(off)) / xp.where(largest > 0.0, largest, 1.0)

    def improve(state: _State) -> _State:
        rough = xp.maximum(xp.minimum(ROUGHLY, state.error), ENOUGH * TOLERANCE / state.error)
        slopes = slip_slopes(state.moves, slip, points)
        force = part_of_step(face, slopes, state.off, sticking, driven, rough)
        way = sticking.moved(force, driven, pull)
        along, count = face.moves(way), state.taken + 1

        def part(of: Any) -> _State:
            moves = state.moves + of * along
            return at(state.u + of * way, state.held + of * force, moves, count)

        whole, before = part(1.0), xp.sum(state.off**2)

        def shortened() -> _State:
            trials = state.moves + SHORTER[:, None, None] * along
            offs = by_law(trials) - (state.held + SHORTER[:, None] * force)
            squares = xp.sum(offs**2, axis=1)
            better = squares < (1.0 - 1e-4 * SHORTER) * before
            best = xp.where(xp.any(better), xp.argmax(better), xp.argmin(squares))
            return part(xp.asarray(SHORTER)[best])

        falls = xp.sum(whole.off**2) < (1.0 - 1e-4) * before
        state = cond(falls, lambda: whole, shortened)
        # A loop of no sweeps costs nothing, also under vmap, where a condition would take them all.
        left = xp.where(count % ROUND == 0, SWEEPS, 0)
        return while_loop(lambda sweep: sweep[1] > 0, swept, (state, left))[0]

    def swept(now: tuple[_State, Array]) -> tuple[_State, Array]:
        state, left = now
        u = state.u + sticking.moved(state.off, driven, pull)
        return at(u, state.held + state.off, face.moves(u), state.taken), left - 1

    def goes_on(state: _State) -> Array:
        lasts = (state.error > TOLERANCE) & xp.isfinite(state.error)
        return lasts & (state.taken < ITERATIONS)

    def again(state: _State, off: Array) -> _State:
        u = state.u - sticking.moved(off, driven, pull)
        return at(u, state.held, face.moves(u), state.taken)

    def settled(now: tuple[_State, Array, Array, Array]) -> tuple[_State, Array, Array, Array]:
        state, off, _, left = now
        state = cond(left == TURNS, lambda: state, lambda: again(state, off))
        state = while_loop(goes_on, improve, state)
        off = _off_balance(face, state.u, slip, drive)
        return state, off + state.off, relative(state.u, off), left - 1

    held = face.on_nodes(springs * guess)
    u = sticking.under(face, held, drive)
    begin = at(u, held, face.moves(u), xp.asarray(0))
    # The flexibility is rounded: what that leaves out of balance is taken out of u, once.
    state, _, error, _ = while_loop(
        lambda now: (now[2] > TOLERANCE) & (now[3] > 0),
        settled,
        (begin, xp.zeros_like(u), xp.asarray(np.inf), xp.asarray(TURNS)),
    )
    return state.u, error, xp.asarray(state.taken, float)
