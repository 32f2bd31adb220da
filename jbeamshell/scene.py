"""A Scene: everything that defines a run, as a frozen pytree whose physical parameters are leaves.

``Scene()`` is the standard strip.  Units are the user's own, as long as they are consistent; forces
are per unit width.  Dotted keys ("strip.height_ratio") name the same things in the TOML file, on
the command line and among the free parameters of a fit.
"""

from __future__ import annotations

import dataclasses
import difflib
import os
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import tomli_w
from jax import Array

from jbeamshell.energy import Energy, Homogeneous
from jbeamshell.errors import InputError
from jbeamshell.files import read_toml, write_text
from jbeamshell.friction import (
    LAWS,
    CappedTrial,
    ElasticSlip,
    FrictionLaw,
    SharpSlip,
    TanhIncrement,
)
from jbeamshell.parts import (
    ARC_LENGTH,
    CONTROLS,
    SMOOTHING,
    Contact,
    Load,
    Model,
    Strip,
    as_leaf,
    require,
    require_number,
    resultant,
)
from jbeamshell.rungs import spelled_out
from jbeamshell.sections import Hierarchic

LENGTHS = ("displacement", ARC_LENGTH)  # controls whose amplitude is a length
SECTIONS = {"strip": Strip, "contact": Contact, "load": Load, "model": Model}

# Keys that set a leaf through others, in the order in which they apply.
DERIVED = {
    "strip.half_height": "strip.height_ratio",
    "strip.youngs_modulus": "strip.axial_stiffness",
}

NUMBERS = (
    "strip.length",
    "strip.height_ratio",
    "strip.half_height",
    "strip.axial_stiffness",
    "strip.youngs_modulus",
    "strip.poisson_ratio",
    "strip.kappa_s",
    "strip.layers",
    "strip.deviation",
    "strip.curvature",
    "contact.friction",
    "contact.pressure",
    "contact.bottom_pressure",
    "contact.stick_stiffness",
    "contact.smoothing",
    "contact.normal_stiffness",
    "load.amplitude",
)
SETTINGS = (
    "load.cycles",
    "load.steps_per_half_cycle",
    "load.pressure_steps",
    "model.nodes",
    "model.order",
    "model.end_size",
)
WORDS = (
    "strip.far_end",
    "strip.plane",
    "contact.law",
    "contact.normal",
    "load.control",
    "model.fields",
    "model.kinematics",
    "model.grid",
    "model.constants",
    "model.squeeze",
    "model.solution",
    "model.rung",
)
KEYS = NUMBERS + SETTINGS + WORDS
OPTIONAL = ("strip.layers", "strip.curvature")  # may be None

_LAWS: dict[str, type[FrictionLaw]] = {
    "elastic-slip": ElasticSlip,
    "smooth-cap": CappedTrial,
    "tanh-increment": TanhIncrement,
}


