"""Table of the keys of a scene: default, domain, scale, symbol, unit and meaning of each.

The rows are the fields of the scene's parts, declared here once: `StripKeys` is the section
``[strip]`` of a TOML file, and so on.  Scenes, fits, sweeps, pictures and the command line's help
read `TABLE`.  A new number needs its row here and the physics that uses it, nothing else.
"""

from __future__ import annotations

import difflib
import math
import textwrap
from dataclasses import InitVar
from typing import Any, ClassVar

from jax import Array

from jbeamshell.common.errors import InputError
from jbeamshell.mechanics.elements import ORDER
from jbeamshell.mechanics.friction import LAWS
from jbeamshell.mechanics.homogeneous import CONSTANTS, PLANES
from jbeamshell.mechanics.kinematics import KINEMATICS
from jbeamshell.scene.rows import AUTO, Key, Part, count, number, rows, setting, word
from jbeamshell.scene.sections import SECTIONS

FAR_ENDS = {"guided": ("v", "beta"), "pinned": ("v",), "free": ()}  # fields held at X = 0
ENTRIES = ("member", "face", "guided", "traction")
CONTROLS = ("force", "displacement")
ARC_LENGTH = "arc-length"
KAPPA_S = "strip.kappa_s"  # squeeze-shear factor, which plane elasticity does not have
LENGTHS = ("displacement", ARC_LENGTH)  # controls whose amplitude is a length
LOAD_KINDS = ("force", "moment")
ASSEMBLIES = ("frictionless", "frictional")
NORMALS = ("rigid", "held", "compliant", "none")
LOADED_ENDS = ("free", "level")
MEMBERS = ("none", "rolling", "clamped")

TOLERANCE = 0.01
FINEST, COARSEST = 1e-4, 0.1  # tolerance: below, the finest mesh may not reach it
LAYERS = "give rows [thickness, E, nu] of all layers, from the bottom to the top"
PRESSURE = "give a number or a table of [X, pressure] rows"
BOLTS = "give rows of numbers [X, force, width of the patch]"
GAP = "give a number or a table of [X, gap] rows"
WIDTH = 96  # characters of a line of the printed table


class StripKeys(Part):
    """Geometry and material of the strip, section ``[strip]``."""

    heading: ClassVar[str] = "strip"

    length: Array = number(2.0, "Length L of the strip.", symbol="L", unit="length")
    width: Array | None = number(
        None,
        "Width of the joint, whose forces, works and stiffnesses are totals then and whose sides "
        "are free; none is one unit of width.",
        symbol="b",
        unit="length",
    )
    height_ratio: InitVar[Any] = number(
        0.1126,
        "Half height over half the length, eta = H/(L/2).",
        left_out=None,
        symbol=r"\eta",
    )
    half_height: InitVar[Any] = number(
        None,
        "Half height H, in place of the height ratio.",
        symbol="H",
        unit="length",
        through="strip.height_ratio",
    )
    axial_stiffness: InitVar[Any] = number(
        3.4e4,
        "Stretching stiffness E' 2H; E' = E/(1-nu^2) in plane strain, E in plane stress.",
        left_out=None,
        symbol="E' 2H",
        unit="force/width",
    )
    youngs_modulus: InitVar[Any] = number(
        None,
        "Young's modulus E, in place of the stretching stiffness.",
        symbol="E",
        unit="stress",
        through="strip.axial_stiffness",
    )
    poisson_ratio: Array | None = number(
        0.3,
        "Poisson's ratio.",
        left_out=None,
        symbol=r"\nu",
        low=-1.0,
        high=0.5,
        scale="linear",
    )
    kappa_s: Array = number(
        0.44, "Squeeze-shear factor; 0.44 fits the squeeze layer.", symbol=r"\kappa_s"
    )
    far_end: str = word(
        "guided",
        FAR_ENDS,
        "Support at X = 0: guided (a rigid face at rest), pinned (its lower edge at rest) or free.",
    )
    overhang: Array | None = number(
        None,
        "Length beyond X = L, at whose end the load acts and u is taken; none is none.",
        unit="length",
    )
    layers: Array | None = number(
        None,
        "Rows [thickness, E, nu] of the layers from the bottom up, in place of the stiffness "
        "and Poisson's ratio.",
        unit="mixed",
        table=True,
        fix=LAYERS,
    )
    plane: InitVar[Any] = word(
        AUTO, PLANES, "Plane strain or plane stress; auto is stress where strip.width is given."
    )
    curvature: Array | None = number(
        None,
        "Curvature alpha' before loading, positive if the ends point up; none is straight.",
        symbol=r"\alpha'",
        unit="1/length",
        low=-math.inf,
        scale="linear",
    )


