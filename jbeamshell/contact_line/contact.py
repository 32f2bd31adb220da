"""Contact of substructures: a body on a rigid base, or two bodies, pressed and loaded to and fro.

The bodies come from any elastic model (see `jbeamshell.StiffnessModel`).  Their contact is solved
as that of strips and lap joints is: event by event, so that load steps only say where the path is
looked at, with Coulomb friction and unilateral contact between nodes that match.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.checks import (
    NOT_NEGATIVE,
    TINY,
    as_leaf,
    is_traced,
    require,
    require_choice,
    require_count,
    require_finite,
    require_number,
)
from jbeamshell.common.errors import UnconvergedError, warn_of_doubts
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.small import Small
from jbeamshell.contact_line.assembly import press_roughly
from jbeamshell.contact_line.body import Body, local_compliance
from jbeamshell.contact_line.contact_input import (
    check_bodies,
    checked_bolts,
    checked_gap,
    held_nodes,
)
from jbeamshell.contact_line.contact_state import ContactState, pressed
from jbeamshell.contact_line.drives import driven_by_displacement, exchanged
from jbeamshell.contact_line.pair import together
from jbeamshell.contact_line.pressing import press
from jbeamshell.contact_line.substructure import Substructure, potential
from jbeamshell.contact_line.turns import known_turns, turns_of, turns_of_cycles
from jbeamshell.contact_line.walk import SLIDES, Level, walk
from jbeamshell.history.contact_history import ContactHistory
from jbeamshell.numerics.cycles import closed_cycles
from jbeamshell.scene.keys import ASSEMBLIES, CONTROLS
from jbeamshell.scene.parts import unit_path

STEPS = 16  # per half cycle
HARDLY = 1e-11  # energy of a movement over that of the nodes alone, from which nothing resists
SMALL_PUSH = 1e-6  # of the pressing, from which on it pushes along the contact
MOST_CYCLES = 32  # until the loop is steady
REPEATS = 1e-6  # slip left over by a steady cycle, over its largest range
NOISE = 1e-12  # slip over what the friction would move a node by, taken as none
FREER = 30.0  # times `SLIDES`, how much the spring of a body that slides gives way


def solve_contact(
    upper: Substructure,
    lower: Substructure | None = None,
    *,
    friction: ArrayLike = 0.1,
    amplitude: ArrayLike = 1.0,
    cycles: int | None = None,
    steps_per_half_cycle: int = STEPS,
    control: str = "force",
    path: ArrayLike | None = None,
    bolts: ArrayLike = 1.0,
    gap: ArrayLike = 0.0,
    assembly: str = "frictionless",
    points: bool = False,
    throw: bool = True,
) -> ContactHistory:
    """Press bodies together, load them to and fro, and return the history of their contact.

    All numbers may be traced: those of the bodies, friction, amplitude, bolts and gap.

    Parameters
    ----------
    upper : body that is pulled
    lower : body below, on matching nodes, its displacements in the same frame; None is a rigid base
    friction : Coulomb's coefficient mu
    amplitude, steps_per_half_cycle : load path, 0 to A, then cycles A, -A, A
    cycles : number of cycles; None goes on until the loop is steady, 32 at most.  A traced history
        always has 32, those after the first steady one copied at no cost
    control : "force" or "displacement", what the amplitude is of
    path : (levels,) loads instead of the cycles
    bolts : size of each pressing load of the bodies, a number or one for each
    gap : distance of the nodes before anything presses, a number or (n,); in a frictional assembly
        it grows together with the pressures
    assembly : "frictionless", which locks no shear in, as in a scene, or "frictional", as bolts are
        tightened one with the other
    points : True if the nodes are contacts of their own, such as pins, each of which slips as a
        whole; False if they are a mesh of a line, along which slip spreads evenly
    throw : True raises for a load without equilibrium and warns of doubts; False returns NaN, and
        leaves both to ``history.settled`` and ``history.doubts``

    Returns
    -------
    ContactHistory

    Raises
    ------
    InputError
        for numbers that make no sense; if the contact lines do not match; if nothing holds the
        bodies, pulls them or presses them together; or if a pressing without friction would push a
        body away along X
    UnconvergedError
        if a load has no equilibrium, such as beyond gross slip

    Warns
    -----
    DoubtfulWarning
        if the result may still be wrong, see `jbeamshell.ContactHistory.doubts`

    Examples
    --------
    ::

        history = jb.solve_contact(upper, lower, friction=0.1, amplitude=0.5, bolts=[8e3, 8e3])
        history.dissipation, history.loop
    """
    check_bodies(upper, lower)
    require_choice("assembly", assembly, ASSEMBLIES)
    require_choice("control", control, CONTROLS)
    require_number("friction", friction, NOT_NEGATIVE, low=-TINY)
    sizes, gaps = checked_bolts(upper, lower, bolts), checked_gap(upper, gap)
    targets = _targets(amplitude, cycles, steps_per_half_cycle, path)
    held = held_nodes(upper, lower)
    hessian, slides = _relative(upper, lower, sizes)
    if assembly == "frictionless" and not is_traced(hessian):
        _check_push(hessian, held, slides)
    contact = hessian, upper.x, upper.tributary, as_leaf(friction), slides
    flat = not is_traced(gaps) and not np.any(np.asarray(gaps))
    distance = None if flat else jnp.broadcast_to(gaps, upper.x.shape)
    until_steady = path is None and cycles is None
    turns = _turns(targets, cycles, steps_per_half_cycle, path is None)
    half = steps_per_half_cycle if until_steady else None
    settings = control, assembly, half, points, turns
    levels, count, error = _levels((contact, distance, targets), held, settings)
    if until_steady and not is_traced(levels):
        targets = targets[: unit_path(int(count), steps_per_half_cycle).size]
        levels, error = jax.tree.map(lambda a: a[: targets.size + 1], (levels, error))
    if not is_traced(levels) and throw:
        _demand(levels, targets)
    unit = unit_path(MOST_CYCLES if cycles is None else cycles, steps_per_half_cycle)
    loads = unit[: targets.size] if path is None else targets
    history = _history(
        upper, levels, held, error, _cycles(loads), as_leaf(friction), control, assembly, points
    )
    if not is_traced(levels) and throw:
        warn_of_doubts(history.doubts, stacklevel=2)
    return history


def _targets(
    amplitude: ArrayLike, cycles: int | None, steps_per_half_cycle: int, path: ArrayLike | None
) -> Array:
    """Loads (levels,) after the pressing; those of all cycles that a steady one may take."""
    if path is None:
        require_number("amplitude", amplitude)
        if cycles is not None:
            require_count("cycles", cycles, 1)
        count = MOST_CYCLES if cycles is None else cycles
        return as_leaf(amplitude) * jnp.asarray(unit_path(count, steps_per_half_cycle))
    require("cycles", cycles, cycles is None, "is given beside path: leave one of them out")
    loads = as_leaf(path, "path")
    require("path", loads.shape, loads.ndim == 1 and loads.size > 0, "give (levels,) loads")
    require_finite("path", loads)
    return loads


def _turns(targets: Array, cycles: int | None, steps: int, own: bool) -> tuple[bool, ...] | None:
    """Turns of a path of cycles (``own``) or of given loads; None where they are not known yet."""
    if own:
        return None if cycles is None else turns_of_cycles(cycles, steps)
    return None if is_traced(targets) else known_turns(np.asarray(targets))


@jax.jit
def _relative(upper: Substructure, lower: Substructure | None, bolts: Array) -> tuple[Array, Array]:
    """Potential (2n + 2, 2n + 2) in the displacements over what is below, load and pressing.

    True beside it if nothing but friction keeps one of the bodies from moving along X.
    """
    above = potential(upper, bolts)
    if lower is None:
        return above, _slides(upper)
    fixed = np.array(upper.fixed), np.array(lower.fixed)
    hessian = together(above, potential(lower, bolts), *fixed)[0]
    return hessian, _slides(upper) | _slides(lower)


def _slides(body: Substructure) -> Array:
    """True if nothing but friction keeps a body from moving along X."""
    if any(body.fixed[::2]):
        return jnp.asarray(False)
    energy = jnp.sum(body.stiffness[::2, ::2])  # of a unit displacement
    return energy < HARDLY * body.x.size * jnp.max(body.stiffness)


def _check_push(hessian: Array, held: tuple[bool, ...], slides: Array) -> None:
    """Refuse a pressing that pushes along X what only friction would hold."""
    order, free = _order(held)
    press = np.asarray(hessian[:-2, -1]).reshape(-1, 2)[order]
    push, down = np.sum(press[:free, 0]), np.sum(np.abs(press))
    fix = "only friction holds the body against it: take assembly='frictional'"
    stays = not slides or abs(push) <= SMALL_PUSH * down
    require("press", f"{-push:.4g} along X", bool(stays), fix)


@Small
def _levels(
    inputs: tuple[tuple[Array, ...], Array | None, Array],
    held: tuple[bool, ...],
    settings: tuple[str, str, int | None, bool, tuple[bool, ...] | None],
) -> tuple[Level, Array, Array]:
    """Levels of the path, the number of cycles until it is steady, and the `_errors`.

    The pressed contact comes first.  Nodes are as `_order` has them.  The settings are control,
    assembly, the steps per half cycle of a path that goes on until it is steady, else None, True
    for nodes that are contacts of their own, and the turns of the path if they are known.
    """
    (contact, gap, targets), (control, assembly, half, points, turns) = inputs, settings
    body, lift = _pressed_body(contact, gap, held, assembly)
    friction, start = contact[3], pressed(body)
    driven = driven_by_displacement(body) if control == "displacement" else body
    if half is None:
        known = turns_of(targets) if turns is None else turns
        levels = walk(driven, friction, start, targets, known, lift, rounded=not points)
        count = targets
    else:
        levels, count = _until_steady(driven, friction, start, targets, lift, half, points)
    state = jax.vmap(exchanged)(levels.state) if control == "displacement" else levels.state
    sound = jnp.all(jnp.isfinite(lift))
    first = Level(start, lift, jnp.zeros_like(body.c), jnp.zeros_like(start.v, bool), sound)
    levels = levels._replace(state=state, settled=levels.settled & sound)
    levels = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, levels)
    return levels, count, _errors(body, friction, levels)


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
    """Levels of the first loading and of all cycles, and the number of those up to a steady one.

    A cycle is steady if its slip ends where it began, or has moved on as far as in the cycle
    before: a body may walk.  The cycles after it are copies.
    """
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


def _demand(levels: Level, targets: Array) -> None:
    """Refuse a path without equilibrium."""
    settled = np.asarray(levels.settled)
    first = int(np.argmin(settled))
    if settled.all():
        return
    if first == 0:
        raise UnconvergedError("bolts: the contact under the pressing alone comes to no end")
    load = float(np.asarray(targets)[first - 1])
    raise UnconvergedError(
        f"load {load:.6g} (step {first}): no equilibrium, most likely all of the contact slides: "
        "take a smaller amplitude, or control='displacement'"
    )


def _cycles(loads: Array | np.ndarray) -> tuple[tuple[int, int, int], ...]:
    """Closed cycles of a path, whose first step is the pressing; none of one that is traced."""
    return () if is_traced(loads) else closed_cycles(np.append(0.0, np.asarray(loads)))


def _history(
    upper: Substructure,
    levels: Level,
    held: tuple[bool, ...],
    error: Array,
    cycles: tuple[tuple[int, int, int], ...],
    friction: Array,
    control: str,
    assembly: str,
    points: bool,
) -> ContactHistory:
    """History of levels, its nodes along X."""
    order, _ = _order(held)
    places = np.argsort(order)

    def along(values: Array) -> Array:
        missing = ((0, 0), (0, places.size - values.shape[1]))
        return sound(jnp.pad(values, missing)[:, places])

    def sound(values: Array) -> Array:
        return nan_unless(levels.settled, values)

    state = levels.state
    return ContactHistory(
        x=upper.x,
        tributary=upper.tributary,
        force=sound(state.force),
        displacement=sound(state.displacement),
        slip=along(state.v),
        gap=along(levels.lift),
        traction=-along(state.r_t) / upper.tributary,
        reaction=along(state.r_n) / upper.tributary,
        slipping=along(levels.slipping.astype(float)) == 1.0,
        slip_work=sound(levels.slip_work),
        settled=levels.settled,
        error=error,
        friction=friction,
        cycles=cycles,
        control=control,
        assembly=assembly,
        points=points,
    )