class Scene(eqx.Module):
    """A strip, its contact, its load and the model of it.

    Attributes
    ----------
    strip, contact, load, model : the parts
    energy : the user's own strain energy Phi(e, g, k, psi, psi') per unit length, any JAX function
        of five scalars (an `equinox.Module` may carry parameters); None is the homogeneous section
    """

    strip: Strip = eqx.field(default_factory=Strip)
    contact: Contact = eqx.field(default_factory=Contact)
    load: Load = eqx.field(default_factory=Load)
    model: Model = eqx.field(default_factory=Model)
    energy: Energy | None = None

    def __check_init__(self) -> None:
        for name, kind in SECTIONS.items():
            part = getattr(self, name)
            require(name, part, isinstance(part, kind), f"give a jbeamshell.{kind.__name__}")
        self._check_rung()
        self._check_contact()
        if self.energy is None:
            return
        fix = "must be a function of (e, g, k, psi, psi')"
        require("energy", self.energy, callable(self.energy), fix)
        probe = [jax.ShapeDtypeStruct((), self.strip.length.dtype)] * 5
        try:
            shape = jax.eval_shape(self.energy, *probe)
        except TypeError as error:
            raise InputError(f"energy: {fix}; {error}") from None
        require(
            "energy",
            self.energy,
            getattr(shape, "shape", None) == (),
            f"must return one number, not {shape}",
        )

    def strain_energy(self) -> Energy:
        """Phi(e, g, k, psi, psi') of this scene's section."""
        if self.energy is not None:
            return self.energy
        strip = self.strip
        squeeze = "psi" in self.model.fields and self.model.squeeze == "field"
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

    def hierarchic_section(self) -> Hierarchic | None:
        """The section of order p; None where the beamshell's is meant."""
        strip, model = self.strip, self.model
        if model.order == 0:
            return None
        return Hierarchic(
            half_height=strip.half_height,
            plane_modulus=strip.plane_modulus,
            poisson_ratio=jnp.asarray(strip.poisson_ratio),
            order=model.order,
            kinematics=model.kinematics,
            plane=strip.plane,
        )

    def _check_rung(self) -> None:
        """What the model cannot represent."""
        strip, contact, model = self.strip, self.contact, self.model
        plain = self.energy is None and strip.layers is None and strip.curvature is None
        fix = "is for a straight homogeneous strip without an energy of its own; take 0"
        require("model.order", model.order, model.order == 0 or plain, fix)
        uniform = contact.pressure.ndim == 0 and contact.bottom_pressure.ndim == 0
        bar = plain and uniform and contact.normal == "rigid"
        closed = model.solution == "closed-form"
        fix = "is the bar's, homogeneous, straight, under one pressure: take another model.rung"
        require("model.solution", model.solution, bar or not closed, fix)
        either = model.solution == "stepwise" or self.load.control in CONTROLS
        require("model.solution", model.solution, either, "knows no arc length: take 'stepwise'")
        cycling = model.solution == "stepwise" or self.load.cycles > 0
        fix = "doubles a backbone for load.cycles, of which there are none: take 'stepwise'"
        require("model.solution", model.solution, cycling, fix)
        half = self.load.steps_per_half_cycle
        fix = "a backbone that is doubled needs an even number"
        enough = model.solution == "stepwise" or half % 2 == 0
        require("load.steps_per_half_cycle", half, enough, fix)
        if not isinstance(contact.friction, jax.core.Tracer):
            rubs = not closed or float(contact.friction) > 0.0
            require("contact.friction", contact.friction, rubs, "the bar needs friction")

    def _check_contact(self) -> None:
        """What the parts cannot see alone: a strip that nothing holds, a load off the strip."""
        strip, contact, fields = self.strip, self.contact, self.model.fields
        lift = "w" in fields
        needs = "needs w in model.fields"
        require("contact.normal", contact.normal, lift or contact.normal == "rigid", needs)
        require("strip.curvature", strip.curvature, lift or strip.curvature is None, needs)
        layered = self.model.squeeze == "assumed" and strip.layers is not None
        require("model.squeeze", "assumed", not layered, "is for a homogeneous strip")
        if contact.normal == "none":
            held = strip.far_end == "held"
            fix = "is all that holds a strip without a foundation: take 'held' (rigid-body motion)"
            require("strip.far_end", strip.far_end, held, fix)
        leaves = (strip.length, contact.friction, contact.pressure, contact.bottom_pressure)
        if any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
            return
        rough = float(contact.friction) > 0.0 or strip.far_end != "free"
        fix = "nothing holds the strip along X without friction (rigid-body motion): give "
        require("contact.friction", 0.0, rough, fix + "strip.far_end or friction")
        length = float(strip.length)
        _check_on_strip("contact.pressure", contact.pressure, length)
        _check_on_strip("contact.bottom_pressure", contact.bottom_pressure, length)
        down, _ = resultant(contact.pressure, length, table=contact.pressure.ndim == 2)
        require("contact.pressure", contact.pressure, bool(down > 0.0), "must press somewhere")
        total, moment = contact.resultant(length)
        fix = "overflows together with contact.pressure: take other units"
        require("strip.length", length, bool(np.isfinite(moment)), fix)
        if contact.normal != "none":
            fix = "nothing holds the strip down (rigid-body motion): press more on top"
            require("contact.bottom_pressure", contact.bottom_pressure, total > 0.0, fix)
            upright = strip.far_end == "held" or not lift
            inside = upright or 0.0 <= moment <= total * length
            fix = "the strip tips over (rigid-body motion): the pressures' resultant misses it"
            require("contact.bottom_pressure", contact.bottom_pressure, inside, fix)

    @property
    def slip_stiffness(self) -> Array:
        """Elastic stiffness k_t = alpha G/H of the sliders, traction per slip."""
        strip = self.strip
        return self.contact.stick_stiffness * strip.shear_modulus / strip.half_height

    def get(self, key: str) -> Any:
        """The value behind a dotted key, e.g. ``scene.get("strip.height_ratio")``."""
        check_key(key)
        section, name = key.split(".")
        if key == "contact.law":
            return _law_name(self.contact.law)
        return getattr(getattr(self, section), name)

    def replace(self, values: Mapping[str, Any]) -> Scene:
        """A copy with other values, e.g. ``scene.replace({"contact.friction": 0.2})``.

        Keys are those of the TOML file and the command line; values may be traced, so gradients and
        batches reach every number through it.
        """
        known = isinstance(values, Mapping)
        require("values", values, known, "give a dictionary, such as {'contact.friction': 0.2}")
        for key, value in values.items():
            check_key(key)
            _check_word(key, value)
            if DERIVED.get(key) in values:
                raise InputError(f"{key} and {DERIVED[key]} say the same thing: give one of them")
        values = spelled_out(dict(values), self.model.fields)
        parts: dict[str, dict[str, Any]] = {section: {} for section in SECTIONS}
        for key, value in values.items():
            if key not in DERIVED:
                section, name = key.split(".")
                parts[section][name] = value
        if "strip.half_height" in values:
            height = as_leaf(values["strip.half_height"], "strip.half_height")
            require_number("strip.half_height", height)
            length = parts["strip"].get("length", self.strip.length)
            parts["strip"]["height_ratio"] = 2.0 * height / as_leaf(length, "strip.length")
        if parts["strip"].get("layers") is not None:
            # The layers say what the stiffness and nu are; giving both is refused by the strip.
            for name in ("axial_stiffness", "poisson_ratio"):
                parts["strip"].setdefault(name, None)
        contact = parts["contact"]
        if "law" in contact or "smoothing" in contact:
            contact["law"] = _make_law(self.contact.law, contact)
        # A number keeps its meaning when the control changes only if it is given anew.
        if parts["load"].get("control", self.load.control) != self.load.control:
            parts["load"].setdefault("amplitude", None)
        fresh = {
            section: dataclasses.replace(getattr(self, section), **changes) if changes else None
            for section, changes in parts.items()
        }
        scene = dataclasses.replace(self, **{k: v for k, v in fresh.items() if v is not None})
        if "strip.youngs_modulus" in values:
            strip = _with_youngs_modulus(scene.strip, values["strip.youngs_modulus"])
            scene = dataclasses.replace(scene, strip=strip)
        return scene


