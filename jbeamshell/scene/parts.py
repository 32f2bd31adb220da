"""Parts of a Scene: strip, second member, contact, load and model.

Their fields, with defaults and domains, are the rows of the table in `jbeamshell.scene.keys`.  The
defaults are the standard strip (after Brink 2015, chapter III, with chapter IV's squeeze strain).
Numbers are leaves of a pytree, words and counts are static.  Every part checks itself when it is
made.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Collection
from typing import Any, Self, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.checks import is_traced, require
from jbeamshell.mechanics.elements import ORDER, table_steps
from jbeamshell.mechanics.friction import FrictionLaw, SharpSlip, takes_smoothing
from jbeamshell.mechanics.homogeneous import plane_modulus, shear_modulus, youngs_modulus
from jbeamshell.mechanics.laminate import Laminate
from jbeamshell.scene.keys import (
    TABLE,
    TWINS,
    ContactKeys,
    LoadKeys,
    MemberKeys,
    ModelKeys,
    Part,
    StripKeys,
    key_table,
    leaf_of,
)
from jbeamshell.scene.layers import check_layers
from jbeamshell.scene.pressure import check_gap, check_pressure, pressure_values
from jbeamshell.scene.rows import AUTO, Given, Key

# Fields of a `Strip` that hold a `Given`, by both keys that it may be given by.
HOLDERS = {
    "strip.height_ratio": "given_height",
    "strip.half_height": "given_height",
    "strip.axial_stiffness": "given_stiffness",
    "strip.youngs_modulus": "given_stiffness",
}


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


class Strip(StripKeys):
    """Geometry and material of the strip.

    Of ``height_ratio`` and ``half_height`` one is given, the last one that was set, and the other
    one follows.  So it is with ``axial_stiffness`` and ``youngs_modulus``.  With ``layers`` there
    is no stiffness and no ``poisson_ratio``: they are None.
    """

    def __post_init__(self) -> None:
        stiffness = self.given_stiffness
        if self.layers is not None:
            fix = "strip.layers say it already; leave it out"
            if stiffness is not None:
                require(stiffness.key, stiffness.value, False, fix)
            nu = self.poisson_ratio
            require("strip.poisson_ratio", nu, nu is None, fix)
        else:
            if stiffness is None:
                self.given_stiffness = _default("strip.axial_stiffness")
            if self.poisson_ratio is None:
                self.poisson_ratio = TABLE["strip.poisson_ratio"].default
        if self.given_height is None:
            self.given_height = _default("strip.height_ratio")
        super().__post_init__()
        curvature = self.curvature
        if (
            curvature is not None
            and not isinstance(curvature, jax.core.Tracer)
            and not np.any(curvature)
        ):
            self.curvature = None  # straight

    def __check_init__(self) -> None:
        if self.layers is not None:
            check_layers(self.layers, 2.0 * self.half_height, self.plane)

    def changed(self, **values: Any) -> Self:
        for key, holder in HOLDERS.items():
            name = key.removeprefix("strip.")
            if name in values:
                values[holder] = Given(key, leaf_of(key, values.pop(name)))
        if values.get("layers") is not None:
            # The layers give the stiffness and nu; the strip refuses both being given.
            values = {"given_stiffness": None, "poisson_ratio": None} | values
        return super().changed(**values)

    @property
    def said(self) -> set[str]:
        """Keys of `HOLDERS` that are given."""
        holders = self.given_height, self.given_stiffness
        return {given.key for given in holders if given is not None}

    def derives(self, key: str, others: Collection[str] = ()) -> bool:
        """True if the number of a key follows from its twin.

        Parameters
        ----------
        key : dotted key
        others : keys whose numbers are given in place of the strip's
        """
        return key in HOLDERS and (TWINS[key] in others or TWINS[key] in self.said)

    def _number(self, key: str) -> Any:
        """Number of a key, as it was given or as it follows; None for a stiffness of layers."""
        if key not in HOLDERS:
            return getattr(self, key.removeprefix("strip."))
        given: Given | None = getattr(self, HOLDERS[key])
        if given is None:
            return None
        return given.value if given.key == key else follows(key, self._number, self.plane)

    @property
    def height_ratio(self) -> Array:
        """Half height over half the length, eta = H/(L/2)."""
        return cast(Array, self._number("strip.height_ratio"))

    @property
    def half_height(self) -> Array:
        """Half height H, length."""
        return cast(Array, self._number("strip.half_height"))

    @property
    def axial_stiffness(self) -> Array | None:
        """Stretching stiffness E' 2H, force per unit width; None when there are layers."""
        return cast(Array | None, self._number("strip.axial_stiffness"))

    @property
    def youngs_modulus(self) -> Array | None:
        """Young's modulus E, stress; None when there are layers."""
        return cast(Array | None, self._number("strip.youngs_modulus"))

    def in_one_form(self) -> Self:
        """Same strip by its height ratio and E' 2H, so that programs do not ask what was given."""
        numbers: Any = jnp if is_traced(self) else np  # much faster
        strip = jax.tree.map(numbers.asarray, self)
        forms = {
            HOLDERS[key]: Given(key, numbers.asarray(strip._number(key)))
            for key in ("strip.height_ratio", "strip.axial_stiffness")
            if getattr(strip, HOLDERS[key]) is not None
        }
        return strip.but(**forms)

    @property
    def section(self) -> Laminate | None:
        """Laminated section; None for a homogeneous strip."""
        if self.layers is None:
            return None
        return Laminate(self.layers, self.kappa_s, self.plane)

    @property
    def stretching_stiffness(self) -> Array:
        """Stiffness E' 2H, or its sum over the layers, force per unit width."""
        if self.section is not None:
            return self.section.stretching_stiffness
        return cast(Array, self.axial_stiffness)  # not converted: a NumPy array stays one

    @property
    def plane_modulus(self) -> Array:
        """Plane modulus E' (of the mean stiffness where there are layers), stress."""
        given = self.given_stiffness
        if given is not None and given.key == "strip.youngs_modulus":
            return cast(Array, plane_modulus(given.value, self.poisson_ratio, self.plane))
        return self.stretching_stiffness / (2.0 * self.half_height)

    @property
    def shear_modulus(self) -> Array:
        """Shear modulus G (the mean over the height where there are layers), stress."""
        if self.section is not None:
            return self.section.mean_shear_modulus
        return shear_modulus(self.plane_modulus, cast(Array, self.poisson_ratio), self.plane)


