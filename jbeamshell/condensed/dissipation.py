"""Dissipation of plane elasticity in steady cycles, from factors of the body."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.errors import UnconvergedError
from jbeamshell.condensed.branches import factorise, path, pressed
from jbeamshell.condensed.solve import solve
from jbeamshell.condensed.strip import condensed
from jbeamshell.scene.load_path import check
from jbeamshell.scene.rungs import PLANE_NODES
from jbeamshell.scene.scene import Scene

CYCLES = 2  # from the second cycle on the dissipation repeats


def dissipation(scene: Scene, amplitudes: ArrayLike, *, nodes: int = PLANE_NODES) -> Array:
    """Work of friction in a steady cycle of plane elasticity, at several amplitudes.

    Parameters
    ----------
    scene : strip and contact, see the rung ``plane``; may be traced
    amplitudes : (k,) of the end force
    nodes : contact nodes

    Returns
    -------
    (k,) work per cycle and unit width.  Amplitudes whose slip zones are not nested are walked event
    by event; where anything is traced they cannot be, and hold NaN.

    Raises
    ------
    InputError
        if the scene has no such rung, or an amplitude exceeds gross slip, unless traced
    UnconvergedError
        if the events of a load step come to no end, unless traced
    """
    require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
    scene = scene.replace({"model.rung": "plane", "model.nodes": nodes})
    force = scene.load.control == "force"
    require("load.control", scene.load.control, force, "must be 'force' for amplitudes of it")
    found = _dissipation(scene, jnp.asarray(amplitudes))
    if is_traced(scene, amplitudes, found):
        return found
    sizes, works = np.asarray(amplitudes, dtype=float), np.array(found)
    fix = "give (k,) positive amplitudes"
    require("amplitudes", sizes, sizes.ndim == 1 and bool(np.all(sizes > 0.0)), fix)
    check(scene.replace({"load.amplitude": np.max(sizes, initial=0.0)}))
    for i in np.flatnonzero(np.isnan(works)):
        steady = {"load.amplitude": sizes[i], "load.cycles": CYCLES, "load.steps_per_half_cycle": 1}
        lone = scene.replace(steady)
        history = solve(lone, *check(lone))
        if not history.converged:
            raise UnconvergedError(f"amplitudes = {sizes[i]:.6g}: its events come to no end")
        works[i] = history.dissipation
    return jnp.asarray(works)


@eqx.filter_jit
def _dissipation(scene: Scene, amplitudes: Array) -> Array:
    strip = condensed(scene, scene.model.nodes)
    friction, start = scene.contact.friction, pressed(strip.body)
    factors = factorise(strip.body, friction)
    turns = jnp.asarray([1.0, *[-1.0, 1.0] * CYCLES])

    def one(amplitude: Array) -> Array:
        branches = path(strip.body, factors, friction, start, amplitude * turns)
        return jnp.where(jnp.all(branches.valid), jnp.sum(branches.slip_work[-2:]), jnp.nan)

    return jax.vmap(one)(amplitudes)
