"""Dissipation in steady cycles, from factors of the body; of plane elasticity by default."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.errors import UnconvergedError
from jbeamshell.contact_line.cycles import STEADY, CycleFactors, cycle_factors
from jbeamshell.contact_line.drives import with_springs
from jbeamshell.contact_line.entry import goes_on
from jbeamshell.contact_line.solve import solve
from jbeamshell.contact_line.strip import condensed, spring_stiffness
from jbeamshell.scene.load_path import check
from jbeamshell.scene.planning import PLANE_NODES
from jbeamshell.scene.rows import AUTO
from jbeamshell.scene.scene import Scene

NODES = 49  # 1 % of elasticity where D exceeds a tenth of the bar's cubic law, 3 % down to 1e-4
REFINED = 89  # a third of that


def dissipation(scene: Scene, amplitudes: ArrayLike, *, nodes: int | None = None) -> Array:
    """Work of friction in a steady cycle at several amplitudes.

    Parameters
    ----------
    scene : strip and contact, with linear kinematics; plane elasticity if its section is open; may
        be traced
    amplitudes : (k,) of the end force
    nodes : contact nodes; None is 49 for plane elasticity, which are within 1 % of it where the
        dissipation exceeds a tenth of the bar's cubic law, and 3 % down to a ten-thousandth (89
        within .3 and 1 %), and the scene's own number for others

    Returns
    -------
    (k,) work per cycle and unit width.  Amplitudes whose slip zones are not nested are walked event
    by event; where anything is traced they cannot be, and hold NaN.

    Raises
    ------
    InputError
        if the scene has no contact line, or if an amplitude exceeds gross slip, unless traced
    UnconvergedError
        if the events of a load step come to no end, unless traced

    Notes
    -----
    To ask one strip again and again, keep its `factors`.  Elastic slip (contact.stick_stiffness)
    leaves no nested zones at the corner.
    """
    scene = on_contact_line(scene, nodes)
    by_factors = _dissipation(scene, jnp.asarray(amplitudes))
    if is_traced(scene, amplitudes, by_factors):
        return by_factors
    sizes, works = np.asarray(amplitudes, dtype=float), np.array(by_factors)
    fix = "give (k,) positive amplitudes"
    require("amplitudes", sizes, sizes.ndim == 1 and bool(np.all(sizes > 0.0)), fix)
    check(scene.replace({"load.amplitude": np.max(sizes, initial=0.0)}))
    for i in np.flatnonzero(np.isnan(works)):
        steady = {"load.amplitude": sizes[i], "load.cycles": STEADY, "load.steps_per_half_cycle": 1}
        # Events leave steps of whole elements in D, which this many nodes make small.
        lone = scene.replace(steady | {"model.nodes": max(scene.plan.nodes, PLANE_NODES)})
        history = solve(lone, *check(lone))
        if not history.converged:
            raise UnconvergedError(f"amplitudes = {sizes[i]:.6g}: its events come to no end")
        works[i] = history.dissipation
    return jnp.asarray(works)


def factors(scene: Scene, *, nodes: int | None = None) -> CycleFactors:
    """Factors of a strip, from which many amplitudes cost microseconds each.

    They hold for all amplitudes, for one strip, contact and pressure.  Many strips are built by one
    program with `jax.lax.map`.

    Parameters
    ----------
    scene, nodes : as of `dissipation`

    Returns
    -------
    CycleFactors
        whose method ``dissipation`` takes (k,) amplitudes and returns (k,) works; NaN where slip
        zones are not nested, which `dissipation` would walk event by event

    Raises
    ------
    InputError
        for a member that goes on, whose contact opens at its edge so that no zones are nested

    Examples
    --------
    >>> factors = jb.contact_line.factors(jb.library.standard())
    >>> factors.dissipation(jnp.linspace(0.1, 1.9, 256))
    """
    scene = on_contact_line(scene, nodes)
    fix = "opens the edge of the contact, so that no slip zones are nested: take traction, face or "
    fix += "guided, or jbeamshell.contact_line.dissipation"
    require("load.entry", scene.load.entry, not goes_on(scene), fix)
    return _factors(scene)


def on_contact_line(scene: Scene, nodes: int | None) -> Scene:
    """Scene on its contact line, as plane elasticity if its section is open; see `dissipation`."""
    require("scene", scene, isinstance(scene, Scene), "give a jbeamshell.Scene")
    force = scene.load.control == "force"
    require("load.control", scene.load.control, force, "must be 'force' for amplitudes of it")
    section = "plane" if scene.model.section == AUTO else scene.model.section
    scene = scene.replace({"model.section": section, "model.kinematics": "linear"})
    fix = "has no contact line: leave it open, or take another section, the sharp slider, and a "
    fix += "straight strip on a rigid base"
    require("model.section", section, scene.plan.on_contact_line, fix)
    if scene.plan.elastic:
        scene = scene.replace({"model.nodes": NODES})
    return scene if nodes is None else scene.replace({"model.nodes": nodes})


@eqx.filter_jit
def _factors(scene: Scene) -> CycleFactors:
    strip = condensed(scene, scene.plan.nodes)
    body = strip.body
    if scene.contact.stick_stiffness is not None:
        body, _ = with_springs(body, spring_stiffness(scene, strip))
    return cycle_factors(body, scene.contact.friction)


@eqx.filter_jit
def _dissipation(scene: Scene, amplitudes: Array) -> Array:
    return _factors(scene).dissipation(amplitudes)
