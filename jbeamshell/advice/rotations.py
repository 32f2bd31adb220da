"""Whether linear kinematics will do: a bound on what they change, without solving anything."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jbeamshell.scene import Scene


class Constants(NamedTuple):
    """Of `bound`; the fit is calibration/map_kinematics.py, the record its JSON."""

    corner: float = 4.0
    reach: float = 1.5
    power: float = 3.0
    friction: float = 0.5
    growth: float = 1.0


def bound(
    strain: ArrayLike,
    slip_length: ArrayLike,
    friction: ArrayLike,
    softness: ArrayLike,
    constants: Constants = Constants(),  # noqa: B008 - immutable
) -> np.ndarray:
    """Bound on the relative difference; `linear_error` says of what."""
    c, strain = constants, np.asarray(strain)
    corner = c.corner / (1.0 + (slip_length / (c.reach * np.asarray(softness))) ** c.power)
    return strain * (1.0 + c.growth * strain) * (corner + c.friction * np.asarray(friction))


def linear_error(scene: Scene) -> float:
    strip, contact = scene.strip, scene.contact
    return 0.0
