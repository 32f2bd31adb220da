"""Contact of substructures: a body on a rigid base, or two bodies, pressed and loaded to and fro.

The bodies come from any elastic model (see `jbeamshell.StiffnessModel`).  Their contact is solved
as that of strips and lap joints is: event by event, so that load steps only say where the path is
looked at, with Coulomb friction and unilateral contact between nodes that match.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import (
    NOT_NEGATIVE,
    TINY,
    as_leaf,
    is_traced,
    require,
    require_choice,
    require_number,
)
from jbeamshell.common.errors import UnconvergedError
from jbeamshell.common.failed import nan_unless
from jbeamshell.common.small import Small
from jbeamshell.condensed.assembly import press_roughly
from jbeamshell.condensed.body import Body
from jbeamshell.condensed.branches import pressed
from jbeamshell.condensed.drives import driven_by_displacement, exchanged
from jbeamshell.condensed.events import walk
from jbeamshell.condensed.levels import turns_of
from jbeamshell.condensed.pair import together
from jbeamshell.condensed.pressing import press
from jbeamshell.condensed.stretch import Level
from jbeamshell.condensed.substructure import Substructure, loose_mode, potential
from jbeamshell.history.contact_history import ContactHistory
from jbeamshell.numerics.cycles import closed_cycles
from jbeamshell.scene.keys import ASSEMBLIES, CONTROLS
from jbeamshell.scene.parts import Load

MATCH = 1e-6  # of the contact's length, within which nodes match
STEPS = 16  # per half cycle
HARDLY = 1e-11  # energy of a movement over that of the nodes alone, from which nothing resists


def solve_contact(
    upper: Substructure,
    lower: Substructure | None = None,
    *,
    friction: ArrayLike = 0.1,
    amplitude: ArrayLike = 1.0,
    cycles: int = 2,
    steps_per_half_cycle: int = STEPS,
    control: str = "force",
    path: ArrayLike | None = None,
    bolts: ArrayLike = 1.0,
    gap: ArrayLike = 0.0,
    assembly: str = "frictional",
    throw: bool = True,
) -> ContactHistory:
    """Press bodies together, load them to and fro, and return the history of their contact.

    All numbers may be traced: those of the bodies, friction, amplitude, bolts and gap.

    Parameters
    ----------
    upper : body that is pulled
    lower : body below, on matching nodes, its displacements in the same frame; None is a rigid base
    friction : Coulomb's coefficient mu
    amplitude, cycles, steps_per_half_cycle : load path, 0 to A, then so many times A, -A, A
    control : "force" or "displacement", what the amplitude is of
    path : (levels,) loads instead of the cycles
    bolts : size of each pressing load of the bodies, a number or one for each
    gap : distance of the nodes before anything presses, a number or (n,); in a frictional assembly
        it grows together with the pressures
    assembly : "frictional", as bolts are tightened one with the other, or "frictionless", which
        locks no shear in
    throw : False to return steps without equilibrium as NaN

    Returns
    -------
    ContactHistory

    Raises
    ------
    InputError
        if the contact lines do not match, or nothing holds the bodies or presses them together
    UnconvergedError
        if a load has no equilibrium, such as beyond gross slip

    Examples
    --------
    ::

        history = jb.solve_contact(upper, lower, friction=0.1, amplitude=0.5, bolts=[8e3, 8e3])
        history.dissipation, history.loop
    """
    for key, body in (("upper", upper), ("lower", lower)):
        known = isinstance(body, Substructure) or (body is None and key == "lower")
        require(key, type(body).__name__, known, "give a jbeamshell.Substructure")
    require_choice("assembly", assembly, ASSEMBLIES)
    require_choice("control", control, CONTROLS)
    require_number("friction", friction, NOT_NEGATIVE, low=-TINY)
    sizes = _bolts(upper, lower, bolts)
    away = as_leaf(gap, "gap")
    fix = f"give a number or {upper.x.size} of them, not negative"
    require("gap", gap, away.shape in ((), upper.x.shape), fix)
    require("gap", gap, is_traced(away) or bool(np.all(np.asarray(away) >= 0.0)), fix)
    targets = _targets(amplitude, cycles, steps_per_half_cycle, path)
    if lower is not None:
        _check_match(upper, lower)
        _check_held(upper, lower)
    held = _held(upper, lower)
    hessian = _relative(upper, lower, sizes)
    contact = hessian, upper.x, upper.tributary, as_leaf(friction)
    flat = assembly == "frictional" and not is_traced(away) and not np.any(away)
    distance = None if flat else jnp.broadcast_to(away, upper.x.shape)
    slides = assembly == "frictionless" and (_slides(upper) or _slides(lower))
    words = control, assembly, slides
    levels: Level = _walked((contact, distance, targets), held, words)
    if not is_traced(levels) and throw:
        _demand(levels, targets)
    return _history(upper, levels, held, _cycles(targets, cycles, steps_per_half_cycle, path))


def _bolts(upper: Substructure, lower: Substructure | None, bolts: ArrayLike) -> Array:
    """Size of each pressing load, (m - 1,)."""
    count = upper.bolts if lower is None else max(upper.bolts, lower.bolts)
    require("bolts", 0, count > 0, "nothing presses the bodies together: condense one with press=")
    for key, body in (("upper.press", upper), ("lower.press", lower)):
        if body is not None:
            fix = f"give {count} in both bodies, or none in one of them"
            require(key, body.bolts, body.bolts in (0, count), fix)
    sizes = as_leaf(bolts, "bolts")
    fix = f"give a number, or one for each of {count} presses"
    require("bolts", bolts, sizes.shape in ((), (count,)), fix)
    return jnp.broadcast_to(sizes, (count,))


def _targets(
    amplitude: ArrayLike, cycles: int, steps_per_half_cycle: int, path: ArrayLike | None
) -> Array:
    """Loads (levels,) after the pressing."""
    if path is None:
        require_number("amplitude", amplitude)
        return as_leaf(amplitude) * jnp.asarray(_unit_path(cycles, steps_per_half_cycle))
    loads = as_leaf(path, "path")
    require("path", loads.shape, loads.ndim == 1 and loads.size > 0, "give (levels,) loads")
    return loads


def _unit_path(cycles: int, steps: int) -> np.ndarray:
    """Loads of the cycles for the amplitude 1."""
    return Load(amplitude=jnp.ones(()), cycles=cycles, steps_per_half_cycle=steps).unit_path()


def _check_match(upper: Substructure, lower: Substructure) -> None:
    """Refuse contact lines that do not match, and a place that both bodies hold."""
    same = upper.x.size == lower.x.size
    fix = f"does not match the {upper.x.size} nodes of the upper body: mesh both lines alike"
    require("lower.x", f"{lower.x.size} nodes", same, fix)
    if is_traced(upper.x, lower.x):
        return
    x, other = np.asarray(upper.x), np.asarray(lower.x)
    worst = int(np.argmax(np.abs(x - other)))
    fix = f"does not match node {worst} of the upper body at X = {x[worst]:.6g}: mesh both alike"
    close = abs(x[worst] - other[worst]) <= MATCH * float(np.ptp(x))
    require(f"lower.x[{worst}]", float(other[worst]), close, fix)


def _held(upper: Substructure, lower: Substructure | None) -> tuple[bool, ...]:
    """True for contact nodes (n,) that cannot slip, because supports hold both sides."""
    fixed = np.array(upper.fixed).reshape(-1, 2)
    if lower is not None:
        fixed = fixed & np.array(lower.fixed).reshape(-1, 2)
    first = int(np.argmax(fixed[:, 1]))
    fix = "holds the normal direction of both sides: leave this node out of the contact"
    require(f"contact[{first}]", "a support", not fixed[:, 1].any(), fix)
    return tuple(fixed[:, 0].tolist())


def _check_held(upper: Substructure, lower: Substructure) -> None:
    """Refuse two bodies that move together without energy."""
    if is_traced(upper, lower):
        return
    fixed = np.array(upper.fixed) | np.array(lower.fixed)  # the bodies stuck to each other
    both = np.asarray(upper.stiffness + lower.stiffness)
    both = np.where(fixed | fixed[:, None], 0.0, both) + np.diag(fixed * np.max(both))
    mode = loose_mode(both, np.asarray(upper.x))
    fix = f"{mode} with the other one: hold one of them by a support"
    require("lower", "loose body", not mode, fix)


def _slides(body: Substructure | None) -> bool:
    """True if nothing but friction keeps a body from moving along X."""
    if body is None or any(body.fixed[::2]):
        return False
    fix = "asks the numbers of the bodies what holds them: take 'frictional' where they are traced"
    require("assembly", "frictionless", not is_traced(body.stiffness), fix)
    stiffness = np.asarray(body.stiffness)
    energy = float(np.sum(stiffness[::2, ::2]))  # of a unit displacement
    return energy < HARDLY * body.x.size * float(np.max(stiffness))


@jax.jit
def _relative(upper: Substructure, lower: Substructure | None, bolts: Array) -> Array:
    """Potential (2n + 2, 2n + 2) in the displacements over what is below, load and pressing."""
    own = potential(upper, bolts)
    if lower is None:
        return own
    fixed = np.array(upper.fixed), np.array(lower.fixed)
    return together(own, potential(lower, bolts), *fixed)[0]


@Small
def _walked(
    given: tuple[tuple[Array, ...], Array | None, Array],
    held: tuple[bool, ...],
    words: tuple[str, str, bool],
) -> Level:
    """Levels of the path, the pressed contact first; nodes as `_order` has them."""
    ((hessian, x, tributary, friction), gap, targets), (control, assembly, slides) = given, words
    order, free = _order(held)
    v, w = 2 * order[:free], 2 * order + 1
    k_tt, k_tn, k_nn = hessian[np.ix_(v, v)], hessian[np.ix_(v, w)], hessian[np.ix_(w, w)]
    press_t, press_n, away = hessian[v, -1], hessian[w, -1], None if gap is None else gap[order]
    traction = jnp.zeros_like(press_t)
    if assembly == "frictional":
        rough = press_roughly(k_tt, k_tn, k_nn, press_t, press_n, friction, away)
        lift, reaction, traction = rough.lift, rough.reaction, rough.traction
    else:
        some = free - 1 if slides else free  # without friction one node keeps its place
        parts = k_tt[:some, :some], k_tn[:some], k_nn, press_t[:some], press_n
        lift, _, reaction = press(*parts, gap=away)
    body = Body(
        x=x[order],
        tributary=tributary[order],
        K_tt=k_tt,
        K_tn=k_tn,
        K_nn=k_nn,
        f_t=-hessian[v, -2],
        f_n=-hessian[w, -2],
        r_0=reaction,
        t_0=traction,
        c=-hessian[-2, -2],
    )
    start = pressed(body)
    driven = driven_by_displacement(body) if control == "displacement" else body
    found = walk(driven, friction, start, targets, turns_of(targets), lift)
    state = jax.vmap(exchanged)(found.state) if control == "displacement" else found.state
    sound = jnp.all(jnp.isfinite(lift))
    first = Level(start, lift, jnp.zeros_like(body.c), jnp.zeros_like(start.v, bool), sound)
    found = found._replace(state=state, settled=found.settled & sound)
    return jax.tree.map(lambda one, more: jnp.concatenate([one[None], more]), first, found)


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


def _cycles(
    targets: Array, cycles: int, steps: int, path: ArrayLike | None
) -> tuple[tuple[int, int, int], ...]:
    """Closed cycles of the path, whose first step is the pressing."""
    if path is None:
        loads = _unit_path(cycles, steps)
    else:
        loads = np.zeros(0) if is_traced(targets) else np.asarray(targets)
    return closed_cycles(np.append(0.0, loads)) if loads.size else ()


def _history(
    upper: Substructure,
    levels: Level,
    held: tuple[bool, ...],
    cycles: tuple[tuple[int, int, int], ...],
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
        cycles=cycles,
    )
