"""The parts of a Scene: strip, contact, load and model.

Their defaults are the standard strip (after Brink 2015, chapter III, with chapter IV's squeeze
strain): L = 2, mu = 0.1, F_N = 10, nu = 0.3, E' 2H = 3.4e4, eta = 0.1126, A = 0.7855.  Numbers are
leaves of a pytree, words and counts are static.  Every part checks itself when it is made.
"""

from __future__ import annotations

from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import (
    NOT_NEGATIVE,
    NUMBER,
    POSITIVE,
    TINY,
    as_leaf,
    as_plain,
    as_words,
    number_leaf,
    require,
    require_choice,
    require_count,
    require_number,
    static_word,
)
from jbeamshell.mechanics.elements import END_SIZE, ORDER
from jbeamshell.mechanics.friction import FrictionLaw, SharpSlip, takes_smoothing
from jbeamshell.mechanics.homogeneous import CONSTANTS, PLANES, shear_modulus
from jbeamshell.mechanics.kinematics import FIELDS, KINEMATICS
from jbeamshell.mechanics.laminate import Laminate, check_layers
from jbeamshell.scene.pressure import PRESSURE, check_pressure, pressure_values, resultant
from jbeamshell.scene.rungs import LARGEST_ORDER, name_of

FAR_ENDS = {"held": ("v", "beta"), "pinned": ("v",), "free": ()}  # fields held at X = 0
CONTROLS = ("force", "displacement")
ARC_LENGTH = "arc-length"
NORMALS = ("rigid", "compliant", "none")
SQUEEZES = ("field", "assumed")
SOLUTIONS = ("stepwise", "masing", "masing-pull", "closed-form")
MODELS = (
    ("v",),
    ("v", "beta"),
    ("v", "beta", "psi"),
    ("v", "w", "beta"),
    ("v", "w", "beta", "psi"),
)
STANDARD_AMPLITUDE = 0.7855
STANDARD = {"axial_stiffness": 3.4e4, "poisson_ratio": 0.3}
MOST_LEVELS = 10**7  # of a load path
SMOOTHING = "must be a number above 1, or 'sharp'"
LAYERS = "give [thickness, E, nu] of every layer, from the bottom to the top"


