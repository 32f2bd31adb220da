"""Fields above the contact line, found from its movement when somebody reads them.

To find them takes twice as long as to walk a path, and figures of a cycle need none of them.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np
from jax import Array

from jbeamshell.common.checks import is_traced
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.numbers_of import numbers_of, put
from jbeamshell.common.precision import rounded
from jbeamshell.common.pytrees import Tree
from jbeamshell.common.small import Small, always
from jbeamshell.contact_line.strip import Strip, moved_by
from jbeamshell.history.record import Above
from jbeamshell.mechanics.kinematics import Strains


class Movement(NamedTuple):
    """Movement of the contact line of n nodes along a path.

    Attributes
    ----------
    at_rest : (2n + 2,) v and w of the nodes, end load and pressure of the strip pressed down
    change : (steps+1, 2n + 2) what the load adds to them
    part : (steps+1,) part of the pressures that acts
    sound : (steps+1,) False from the first step on that has no equilibrium
    """

    at_rest: Array
    change: Array
    part: Array
    sound: Array


class Unread(Tree):
    """Fields above the contact line that nobody has read yet.

    Attributes
    ----------
    strip : strip on its contact line
    movement : its movement
    single : True if the fields are rounded to single precision
    """

    strip: Strip
    movement: Movement
    single: bool = eqx.field(static=True, default=False)

    @functools.cached_property
    def found(self) -> Above:
        """The fields; they are found once."""
        if is_traced(self):
            return self._found()
        with jax.enable_x64(True):
            above: Above = jax.device_get(self._found())
        return rounded(above) if self.single else above

    def _found(self) -> Above:
        above: Above = _above((self.strip, self.movement))
        return above


@functools.partial(Small, by_numpy=always)
def _above(inputs: tuple[Strip, Movement]) -> Above:
    """Fields above the contact line at every step."""
    strip, movement = inputs
    xp = numbers_of(inputs)
    # The pressed strip, and what the load adds to it.
    pressed = moved_by(strip.pressed, movement.at_rest[None])
    loaded = moved_by(strip.loaded, movement.change)
    moved, below = (
        None if one is None or other is None else one * movement.part + other
        for one, other in zip(pressed, loaded, strict=True)
    )
    assert moved is not None
    further, sections = _sections(strip, moved)

    def masked(values: Array) -> Array:
        return nan_unless(movement.sound, values)

    return Above(
        fields=masked(xp.concatenate([moved[:2].T, further], axis=-1)),
        sections=jax.tree.map(masked, sections),
        member=None if below is None else masked(_seen_from_above(strip, below)),
    )


def _seen_from_above(strip: Strip, moved: Array) -> Array:
    """Fields v, w, beta, psi, ... (steps, n, k) of the member below, as the strip sees them."""
    assert strip.loaded.pair is not None
    xp = numbers_of(strip, moved)
    further = xp.tensordot(strip.loaded.pair.form.further, moved, 1)
    signs = np.array([1.0, -1.0, -1.0])  # w and beta count the other way from below
    fields = xp.concatenate([moved[:2], further])
    return put(fields, slice(3), signs[:, None, None] * fields[:3]).T


def _sections(strip: Strip, moved: Array) -> tuple[Array, Strains]:
    """Further fields (steps, n, k), and N, Q, M, chi and xi of every element, (steps, elements).

    Parameters
    ----------
    moved : fields (m, n, steps) of the section's form
    """
    xp, form = numbers_of(strip, moved), strip.form
    values, slopes = form.modes[:, 0], form.modes[:, 1]
    on_mean = values @ form.values + slopes @ form.mixed.T
    on_slope = values @ form.mixed + slopes @ form.slopes
    rows = xp.concatenate([on_mean, on_slope, form.further])
    parts = xp.moveaxis(xp.tensordot(rows, moved, 1), 2, 1)  # (rows, steps, n)
    mean, slope, further = xp.split(parts, [len(on_mean), 2 * len(on_mean)])
    between = xp.diff(slope, axis=2) / xp.diff(strip.x)
    forces = 0.5 * (mean[..., 1:] + mean[..., :-1]) + between
    return xp.moveaxis(further, 0, 2), Strains(*forces)
