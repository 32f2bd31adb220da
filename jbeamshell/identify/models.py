"""Models that a fit changes: a strip, a law of a joint, or a structure with joints.

Each has numbers by dotted key, a column that drives it, and answers for the kinds of measurement
that it knows.  A structure is in `jbeamshell.identify.assembly`.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NoReturn, Self

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import require, require_choice
from jbeamshell.common.errors import InputError
from jbeamshell.contact_line.shared import Shared, shared
from jbeamshell.contact_line.strip import Strip
from jbeamshell.laws import Law, MasingLaw
from jbeamshell.measured.curves import AmplitudeCurve, DissipationCurve, StiffnessCurve
from jbeamshell.measured.loops import Loop
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.keys import CONTROLS
from jbeamshell.scene.load_path import check
from jbeamshell.scene.planning import may_be_elastic
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.toml import scene_to_toml
from jbeamshell.solving.solve import run

# Figure of a `History` that each curve over amplitude measures.
FIGURES: dict[type[AmplitudeCurve], str] = {
    DissipationCurve: "dissipation",
    StiffnessCurve: "secant_stiffness",
}
WITHIN, GROSS = 0.95, 0.99  # parts of the data and of gross slip, where data reach gross slip
FINER = 0.5  # part of the tolerance that plane elasticity keeps: fitted numbers amplify its error


class Model(eqx.Module):
    """Numbers by dotted key, and the answers to measurements that follow from them."""

    kind: ClassVar[str]  # in words

    @property
    @abc.abstractmethod
    def control(self) -> str:
        """Column that drives it, "force" or "displacement"."""

    @property
    def own(self) -> Any:
        """Object that a user knows: the scene, the law, or the structure itself."""
        return self

    @abc.abstractmethod
    def get(self, key: str) -> Any:
        """Number by its dotted key."""

    @abc.abstractmethod
    def replace(self, values: Mapping[str, Any]) -> Self:
        """Copy with other numbers, by dotted key; they may be traced."""

    def fitted(self, measurements: Sequence[Any]) -> Model:
        """Model that knows how far its measurements went, where that matters."""
        return self

    @property
    def tolerance(self) -> float:
        """Error of an answer, over its range, that the model's grid may leave; 0 without a grid."""
        return 0.0

    @property
    def small(self) -> bool:
        """True if its answers are small programs."""
        return False

    def serving(self, free: Sequence[str]) -> Model:
        """Model with settings that serve all values of free numbers."""
        return self

    def shared(self, vary: Sequence[str], figures: Sequence[str]) -> Shared | None:
        """Strip that its copies share while some numbers vary; None if each needs its own."""
        return None

    def prepared(self, strip: Strip) -> Model:
        """Model whose strip is known, so that a run need not condense it."""
        return self

    def as_toml(self) -> str:
        """TOML of its numbers; empty if there is none."""
        return ""

    def check_path(self, path: ArrayLike) -> None:
        """Raise `InputError` unless it follows a path of its driving column."""
        self.lacks("loop or backbone", "a Scene or a law")

    def check_amplitudes(self, amplitude: ArrayLike) -> None:
        """Raise `InputError` unless it has a steady cycle of all amplitudes."""
        self.lacks("work or stiffness of a cycle", "a Scene or a law")

    def along(self, path: Array, solver: Newton) -> tuple[Array, Array]:
        """Answering column (T,) on a path (T,) of the driving one, and if all of it converged."""
        self.lacks("loop", "a Scene or a law")

    def cycles(self, amplitude: Array, figure: Array, solver: Newton) -> tuple[Array, Array]:
        """Figures (n,) of the steady cycles of some amplitudes (n,), and if each converged.

        Parameters
        ----------
        amplitude : (n,) amplitudes of the driving column
        figure : (n,) index of the figure in `FIGURES`
        solver : settings of Newton's method
        """
        self.lacks("cycle", "a Scene or a law")

    def squeeze(self, x: Array, solver: Newton) -> tuple[Array, Array]:
        """Squeeze stress (n,) at positions (n,) under the pressures alone, and if it converged."""
        self.lacks("squeeze stress", "a Scene")

    def lacks(self, what: str, better: str) -> NoReturn:
        """Raise `InputError` that says what the model has not."""
        raise InputError(f"{what}: {self.kind} has none; give {better}")


