"""Newton's method for residuals with kinks, differentiable at the root.  No physics."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import require, require_count
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.numerics.block_tridiagonal import BlockTridiagonal

PATIENCE = 100  # iterations before a search is careful; receding contact needs many
CHORDS = 12  # iterations between two refreshes of the stiffness


class Problem(NamedTuple):
    """Residual whose rows couple to neighbouring rows only, with its tangent.

    The tangent is made from two things: an input that `evaluate` finds along with the residual, and
    a stiffness that hardly changes.

    Attributes
    ----------
    evaluate : from the unknowns (n, m) to the residual (n, m), in units of the friction force
        mu F_N L, and the tangent's input
    limit : from an iterate and the next one to the one to go on with
    tangent : from its input and the stiffness to the matrix of the residual
    refresh : from the unknowns and the tangent's input to the stiffness; None if the stiffness is
        constant and given
    careful : from the residual, the tangent's input, the tolerance and the number of iterations to
        residual and input for a step that changes less, and True if it must be taken whole
    """

    evaluate: Callable[[Array], tuple[Array, Any]]
    limit: Callable[[Array, Array], Array]
    tangent: Callable[[Any, Any], BlockTridiagonal]
    refresh: Callable[[Array, Any], Any] | None = None
    careful: Callable[[Array, Any, float, Array], tuple[Array, Any, Array]] | None = None


class Newton(eqx.Module):
    """Settings of Newton's method with a non-monotone line search, differentiable at the root.

    Friction's kinks raise the residual for an iteration or two, by no more than the friction force
    itself, and a search that forbids this stalls there.  So a step is halved only if it raises the
    residual by more than that.

    Attributes
    ----------
    tolerance : largest out-of-balance force at a node over mu F_N L; None is 1e-10 in double and
        1e-4 in single precision
    max_iterations : largest number of Newton iterations in a load step
    max_halvings : largest number of halvings of one Newton step

    Examples
    --------
    >>> history = jb.solve(scene, solver=jb.Newton(tolerance=1e-8))
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
        """Tolerance in force at a precision; `InputError` if the precision cannot reach it."""
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
        self, problem: Problem, guess: Array, stiffness: Any = None, enabled: ArrayLike = True
    ) -> tuple[Array, tuple[Array, Array]]:
        """Find a root.

        Parameters
        ----------
        problem : residual and tangent
        guess : (n, m) unknowns to start from
        stiffness : stiffness at the guess; None if ``problem.tangent`` needs none
        enabled : False skips the iteration

        Returns
        -------
        root : (n, m); forward and reverse derivatives by the implicit function theorem
        iterations, error : number of iterations, and the largest residual left
        """
        # An iteration that approaches the root slowly goes on for once when it is close.
        once_more = problem.refresh is not None
        tolerance = self.tolerance_for(guess.dtype)
        search = _Search(self, problem, tolerance, jnp.asarray(enabled), once_more)

        def iterate(_: Callable[[Array], Array], start: Array) -> tuple[Array, tuple]:
            end = search.run(start, stiffness)
            # The count is a float because custom_root has no tangent for integers.
            return end.x, (end.tried.astype(end.x.dtype), _largest(end.residual))

        root, (count, error) = lax.custom_root(
            lambda x: problem.evaluate(x)[0],
            guess,
            iterate,
            block_tridiagonal.linear_solve,
            has_aux=True,
        )
        return root, (count.astype(int), error)


class _Iterate(NamedTuple):
    """Iterate of a search.

    Attributes
    ----------
    x, residual, tangent_input : unknowns, their residual and the input of the tangent there
    scale : part of the next Newton step that is taken
    was_close : True if a step was tried from an iterate within the tolerance
    tried : number of steps tried so far
    """

    x: Array
    residual: Array
    tangent_input: Any
    scale: Array
    was_close: Array
    tried: Array


