"""Parts of a Scene: strip, second member, contact, load and model.

Their fields, with defaults and domains, are the rows of the table in `jbeamshell.scene.keys`.  The
defaults are the standard strip (after Brink 2015, chapter III, with chapter IV's squeeze strain).
Numbers are leaves of a pytree, words and counts are static.  Every part checks itself when it is
made.
"""

from __future__ import annotations

import dataclasses
import textwrap
from typing import Any, Self, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.mechanics.elements import ORDER, table_steps
from jbeamshell.mechanics.friction import FrictionLaw, SharpSlip, takes_smoothing
from jbeamshell.mechanics.homogeneous import plane_modulus, shear_modulus
from jbeamshell.mechanics.laminate import Laminate
from jbeamshell.scene.forms import HOLDERS, Forms, default, given
from jbeamshell.scene.keys import (
    TABLE,
    ContactKeys,
    LoadKeys,
    MemberKeys,
    ModelKeys,
    Part,
    StripKeys,
    key_table,
)
from jbeamshell.scene.layers import check_layers
from jbeamshell.scene.pressure import check_gap, check_pressure, pressure_values
from jbeamshell.scene.rows import AUTO, Key


class Strip(Forms, StripKeys):
    """Geometry and material of the strip.

    Of ``height_ratio`` and ``half_height`` one is given, the last one that was set, and the other
    one follows.  So it is with ``axial_stiffness`` and ``youngs_modulus``.  With ``layers`` there
    is no stiffness and no ``poisson_ratio``: they are None.

    Forces and stiffnesses of the parts of a scene are those of one unit of width.  Where there is a
    ``width``, `Scene.replace` takes totals and `Scene.get` gives them.
    """

    def __post_init__(
        self,
        height_ratio: Any,
        half_height: Any,
        axial_stiffness: Any,
        youngs_modulus: Any,
        plane: Any,
    ) -> None:
        TABLE["strip.plane"].check(plane)
        self.given_plane = self.given_plane if plane == AUTO else plane
        tall = {"strip.height_ratio": height_ratio, "strip.half_height": half_height}
        stiff = {"strip.axial_stiffness": axial_stiffness, "strip.youngs_modulus": youngs_modulus}
        self.given_height = given(tall, self.given_height) or default("strip.height_ratio")
        stiffness = self.given_stiffness = given(stiff, self.given_stiffness)
        nu = self.poisson_ratio
        if self.layers is not None:
            fix = "strip.layers say it already; leave it out"
            if stiffness is not None:
                require(stiffness.key, stiffness.value, False, fix)
            require("strip.poisson_ratio", nu, nu is None, fix)
        else:
            self.given_stiffness = stiffness or default("strip.axial_stiffness")
            self.poisson_ratio = TABLE["strip.poisson_ratio"].default if nu is None else nu
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
        if is_traced(self):
            return
        same, fix = self.in_one_form(), "overflows beside the strip's other numbers: take others"
        for holder in dict.fromkeys(HOLDERS.values()):
            said, other = getattr(self, holder), getattr(same, holder)
            if said is not None:
                require(said.key, said.value, bool(TABLE[other.key].holds(other.value)), fix)

    def changed(self, **values: Any) -> Self:
        own = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        own |= {HOLDERS[key]: None for key in HOLDERS if key.removeprefix("strip.") in values}
        own |= {"given_plane": AUTO} if "plane" in values else {}
        if values.get("layers") is not None:  # which give the stiffness and nu
            own |= {"given_stiffness": None, "poisson_ratio": None}
        return type(self)(**own | values)

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
        stiffness = self.given_stiffness
        if stiffness is not None and stiffness.key == "strip.youngs_modulus":
            return cast(Array, plane_modulus(stiffness.value, self.poisson_ratio, self.plane))
        return self.stretching_stiffness / (2.0 * self.half_height)

    @property
    def shear_modulus(self) -> Array:
        """Shear modulus G (the mean over the height where there are layers), stress."""
        if self.section is not None:
            return self.section.mean_shear_modulus
        return shear_modulus(self.plane_modulus, cast(Array, self.poisson_ratio), self.plane)


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
        """Member as a strip whose contact is its bottom face; what it leaves out is the strip's.

        Its numbers are of NumPy if theirs are.
        """
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
        made = strip.changed(far_end="guided", **values)
        return cast(Strip, jax.tree.map(numbers_of(self, strip).asarray, made))


class Contact(ContactKeys):
    """Rough foundation, and the pressures on the strip.

    A pressure table acts exactly as it is drawn, wherever its steps lie between the nodes.

    Attributes
    ----------
    law : friction law of one contact point
    bolted : True if bolts were given last, so that the pressure on the bottom face is theirs under
        a clamped second member, and zero without one
    """

    law: FrictionLaw = eqx.field(default_factory=SharpSlip)
    bolted: bool = eqx.field(static=True, default=False)

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
        xp = numbers_of(steps)
        return xp.sort(xp.concatenate(steps)) if steps else None


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
