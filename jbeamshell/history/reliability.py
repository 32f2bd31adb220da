"""What a run's own fields say about how far its figures can be trusted.

Newton's method finds the equilibrium of a grid, whether or not the grid resolves what happens.  At
the loaded end two things go wrong unseen: so few nodes slip that the grid decides what they
dissipate, or the reaction gathers in the corner's last node, which it goes on doing as the grid is
refined, down to the tension of a strip that may not lift.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import jax
import numpy as np
from jax import Array

from jbeamshell.history.linearisation import linear_error
from jbeamshell.mechanics.friction import coulomb_cap
from jbeamshell.scene.scene import Scene

NEGLIGIBLE = 1e-9  # of the sticking range, or of the pressure: less than this is none
CLOSES = 1e-3  # of its width: a loop that ends further off is not steady yet
SAFETY = 1.2  # of the corner's estimate
TOLERANCE = 0.02  # of the dissipation: a smaller error is not told
LOCKS = 0.491  # nu beyond which the midpoint rule is off by more than 1 % of the dissipation
FINER = "take a smaller model.end_size or more model.nodes"


class Run(Protocol):
    """What is asked of a history; see `jbeamshell.History`."""

    scene: Scene
    x: Array
    reaction: Array
    cycles: tuple[tuple[int, int, int], ...]

    @property
    def converged(self) -> bool: ...
    @property
    def loop(self) -> tuple[Array, Array]: ...
    @property
    def rubbing(self) -> SlipCycle: ...


class SlipCycle(NamedTuple):
    """A cycle at the contact's nodes, as arrays of NumPy or of JAX.

    Attributes
    ----------
    x : (n,) positions
    tributary : (n,) contact length of each node
    v : (levels, n) tangential displacement
    traction, reaction : (levels, n) of friction, normal
    friction : mu
    slip_stiffness : k_t, traction per slip
    half_height : H
    """

    x: Array
    tributary: Array
    v: Array
    traction: Array
    reaction: Array
    friction: Array
    slip_stiffness: Array
    half_height: Array


def dissipation_errors(cycle: SlipCycle) -> tuple[Array, ...]:
    """Estimates of the relative error of a cycle's dissipation, by its grid and by the corner.

    With the friction work W_i of the nodes, as many as (sum W_i)^2 / sum W_i^2 would share it if
    they all did the same (the participation ratio); the grid's error is that to the power -3/2.
    The corner's is the part of the work that is due to what the nodes' reactions have beyond their
    neighbours', times how much less the contact slips one H from the end.  Both are measured,
    rather too large than too small (calibration/failure_map.py).

    Returns
    -------
    grid, corner : infinite where nothing slips
    """
    numbers: Any = np if isinstance(cycle.v, np.ndarray) else jax.numpy
    cap = coulomb_cap(cycle.friction, cycle.reaction)
    cap = 0.5 * (cap[1:] + cap[:-1])
    elastic = numbers.diff(cycle.traction, axis=0) / cycle.slip_stiffness
    slip = numbers.abs(numbers.diff(cycle.v, axis=0) - elastic)
    slip = numbers.where(cycle.slip_stiffness * slip > NEGLIGIBLE * cap, slip, 0.0)

    work = numbers.sum(slip * cap, axis=0) * cycle.tributary
    total = numbers.sum(work)
    slips = total > 0.0
    whole = numbers.where(slips, total, 1.0)
    grid = numbers.sum((work / whole) ** 2) ** 1.5

    excess = numbers.abs(numbers.diff(cycle.reaction, axis=1)) * cycle.tributary[1:]
    excess = 0.5 * cycle.friction * (excess[1:] + excess[:-1])
    gathered = SAFETY * numbers.sum(excess * slip[:, 1:]) / whole
    path = numbers.sum(slip, axis=0)
    inside = numbers.interp(cycle.x[-1] - cycle.half_height, cycle.x, path)
    at_end = numbers.where(path[-1] > 0.0, path[-1], numbers.max(path) + 1.0)
    fall = numbers.clip(1.0 - inside / at_end, 0.0, 1.0)
    both = grid, gathered * fall
    return tuple(numbers.where(slips, error, numbers.inf) for error in both)


def doubts_of(history: Run) -> tuple[str, ...]:
    """What is doubtful about a run, by how much, and what to change; a sentence each."""
    plain = jax.tree.map(np.asarray, history)  # quicker than JAX where nothing is compiled
    if not plain.converged:
        return ("a load step found no equilibrium: the steps from there on hold no numbers",)
    scene = plain.scene
    if scene.model.solution == "closed-form" or scene.contact.normal == "none":
        return ()
    if not plain.cycles:
        return _tension(plain)
    rubbing = _rubbing(plain) if scene.contact.friction > 0.0 else ()
    return (*_unsteady(plain), *rubbing, *_tension(plain), *doubts_before(scene))


def doubts_before(scene: Scene) -> tuple[str, ...]:
    """What can be doubted of a scene's loop before it is run."""
    model, strip, found = scene.model, scene.strip, []
    if model.kinematics == "linear" and (error := linear_error(scene)) > TOLERANCE:
        found.append(f"{_off(error)} by linear kinematics; take model.kinematics = exact")
    beamshell = "psi" in model.fields and model.order == 0
    locks = beamshell and model.grid == "finite-difference" and strip.plane == "strain"
    if locks and strip.poisson_ratio is not None and strip.poisson_ratio > LOCKS:
        found.append(
            f"nearly incompressible (nu = {strip.poisson_ratio:.4g}): finite differences may be "
            "off by several per cent; take model.grid = collocation"
        )
    return tuple(found)


def _unsteady(history: Run) -> tuple[str, ...]:
    force, displacement = history.loop
    answer = displacement if history.scene.load.control == "force" else force
    open_by = abs(answer[-1] - answer[0]) / max(np.ptp(answer), np.finfo(float).tiny)
    if open_by <= CLOSES:
        return ()
    return (
        f"the last loop does not close (by {open_by:.2g} of its width): give more load.cycles for "
        "a steady one",
    )


def _rubbing(history: Run) -> tuple[str, ...]:
    grid, corner = map(float, dissipation_errors(jax.tree.map(np.asarray, history.rubbing)))
    if np.isinf(grid):
        return (
            "nothing slips in the last cycle: if something does, this grid cannot show it; "
            "take a smaller model.end_size",
        )
    found = []
    if grid > TOLERANCE:
        found.append(f"{_off(grid)}: few nodes do the slipping; {FINER}")
    if corner > TOLERANCE:
        fix = "compare with a smaller model.end_size"
        if "w" not in history.scene.model.fields:
            fix = "add w to model.fields and " + fix
        found.append(f"{_off(corner)}: the reaction gathers in the corner at the loaded end; {fix}")
    return tuple(found)


def _off(error: float) -> str:
    by = f"about {100.0 * error:.2g} %" if error < 1.0 else "its own size"
    return f"the dissipation may be off by {by}"


def _tension(history: Run) -> tuple[str, ...]:
    """Where a strip that may not lift is held down; at the very corner only if that matters."""
    reaction, scene = history.reaction, history.scene
    if history.cycles and scene.contact.friction > 0.0:
        reaction = reaction[:, history.x < history.x[-1] - scene.strip.half_height]
    least = float(np.min(reaction, initial=0.0))
    if "w" in scene.model.fields or least >= -NEGLIGIBLE * np.max(np.abs(history.reaction)):
        return ()
    return (
        f"tension at the contact (reaction_min = {least:.4g}): the lift is frozen; add w to "
        "model.fields for unilateral contact, or take fewer model.nodes",
    )
