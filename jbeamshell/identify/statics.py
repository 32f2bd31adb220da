"""Doubt about a structure that was fitted by statics: how far its values may be off.

Frequency and damping of a structure follow from statics, whose errors a curve estimates, see
`jbeamshell.dynamics.modal_curve`.  A Gauss-Newton step tells how the values would change if the
response were without them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from jbeamshell.dynamics.structure.modal import DOUBTED
from jbeamshell.identify.experiment import Experiment
from jbeamshell.identify.models import Model
from jbeamshell.identify.observations import ModalObservation
from jbeamshell.identify.uncertainty import Uncertainty

ROUNDED = 1.0 - 5e-4  # of an amplitude, so that its four digits are no larger


def doubt_of_statics(
    experiment: Experiment,
    scenes: Sequence[Model],
    uncertainty: Uncertainty,
    jacobian: NDArray[np.float64],
) -> list[str]:
    """Sentence on the error of statics in a fit; none if it is small or there is no structure.

    Parameters
    ----------
    experiment : measurements of the fit
    scenes : model of each specimen with the fitted values
    uncertainty : uncertainty at the end of the fit, n values
    jacobian : (rows + priors, n) derivatives of the residuals there
    """
    change, curves = np.zeros(jacobian.shape[0]), []
    pairs = zip(experiment.observations, experiment.slices, experiment.owners, strict=True)
    for observation, rows, owner in pairs:
        if isinstance(observation, ModalObservation):
            curve, more = observation.without_errors(scenes[owner])
            change[rows] = experiment.emphasis[rows] * experiment.weight[rows] * more
            curves.append(curve)
    if not any(curve.doubts for curve in curves):
        return []
    sizes = np.concatenate([np.asarray(curve.amplitude) for curve in curves])
    errors = np.abs(
        [
            np.concatenate([np.asarray(getattr(curve, name)) for curve in curves])
            for name in ("frequency_error", "damping_error")
        ]
    )
    frequency, damping = np.max(errors, axis=1).tolist()
    first = ROUNDED * np.min(sizes[np.max(errors, axis=0) > DOUBTED])
    inside, step = ~uncertainty.at_bound, np.zeros(uncertainty.point.size)
    step[inside] = np.linalg.lstsq(jacobian[:, inside], change)[0]
    off = np.abs(uncertainty.space.slopes(uncertainty.point) * step)
    moved = " and ".join(f"{k} by {size:.2g}" for k, size in uncertainty.space.named(off).items())
    fix = "compare the fitted structure with nonlinear_mode"
    fix = f"fit smaller amplitudes alone, or {fix}" if np.any(sizes < first) else fix
    return [
        f"from the amplitude {first:.4g} on, the fitted damping may be off by up to {damping:.0%} "
        f"and the frequency by {frequency:.1%}, as statics know no inertia and no shape of the "
        f"loop, which may move {moved}: {fix}"
    ]
