"""Newton's method for residuals with kinks, differentiable at the root.  No physics."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import require, require_count
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.numerics.block_tridiagonal import BlockTridiagonal

Seen = TypeVar("Seen")
Stiffness = TypeVar("Stiffness")
PATIENCE = 100  # iterations; contact that recedes node by node needs many
CHORDS = 12  # iterations between refreshes of what hardly changes


class Newton(eqx.Module):
    """Newton's method with a non-monotone line search, differentiable at the root.

    Friction's kinks raise the residual for an iteration or two, by no more than the friction force
    itself; a search that forbids this stalls there.  So a step is halved only when the residual
    grows by more than that.

    Attributes
    ----------
    tolerance : largest out-of-balance force at a node over mu F_N L; None is 1e-10 in double and
        1e-4 in single precision
    max_iterations : Newton iterations per load step
    max_halvings : of one Newton step
    """

    tolerance: float | None = eqx.field(static=True, default=None)
    max_iterations: int = eqx.field(static=True, default=200)
    max_halvings: int = eqx.field(static=True, default=8)

    def __check_init__(self) -> None:
        number = isinstance(self.tolerance, int | float) and not isinstance(self.tolerance, bool)
        good = self.tolerance is None or (number and self.tolerance > 0.0)
        require("solver.tolerance", self.tolerance, good, "must be a positive number or None")
        require_count("solver.max_iterations", self.max_iterations, 1)
        require_count("solver.max_halvings", self.max_halvings, 0)

    def tolerance_for(self, dtype: jnp.dtype) -> float:
        """The tolerance in force at a precision."""
        double = dtype == jnp.float64
        tolerance = self.tolerance or (1e-10 if double else 1e-4)
        require(
            "solver.tolerance",
            tolerance,
            double or tolerance >= 1e-5,
            "is beyond single precision; write jax.config.update('jax_enable_x64', True) first",
        )
        return tolerance

    def solve(
        self,
        evaluate: Callable[[Array], tuple[Array, Seen]],
        limit: Callable[[Array, Array], Array],
        guess: Array,
        enabled: Array,
        tangent: Callable[[Seen, Stiffness], BlockTridiagonal],
        stiffness: Stiffness | None,
        refresh: Callable[[Array], Stiffness] | None = None,
    ) -> tuple[Array, tuple[Array, Array]]:
        """Find a root of a residual whose rows couple to neighbouring rows only.

        Parameters
        ----------
        evaluate : from (n, m) unknowns to the residual (n, m), in units of the friction force
            mu F_N L, and to what the tangent sees of it
        limit : from an iterate and the next one to the one to go on with
        guess : (n, m)
        enabled : false skips the iteration
        tangent : the residual's matrix from what it sees and from the part that hardly changes
        stiffness : that part; None where the guess is likely to be a root, so that it is found only
            when it is needed
        refresh : that part at some unknowns; None where it is the same everywhere and known

        Returns
        -------
        root : (n, m); forward and reverse derivatives by the implicit function theorem
        iterations, error : count, and the largest residual left
        """
        tolerance = self.tolerance_for(guess.dtype)
        creeping = refresh is not None and stiffness is not None

        def close(at: Iterate) -> Array:
            return jnp.max(jnp.abs(at.residual)) <= tolerance

        def unfinished(at: Iterate) -> Array:
            # What approaches the root a little at a time goes on for once when it is close.
            done = close(at) & at.was_close if creeping else close(at)
            return enabled & ~done & (at.tried < self.max_iterations)

        def improve(at: Iterate, stiffness: Stiffness) -> Iterate:
            step = block_tridiagonal.solve(tangent(at.seen, stiffness), -at.residual)
            x = limit(at.x, at.x + at.scale * step)
            residual, seen = evaluate(x)
            # Friction's kinks raise the residual, but by no more than the friction force itself;
            # a search that goes round in circles must lower it.
            rise = jnp.where(at.tried < PATIENCE, 1.0, 0.0)
            most = jnp.linalg.norm(at.residual) + rise
            good = (jnp.linalg.norm(residual) <= most) | (at.scale <= 0.5**self.max_halvings)
            new = Iterate(x, residual, seen, jnp.ones_like(at.scale), close(at), at.tried)
            old = at._replace(scale=0.5 * at.scale)
            kept: Iterate = jax.tree.map(lambda a, b: jnp.where(good, a, b), new, old)
            return kept._replace(tried=at.tried + 1)

        def search(at: Iterate, stiffness: Stiffness, until: ArrayLike) -> Iterate:
            return lax.while_loop(
                lambda at: unfinished(at) & (at.tried < until),
                lambda at: improve(at, stiffness),
                at,
            )

        def refreshing(
            start: Iterate, stiffness: Stiffness, anew: Callable[[Array], Stiffness]
        ) -> Iterate:
            def chords(state: tuple[Iterate, Stiffness]) -> tuple[Iterate, Stiffness]:
                at = search(*state, state[0].tried + CHORDS)
                return at, lax.cond(unfinished(at), anew, lambda _: state[1], at.x)

            return lax.while_loop(lambda s: unfinished(s[0]), chords, (start, stiffness))[0]

        def iterate(_: Callable[[Array], Array], start: Array) -> tuple[Array, tuple]:
            one, none = jnp.ones((), start.dtype), jnp.asarray(0)
            at = Iterate(start, *evaluate(start), one, jnp.asarray(False), none)
            if stiffness is not None and refresh is not None:
                at = refreshing(at, stiffness, refresh)
            elif stiffness is not None:
                at = search(at, stiffness, self.max_iterations)
            elif refresh is not None:
                at = lax.while_loop(
                    unfinished, lambda at: search(at, refresh(at.x), self.max_iterations), at
                )
            # As a float: custom_root has no tangent for integers.
            return at.x, (at.tried.astype(at.x.dtype), jnp.max(jnp.abs(at.residual)))

        root, (count, error) = lax.custom_root(
            lambda x: evaluate(x)[0],
            guess,
            iterate,
            block_tridiagonal.linear_solve,
            has_aux=True,
        )
        return root, (count.astype(int), error)


class Iterate(NamedTuple):
    """Where a search stands.

    Attributes
    ----------
    x, residual, seen : unknowns, their residual and what the tangent sees of it
    scale : part of the next step that is taken
    was_close : whether the iterate before was within the tolerance
    tried : steps tried so far
    """

    x: Array
    residual: Array
    seen: Any
    scale: Array
    was_close: Array
    tried: Array
