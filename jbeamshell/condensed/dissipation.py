"""Dissipation of plane elasticity in steady cycles, from factors of the body."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require
from jbeamshell.condensed.branches import factorise, path, pressed
from jbeamshell.condensed.solve import check, solve
from jbeamshell.condensed.strip import NODES, condensed
from jbeamshell.scene.domain import gross_slip_rule
from jbeamshell.scene.scene import Scene

CYCLES = 2  # from the second cycle on the dissipation repeats


def dissipation(scene: Scene, amplitudes: ArrayLike, *, nodes: int = NODES) -> Array:
    """Work of friction in a steady cycle of plane elasticity, at several amplitudes.

    Parameters
    ----------
    scene : as of `solve`; may be traced
    amplitudes : (k,) of the end force
    nodes : as of `solve`

    Returns
    -------
    (k,) work per cycle and unit width.  Amplitudes whose slip zones are not nested are walked event
    by event; where anything is traced they cannot be, and hold NaN.

    Raises
    ------
    InputError, UnconvergedError
        as of `solve`, unless anything is traced
    """
    found = _dissipation(scene, jnp.asarray(amplitudes), nodes)
    if is_traced(scene, amplitudes, found):
        return found
    check(scene)
    sizes, works = np.asarray(amplitudes, dtype=float), np.array(found)
    fix = "give (k,) positive amplitudes"
    require("amplitudes", sizes, sizes.ndim == 1 and bool(np.all(sizes > 0.0)), fix)
    gross_slip_rule(scene.load, scene.number, sizes).demand()
    for i in np.flatnonzero(np.isnan(works)):
        steady = {"load.amplitude": sizes[i], "load.cycles": CYCLES, "load.steps_per_half_cycle": 1}
        works[i] = solve(scene.replace(steady), nodes=nodes).dissipation
    return jnp.asarray(works)


@eqx.filter_jit
def _dissipation(scene: Scene, amplitudes: Array, nodes: int) -> Array:
    strip = condensed(scene, nodes)
    friction, start = scene.contact.friction, pressed(strip.body)
    factors = factorise(strip.body, friction)
    turns = jnp.asarray([1.0, *[-1.0, 1.0] * CYCLES])

    def one(amplitude: Array) -> Array:
        branches = path(strip.body, factors, friction, start, amplitude * turns)
        return jnp.where(jnp.all(branches.valid), jnp.sum(branches.slip_work[-2:]), jnp.nan)

    return jax.vmap(one)(amplitudes)
