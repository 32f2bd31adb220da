"""Error estimates of a run's dissipation, from the slip of its last cycle.

Newton's method finds the equilibrium of a grid, no matter if the grid resolves the contact.  Four
errors would stay unseen.  So few nodes may slip that the grid decides how much they dissipate.  The
reaction may gather in the last node at the corner: the finer the grid, the more, and a strip that
may not lift is even held down there by tension.  And a strip that lifts may rest on single nodes.
The elastic slider of such a node is as stiff as the node is long, so that it holds the less, the
finer the grid.  And load steps may be so long that the reaction changes much within one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jax import Array

from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.mechanics.friction import coulomb_cap
from jbeamshell.scene.scene import Scene

# Distance between the ends of a steady loop, over its width.  A node that slips by a part settles
# within a few cycles, which changes the dissipation by 1e-5.
CLOSES = 5e-3
NEGLIGIBLE = 1e-9  # slip over the sticking range, taken as zero
SAFETY = 1.2  # factor on the estimated error of the corner
SPREAD = 0.4  # of a strip in plane elasticity: measured .05 in the median, .38 where little slips
JOINT = 0.6  # the same with a second member or steps of the pressure: measured 0 to .5
MOMENT = 3.0  # the same of one under a moment: of 14 that were off by 2 % and more, 13 are above
SINGULAR = 1.0  # error by a singular corner over its element per slip zone: measured .05 to 1.1
BEYOND = 4.0  # the same under a member that goes on: measured up to 3.1
STEPS = 1.5  # the same of a beamshell's grid that steps of the pressure share
REFINED = 0.15  # least error of a refined grid, over that of the rule: measured .02 to .13
RESTING = 2.0  # error of the dissipation over the part of the load that single sliders hold
WITHIN_STEPS = 0.1  # error of the dissipation over the work of caps that change within load steps


class SlipCycle(NamedTuple):
    """One load cycle at the nodes of the contact, as arrays of NumPy or of JAX.

    Attributes
    ----------
    x : (n,) positions X, length
    tributary : (n,) contact length of each node
    v : (levels, n) tangential displacement, length
    traction, reaction : (levels, n) friction traction and normal reaction, stress
    friction : Coulomb friction coefficient mu
    slip_stiffness : (n,) k_t, traction per slip
    half_height : H, length
    dissipation : work of friction in the cycle, force; None is that of the slip and the mean caps,
        which load steps know well, and turning points alone do not
    """

    x: Array
    tributary: Array
    v: Array
    traction: Array
    reaction: Array
    friction: Array
    slip_stiffness: Array
    half_height: Array
    dissipation: Array | None = None


def dissipation_errors(cycle: SlipCycle) -> tuple[Array, ...]:
    """Estimated relative errors of a cycle's dissipation: of the grid, and of the loaded corner.

    With the friction work W_i of node i, which its slip would do against its mean cap, the number
    of nodes that share the work D is the participation ratio P = D^2 / sum W_i^2.  The error of the
    grid is P^(-3/2).  Nodes that open before they move do none of that work, so that P falls where
    D is small beside sum W_i, and little is known of where friction works.  The error of the corner
    is the part of the work that comes from the jumps of the reaction between neighbouring nodes,
    times the relative fall of the slip over the last H before the end.  Both are measured rules,
    rather too large than too small (verification/failure_map.py).

    Returns
    -------
    grid, corner : scalars; infinite if nothing slips
    """
    numbers = numbers_of(cycle.v)
    slip, cap = slip_and_cap(cycle)
    work = numbers.sum(slip * cap, axis=0) * cycle.tributary
    total = numbers.sum(work)
    slips = total > 0.0
    whole = numbers.where(slips, total, 1.0)
    grid = grid_error(work, cycle.dissipation)

    excess = numbers.abs(numbers.diff(cycle.reaction, axis=1)) * cycle.tributary[1:]
    excess = 0.5 * cycle.friction * (excess[1:] + excess[:-1])
    gathered = SAFETY * numbers.sum(excess * slip[:, 1:]) / whole
    path = numbers.sum(slip, axis=0)
    x = cycle.x / cycle.half_height  # in units of H: JAX takes very small steps of x as none
    inside = numbers.interp(x[-1] - 1.0, x, path)
    at_end = numbers.where(path[-1] > 0.0, path[-1], numbers.max(path) + 1.0)
    fall = numbers.clip(1.0 - inside / at_end, 0.0, 1.0)
    both = grid, gathered * fall
    return tuple(numbers.where(slips, error, numbers.inf) for error in both)


def grid_error(work: Array, dissipation: Array | None = None) -> Array:
    """Estimated relative error by the grid, P^(-3/2), from the friction work (n,) of its nodes.

    The dissipation is the sum of that work if it is not known, or larger; see
    `dissipation_errors`.
    """
    numbers = numbers_of(work)
    total = numbers.sum(work)
    if dissipation is not None:
        total = numbers.minimum(total, dissipation)
    slips = total > 0.0
    whole = numbers.where(slips, total, 1.0)
    grid = numbers.sum((work / whole) ** 2) ** 1.5
    return numbers.where(slips, grid, numbers.inf)


def slip_and_cap(cycle: SlipCycle) -> tuple[Array, Array]:
    """Amounts of slip (levels - 1, n) in each step of a cycle, and the mean caps there."""
    numbers = numbers_of(cycle.v)
    cap = coulomb_cap(cycle.friction, cycle.reaction)
    cap = 0.5 * (cap[1:] + cap[:-1])
    elastic = numbers.diff(cycle.traction, axis=0) / cycle.slip_stiffness
    slip = numbers.abs(numbers.diff(cycle.v, axis=0) - elastic)
    elastic_slip = numbers.isfinite(cycle.slip_stiffness)
    stiffness = numbers.where(elastic_slip, cycle.slip_stiffness, 1.0)
    some = numbers.where(elastic_slip, stiffness * slip > NEGLIGIBLE * cap, slip > 0.0)
    return numbers.where(some, slip, 0.0), cap


def step_error(cycle: SlipCycle) -> Array:
    """Estimated relative error of a cycle's dissipation by the length of its load steps.

    A load step knows a node's cap only at its beginning and its end.  The larger the change in
    between, the larger the error.  With the changes as caps, friction would do some work; the error
    is taken as `WITHIN_STEPS` times the ratio of that work to the real one.  Strips with mu from .5
    to 1 in 1, 2 and 4 steps per half cycle were off by less than .1 times that ratio, one by .13.

    Returns
    -------
    scalar, zero if nothing slips
    """
    numbers = numbers_of(cycle.v)
    slip, cap = slip_and_cap(cycle)
    change = numbers.abs(numbers.diff(coulomb_cap(cycle.friction, cycle.reaction), axis=0))
    changed, work = (numbers.sum(slip @ cycle.tributary) for slip in (slip * change, slip * cap))
    return WITHIN_STEPS * changed / numbers.where(work > 0.0, work, 1.0)


def slider_error(cycle: SlipCycle) -> Array:
    """Estimated relative error of a cycle's dissipation by elastic sliders of single nodes.

    A node rests alone so far as its reaction R_i exceeds those of its neighbours,
    a_i = 1 - (R_(i-1) + R_(i+1))/R_i.  The stiffness of its slider is k_t l_i, so that on ever
    finer grids it lets go of the friction T_i = max(a_i t_i l_i).  The error is twice the part of
    the load that is let go.  On strips that rest on their corner, the dissipation or the secant
    stiffness was off by .4 to .9 times that part most often, and by 2.3 times at most.

    Returns
    -------
    scalar, zero if sliders are rigid until they slip
    """
    numbers = numbers_of(cycle.v)
    if numbers is np and np.all(np.isinf(cycle.slip_stiffness)):
        return np.zeros(())  # type: ignore[return-value]
    beside = numbers.pad(cycle.reaction, ((0, 0), (1, 1)))
    beside = numbers.maximum(beside[:, 2:] + beside[:, :-2], 0.0)
    pressed = cycle.reaction > 0.0
    alone = 1.0 - beside / numbers.where(pressed, cycle.reaction, 1.0)
    alone = numbers.where(pressed, numbers.maximum(alone, 0.0), 0.0)
    force = cycle.traction * cycle.tributary
    let_go = numbers.sum(numbers.max(numbers.abs(alone * force), axis=0))
    load = 0.5 * numbers.max(numbers.sum(numbers.abs(force - force[0]), axis=1))
    error = RESTING * let_go / numbers.where(load > 0.0, load, 1.0)
    yields = numbers.any(numbers.isfinite(cycle.slip_stiffness))
    return numbers.where(yields & (load > 0.0), error, 0.0)


def singular_corner_error(scene: Scene, cycle: SlipCycle) -> Array:
    """Estimated relative error of a cycle's dissipation by the element at a singular corner.

    Stresses are singular at the loaded corner of plane elasticity.  The grid gets them wrong within
    about one element there, of the length h, which changes the work of a slip zone of the length s
    by a part of the order of h/s.  Where s < .01 H, strips under members that go on were off by up
    to 3.1 h/s, and strips under an even traction by .05 to 1.1 h/s.  Both ends of a lap joint share
    the zone.

    Returns
    -------
    scalar, infinite if nothing slips
    """
    numbers = numbers_of(cycle.v)
    slips = numbers.any(slip_and_cap(cycle)[0] > 0.0, axis=0)
    zone = numbers.sum(slips * cycle.tributary)
    element = (cycle.x[-1] - cycle.x[-2]) * (1.0 if scene.member.support == "none" else 2.0)
    part = element / numbers.where(zone > 0.0, zone, 1.0)
    part = part * (BEYOND if scene.load.entry == "member" else SINGULAR)
    return numbers.where(zone > 0.0, part, numbers.inf)


def estimates(scene: Scene, cycle: SlipCycle, change: Array | None = None) -> tuple[Array, ...]:
    """Estimated relative errors of a scene's dissipation.

    They are those of the grid, of the loaded corner, of single nodes and of load steps.  That of a
    grid that was refined is the change that this made, which is larger than what is left, and not
    less than a part of the rule's, because two coarse grids may agree by chance.

    The corner of a section has none where it may open, unless friction is elastic: the point
    reaction then holds the last node by a slider that is the softer, the shorter the elements.  A
    refined grid has told what that makes.  That of plane elasticity has no point reaction, and its
    error is at most that of `singular_corner_error`.

    Single nodes hold rigid sliders on any grid that is used.

    Where the pressure has steps, small elements lie there too, and the slip zone holds larger ones
    (measured by verification/campaign.py).
    """
    grid, corner = dissipation_errors(cycle)
    numbers = numbers_of(cycle.v)
    plane = scene.plan.elastic
    rule = _factor(scene) * grid
    grid = rule if change is None else numbers.maximum(change, REFINED * grid)
    soft = scene.contact.stick_stiffness is not None
    if plane:
        corner = numbers.minimum(corner, singular_corner_error(scene, cycle))
    elif scene.plan.lifts or scene.member.support != "none":
        corner = corner if soft and change is None else numbers.zeros(())
    slider = slider_error(cycle) if soft else numbers.zeros(())
    steps = step_error(cycle) if scene.plan.engine == "load steps" else numbers.zeros(())
    return grid, corner, slider, steps


def _factor(scene: Scene) -> float:
    """Factor on the rule for the grid's error."""
    stepped = scene.contact.jumps > 1
    if not scene.plan.elastic:
        return STEPS if stepped else 1.0
    if scene.load.kind == "moment":
        return MOMENT
    return JOINT if stepped or scene.member.support != "none" else SPREAD
