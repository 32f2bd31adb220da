"""Newton's method for residuals with kinks, differentiable at the root.  No physics."""

from __future__ import annotations

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array, lax

from jbeamshell import block_tridiagonal
from jbeamshell.parts import require


class Newton(eqx.Module):
    """Newton's method with a non-monotone line search, differentiable at the root.

    Friction's kinks raise the residual for an iteration or two, by no more than the friction force
    itself; a search that forbids this stalls there.  So a step is halved only when the residual
    grows by more than that.

    Attributes
    ----------
    tolerance : largest out-of-balance force at a node over mu F_N L; None is 1e-10 in double and
        2e-5 in single precision
    max_iterations : Newton iterations per load step
    max_halvings : of one Newton step
    """

    tolerance: float | None = eqx.field(static=True, default=None)
    max_iterations: int = eqx.field(static=True, default=200)
    max_halvings: int = eqx.field(static=True, default=8)

    def __check_init__(self) -> None:
        good = self.tolerance is None or self.tolerance > 0.0
        require("solver.tolerance", self.tolerance, good, "must be a positive number or None")

    def tolerance_for(self, dtype: jnp.dtype) -> float:
        """The tolerance in force at a precision."""
        double = dtype == jnp.float64
        tolerance = self.tolerance or (1e-10 if double else 2e-5)
        require(
            "solver.tolerance",
            tolerance,
            double or tolerance >= 1e-6,
            "is beyond single precision; write jax.config.update('jax_enable_x64', True) first",
        )
        return tolerance

    def solve(
        self,
        residual: Callable[[Array], Array],
        limit: Callable[[Array, Array], Array],
        guess: Array,
        enabled: Array,
    ) -> tuple[Array, tuple[Array, Array]]:
        """Find a root of a residual whose rows couple to neighbouring rows only.

        Parameters
        ----------
        residual : (n, m) to (n, m), in units of the friction force mu F_N L
        limit : from an iterate and the next one to the one to go on with
        guess : (n, m)
        enabled : false skips the iteration

        Returns
        -------
        root : (n, m); forward and reverse derivatives by the implicit function theorem
        iterations, error : count, and the largest residual left
        """
        tolerance = self.tolerance_for(guess.dtype)

        def unfinished(state: tuple[Array, Array, Array]) -> Array:
            _, r, count = state
            return enabled & (jnp.max(jnp.abs(r)) > tolerance) & (count < self.max_iterations)

        def iterate(function: Callable[[Array], Array], start: Array) -> tuple[Array, tuple]:
            def improve(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
                x, r, count = state
                _, linear = jax.linearize(function, x)
                step = block_tridiagonal.solve(block_tridiagonal.jacobian(linear, x), -r)
                x, r = self._search(function, lambda s: limit(x, x + s * step), r)
                return x, r, count + 1

            x, r, count = lax.while_loop(
                unfinished, improve, (start, function(start), jnp.asarray(0))
            )
            # As a float: custom_root has no tangent for integers.
            return x, (count.astype(x.dtype), jnp.max(jnp.abs(r)))

        root, (count, error) = lax.custom_root(
            residual, guess, iterate, block_tridiagonal.linear_solve, has_aux=True
        )
        return root, (count.astype(int), error)

    def _search(
        self, function: Callable[[Array], Array], along: Callable[[Array], Array], r: Array
    ) -> tuple[Array, Array]:
        """Halve the step until the residual grows by no more than the friction force."""
        bound = jnp.linalg.norm(r) + 1.0

        def too_long(trial: tuple[Array, Array, Array]) -> Array:
            _, r_new, scale = trial
            return ~(jnp.linalg.norm(r_new) <= bound) & (scale > 0.5**self.max_halvings)

        def halve(trial: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
            scale = 0.5 * trial[2]
            x = along(scale)
            return x, function(x), scale

        one = jnp.ones((), r.dtype)
        x, r, _ = lax.while_loop(too_long, halve, (along(one), function(along(one)), one))
        return x, r
