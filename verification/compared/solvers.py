"""Ways to find the equilibrium of a load step, on the library's own residual and tangent.

Newton's iteration from the last equilibrium, plain or with one help: a line search that demands a
smaller residual, the friction law's limit on what a step may do to a node, smaller load steps after
a failure, or a continuation that solves a milder friction first. Steps that are not found after
`TRIES` iterations are kept without notice, so that the count of wrong answers shows the worth of
reading the flag; the library's own solver stands beside them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

import jbeamshell as jb
from calibration.strip import in_load_steps
from jbeamshell.load_steps.system import LoadLevel, Prescribed, System, V
from jbeamshell.load_steps.tangent import Stiffness, initial_stiffness, matrix
from jbeamshell.mechanics.bar import cubic_law
from jbeamshell.numerics import block_tridiagonal
from jbeamshell.scene.parts import unit_path
from jbeamshell.scene.scene import ALMOST_RIGID

TOLERANCE = 1e-10  # of mu F_N L, as the library's
TRIES, HALVINGS = 100, 8
WRONG = 0.02  # of the dissipation
NEGLIGIBLE = 1e-6  # of the bar's dissipation: less than this is nothing
SMALL = {
    "model.nodes": 41,
    "model.kinematics": "linear",
    "load.steps_per_half_cycle": 10,
    "load.cycles": 1,
}
# The domain in which the library answers for its results: low and high; whether spread evenly.
DOMAIN = {
    "strip.height_ratio": (0.005, 0.5, False),
    "contact.friction": (0.02, 1.0, False),
    "load.amplitude": (0.02, 0.98, True),  # of gross slip
    "strip.poisson_ratio": (0.0, 0.49, True),
    "strip.kappa_s": (0.05, 3.0, False),
    "contact.stick_stiffness": (2.0, 1e4, False),
}


class Method(NamedTuple):
    """A way to solve a load step.

    Attributes
    ----------
    monotone : halve a step until it lowers the residual
    limited : do not throw a node over its sticking range, see `FrictionLaw.limit`
    cuts : how often a load step that fails is halved
    stages : what is changed of a scene to be solved first, in this order
    """

    monotone: bool = False
    limited: bool = False
    cuts: int = 0
    stages: Sequence[Callable[[jb.Scene], jb.Scene]] = ()


def softer(part: float) -> Callable[[jb.Scene], jb.Scene]:
    """The scene with sliders of a part of their stiffness."""
    key = "contact.stick_stiffness"

    def changed(scene: jb.Scene) -> jb.Scene:
        alpha = scene.contact.stick_stiffness
        return scene.replace({key: part * (ALMOST_RIGID if alpha is None else alpha)})

    return changed


def smoother(exponent: float) -> Callable[[jb.Scene], jb.Scene]:
    """The scene with the smooth law of an exponent m."""
    return lambda scene: scene.replace({"contact.smoothing": exponent})


MILDER_ALPHA = (softer(0.25), softer(0.5))
MILDER_M = (smoother(2.0), smoother(8.0), smoother(32.0))
METHODS = {
    "plain Newton": Method(),
    "monotone line search": Method(monotone=True),
    "limit, no search": Method(limited=True),
    "limit, monotone": Method(limited=True, monotone=True),
    "step cutting": Method(cuts=6),
    "continuation in alpha": Method(stages=MILDER_ALPHA),
    "continuation in m": Method(stages=MILDER_M),
    "limit, continuation in alpha": Method(limited=True, stages=MILDER_ALPHA),
    "limit, continuation in m": Method(limited=True, stages=MILDER_M),
}
LIBRARY = "library"


class Run(NamedTuple):
    """Result of a load path.

    Attributes
    ----------
    dissipation : of the last cycle, unfound steps and all
    unfound : load steps without equilibrium
    iterations : in all
    steps : load steps
    """

    dissipation: Any
    unfound: Any
    iterations: Any
    steps: Any


class Attempt(NamedTuple):
    """Part of a load step; levels are where it starts and where it is."""

    level: LoadLevel
    part: Array
    size: Array
    work: Array
    tried: Array
    given_up: Array


def march(scene: jb.Scene, method: Method) -> Run:
    """Press the strip and walk its cycles."""
    scenes = [*(stage(scene) for stage in method.stages), scene]
    systems = [System(one) for one in scenes]
    stiffnesses = [initial_stiffness(system, 1.0) for system in systems]
    unit = jnp.asarray(np.append(0.0, unit_path(scene.load.cycles, scene.plan.steps)))

    def step(state: tuple[LoadLevel, Array], load: tuple[Array, Array]) -> tuple[Any, Any]:
        level, target = state
        to, rough = load
        found = _step(systems, stiffnesses, level, (target, to, rough), method)
        return (found.level, to), (found.work, found.given_up, found.tried)

    targets = scene.load.amplitude * unit
    rough = jnp.ones_like(unit).at[0].set(0.0)
    start = (systems[-1].unloaded(), jnp.zeros_like(targets[0]))
    _, (work, given_up, tried) = lax.scan(step, start, (targets, rough))
    cycle = 2 * scene.plan.steps
    return Run(jnp.sum(work[-cycle:]), jnp.sum(given_up), jnp.sum(tried), unit.size)


def _step(
    systems: list[System],
    stiffnesses: list[Stiffness],
    before: LoadLevel,
    load: tuple[Array, Array, Array],
    method: Method,
) -> Attempt:
    """A load step, in parts where it must."""
    begin, end, rough = load
    smallest = 0.5**method.cuts

    def go_on(at: Attempt) -> Attempt:
        part = jnp.minimum(at.part + at.size, 1.0)
        zero = jnp.zeros_like(part)
        prescribed = Prescribed(begin + part * (end - begin), zero + 1.0, zero, rough)
        change, tried = jnp.zeros_like(at.level.q[:, list(systems[-1].plan.active)]), at.tried
        for system, stiffness in zip(systems, stiffnesses, strict=True):
            change, error, more = _newton(system, stiffness, change, at.level, prescribed, method)
            tried = tried + more
        after, *_ = systems[-1].advance(change, at.level, prescribed)
        good = error <= TOLERANCE
        given_up = ~good & (at.size <= smallest)
        kept = good | given_up
        level = jax.tree.map(lambda new, old: jnp.where(kept, new, old), after, at.level)
        work = prescribed.rough * systems[-1].slip_work(at.level, after)
        return Attempt(
            level,
            jnp.where(kept, part, at.part),
            jnp.where(good, jnp.minimum(2.0 * at.size, 1.0), jnp.maximum(0.5 * at.size, smallest)),
            at.work + jnp.where(kept, work, 0.0),
            tried,
            at.given_up | given_up,
        )

    zero = jnp.zeros_like(begin)
    never = jnp.asarray(False)
    whole = Attempt(before, zero, zero + 1.0, zero, jnp.asarray(0), never)
    return lax.while_loop(lambda at: at.part < 1.0, go_on, whole)


def _newton(
    system: System,
    stiffness: Stiffness,
    start: Array,
    before: LoadLevel,
    prescribed: Prescribed,
    method: Method,
) -> tuple[Array, Array, Array]:
    """Newton's iteration: change of the fields, largest residual left, iterations."""
    limit = jax.vmap(system.foundation.friction_law.limit)

    def size(residual: Array) -> Array:
        return jnp.max(jnp.abs(residual))

    def unfinished(at: tuple) -> Array:
        left = size(at[1])  # a residual that is not finite ends the iteration
        return (left > TOLERANCE) & jnp.isfinite(left) & (at[4] < TRIES)

    def improve(at: tuple) -> tuple:
        x, residual, seen, scale, tried = at
        tangent = matrix(system, stiffness, seen, before, prescribed)
        new = x + scale * block_tridiagonal.solve(tangent, -residual)
        if method.limited:
            given = before.traction, before.cap, system.foundation.slip_stiffness
            limited = limit(x[:, V], new[:, V], *given)
            new = new.at[:, V].set(jnp.where(prescribed.rough > 0.0, limited, new[:, V]))
        _, left, sees = system.advance(new, before, prescribed)
        better = jnp.linalg.norm(left) < jnp.linalg.norm(residual)
        taken = better | (scale <= 0.5**HALVINGS) | (not method.monotone)
        there = (new, left, sees, jnp.ones_like(scale))
        here = (x, residual, seen, 0.5 * scale)
        kept = jax.tree.map(lambda a, b: jnp.where(taken, a, b), there, here)
        return (*kept, tried + 1)

    _, residual, seen = system.advance(start, before, prescribed)
    at = (start, residual, seen, jnp.ones_like(prescribed.controlled), jnp.asarray(0))
    x, residual, _, _, tried = lax.while_loop(unfinished, improve, at)
    return x, size(residual), tried


