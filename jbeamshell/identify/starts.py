"""Start values of a fit from the loops themselves, for what nobody gave.

Below gross slip, a held strip of small height answers like Goodman's bar: u = A^2/(2 EA q), and the
work of a cycle is a third of 4 A u, whatever A is.  With height both figures depend on
x = (2A/G)/eta alone, where G = mu F_N L is the force of gross slip: the finite-element loops that
ship with the library lie on one curve for eta = .03 to .4.  So the work tells x, and x with either
G or eta the other one.  A loop with a plateau tells G, and its work the displacement over which
the strip yields.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.identify.models import StripModel
from jbeamshell.identify.specimens import Case, plausible_stiffness
from jbeamshell.measured.curves import Backbone, DissipationCurve, StiffnessCurve
from jbeamshell.measured.findings import TOO_LARGE, TOO_SMALL, TOO_SOFT, TOO_STIFF, UNIT_ERROR
from jbeamshell.measured.inspection import inspect
from jbeamshell.measured.loops import Loop
from jbeamshell.scene.domain import gross_slip_rule
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.toml import overridden, scene_from_values

# Loops of finite elements (calibration/data): x, work over 4 A u, and u over the bar's.
X = (1.0, 1.78, 2.48, 3.3, 4.24, 5.2, 6.98, 8.88, 11.5, 14.3, 19.4, 31.0, 62.0)
WORK = (0.0003, 0.0042, 0.020, 0.058, 0.115, 0.168, 0.232, 0.267, 0.293, 0.306, 0.318, 0.327, 0.332)
BEYOND_BAR = (4.0, 2.46, 1.79, 1.44, 1.25, 1.16, 1.09, 1.055, 1.033, 1.021, 1.011, 1.004, 1.001)
SLENDER = 0.15  # height ratio, where nothing tells it
PARTS = (0.1, 0.85)  # parts of gross slip between which a force starts then
MOST, LEAST = 0.9, 0.02  # parts of gross slip between which a force starts
HEIGHTS = (0.01, 0.5)  # height ratios between which a fit starts
BELOW = 1.0 - 1e-6  # part of gross slip that a force may reach
STRAIGHT = 0.875  # halfway over the way that work is short of; 1 if straight, .75 if a root
STIFF = 3.0  # stretching stiffness over that of soft sliders, at the start
STEEP = 0.02  # way to a plateau over the amplitude, at least
AFTER_TURN = 0.15  # part of the range of the displacement in which the first slope is taken
STIFFEST = 50.0  # largest stiffness after a turn over the secant
STRAIN = 1e-3  # displacement over a length that nobody gave, at most
FRICTIONS = (0.003, 3.0)  # friction that surfaces have, beyond which a unit is wrong
MODULI = (5e8, 3e12)  # plane moduli [Pa] of the materials of joints, likewise
STRAINS = (1e-7, 1e-2)  # of a strip under the force of a measured loop, likewise
SIMILAR = 3.0  # factor of a force of gross slip within which the standard strip may be meant

HEIGHT = ("strip.height_ratio", "strip.half_height")
STIFFNESS = ("strip.axial_stiffness", "strip.youngs_modulus")
PRESSURE = ("contact.pressure", "contact.bolts")


class Estimate(NamedTuple):
    """Figures of the largest loop or pull of some measurements, from which strips and laws start.

    Attributes
    ----------
    force, displacement : amplitudes
    peak : largest force of all measurements, up or down
    work : work of a cycle; None if there is no cycle, or if it cannot be told from noise
    slides : True if the loop has a plateau
    halfway : displacement from a turn until half of the range of the force is gone; None without
        cycles
    stiffness : slope right after a turn
    normal : mean normal force; None if it was not recorded
    si : True if the numbers are in SI
    """

    force: float
    displacement: float
    peak: float
    work: float | None
    slides: bool
    halfway: float | None
    stiffness: float
    normal: float | None
    si: bool

    @property
    def short(self) -> float:
        """Displacement that the work of a cycle is short of a rectangle's."""
        return self.displacement - (self.work or 0.0) / (4.0 * self.force)

    @property
    def soft(self) -> bool:
        """True if the way to a plateau is straight, by soft sliders, and no root, by the strip."""
        return self.slides and self.halfway is not None and self.halfway > STRAIGHT * self.short


