"""Strip of a scene on its contact line: its stations, its pressing, its condensed body."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.numbers_of import numbers_of, pad, put
from jbeamshell.contact_line import entry
from jbeamshell.contact_line.assembly import press_roughly
from jbeamshell.contact_line.body import Body, Elimination, Unknown, eliminate
from jbeamshell.contact_line.ends import end_section
from jbeamshell.contact_line.pair import Member, Pair, as_one, joined, with_shanks
from jbeamshell.contact_line.pressing import press as press_down
from jbeamshell.contact_line.section import section_form
from jbeamshell.contact_line.stations import stations
from jbeamshell.mechanics import elements
from jbeamshell.mechanics.section_form import SectionForm, on_symmetry_plane
from jbeamshell.numerics.factors import solve
from jbeamshell.scene.keys import FAR_ENDS
from jbeamshell.scene.parts import Load
from jbeamshell.scene.scene import Scene

RULE = elements.element_rule("finite-difference")


class Members(NamedTuple):
    """Strip of a scene, with its second member if there is one, on its contact line.

    Attributes
    ----------
    elimination : what finds the fields above the contact again
    hessian : (2n+2, 2n+2) of the potential in v and w of all stations, end load and pressure; of
        members that are not `pressed` yet the pressures are several
    pair : second member of a lap joint; v, w and hessian are then relative to it
    """

    elimination: Elimination | Unknown
    hessian: Array
    pair: Pair | None = None

    def pressed(self, top: Array, bottom: Array, up: Array) -> Members:
        """Members under pressures of some sizes that act as one.

        Parameters
        ----------
        top, bottom : sizes of the pressures on both faces, or members
        up : (n,) nodal forces of the latter, on the contact line of a strip alone
        """
        xp, elimination, pair = numbers_of(self, top), self.elimination.pressed(top), self.pair
        sizes = top if pair is None else xp.append(top, bottom)
        hessian = as_one(as_one(self.hessian, sizes).T, sizes)
        if pair is None:
            lift = pad(xp.stack([xp.zeros_like(up), up], axis=1).ravel(), (0, 2))
            from_below = lift[:, None] * np.eye(lift.size)[-1]
            return Members(elimination, hessian - from_below - from_below.T)
        return Members(elimination, hessian, pair.pressed(top, bottom))

    def recovered_by(self, members: Members, scene: Scene) -> Members:
        """Members whose fields are found as those of others, of the same strip but not pressed."""
        top, bottom = _sizes(scene)
        pair = self.pair
        if pair is not None and members.pair is not None:
            pair = pair._replace(elimination=members.pair.elimination.pressed(bottom))
        return self._replace(elimination=members.elimination.pressed(top), pair=pair)

    @property
    def of_contact(self) -> Members:
        """Members without what finds the fields above the contact again."""
        pair = self.pair
        if pair is not None:
            pair = pair._replace(elimination=pair.elimination.forgotten)
        return self._replace(elimination=self.elimination.forgotten, pair=pair)


class Strip(NamedTuple):
    """Strip of a scene, condensed.

    Attributes
    ----------
    body : contact line, numbered from the loaded end
    form : energy of the section
    pressed : the strip under its pressures
    loaded : the strip under its load, whose members may go on beyond the contact
    x, tributary, load : (n,) stations from the far end, contact lengths, forces of the top pressure
    settled, lift : (k,) tangential displacements and (n,) lifts under the pressures, relative to a
        second member
    """

    body: Body
    form: SectionForm
    pressed: Members
    loaded: Members
    x: Array
    tributary: Array
    load: Array
    settled: Array
    lift: Array

    @property
    def of_contact(self) -> Strip:
        """Strip without what finds the fields above the contact again: they are NaN."""
        return self._replace(pressed=self.pressed.of_contact, loaded=self.loaded.of_contact)

    def recovered_by(self, strip: Unpressed, scene: Scene) -> Strip:
        """Strip whose fields above the contact are found as those of an unpressed one."""
        pressed = self.pressed.recovered_by(strip.under_pressure, scene)
        loaded = self.loaded.recovered_by(strip.under_load, scene)
        return self._replace(pressed=pressed, loaded=loaded)


class Unpressed(NamedTuple):
    """Strip of a scene, condensed for pressures of any size.

    Attributes
    ----------
    form : energy of the section
    x : (n,) stations from the far end
    top, bottom : (n, p) nodal forces of each row of both pressures, its size 1
    under_pressure, under_load : members while they are pressed, and while they are loaded
    """

    form: SectionForm
    x: Array
    top: Array
    bottom: Array
    under_pressure: Members
    under_load: Members

    @property
    def of_contact(self) -> Unpressed:
        """Strip without what finds the fields above the contact again."""
        parts = self.under_pressure.of_contact, self.under_load.of_contact
        return self._replace(under_pressure=parts[0], under_load=parts[1])


def condensed(scene: Scene, nodes: int) -> Strip:
    """Strip of a scene as its condensed section, or as plane elasticity, on its contact nodes."""
    return pressed(scene, unpressed(scene, nodes))


def unpressed(scene: Scene, nodes: int) -> Unpressed:
    """Strip of a scene, condensed for pressures of any size."""
    form, x, contact = section_form(scene), stations(scene, nodes), scene.contact
    top, bottom = (_rows(x, face) for face in (contact.pressure, contact.bottom_pressure))
    alone = scene.member.support == "none"
    return Unpressed(
        form, x, top, bottom, *(_alone if alone else _joint)(scene, form, x, top, bottom)
    )


def pressed(scene: Scene, strip: Unpressed) -> Strip:
    """Strip under a scene's pressures, condensed for its other numbers."""
    form, x, xp = strip.form, strip.x, numbers_of(scene, strip)
    top, bottom = _sizes(scene)
    down, up = strip.top @ top, strip.bottom @ bottom
    tributary = elements.tributary_lengths(RULE, x)
    under_pressure, under_load = (
        members.pressed(top, bottom, up) for members in (strip.under_pressure, strip.under_load)
    )
    gap = initial_gap(scene, x)
    last = 2 * x.size - 2
    v = slice(last, 0 if "v" in FAR_ENDS[scene.strip.far_end] else None, -2)
    w = slice(last + 1, None, -2)
    hessian = under_pressure.hessian
    k_tt, k_tn, press = hessian[v, v], hessian[v, w], hessian[:-2, -1]
    # Without friction the far end keeps its place, even if nothing else holds it.
    count = x.size - 1
    press_t, traction = press[v][:count], xp.zeros_like(press[v])
    stiffness = k_tt[:count, :count], k_tn[:count], hessian[w, w]
    gaps = None if gap is None else gap[::-1]
    if scene.member.assembly == "frictional":
        loads = press[v], press[w], scene.contact.friction
        lift, settled, reaction, traction = press_roughly(k_tt, k_tn, hessian[w, w], *loads, gaps)
    elif stays_flat(scene):
        lift, reaction = 0.0 * x, (down - up)[::-1]
        settled = solve(stiffness[0], -press_t)
    else:
        based = scene.contact.normal == "rigid"
        lift, settled, reaction = press_down(*stiffness, press_t, press[w], based, gaps)
    if gap is not None:
        under_pressure, under_load = (over_gap(part, gap) for part in (under_pressure, under_load))
    settled = pad(settled, (0, k_tt.shape[0] - settled.size))
    hessian = under_load.hessian
    if scene.member.bolt_stiffness is not None:
        hessian = with_shanks(hessian, scene.member.bolt_stiffness, down)
    body = Body(
        x=x[::-1],
        tributary=tributary[::-1],
        K_tt=hessian[v, v],
        K_tn=hessian[v, w],
        K_nn=hessian[w, w],
        f_t=-hessian[v, -2],
        f_n=-hessian[w, -2],
        r_0=reaction,
        t_0=traction,
        c=-hessian[-2, -2],
    )
    under_load = under_load._replace(hessian=hessian)
    return Strip(body, form, under_pressure, under_load, x, tributary, down, settled, lift)


