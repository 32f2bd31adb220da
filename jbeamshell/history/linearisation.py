"""Error of linear kinematics: a bound that needs no solution."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from jbeamshell.mechanics.bar import bar_force
from jbeamshell.scene.scene import Scene

# Constants of `bound`, fitted by calibration/map_kinematics.py to map_kinematics.json beside it.
BEAMSHELL = (3.2, 3.6, 3.6, 0.5, 0.0, 3.0)
SECTIONS = (14.0, 2.7, 3.5, 1.7, 1.7, 3.0)


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
    constants : `BEAMSHELL` or `SECTIONS`

    Returns
    -------
    relative error, of the shape that the ratios broadcast to
    """
    near, reach, power, far, stretch, growth = constants
    p, x, soft = np.asarray(pressed), np.asarray(slip), np.asarray(softness)
    corner = near / (1.0 + (x / (reach * soft)) ** power)
    return p * (1.0 + growth * p) * (corner + far * np.asarray(friction) + stretch * (soft - 1.0))


def linear_error(scene: Scene) -> float:
    """Largest relative error of a strip's loop that linear kinematics make.

    It bounds the error of the dissipation per cycle and of the secant stiffness.  It grows with the
    strain p = F_N/E' of the pressure, not with that of the load, and is largest if the slip length
    s of the bar is a few H.  With x = 2 s G/(H E'),

        error <= p (1 + 3 p) (3.2/(1 + (x/3.6)^3.6) + 0.5 mu).

    Sections of order p have other constants, because their exact material is St. Venant and
    Kirchhoff's.  The bound was measured for loads up to E' 2H/10 and pressures up to E'/3
    (calibration/map_kinematics.json).  Beyond, and for a strip that is curved or on a compliant
    foundation, it is a guess.

    Parameters
    ----------
    scene : scene with a foundation and without traced leaves

    Returns
    -------
    relative error, 0.01 for 1 %
    """
    strip, contact, load = scene.strip, scene.contact, scene.load
    stiffness, pressure = float(strip.stretching_stiffness), float(contact.largest_pressure)
    slip, height = float(strip.length), float(strip.half_height)
    limit, amplitude = float(contact.friction) * pressure, float(load.amplitude)
    if limit > 0.0:  # else the whole strip slips
        displaced = load.control == "displacement"
        force = bar_force(amplitude, stiffness, limit) if displaced else amplitude
        slip = min(slip, force / limit)
    softness = float(strip.plane_modulus / (2.0 * strip.shear_modulus))
    pressed = 2.0 * height * pressure / stiffness
    elastic = scene.model.order > 0 or scene.model.solution == "plane"
    constants = SECTIONS if elastic else BEAMSHELL
    return float(bound(pressed, slip / height, limit / pressure, softness, constants))


def buckling(scene: Scene) -> tuple[float, float]:
    """Compression of the part of a strip beyond its pressure, and the compression that buckles it.

    The latter is Euler's load of a column that the pressed part clamps and whose loaded end is
    free, pi^2 E' (2H)^3/(48 l^2) over its length l (Timoshenko & Gere 1961, section 2.1).

    Parameters
    ----------
    scene : scene without traced leaves

    Returns
    -------
    compression : largest in the scene's cycles, force per unit width; under displacement control
        that of a rigid clamp
    limit : infinite if the pressure reaches the loaded end
    """
    strip, load = scene.strip, scene.load
    table = np.asarray(scene.contact.pressure, dtype=float)
    if table.ndim == 0 or table[-1, 1] > 0.0 or load.cycles == 0:
        return 0.0, float("inf")
    x, pressure = table.T
    beyond = float(strip.length) - float(x[np.flatnonzero(pressure > 0.0)[-1] + 1])
    if beyond <= 0.0:
        return 0.0, float("inf")
    stretching = float(strip.stretching_stiffness)
    bending = stretching * (2.0 * float(strip.half_height)) ** 2 / 12.0
    force = float(load.amplitude) * (1.0 if load.control == "force" else stretching / beyond)
    return force, float(np.pi**2 * bending / (4.0 * beyond**2))