class Strip(eqx.Module):
    """Geometry and material of the strip.

    Attributes
    ----------
    length : L
    height_ratio : eta = H/(L/2), with H the HALF height
    axial_stiffness : E' 2H, force per unit width; E' = E/(1-nu^2) in plane strain, E in plane
        stress; None when there are layers
    poisson_ratio : nu; None when there are layers
    kappa_s : squeeze-shear factor
    far_end : support at X = 0: "held" (v = beta = 0), "pinned" (v = 0: held at the contact point
        only) or "free"
    layers : (n, 3) thickness, E and nu of every layer from the bottom to the top; None is a
        homogeneous strip
    deviation : height above the middle of the curve at which a laminate's shear is split from its
        squeeze-shear (the base-reference deviation)
    plane : "strain" or "stress"
    curvature : alpha' before loading, 1/length, positive when the ends point up; None is straight
    """

    length: Array
    height_ratio: Array
    axial_stiffness: Array | None
    poisson_ratio: Array | None
    kappa_s: Array
    far_end: str = eqx.field(static=True)
    layers: Array | None
    deviation: Array
    plane: str = eqx.field(static=True)
    curvature: Array | None

    def __init__(
        self,
        length: Any = 2.0,
        height_ratio: Any = 0.1126,
        axial_stiffness: Any = None,
        poisson_ratio: Any = None,
        kappa_s: Any = 0.44,
        far_end: str = "held",
        layers: Any = None,
        deviation: Any = 0.0,
        plane: str = "strain",
        curvature: Any = None,
    ) -> None:
        self.length = as_leaf(length, "strip.length")
        self.height_ratio = as_leaf(height_ratio, "strip.height_ratio")
        material = {"axial_stiffness": axial_stiffness, "poisson_ratio": poisson_ratio}
        for name, value in material.items():
            key, twice = f"strip.{name}", layers is not None and value is not None
            require(key, value, not twice, "strip.layers say it already; leave it out")
            if layers is None:
                material[name] = as_leaf(STANDARD[name] if value is None else value, key)
        self.axial_stiffness = material["axial_stiffness"]
        self.poisson_ratio = material["poisson_ratio"]
        self.kappa_s = as_leaf(kappa_s, "strip.kappa_s")
        self.far_end = as_plain(far_end)
        self.layers = None if layers is None else as_leaf(layers, "strip.layers", LAYERS)
        self.deviation = as_leaf(deviation, "strip.deviation")
        self.plane = as_plain(plane)
        bend = None if curvature is None else as_leaf(curvature, "strip.curvature")
        known = bend is not None and bend.ndim == 0 and not isinstance(bend, jax.core.Tracer)
        straight = bend is None or (known and not np.any(bend))
        self.curvature = None if straight else bend

    def __check_init__(self) -> None:
        require_number("strip.length", self.length)
        require_number("strip.height_ratio", self.height_ratio, POSITIVE + " (H over L/2)")
        require_choice("strip.plane", self.plane, PLANES)
        if self.layers is not None:
            check_layers(self.layers, 2.0 * self.half_height, self.plane)
        else:
            require_number("strip.axial_stiffness", self.axial_stiffness, POSITIVE + " (E' 2H)")
            between = "must lie between -1 and 0.5 (both excluded)"
            require_number("strip.poisson_ratio", self.poisson_ratio, between, -1.0, 0.5)
        require_number("strip.kappa_s", self.kappa_s, POSITIVE + "; 0.44 fits the squeeze layer")
        require_number("strip.deviation", self.deviation, NUMBER, -np.inf)
        require_choice("strip.far_end", self.far_end, tuple(FAR_ENDS))
        if self.curvature is not None:
            require_number("strip.curvature", self.curvature, NUMBER, -np.inf)

    @property
    def half_height(self) -> Array:
        """H, length."""
        return 0.5 * self.height_ratio * self.length

    @property
    def section(self) -> Laminate | None:
        """The laminated section; None for a homogeneous strip."""
        if self.layers is None:
            return None
        return Laminate(self.layers, self.kappa_s, self.deviation, self.plane)

    @property
    def stretching_stiffness(self) -> Array:
        """E' 2H, or its sum over the layers, force per unit width."""
        if self.section is not None:
            return self.section.stretching_stiffness
        return cast(Array, self.axial_stiffness)  # as it is: NumPy's stays NumPy's

    @property
    def plane_modulus(self) -> Array:
        """E' (of the mean stiffness where there are layers), stress."""
        return self.stretching_stiffness / (2.0 * self.half_height)

    @property
    def youngs_modulus(self) -> Array | None:
        """E, stress; None when there are layers."""
        if self.poisson_ratio is None:
            return None
        if self.plane == "stress":
            return self.plane_modulus
        return self.plane_modulus * (1.0 - self.poisson_ratio**2)

    @property
    def shear_modulus(self) -> Array:
        """G (the mean over the height where there are layers), stress."""
        if self.section is not None:
            return self.section.mean_shear_modulus
        return shear_modulus(self.plane_modulus, cast(Array, self.poisson_ratio), self.plane)


