"""The implicit solver's linear algebra: nodes couple to their neighbours, energies to nothing.

A stage of an implicit Runge-Kutta method has a Jacobian whose blocks are the nodes'.  It is found
by probing every third node at once, eliminated once per step and applied at every iteration.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import lineax as lx
from jax import Array, lax

from jbeamshell.dynamics.strip.equations import MotionState
from jbeamshell.numerics.block_tridiagonal import inverse as block_inverse
from jbeamshell.numerics.block_tridiagonal import jacobian

Factored = tuple[Array, Array, Array, Array, Array]


class Banded(lx.AbstractLinearSolver):
    """Block elimination for operators between `State`, without pivoting."""

    def init(self, operator: lx.AbstractLinearOperator, options: dict[str, Any]) -> Factored:
        """Eliminate once: inverse pivots, the blocks below, the pivots' rows, and works' own."""
        like = jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), operator.in_structure())

        def moving(rows: Array) -> Array:
            return _rows(operator.mv(_state(rows, like.work)))

        matrix = jacobian(moving, _rows(like))
        lower, diagonal, upper = (jnp.moveaxis(blocks, -1, 0) for blocks in matrix)

        def eliminate(above: Array, row: tuple[Array, Array, Array]) -> tuple[Array, Any]:
            low, own, up = row
            inverse = block_inverse(own - low @ above)
            right = inverse @ up
            return right, (inverse, right)

        _, (inverse, right) = lax.scan(
            eliminate, jnp.zeros_like(upper[0]), (lower, diagonal, upper)
        )
        # Of the works' rows: what the moving parts do to them, and their own diagonal.
        backwards = operator.transpose()

        def weighing(unit: Array) -> tuple[Array, Array]:
            row = backwards.mv(_state(jnp.zeros_like(_rows(like)), unit))
            return _rows(row), jnp.sum(row.work * unit)

        weights, alone = jax.vmap(weighing)(jnp.eye(like.work.size, dtype=like.work.dtype))
        return inverse, lower, right, weights, alone

    def compute(
        self, state: Factored, vector: MotionState, options: dict[str, Any]
    ) -> tuple[Any, Any, dict]:
        """Solve for one right-hand side."""
        inverse, lower, right, weights, alone = state

        def forth(above: Array, row: tuple[Array, ...]) -> tuple[Array, Array]:
            own, low, b = row
            x = jnp.sum(own * (b - jnp.sum(low * above, axis=1)), axis=1)
            return x, x

        def back(below: Array, row: tuple[Array, Array]) -> tuple[Array, Array]:
            up, b = row
            x = b - jnp.sum(up * below, axis=1)
            return x, x

        rows = _rows(vector)
        _, halfway = lax.scan(forth, jnp.zeros_like(rows[0]), (inverse, lower, rows))
        _, solution = lax.scan(back, jnp.zeros_like(rows[0]), (right, halfway), reverse=True)
        work = (vector.work - jnp.sum(weights * solution, axis=(1, 2))) / alone
        return _state(solution, work), lx.RESULTS.successful, {}

    def transpose(self, state: Any, options: dict[str, Any]) -> Any:
        """Not needed: gradients go through the converged stages."""
        raise NotImplementedError

    def conj(self, state: Any, options: dict[str, Any]) -> Any:
        """Real already."""
        return state, options

    def assume_full_rank(self) -> bool:
        """Whether the operator must be regular; it is, for small enough steps."""
        return True


def _rows(state: MotionState) -> Array:
    """Everything that belongs to a node, (b, 2a+1)."""
    return jnp.concatenate([state.q, state.p, state.t[:, None]], axis=1)


def _state(rows: Array, work: Array) -> MotionState:
    fields = rows.shape[1] // 2
    return MotionState(rows[:, :fields], rows[:, fields : 2 * fields], rows[:, -1], work)
