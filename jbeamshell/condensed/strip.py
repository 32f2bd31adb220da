"""Strip of a scene on its contact line: its stations, its pressing, its condensed body."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.condensed.assembly import press_roughly
from jbeamshell.condensed.body import Body, Elimination, eliminate
from jbeamshell.condensed.pair import (
    Member,
    Pair,
    joined,
    lower_member,
    over_gap,
    upper_member,
    with_shanks,
)
from jbeamshell.condensed.pressing import press as press_down
from jbeamshell.condensed.section import section_form
from jbeamshell.mechanics import elements
from jbeamshell.mechanics.section_form import SectionForm
from jbeamshell.numerics.factors import solve
from jbeamshell.scene.keys import FAR_ENDS
from jbeamshell.scene.parts import Load
from jbeamshell.scene.scene import Scene

PLANE_END_SIZE = 1e-4  # of H, the element at the loaded end
PLANE_GROWTH = 0.3  # of the element size over the distance from there, also of small elements
PLANE_FAR_SIZE = 0.15  # of L, elements away from it
HOLE_DEPTH = 0.1  # of H, a gap that nothing closes
STEP_SIZE = 0.05  # of H, elements at a step of the pressure
RULE = elements.element_rule("finite-difference")


class Strip(NamedTuple):
    """Strip of a scene, condensed.

    Attributes
    ----------
    body : contact line, numbered from the loaded end
    form : energy of the section
    elimination : what finds the fields above the contact again
    hessian : (2n+2, 2n+2) of the potential in v and w of all stations, end load and pressure
    x, tributary, load : (n,) stations from the far end, contact lengths, forces of the top pressure
    settled, lift : (k,) tangential displacements and (n,) lifts under the pressures
    pair : second member of a lap joint; v, w, hessian, settled and lift are then relative to it
    """

    body: Body
    form: SectionForm
    elimination: Elimination
    hessian: Array
    x: Array
    tributary: Array
    load: Array
    settled: Array
    lift: Array
    pair: Pair | None


def condensed(scene: Scene, nodes: int) -> Strip:
    """Strip of a scene as its condensed section, or as plane elasticity, on its contact nodes."""
    far_end = scene.strip.far_end
    form, x = section_form(scene), stations(scene, nodes)
    down, up = pressing(scene, x)
    tributary = elements.tributary_lengths(RULE, x)
    if scene.member.support == "none":
        pair = None
        none = np.zeros_like(form.held)
        held = form.held if "beta" in FAR_ENDS[far_end] else none
        elimination, hessian = eliminate(form, x, down, (held, none))
        lifted = jnp.pad(jnp.stack([jnp.zeros_like(up), up], axis=1).ravel(), (0, 2))
        from_below = lifted[:, None] * np.eye(lifted.size)[-1]
        hessian = hessian - from_below - from_below.T
    else:
        upper, lower = _members(scene, form, x, down, up)
        elimination = upper.elimination
        pair, hessian = joined(upper, lower)
    gap = initial_gap(scene, x)
    last = 2 * x.size - 2
    v = slice(last, 0 if "v" in FAR_ENDS[far_end] else None, -2)
    w = slice(last + 1, None, -2)
    k_tt, k_tn, press = hessian[v, v], hessian[v, w], hessian[:-2, -1]
    # Without friction the far end keeps its place, even if nothing else holds it.
    some = x.size - 1
    press_t, traction = press[v][:some], jnp.zeros_like(press[v])
    stiffness = k_tt[:some, :some], k_tn[:some], hessian[w, w]
    away = None if gap is None else gap[::-1]
    if scene.contact.assembly == "frictional":
        loads = press[v], press[w], scene.contact.friction
        lift, settled, reaction, traction = press_roughly(k_tt, k_tn, hessian[w, w], *loads, away)
    elif stays_flat(scene):
        lift, reaction = jnp.zeros_like(x), (down - up)[::-1]
        settled = solve(stiffness[0], -press_t)
    else:
        based = scene.contact.normal == "rigid"
        lift, settled, reaction = press_down(*stiffness, press_t, press[w], based, away)
    if gap is not None and pair is not None:
        pair, hessian = over_gap(pair, hessian, gap)
    settled = jnp.pad(settled, (0, k_tt.shape[0] - settled.size))
    if scene.contact.bolt_stiffness is not None:
        hessian = with_shanks(hessian, scene.contact.bolt_stiffness, down, settled[::-1])
    body = Body(
        x=x[::-1],
        tributary=tributary[::-1],
        K_tt=hessian[v, v],
        K_tn=k_tn,
        K_nn=hessian[w, w],
        f_t=-hessian[v, -2],
        f_n=-hessian[w, -2],
        r_0=reaction,
        t_0=traction,
        c=-hessian[-2, -2],
    )
    return Strip(body, form, elimination, hessian, x, tributary, down, settled, lift, pair)


def initial_gap(scene: Scene, x: Array) -> Array | None:
    """Distance (n,) of the members at their stations before anything presses; None if they touch.

    A hole is a gap that nothing closes.
    """
    given, holes = scene.contact.gap, scene.contact.holes
    if given is None and holes is None:
        return None
    gap = jnp.zeros_like(x) if given is None else _on_stations(given, x)
    if holes is None:
        return gap
    begin, end = scene.contact.hole_edges.T
    inside = jnp.any((x[:, None] > begin) & (x[:, None] < end), axis=1)
    return gap + jnp.where(inside, HOLE_DEPTH * scene.strip.half_height, 0.0)


def _on_stations(gap: Array, x: Array) -> Array:
    """Values (n,) of a number or a table at the stations."""
    return jnp.interp(x, gap[:, 0], gap[:, 1]) if gap.ndim else jnp.broadcast_to(gap, x.shape)


def _members(scene: Scene, form: SectionForm, x: Array, down: Array, up: Array) -> list[Member]:
    """Both members of a lap joint."""
    strip, member = scene.strip, scene.member
    below = section_form(scene.of_member())
    return [
        upper_member(
            loaded(form, scene.load), x, strip.overhang, down, strip.loaded_end == "guided"
        ),
        lower_member(below, x, member.overhang, up, member.support == "clamped"),
    ]


def loaded(form: SectionForm, load: Load) -> SectionForm:
    """Form of a section whose end is loaded by a moment, or by a force away from mid-height."""
    if load.kind == "moment":
        return form._replace(pull=form.turn)
    return form if load.arm is None else form._replace(pull=form.pull - load.arm * form.turn)


def pressing(scene: Scene, x: Array) -> tuple[Array, Array]:
    """Forces (n,) of the pressures on the top face, downwards, and the bottom face, upwards."""
    down = elements.nodal_loads(RULE, x, scene.contact.pressure)
    return down, elements.nodal_loads(RULE, x, scene.contact.bottom_pressure)


def is_pressed_evenly(scene: Scene) -> bool:
    """True if neither pressure is a table."""
    return scene.contact.pressure.ndim == scene.contact.bottom_pressure.ndim == 0


def stays_flat(scene: Scene) -> bool:
    """True if the pressures squeeze the strip evenly onto a foundation, so that it does not bend.

    Layers and a Phi of the user's own may bend.
    """
    homogeneous = scene.strip.layers is None and scene.energy is None
    alone = homogeneous and scene.member.support == "none"
    return is_pressed_evenly(scene) and alone and scene.contact.normal == "rigid"


def stations(scene: Scene, nodes: int) -> Array:
    """Stations (nodes,) along X: those of load steps, or of plane elasticity.

    The latter are denser at the singular loaded corner and at steps of the pressure.
    """
    length, half_height = scene.strip.length, scene.strip.half_height
    steps, model = scene.contact.steps(length), scene.model
    if scene.member.support != "none":
        return _joint_stations(scene, nodes)
    if model.solution == "condensed":
        grading = (model.end_size, steps, elements.GROWTH, model.far_size, model.small_growth)
        return elements.vertices(nodes - 1, length, half_height, *grading)
    if steps is None:
        return _plane_vertices(scene, nodes, PLANE_END_SIZE, None, PLANE_GROWTH)
    inside = jnp.append(steps < length, False)
    sizes = jnp.where(inside, STEP_SIZE, PLANE_END_SIZE)
    growths = jnp.where(inside, elements.GROWTH, PLANE_GROWTH)
    return _plane_vertices(scene, nodes, sizes, steps, growths)


def _joint_stations(scene: Scene, nodes: int) -> Array:
    """Stations of a lap joint, which are denser at both its ends and at steps of the pressure."""
    length, half_height = scene.strip.length, scene.strip.half_height
    steps, model = scene.contact.steps(length), scene.model
    if model.solution == "condensed":
        start = jnp.zeros_like(length)[None]
        foci = start if steps is None else jnp.append(start, steps)
        grading = (model.end_size, foci, elements.GROWTH, model.far_size, model.small_growth)
        return elements.vertices(nodes - 1, length, half_height, *grading)
    none = jnp.zeros((0,), length.dtype) if steps is None else steps
    foci = jnp.append(jnp.zeros_like(length), none)
    ends = jnp.concatenate([jnp.array([True]), ~(none < length), jnp.array([True])])
    sizes = jnp.where(ends, PLANE_END_SIZE, STEP_SIZE)
    growths = jnp.where(ends, PLANE_GROWTH, elements.GROWTH)
    return _plane_vertices(scene, nodes, sizes, foci, growths)


def _plane_vertices(
    scene: Scene, nodes: int, sizes: Array | float, foci: Array | None, growths: Array | float
) -> Array:
    """Stations of plane elasticity: small elements grow slowly too, as stresses are singular."""
    grading = (sizes, foci, growths, PLANE_FAR_SIZE, PLANE_GROWTH)
    length, half_height = scene.strip.length, scene.strip.half_height
    return elements.vertices(nodes - 1, length, half_height, *grading)


def spring_stiffness(scene: Scene, strip: Strip) -> Array:
    """Stiffness (k,) of the elastic slip of each node, k_t times its contact length."""
    lengths = strip.body.tributary[: strip.body.f_t.size]
    return scene.slip_stiffness(lengths) * lengths


def moving_volume(strip: Strip) -> Array:
    """Integral of |u|^2/u(L)^2 over each layer, (layers,), under an end load, all nodes stuck.

    A second member's counts with the lowest layer; overhangs do not count.
    """
    n = strip.x.size
    given = jnp.zeros((1, 2 * n + 2)).at[0, -2].set(1.0 / strip.body.c)
    if strip.pair is None:
        return _volume(strip, strip.form, strip.elimination, given, slice(n))
    upper, lower = strip.pair.above(given), strip.pair.below(given)
    volume = _volume(strip, strip.form, strip.elimination, upper, slice(n))
    other = _volume(strip, strip.pair.form, strip.pair.elimination, lower, slice(-n, None))
    return volume.at[0].add(jnp.sum(other))


def _volume(
    strip: Strip, form: SectionForm, elimination: Elimination, given: Array, contact: slice
) -> Array:
    """Moving volume (layers,) of one member along the contact."""
    moved = fields(elimination, given)[:, contact, 0]
    return jnp.einsum("i,mi,lmk,ki->l", strip.tributary, moved, form.masses, moved)


def fields(elimination: Elimination, given: Array) -> Array:
    """Fields (m, n, steps) of a form from v and w of its stations, load and pressure (steps, :)."""
    contact = given[:, :-2].reshape(len(given), -1, 2)
    inner = elimination.recovered(given.T)  # (n, m-2, steps)
    return jnp.concatenate([contact.T, jnp.moveaxis(inner, 1, 0)])
