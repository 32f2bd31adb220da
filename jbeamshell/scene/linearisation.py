"""Error of linear kinematics: a bound that needs no solution."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from jbeamshell.mechanics.bar import bar_force
from jbeamshell.mechanics.homogeneous import Energy, shear_modulus
from jbeamshell.scene.domain import Numbers
from jbeamshell.scene.parts import Contact, Load, Member, Model, Strip
from jbeamshell.scene.plan import Plan
from jbeamshell.scene.pressure import is_table

# Constants of `bound`, fitted by verification/map_kinematics.py to map_kinematics.json beside it.
BEAMSHELL = (3.2, 3.6, 3.6, 0.5, 0.0, 3.0)
ELASTICITY = (14.0, 2.7, 3.5, 1.7, 1.7, 3.0)


def bound(
    pressed: ArrayLike,
    slip: ArrayLike,
    friction: ArrayLike,
    softness: ArrayLike,
    constants: Sequence[float] | np.ndarray = BEAMSHELL,
) -> np.ndarray:
    """Bound of `linear_error` from ratios of the strip.

    Parameters
    ----------
    pressed : F_N/E'
    slip : slip length over H
    friction : Coulomb friction coefficient mu
    softness : E'/(2G)
    constants : `BEAMSHELL` or `ELASTICITY`

    Returns
    -------
    relative error, of the shape that the ratios broadcast to
    """
    near, reach, power, far, stretch, growth = constants
    p, x, soft = np.asarray(pressed), np.asarray(slip), np.asarray(softness)
    corner = near / (1.0 + (x / (reach * soft)) ** power)
    return p * (1.0 + growth * p) * (corner + far * np.asarray(friction) + stretch * (soft - 1.0))


class Parts(Protocol):
    """Parts of a `jbeamshell.Scene` that bounds are found from."""

    strip: Strip
    contact: Contact
    load: Load
    model: Model
    energy: Energy | None
    member: Member
    plan: Plan

    def number(self, key: str) -> np.ndarray: ...


def linear_error(scene: Parts) -> float:
    """Largest relative error of a strip's loop that linear kinematics make; see `linear_errors`.

    Parameters
    ----------
    scene : scene with a foundation and without traced leaves
    """
    return float(linear_errors(scene.strip, scene.load, scene.plan.elastic, scene.number))


@np.errstate(divide="ignore", invalid="ignore")
def linear_errors(strip: Strip, load: Load, elastic: bool, numbers: Numbers) -> np.ndarray:
    """Largest relative errors of loops that linear kinematics make, for one scene or for a sweep.

    They bound the error of the dissipation per cycle and of the secant stiffness.  The error grows
    with the strain p = F_N/E' of the pressure, not with that of the load, and is largest if the
    slip length s of the bar is a few H.  With x = 2 s G/(H E'),

        error <= p (1 + 3 p) (3.2/(1 + (x/3.6)^3.6) + 0.5 mu).

    Plane elasticity has other constants.  They were fitted to displacements of third order through
    the height, of St. Venant and Kirchhoff's material.  The bound was measured for loads up to
    E' 2H/10 and pressures up to E'/3 (verification/map_kinematics.json).  Beyond, and for a strip
    that is curved or on a compliant foundation, it is a guess.

    Parameters
    ----------
    strip, load : parts of the scene, for their words
    elastic : True for plane elasticity
    numbers : values by dotted key

    Returns
    -------
    relative error, 0.01 for 1 %, of the shape that the numbers broadcast to
    """
    stiffness = stretching(strip, numbers)
    length, height = numbers("strip.length"), numbers("strip.half_height")
    amplitude, pressure = numbers("load.amplitude"), numbers("contact.pressure")
    pressure = np.max(pressure[:, 1]) if is_table(pressure) else pressure
    with np.errstate(over="ignore"):  # then nothing slips
        limit = numbers("contact.friction") * pressure
    force = pull(load, amplitude)
    if load.control == "displacement":
        force = bar_force(amplitude, stiffness, limit)
    slip = np.where(limit > 0.0, np.minimum(length, force / limit), length)  # else all of it slips
    if strip.layers is not None:
        softness = np.asarray(strip.plane_modulus / (2.0 * strip.shear_modulus))
    else:
        softness = 0.5 / shear_modulus(1.0, numbers("strip.poisson_ratio"), strip.plane)
    strain = 2.0 * height * pressure / stiffness
    constants = ELASTICITY if elastic else BEAMSHELL
    return bound(strain, slip / height, limit / pressure, softness, constants)


def pull(load: Load, amplitude: np.ndarray) -> np.ndarray:
    """Largest force along X under an amplitude of the load: a moment has none."""
    return amplitude if load.kind == "force" else 0.0 * amplitude


def stretching(strip: Strip, numbers: Numbers) -> np.ndarray:
    """Stretching stiffness E' 2H, force per unit width."""
    if strip.layers is not None:
        return np.asarray(strip.stretching_stiffness)
    return numbers("strip.axial_stiffness")
