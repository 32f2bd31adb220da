"""Linear solver for the stages of implicit Runge-Kutta methods, by block elimination.

The Jacobian of a stage couples every node with its neighbours, and the rows of work with all nodes.
Its blocks are found by probing every third node at once, and factored once per step.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import lineax as lx
from jax import Array, lax

from jbeamshell.dynamics.strip.equations import MotionState
from jbeamshell.numerics.block_tridiagonal import inverse, jacobian

Factors = tuple[Array, Array, Array, Array, Array]


class BlockElimination(lx.AbstractLinearSolver):
    """Block elimination for operators between `MotionState`, without pivoting."""

    def init(self, operator: lx.AbstractLinearOperator, options: dict[str, Any]) -> Factors:
        """Factors: inverse pivots, lower and eliminated upper blocks, rows and diagonal of work."""
        like = jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), operator.in_structure())

        def nodal(rows: Array) -> Array:
            return _rows(operator.mv(_state(rows, like.work)))

        matrix = jacobian(nodal, _rows(like))
        lower, diagonal, upper = (jnp.moveaxis(blocks, -1, 0) for blocks in matrix)

        def eliminate(above: Array, row: tuple[Array, Array, Array]) -> tuple[Array, Any]:
            low, own, up = row
            pivot = inverse(own - low @ above)
            right = pivot @ up
            return right, (pivot, right)

        _, (pivots, right) = lax.scan(eliminate, jnp.zeros_like(upper[0]), (lower, diagonal, upper))
        transposed = operator.transpose()

        def work_row(unit: Array) -> tuple[Array, Array]:
            row = transposed.mv(_state(jnp.zeros_like(_rows(like)), unit))
            return _rows(row), jnp.sum(row.work * unit)

        work_rows, work_diagonal = jax.vmap(work_row)(
            jnp.eye(like.work.size, dtype=like.work.dtype)
        )
        return pivots, lower, right, work_rows, work_diagonal

    def compute(
        self, state: Factors, vector: MotionState, options: dict[str, Any]
    ) -> tuple[Any, Any, dict]:
        """Solution for one right-hand side."""
        pivots, lower, right, work_rows, work_diagonal = state

        def forward(above: Array, row: tuple[Array, ...]) -> tuple[Array, Array]:
            pivot, low, b = row
            x = jnp.sum(pivot * (b - jnp.sum(low * above, axis=1)), axis=1)
            return x, x

        def backward(below: Array, row: tuple[Array, Array]) -> tuple[Array, Array]:
            up, b = row
            x = b - jnp.sum(up * below, axis=1)
            return x, x

        rows = _rows(vector)
        _, halfway = lax.scan(forward, jnp.zeros_like(rows[0]), (pivots, lower, rows))
        _, solution = lax.scan(backward, jnp.zeros_like(rows[0]), (right, halfway), reverse=True)
        work = (vector.work - jnp.sum(work_rows * solution, axis=(1, 2))) / work_diagonal
        return _state(solution, work), lx.RESULTS.successful, {}

    def transpose(self, state: Any, options: dict[str, Any]) -> Any:
        """Not implemented: derivatives need no transposed solve."""
        raise NotImplementedError

    def conj(self, state: Any, options: dict[str, Any]) -> Any:
        """Factors of the conjugate, which are the same because all is real."""
        return state, options

    def assume_full_rank(self) -> bool:
        """True; the operator is regular for small enough steps."""
        return True


def _rows(state: MotionState) -> Array:
    """Fields, rates and tractions of the nodes, (b, 2a+1)."""
    return jnp.concatenate([state.q, state.p, state.t[:, None]], axis=1)


def _state(rows: Array, work: Array) -> MotionState:
    """State from its rows and its work."""
    fields = rows.shape[1] // 2
    return MotionState(rows[:, :fields], rows[:, fields : 2 * fields], rows[:, -1], work)
