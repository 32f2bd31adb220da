"""Numbers that two keys can say: the one that was given last is held, and the other one follows.

So a height that is changed keeps Young's modulus where that was given, and E' 2H where that was.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any, Self, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.checks import is_traced
from jbeamshell.common.errors import InputError
from jbeamshell.common.pytrees import Tree
from jbeamshell.mechanics.homogeneous import plane_modulus, youngs_modulus
from jbeamshell.scene.keys import TABLE, TWINS, leaf_of
from jbeamshell.scene.rows import AUTO

# Fields that hold what is given, by both keys that can say it.
HOLDERS = {
    "strip.height_ratio": "given_height",
    "strip.half_height": "given_height",
    "strip.axial_stiffness": "given_stiffness",
    "strip.youngs_modulus": "given_stiffness",
}


class Given(Tree):
    """Number that was given, of two keys that say the same thing.

    Attributes
    ----------
    key : dotted key, such as "strip.half_height"
    value : its number
    """

    key: str = eqx.field(static=True)
    value: Array


def default(key: str) -> Given:
    """Default of a key as if it were given."""
    return Given(key, leaf_of(key, TABLE[key].default))


def given(values: Mapping[str, Any], before: Given | None) -> Given | None:
    """Given number of two keys, or the one that was given before; None is nothing.

    Raises
    ------
    InputError
        if both are given, or one beside what was given before
    """
    said = {key: value for key, value in values.items() if value is not None}
    if said and before is not None:
        fix = "take Scene.replace({'strip.length': 3.0}) in place of dataclasses.replace"
        raise InputError(f"strip: {fix}")
    if len(said) > 1:
        raise InputError(f"{' and '.join(said)} say the same thing: give one of them")
    return next((Given(key, leaf_of(key, value)) for key, value in said.items()), before)


def follows(key: str, numbers: Callable[[str], Any], plane: str) -> Any:
    """Number of a key of `HOLDERS` where its twin is given; any shape, traced or not.

    Parameters
    ----------
    key : dotted key
    numbers : values by dotted key
    plane : "strain" or "stress"
    """
    if key == "strip.height_ratio":
        return 2.0 * numbers("strip.half_height") / numbers("strip.length")
    if key == "strip.half_height":
        return 0.5 * numbers("strip.height_ratio") * numbers("strip.length")
    height, nu = 2.0 * numbers("strip.half_height"), numbers("strip.poisson_ratio")
    if key == "strip.axial_stiffness":
        return plane_modulus(numbers("strip.youngs_modulus"), nu, plane) * height
    return youngs_modulus(numbers("strip.axial_stiffness") / height, nu, plane)


class Forms(Tree):
    """Height and stiffness of a strip, each in both forms.

    Attributes
    ----------
    given_height, given_stiffness : what is given; layers leave no stiffness
    given_plane : "strain", "stress", or "auto" if it follows from the width
    """

    given_height: Given = eqx.field(default=None)
    given_stiffness: Given | None = eqx.field(default=None)
    given_plane: str = eqx.field(static=True, default=AUTO)

    @property
    def said(self) -> set[str]:
        """Keys of `HOLDERS` that are given."""
        holders = self.given_height, self.given_stiffness
        return {held.key for held in holders if held is not None}

    def derives(self, key: str, others: Collection[str] = ()) -> bool:
        """True if the number of a key follows from its twin.

        Parameters
        ----------
        key : dotted key
        others : keys whose numbers are given in place of the strip's
        """
        return key in HOLDERS and (TWINS[key] in others or TWINS[key] in self.said)

    @property
    def plane(self) -> str:
        """Plane "strain" or "stress"; free sides, as a joint with a width has, are in stress."""
        if self.given_plane != AUTO:
            return self.given_plane
        width = getattr(self, "width", None)
        return "strain" if width is None else "stress"

    @property
    def height_ratio(self) -> Array:
        """Half height over half the length, eta = H/(L/2)."""
        return cast(Array, self._value("strip.height_ratio"))

    @property
    def half_height(self) -> Array:
        """Half height H, length."""
        return cast(Array, self._value("strip.half_height"))

    @property
    def axial_stiffness(self) -> Array | None:
        """Stretching stiffness E' 2H, force per unit width; None when there are layers."""
        return cast(Array | None, self._value("strip.axial_stiffness"))

    @property
    def youngs_modulus(self) -> Array | None:
        """Young's modulus E, stress; None when there are layers."""
        return cast(Array | None, self._value("strip.youngs_modulus"))

    @np.errstate(all="ignore")  # the strip refuses what is not finite
    def in_one_form(self) -> Self:
        """Same strip by its height ratio and E' 2H, so that programs do not ask what was given.

        Its forces are those of one unit of width, which no program asks for either.
        """
        numbers: Any = jnp if is_traced(self) else np  # much faster
        strip = jax.tree.map(numbers.asarray, self)
        forms = {
            HOLDERS[key]: Given(key, numbers.asarray(strip._value(key)))
            for key in ("strip.height_ratio", "strip.axial_stiffness")
            if getattr(strip, HOLDERS[key]) is not None
        }
        return cast(Self, strip.but(**forms, width=None, given_plane=self.plane))

    def _value(self, key: str) -> Any:
        """Value of a key of the strip, as it was given or as it follows."""
        if key not in HOLDERS:
            return getattr(self, key.removeprefix("strip."))
        held: Given | None = getattr(self, HOLDERS[key])
        if held is None:
            return None
        if held.key == key:
            return held.value
        return follows(key, self._value, self._value("strip.plane"))
