"""Forced responses of structures with joints: curves over frequency and over force."""

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
from jbeamshell.dynamics.structure.matrices import Structure
from jbeamshell.dynamics.vibration import setup
from jbeamshell.dynamics.vibration.balance import (
    Balance,
    Found,
    Point,
    Rows,
    dynamic_stiffness,
    left_out,
    marched,
    polished,
)
from jbeamshell.dynamics.vibration.continuation import (
    EXCITATION,
    LEVEL,
    MOST_POINTS,
    OMEGA,
    Curve,
    follow,
)
from jbeamshell.dynamics.vibration.reduction import Reduced, reduced
from jbeamshell.dynamics.vibration.results import (
    ForcedResponse,
    StalledContinuationError,
    SteadyResponse,
    over_a_cycle,
)

TURN = 2.0 * np.pi
SLIGHT = 1e-3  # part of a force at which a structure is nearly elastic


def forced_response(
    structure: Structure,
    force: ArrayLike,
    frequencies: tuple[float, float],
    *,
    place: int | None = None,
    harmonics: int = setup.HARMONICS,
    samples: int | None = None,
    most_points: int = MOST_POINTS,
) -> ForcedResponse:
    """Steady response to a force cos(omega t) over its frequency.

    Parameters
    ----------
    structure : structure with its joints
    force : (n,) amplitudes of the force on the degrees of freedom
    frequencies : cycles per time from which and to which the curve is followed
    place : degree of freedom of ``amplitude`` and ``phase``; None is that of the largest force
    harmonics : highest harmonic; odd ones up to it are balanced
    samples : of a cycle; None is 16 for a period of the highest harmonic, 128 at least
    most_points : largest number of points

    Raises
    ------
    InputError
        for a force of another size than n, frequencies that are not positive, an even number of
        harmonics, a place that does not exist, or a force that moves a joint of a strip beyond its
        backbone
    StalledContinuationError
        if the curve ends before the range; it carries the part that was found

    Warns
    -----
    DoubtfulWarning
        if the next harmonic moves the joints by more than a thousandth of the first

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
    setting = (place, harmonics, samples, most_points)
    return _followed(structure, force, (TURN * first, 1.0), OMEGA, TURN * last, setting)


def level_response(
    structure: Structure,
    force: ArrayLike,
    frequency: float,
    levels: tuple[float, float],
    *,
    place: int | None = None,
    harmonics: int = setup.HARMONICS,
    samples: int | None = None,
    most_points: int = MOST_POINTS,
) -> ForcedResponse:
    """Steady response at one frequency over the level of the force.

    Parameters
    ----------
    frequency : of the force, cycles per time
    levels : factors of ``force`` from which and to which the curve is followed
    structure, force, place, harmonics, samples, most_points : see `forced_response`, also for
        errors and doubts
    """
    setup.check_frequency(frequency)
    first, last = setup.checked_pair("levels", levels, setup.LEVELS)
    setting = (place, harmonics, samples, most_points)
    return _followed(structure, force, (TURN * frequency, first), LEVEL, last, setting)


def steady_response(
    structure: Structure,
    force: ArrayLike,
    frequencies: ArrayLike,
    *,
    place: int | None = None,
    harmonics: int = setup.HARMONICS,
    samples: int | None = None,
) -> SteadyResponse:
    """Steady responses at given frequencies, with derivatives to all numbers.

    Each is found from a small force on; where several exist, it is the one that a growing force
    reaches.  Numbers of matrices, joints, force and frequencies may be traced; motions that are
    not found then hold NaN.

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
    omega = TURN * frequency
    balance = setup.checked_balance(harmonics, samples)
    force = setup.checked_force(structure, force)
    place = setup.checked_place(structure, place, force)
    traced = structure.traced or is_traced(force, omega)
    with setup.precise(traced):
        model, basis = reduced(structure, force)
        found = _steady(model, balance, jnp.asarray(omega), traced)
        good, directions = found.converged, model.directions
        peaks = setup.joint_peaks(found.point.x, directions, balance.harmonics, jnp)
        if traced:
            good = good & structure.knows(peaks, "")
        x = nan_unless(good, found.point.x)
        first = x[:, 0] @ basis[place]
        after = left_out(model, balance, omega, x @ model.directions, found.lost)
        result = SteadyResponse(
            frequency=frequency,
            amplitude=abs(first),
            phase=jnp.angle(first),
            harmonics=np.array(balance.harmonics),
            coefficients=x,
            basis=basis,
            truncation=after,
        )
        if traced:
            return result
        result = jax.tree.map(np.asarray, result)
    if not np.all(found.converged):
        lost = float(frequency[int(np.argmin(found.converged))])
        raise UnconvergedError(f"no steady response is found at the frequency {lost:.6g}")
    structure.knows(peaks, "the force")
    warn_of_doubts(result.doubts)
    return result