def random_strips(count: int, seed: int = 5) -> list[dict[str, float]]:
    """Values of strips from all over `DOMAIN`."""
    parts = np.random.default_rng(seed).uniform(size=(count, len(DOMAIN)))
    found = []
    for row in parts:
        values = {}
        for part, (key, (low, high, even)) in zip(row, DOMAIN.items(), strict=True):
            values[key] = float(low + part * (high - low) if even else low * (high / low) ** part)
        values["load.amplitude"] *= 20.0 * values["contact.friction"]
        found.append(values)
    return found


def runner(name: str) -> Callable[[dict[str, float]], Run]:
    """A compiled run of a method, from the values of a strip."""
    base = in_load_steps().replace(SMALL)

    def library(values: dict[str, float]) -> Run:
        history = jb.solve(base.replace(values), throw=False)
        unfound = jnp.sum(history.status > 0)
        return Run(history.dissipation, unfound, jnp.sum(history.iterations), history.status.size)

    if name == LIBRARY:
        return jax.jit(library)
    return jax.jit(lambda values: march(base.replace(values), METHODS[name]))


class Tally(NamedTuple):
    """Success and errors of a method on some strips.

    Attributes
    ----------
    found : share of strips whose every step found equilibrium
    wrong : share whose dissipation is off by more than `WRONG`, or no number, if nobody looks
    wrong_but_found : share of those that are off although every step found equilibrium
    worst : largest factor, either way, by which an unfound dissipation is off
    iterations : mean per load step, where every step found equilibrium
    """

    found: float
    wrong: float
    wrong_but_found: float
    worst: float
    iterations: float


