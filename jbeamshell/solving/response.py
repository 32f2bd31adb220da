"""Compiled function from some of a scene's numbers to figures of its last cycle."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.apart import apart
from jbeamshell.common.checks import check_words, is_traced, require, require_choice
from jbeamshell.common.errors import InputError
from jbeamshell.common.precision import doubled, in_double, is_single
from jbeamshell.common.progress import patience
from jbeamshell.common.small import Small
from jbeamshell.common.threads import on_one_core
from jbeamshell.contact_line.shared import Layout, Shared, shared
from jbeamshell.contact_line.strip import Strip
from jbeamshell.history.history import FIGURES, History
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.domain import Numbers
from jbeamshell.scene.keys import NUMBERS, TABLE, check_key
from jbeamshell.scene.planning import FEW_STEPS
from jbeamshell.scene.rows import AUTO
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.template import Template
from jbeamshell.solving.solve import run

Response = Callable[..., dict[str, Array]]

# Figures of a cycle that condensed strips know from its turning points alone.
EXACT = {*FIGURES, "dissipation_error"} - {"dissipation_loop", "reaction_min"}
KEPT = 16  # compiled functions that are kept for scenes of other numbers
RESPONSES = (
    "force",
    "displacement",
    *(
        name
        for name, value in inspect.getmembers(History)
        if isinstance(value, property) and name[0] != "_" and name != "converged"
    ),
)


def response(
    scene: Scene,
    over: Sequence[str],
    figures: Sequence[str] = ("dissipation",),
    *,
    solver: Newton | None = None,
) -> Response:
    """Make a pure function of some of a scene's numbers, for `jax.jit`, `jax.vmap`, `jax.grad`.

    It computes only its figures, so it costs less than `jbeamshell.solve`.

    `jax.vmap` over loads alone is three times as fast as `jax.lax.map`, because they share a body.

    Parameters
    ----------
    scene : scene with all other numbers
    over : dotted keys of the numbers that vary, in the order of the function's arguments
    figures : names of `jbeamshell.History`, such as "dissipation" or "secant_stiffness"
    solver : settings of Newton's method

    Returns
    -------
    Callable
        from the numbers to a dictionary of the figures and ``status``, the largest code of
        `jbeamshell.Status` of all steps.  Unless it is zero the figures are NaN or wrong.  Numbers
        are not checked against the scene's domain, and the settings stay those of the scene.
        Plane elasticity of a strip under an even pressure is interpolated over its height; within
        transformations heights are to be .02 to .8, or within 1.5 times the scene's own.

    Raises
    ------
    InputError
        if a key or a figure is unknown; on a call with other than one number for each key

    Examples
    --------
    >>> ask = jb.response(jb.Scene(), ["load.amplitude", "contact.friction"])
    >>> ask(0.5, 0.1)["dissipation"]
    >>> jax.grad(lambda mu: ask(0.5, mu)["dissipation"])(0.1)
    """
    require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
    check_words("over", over)
    check_words("figures", figures)
    for key in over:
        check_key(key)
        require("over", key, key in NUMBERS, "is no number of the scene: give it to the scene")
    for name in figures:
        require_choice("figures", name, RESPONSES)

    served = pinned(scene.serving(over), figures)
    return Answers(served, _Asked(tuple(over), tuple(figures), solver))


class _Asked(NamedTuple):
    """Question to a scene; its parts are those of `response`."""

    over: tuple[str, ...]
    figures: tuple[str, ...]
    solver: Newton | None


class Answers:
    """Function that `response` makes; pickled, it is made again where it is read.

    Parameters
    ----------
    scene : scene with its settings as they were chosen
    asked : see `response`
    """

    def __init__(self, scene: Scene, asked: _Asked) -> None:
        self._given = scene, asked
        self._asked = False
        self._ask = _response(scene, asked)
        if not is_traced(scene) and is_single(scene):
            with jax.enable_x64(True):
                precise = _response(doubled(scene), asked)
            self._ask = in_double(precise, within=self._ask)

    def __call__(self, *values: Array) -> dict[str, Array]:
        if self._asked:
            return self._ask(*values)
        with patience("answering for the first time"):
            found = self._ask(*values)
        self._asked = True
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._given


def _response(scene: Scene, asked: _Asked) -> Response:
    """Response of a scene with its settings as they were chosen."""
    over = asked.over
    template, numbers = Template.of(scene)
    fixed: Any = numbers if is_traced(numbers) else np.array(numbers)  # tables may be traced too
    tables = tuple(TABLE[key].table or np.ndim(scene.get(key)) > 0 for key in over)

    @functools.cache
    def strips() -> Shared | None:
        return shared(scene, over, asked.figures)

    def ask(*values: Array) -> dict[str, Array]:
        count = len(values) == len(over)
        require("over", list(over), count, f"needs as many numbers, not {len(values)}")
        for key, value, table in zip(over, values, tables, strict=True):
            if np.ndim(value) and not table:
                fix = "give one number, and many by jax.vmap or jbeamshell.sweep"
                raise InputError(f"{key}: is an array of shape {np.shape(value)}: {fix}")
        found = strips()
        if found is None or not (is_traced(values) or found.holds(scene, over, values)):
            return _programs(template, asked)(fixed, *values)
        return _programs(template, asked, found.layout)(fixed, found.numbers, *values)

    return ask


@functools.lru_cache(KEPT)
def _programs(template: Template, asked: _Asked, layout: Layout | None = None) -> Response:
    """Function of the scene's numbers and of the values that vary, compiled at its first call.

    With a layout the numbers of shared strips come before the values.
    """
    over, solver = asked.over, asked.solver
    first = 0 if layout is None else 1

    @Small
    def figures_of(given: tuple[Any, ...]) -> dict[str, Array]:
        fixed, *further = given
        values = dict(zip(over, further[first:], strict=True))
        varied = template.scene(list(fixed)).replace(values)
        strip = None if layout is None else layout.strip(further[0], varied)
        return figures(varied, asked.figures, strip, solver)

    @on_one_core
    def now(given: tuple[Any, ...]) -> dict[str, Array]:
        found: dict[str, Array] = jax.block_until_ready(figures_of(given))
        return found

    def ask(*given: Any) -> dict[str, Array]:
        arrays = jax.tree.map(lambda a: a if isinstance(a, Array) else np.asarray(a), given)
        if is_traced(arrays):
            found: dict[str, Array] = figures_of(arrays)
            return found
        # While another function is traced, numbers would become a part of its program.
        return apart(lambda: now(arrays))

    return ask


def figures(
    scene: Scene,
    names: Sequence[str],
    strip: Strip | None,
    solver: Newton | None,
) -> dict[str, Array]:
    """Figures of a scene by name, and ``status``; see `response`.

    Parameters
    ----------
    strip : the scene's strip on its contact line, if it is known
    """
    history = run(scene, throw=False, solver=solver, strip=strip)
    found = {name: getattr(history, name) for name in names}
    return found | {"status": jnp.max(history.status)}


def pinned(scene: Scene, figures: Sequence[str], numbers: Numbers | None = None) -> Scene:
    """Scene with its settings as they were chosen, and as few load steps as its figures need.

    Parameters
    ----------
    scene : scene whose settings may be open
    figures : names of `jbeamshell.History`
    numbers : values by dotted key of the strips of a sweep, see `Scene.pinned`
    """
    found = scene.pinned(numbers)
    few = found.plan.on_contact_line and scene.load.steps_per_half_cycle == AUTO
    if few and EXACT.issuperset(figures):
        return found.replace({"load.steps_per_half_cycle": FEW_STEPS})
    return found