class Contact(eqx.Module):
    """The rough foundation and what presses the strip onto it.

    A pressure is one number, or a table (n, 2) of X and pressure, linear in between, going on with
    its end values; two rows of the same X make a step.  It acts exactly, wherever its steps fall.

    Attributes
    ----------
    friction : mu; 0 is a frictionless foundation
    pressure : F_N on the top face, stress, positive pressing down
    bottom_pressure : on the bottom face, stress, positive pressing up
    stick_stiffness : alpha; the elastic slip stiffness is k_t = alpha G/H
    law : one contact point's friction law
    normal : "rigid" (gap >= 0, R >= 0 where the lift w is a field, else glued), "compliant" (a
        layer that lets derivatives pass) or "none" (no foundation)
    normal_stiffness : k_n of the compliant layer in units of E'/H
    """

    friction: Array = number_leaf("contact.friction", 0.1)
    pressure: Array = number_leaf("contact.pressure", 10.0, PRESSURE)
    bottom_pressure: Array = number_leaf("contact.bottom_pressure", 0.0, PRESSURE)
    stick_stiffness: Array = number_leaf("contact.stick_stiffness", 1000.0)
    law: FrictionLaw = eqx.field(default_factory=SharpSlip)
    normal: str = static_word("rigid")
    normal_stiffness: Array = number_leaf("contact.normal_stiffness", 50.0)

    def __check_init__(self) -> None:
        require_number("contact.friction", self.friction, NOT_NEGATIVE, low=-TINY)
        require_number("contact.stick_stiffness", self.stick_stiffness)
        law = isinstance(self.law, FrictionLaw)
        require("contact.law", self.law, law, "give a jbeamshell.mechanics.friction.FrictionLaw")
        if takes_smoothing(self.law):
            require_number("contact.smoothing", self.smoothing, SMOOTHING, low=1.0)
        require_choice("contact.normal", self.normal, NORMALS)
        require_number("contact.normal_stiffness", self.normal_stiffness)
        for key in ("pressure", "bottom_pressure"):
            pressure = getattr(self, key)
            if not isinstance(pressure, jax.core.Tracer):
                check_pressure(f"contact.{key}", np.asarray(pressure))
        if not isinstance(self.pressure, jax.core.Tracer):
            presses = bool(np.any(pressure_values(np.asarray(self.pressure)) > 0.0))
            require("contact.pressure", self.pressure, presses, "must press somewhere")

    @property
    def smoothing(self) -> Array:
        """The exponent m of the friction law; infinity for the sharp slider."""
        return getattr(self.law, "smoothing", jnp.asarray(np.inf))

    def resultant(self, length: ArrayLike) -> tuple[float, float]:
        """Force of the pressures on a strip of that length, down, and its moment about X = 0."""
        down, turning = resultant(self.pressure, length, table=self.pressure.ndim == 2)
        up, lifting = resultant(self.bottom_pressure, length, table=self.bottom_pressure.ndim == 2)
        return float(down - up), float(turning - lifting)

    @property
    def largest_pressure(self) -> Array:
        """Largest F_N on the top face."""
        return jnp.max(self.pressure[:, 1]) if self.pressure.ndim else self.pressure