def bar_dissipation(values: Mapping[str, float]) -> float:
    """Dissipation of the one-dimensional bar."""
    scene = in_load_steps().replace(dict(values))
    rubs = scene.contact.friction * scene.contact.pressure
    return float(cubic_law(scene.load.amplitude, scene.strip.stretching_stiffness, rubs))


def tally(runs: Sequence[Run], right: np.ndarray, nothing: np.ndarray) -> Tally:
    """Count successes and errors of a method.

    Parameters
    ----------
    runs : of the method, strip by strip
    right : (strips,) the right dissipations
    nothing : (strips,) dissipations that are negligible
    """
    dissipation, unfound, iterations, steps = np.array([[float(x) for x in run] for run in runs]).T
    ratio = np.maximum(dissipation, nothing) / np.maximum(right, nothing)
    ratio = np.where(np.isfinite(dissipation), ratio, np.nan)
    off = ~(np.abs(ratio - 1.0) <= WRONG)
    found = unfound == 0
    worst = np.exp(np.max(np.abs(np.log(ratio[np.isfinite(ratio)])), initial=0.0))
    per_step = np.mean((iterations / steps)[found]) if found.any() else np.nan
    figures = (found.mean(), off.mean(), (off & found).mean(), worst, per_step)
    return Tally(*map(float, figures))
