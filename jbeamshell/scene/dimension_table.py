"""Table of the dimensions of a specimen: unit, example and meaning of each."""

from typing import NamedTuple


class Dimension(NamedTuple):
    """A dimension.

    Attributes
    ----------
    unit : base unit; empty for a pure number
    example : text that would do
    text : meaning
    """

    unit: str
    example: str
    text: str


DIMENSIONS = {
    "length": Dimension("m", "120mm", "length of the strip, from its support to the loaded end"),
    "thickness": Dimension("m", "12mm", "thickness of the strip, 2H"),
    "width": Dimension("m", "50mm", "width of the specimen, by which forces are divided"),
    "modulus": Dimension("Pa", "210GPa", "Young's modulus of the strip"),
    "poisson": Dimension("", "0.3", "Poisson's ratio of the strip"),
    "pressure": Dimension("Pa", "5MPa", "even pressure on the strip, if there are no bolts"),
    "bolts": Dimension(
        "N",
        "2x8kN@30mm,90mm",
        "number of bolts, preload of each, and positions from the support; "
        "further kinds of bolts after semicolons",
    ),
    "head": Dimension("m", "13mm", "bearing diameter of the bolts' heads or washers"),
}