class StripModel(Model):
    """Strip with its load.

    Attributes
    ----------
    scene : the scene
    strip : its strip on the contact line, if that is known
    """

    scene: Scene
    strip: Strip | None = None
    kind: ClassVar[str] = "a strip"

    @property
    def control(self) -> str:
        return self.scene.load.control

    @property
    def own(self) -> Scene:
        """The scene."""
        return self.scene

    def get(self, key: str) -> Any:
        return self.scene.get(key)

    def replace(self, values: Mapping[str, Any]) -> Self:
        return type(self)(self.scene.replace(values))

    @property
    def tolerance(self) -> float:
        """Tolerance of plane elasticity; 0 for other sections."""
        return float(self.scene.model.tolerance) if self.scene.plan.elastic else 0.0

    @property
    def small(self) -> bool:
        return self.scene.plan.on_contact_line

    def serving(self, free: Sequence[str]) -> Model:
        finer = {"model.tolerance": FINER * self.scene.model.tolerance}
        scene = self.scene.replace(finer if may_be_elastic(self.scene) else {})
        return type(self)(scene.serving(free).pinned())

    def shared(self, vary: Sequence[str], figures: Sequence[str]) -> Shared | None:
        return shared(self.scene, vary, figures)

    def prepared(self, strip: Strip) -> Model:
        return type(self)(self.scene, strip)

    def as_toml(self) -> str:
        return scene_to_toml(self.scene)

    def check_path(self, path: ArrayLike) -> None:
        """Raise `InputError` if a force exceeds gross slip."""
        check(self.scene, path)

    def check_amplitudes(self, amplitude: ArrayLike) -> None:
        """Raise `InputError` if a force exceeds gross slip."""
        check(self.scene, np.sort(np.asarray(amplitude)))

    def along(self, path: Array, solver: Newton) -> tuple[Array, Array]:
        history = run(self.scene, path, solver=solver, throw=False, strip=self.strip)
        response = history.displacement if self.control == "force" else history.force
        return response[history.pressed + 1 :], jnp.all(history.status == 0)

    def cycles(self, amplitude: Array, figure: Array, solver: Newton) -> tuple[Array, Array]:
        cycles = max(self.scene.load.cycles, 1)

        def one(point: tuple[Array, Array]) -> tuple[Array, Array]:
            at = self.scene.replace({"load.amplitude": point[0], "load.cycles": cycles})
            history = run(at, solver=solver, throw=False, strip=self.strip)
            figures = (getattr(history, name) for name in FIGURES.values())
            return lax.select_n(point[1], *figures), jnp.all(history.status == 0)

        return lax.map(one, (amplitude, figure))

    def squeeze(self, x: Array, solver: Newton) -> tuple[Array, Array]:
        history = run(self.scene.replace({"load.cycles": 0}), solver=solver, throw=False)
        stress = jnp.interp(x, history.middles, history.squeeze_stress[-1])
        return stress, jnp.all(history.status == 0)


class LawModel(Model):
    """Law of a joint in place of a strip.

    Attributes
    ----------
    law : the law
    by : column that drives it; a force on a path only where the law follows Masing's rule
    """

    law: Law
    by: str = eqx.field(static=True, default="displacement")
    kind: ClassVar[str] = "a law of a joint"

    def __check_init__(self) -> None:
        require_choice("load.control", self.by, CONTROLS)

    @property
    def control(self) -> str:
        return self.by

    @property
    def own(self) -> Law:
        """The law."""
        return self.law

    def get(self, key: str) -> Any:
        return self.law.get(key)

    def replace(self, values: Mapping[str, Any]) -> Self:
        return type(self)(self.law.replace(values), self.control)

    def fitted(self, measurements: Sequence[Any]) -> Model:
        """Model whose law knows how far measurements went, unless it slides well within."""
        law, far = self.law, 0.0
        if not np.isfinite(law.capacity):
            return self
        for item in measurements:
            if not isinstance(item, AmplitudeCurve):
                u = item.displacement
                closed = isinstance(item, Loop) and item.closed
                size = 0.5 * np.ptp(u) if closed else np.max(np.abs(u))
            else:
                size = np.max(item.amplitude)
                size = law.displacement(size) if self.control == "force" else size
            far = max(far, float(size))
        if law.backbone(WITHIN * far) >= GROSS * law.capacity:
            return self
        return type(self)(law.but(fitted_to=far), self.by)

    def as_toml(self) -> str:
        return self.law.as_toml()

    def check_path(self, path: ArrayLike) -> None:
        """Raise `InputError` for a law without loops, and forces that it cannot follow."""
        _ = self.law.stiffness  # raises for a law without loops
        if self.control == "force":
            fix = "follows displacements alone: let these drive it, or take a law such as iwan4"
            require("law driven by the force", self.law.heading, self.law.by_force, fix)
            self._check_forces(path)

    def check_amplitudes(self, amplitude: ArrayLike) -> None:
        """Raise `InputError` if a force reaches gross slip."""
        if self.control == "force":
            self._check_forces(amplitude)

    def along(self, path: Array, solver: Newton) -> tuple[Array, Array]:
        if self.control == "force" and isinstance(self.law, MasingLaw):
            response = self.law.path_displacements(path)
        else:
            response = self.law.path_forces(path)
        return response, jnp.all(jnp.isfinite(response))

    def cycles(self, amplitude: Array, figure: Array, solver: Newton) -> tuple[Array, Array]:
        law = self.law
        size = law.displacement(amplitude) if self.control == "force" else amplitude
        values = lax.select_n(figure, law.dissipation(size), law.secant_stiffness(size))
        return values, jnp.isfinite(values)

    def _check_forces(self, force: ArrayLike) -> None:
        """Raise `InputError` if forces reach gross slip at the start values."""
        law, largest = self.law, float(np.max(np.abs(np.asarray(force))))
        fix = f"reaches gross slip of {law.heading} at the start, {float(law.capacity):.6g}"
        require("force", largest, largest < float(law.capacity), f"{fix}: start from a larger one")


def as_model(given: Any) -> Model:
    """Model of a scene, of a law under a displacement, or a model as it is."""
    if isinstance(given, Scene):
        return StripModel(given)
    return LawModel(given) if isinstance(given, Law) else given
