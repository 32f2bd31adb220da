"""Structure in place of a strip: what a fit builds from a scene and a few numbers of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import as_leaf, is_staged, is_traced, require, require_number
from jbeamshell.common.errors import InputError, warn_of_doubts
from jbeamshell.dynamics.structure.joint import Joint
from jbeamshell.dynamics.structure.matrices import Attachment, Structure
from jbeamshell.dynamics.structure.modal import ModalCurve, by_statics
from jbeamshell.identify.models import Model
from jbeamshell.identify.parameters import OF_STRUCTURE
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.toml import scene_to_toml

REACH = 0.9  # force up to which a joint is computed, over its gross slip
UNTRACED = (jax.errors.ConcretizationTypeError, jax.errors.TracerArrayConversionError)
TRACED = (
    "JAX traces its numbers in a fit: take jax.numpy in place of numpy and math, and no float(), "
    "int() or if on them"
)
NUMBERS = "give numbers by name, such as {'damping_ratio': 0.001}"

Build = Callable[[Scene | None, Mapping[str, Array]], Structure]


class Assembly(Model):
    """Structure with joints, built from a scene and a few numbers, in place of a strip.

    Attributes
    ----------
    build : function of the scene and the numbers that returns a `jbeamshell.dynamics.Structure`;
        JAX traces it
    scene : scene of the joints; None if the function needs none
    numbers : numbers by name; the key of a ``stiffness`` among them is ``structure.stiffness``
    mode : number of the measured mode, counted from 0
    point : degree of freedom whose displacement amplitudes were measured; None is the modal
        displacement
    driven : degree of freedom that a force drives; None is that of ``point``

    Raises
    ------
    InputError
        for numbers that are none, or places that are no whole numbers

    Examples
    --------
    ::

        def beam(scene, numbers):
            joint = Joint.of(scene, 1.2).times(25.0).in_series(numbers["spring"])
            ratio = numbers["damping_ratio"]
            return Structure(mass, stiffness, [Attachment(joint, 0, 1)], damping_ratio=ratio)

        numbers = {"spring": 1e5, "damping_ratio": 1e-3}
        model = jb.identify.Assembly(beam, jb.Scene(), numbers, point=3)
        fit = jb.identify.fit([frequency, damping], model, ["structure.spring"])
    """

    build: Build
    scene: Scene | None
    numbers: dict[str, Array]
    kind: ClassVar[str] = "a structure"
    mode: int = eqx.field(static=True)
    point: int | None = eqx.field(static=True)
    driven: int | None = eqx.field(static=True)

    def __init__(
        self,
        build: Build,
        scene: Scene | None = None,
        numbers: Mapping[str, Any] | None = None,
        *,
        mode: int = 0,
        point: int | None = None,
        driven: int | None = None,
    ) -> None:
        require("build", build, callable(build), "give a function of a scene and numbers")
        given = {} if numbers is None else numbers
        named = isinstance(given, Mapping) and all(isinstance(name, str) for name in given)
        require("numbers", given, named, NUMBERS)
        for name, place in {"mode": mode, "point": point, "driven": driven}.items():
            whole = isinstance(place, int) and place >= 0
            missing = place is None and name != "mode"
            require(name, place, whole or missing, "give a whole number, counted from 0")
        self.build, self.scene = build, scene
        self.numbers = {name: as_leaf(value, name, NUMBERS) for name, value in given.items()}
        self.mode, self.point, self.driven = mode, point, driven

    @classmethod
    def of(
        cls,
        scene: Scene,
        mass: ArrayLike,
        stiffness: ArrayLike,
        joint: Sequence[int | None] = (0, None),
        *,
        width: float = 1.0,
        damping_ratio: float = 0.0,
        series_stiffness: float | None = None,
        reach: float = REACH,
        mode: int = 0,
        point: int | None = None,
        driven: int | None = None,
    ) -> Self:
        """Structure with a strip as its joint, whose numbers a fit may change.

        Its keys are those of the scene, and ``structure.mass`` and ``structure.stiffness``, factors
        of the matrices that start from 1; ``structure.width``, ``structure.damping_ratio`` and
        ``structure.series_stiffness``.

        Parameters
        ----------
        scene : strip or lap joint
        mass, stiffness : (n, n) matrices without the joint
        joint : its two degrees of freedom; None is the ground
        width : width of the strip, where its forces are for one unit of width
        damping_ratio : of all modes, besides that of the joint
        series_stiffness : stiffness of a spring in series with the joint; None is rigid
        reach : force up to which the joint is computed, over its gross slip; a moment is the
            scene's own
        mode, point, driven : see `Assembly`

        Raises
        ------
        InputError
            for matrices that are no square ones, numbers out of bounds, or two widths

        Examples
        --------
        >>> model = Assembly.of(jb.Scene(), [[2.0]], [[1e4]], point=0, damping_ratio=1e-3)
        >>> float(model.get("structure.damping_ratio"))
        0.001
        """
        require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
        require_number("reach", reach, "give a part of gross slip, from 0 to 1", 0.0, 1.0)
        pair = isinstance(joint, list | tuple) and 0 < len(joint) <= 2
        require(
            "joint", joint, pair, "give two degrees of freedom, or one that is held by the ground"
        )
        fix = "the scene has a strip.width already: leave width out"
        require("width", width, width == 1.0 or scene.strip.width is None, fix)
        first, second = (*joint, None)[:2]
        require("joint", joint, isinstance(first, int), "give a degree of freedom first")
        assert isinstance(first, int)
        numbers = {"mass": 1.0, "stiffness": 1.0, "width": width, "damping_ratio": damping_ratio}
        if series_stiffness is not None:
            numbers["series_stiffness"] = series_stiffness
        matrices = as_leaf(mass, "mass"), as_leaf(stiffness, "stiffness")
        plain = _Plain(*matrices, (first, second), float(reach))
        return cls(plain, scene, numbers, mode=mode, point=point, driven=driven)

    @property
    def control(self) -> str:
        return "displacement"

    def get(self, key: str) -> Any:
        """Number of the structure, or of its scene, by dotted key."""
        name = key.removeprefix(OF_STRUCTURE)
        if name == key:
            require(key, "no scene", self.scene is not None, "give the assembly a scene")
            assert self.scene is not None
            return self.scene.get(key)
        if name not in self.numbers:
            known = ", ".join(OF_STRUCTURE + own for own in self.numbers) or "none"
            raise InputError(f"unknown key {key!r}: numbers of this structure are {known}")
        return self.numbers[name]

    def replace(self, values: Mapping[str, Any]) -> Self:
        """Copy with other numbers, by dotted key; they may be traced."""
        own = {k.removeprefix(OF_STRUCTURE): v for k, v in values.items() if OF_STRUCTURE in k}
        of_scene = {key: value for key, value in values.items() if OF_STRUCTURE not in key}
        for key in of_scene:
            self.get(key)
        scene = self.scene.replace(of_scene) if of_scene and self.scene else self.scene
        return type(self)(
            self.build,
            scene,
            self.numbers | own,
            mode=self.mode,
            point=self.point,
            driven=self.driven,
        )

    def as_toml(self) -> str:
        return "" if self.scene is None else scene_to_toml(self.scene)

    def structure(self) -> Structure:
        """Structure with these numbers."""
        try:
            built = self.build(self.scene, self.numbers)
        except UNTRACED as error:
            raise InputError(f"build: {TRACED}") from error
        fix = "must return a jbeamshell.dynamics.Structure"
        require("build", built, isinstance(built, Structure), fix)
        for name, place in {"point": self.point, "driven": self.driven}.items():
            fix = f"give a degree of freedom from 0 to {built.size - 1}"
            require(name, place, place is None or place < built.size, fix)
        return built

    def curve(self, amplitudes: ArrayLike) -> ModalCurve:
        """Frequency and damping of the mode over the displacement amplitudes of the point.

        Warns
        -----
        DoubtfulWarning
            as `jbeamshell.dynamics.modal_curve` does; `response` does not
        """
        found = self.response(amplitudes)[0]
        if not (is_traced(found) or is_staged()):
            warn_of_doubts(found.doubts)
        return found

    def response(self, amplitudes: ArrayLike) -> tuple[ModalCurve, Array]:
        """Curve as `curve` has it, and the modal force of a unit force at the driven point.

        The second is over the displacement of the point per modal displacement, so that it is the
        inverse of a modal mass.
        """
        structure = self.structure()
        shapes = structure.modes(self.mode + 1).shapes
        shape = jnp.asarray(shapes)[:, self.mode]
        seen = jnp.asarray(1.0) if self.point is None else jnp.abs(shape[self.point])
        driven = self.point if self.driven is None else self.driven
        felt = jnp.asarray(1.0) if driven is None else jnp.abs(shape[driven])
        found = by_statics(structure, jnp.asarray(amplitudes) / seen, self.mode)
        return found.but(amplitude=amplitudes), felt * seen


class _Plain(eqx.Module):
    """Structure with one strip as its joint; see `Assembly.of`."""

    mass: Array
    stiffness: Array
    ends: tuple[int, int | None] = eqx.field(static=True)
    reach: float = eqx.field(static=True)

    def __call__(self, scene: Scene | None, numbers: Mapping[str, Array]) -> Structure:
        assert scene is not None
        forced = scene.load.kind == "force"
        force = self.reach * scene.gross_slip if forced else scene.get("load.amplitude")
        joint = Joint.of(scene, force).times(numbers["width"])
        if "series_stiffness" in numbers:
            joint = joint.in_series(numbers["series_stiffness"])
        return Structure(
            numbers["mass"] * self.mass,
            numbers["stiffness"] * self.stiffness,
            [Attachment(joint, *self.ends)],
            damping_ratio=numbers["damping_ratio"],
        )
