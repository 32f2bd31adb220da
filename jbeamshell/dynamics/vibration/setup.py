"""Input of harmonic balance, checked, and energies and largest displacements of its result."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jbeamshell.common.checks import (
    as_leaf,
    is_staged,
    is_traced,
    require,
    require_count,
)
from jbeamshell.dynamics.structure.matrices import Structure
from jbeamshell.dynamics.vibration.balance import Balance, Found, left_out
from jbeamshell.dynamics.vibration.reduction import Reduced
from jbeamshell.dynamics.vibration.results import over_a_cycle

HARMONICS = 9  # highest one, unless told otherwise
PER_HARMONIC = 16  # samples of a period of the highest harmonic
FEWEST = 128  # samples of a cycle
RANGE = "give two different positive frequencies, (from, to), in cycles per time"
AMPLITUDES = "give positive modal displacements that rise"


def precise(traced: bool) -> Any:
    """Context of double precision; within a transformation the precision stays as it is."""
    plain = traced or is_staged()
    return contextlib.nullcontext() if plain else jax.enable_x64(True)


def checked_balance(harmonics: Any, samples: Any) -> Balance:
    """Odd harmonics up to the highest one, and samples of a cycle; raises `InputError`."""
    require_count("harmonics", harmonics, 1, 99)
    odd = harmonics % 2 == 1
    require("harmonics", harmonics, odd, "must be odd: joints have no even ones")
    if samples is None:
        samples = max(FEWEST, PER_HARMONIC * harmonics)
    require_count("samples", samples, 4 * harmonics + 4)
    require("samples", samples, samples % 2 == 0, "must be even")
    return Balance(tuple(range(1, harmonics + 1, 2)), int(samples))


def checked_force(structure: Structure, force: Any) -> Any:
    """Forces (n,); raises `InputError`."""
    known = as_leaf(force, "force", f"give {structure.size} numbers")
    fix = f"give {structure.size} numbers, one for each degree of freedom"
    require("force", known.shape, known.shape == (structure.size,), fix)
    if is_traced(known):
        return known
    values = np.asarray(known, float)
    moves = bool(np.all(np.isfinite(values)) and np.any(values))
    require("force", values, moves, "must hold finite numbers, not all of them zero")
    return values


def checked_place(structure: Structure, place: Any, force: Any) -> int:
    """Degree of freedom of the result; None is that of the largest force."""
    if place is None:
        fix = "name the degree of freedom of the result, as the force is traced"
        require("place", place, not is_traced(force), fix)
        return int(np.argmax(np.abs(force)))
    require_count("place", place, 0, structure.size - 1)
    return int(place)


def checked_pair(key: str, pair: Any, fix: str) -> tuple[float, float]:
    """Two different positive numbers; raises `InputError`."""
    values = np.asarray(as_leaf(pair, key, fix), float)
    good = values.shape == (2,) and bool(np.all(np.isfinite(values) & (values > 0.0)))
    require(key, pair, good and values[0] != values[1], fix)
    return float(values[0]), float(values[1])


def checked_rising(key: str, values: Any, fix: str, rising: bool = True) -> Any:
    """Positive numbers (k,), rising if asked; raises `InputError`."""
    known = jnp.atleast_1d(as_leaf(values, key, fix))
    require(key, known.shape, known.ndim == 1 and known.size > 0, fix)
    if is_traced(known):
        return known
    numbers = np.asarray(known, float)
    good = bool(np.all(np.isfinite(numbers) & (numbers > 0.0)))
    require(key, numbers, good and (not rising or bool(np.all(np.diff(numbers) > 0.0))), fix)
    return numbers


def joint_peaks(motion: Any, directions: Any, harmonics: Sequence[int], xp: Any = np) -> Any:
    """Largest displacements (k, J) of the elements in motions (k, H, r)."""
    return abs(over_a_cycle(motion @ directions, np.array(harmonics), xp)).max(axis=1)


def columns(model: Reduced, balance: Balance, found: Found, basis: Any, xp: Any) -> dict[str, Any]:
    """Columns that all results of harmonic balance have, from solutions (k, ...).

    ``xp`` is NumPy, or JAX for traced numbers.
    """
    motion, omega, directions = found.point.x, found.point.p[:, 0], xp.asarray(model.directions)
    u, number = motion @ directions, np.array(balance.harmonics)
    lost = xp.imag(found.lost[:, :-1] * xp.conj(u)) * number[:, None]
    dissipation = np.pi * xp.sum(lost, axis=(-2, -1))
    truncation = xp.asarray(left_out(model, balance, omega, u, found.lost))
    # What is left out acts on the first harmonic, whose elastic forces balance but for the driving
    # force or, of a mode, the damping.
    first = motion[:, 0]
    mass, damping, drive = (xp.asarray(a) for a in (model.mass, model.damping, model.drive))
    viscous, elastic = (
        xp.real(xp.sum(xp.conj(first) * (first @ matrix), axis=-1)) * omega**power
        for matrix, power in ((damping, 1), (mass, 2))
    )
    held = xp.maximum(xp.abs(first @ drive), dissipation / np.pi + viscous)
    return {
        "harmonics": number,
        "coefficients": motion,
        "basis": basis,
        "joints": joint_peaks(motion, directions, balance.harmonics, xp),
        "dissipation": dissipation,
        "truncation": truncation,
        "truncation_error": truncation * elastic / xp.where(held > 0.0, held, elastic),
    }
