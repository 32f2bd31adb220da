"""The parts of a Scene: strip, contact, load and model.

Their defaults are the standard strip (after Brink 2015, chapter III, with chapter IV's squeeze
strain): L = 2, mu = 0.1, F_N = 10, nu = 0.3, E' 2H = 3.4e4, eta = 0.1126, A = 0.7855.  Numbers are
leaves of a pytree, words and counts are static.  Every part checks itself when it is made.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.energy import CONSTANTS
from jbeamshell.errors import InputError
from jbeamshell.friction import CappedTrial, ElasticSlip, FrictionLaw, SharpSlip
from jbeamshell.grid import ORDER
from jbeamshell.kinematics import FIELDS, KINEMATICS

FAR_ENDS = ("held", "pinned", "free")
CONTROLS = ("force", "displacement")
MODELS = (
    ("v",),
    ("v", "beta"),
    ("v", "beta", "psi"),
    ("v", "w", "beta"),
    ("v", "w", "beta", "psi"),
)
STANDARD_AMPLITUDE = 0.7855

NUMBER = "must be a number"
POSITIVE = "must be a positive number"
SMOOTHING = "must be a number above 1, or 'sharp'"
PRESSURE = "give a number or a table of [X, F_N] rows"


def as_leaf(value: Any, key: str = "value", fix: str = NUMBER) -> Array:
    """A floating-point leaf from numbers or nested lists of them; arrays keep their precision."""
    if isinstance(value, jax.Array) and jnp.issubdtype(value.dtype, jnp.floating):
        return value
    require(key, value, _numeric(value), fix)
    traced = any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(value))
    # Plain numbers stay concrete inside jit too, where they must still be checked.
    concrete = contextlib.nullcontext() if traced else jax.ensure_compile_time_eval()
    try:
        with concrete:
            return jnp.asarray(value, dtype=jnp.result_type(float))
    except (ValueError, OverflowError):  # rows of different length; whole numbers beyond any float
        raise InputError(f"{key} = {_shown(value)}: {fix}") from None


def _numeric(value: Any) -> bool:
    """Whether there are only numbers in a value, words and truths being none."""
    if isinstance(value, list | tuple):
        return all(map(_numeric, value))
    if isinstance(value, np.ndarray | np.generic | jax.Array):
        return value.dtype.kind in "fiu"
    return isinstance(value, int | float) and not isinstance(value, bool)


def _leaf(key: str, default: float, fix: str = NUMBER) -> Any:
    convert = functools.partial(as_leaf, key=key, fix=fix)
    return eqx.field(converter=convert, default=default)


def _static(default: Any) -> Any:
    return eqx.field(static=True, default=default)


def require(key: str, value: Any, holds: bool, fix: str) -> None:
    """Raise `InputError` naming the key, the value and the fix unless the condition holds."""
    if not holds:
        raise InputError(f"{key} = {_shown(value)}: {fix}")


def _shown(value: Any) -> str:
    if isinstance(value, jax.Array | np.ndarray):
        value = np.asarray(value).tolist()
    return repr(value)


def require_number(
    key: str, value: Any, fix: str = POSITIVE, low: float = 0.0, high: float = np.inf
) -> None:
    """A single number strictly between low and high; traced values are left to the solver."""
    if isinstance(value, jax.core.Tracer):
        return
    number = np.asarray(value)
    require(key, value, number.ndim == 0, f"give one number, not an array of shape {number.shape}")
    require(key, value, bool(np.isfinite(number) and low < number < high), fix)


def _require_choice(key: str, value: Any, choices: Sequence[Any]) -> None:
    require(key, value, value in choices, "choose " + " or ".join(map(repr, choices)))


class Strip(eqx.Module):
    """Geometry and material of the strip.

    Attributes
    ----------
    length : L
    height_ratio : eta = H/(L/2), with H the HALF height
    axial_stiffness : E' 2H, force per unit width, E' = E/(1-nu^2)
    poisson_ratio : nu
    kappa_s : squeeze-shear factor
    far_end : support at X = 0: "held" (v = beta = 0), "pinned" (v = 0: held at the contact point
        only) or "free"
    """

    length: Array = _leaf("strip.length", 2.0)
    height_ratio: Array = _leaf("strip.height_ratio", 0.1126)
    axial_stiffness: Array = _leaf("strip.axial_stiffness", 3.4e4)
    poisson_ratio: Array = _leaf("strip.poisson_ratio", 0.3)
    kappa_s: Array = _leaf("strip.kappa_s", 0.44)
    far_end: str = _static("held")

    def __check_init__(self) -> None:
        require_number("strip.length", self.length)
        require_number("strip.height_ratio", self.height_ratio, POSITIVE + " (H over L/2)")
        require_number("strip.axial_stiffness", self.axial_stiffness, POSITIVE + " (E' 2H)")
        require_number(
            "strip.poisson_ratio",
            self.poisson_ratio,
            "must lie between -1 and 0.5 (both excluded)",
            -1.0,
            0.5,
        )
        require_number("strip.kappa_s", self.kappa_s, POSITIVE + "; 0.44 fits the squeeze layer")
        _require_choice("strip.far_end", self.far_end, FAR_ENDS)

    @property
    def half_height(self) -> Array:
        """H, length."""
        return 0.5 * self.height_ratio * self.length

    @property
    def plane_modulus(self) -> Array:
        """E' = E/(1-nu^2), stress."""
        return self.axial_stiffness / (2.0 * self.half_height)

    @property
    def youngs_modulus(self) -> Array:
        """E, stress."""
        return self.plane_modulus * (1.0 - self.poisson_ratio**2)

    @property
    def shear_modulus(self) -> Array:
        """G, stress."""
        return 0.5 * (1.0 - self.poisson_ratio) * self.plane_modulus


