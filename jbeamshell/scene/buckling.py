"""Buckling of the parts of a strip that nothing presses: Euler's load, and the compression there.

Linear kinematics know no buckling.  A strip that is pressed, however little, does not buckle by
small deflections; a part without pressure is a column between its supports.  So is the overhang of
a lap joint, and a whole single lap, whose eccentric load bends it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jbeamshell.mechanics.homogeneous import shear_coefficient, shear_modulus
from jbeamshell.scene.domain import Numbers
from jbeamshell.scene.keys import FAR_ENDS
from jbeamshell.scene.linearisation import Parts, pull, stretching
from jbeamshell.scene.parts import Contact
from jbeamshell.scene.pressure import face_resultant, is_table

NEAR_BUCKLING = 0.5  # part of the Euler load from which deflections double
# Euler's load over pi^2 B/l^2 (Timoshenko & Gere 1961, section 2.1).
OVERHANG, CLAMPED, HINGED = 0.25, 4.0, 2.0457


class Column(NamedTuple):
    """Part of a strip without pressure, and the load that buckles it.

    Attributes
    ----------
    begin, end : positions X, length
    force : largest compression in the scene's cycles, force per unit width
    limit : Euler's load, force per unit width; infinite where there is no such part
    """

    begin: np.ndarray
    end: np.ndarray
    force: np.ndarray
    limit: np.ndarray

    @property
    def near(self) -> np.ndarray:
        """True where the compression comes near the load that buckles."""
        return np.asarray(self.force >= NEAR_BUCKLING * self.limit)


@np.errstate(all="ignore")  # the largest numbers there are may overflow
def weakest_column(scene: Parts, numbers: Numbers | None = None) -> Column:
    """Column that is nearest to buckling among the parts of a strip without pressure.

    An overhang is clamped where the pressure ends and free at its loaded end; a part between
    pressures is clamped at both ends; one at X = 0 is held as the far end is.  With the bending
    stiffness B about the neutral line and the shear stiffness kappa G 2H, the load of Euler and
    Engesser is 1/P = l^2/(c pi^2 B) + 1/(kappa G 2H).  Friction of pressures nearer to the loaded
    end takes its part of a force; a displacement compresses the strip as far as the column's far
    end at most.

    Parameters
    ----------
    scene : scene without traced leaves
    numbers : values by dotted key of the strips of a sweep; None is those of the scene
    """
    numbers = numbers or scene.number
    length, load = numbers("strip.length"), scene.load
    none = Column(length, length, np.zeros(()), np.asarray(np.inf))
    parts = unpressed_parts(scene.contact)
    if load.cycles == 0:
        return none
    columns = _columns_of_joint(scene, numbers)
    if not columns and not parts:
        return none
    bending, shear = _stiffnesses(scene, numbers)
    amplitude = pull(load, numbers("load.amplitude"))
    support = "clamped" if "beta" in FAR_ENDS[scene.strip.far_end] else scene.strip.far_end
    for start, stop in parts:
        begin, end = np.clip(start, 0.0, length), np.clip(stop, 0.0, length)
        overhangs = end == length
        if start == -np.inf and support == "free":
            continue  # nothing takes a compression
        far = HINGED if start == -np.inf and support != "clamped" else CLAMPED
        limit = _euler_load(np.where(overhangs, OVERHANG, far), begin, end, bending, shear)
        friction = numbers("contact.friction") * _pressed_beyond(scene.contact, stop, length)
        force = np.maximum(amplitude - friction, 0.0)
        if load.control != "force":
            force = amplitude * stretching(scene.strip, numbers) / (length - begin)
        columns.append(Column(*np.broadcast_arrays(begin, end, force, limit)))
    weakest = none
    for column in columns:
        nearer = column.force / column.limit > weakest.force / weakest.limit
        weakest = Column(*(np.where(nearer, a, b) for a, b in zip(column, weakest, strict=True)))
    return weakest


def sway(scene: Parts) -> float:
    """Load of a single lap over the load that buckles it; zero for any other scene.

    It bounds how much the moments at the contact grow under a push, and fall under a pull, with the
    deflection (Timoshenko & Gere 1961, section 1.11).  In a stepped column that is as stiff in the
    contact as both members together they change by .3 to .7 of it, and their range by .03 of it.
    """
    if scene.member.support != "clamped" or scene.load.cycles == 0:
        return 0.0
    whole = _columns_of_joint(scene, scene.number)[-1]
    return float(whole.force / whole.limit)


def _columns_of_joint(scene: Parts, numbers: Numbers) -> list[Column]:
    """Lengths beyond the contact, and last a whole single lap; the load compresses all of them.

    The loaded end is free, or guided and turns; the end of the second member is clamped.  Where the
    loaded end is free the joint sways, so that both overhangs are free at one end.
    """
    strip, member, load = scene.strip, scene.member, scene.load
    if member.support == "none" and strip.overhang is None:
        return []
    length = numbers("strip.length")
    zero = np.zeros(())
    far_overhang = zero if member.overhang is None else numbers("member.overhang")
    overhang = zero if strip.overhang is None else numbers("strip.overhang")
    factor = OVERHANG if member.loaded_end == "free" else HINGED
    upper, lower = (_stiffnesses(scene, numbers, second) for second in (False, True))
    along = stretching(strip, numbers)
    Span = tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]
    spans: list[Span] = [(length, length + overhang, upper)]
    if member.support == "clamped":
        spans += [(-far_overhang, 0.0 * length, lower)]
        weaker = np.minimum(upper[0], lower[0]), np.minimum(upper[1], lower[1])
        spans += [(-far_overhang, length + overhang, weaker)]
    columns = []
    for begin, end, (bending, shear) in spans:
        limit = _euler_load(factor, begin, end, bending, shear)
        force = pull(load, numbers("load.amplitude"))
        if load.control != "force":
            force = force * along / length
        columns.append(Column(*np.broadcast_arrays(begin, end, force, limit)))
    return columns


def _euler_load(
    factor: Any, begin: np.ndarray, end: np.ndarray, bending: np.ndarray, shear: np.ndarray
) -> np.ndarray:
    """Load of Euler and Engesser of a part from begin to end; infinite where there is none."""
    run = np.where(end > begin, end - begin, np.nan)
    euler = factor * np.pi**2 * bending / run**2
    return np.where(end > begin, 1.0 / (1.0 / euler + 1.0 / shear), np.inf)


def unpressed_parts(contact: Contact) -> list[tuple[float, float]]:
    """Parts (begin, end) in X that no pressure holds down, infinite beyond the tables."""
    if contact.normal == "none":
        return [(-np.inf, np.inf)]
    faces = [np.asarray(p, dtype=float) for p in (contact.pressure, contact.bottom_pressure)]
    rows = [face[:, 0] for face in faces if is_table(face)]
    if not rows:
        return []
    edges = np.unique(np.concatenate(rows))
    reach = max(float(edges[-1] - edges[0]), 1.0)
    knots = np.concatenate([[edges[0] - reach], edges, [edges[-1] + reach]])
    points = [knots[:-1] + part * np.diff(knots) for part in (0.25, 0.75)]
    down, up = (
        [np.interp(x, *f.T) if is_table(f) else np.full(x.size, np.max(f)) for x in points]
        for f in faces
    )
    free = (down[0] <= up[0]) & (down[1] <= up[1])
    ends = np.concatenate([[-np.inf], edges, [np.inf]])
    turns = np.flatnonzero(np.diff(np.concatenate([[False], free, [False]])))
    return [(float(ends[a]), float(ends[b])) for a, b in turns.reshape(-1, 2)]


def _pressed_beyond(contact: Contact, start: float, length: np.ndarray) -> np.ndarray:
    """Force of the pressures between X = start and L, downwards, per unit width."""
    if start == np.inf:
        return np.zeros(())
    forces = []
    for pressure in (contact.pressure, contact.bottom_pressure):
        face = np.asarray(pressure, dtype=float)
        if not is_table(face):
            forces.append(np.max(face) * (length - start))
            continue
        first = np.interp(start, *face.T)
        rest = np.vstack([[start, first], face[face[:, 0] >= start]])
        forces.append(face_resultant(rest, length)[0] - first * start)
    return np.maximum(forces[0] - forces[1], 0.0)


def _stiffnesses(
    scene: Parts, numbers: Numbers, second: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Bending stiffness about the neutral line, and shear stiffness, of a section.

    Parameters
    ----------
    scene, numbers : scene, and values by dotted key of the strips of a sweep
    second : True for the second member, which is the scene's own
    """
    strip = scene.member.beside(scene.strip) if second else scene.strip
    if strip.section is not None:
        section = strip.section
        shear = section.shear_coefficient * section.mean_shear_modulus * section.height
        return np.asarray(section.bending_stiffness), np.asarray(shear)
    if second:
        along, height = (np.asarray(a) for a in (strip.axial_stiffness, 2.0 * strip.half_height))
        nu = np.asarray(strip.poisson_ratio)
    else:
        along, height = stretching(strip, numbers), 2.0 * numbers("strip.half_height")
        nu = numbers("strip.poisson_ratio")
    bending = along * height**2 / (12.0 if scene.model.constants == "consistent" else 192.0)
    return bending, shear_coefficient(nu) * shear_modulus(along, nu, strip.plane)