def _check_on_strip(key: str, pressure: Any, length: float) -> None:
    table = np.asarray(pressure, dtype=float)
    if table.ndim == 2:
        x = table[:, 0]
        off = (x < 0.0) | (x > length * (1.0 + 1e-12))
        fix = f"lies off the strip, whose X runs from 0 to {length:.6g}"
        require(key, x[off], not np.any(off), fix)


def check_key(key: str) -> None:
    """Raise `InputError` for a key that does not exist, with the nearest one that does."""
    if not isinstance(key, str):
        raise InputError(f"{key!r}: is no key; keys are {', '.join(KEYS)}")
    if key not in KEYS:
        near = difflib.get_close_matches(key, KEYS, 1)
        hint = f"did you mean {near[0]!r}?" if near else f"keys are {', '.join(KEYS)}"
        raise InputError(f"unknown key {key!r}: {hint}")


def _with_youngs_modulus(strip: Strip, value: Any) -> Strip:
    key = "strip.youngs_modulus"
    value = as_leaf(value, key)
    require_number(key, value)
    require(key, value, strip.layers is None, "strip.layers say it already; leave it out")
    nu = jnp.asarray(strip.poisson_ratio)
    plane = value if strip.plane == "stress" else value / (1.0 - nu**2)
    return dataclasses.replace(strip, axial_stiffness=plane * 2.0 * strip.half_height)


