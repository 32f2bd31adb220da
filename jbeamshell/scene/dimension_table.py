"""Table of the dimensions of a specimen: unit, example and meaning of each."""

from typing import NamedTuple


class Dimension(NamedTuple):
    """A dimension.

    Attributes
    ----------
    unit : base unit; empty for a pure number, "word" for a word
    example : text that would do
    text : meaning
    """

    unit: str
    example: str
    text: str


DIMENSIONS = {
    "length": Dimension("m", "120mm", "length of the contact, from its support to the loaded end"),
    "thickness": Dimension("m", "12mm", "thickness of the strip, 2H"),
    "width": Dimension("m", "50mm", "width of the specimen, which bears the whole force"),
    "modulus": Dimension("Pa", "210GPa", "Young's modulus of the strip"),
    "poisson": Dimension("", "0.3", "Poisson's ratio of the strip"),
    "pressure": Dimension("Pa", "5MPa", "even pressure on the strip, if there are no bolts"),
    "bolts": Dimension(
        "word",
        "2xM8@30mm,90mm",
        "number of bolts, size or preload (8kN) of each, and positions from the support; "
        "further kinds of bolts after semicolons",
    ),
    "torque": Dimension("N m", "25Nm", "torque by which bolts of a size are tightened"),
    "proof": Dimension(
        "", "0.75", "their preload as a part of the proof load, if no torque says it"
    ),
    "grade": Dimension("word", "8.8", "their property class (default 8.8), or A2-70 and the like"),
    "thread_friction": Dimension("", "0.12", "friction in their thread and under their head"),
    "tightening": Dimension(
        "", "1.6", "tightening factor, their largest preload over the smallest"
    ),
    "head": Dimension("m", "13mm", "bearing diameter of their heads or washers"),
}
LAP = {
    "joint": Dimension(
        "word", "single-lap", "single-lap or double-lap: the strip on another plate"
    ),
    "overhang": Dimension(
        "m", "100mm", "length of both plates beyond the contact, to where they are pulled and held"
    ),
    "other_thickness": Dimension(
        "m",
        "12mm",
        "thickness of the other plate, the inner one of a double lap (default: as much, or twice)",
    ),
    "friction": Dimension("", "0.2", "friction coefficient of the contact"),
    "force": Dimension("N", "4kN", "amplitude of the force"),
}
ALL = DIMENSIONS | LAP
