"""Nonlinear modes of structures with joints: frequency and damping over amplitude."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require_count
from jbeamshell.common.errors import UnconvergedError, warn_of_doubts
from jbeamshell.common.progress import patience
from jbeamshell.dynamics.structure.matrices import Structure
from jbeamshell.dynamics.vibration import setup
from jbeamshell.dynamics.vibration.balance import Point, Rows, marched, polished
from jbeamshell.dynamics.vibration.reduction import Reduced, reduced
from jbeamshell.dynamics.vibration.results import NonlinearMode

SLIGHT = 1e-3  # part of the first amplitude, at which a mode is nearly linear


@patience("following the mode")
def nonlinear_mode(
    structure: Structure,
    amplitudes: ArrayLike,
    mode: int = 0,
    *,
    harmonics: int = setup.HARMONICS,
    samples: int | None = None,
) -> NonlinearMode:
    r"""Frequency and damping of a mode over its amplitude, by harmonic balance.

    A negative damping -2 zeta omega M holds the free vibration at an amplitude (extended periodic
    motion, Krack 2015); zeta is the damping ratio of joints and structure.  Near an isolated
    resonance it is the backbone on which a force is a quarter of a cycle ahead of the displacement.
    Numbers of matrices, joints and amplitudes may be traced; motions that are not found then hold
    NaN.

    Parameters
    ----------
    structure : structure with its joints
    amplitudes : (k,) rising modal displacements q of the first harmonic
    mode : number of the mode, counted from 0
    harmonics : highest harmonic; odd ones up to it are balanced
    samples : of a cycle; None is 16 for a period of the highest harmonic, 128 at least

    Raises
    ------
    InputError
        for amplitudes that are not positive and rising, a mode that does not exist, an even number
        of harmonics, or amplitudes that move a joint of a strip beyond its backbone
    UnconvergedError
        if no motion is found at an amplitude

    Warns
    -----
    DoubtfulWarning
        if the next harmonic moves the joints by more than a thousandth of the first, or may make an
        error of a quarter of a per cent

    Examples
    --------
    >>> joint = Joint(displacements=[1.0, 3.0], forces=[1.0, 2.0])
    >>> structure = Structure([[1.0]], [[0.0]], [Attachment(joint, 0)])
    >>> nonlinear_mode(structure, [0.5, 2.0]).frequency.round(2).tolist()
    [0.16, 0.14]
    """
    amplitude = setup.checked_rising("amplitudes", amplitudes, setup.AMPLITUDES)
    require_count("mode", mode, 0, structure.size - 1)
    balance = setup.checked_balance(harmonics, samples)
    traced = structure.traced or is_traced(amplitude)
    xp: Any = jnp if traced else np
    with setup.precise(traced):
        model, basis = reduced(structure, np.zeros(structure.size), mode)
        target = jnp.asarray(amplitude)
        start, rows = _linear(structure, model, basis, mode, len(balance.harmonics))
        fixed, held, still = lax.stop_gradient((model, rows, target))
        small = SLIGHT * still[0]
        begin = lax.stop_gradient(Point(small * start.x, start.p))
        found = marched(fixed, balance, begin, held, still, small)
        if traced:
            found = polished(model, balance, found, rows, target)
        found = jax.tree.map(xp.asarray, found)
        columns = setup.columns(model, balance, found, basis, xp)
        good = found.converged
        if traced:
            good = good & structure.knows(columns["joints"], "")
        omega = xp.where(good, found.point.p[:, 0], xp.nan)
        result = NonlinearMode(
            amplitude=amplitude,
            frequency=omega / (2.0 * np.pi),
            damping=found.point.p[:, 2] / (2.0 * omega),
            **columns,
        )
    if traced:
        return result
    if not np.all(good):
        lost_at = float(amplitude[int(np.argmin(good))])
        raise UnconvergedError(
            f"no motion is found at the modal displacement {lost_at:.6g}: give more amplitudes "
            "below it, or fewer harmonics"
        )
    structure.knows(result.joints, f"the modal displacement {float(amplitude[-1]):.6g}")
    warn_of_doubts(result.doubts)
    return result


def _linear(
    structure: Structure, model: Reduced, basis: Any, mode: int, count: int
) -> tuple[Point, Rows]:
    """Linear mode of unit amplitude, and the conditions of free vibration at an amplitude."""
    modes = structure.modes(mode + 1)
    momentum = jnp.asarray(basis.T @ (structure.mass @ modes.shapes[:, mode]))
    shape = jnp.linalg.solve(model.mass, momentum)
    first = jnp.zeros((count, shape.size)).at[0]
    own = shape @ model.damping @ shape
    start = Point(
        first.set(shape) + 0j, jnp.stack([jnp.asarray(modes.omega[mode]), 0.0 * own, own])
    )
    measure = first.set(momentum)
    no_force = jnp.zeros((3, 3)).at[0, 1].set(1.0)
    return start, Rows(
        jnp.stack([0j * measure, 1j * measure, measure + 0j]), no_force, jnp.zeros(3)
    )