class Contact(eqx.Module):
    """The rough foundation and what presses the strip onto it.

    Attributes
    ----------
    friction : mu
    pressure : F_N on the top face, stress, positive pressing down: a number, or a table (n, 2) of
        X and F_N, linear in between
    stick_stiffness : alpha; the elastic slip stiffness is k_t = alpha G/H
    law : one contact point's friction law
    """

    friction: Array = _leaf("contact.friction", 0.1)
    pressure: Array = _leaf("contact.pressure", 10.0, PRESSURE)
    stick_stiffness: Array = _leaf("contact.stick_stiffness", 1000.0)
    law: FrictionLaw = eqx.field(default_factory=SharpSlip)

    def __check_init__(self) -> None:
        require_number("contact.friction", self.friction)
        require_number("contact.stick_stiffness", self.stick_stiffness)
        if isinstance(self.law, ElasticSlip | CappedTrial):
            require_number("contact.smoothing", self.law.smoothing, SMOOTHING, low=1.0)
        if not isinstance(self.pressure, jax.core.Tracer):
            self._check_pressure(np.asarray(self.pressure))

    @staticmethod
    def _check_pressure(pressure: np.ndarray) -> None:
        key = "contact.pressure"
        table = pressure.ndim == 2 and pressure.shape[1] == 2 and pressure.shape[0] >= 2
        require(key, pressure, pressure.ndim == 0 or table, PRESSURE)
        values = pressure[:, 1] if table else pressure
        require(
            key,
            pressure,
            bool(np.all(np.isfinite(pressure)) and np.all(values >= 0.0) and np.any(values > 0.0)),
            "must press the strip down: finite, nowhere negative, somewhere positive",
        )
        if table:
            order = bool(np.all(np.diff(pressure[:, 0]) > 0.0))
            require(key, pressure, order, "its X must increase from row to row")

    @property
    def smoothing(self) -> Array:
        """The exponent m of the friction law; infinity for the sharp slider."""
        return getattr(self.law, "smoothing", jnp.asarray(np.inf))

    def pressure_at(self, x: Array) -> Array:
        """F_N at the positions x; a table continues with its end values."""
        if self.pressure.ndim == 0:
            return jnp.broadcast_to(self.pressure, x.shape)
        return jnp.interp(x, self.pressure[:, 0], self.pressure[:, 1])


