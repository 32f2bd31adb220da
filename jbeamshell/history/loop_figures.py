"""Figures of the last load cycle that any loop has: dissipation, stiffness, loss factor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from jax import Array

from jbeamshell.common.errors import InputError
from jbeamshell.common.numbers_of import numbers_of, quiet
from jbeamshell.numerics.cycles import branch_work


class LoopFigures:
    """Figures of the last cycle; scalars but for `loop`.

    Attributes
    ----------
    force, displacement : (steps+1,) load and the displacement conjugate to it
    slip_work : (steps+1,) work dissipated by friction in each step
    cycles : steps at the start, the turn and the end of each closed cycle

    Raises
    ------
    InputError
        if the path holds no closed cycle
    """

    if TYPE_CHECKING:  # fields of the classes that have these figures, in the order they choose
        force: Array
        displacement: Array
        slip_work: Array
        cycles: tuple[tuple[int, int, int], ...]

    @property
    def _numbers(self) -> Any:
        """NumPy for its arrays, `jax.numpy` for those of JAX."""
        return numbers_of(self.slip_work)

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
        """Work of friction in the last cycle, D."""
        start, _, stop = self._last
        return self._numbers.sum(self.slip_work[start + 1 : stop + 1])

    @property
    @quiet
    def dissipation_loop(self) -> Array:
        """Area of the last loop, with each branch integrated by parabolas."""
        start, turn, stop = self._last
        down, up = slice(start, turn + 1), slice(turn, stop + 1)
        there, back = (branch_work(self.force[b], self.displacement[b]) for b in (down, up))
        return there + back

    @property
    @quiet
    def secant_stiffness(self) -> Array:
        """Range of force over range of displacement of the last loop."""
        force, displacement = self.loop
        return self._numbers.ptp(force) / self._numbers.ptp(displacement)

    @property
    @quiet
    def loss_factor(self) -> Array:
        """Loss factor D/(2 pi W), with W the energy of the secant stiffness at the amplitude."""
        force, displacement = self.loop
        ranges = self._numbers.ptp(force) * self._numbers.ptp(displacement)
        return self.dissipation / (2.0 * np.pi * ranges / 8.0)

    @property
    def peak_displacement(self) -> Array:
        """Largest abs(u(L)) of the last loop, length."""
        return self._numbers.max(self._numbers.abs(self.loop[1]))