class ContactKeys(Part):
    """Rough foundation and pressures, section ``[contact]``."""

    heading: ClassVar[str] = "contact"

    friction: Array = number(
        0.1, "Coulomb friction coefficient; 0 is frictionless.", symbol=r"\mu", closed=True
    )
    pressure: Array = number(
        10.0,
        "Pressure on the top face, positive downwards: a number, or rows [X, p] with linear "
        "interpolation; two rows of one X make a step.",
        symbol="F_N",
        unit="stress",
        closed=True,
        table=True,
        fix=PRESSURE,
    )
    bottom_pressure: Array = number(
        0.0,
        "Pressure on the bottom face, positive upwards; a number or rows [X, p].",
        unit="stress",
        closed=True,
        table=True,
        fix=PRESSURE,
    )
    stick_stiffness: Array | None = number(
        None,
        "Stiffness of elastic sliders in units of G/H: k_t = alpha G/H; none is rigid sliders.",
        symbol=r"\alpha",
    )
    normal: str = word(
        "rigid",
        NORMALS,
        "Normal contact: rigid, held (rigid, and the strip may not lift off), compliant, or none "
        "(no foundation).",
    )
    normal_stiffness: Array = number(
        50.0, "Stiffness of the compliant foundation, in units of E'/H.", symbol="k_n", unit="E'/H"
    )


class LoadKeys(Part):
    """Load on the end X = L after the pressure, section ``[load]``."""

    heading: ClassVar[str] = "load"

    control: str = word(
        "force",
        (*CONTROLS, ARC_LENGTH),
        "Controlled quantity: force (F), displacement (u at X = L) or arc-length (along the path "
        "of u and F L/(E' 2H)).",
    )
    kind: str = word(
        "force",
        LOAD_KINDS,
        "What acts on the end: a force F along X, or a moment M.  A moment opens "
        "the joint if positive; u is then the rotation of the end, and F is M.",
    )
    entry: str = word(
        "member",
        ENTRIES,
        "How the force enters at X = L: member (the strip goes on without contact and is pulled "
        "evenly far away), face (a rigid face that may turn), guided (a rigid face that may not) "
        "or traction (spread evenly over the face).",
    )
    arm: Array | None = number(
        None,
        "Height above mid-height at which the force acts, and at which u is taken (lap joints "
        "only); none is mid-height.",
        unit="length",
        low=-math.inf,
        scale="linear",
    )
    amplitude: Array = number(
        0.7855,
        "Amplitude of the controlled quantity; a length, without default, unless the force is "
        "controlled.",
        left_out=None,
        symbol="A",
        unit="force/width",
    )
    cycles: int = count(2, 0, "Full cycles after the first loading; 0 is the pressure alone.")
    steps_per_half_cycle: int = count(AUTO, 1, "Equal load steps from A to -A; 1, or even.")
    pressure_steps: int = count(1, 1, "Equal steps in which the pressure is applied.")


HIERARCHIC = (
    tuple(f"p{order}" for order in range(1, 13)),
    "take plane, or squeeze with model.kinematics = exact",
)


