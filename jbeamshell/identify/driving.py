"""Laws of a joint in place of a strip: what drives them, and where they start."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.identify.models import LawModel
from jbeamshell.identify.starts import estimate
from jbeamshell.laws import Law
from jbeamshell.measured.curves import (
    AmplitudeCurve,
    Backbone,
    DissipationCurve,
    StiffnessCurve,
)
from jbeamshell.measured.loops import Loop

ABOVE = 1.2  # force of a start over the largest one that drives


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
    pulls = [item for item in measurements if isinstance(item, Loop | Backbone)]
    by_force = [getattr(pull, "driver", None) == "force" for pull in pulls]
    both = [getattr(pull, "drive_noise", None) is not None for pull in pulls]
    noisy = [pull.deviations is not None and not b for pull, b in zip(pulls, both, strict=True)]
    backward = any(a and b for a, b in zip(by_force, noisy, strict=True))
    force = not pulls or (backward and law.by_force)
    by = control or ("force" if force else "displacement")
    if not isinstance(law, Law):
        kind, (size, *rest) = law, _figures(measurements, control or "force")
        law = kind.started(size, *rest)
        most = max([size, *(float(np.max(np.abs(pull.force))) for pull in pulls)])
        if by == "force" and law.capacity <= most:  # a law has no answer at its gross slip
            law = kind.started(ABOVE * most, *rest)
    return LawModel(law, by)


def _figures(measurements: Sequence[Any], control: str) -> tuple[float, float, float, float]:
    """Amplitudes of force and displacement, work of a cycle, and stiffness right after a turn.

    They are those of the largest loop or backbone, or of curves over the amplitude of a column.
    """
    if (found := estimate(measurements)) is not None:
        work = found.work or 0.5 * found.force * found.displacement
        return found.force, found.displacement, work, found.stiffness
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
    return force, displacement, work or 4.0 / 3.0 * force * displacement, stiffness