class _Search(NamedTuple):
    """Search for a root of a problem.

    Attributes
    ----------
    settings : settings of Newton's method
    problem : residual and tangent
    tolerance : largest residual of a root
    enabled : False skips the iteration
    once_more : True if a further step must be tried from an iterate within the tolerance
    """

    settings: Newton
    problem: Problem
    tolerance: float
    enabled: Array
    once_more: bool

    def run(self, start: Array, stiffness: Any) -> _Iterate:
        """Iterate from unknowns ``start``."""
        refresh = self.problem.refresh
        one, none = jnp.ones((), start.dtype), jnp.asarray(0)
        values = self.problem.evaluate(start)
        first = _Iterate(start, *values, one, jnp.asarray(False), none)
        if refresh is None:
            return self._chords(first, stiffness, self.settings.max_iterations)

        def refreshed(state: tuple[_Iterate, Any]) -> tuple[_Iterate, Any]:
            at = self._chords(*state, state[0].tried + CHORDS)
            found = at.x, at.tangent_input
            return at, lax.cond(self._unfinished(at), refresh, lambda *_: state[1], *found)

        return lax.while_loop(lambda s: self._unfinished(s[0]), refreshed, (first, stiffness))[0]

    def _chords(self, start: _Iterate, stiffness: Any, until: ArrayLike) -> _Iterate:
        """Iterate with one stiffness up to so many steps."""
        return lax.while_loop(
            lambda at: self._unfinished(at) & (at.tried < until),
            lambda at: self._improved(at, stiffness),
            start,
        )

    def _improved(self, at: _Iterate, stiffness: Any) -> _Iterate:
        """Iterate after a Newton step, or the same with half the scale if the step is rejected."""
        problem = self.problem
        defect, tangent_input, whole_step = self._linearised(at)
        matrix = problem.tangent(tangent_input, stiffness)
        step = block_tridiagonal.solve(matrix, -defect)
        x = problem.limit(at.x, at.x + jnp.where(whole_step, 1.0, at.scale) * step)
        residual, tangent_input = problem.evaluate(x)
        # Friction's kinks raise the residual, but by no more than the friction force itself.  A
        # search that goes round in circles must lower it.
        rise = jnp.where(at.tried < PATIENCE, 1.0, 0.0)
        most = jnp.linalg.norm(at.residual) + rise
        smallest = at.scale <= 0.5**self.settings.max_halvings
        accepted = (jnp.linalg.norm(residual) <= most) | smallest | whole_step
        # A close iterate is left for a closer one only: at a kink, round-off throws a step far off.
        close, whole = self._close(at), jnp.ones_like(at.scale)
        accepted = jnp.where(close, _largest(residual) <= _largest(at.residual), accepted)
        new = _Iterate(x, residual, tangent_input, whole, close, at.tried)
        old = at._replace(scale=0.5 * at.scale, was_close=close)
        iterate: _Iterate = jax.tree.map(lambda a, b: jnp.where(accepted, a, b), new, old)
        return iterate._replace(tried=at.tried + 1)

    def _linearised(self, at: _Iterate) -> tuple[Array, Any, Array]:
        """Residual and tangent's input of the next step, and True if it must be taken whole."""
        plain = at.residual, at.tangent_input, jnp.asarray(False)
        if self.problem.careful is None:
            return plain
        careful = self.problem.careful(at.residual, at.tangent_input, self.tolerance, at.tried)
        circles = at.tried >= PATIENCE
        return jax.tree.map(lambda a, b: jnp.where(circles, a, b), careful, plain)

    def _close(self, at: _Iterate) -> Array:
        return _largest(at.residual) <= self.tolerance

    def _unfinished(self, at: _Iterate) -> Array:
        done = self._close(at) & at.was_close if self.once_more else self._close(at)
        return self.enabled & ~done & (at.tried < self.settings.max_iterations)


def _largest(residual: Array) -> Array:
    """Largest magnitude of a residual."""
    return jnp.max(jnp.abs(residual))
