"""Bolts as people know them: size, property class and torque; their preload and their patch.

Lengths are in mm and forces in N, as standards have them.

A torque M and a preload F go together by friction in the thread and under the head,
F = M / (.159 P + .577 d_2 mu_G + .5 D_Km mu_K), with the pitch P, the pitch diameter d_2 and the
mean diameter of the bearing face D_Km = (d_w + d_h)/2 (Kellermann & Klein 1955; VDI 2230 part 1,
2015, section 5.4.3, for flanks of 60 degrees).

Tightening scatters: the largest preload is the tightening factor alpha_A times the smallest (VDI
2230 part 1, table A8: 1.4 to 1.6 for torque wrenches with friction from tests, 1.6 to 2 with
friction that is estimated).  About their mean F they are 2 F/(1 + alpha_A) and alpha_A times that.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require, require_number, shown
from jbeamshell.common.errors import InputError
from jbeamshell.scene.quantities import quantity

FRICTION = 0.12  # in the thread and under the head, oiled or as delivered
TIGHTENING = 1.6  # alpha_A of a torque wrench
PART_OF_HEAD = 0.75  # hole over head, where only the head is known


class Size(NamedTuple):
    """Size of a metric bolt, in mm.

    Attributes
    ----------
    pitch : coarse one (ISO 262)
    head : least diameter d_w of the bearing face of a hexagon head (ISO 4014)
    hole : medium clearance hole (ISO 273)
    """

    pitch: float
    head: float
    hole: float


SIZES = {
    3: Size(0.5, 4.57, 3.4),
    4: Size(0.7, 5.88, 4.5),
    5: Size(0.8, 6.88, 5.5),
    6: Size(1.0, 8.88, 6.6),
    8: Size(1.25, 11.63, 9.0),
    10: Size(1.5, 14.63, 11.0),
    12: Size(1.75, 16.63, 13.5),
    14: Size(2.0, 19.64, 15.5),
    16: Size(2.0, 22.49, 17.5),
    18: Size(2.5, 25.34, 20.0),
    20: Size(2.5, 28.19, 22.0),
    22: Size(2.5, 31.71, 24.0),
    24: Size(3.0, 33.61, 26.0),
    27: Size(3.0, 38.0, 30.0),
    30: Size(3.5, 42.75, 33.0),
    33: Size(3.5, 46.55, 36.0),
    36: Size(4.0, 51.11, 39.0),
}
# Proof stresses in MPa, up to M16 and beyond (ISO 898-1); of stainless steel R_p0.2 (ISO 3506-1).
PROOF = {
    "4.6": (225.0, 225.0),
    "4.8": (310.0, 310.0),
    "5.6": (280.0, 280.0),
    "5.8": (380.0, 380.0),
    "6.8": (440.0, 440.0),
    "8.8": (580.0, 600.0),
    "10.9": (830.0, 830.0),
    "12.9": (970.0, 970.0),
    **{f"{steel}-50": (210.0, 210.0) for steel in ("A2", "A4")},
    **{f"{steel}-70": (450.0, 450.0) for steel in ("A2", "A4")},
    **{f"{steel}-80": (600.0, 600.0) for steel in ("A2", "A4")},
}
NAME = re.compile(r"M\s*(\d+)(?:\s*x\s*(\d*\.?\d+))?")


@dataclasses.dataclass(frozen=True)
class Bolt:
    """Metric bolt with hexagon head or washer, and how it is tightened.

    One of ``torque``, ``proof`` and ``preload`` says how far.

    Attributes
    ----------
    size : "M3" to "M36", or with a fine pitch, such as "M8x1"
    grade : property class, "4.6" to "12.9", or "A2-70" and the like
    torque : with its unit, such as "25 N m"; or a number, in N m
    proof : preload as a part of the proof load
    force : preload with its unit, such as "8 kN"; or a number, in N
    friction : mu_G = mu_K, in the thread and under the head
    tightening : alpha_A, largest over smallest preload
    head, hole : diameters with their units, or numbers in mm; None is that of the size

    Raises
    ------
    InputError
        for an unknown size or class, a number out of its range, a bolt that is not tightened or in
        two ways, and one that would be loaded beyond its proof load

    Examples
    --------
    >>> bolt = Bolt("M8", "8.8", torque="25 N m")
    >>> round(bolt.preload), [round(force) for force in bolt.interval]
    (19006, [14620, 23392])
    """

    size: str = "M8"
    grade: str = "8.8"
    torque: Any = None
    proof: float | None = None
    force: Any = None
    friction: float = FRICTION
    tightening: float = TIGHTENING
    head: Any = None
    hole: Any = None

    def __post_init__(self) -> None:
        text = NAME.fullmatch(self.size.strip()) if isinstance(self.size, str) else None
        known = text is not None and int(text[1]) in SIZES
        require("bolt", self.size, known, f"give {', '.join(f'M{d}' for d in SIZES)}, or M8x1")
        require("grade", self.grade, self.grade in PROOF, f"choose {', '.join(PROOF)}")
        require_number("friction of bolt", self.friction, low=0.0, high=1.0)
        fix = "is the largest preload over the smallest: give 1, or more, such as 1.6"
        require_number("tightening", self.tightening, fix, low=1.0 - 1e-12)
        fix = "must be below the size of the bolt"
        require("pitch of bolt", self.pitch, 0.0 < self.pitch < 0.5 * self.diameter, fix)
        fix = "must be smaller than the head"
        require("hole", self.holed, 0.0 < self.holed < self.bearing, fix)
        given = [x for x in (self.torque, self.proof, self.force) if x is not None]
        fix = "give one of torque, such as 25 N m, proof, such as 0.75, and a preload"
        require(self.size, given, len(given) == 1, fix)
        if self.proof is not None:
            fix = "must be a part of the proof load, 0 to 1"
            require_number("proof", self.proof, fix, high=1.0 + 1e-9)
        self._check_proof()

    def _check_proof(self) -> None:
        """Refuse a preload beyond the proof load."""
        force, limit = self.preload, self.proof_load
        if force <= limit * (1.0 + 1e-9):
            return
        what = f"loads {self.size} of class {self.grade} to {1e-3 * force:.3g} kN, beyond its "
        what += f"proof load of {1e-3 * limit:.3g} kN"
        if self.torque is not None:
            most = 1e-3 * self._lever * limit
            fix = f"take {most:.3g} N m or less, a larger bolt or a higher class"
            raise InputError(f"torque = {shown(self.torque)}: {what}: {fix}")
        raise InputError(f"preload = {shown(self.force)}: {what}: take less, or a larger bolt")

    @property
    def diameter(self) -> float:
        """Nominal diameter d, mm."""
        return float(self._name[1])

    @property
    def pitch(self) -> float:
        """Pitch P, mm."""
        return float(self._name[2]) if self._name[2] else SIZES[int(self._name[1])].pitch

    @property
    def pitch_diameter(self) -> float:
        """Pitch diameter d_2 = d - 3 sqrt(3) P/8, mm (ISO 724)."""
        return self.diameter - 0.375 * math.sqrt(3.0) * self.pitch

    @property
    def stress_area(self) -> float:
        """Stress area pi/4 ((d_2 + d_3)/2)^2 with d_3 = d - 1.22687 P, mm^2 (ISO 898-1)."""
        core = self.diameter - 1.22687 * self.pitch
        return 0.25 * math.pi * (0.5 * (self.pitch_diameter + core)) ** 2

    @property
    def bearing(self) -> float:
        """Diameter d_w of the bearing face, mm."""
        return _length("head", self.head, SIZES[int(self._name[1])].head)

    @property
    def holed(self) -> float:
        """Diameter d_h of the hole, mm."""
        return _length("hole", self.hole, SIZES[int(self._name[1])].hole)

    @property
    def proof_load(self) -> float:
        """Proof load, N."""
        return PROOF[self.grade][int(self.diameter > 16.0)] * self.stress_area

    @property
    def preload(self) -> float:
        """Preload F in the mean, N."""
        if self.proof is not None:
            return self.proof * self.proof_load
        if self.force is not None:
            return _of_unit("preload", self.force, "N", "8kN")
        return 1e3 * _of_unit("torque", self.torque, "N m", "25 N m") / self._lever

    @property
    def scatter(self) -> float:
        """Half the range of the preload over its mean, (alpha_A - 1)/(alpha_A + 1)."""
        return (self.tightening - 1.0) / (self.tightening + 1.0)

    @property
    def interval(self) -> tuple[float, float]:
        """Smallest and largest preload, N."""
        return self.preload * (1.0 - self.scatter), self.preload * (1.0 + self.scatter)

    @property
    def patch(self) -> float:
        """Width of the patch of pressure of a plane model, mm; see `patch_width`."""
        return patch_width(self.bearing, self.holed)

    def rows(self, places: Sequence[float], unit: str = "mm") -> NDArray[np.float64]:
        """Rows [X, force, width] of such bolts, for ``contact.bolts`` of a scene with a width.

        Parameters
        ----------
        places : (k,) positions X in the unit
        unit : of the scene's lengths, "mm" or "m"; forces are in N

        Examples
        --------
        >>> Bolt("M8", torque="25 N m").rows([30.0, 70.0]).round(1).tolist()
        [[30.0, 19006.3, 14.7], [70.0, 19006.3, 14.7]]
        """
        require("unit", unit, unit in ("mm", "m"), "choose 'mm' or 'm'")
        width = self.patch * (1.0 if unit == "mm" else 1e-3)
        return np.array([[float(place), self.preload, width] for place in places])

    @property
    def _name(self) -> re.Match[str]:
        """Parts of the size."""
        match = NAME.fullmatch(self.size.strip())
        assert match is not None
        return match

    @property
    def _lever(self) -> float:
        """Torque over preload, mm."""
        mean = 0.5 * (self.bearing + self.holed)
        thread = 0.159 * self.pitch + 0.577 * self.pitch_diameter * self.friction
        return thread + 0.5 * mean * self.friction

    def __str__(self) -> str:
        low, high = (1e-3 * force for force in self.interval)
        spread = f", {low:.3g} to {high:.3g} kN by the tightening" if self.scatter > 0.0 else ""
        return f"{self.size} of class {self.grade}: preload {1e-3 * self.preload:.4g} kN{spread}"


def patch_width(head: float, hole: float) -> float:
    """Width of the even patch that stands for the ring under a round head, of the same unit.

    It is (d_w^2 + d_h^2)^(1/2) of the diameters of head and hole, and acts on the outer face, where
    the head is: plane elasticity spreads the pressure through the plate by itself, so that no cone
    is added.  The ring alone would have the same second moment along X on .87 of that.  The rest is
    fitted to single laps in three dimensions, where the pressure spreads across too
    (`calibration/finite_elements/bolt_patch.py`, which has the errors).
    """
    return math.hypot(head, hole)


def _length(name: str, given: Any, usual: float) -> float:
    """Diameter in mm."""
    if given is None:
        return usual
    return 1e3 * quantity(name, given, "m", "13mm") if isinstance(given, str) else float(given)


def _of_unit(name: str, given: Any, unit: str, example: str) -> float:
    """Positive number in a unit."""
    if isinstance(given, str):
        return quantity(name, given, unit, example)
    require_number(name, given)
    return float(given)