class Load(eqx.Module):
    """What is done to the loaded end X = L after the pressure.

    Attributes
    ----------
    control : "force" (F, force per unit width) or "displacement" (u(L), mid-height face average)
    amplitude : A, of the controlled quantity; no default under displacement control
    cycles : full cycles A, -A, A after the first loading 0 to A
    steps_per_half_cycle : equal load steps from -A to A
    """

    control: str = eqx.field(static=True)
    amplitude: Array
    cycles: int = eqx.field(static=True)
    steps_per_half_cycle: int = eqx.field(static=True)

    def __init__(
        self,
        control: str = "force",
        amplitude: Any = None,
        cycles: int = 2,
        steps_per_half_cycle: int = 40,
    ) -> None:
        _require_choice("load.control", control, CONTROLS)
        if amplitude is None:
            require(
                "load.amplitude",
                None,
                control == "force",
                "give the end displacement's amplitude under displacement control",
            )
            amplitude = STANDARD_AMPLITUDE
        self.control = control
        self.amplitude = as_leaf(amplitude, "load.amplitude")
        self.cycles = cycles
        self.steps_per_half_cycle = steps_per_half_cycle

    def __check_init__(self) -> None:
        require_number("load.amplitude", self.amplitude)
        _require_count("load.cycles", self.cycles, 1)
        _require_count("load.steps_per_half_cycle", self.steps_per_half_cycle, 2)
        require(
            "load.steps_per_half_cycle",
            self.steps_per_half_cycle,
            self.steps_per_half_cycle % 2 == 0,
            "must be even, so that the path passes through zero",
        )

    def unit_path(self) -> np.ndarray:
        """Load levels after zero for unit amplitude: 0 to 1, then ``cycles`` times 1, -1, 1."""
        half = self.steps_per_half_cycle
        down = 1.0 - 2.0 * np.arange(1, half + 1) / half
        first = np.arange(1, half // 2 + 1) / (half // 2)
        return np.concatenate([first, *[down, -down] * self.cycles])


def _require_count(key: str, value: Any, low: int, high: int = 10**6) -> None:
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    require(key, value, whole and low <= value <= high, f"must be a whole number, {low} to {high}")


class Model(eqx.Module):
    """How much of the strip is modelled, and how finely.

    Attributes
    ----------
    fields : active section fields: ("v",) the bar, ("v", "beta") chapter III,
        ("v", "beta", "psi") with the squeeze strain
    kinematics : "exact" or "linear"
    grid : "finite-difference" (second order) or "collocation" (fourth)
    nodes : nodes along X
    constants : "consistent" or "printed" (the dissertation's own)
    """

    fields: tuple[str, ...] = eqx.field(static=True, default=("v", "beta", "psi"), converter=tuple)
    kinematics: str = _static("exact")
    grid: str = _static("finite-difference")
    nodes: int = _static(161)
    constants: str = _static("consistent")

    def __check_init__(self) -> None:
        unknown = [f for f in self.fields if f not in FIELDS]
        require("model.fields", list(self.fields), not unknown, f"fields are {', '.join(FIELDS)}")
        require(
            "model.fields",
            list(self.fields),
            self.fields in MODELS,
            "make no model; choose " + " or ".join(str(list(m)) for m in MODELS),
        )
        _require_choice("model.kinematics", self.kinematics, tuple(KINEMATICS))
        _require_choice("model.grid", self.grid, tuple(ORDER))
        _require_choice("model.constants", self.constants, CONSTANTS)
        _require_count("model.nodes", self.nodes, 3)
        require(
            "model.nodes",
            self.nodes,
            (self.nodes - 1) % ORDER[self.grid] == 0,
            "must be odd for the collocation grid (two elements' ends and their middle)",
        )

    @property
    def active(self) -> tuple[int, ...]:
        """Positions of the active fields among (v, w, beta, psi)."""
        return tuple(FIELDS.index(f) for f in self.fields)