@partial(jax.jit, static_argnums=(1, 3))
def _steady(model: Reduced, balance: Balance, omegas: Array, differentiable: bool) -> Found:
    """Solutions (k, ...) at angular frequencies (k,) under the whole force."""
    number = jnp.eye(3)[jnp.array([EXCITATION, OMEGA, LEVEL])]
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
    shift = (model.directions * (SLIGHT * model.laws.stuck)) @ model.directions.T
    matrix = dynamic_stiffness(model, omega, jnp.zeros(()), (1,))[0] + 1j * shift
    first = jnp.linalg.solve(matrix, level * model.drive + 0j)
    x = jnp.zeros((len(balance.harmonics), first.size), first.dtype).at[0].set(first)
    return Point(x, jnp.stack([jnp.asarray(omega), jnp.asarray(level), jnp.zeros(())]))


def _followed(
    structure: Structure,
    force: Any,
    start: tuple[float, float],
    along: int,
    end: float,
    setting: tuple[Any, Any, Any, int],
) -> ForcedResponse:
    """Curve over frequency or level from (omega, level)."""
    balance = setup.checked_balance(*setting[1:3])
    force = setup.checked_force(structure, force)
    place = setup.checked_place(structure, setting[0], force)
    with setup.precise(traced=False):
        model, basis = reduced(structure, force)
        directions = np.asarray(model.directions)

        def check(found: Found) -> None:
            omega, level, _ = found.point.p
            what = f"the force times {level:.4g} at the frequency {omega / TURN:.6g}"
            peaks = setup.joint_peaks(found.point.x[None], directions, balance.harmonics)
            structure.knows(peaks, what)

        omega, level = start
        begin = _slight(model, balance, omega, level)
        curve = follow(model, balance, begin, along, end, check, setting[3])
        if not curve.points:  # far from elastic
            begin = _grown(model, balance, omega, level)
            curve = follow(model, balance, begin, along, end, check, setting[3])
        if not curve.points:
            raise UnconvergedError(
                f"no steady response is found at the frequency {omega / TURN:.6g} and the level "
                f"{level:.6g}, where the curve begins: begin farther from resonance"
            )
        response = _response(model, balance, curve, basis, place)
    if curve.stalled:
        raise StalledContinuationError(
            f"the response ends at the frequency {response.frequency[-1]:.6g}, the level "
            f"{response.level[-1]:.6g} and the amplitude {response.amplitude[-1]:.4g}: "
            f"{curve.stalled}; take another range, more damping or more harmonics",
            response,
        )
    warn_of_doubts(response.doubts, stacklevel=3)
    return response


def _grown(model: Reduced, balance: Balance, omega: float, level: float) -> Point:
    """Response at a level that is reached from small ones."""
    found = _steady(model._replace(drive=level * model.drive), balance, jnp.array([omega]), False)
    x, p = (np.asarray(a[0]) for a in found.point)
    return Point(x, p * np.array([1.0, level, 1.0]))  # type: ignore[arg-type]


def _response(
    model: Reduced, balance: Balance, curve: Curve, basis: Any, place: int
) -> ForcedResponse:
    """Result of a curve."""
    found: Found = jax.tree.map(lambda *rows: np.stack(rows), *curve.points)
    directions = np.asarray(model.directions)
    omega, u = found.point.p[:, OMEGA], found.point.x @ directions
    return ForcedResponse(
        frequency=np.asarray(omega) / TURN,
        level=np.asarray(found.point.p[:, LEVEL]),
        harmonics=np.array(balance.harmonics),
        coefficients=np.asarray(found.point.x),
        basis=np.asarray(basis),
        place=place,
        joints=np.max(np.abs(over_a_cycle(u, balance.harmonics)), axis=1),
        dissipation=np.asarray(setup.dissipation(found, directions, balance.harmonics)),
        truncation=np.asarray(left_out(model, balance, omega, u, found.lost)),
    )
