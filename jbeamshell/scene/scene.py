"""Scene: everything that defines a run, as a frozen pytree whose physical parameters are leaves.

``Scene()`` is the standard strip.  Units are the user's own, as long as they are consistent; forces
are per unit width, or totals where there is a `strip.width`.  Dotted keys ("strip.height_ratio")
name the same things in the TOML file, on the command line and among the free parameters of a fit.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import as_leaf, is_traced, require
from jbeamshell.common.errors import InputError
from jbeamshell.common.pytrees import Tree
from jbeamshell.mechanics.friction import (
    LAWS,
    FrictionLaw,
    SharpSlip,
    law_name,
    law_named,
    takes_smoothing,
)
from jbeamshell.mechanics.homogeneous import Energy, Homogeneous, as_energy
from jbeamshell.scene.domain import Numbers, gross_slip, support_rules
from jbeamshell.scene.forms import follows
from jbeamshell.scene.joint import check_joint
from jbeamshell.scene.keys import (
    CONTROLS,
    DERIVED,
    FAR_ENDS,
    KAPPA_S,
    TABLE,
    WIDTH_OF_ALL,
    check_key,
    leaf_of,
)
from jbeamshell.scene.parts import PARTS, Contact, Load, Member, Model, Part, Strip
from jbeamshell.scene.plan import Plan
from jbeamshell.scene.planning import finer, may_be_elastic, plan
from jbeamshell.scene.pressure import bolt_pressure
from jbeamshell.scene.rows import AUTO
from jbeamshell.scene.text import summary
from jbeamshell.scene.width import halves, is_total, per_width, pressure_factor, times

MOST_LEVELS = 10**7  # load steps of a path
ALMOST_RIGID = 1000.0  # stiffness of rigid sliders in load steps, in units of G/l


def _standard(part: type[Part]) -> Any:
    """Field whose default is a part of the standard strip, which all scenes share."""

    @functools.cache
    def part_for(precision: Any, device: Any) -> Part:
        return part()

    def standard_part() -> Part:
        config: Any = jax.config
        return part_for(jnp.result_type(float), config.jax_default_device)

    return eqx.field(default_factory=standard_part)


class Scene(Tree):
    """Strip, its contact, its load and the model of it.

    Settings that are "auto" are decided when the scene is made, see `jbeamshell.scene.planning`;
    its plan holds them.  In a JAX transformation the plan stays that of the scene that was changed.

    Attributes
    ----------
    strip, contact, load, model, member : parts of the scene, see `jbeamshell.scene.parts`
    energy : strain energy Phi(e, g, k, psi, psi') per unit length of the user's own, any JAX
        function of five scalars, such as ``lambda e, g, k, psi, dpsi: ...`` or an
        `equinox.Module` that carries parameters; None is the strip's own section
    plan : how the scene is solved, see `jbeamshell.scene.plan`; it is made with the scene

    Raises
    ------
    InputError
        if a value lies outside its domain, or if values do not go together

    Examples
    --------
    >>> scene = Scene().replace({"strip.height_ratio": 0.05, "contact.friction": 0.2})
    >>> float(scene.get("strip.half_height"))
    0.05
    """

    strip: Strip = _standard(Strip)
    contact: Contact = _standard(Contact)
    load: Load = _standard(Load)
    model: Model = _standard(Model)
    energy: Energy | None = None
    member: Member = _standard(Member)
    plan: Plan = eqx.field(static=True, default=cast(Plan, None), kw_only=True, repr=False)

    def __post_init__(self) -> None:
        for name, kind in PARTS.items():
            part = getattr(self, name)
            require(name, part, isinstance(part, kind), f"give a jbeamshell.{kind.__name__}")
        self.energy = as_energy(self.energy)
        self.plan = plan(self)

    def __check_init__(self) -> None:
        self._check_plan()
        self._check_contact()
        check_joint(self)
        if self.energy is not None:
            self._check_energy(self.energy)

    def _check_energy(self, energy: Energy) -> None:
        """Refuse what is no strain energy."""
        fix = "must be a function of (e, g, k, psi, psi')"
        require("energy", energy, callable(energy), fix)
        probe = [jax.ShapeDtypeStruct((), self.strip.length.dtype)] * 5
        try:
            shape = jax.eval_shape(energy, *probe)
        except TypeError as error:
            raise InputError(f"energy: {fix}; {error}") from None
        require(
            "energy",
            energy,
            getattr(shape, "shape", None) == (),
            f"must return one number, not {shape}",
        )

    def __str__(self) -> str:
        return summary(self, self.energy is not None).as_text(28)

    def strain_energy(self) -> Energy:
        """Strain energy Phi(e, g, k, psi, psi') of this scene's section."""
        if self.energy is not None:
            return self.energy
        strip = self.strip
        squeeze = "psi" in self.plan.fields and self.plan.section != "assumed"
        if strip.section is not None:
            return dataclasses.replace(
                strip.section, squeeze=squeeze, constants=self.model.constants
            )
        return Homogeneous(
            half_height=strip.half_height,
            plane_modulus=strip.plane_modulus,
            poisson_ratio=jnp.asarray(strip.poisson_ratio),
            kappa_s=strip.kappa_s,
            squeeze=squeeze,
            constants=self.model.constants,
            plane=strip.plane,
        )

    def _check_plan(self) -> None:
        """Refuse what the planned section and engine cannot represent."""
        strip, plan, load = self.strip, self.plan, self.load
        levels = 2 * load.cycles * plan.steps
        fix = f"with {plan.steps} steps per half cycle are more than {MOST_LEVELS} load steps: "
        require("load.cycles", load.cycles, levels <= MOST_LEVELS, f"{fix}take fewer")
        fix = "is for a homogeneous strip: take squeeze"
        homogeneous = strip.layers is None or plan.section != "assumed"
        require("model.section", plan.section, homogeneous, fix)
        if plan.elastic:
            self._check_elasticity()

    def _check_elasticity(self) -> None:
        """Refuse what is not plane elasticity."""
        strip, contact, model, energy = self.strip, self.contact, self.model, self.energy
        section = "model.section = squeeze"
        fix = f"must be linear for plane elasticity: take {section} for rotations"
        require("model.kinematics", model.kinematics, self.plan.kinematics == "linear", fix)
        fix = f"is no engine of plane elasticity: leave it out, or take {section}"
        require("model.by", model.by, model.by == AUTO, fix)
        for key, value in (("strip.curvature", strip.curvature), ("energy", energy)):
            fix = f"must be left out for plane elasticity: take {section}"
            require(key, value, value is None, fix)
        sharp = isinstance(contact.law, SharpSlip)
        fix = f"must be the sharp slider for plane elasticity: take it, or {section}"
        require("contact.law", law_name(contact.law), sharp, fix)
        fix = f"must be rigid for plane elasticity, which may lift off: take {section}"
        on_base = contact.normal in ("rigid", "none")
        require("contact.normal", contact.normal, on_base, fix)
        control = self.load.control
        fix = f"must be force or displacement for plane elasticity: take {section}"
        require("load.control", control, control in CONTROLS, fix)

    def _check_contact(self) -> None:
        """Refuse a strip that nothing holds, and a load off the strip."""
        strip, contact, plan = self.strip, self.contact, self.plan
        stiff = contact.normal in ("rigid", "held")
        fix = "needs a section that may lift off: take another model.section than bar"
        require("contact.normal", contact.normal, plan.lifts or stiff, fix)
        fix = "needs a strip that may lift off: take contact.normal = rigid and another "
        fix += "model.section than bar"
        require("strip.curvature", strip.curvature, plan.lifts or strip.curvature is None, fix)
        if contact.normal == "none":
            held = "beta" in FAR_ENDS[strip.far_end]
            fix = "is all that holds a strip without a foundation: take 'guided' (rigid-body "
            fix += "motion)"
            require("strip.far_end", strip.far_end, held, fix)
        pressures = (contact.pressure, contact.bottom_pressure)
        if not is_traced(strip.length, contact.friction, *pressures):
            parts = strip, self.member, contact, plan, self.load
            for rule in support_rules(*parts, self.number):
                rule.demand()

    def of_member(self) -> Scene:
        """Scene with the second member in the strip's place, for its section alone."""
        strip = self.member.beside(self.strip)
        scene: Scene = eqx.tree_at(lambda scene: scene.strip, self, strip)
        return scene

    def slip_stiffness(self, tributary: ArrayLike) -> Array:
        """Elastic stiffness k_t of the sliders at nodes, traction per slip.

        It is alpha G/H with alpha = contact.stick_stiffness.  Without alpha sliders are rigid, and
        k_t is infinite.  Load steps need a finite one: a node of length l then has
        `ALMOST_RIGID` G/min(l, H), so that the slider of a short node is as stiff as that of a
        longer one.

        Parameters
        ----------
        tributary : contact length l of each node
        """
        strip, alpha = self.strip, self.contact.stick_stiffness
        numbers: Any = jnp if is_traced(strip, alpha, tributary) else np  # much faster
        if alpha is not None:
            k_t = numbers.full_like(tributary, alpha * strip.shear_modulus / strip.half_height)
        elif self.plan.on_contact_line:
            k_t = numbers.full_like(tributary, np.inf)
        else:
            length = numbers.minimum(tributary, strip.half_height)
            k_t = ALMOST_RIGID * strip.shear_modulus / length
        return cast(Array, k_t)

    @property
    def gross_slip(self) -> Any:
        """End force at which all of the contact slides, mu F_N L; may be traced.

        It is per unit of width, or a total where there is a width.  Infinite for a moment, under
        which nothing slides off.  Shanks of bolts hold beyond it.
        """
        moment = self.load.kind == "moment"
        return np.inf if moment else self.wide * gross_slip(self.get, self.member.support)

    @property
    def wide(self) -> Any:
        """Factor of end forces and works from what is solved to the joint; 1 without a width.

        It is the width, twice for both halves of a joint in double shear.
        """
        width = self.strip.width
        return 1.0 if width is None else width * halves("load.amplitude", self.member.support)

    def get(self, key: str) -> Any:
        """Value of a dotted key, such as ``scene.get("strip.height_ratio")``."""
        check_key(key)
        heading, name = key.split(".")
        if key == "contact.law":
            return law_name(self.contact.law)
        value = getattr(getattr(self, heading), name)
        width = self.strip.width
        if width is None or value is None or not is_total(key, self.load.control):
            return value
        return times(key, value, width * halves(key, self.member.support))

    @np.errstate(over="ignore")  # rules refuse what is not finite
    def number(self, key: str, others: Mapping[str, Any] = MappingProxyType({})) -> np.ndarray:
        """Number or table of a dotted key in double precision, for the rules of `domain`.

        Forces are those of one unit of width.

        Parameters
        ----------
        key : dotted key
        others : numbers by dotted key in place of the scene's own, as `replace` takes them; any
            shapes that broadcast
        """
        strip = self.strip
        given = key in others
        if not given and strip.derives(key, others):  # quicker than by JAX
            return np.asarray(follows(key, lambda key: self.number(key, others), strip.plane))
        number = np.asarray(others[key] if given else self.get(key), dtype=float)
        if strip.width is None or number.ndim > 1 or not is_total(key, self.load.control):
            return number
        width = np.asarray(others.get(WIDTH_OF_ALL, strip.width), dtype=float)
        return number / (width * halves(key, self.member.support))

    def replace(self, values: Mapping[str, Any]) -> Scene:
        """Copy with other values, such as ``scene.replace({"contact.friction": 0.2})``.

        Keys are those of the TOML file and the command line.  Values may be traced, so that
        gradients and batches reach every number of the scene.  What was given last stays given:
        after ``strip.youngs_modulus`` a new height keeps E, after ``strip.axial_stiffness`` E' 2H.

        Where there is a ``strip.width``, forces and stiffnesses are totals, those of bolts too.
        They stay given under another width; pressures that are no bolts' stay as stresses.

        Raises
        ------
        InputError
            if a key does not exist, a value is no good, or a scene gets its first width without
            new values for its forces, see `of_width`
        """
        mapping = isinstance(values, Mapping)
        require("values", values, mapping, "give a dictionary, such as {'contact.friction': 0.2}")
        for key, value in values.items():
            check_key(key)
            check_word(key, value)
            if DERIVED.get(key) in values:
                raise InputError(f"{key} and {DERIVED[key]} say the same thing: give one of them")
        if is_traced(values.get(KAPPA_S)) and may_be_elastic(self):
            return self.serving([KAPPA_S]).replace(values)
        parts: dict[str, dict[str, Any]] = {heading: {} for heading in PARTS}
        factor = pressure_factor(self, values)
        for key, value in per_width(self, values).items():
            heading, name = key.split(".")
            parts[heading][name] = value
        contact = parts["contact"]
        self._say_pressures(parts, factor)
        if "law" in contact or "smoothing" in contact:
            contact["law"] = _make_law(self.contact.law, contact)
        # An amplitude of another control or kind has another unit: it must be given anew.
        for word in ("control", "kind"):
            if parts["load"].get(word, getattr(self.load, word)) != getattr(self.load, word):
                parts["load"].setdefault("amplitude", None)
        new_parts = {
            heading: getattr(self, heading).changed(**changes)
            for heading, changes in parts.items()
            if changes
        }
        return dataclasses.replace(self, **new_parts)

    def of_width(self, width: Any) -> Scene:
        """Same joint of a width, its forces totals then; None is one unit of width.

        What the scene says for one unit of width stays, but its sides become free: with a width it
        is in plane stress unless ``strip.plane`` is given.

        Examples
        --------
        >>> scene = Scene().of_width(50.0)
        >>> round(float(scene.get("load.amplitude")), 3)
        39.275
        """
        return dataclasses.replace(self, strip=self.strip.changed(width=width))

    def _say_pressures(self, parts: dict[str, dict[str, Any]], factor: Any) -> None:
        """Say the pressures of bolts, of which the bottom one follows the member's support.

        It does so until it is given itself, or another pressure takes the place of the bolts.

        Parameters
        ----------
        parts : new values by heading and name
        factor : factor of the pressures of bolts that stay while the width changes; None is 1
        """
        contact, member = parts["contact"], parts["member"]
        bolted = "bolts" in contact or factor is not None
        if factor is not None:
            x, pressure = self.contact.pressure.T
            contact["pressure"] = jnp.stack([x, factor * pressure], axis=1)
        elif bolted:
            rows = leaf_of("contact.bolts", contact.pop("bolts"))
            length = as_leaf(parts["strip"].get("length", self.strip.length), "strip.length")
            contact["pressure"] = bolt_pressure(rows, length)
        elif self.contact.bolted and "pressure" in contact:
            contact.setdefault("bottom_pressure", TABLE["contact.bottom_pressure"].default)
        if "bottom_pressure" in contact:
            contact["bolted"] = False
        elif bolted or (self.contact.bolted and "support" in member):
            clamped = member.get("support", self.member.support) == "clamped"
            top = contact.get("pressure", self.contact.pressure)
            contact |= {"bolted": True, "bottom_pressure": top if clamped else 0.0}

    def pinned(self, numbers: Numbers | None = None) -> Scene:
        """Copy whose settings are given as they are planned, so that no change decides others.

        Parameters
        ----------
        numbers : values by dotted key of many scenes, all of which the settings are to serve; None
            is those of this scene
        """
        settings = self.plan if numbers is None else plan(self, numbers)
        model = self.model.but(
            section=settings.section, kinematics=settings.kinematics, nodes=settings.nodes
        )
        load = self.load.but(steps_per_half_cycle=settings.steps)
        scene = self.but(load=load, model=model, plan=settings)
        if plan(scene, numbers).end_size == settings.end_size:
            return scene
        return scene.but(model=model.but(end_size=settings.end_size))  # of a refined grid

    def refined(self) -> Scene:
        """Copy on elements half as large, from which any change goes back to the planned grid."""
        return self.but(plan=finer(self))

    def in_one_form(self) -> Scene:
        """Copy with its numbers in one form, so that programs do not ask what was given."""
        return self.but(strip=self.strip.in_one_form(), contact=self.contact.but(bolted=False))

    def serving(self, keys: Collection[str]) -> Scene:
        """Copy on the beamshell if some numbers are its own and the section is open.

        Plane elasticity has no squeeze-shear factor.

        Parameters
        ----------
        keys : dotted keys of the numbers
        """
        if KAPPA_S not in keys or not may_be_elastic(self):
            return self
        return self.pinned(lambda key: np.array(np.nan) if key == KAPPA_S else self.number(key))

    def by_load_steps(self) -> Scene:
        """Copy that is solved in load steps, of any section but plane elasticity."""
        return self.replace({"model.by": "steps"})

    def on_grid(self, nodes: int, end_size: float) -> Scene:
        """Copy on a grid of its own, for studies of convergence.

        Parameters
        ----------
        nodes : number of nodes along X
        end_size : smallest elements in units of H, before the number of nodes scales all of them;
            below 1e-4 it serves the last node alone
        """
        model = dataclasses.replace(self.model, nodes=nodes, end_size=end_size)
        return dataclasses.replace(self, model=model)


def _make_law(current: FrictionLaw, contact: dict[str, Any]) -> FrictionLaw:
    law = contact.pop("law", law_name(current))
    smoothing = contact.pop("smoothing", None)
    m = getattr(current, "smoothing", "sharp") if smoothing is None else smoothing
    m = np.inf if isinstance(m, str) else m
    key = TABLE["contact.smoothing"]
    exponent = key.convert(m)
    sharp = not isinstance(exponent, jax.core.Tracer) and bool(np.all(np.isposinf(exponent)))
    require("contact.smoothing", m, exponent.ndim == 0, key.words)
    custom = isinstance(law, FrictionLaw)
    if not custom and takes_smoothing(LAWS[law]):
        return law_named(law, None if sharp else exponent)
    unused = smoothing is None or sharp
    require("contact.smoothing", smoothing, unused, f"contact.law {law!r} has none; leave it out")
    return law if custom else law_named(law, None)


def check_word(name: str, value: Any) -> None:
    """Raise `InputError` for a value of the wrong type, before it is put into a part."""
    key = TABLE[name]
    if name == "contact.law":
        is_law = isinstance(value, FrictionLaw) or (isinstance(value, str) and value in LAWS)
        require(name, value, is_law, f"choose {' or '.join(map(repr, LAWS))}")
    elif name == "contact.smoothing" and isinstance(value, str):
        require(name, value, value == "sharp", key.words)
    elif key.kind == "word":
        require(name, value, isinstance(value, str), "must be a word")
    elif key.kind == "number" and not key.optional:
        require(name, value, value is not None, "must be a number")