class ModelKeys(Part):
    """Extent and resolution of the model, section ``[model]``."""

    heading: ClassVar[str] = "model"

    section: str = word(
        AUTO,
        SECTIONS,
        "Section: bar, shell, squeeze, assumed (its squeeze strain from the pressures) or plane "
        "(elasticity).",
        former=HIERARCHIC,
    )
    kinematics: str = word(AUTO, KINEMATICS, "Rotations: exact or linear.")
    by: str = word(AUTO, ("steps",), "Engine: steps are load steps, also where others would do.")
    grid: str = word(
        "finite-difference",
        ORDER,
        "Grid of load steps: finite-difference (second order) or collocation (fourth).",
    )
    nodes: int = count(AUTO, 3, "Nodes along X.")
    constants: str = word(
        "consistent", CONSTANTS, "Section constants: consistent, or printed (the dissertation's)."
    )
    tolerance: float = setting(
        TOLERANCE,
        "Relative error of the dissipation, the loop and the secant stiffness, to plane elasticity "
        "of the same scene, for which settings that are auto are chosen.",
        low=FINEST,
        high=COARSEST,
        closed=True,
    )


class MemberKeys(Part):
    """Second member of a lap joint, under the strip, and how the two are joined; ``[member]``."""

    heading: ClassVar[str] = "member"

    support: str = word(
        "none",
        MEMBERS,
        "Second member: none (a rigid base), rolling (held along X at X = 0, its bottom on a "
        "symmetry plane: double shear) or clamped (at X = 0: single lap).",
    )
    height_ratio: Array | None = number(
        None,
        "Half its height over half the length; none is the strip's.",
        symbol=r"\eta_2",
    )
    axial_stiffness: Array | None = number(
        None,
        "Its stretching stiffness E' 2H; none is by the strip's E if given, else by its E'.",
        symbol="(E' 2H)_2",
        unit="force/width",
    )
    poisson_ratio: Array | None = number(
        None,
        "Its Poisson's ratio; none is the strip's.",
        symbol=r"\nu_2",
        low=-1.0,
        high=0.5,
        scale="linear",
    )
    overhang: Array | None = number(
        None,
        "Its length before X = 0, at whose end it is held; none is none.",
        unit="length",
    )
    layers: Array | None = number(
        None,
        "Rows [thickness, E, nu] of its layers from the contact downwards.",
        unit="mixed",
        table=True,
        fix=LAYERS,
    )
    loaded_end: str = word(
        "free",
        LOADED_ENDS,
        "Support of the strip at X = L beside the load: free, or level (no deflection).",
    )
    assembly: str = word(
        "frictionless",
        ASSEMBLIES,
        "Pressing: frictionless (locks no shear in), or frictional, as bolts are tightened.",
    )
    gap: Array | None = number(
        None,
        "Distance to the second member before anything presses, of curved members: a number, or "
        "rows [X, gap]; none is none.",
        symbol="g_0",
        unit="length",
        closed=True,
        table=True,
        fix=GAP,
    )
    bolt_stiffness: Array | None = number(
        None,
        "Stiffness of the bolts' shanks against slip, which stays beyond gross slip; spread as the "
        "pressure; none is none.",
        symbol="k_b",
        unit="force/width/length",
    )
    bearing_stiffness: Array | None = number(
        None,
        "Stiffness of the bolts' shanks on their holes, once the bolts' mean slip exceeds the "
        "clearance; none is none.",
        symbol="k_c",
        unit="force/width/length",
    )
    clearance: Array | None = number(
        None,
        "Slip after the pressing beyond which the shanks bear on their holes; none is zero.",
        symbol="c",
        unit="length",
        closed=True,
    )


# Keys that are no field of their own: they set, or read, a field in another form.
INDIRECT = (
    Key(
        "contact.bolts",
        "number",
        None,
        "Bolts, rows [X, force, width of the patch], the force per width unless strip.width is "
        "given; sets the pressure on the top face, and below a clamped second member.",
        unit="mixed",
        table=True,
        through="contact.pressure",
        fix=BOLTS,
    ),
    Key("contact.law", "word", "elastic-slip", "Friction law by its name.", choices=tuple(LAWS)),
    Key(
        "contact.smoothing",
        "number",
        math.inf,
        "Exponent m of the friction law, 8 to 32 in practice; sharp is the Jenkins slider.",
        symbol="m",
        low=1.0,
        scale="linear",
        fix="must be a number above 1, or 'sharp'",
    ),
)