def _make_law(current: FrictionLaw, contact: dict[str, Any]) -> FrictionLaw:
    name = contact.pop("law", _law_name(current))
    given = contact.pop("smoothing", None)
    smoothing = getattr(current, "smoothing", "sharp") if given is None else given
    m = np.inf if isinstance(smoothing, str) else smoothing
    exponent = as_leaf(m, "contact.smoothing", SMOOTHING)
    sharp = not isinstance(exponent, jax.core.Tracer) and bool(np.all(np.isposinf(exponent)))
    require("contact.smoothing", m, exponent.ndim == 0, SMOOTHING)
    if name == "elastic-slip":
        return SharpSlip() if sharp else ElasticSlip(exponent)
    if name == "smooth-cap":
        return CappedTrial() if sharp else CappedTrial(exponent)
    unused = given is None or sharp
    require("contact.smoothing", given, unused, f"contact.law {name!r} has none; leave it out")
    return name if isinstance(name, FrictionLaw) else TanhIncrement()


def _law_name(law: FrictionLaw) -> Any:
    if isinstance(law, SharpSlip):
        return "elastic-slip"
    return next((name for name, kind in _LAWS.items() if type(law) is kind), law)


def _check_word(key: str, value: Any) -> None:
    """Types of the static values; numbers check theirs when they become leaves."""
    if key == "contact.law":
        known = isinstance(value, FrictionLaw) or (isinstance(value, str) and value in LAWS)
        require(key, value, known, f"choose {' or '.join(map(repr, LAWS))}")
    elif key == "contact.smoothing" and isinstance(value, str):
        require(key, value, value == "sharp", SMOOTHING)
    elif key == "model.fields":
        words = isinstance(value, list | tuple) and all(isinstance(f, str) for f in value)
        require(key, value, words, "give a list such as ['v', 'beta', 'psi']")
    elif key in WORDS:
        require(key, value, isinstance(value, str), "must be a word")
    elif key in NUMBERS and key not in OPTIONAL:
        require(key, value, value is not None, "must be a number")


def scene_from_values(values: Mapping[str, Any]) -> Scene:
    """A scene from dotted keys on top of the standard strip."""
    if values.get("load.control") in LENGTHS and "load.amplitude" not in values:
        return Scene(load=Load(values["load.control"]))  # says what is missing
    return Scene().replace(values)


def overridden(values: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted keys with others on top; half_height replaces height_ratio and the like."""
    same = DERIVED | {primary: derived for derived, primary in DERIVED.items()}
    for given in (values, overrides):
        if "model.rung" in given:
            _check_word("model.rung", given["model.rung"])
    values = spelled_out(dict(values))
    overrides = spelled_out(dict(overrides), values.get("model.fields", ()))
    displaced = {same[key] for key in overrides if key in same}
    return {k: v for k, v in values.items() if k not in displaced} | dict(overrides)


def read_values(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The dotted keys of a TOML file, flat."""
    values: dict[str, Any] = {}
    for section, table in read_toml(path).items():
        if section not in SECTIONS:
            raise InputError(
                f"{path}: unknown section {section!r}; sections are {', '.join(SECTIONS)}"
            )
        if not isinstance(table, dict):
            raise InputError(f"{path}: {section} must be a table: write [{section}] above its keys")
        values |= {f"{section}.{name}": value for name, value in table.items()}
    return values


def read_scene(path: str | os.PathLike[str]) -> Scene:
    """The scene described by a TOML file; what it leaves out is the standard strip's."""
    return scene_from_values(read_values(path))


def scene_to_toml(scene: Scene) -> str:
    """TOML text that `read_scene` turns into the same scene, to the last bit."""
    require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
    if scene.energy is not None or not isinstance(_law_name(scene.contact.law), str):
        raise InputError(
            "energy, law: a user's own function cannot be written to TOML; keep it in code"
        )
    tables: dict[str, dict[str, Any]] = {section: {} for section in SECTIONS}
    for key in KEYS:
        if key in DERIVED or key == "model.rung":
            continue
        section, name = key.split(".")
        value = scene.get(key)
        if value is None:  # no layers, no curvature
            continue
        if key in NUMBERS:
            value = np.asarray(value, dtype=float).tolist()
        if key == "contact.smoothing" and np.isinf(value):
            value = "sharp"
        tables[section][name] = list(value) if isinstance(value, tuple) else value
    return tomli_w.dumps(tables)


def write_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write the scene as TOML, whole or not at all."""
    write_text(path, scene_to_toml(scene))
