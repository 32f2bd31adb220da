"""Laws of a joint in place of a strip: what drives them, where they start, what they cannot follow.

A law is odd: it answers a push as a pull.  Laws without Masing's memory let minor loops drift.
Loops that show otherwise are told as doubts, as no numbers of the law can follow them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.identify.models import LawModel, Model
from jbeamshell.laws import Law, MasingLaw
from jbeamshell.measured.curves import (
    AmplitudeCurve,
    Backbone,
    DissipationCurve,
    StiffnessCurve,
)
from jbeamshell.measured.loops import Loop
from jbeamshell.measured.reversals import find_turns

AFTER_TURN = 0.15  # part of the range of the displacement in which the first slope is taken
STIFFEST = 50.0  # largest start of the stiffness over the secant
ASYMMETRY = 0.02  # part of the force's range that a law, being odd, may miss without a doubt
GRID = np.linspace(-0.98, 0.98, 99)


class Figures(NamedTuple):
    """Figures of measurements from which a law starts.

    Attributes
    ----------
    force, displacement : amplitudes of the largest loop or pull
    work : energy of its cycle
    stiffness : slope right after a turn
    """

    force: float
    displacement: float
    work: float
    stiffness: float


def driven(
    law: Law | type[Law], measurements: Sequence[Any], control: str | None = None
) -> LawModel:
    """Model of a law, or of the class of one that starts from the data.

    A law is driven by the displacement, as it has a force for each; by the force where curves over
    amplitude are all there is, or where loops know the noise of their displacement alone.

    Parameters
    ----------
    law : law, or its class
    measurements : what was measured
    control : column that drives it; None chooses as above
    """
    if not isinstance(law, Law):
        law = law.started(*figures_of(measurements, control or "force"))
    pulls = [item for item in measurements if isinstance(item, Loop | Backbone)]
    by_force = [getattr(pull, "driver", None) == "force" for pull in pulls]
    noisy = [pull.deviations is not None for pull in pulls]
    backward = any(a and b for a, b in zip(by_force, noisy, strict=True))
    force = not pulls or (backward and isinstance(law, MasingLaw))
    return LawModel(law, control or ("force" if force else "displacement"))


def figures_of(measurements: Sequence[Any], control: str = "force") -> Figures:
    """Figures of the largest loop or backbone, or of curves over the amplitude of a column.

    Raises
    ------
    InputError
        if no measurement tells any
    """
    pulls = [item for item in measurements if isinstance(item, Loop | Backbone)]
    if pulls:
        return _of_pull(max(pulls, key=lambda item: float(np.ptp(item.displacement))))
    curves = [item for item in measurements if isinstance(item, AmplitudeCurve)]
    if not curves:
        raise InputError("data: tell no loop, backbone or curve over amplitude to start a law from")
    size = max(float(np.max(curve.amplitude)) for curve in curves)
    last = {
        type(curve): getattr(curve, curve.form.y)[np.argmax(curve.amplitude)] for curve in curves
    }
    most = max((np.max(c.stiffness) for c in curves if isinstance(c, StiffnessCurve)), default=0.0)
    work, secant = (float(last.get(kind, 0.0)) for kind in (DissipationCurve, StiffnessCurve))
    # Without one of them, as of Goodman's bar: D = (4/3) F u.
    if not secant:
        secant = 4.0 / 3.0 * size**2 / work if control == "force" else 0.75 * work / size**2
    force, displacement = (size, size / secant) if control == "force" else (size * secant, size)
    stiffness = 1.5 * max(float(most), secant)
    return Figures(force, displacement, work or 4.0 / 3.0 * force * displacement, stiffness)


def feature_doubts(model: Model, loops: Sequence[Loop]) -> list[str]:
    """Sentences on what loops show and a law cannot follow; none for other models."""
    if not isinstance(model, LawModel):
        return []
    name, doubts = model.law.heading, []
    for loop in loops:
        missed = _asymmetry(loop)
        if missed > ASYMMETRY:
            doubts.append(
                f"{loop.label}: pull and push differ by {100.0 * missed:.2g} % of the force's "
                f"range, and {name} answers both alike: it cannot follow that; take a strip"
            )
        if not isinstance(model.law, MasingLaw) and _nested(loop):
            doubts.append(
                f"{loop.label}: turns within a larger cycle, and {name} forgets where: its minor "
                "loops do not close; take a law with memory, such as iwan4"
            )
    return doubts


def _of_pull(pull: Loop | Backbone) -> Figures:
    """Figures of one loop or backbone."""
    force, u = pull.force, pull.displacement
    closed = isinstance(pull, Loop) and pull.closed
    half = 0.5 if closed else 1.0
    largest, reach = half * float(np.ptp(force)), half * float(np.ptp(u))
    first = int(np.argmax(u)) if closed else 0
    after = np.roll(np.arange(u.size), -first)
    gone = np.abs(u[after] - u[first])
    far = int(np.argmax(gone > AFTER_TURN * np.ptp(u)))
    near = after[: max(far, 3)]
    slope = float(np.polyfit(u[near], force[near], 1)[0]) if np.ptp(u[near]) > 0.0 else 0.0
    secant = largest / reach
    stiffness = float(np.clip(slope, secant, STIFFEST * secant))
    work = float(pull.work) if isinstance(pull, Loop) and closed else 0.0
    return Figures(largest, reach, work if work > 0.0 else 0.5 * largest * reach, stiffness)


def _asymmetry(loop: Loop) -> float:
    """Root mean square by which a closed loop is not its own image through its centre.

    It is taken over the range of the force, less the noise; 0 for other loops.
    """
    if not loop.closed or len(find_turns(loop.displacement)) > 2:
        return 0.0
    u, force = loop.displacement, loop.force
    start = int(np.argmin(u))
    u, force = np.roll(u, -start), np.roll(force, -start)
    top = int(np.argmax(u))
    if top < 3 or u.size - top < 3:
        return 0.0
    middle = 0.5 * (u[0] + u[top])
    x = (u - middle) / (0.5 * np.ptp(u))
    up = _over(x[: top + 1], force[: top + 1])
    down = _over(np.append(x[top:], x[0])[::-1], np.append(force[top:], force[0])[::-1])
    odd = up + down[::-1]
    noise = loop.deviations
    own = 0.0 if noise is None else 2.0 * float(np.mean(noise)) ** 2
    return float(max(0.25 * float(np.var(odd)) - own, 0.0) ** 0.5 / np.ptp(force))


def _over(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Column over `GRID` of a branch that rises but for noise."""
    order = np.argsort(x, kind="stable")
    return np.interp(GRID, x[order], y[order])


def _nested(loop: Loop) -> bool:
    """True if a loop turns more often than twice in its cycle."""
    return len(find_turns(loop.displacement)) > 2