TABLE: dict[str, Key] = {}
for _part in (StripKeys, ContactKeys, LoadKeys, ModelKeys, MemberKeys):
    _indirect = (row for row in INDIRECT if row.name.startswith(f"{_part.heading}."))
    TABLE |= {row.name: row for row in (*rows(_part).values(), *_indirect)}
# Keys that say the same thing as another one.
DERIVED = {row.name: row.through for row in TABLE.values() if row.through}
TWINS = DERIVED | {through: name for name, through in DERIVED.items()}
KEYS = tuple(TABLE)
NUMBERS = tuple(name for name, key in TABLE.items() if key.kind == "number")
WIDTH_OF_ALL = "strip.width"
# Numbers that are totals where a width is given; of bolts it is their forces.
TOTALS = (
    *(name for name, key in TABLE.items() if "/width" in key.unit),
    "contact.bolts",
)
# Keys of old files, with what is to be done about them.
_SECTION = "say model.section: bar, shell, squeeze or plane"
_HOLE = "say contact.pressure, a table that is zero over the hole"
FORMER = {
    "strip.deviation": "a laminate's shear is split at mid-height: leave it out",
    "strip.loaded_end": "say member.loaded_end",
    "model.fields": f"{_SECTION}; a strip lifts off unless contact.normal = held",
    "model.rung": _SECTION,
    "model.order": _SECTION,
    "model.solution": "leave it out, or say model.by = steps",
    "model.squeeze": "say model.section = assumed",
    "model.end_size": "elements follow from model.nodes: leave it out",
    "member.holes": _HOLE,
    "contact.holes": _HOLE,
}
_OF_JOINT = ("assembly", "gap", "bolt_stiffness", "bearing_stiffness", "clearance")
FORMER |= {f"contact.{name}": f"say member.{name}" for name in _OF_JOINT}


def key_table(section: str = "") -> str:
    """Table as text with key, default, unit and meaning; of one section, or of all."""
    keys = [key for key in TABLE.values() if key.name.startswith(section)]
    heads = [("key", "default", "unit")]
    cells = heads + [(key.name, key.shown_default, key.shown_unit) for key in keys]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = []
    for row, text in zip(cells, ["meaning", *(key.sentence for key in keys)], strict=True):
        begin = "".join(cell.ljust(width + 2) for cell, width in zip(row, widths, strict=True))
        margin = " " * len(begin)
        wrap = textwrap.TextWrapper(WIDTH, begin, margin, break_on_hyphens=False)
        lines += wrap.wrap(text)
    return "\n".join(lines)


def check_key(key: str) -> None:
    """Raise `InputError` for a key that does not exist, with the nearest one that does."""
    if not isinstance(key, str):
        raise InputError(f"{key!r}: is no key; keys are {', '.join(KEYS)}")
    if key in FORMER:
        raise InputError(f"{key}: is no key any more; {FORMER[key]}")
    if key not in TABLE:
        matches = difflib.get_close_matches(key, KEYS, 1)
        hint = f"did you mean {matches[0]!r}?" if matches else f"keys are {', '.join(KEYS)}"
        raise InputError(f"unknown key {key!r}: {hint}")


def leaf_of(key: str, value: Any) -> Array:
    """Leaf of a number of the scene, checked."""
    number: Array = TABLE[key].convert(value)
    TABLE[key].check(number)
    return number


def unit_of(key: str, load: LoadKeys, whole: bool = False) -> str:
    """Unit of a number of the scene; that of the amplitude depends on what is controlled.

    Parameters
    ----------
    key : dotted key
    load : load of the scene
    whole : True where forces are totals, those of the scene's width
    """
    unit, turns = TABLE[key].unit, load.kind == "moment"
    if key == "load.amplitude" and load.control in LENGTHS:
        unit = "rad" if turns else "length"
    elif key == "load.amplitude" and turns:
        unit = "force length/width"
    return unit.replace("/width", "") if whole else unit
