"""Models that a fit runs: a strip, a law of a joint, or a structure with joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import require, require_choice
from jbeamshell.common.errors import InputError
from jbeamshell.contact_line.strip import Strip
from jbeamshell.identify.assembly import Assembly
from jbeamshell.identify.drive import Drive as Drive
from jbeamshell.laws import Law, MasingLaw, PowerLaw
from jbeamshell.measured.curves import AmplitudeCurve, DissipationCurve, StiffnessCurve
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.keys import CONTROLS
from jbeamshell.scene.load_path import check
from jbeamshell.scene.parts import Load
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.solve import run

# Figure of a `History` that each curve over amplitude measures.
FIGURES: dict[type[AmplitudeCurve], str] = {
    DissipationCurve: "dissipation",
    StiffnessCurve: "secant_stiffness",
}


class Driven(eqx.Module):
    """Law of a joint in place of a strip.

    Attributes
    ----------
    law : the law
    load : what drives it; a force on a path only where the law follows Masing's rule

    Examples
    --------
    >>> model = Driven(jb.laws.Iwan4(slip_force=2.0), Drive("force"))
    >>> model.get("iwan4.chi")
    """

    law: Law
    load: Drive = eqx.field(static=True, default=Drive())

    def __check_init__(self) -> None:
        require("law", self.law, isinstance(self.law, Law), "give a jbeamshell.laws.Law")
        require_choice("load.control", self.load.control, CONTROLS)

    def get(self, key: str) -> Any:
        """Number of the law by its dotted key."""
        return self.law.get(key)

    def replace(self, values: Mapping[str, Any]) -> Self:
        """Copy with other numbers of the law, by dotted key; they may be traced."""
        return type(self)(self.law.replace(values), self.load)


class Prepared(eqx.Module):
    """Scene whose strip on its contact line is known, so that a run need not condense it.

    Attributes
    ----------
    scene : the scene
    strip : its strip, which answers figures of the contact alone
    """

    scene: Scene
    strip: Strip

    @property
    def load(self) -> Load:
        """Load of the scene."""
        return self.scene.load


Model = Scene | Driven | Assembly
Runnable = Model | Prepared


def check_path(model: Model, path: ArrayLike) -> None:
    """Raise `InputError` if a model cannot follow a path of its driving column."""
    if isinstance(model, Scene):
        check(model, path)
        return
    driven = of_law("loop or backbone", model)
    law = driven.law
    _ = law.stiffness  # raises for a law without loops
    if driven.load.control == "force":
        fix = f"{law.heading} is driven by the displacement alone: take 'displacement'"
        require("load.control", "force", isinstance(law, MasingLaw), fix)
        check_forces(driven, path)


def check_amplitudes(model: Model, amplitude: ArrayLike) -> None:
    """Raise `InputError` if a model has no steady cycle of one of the amplitudes."""
    if isinstance(model, Scene):
        check(model, np.sort(np.asarray(amplitude)))
        return
    driven = of_law("work or stiffness of a cycle", model)
    if driven.load.control == "force":
        check_forces(driven, amplitude)


def check_forces(model: Driven, force: ArrayLike) -> None:
    """Raise `InputError` if forces reach a law's gross slip at its start values."""
    law, largest = model.law, float(np.max(np.abs(np.asarray(force))))
    fix = f"reaches gross slip of {law.heading} at the start, {float(law.capacity):.6g}: start from"
    require("force", largest, largest < float(law.capacity), f"{fix} a larger one")


def response_along(model: Runnable, path: Array, solver: Newton) -> tuple[Array, Array]:
    """Answering column (T,) on a path (T,) of the driving one, and whether all of it converged."""
    by_force = model.load.control == "force"
    scene, strip = _parts(model)
    if scene is not None:
        history = run(scene, path, solver=solver, throw=False, strip=strip)
        response = history.displacement if by_force else history.force
        return response[history.pressed + 1 :], jnp.all(history.status == 0)
    law = of_law("loop", model).law
    if by_force and isinstance(law, MasingLaw):
        response = law.path_displacements(path)
    else:
        response = law.path_forces(path)
    return response, jnp.all(jnp.isfinite(response))


def cycle_figures(
    model: Runnable, amplitude: Array, figure: Array, solver: Newton
) -> tuple[Array, Array]:
    """Figures (n,) of the steady cycles of some amplitudes (n,), and whether each converged.

    Parameters
    ----------
    model : strip, or law
    amplitude : (n,) amplitudes of the driving column
    figure : (n,) index of the figure in `FIGURES`
    solver : settings of Newton's method
    """
    scene, strip = _parts(model)
    if scene is not None:
        cycles = max(scene.load.cycles, 1)

        def one(point: tuple[Array, Array]) -> tuple[Array, Array]:
            to = {"load.amplitude": point[0], "load.cycles": cycles}
            history = run(scene.replace(to), solver=solver, throw=False, strip=strip)
            figures = (getattr(history, name) for name in FIGURES.values())
            return lax.select_n(point[1], *figures), jnp.all(history.status == 0)

        return lax.map(one, (amplitude, figure))
    law = of_law("cycle", model).law
    if isinstance(law, PowerLaw):
        values = jnp.where(figure == 0, law.dissipation_at_force(amplitude), jnp.nan)
    else:
        size = law.displacement(amplitude) if model.load.control == "force" else amplitude
        values = lax.select_n(figure, law.dissipation(size), law.secant_stiffness(size))
    return values, jnp.isfinite(values)


def _parts(model: Runnable) -> tuple[Scene | None, Strip | None]:
    """Scene of a model, and its strip if that is known; None for laws and structures."""
    if isinstance(model, Prepared):
        return model.scene, model.strip
    return (model if isinstance(model, Scene) else None), None


def of_strips_alone(what: str, model: Runnable) -> Scene:
    """Scene of a model; raises `InputError` for others, which have nothing of the kind."""
    if isinstance(model, Scene):
        return model
    other = "a law of a joint" if isinstance(model, Driven) else "a structure"
    raise InputError(f"{what}: {other} has none; give a Scene")


def of_law(what: str, model: Runnable) -> Driven:
    """Driven law of a model that is no scene; raises `InputError` for a structure."""
    if isinstance(model, Driven):
        return model
    raise InputError(f"{what}: a structure has none; give a Scene or a law")


def of_structures_alone(what: str, model: Runnable) -> Assembly:
    """Structure of a model; raises `InputError` for a strip or a law."""
    if isinstance(model, Assembly):
        return model
    raise InputError(f"{what}: is that of a structure; give a jbeamshell.identify.Assembly")


def require_point(label: str, model: Assembly) -> None:
    """Raise `InputError` unless a structure knows where a force drives it."""
    place = model.point if model.driven is None else model.driven
    fix = "is driven nowhere: give the assembly driven=, a degree of freedom"
    require(label, "force", place is not None, fix)
