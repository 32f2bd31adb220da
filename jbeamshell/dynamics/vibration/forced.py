"""Forced responses of structures with joints over the frequency of a force."""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced
from jbeamshell.common.errors import UnconvergedError, warn_of_doubts
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.progress import patience
from jbeamshell.dynamics.structure.matrices import Structure
from jbeamshell.dynamics.vibration import setup
from jbeamshell.dynamics.vibration.balance import (
    Balance,
    Found,
    Point,
    Rows,
    dynamic_stiffness,
    marched,
    polished,
)
from jbeamshell.dynamics.vibration.continuation import ORDER, follow
from jbeamshell.dynamics.vibration.reduction import Reduced, reduced
from jbeamshell.dynamics.vibration.results import ForcedResponse

TURN = 2.0 * np.pi
SLIGHT = 1e-3  # part of a force at which a structure is nearly elastic
NOT_FOUND = "no steady response is found at the frequency {:.6g}"


@patience("following the response")
def forced_response(
    structure: Structure,
    force: ArrayLike,
    frequencies: tuple[float, float],
    *,
    place: int | None = None,
    harmonics: int = setup.HARMONICS,
    samples: int | None = None,
) -> ForcedResponse:
    """Steady response to a force cos(omega t) over its frequency, in steps that show its peaks.

    Parameters
    ----------
    structure : structure with its joints
    force : (n,) amplitudes of the force on the degrees of freedom
    frequencies : cycles per time from which and to which the response is followed
    place : degree of freedom of ``amplitude`` and ``phase``; None is that of the largest force
    harmonics : highest harmonic; odd ones up to it are balanced
    samples : of a cycle; None is 16 for a period of the highest harmonic, 128 at least

    Raises
    ------
    InputError
        for a force of another size than n, frequencies that are not positive, an even number of
        harmonics, a place that does not exist, or a force that moves a joint of a strip beyond its
        backbone
    UnconvergedError
        if no response is found where it begins, or from some frequency on

    Warns
    -----
    DoubtfulWarning
        if the next harmonic moves the joints by more than a thousandth of the first, or may make an
        error of a quarter of a per cent

    Notes
    -----
    Joints of sliders have one steady motion under each load, and it is stable, so that no curve
    folds; see `jbeamshell.dynamics.vibration.continuation`.

    Examples
    --------
    >>> u = np.linspace(0.25, 3.0, 12)
    >>> joint = Joint(displacements=u, forces=2.0 * np.tanh(u / 2.0))
    >>> structure = Structure([[1.0]], [[1.0]], [Attachment(joint, 0)], damping=[[0.02]])
    >>> response = forced_response(structure, [0.3], (0.13, 0.32))
    >>> bool(response.amplitude.max() > 1.0)
    True
    """
    first, last = setup.checked_pair("frequencies", frequencies, setup.RANGE)
    balance = setup.checked_balance(harmonics, samples)
    force = setup.checked_force(structure, force)
    place = setup.checked_place(structure, place, force)
    with setup.precise(traced=False):
        model, basis = reduced(structure, force)
        directions = np.asarray(model.directions)

        def check(found: Found) -> None:
            peaks = setup.joint_peaks(found.point.x[None], directions, balance.harmonics)
            structure.knows(peaks, f"the force at the frequency {found.point.p[0] / TURN:.6g}")

        begin, end = _slight(model, balance, TURN * first, 1.0), TURN * last
        points = follow(model, balance, begin, end, check)
        if not points:  # far from elastic
            grown = _steady(model, balance, jnp.array([TURN * first]), False).point
            begin = jax.tree.map(lambda a: np.asarray(a[0]), grown)
            points = follow(model, balance, begin, end, check)
        if not points:
            where = NOT_FOUND.format(first)
            raise UnconvergedError(f"{where}, where the curve begins: begin farther from resonance")
        found: Found = jax.tree.map(lambda *rows: np.stack(rows), *points)
        columns = setup.columns(model, balance, found, basis, np)
        response = ForcedResponse(frequency=found.point.p[:, 0] / TURN, place=place, **columns)
    warn_of_doubts(response.doubts)
    return response


def steady_response(
    structure: Structure,
    force: ArrayLike,
    frequencies: ArrayLike,
    *,
    place: int | None = None,
    harmonics: int = setup.HARMONICS,
    samples: int | None = None,
) -> ForcedResponse:
    """Steady responses at given frequencies, with derivatives to all numbers.

    Each is found from a small force on.  Numbers of matrices, joints, force and frequencies may be
    traced; motions that are not found then hold NaN.

    Parameters
    ----------
    frequencies : (k,) cycles per time
    structure, force, place, harmonics, samples : see `forced_response`

    Raises
    ------
    InputError
        as `forced_response` does
    UnconvergedError
        if a response is not found
    """
    frequency = setup.checked_rising("frequencies", frequencies, setup.RANGE, rising=False)
    balance = setup.checked_balance(harmonics, samples)
    force = setup.checked_force(structure, force)
    place = setup.checked_place(structure, place, force)
    traced = structure.traced or is_traced(force, frequency)
    with setup.precise(traced):
        model, basis = reduced(structure, force)
        found = _steady(model, balance, TURN * jnp.asarray(frequency), traced)
        if not traced:
            found = jax.tree.map(np.asarray, found)
        columns = setup.columns(model, balance, found, basis, jnp if traced else np)
        response = ForcedResponse(frequency=frequency, place=place, **columns)
    if traced:
        sound = found.converged & structure.knows(response.joints, "")
        return response.but(coefficients=nan_unless(sound, response.coefficients))
    if not np.all(found.converged):
        raise UnconvergedError(NOT_FOUND.format(frequency[int(np.argmin(found.converged))]))
    structure.knows(response.joints, "the force")
    warn_of_doubts(response.doubts)
    return response


@partial(jax.jit, static_argnums=(1, 3))
def _steady(model: Reduced, balance: Balance, omegas: Array, differentiable: bool) -> Found:
    """Solutions (k, ...) at angular frequencies (k,) under the whole force."""
    number = jnp.eye(3)[jnp.array([ORDER[0], ORDER[2], ORDER[1]])]
    whole, fixed = jnp.ones(1), lax.stop_gradient(model)

    def one(omega: Array) -> Found:
        held = lax.stop_gradient(omega)
        start = _slight(fixed, balance, held, jnp.asarray(SLIGHT))
        none = jnp.zeros((3, *start.x.shape)) + 0j
        rows = Rows(none, number, jnp.stack([0.0 * held, held, 1.0]))
        found = marched(fixed, balance, start, rows, whole, SLIGHT)
        if differentiable:
            rows = rows._replace(target=jnp.stack([0.0 * omega, omega, 1.0]))
            found = polished(model, balance, found, rows, whole)
        return jax.tree.map(lambda a: a[0], found)

    return lax.map(one, omegas)


@partial(jax.jit, static_argnums=1)
def _slight(model: Reduced, balance: Balance, omega: Any, level: Any) -> Point:
    """Elastic response at a level of the force, slightly damped at the joints."""
    shift = (model.directions * (SLIGHT * model.elements.stiffness)) @ model.directions.T
    matrix = dynamic_stiffness(model, omega, jnp.zeros(()), (1,))[0] + 1j * shift
    first = jnp.linalg.solve(matrix, level * model.drive + 0j)
    x = jnp.zeros((len(balance.harmonics), first.size), first.dtype).at[0].set(first)
    return Point(x, jnp.stack([jnp.asarray(omega), jnp.asarray(level), jnp.zeros(())]))
