"""Contact of bodies on a line, walked event by event, as that of strips and lap joints is.

Load steps only say where the path is looked at.  Friction is Coulomb's, the contact unilateral.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.bodies.contact_input import Problem, held_nodes
from jbeamshell.bodies.joined import joined
from jbeamshell.bodies.levels import Found, Levels
from jbeamshell.bodies.substructure import Substructure
from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.small import Small
from jbeamshell.contact_line.assembly import press_roughly
from jbeamshell.contact_line.body import Body, local_compliance
from jbeamshell.contact_line.contact_state import ContactState, pressed
from jbeamshell.contact_line.drives import driven_by_displacement, exchanged
from jbeamshell.contact_line.pressing import press
from jbeamshell.contact_line.turns import known_turns, turns_of
from jbeamshell.contact_line.walk import SLIDES, Level, walk

STEPS = 16  # per half cycle
MOST_CYCLES = 32  # until the loop is steady
HARDLY = 1e-11  # energy of a movement over that of the nodes alone, from which nothing resists
SMALL_PUSH = 1e-6  # of the pressing, from which on it pushes along the contact
REPEATS = 1e-6  # slip left over by a steady cycle, over its largest range
NOISE = 1e-12  # slip over what the friction would move a node by, taken as none
FREER = 30.0  # times `SLIDES`, how much the spring of a body that slides gives way

Settings = tuple[str, str, int | None, bool, tuple[bool, ...] | None]


def solved(problem: Problem) -> Found:
    """Levels of a contact, and the number of its cycles until it is steady.

    A cycle is steady if its slip ends where it began, or has moved on as far as in the cycle
    before: a body may walk.  The cycles after it are copies.

    Raises
    ------
    InputError
        for supports that leave nothing to slip, or if a pressing without friction would push a
        body away along X
    """
    upper, lower = problem.upper, problem.lower
    held = held_nodes(upper, lower)
    potential, slides = joined(upper, lower), _slides(upper, lower)
    if problem.assembly == "frictionless" and not is_traced(potential, problem.loads):
        down = potential[:, 2 * len(held) :] @ problem.loads[0]
        _check_push(down, held, slides)
    flat = not is_traced(problem.gap) and not np.any(np.asarray(problem.gap))
    turns = None if problem.half is not None else _turns(problem)
    bodies = potential, upper.places, upper.tributary, problem.friction, slides
    settings = problem.control, problem.assembly, problem.half, problem.points, turns
    return Found(*_levels((bodies, None if flat else problem.gap, problem.loads), held, settings))


def _turns(problem: Problem) -> tuple[bool, ...] | None:
    """Turns of the path; None where they are not known yet."""
    loads = problem.loads[1:, 0] if problem.unit is None else problem.unit
    return None if is_traced(loads) else known_turns(np.asarray(loads))


@jax.jit
def _slides(upper: Substructure, lower: Substructure | None) -> Array:
    """True if nothing but friction keeps one of the bodies from moving along X."""
    slides = jnp.asarray(False)
    for body in (upper,) if lower is None else (upper, lower):
        energy = jnp.sum(body.stiffness[::2, ::2])  # of a unit displacement
        free = energy < HARDLY * body.places.size * jnp.max(body.stiffness)
        slides = slides | (free & (not any(body.fixed[::2])))
    return slides


def _mixed(first: Array) -> Array:
    """Load to and fro and pressing (m, 2) as parts of all loads, of which (m,) press."""
    return jnp.stack([jnp.eye(1, first.size)[0], first], axis=1)


def _check_push(down: Array, held: tuple[bool, ...], slides: Array) -> None:
    """Refuse a pressing that pushes along X what only friction would hold.

    Parameters
    ----------
    down : (2n + m,) forces of the nodes against the pressing
    """
    order, free = _order(held)
    press = np.asarray(down)[: 2 * len(held)].reshape(-1, 2)[order]
    push, size = np.sum(press[:free, 0]), np.sum(np.abs(press))
    fix = "only friction holds the body against it: take assembly='frictional'"
    stays = not slides or abs(push) <= SMALL_PUSH * size
    require("press", f"{-push:.4g} along X", bool(stays), fix)


@Small
def _levels(
    inputs: tuple[tuple[Array, ...], Array | None, Array],
    held: tuple[bool, ...],
    settings: Settings,
) -> tuple[Levels, Array]:
    """Levels of the path, and the number of cycles until it is steady.

    The settings are control, assembly, the steps per half cycle of a path that goes on until it is
    steady, else None, True for nodes that are contacts of their own, and the turns of the path if
    they are known.
    """
    (bodies, gap, loads), (control, assembly, half, points, turns) = inputs, settings
    potential, x, tributary, friction, slides = bodies
    size, targets = 2 * x.size, loads[1:, 0]
    both = jax.scipy.linalg.block_diag(jnp.eye(size), _mixed(loads[0]))
    hessian = both.T @ potential @ both
    body, lift = _pressed_body((hessian, x, tributary, friction, slides), gap, held, assembly)
    start = pressed(body)
    driven = driven_by_displacement(body) if control == "displacement" else body
    count = jnp.asarray(0)
    if half is None:
        known = turns_of(targets) if turns is None else turns
        levels = walk(driven, friction, start, targets, known, lift, rounded=not points)
    else:
        levels, count = _until_steady(driven, friction, start, targets, lift, half, points)
    state = jax.vmap(exchanged)(levels.state) if control == "displacement" else levels.state
    sound = jnp.all(jnp.isfinite(lift))
    first = Level(start, lift, jnp.zeros_like(body.c), jnp.zeros_like(start.v, bool), sound)
    levels = levels._replace(state=state, settled=levels.settled & sound)
    levels = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, levels)
    return _in_order(levels, potential, loads, held, _errors(body, friction, levels)), count


def _in_order(
    levels: Level, potential: Array, loads: Array, held: tuple[bool, ...], error: Array
) -> Levels:
    """Levels with the nodes along X, from those with nodes as `_order` has them."""
    order, _ = _order(held)
    places, size = np.argsort(order), 2 * len(held)

    def along(values: Array) -> Array:
        missing = ((0, 0), (0, places.size - values.shape[1]))
        return jnp.pad(values, missing)[:, places]

    state, slip, gap = levels.state, along(levels.state.v), along(levels.lift)
    moved = jnp.stack([slip - slip[0], gap - gap[0]], axis=2).reshape(loads.shape[0], -1)
    loads = loads.at[:, 0].set(state.force)
    others = -moved @ potential[:size, size:] - (loads - loads[0]) @ potential[size:, size:]
    return Levels(
        loads=loads,
        displacements=others.at[:, 0].set(state.displacement),
        slip=slip,
        gap=gap,
        friction_force=-along(state.r_t),
        normal_force=along(state.r_n),
        slipping=along(levels.slipping.astype(float)) == 1.0,
        slip_work=levels.slip_work,
        sound=levels.settled,
        error=error,
        iterations=jnp.zeros(loads.shape[0]),
    )


def _pressed_body(
    contact: tuple[Array, ...], gap: Array | None, held: tuple[bool, ...], assembly: str
) -> tuple[Body, Array]:
    """Body on its contact line, and its lift (n,) under the pressing."""
    hessian, x, tributary, friction, slides = contact
    order, free = _order(held)
    v, w = 2 * order[:free], 2 * order + 1
    k_tt, k_tn, k_nn = hessian[np.ix_(v, v)], hessian[np.ix_(v, w)], hessian[np.ix_(w, w)]
    pressing, gap = (hessian[v, -1], hessian[w, -1]), None if gap is None else gap[order]
    traction = jnp.zeros_like(pressing[0])
    f_t, f_n, c = -hessian[v, -2], -hessian[w, -2], -hessian[-2, -2]
    # Without a weak spring, the matrix of a body that friction alone holds is singular once all of
    # it slips, even for a moment in which one part slips along and another against v.
    stiffness = jnp.append(jnp.diag(k_tt), jnp.diag(k_nn))
    softness = c + local_compliance(stiffness, jnp.append(f_t, f_n))
    k_tt = k_tt + jnp.where(slides, 1.0 / (FREER * SLIDES * free * softness), 0.0) * jnp.eye(free)
    if assembly == "frictional":
        lift, _, reaction, traction = press_roughly(k_tt, k_tn, k_nn, *pressing, friction, gap)
    else:
        # Without friction a spring that carries nothing keeps its place.
        spring = jnp.where(slides, jnp.max(stiffness), 0.0)
        k_spring = k_tt.at[-1, -1].add(spring)
        lift, _, reaction = press(k_spring, k_tn, k_nn, *pressing, gap=gap)
    body = Body(
        x=x[order],
        tributary=tributary[order],
        K_tt=k_tt,
        K_tn=k_tn,
        K_nn=k_nn,
        f_t=f_t,
        f_n=f_n,
        r_0=reaction,
        t_0=traction,
        c=c,
    )
    return body, lift


def _errors(body: Body, friction: Array, levels: Level) -> Array:
    """Largest violation (levels,) of balance, Coulomb's law and Signorini's, over the reactions.

    It needs nothing that the walk knows but its levels.
    """
    state, lift, k = levels.state, levels.lift, body.f_t.size
    slip, rise = state.v - state.v[0], lift - lift[0]
    r_t = body.t_0 + slip @ body.K_tt + rise @ body.K_tn.T - jnp.outer(state.force, body.f_t)
    r_n = body.r_0 + slip @ body.K_tn + rise @ body.K_nn - jnp.outer(state.force, body.f_n)
    violations = [
        jnp.abs(r_t - state.r_t),
        jnp.abs(r_n - state.r_n),
        jnp.abs(state.r_t) - friction * state.r_n[:, :k],
        -state.r_n,
        -lift * jnp.diag(body.K_nn),
        jnp.minimum(jnp.abs(lift * jnp.diag(body.K_nn)), jnp.abs(state.r_n)),
    ]
    worst = jnp.max(jnp.concatenate(violations, axis=1), axis=1)
    return worst / jnp.max(jnp.abs(state.r_n), axis=1)


def _until_steady(
    body: Body,
    friction: Array,
    start: ContactState,
    targets: Array,
    lift: Array,
    half: int,
    points: bool,
) -> tuple[Level, Array]:
    """Levels of the first loading and of all cycles, and the number of those up to a steady one."""
    rise, k = targets.size - 2 * half * MOST_CYCLES, start.v.size
    rest = jnp.full(2 * half - rise, targets[rise - 1])  # the load rests until the first cycle
    loads = jnp.concatenate([targets[:rise], rest, targets[rise:]])
    turning = np.zeros((MOST_CYCLES + 1, 2 * half), bool)
    turning[:, 0] = turning[1:, half] = True
    turns = tuple(turning.ravel().tolist())
    walked = walk(body, friction, start, loads, turns, lift, rounded=not points)

    v, r_t = (lax.stop_gradient(a).reshape(-1, 2 * half, k) for a in walked.state[:2])
    before, tractions = (
        jnp.concatenate([first[None], each[:-1, -1]])
        for first, each in ((start.v, v), (start.r_t, r_t))
    )
    drift = v[:, -1] - before
    apart = drift, jnp.diff(drift, axis=0, prepend=0.0)
    leftover = jnp.minimum(*(jnp.max(jnp.abs(way), axis=1) for way in apart))
    slips = jnp.ptp(jnp.concatenate([before[:, None], v], axis=1), axis=1)
    none = NOISE * jnp.max(jnp.abs(tractions), axis=1) / jnp.max(jnp.abs(body.K_tt))
    repeats = leftover <= REPEATS * jnp.max(slips, axis=1) + none
    closes, settled = np.arange(MOST_CYCLES + 1) > 0, walked.settled[2 * half - 1 :: 2 * half]
    steady = (closes & repeats) | ~settled
    last = jnp.where(jnp.any(steady), jnp.argmax(steady), MOST_CYCLES)
    numbers = np.append(np.arange(rise), np.arange(2 * half, loads.size))
    copied = jnp.minimum(numbers // (2 * half), last) * 2 * half + numbers % (2 * half)
    levels = jax.tree.map(lambda a: a[copied], walked)
    return levels, jnp.maximum(last, 1)


def _order(held: tuple[bool, ...]) -> tuple[np.ndarray, int]:
    """Numbers (n,) of the nodes, those that cannot slip last, and how many can."""
    backwards = np.arange(len(held))[::-1]
    stays = np.array(held)[backwards]
    return np.concatenate([backwards[~stays], backwards[stays]]), int(np.sum(~stays))
