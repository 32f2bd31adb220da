"""Whether linear kinematics will do: a bound on what they change, without solving anything."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from jbeamshell.scene.scene import Scene

# Of `bound`, fitted by calibration/map_kinematics.py to map_kinematics.json beside it.
BEAMSHELL = (3.2, 3.6, 3.6, 0.5, 0.0, 3.0)
SECTIONS = (14.0, 2.7, 3.5, 1.7, 1.7, 3.0)


def bound(
    pressed: ArrayLike,
    slip: ArrayLike,
    friction: ArrayLike,
    softness: ArrayLike,
    constants: Sequence[float] | np.ndarray = BEAMSHELL,
) -> np.ndarray:
    """Bound of `linear_error` from F_N/E', the slip length over H, mu, and E'/(2G)."""
    near, reach, power, far, stretch, growth = constants
    p, x, soft = np.asarray(pressed), np.asarray(slip), np.asarray(softness)
    corner = near / (1.0 + (x / (reach * soft)) ** power)
    return p * (1.0 + growth * p) * (corner + far * np.asarray(friction) + stretch * (soft - 1.0))


def linear_error(scene: Scene) -> float:
    """How much linear kinematics change a strip's loop, at most.

    Bounds the relative difference that they make to the dissipation per cycle and to the secant
    stiffness.  It goes with the strain p = F_N/E' of the pressure, whatever the load's own is, and
    is largest where the slip length s of the bar is a few H: with x = 2 s G/(H E'),

        p (1 + 3 p) (3.2/(1 + (x/3.6)^3.6) + 0.5 mu).

    Sections of order p have other constants, and stretch St. Venant and Kirchhoff's material.
    Measured for loads up to E' 2H/10 and pressures up to E'/3 (calibration/map_kinematics.json);
    beyond, and for a strip that is curved or on a compliant foundation, it is a guess.

    Parameters
    ----------
    scene : with a foundation, and without traced leaves
    """
    strip, contact, load = scene.strip, scene.contact, scene.load
    stiffness, pressure = float(strip.stretching_stiffness), float(contact.largest_pressure)
    slip, height = float(strip.length), float(strip.half_height)
    rub, amplitude = float(contact.friction) * pressure, float(load.amplitude)
    if rub > 0.0:  # else the whole strip slips
        displaced = load.control == "displacement"
        force = math.sqrt(2.0 * stiffness * rub * amplitude) if displaced else amplitude
        slip = min(slip, force / rub)
    softness = float(strip.plane_modulus / (2.0 * strip.shear_modulus))
    pressed = 2.0 * height * pressure / stiffness
    constants = SECTIONS if scene.model.order > 0 else BEAMSHELL
    return float(bound(pressed, slip / height, rub / pressure, softness, constants))