def estimate(measurements: Sequence[Any]) -> Estimate | None:
    """Estimate from loops and backbones; None if there are neither."""
    pulls = [item for item in measurements if isinstance(item, Loop | Backbone)]
    if not pulls:
        return None
    largest = max(pulls, key=lambda item: float(np.ptp(item.force)))
    peak = max(float(np.max(np.abs(item.force))) for item in pulls)
    si = isinstance(largest, Loop) and largest.units is not None
    normal = largest.mean_normal_force() if isinstance(largest, Loop) else None
    levels = inspect(largest).views[0].levels if isinstance(largest, Loop) else ()
    pull: Any = levels[-1].loop if levels else largest
    force, displacement = (
        float(0.5 * np.ptp(column) if levels else np.max(np.abs(column)))
        for column in (pull.force, pull.displacement)
    )
    kind = levels[-1].shape.kind if levels else ""
    work = levels[-1].work if kind in ("micro-slip", "gross slip", "viscous") else None
    halfway, slope = _halfway(pull) if levels else None, _after_turn(pull, force / displacement)
    slides = kind == "gross slip"
    return Estimate(force, displacement, peak, work, slides, halfway, slope, normal, si)


def _halfway(loop: Loop) -> float:
    """Displacement from the first turn of a mean loop until half of the force's range is gone."""
    middle = 0.5 * float(np.max(loop.force) + np.min(loop.force))
    gone = int(np.argmax((loop.force - middle) * (loop.force[0] - middle) <= 0.0))
    return abs(float(loop.displacement[0] - loop.displacement[gone]))


def _after_turn(pull: Loop | Backbone, secant: float) -> float:
    """Slope right after the largest displacement of a loop, or at the begin of a backbone."""
    u = pull.displacement
    first = int(np.argmax(u)) if isinstance(pull, Loop) and pull.closed else 0
    after = np.roll(np.arange(u.size), -first)
    far = int(np.argmax(np.abs(u[after] - u[first]) > AFTER_TURN * np.ptp(u)))
    near = after[: max(far, 3)]
    slope = float(np.polyfit(u[near], pull.force[near], 1)[0]) if np.ptp(u[near]) > 0.0 else 0.0
    return float(np.clip(slope, secant, STIFFEST * secant))


def started(known: Mapping[str, Any], found: Estimate) -> tuple[dict[str, Any], list[str]]:
    """Values of a scene with start values for what is not known, and notes on them.

    Parameters
    ----------
    known : values by dotted key; they stay as they are
    found : figures of the measurements

    Raises
    ------
    InputError
        if the friction and the pressure that are known cannot resist the measured force
    """
    values = {key: value for key, value in known.items() if not key.startswith("load.")}
    scene, forced = _scene_of(known)
    _check_known(scene, values, found, forced)
    if suits(known, found):
        return dict(known), []
    fresh: dict[str, Any] = {}

    def take(key: str, value: float | str) -> None:
        fresh[key] = values[key] = value

    if "strip.length" not in values:
        take("strip.length", _length(found))
    if found.slides and "strip.far_end" not in values:
        take("strip.far_end", "free")
    length = float(scene_from_values(values).strip.length)
    if found.normal is not None and found.normal > 0.0 and not _pressed(values):
        take("contact.pressure", found.normal / (length * float(scene.strip.width or 1.0)))
    scene = scene_from_values(values)
    _check_known(scene, values, found, forced)
    tall = any(key in values for key in HEIGHT) or scene.strip.layers is not None
    stiff = any(key in values for key in STIFFNESS) or scene.strip.layers is not None
    gross = _gross_slip(found, scene, values, forced)
    x = _x(found)
    if not tall and x is not None:
        take("strip.height_ratio", float(np.clip(2.0 * found.force / gross / x, *HEIGHTS)))
    if not stiff:
        halves = float(scene.wide) / float(scene.strip.width or 1.0)
        take("strip.axial_stiffness", _stretching(found, gross, length) / halves)
        if found.si and tall and "strip.length" in known:
            _check_modulus(float(scene_from_values(values).strip.plane_modulus))
    if found.soft and "contact.stick_stiffness" not in values:
        scene = scene_from_values(values)
        sliders = gross / found.short / length / float(scene.wide) * float(scene.strip.half_height)
        take("contact.stick_stiffness", sliders / float(scene.strip.shear_modulus))
    if not _pressed(values):
        pressing = gross / float(scene.contact.friction)
        take("contact.pressure", pressing / (length * float(scene.wide)))
    elif "contact.friction" not in values:
        take("contact.friction", gross / _pressing(scene))
        _check_friction(values["contact.friction"], found, scene, values)
    told = ", ".join(
        f"{key} = {value:.4g}" if isinstance(value, float) else f"{key} = {value}"
        for key, value in fresh.items()
    )
    notes = [f"not given, so estimated from the loops: {told}"] if fresh else []
    if "contact.pressure" in fresh and found.normal is None:
        notes.append("the pressure is not given: of friction, only mu F_N L is determined")
    return overridden(dict(known), fresh), notes