def _alone(
    scene: Scene, form: SectionForm, x: Array, top: Array, bottom: Array
) -> tuple[Members, Members]:
    """Strip on a rigid base, while it is pressed and while it is loaded."""
    del bottom  # what lifts it acts on its contact line itself
    ends = [entry.loaded_end(scene, form, mounted).end for mounted in entry.states(scene)]
    lines = eliminate(form, x, top, entry.far_end(scene, form), *ends)
    members = [Members(line.elimination, line.hessian) for line in lines]
    return members[0], members[-1]


def _joint(
    scene: Scene, form: SectionForm, x: Array, top: Array, bottom: Array
) -> tuple[Members, Members]:
    """Both members of a lap joint, while they are pressed and while they are loaded."""
    members, load = [], 2 * x.size
    for upper, lower, stretch in lap_members(scene, form, x, top, bottom):
        pair, hessian = joined(upper, lower)
        hessian = put(hessian, (load, load), hessian[load, load] + stretch)
        members.append(Members(upper.line.elimination, hessian, pair))
    return members[0], members[-1]


def lap_members(
    scene: Scene, form: SectionForm, x: Array, top: Array, bottom: Array
) -> list[tuple[Member, Member, Array]]:
    """Members of a lap joint under the pressures, and under the load if they are mounted then.

    Parameters
    ----------
    top, bottom : (n, p) nodal forces of the pressures on both

    Returns
    -------
    list
        upper and lower member, and the compliance of the latter that u leaves out
    """
    n, strip, rolls = x.size, scene.strip, scene.member.support == "rolling"
    upper_form, below = loaded(form, scene.load), section_form(scene.of_member())
    flat = rolls and below.top == 0  # what cannot be squeezed keeps its height
    below = on_symmetry_plane(below) if rolls else below
    arm = strip.half_height + scene.member.beside(strip).half_height
    arm = arm if scene.load.arm is None else arm + scene.load.arm
    pull = below.turn if scene.load.kind == "moment" else below.pull + arm * below.turn
    below = below._replace(pull=0.0 * below.pull)  # the load acts above
    free = np.zeros((n - 1, 2), bool)
    states = entry.states(scene)
    entering = [entry.loaded_end(scene, upper_form, mounted) for mounted in states]
    uppers = eliminate(
        upper_form, x, top, end_section(upper_form), *(held.end for held in entering)
    )
    members = []
    for mounted, held, upper in zip(states, entering, uppers, strict=True):
        leaving, stretch = entry.leaving_end(scene, below, pull, flat, mounted)
        fixed = np.append(leaving.fixed, free).reshape(n, 2) | [False, flat]
        fixed[-1, 1] |= not mounted and not rolls  # else it would turn
        (lower,) = eliminate(below, x, bottom, leaving.end, end_section(below))
        above = Member(upper_form, upper, np.append(free, held.fixed))
        members.append((above, Member(below, lower, fixed.ravel()), stretch))
    return members


