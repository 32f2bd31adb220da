"""Steady cycles of a scene at several amplitudes of its end force, and how large that may be."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require, require_number
from jbeamshell.common.errors import Status
from jbeamshell.common.failed import nan_unless
from jbeamshell.scene.domain import gross_slip_rule
from jbeamshell.scene.pressure import resultant
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.solve import run

CYCLE = np.array([1.0, -1.0, 1.0, -1.0, 1.0])  # the last two branches are the steady cycle


class SteadyCycles(NamedTuple):
    """Steady cycles, per width.

    Attributes
    ----------
    force : (k,) amplitudes of the end force
    displacement : (k,) half the ranges of its displacement
    dissipation : (k,) work of friction in a cycle
    """

    force: Array
    displacement: Array
    dissipation: Array

    @classmethod
    def of(cls, scene: Scene, forces: ArrayLike) -> SteadyCycles:
        """Cycles of rising amplitude, one after the other; NaN where traced ones do not converge.

        Raises
        ------
        UnconvergedError
            if a load step has no equilibrium
        """
        throw = not is_traced(scene, forces, jnp.zeros(()))
        levels = jnp.asarray(forces)
        history = run(scene, (levels[:, None] * CYCLE).ravel(), throw=throw)
        size = levels.size * CYCLE.size
        u, work = (
            each[-size:].reshape(levels.size, -1)
            for each in (history.displacement, history.slip_work)
        )
        half = 0.5 * jnp.abs(u[:, -1] - u[:, -2])
        sound = jnp.all(history.status == Status.CONVERGED)
        return cls(levels, *nan_unless(sound, (half, jnp.sum(work[:, -2:], axis=1))))


def gross_slip(scene: Scene) -> Any:
    """End force per width at which the whole contact slips, mu F_N L; may be traced.

    Infinite for a moment, under which nothing slides off.
    """
    if scene.load.kind == "moment":
        return np.inf
    contact, length = scene.contact, scene.strip.length
    down, _ = resultant(contact.pressure, contact.bottom_pressure, length, scene.member.support)
    return contact.friction * down


def largest_force(scene: Scene, force: Any = None) -> Any:
    """Force up to which a joint is wanted, checked; None is the scene's amplitude."""
    key = "force" if force is not None else "load.amplitude"
    if force is None:
        control = scene.load.control
        fix = "is no force: give force=, or take load.control = 'force'"
        require("load.amplitude", scene.load.amplitude, control == "force", fix)
        force = scene.load.amplitude
    require_number("force", force)
    if not is_traced(scene, force):
        by_force = dataclasses.replace(scene.load, control="force")
        rule = gross_slip_rule(by_force, scene.member, scene.number, force)
        limit = float(gross_slip(scene))
        fix = f"must stay below gross slip, mu F_N L = {limit:.6g}: take less, such as half of it, "
        rule._replace(key=key, fix=f"{fix}{0.5 * limit:.4g}").demand()
    return force