def _default(key: str) -> Given:
    return Given(key, leaf_of(key, TABLE[key].default))


class Member(MemberKeys):
    """Second member of a lap joint, which the strip lies on; without one it lies on a rigid base.

    It reaches from X = 0 to L, as the strip does.
    """

    def __check_init__(self) -> None:
        if self.gap is not None and not isinstance(self.gap, jax.core.Tracer):
            check_gap(np.asarray(self.gap))
        for name in ("axial_stiffness", "poisson_ratio"):
            value = getattr(self, name)
            fix = "member.layers say it already; leave it out"
            require(f"member.{name}", value, self.layers is None or value is None, fix)

    def beside(self, strip: Strip) -> Strip:
        """Member as a strip whose contact is its bottom face; what it leaves out is the strip's."""
        layered = self.layers is not None
        stiffness, nu = self.axial_stiffness, self.poisson_ratio
        layers = self.layers if layered or stiffness is not None or nu is not None else strip.layers
        values: dict[str, Any] = {"layers": layers, "overhang": None, "curvature": None}
        if self.height_ratio is not None:
            values["height_ratio"] = self.height_ratio
        if layers is None:
            values["poisson_ratio"] = strip.poisson_ratio if nu is None else nu
            if stiffness is None and "strip.youngs_modulus" not in strip.said:
                ratio = values.get("height_ratio", strip.height_ratio)
                stiffness = strip.plane_modulus * ratio * strip.length
            if stiffness is not None:
                values["axial_stiffness"] = stiffness
        return strip.changed(far_end="guided", **values)