def over_gap(members: Members, gap: Array) -> Members:
    """Members in their opening w + g_0 instead of the relative lift w.

    Parameters
    ----------
    gap : (n,) distance g_0 of the members before anything presses
    """
    xp = numbers_of(members, gap)
    shift = xp.stack([0.0 * gap, -gap], axis=1).ravel()
    unit = np.eye(shift.size + 2, dtype=gap.dtype)
    change = put(unit, (slice(-2), -1), shift)
    pair = members.pair
    assert pair is not None
    moved = pair._replace(upper=pair.upper @ change, lower=pair.lower @ change)
    return members._replace(hessian=change.T @ members.hessian @ change, pair=moved)


def initial_gap(scene: Scene, x: Array) -> Array | None:
    """Distance (n,) of the members at their stations before the pressing; None if they touch."""
    gap = scene.member.gap
    if gap is None:
        return None
    xp = numbers_of(gap, x)
    return xp.interp(x, gap[:, 0], gap[:, 1]) if gap.ndim else xp.broadcast_to(gap, x.shape)


def loaded(form: SectionForm, load: Load) -> SectionForm:
    """Form of a section whose end is loaded by a moment, or by a force away from mid-height."""
    if load.kind == "moment":
        return form._replace(pull=form.turn)
    return form if load.arm is None else form._replace(pull=form.pull - load.arm * form.turn)