class Load(eqx.Module):
    """What is done to the loaded end X = L after the pressure.

    Attributes
    ----------
    control : "force" (F, force per unit width), "displacement" (u(L), mid-height face average) or
        "arc-length": the way along the path of u and F L/(E' 2H), a length, which goes on where
        either turns back by itself (Riks 1979, with a plane for the arc)
    amplitude : A, of the controlled quantity; no default under displacement control
    cycles : full cycles A, -A, A after the first loading 0 to A; 0 is the pressure alone
    steps_per_half_cycle : equal load steps from -A to A, an even number, or 1
    pressure_steps : equal steps in which the pressure is applied, without friction
    """

    control: str = eqx.field(static=True)
    amplitude: Array
    cycles: int = eqx.field(static=True)
    steps_per_half_cycle: int = eqx.field(static=True)
    pressure_steps: int = eqx.field(static=True)

    def __init__(
        self,
        control: str = "force",
        amplitude: Any = None,
        cycles: int = 2,
        steps_per_half_cycle: int = 40,
        pressure_steps: int = 1,
    ) -> None:
        require_choice("load.control", control, (*CONTROLS, ARC_LENGTH))
        if amplitude is None:
            require(
                "load.amplitude",
                None,
                control == "force" or cycles == 0,
                f"give the amplitude under {control} control",
            )
            amplitude = STANDARD_AMPLITUDE
        self.control = control
        self.amplitude = as_leaf(amplitude, "load.amplitude")
        self.cycles = as_plain(cycles)
        self.steps_per_half_cycle = as_plain(steps_per_half_cycle)
        self.pressure_steps = as_plain(pressure_steps)

    def __check_init__(self) -> None:
        require_number("load.amplitude", self.amplitude)
        require_count("load.cycles", self.cycles, 0)
        require_count("load.pressure_steps", self.pressure_steps, 1)
        half = self.steps_per_half_cycle
        require_count("load.steps_per_half_cycle", half, 1)
        fix = "must be 1, or even, so that the path passes through zero"
        require("load.steps_per_half_cycle", half, half == 1 or half % 2 == 0, fix)
        few = 2 * self.cycles * half <= MOST_LEVELS
        fix = f"with {half} steps per half cycle are more than {MOST_LEVELS} load steps: take fewer"
        require("load.cycles", self.cycles, few, fix)

    def unit_path(self) -> np.ndarray:
        """Load levels after zero for unit amplitude: 0 to 1, then ``cycles`` times 1, -1, 1."""
        half = self.steps_per_half_cycle
        if self.cycles == 0:
            return np.zeros(0)
        down = 1.0 - 2.0 * np.arange(1, half + 1) / half
        quarter = max(half // 2, 1)
        first = np.arange(1, quarter + 1) / quarter
        return np.concatenate([first, *[down, -down] * self.cycles])


class Model(eqx.Module):
    """How much of the strip is modelled, and how finely.

    Attributes
    ----------
    fields : active section fields: ("v",) the bar, ("v", "beta") chapter III,
        ("v", "beta", "psi") with the squeeze strain
    kinematics : "exact" or "linear"
    grid : "finite-difference" (second order) or "collocation" (fourth)
    nodes : nodes along X
    constants : "consistent" or "printed" (the dissertation's own)
    squeeze : "field" (psi has its own balance) or "assumed" (psi = -(F_N + R)/(2E), the earlier
        theory of Brink 2015, section 4.2, without Poisson's effect)
    order : 0 is the beamshell; p from 1 up is a section of order p, see
        `jbeamshell.mechanics.hierarchic`
    solution : "stepwise" (Newton's method at every load level), "masing" (the loop is the mean
        backbone of a pull and a push, doubled), "masing-pull" (of a pull alone), or "closed-form"
        (Goodman's bar)
    end_size : size of the smallest elements, at the loaded end and at steps of the pressure, over
        H, before the node count scales all sizes
    """

    fields: tuple[str, ...] = eqx.field(
        static=True, default=("v", "beta", "psi"), converter=as_words
    )
    kinematics: str = static_word("exact")
    grid: str = static_word("finite-difference")
    nodes: int = static_word(161)
    constants: str = static_word("consistent")
    squeeze: str = static_word("field")
    order: int = static_word(0)
    solution: str = static_word("stepwise")
    end_size: float = static_word(END_SIZE)

    def __check_init__(self) -> None:
        require("model.fields", self.fields, isinstance(self.fields, tuple), "give a list of words")
        unknown = [f for f in self.fields if f not in FIELDS]
        require("model.fields", list(self.fields), not unknown, f"fields are {', '.join(FIELDS)}")
        require(
            "model.fields",
            list(self.fields),
            self.fields in MODELS,
            "make no model; choose " + " or ".join(str(list(m)) for m in MODELS),
        )
        require_choice("model.kinematics", self.kinematics, tuple(KINEMATICS))
        require_choice("model.grid", self.grid, tuple(ORDER))
        require_choice("model.constants", self.constants, CONSTANTS)
        require_choice("model.squeeze", self.squeeze, SQUEEZES)
        both = self.squeeze == "field" or {"w", "psi"} <= set(self.fields)
        require("model.squeeze", self.squeeze, both, "needs w and psi in model.fields")
        require_count("model.order", self.order, 0, LARGEST_ORDER)
        straight = {"beta", "psi"} <= set(self.fields) and self.squeeze == "field"
        fix = "needs beta and psi in model.fields, and the squeeze strain as a field"
        require("model.order", self.order, self.order == 0 or straight, fix)
        require_choice("model.solution", self.solution, SOLUTIONS)
        bar = self.solution != "closed-form" or self.fields == ("v",)
        require("model.solution", self.solution, bar, "is the bar's: take ['v'] as model.fields")
        size = as_leaf(self.end_size, "model.end_size", POSITIVE + " (of H)")
        require_number("model.end_size", size, POSITIVE + " (of H)")
        require_count("model.nodes", self.nodes, 3)
        require(
            "model.nodes",
            self.nodes,
            (self.nodes - 1) % ORDER[self.grid] == 0,
            "must be odd for the collocation grid (two elements' ends and their middle)",
        )

    @property
    def active(self) -> tuple[int, ...]:
        """Positions of the active fields among (v, w, beta, psi, and a section's further ones)."""
        return (*(FIELDS.index(f) for f in self.fields), *range(len(FIELDS), self.width))

    @property
    def rung(self) -> str:
        """Name of the model on the ladder; see `jbeamshell.scene.rungs`."""
        return name_of(self.fields, self.order, self.solution)

    @property
    def width(self) -> int:
        """How many fields a section has, active or not."""
        return len(FIELDS) + 2 * max(self.order - 1, 0)