class Contact(ContactKeys):
    """Rough foundation, and the pressures on the strip.

    A pressure table acts exactly as it is drawn, wherever its steps lie between the nodes.

    Attributes
    ----------
    law : friction law of one contact point
    """

    law: FrictionLaw = eqx.field(default_factory=SharpSlip)

    def __check_init__(self) -> None:
        is_law = isinstance(self.law, FrictionLaw)
        require("contact.law", self.law, is_law, "give a jbeamshell.mechanics.friction.FrictionLaw")
        if takes_smoothing(self.law):
            TABLE["contact.smoothing"].check(self.smoothing)
        for key in ("pressure", "bottom_pressure"):
            pressure = getattr(self, key)
            if not isinstance(pressure, jax.core.Tracer):
                check_pressure(f"contact.{key}", np.asarray(pressure))
        if not isinstance(self.pressure, jax.core.Tracer):
            presses = bool(np.any(pressure_values(np.asarray(self.pressure)) > 0.0))
            require("contact.pressure", self.pressure, presses, "must press somewhere")

    @property
    def smoothing(self) -> Array:
        """Exponent m of the friction law; infinite for the sharp slider."""
        return getattr(self.law, "smoothing", jnp.asarray(np.inf))

    @property
    def bolts(self) -> Array | None:
        """Bolts (k, 3) of X, force and width if the pressure is that of patches, else None.

        A traced table of four rows for each patch is taken for one.
        """
        table = self.pressure
        if table.ndim == 0 or table.shape[0] % 4:
            return None
        rows = table.reshape(-1, 4, 2)
        begin, end = rows[:, 0, 0], rows[:, 3, 0]
        if not is_traced(table):
            numbers = np.asarray(rows)
            steps = np.all(numbers[:, ::2, 0] == numbers[:, 1::2, 0])
            if not (
                steps
                and np.all(numbers[:, 1, 1] == numbers[:, 2, 1])
                and not numbers[:, ::3, 1].any()
            ):
                return None
        width = end - begin
        return jnp.stack([0.5 * (begin + end), rows[:, 1, 1] * width, width], axis=1)

    @property
    def largest_pressure(self) -> Array:
        """Largest pressure F_N on the top face."""
        return jnp.max(self.pressure[:, 1]) if self.pressure.ndim else self.pressure

    @property
    def jumps(self) -> int:
        """Number of rows of the pressures' tables at which they may jump."""
        tables = (self.pressure, self.bottom_pressure)
        return sum(p.shape[0] - 1 for p in tables if p.ndim == 2)

    def steps(self, length: Array) -> Array | None:
        """Positions X at which a pressure jumps, rising; None if there are none.

        Rows of a table between which it does not jump give L.
        """
        tables = [p for p in (self.pressure, self.bottom_pressure) if p.ndim == 2]
        steps = [table_steps(table, length) for table in tables]
        return jnp.sort(jnp.concatenate(steps)) if steps else None


class Load(LoadKeys):
    """Load on the end X = L after the pressure.

    The path is 0 to A, then ``cycles`` times A, -A, A.  Under force control A is the force F per
    unit width; under displacement control u(L), the mean displacement of the end face; under
    arc-length control the way along the path of u and F L/(E' 2H), a length.  The arc length goes
    on where force and displacement turn back by themselves (Riks 1979, with a plane for the arc).
    """

    def __post_init__(self) -> None:
        TABLE["load.control"].check(self.control)
        TABLE["load.kind"].check(self.kind)
        if self.amplitude is None:
            turns = " of a moment" if self.kind == "moment" else ""
            fix = f"give the amplitude{turns} under {self.control} control"
            has_default = (self.control, self.kind) == ("force", "force") or self.cycles == 0
            require("load.amplitude", None, has_default, fix)
            self.amplitude = TABLE["load.amplitude"].default
        super().__post_init__()

    def __check_init__(self) -> None:
        steps = self.steps_per_half_cycle
        if steps == AUTO:
            return  # the plan's
        fix = "must be 1, or even, so that the path passes through zero"
        require("load.steps_per_half_cycle", steps, steps == 1 or steps % 2 == 0, fix)


def unit_path(cycles: int, steps: int) -> np.ndarray:
    """Load levels after zero for unit amplitude: 0 to 1, then ``cycles`` times 1, -1, 1.

    Parameters
    ----------
    cycles, steps : full cycles, and load steps per half cycle
    """
    if cycles == 0:
        return np.zeros(0)
    down = 1.0 - 2.0 * np.arange(1, steps + 1) / steps
    quarter = max(steps // 2, 1)
    first = np.arange(1, quarter + 1) / quarter
    return np.concatenate([first, *[down, -down] * cycles])


END_SIZE = Key("end_size", "setting", AUTO, "Smallest elements.", unit="H", open=True)


class Model(ModelKeys):
    """Extent and resolution of the model.

    Attributes
    ----------
    end_size : smallest elements in units of H, before the number of nodes scales all, see
        `Scene.on_grid`; "auto" leaves them to the plan.  No file holds it
    """

    end_size: float | str = eqx.field(static=True, default=AUTO)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.end_size = END_SIZE.convert(self.end_size)
        END_SIZE.check(self.end_size)

    def __check_init__(self) -> None:
        odd = self.nodes == AUTO or (self.nodes - 1) % ORDER[self.grid] == 0
        fix = "must be odd for the collocation grid (two elements' ends and their middle)"
        require("model.nodes", self.nodes, odd, fix)


PARTS: dict[str, type[Part]] = {
    part.heading: part for part in (Strip, Contact, Load, Model, Member)
}
for _heading, _part in PARTS.items():  # `help` shows the keys of every part
    _part.__doc__ = f"{_part.__doc__}\n{textwrap.indent(key_table(_heading), '    ')}\n"