def _sizes(scene: Scene) -> tuple[Array, Array]:
    """Sizes (p,) of the rows of the pressures on both faces."""
    faces = scene.contact.pressure, scene.contact.bottom_pressure
    top, bottom = (face[:, 1] if face.ndim else face[None] for face in faces)
    return top, bottom


def _rows(x: Array, pressure: Array) -> Array:
    """Nodal forces (n, p) of the rows of a pressure, each of size 1."""
    if pressure.ndim == 0:
        return elements.tributary_lengths(RULE, x)[:, None]
    xp, places, units = numbers_of(x, pressure), pressure[:, 0], np.eye(len(pressure))
    tables = [xp.stack([places, xp.asarray(unit, x.dtype)], axis=1) for unit in units]
    return xp.stack([elements.nodal_loads(RULE, x, table) for table in tables], axis=1)


def pressing(scene: Scene, x: Array) -> tuple[Array, Array]:
    """Forces (n,) of the pressures on the top face, downwards, and the bottom face, upwards."""
    down = elements.nodal_loads(RULE, x, scene.contact.pressure)
    return down, elements.nodal_loads(RULE, x, scene.contact.bottom_pressure)


def is_pressed_evenly(scene: Scene) -> bool:
    """True if neither pressure is a table."""
    return scene.contact.pressure.ndim == scene.contact.bottom_pressure.ndim == 0


def stays_flat(scene: Scene) -> bool:
    """True if the pressures squeeze the strip evenly onto a foundation, so that it does not bend.

    Layers and a Phi of the user's own may bend.  A bar never does.
    """
    if scene.plan.section == "bar":
        return True
    homogeneous = scene.strip.layers is None and scene.energy is None
    alone = homogeneous and scene.member.support == "none"
    return is_pressed_evenly(scene) and alone and scene.contact.normal == "rigid"


def spring_stiffness(scene: Scene, strip: Strip) -> Array:
    """Stiffness (k,) of the elastic slip of each node, k_t times its contact length."""
    lengths = strip.body.tributary[: strip.body.f_t.size]
    return scene.slip_stiffness(lengths) * lengths


def moving_volume(strip: Strip) -> Array:
    """Integral of |u|^2/u(L)^2 over each layer, (layers,), under an end load, all nodes stuck.

    A second member's counts with the lowest layer; lengths beyond the contact do not count.
    """
    n = strip.x.size
    movement = jnp.zeros((1, 2 * n + 2)).at[0, -2].set(1.0 / strip.body.c)
    upper, lower = moved_by(strip.loaded, movement)
    volume = _volume(strip, strip.form, upper)
    if lower is None:
        return volume
    assert strip.loaded.pair is not None
    return volume.at[0].add(jnp.sum(_volume(strip, strip.loaded.pair.form, lower)))


def _volume(strip: Strip, form: SectionForm, moved: Array) -> Array:
    """Moving volume (layers,) of one member along the contact, of its fields (m, n, 1)."""
    one = moved[..., 0]
    return jnp.einsum("i,mi,lmk,ki->l", strip.tributary, one, form.masses, one)


def moved_by(members: Members, movement: Array) -> tuple[Array, Array | None]:
    """Fields (m, n, steps) of the strip and of its second member, each of its own form.

    Parameters
    ----------
    movement : (steps, 2n + 2) v and w of the stations, end load and pressure
    """
    pair = members.pair
    if pair is None:
        return _fields(members.elimination, movement), None
    above = _fields(members.elimination, pair.above(movement))
    return above, _fields(pair.elimination, pair.below(movement))


def _fields(elimination: Elimination | Unknown, movement: Array) -> Array:
    """Fields (m, n, steps) of a form from v and w of its stations, load and pressure (steps, :)."""
    xp = numbers_of(elimination, movement)
    contact = movement[:, :-2].reshape(len(movement), -1, 2)
    inner = elimination.recovered(movement.T)  # (n, m-2, steps)
    return xp.concatenate([contact.T, xp.moveaxis(inner, 1, 0)])