def _pressed(values: Mapping[str, Any]) -> bool:
    """True if the pressure is known, also by its bolts."""
    return any(key in values for key in PRESSURE)


def _check_known(scene: Scene, values: Mapping[str, Any], found: Estimate, forced: bool) -> None:
    """Raise `InputError` if the friction and the pressure that are known are too small."""
    if not (forced and "contact.friction" in values and _pressed(values)):
        return
    gross = float(scene.gross_slip)
    if found.peak >= BELOW * gross:
        needed = found.peak / _pressing(scene)
        _check_friction(needed, found, scene, values)
        raise InputError(
            f"contact.friction = {float(scene.contact.friction):.6g}: slides at mu F_N L = "
            f"{gross:.4g}, but the measured force reaches {found.peak:.4g}: start it above "
            f"{needed:.3g}, press more, or set load.control to 'displacement'"
        )


def _check_friction(
    needed: float, found: Estimate, scene: Scene, values: Mapping[str, Any]
) -> None:
    """Raise `InputError` if only friction that no surface has explains the measured force."""
    low, high = FRICTIONS
    if low <= needed <= high or not found.si:
        return
    units = TOO_SMALL if needed < low else TOO_LARGE
    if any(key in values for key in STIFFNESS):  # which tells the wrong one of two units
        stiffness = found.force / found.displacement
        soft, stiff = plausible_stiffness(StripModel(scene), ()) or (0.0, np.inf)
        units = TOO_SOFT if stiffness * UNIT_ERROR < soft else units
        units = TOO_STIFF if stiffness > UNIT_ERROR * stiff else units
    raise InputError(
        f"contact.friction: the measured force, {found.peak:.4g}, is that of a friction "
        f"of {needed:.2g}, which no surface has: {units}, or are pressure, bolts or width wrong; "
        f"if all are right, start from it by --start contact.friction={needed:.2g}"
    )


def _check_modulus(modulus: float) -> None:
    """Raise `InputError` if only a modulus that no usual material has explains the stiffness."""
    low, high = MODULI
    if not low <= modulus <= high:
        raise InputError(
            f"strip.axial_stiffness: force over displacement would need a modulus of "
            f"{1e-9 * modulus:.3g} GPa, which no usual material has: "
            f"{TOO_SOFT if modulus < low else TOO_STIFF}, or is --width wrong; if all are right, "
            "give --modulus"
        )


def doubt_of_strain(known: Mapping[str, Any], scene: Scene, found: Estimate | None) -> list[str]:
    """Sentence on a stiffness from loops that only a wrong unit explains; none if it may be right.

    Numbers without units have no modulus that is too large or too small, but the strain under the
    measured force is a pure number.
    """
    stretching = scene.get("strip.axial_stiffness")
    given = any(key in known for key in STIFFNESS) or "strip.length" not in known
    if found is None or given or stretching is None:
        return []
    strain = found.force / float(stretching)
    low, high = STRAINS
    if low <= strain <= high:
        return []
    return [
        f"by the measured displacement, the measured force stretches the strip by {strain:.2g} of "
        f"its length, which no usual joint does: {TOO_SOFT if strain > high else TOO_STIFF}"
    ]


def check_starts(cases: Sequence[Case], free: Sequence[str]) -> None:
    """Raise `InputError` if a free number starts a strip so that a measured force slides it off."""
    for case in cases:
        scene, found = case.model.own, _peak(case.measurements)
        if not isinstance(scene, Scene):
            continue
        rule = gross_slip_rule(scene.load, scene.member, scene.number, found / scene.wide)
        if np.all(rule.holds):
            continue
        gross = float(scene.gross_slip)
        for key in ("contact.friction", "contact.pressure"):
            if key in free:
                start = float(scene.get(key))
                raise InputError(
                    f"free {key!r}: starts at {start:.4g}, where the strip slides at mu F_N L = "
                    f"{gross:.4g}; the measured force reaches {found:.4g} and must stay below "
                    f"gross slip: start from {start * found / gross / MOST:.3g}"
                )


def _peak(measurements: Sequence[Any]) -> float:
    """Largest force of loops and backbones, or amplitude of curves over it."""
    forces = [item.force for item in measurements if isinstance(item, Loop | Backbone)]
    forces += [
        item.amplitude
        for item in measurements
        if isinstance(item, DissipationCurve | StiffnessCurve)
    ]
    return max((float(np.max(np.abs(force))) for force in forces), default=0.0)


def suits(known: Mapping[str, Any], found: Estimate) -> bool:
    """True if data without units are such that the standard strip may be meant."""
    scene, forced = _scene_of(known)
    gross = float(scene.gross_slip)
    most = BELOW if forced else SIMILAR
    low, high = plausible_stiffness(StripModel(scene), ()) or (0.0, np.inf)
    stiffness = found.force / found.displacement
    return not found.si and found.peak < most * gross and low <= stiffness <= high


def _scene_of(known: Mapping[str, Any]) -> tuple[Scene, bool]:
    """Scene of known values but its load, and whether the force is controlled."""
    values = {key: value for key, value in known.items() if not key.startswith("load.")}
    return scene_from_values(values), known.get("load.control", "force") == "force"


def _gross_slip(found: Estimate, scene: Scene, values: Mapping[str, Any], forced: bool) -> float:
    """Force of gross slip, mu F_N L."""
    if "contact.friction" in values and _pressed(values):
        return float(scene.gross_slip)
    force, x = found.force, _x(found)
    least = found.peak / MOST if forced else force
    if found.slides:
        return least
    part = PARTS[1] if x is None else float(np.clip(0.5 * SLENDER * x, *PARTS))
    if x is None and found.halfway is not None:  # cycles without work hardly slip
        part = PARTS[0]
    guess = force / part
    tall = any(key in values for key in HEIGHT)
    stiff = "strip.axial_stiffness" in values or ("strip.youngs_modulus" in values and tall)
    if x is not None and stiff and scene.strip.axial_stiffness is not None:
        bar = force**2 * float(scene.strip.length) / (2.0 * found.displacement)
        guess = _beyond_bar(x) * bar / float(scene.strip.axial_stiffness * scene.wide)
    elif x is not None and tall:
        guess = 2.0 * force / (x * float(scene.strip.height_ratio))
    return float(np.clip(guess, least, force / LEAST))


def _stretching(found: Estimate, gross: float, length: float) -> float:
    """Stretching stiffness E'2H of a strip that answers as was found."""
    if found.soft:
        return STIFF * gross * length / found.short
    if found.slides and found.work is not None:
        # Of two branches F = -G + 2 G sqrt(du/way) each, 4 G way/3 are missing to a rectangle.
        return gross * length / max(3.0 * found.short, STEEP * found.displacement)
    bar = found.force**2 * length / (2.0 * found.displacement * gross)
    return _beyond_bar(_x(found) or X[0]) * bar


def _x(found: Estimate) -> float | None:
    """Ratio x of the force of a loop below gross slip; None if its work is not known."""
    if found.work is None or found.slides:
        return None
    share = found.work / (4.0 * found.force * found.displacement)
    return float(np.exp(np.interp(np.log(share), np.log(WORK), np.log(X))))


def _beyond_bar(x: float) -> float:
    """Displacement over that of a bar."""
    return float(np.interp(np.log(x), np.log(X), BEYOND_BAR))


def _pressing(scene: Scene) -> float:
    """Resultant of the pressures, F_N L."""
    return float(scene.replace({"contact.friction": 1.0}).gross_slip)


def _length(found: Estimate) -> float:
    """Length that nobody gave: a power of ten, so long that the strip is strained little."""
    return float(10.0 ** np.ceil(np.log10(max(1.0, found.displacement / STRAIN))))
