"""Verdict on a fitted model: whether it describes the data, their energy and their stiffness.

A small misfit is not enough.  A loop is narrow where a joint slips little, so that a law without
any loss may run through its middle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from jbeamshell.identify.experiment import Experiment
from jbeamshell.identify.model_error import white_noise
from jbeamshell.measured.loops import Loop

LIMITS = {"linear": 0.05, "log": 0.3}  # misfit by the model above which it does not describe data
ENERGY, STIFFNESS = 0.2, 0.1  # relative errors of a closed loop above which it does not either
SURE = 2.0  # standard errors by which noise may move energy and stiffness


def undescribed(
    experiment: Experiment, left: Sequence[float], prediction: NDArray[np.float64]
) -> list[str]:
    """Sentences on what a model does not describe; none if it describes all data.

    Parameters
    ----------
    experiment : measurements, with their labels
    left : misfit of each measurement that is no white noise
    prediction : (rows,) response of the model
    """
    limits = [LIMITS[measurement.form.scale] for measurement in experiment.measurements]
    worst = int(np.argmax(np.divide(left, limits)))
    said = []
    if left[worst] > limits[worst]:
        linear = experiment.measurements[worst].form.scale == "linear"
        said.append(
            f"it leaves {100.0 * left[worst]:.3g} % of the {'range' if linear else 'value'} of "
            f"{experiment.labels[worst]} that is no white noise, more than "
            f"{100.0 * limits[worst]:g} %"
        )
    models = experiment.as_measurements(prediction)
    for name, limit in (("energy per cycle", ENERGY), ("secant stiffness", STIFFNESS)):
        errors = [
            _errors(data, model, experiment.models[owner].control)[name]
            for data, model, owner in zip(
                experiment.measurements, models, experiment.owners, strict=True
            )
        ]
        beyond = [abs(error) - SURE * chance for _, _, error, chance in errors]
        worst = int(np.argmax(beyond))
        if beyond[worst] > limit:
            own, wanted, *_ = errors[worst]
            said.append(
                f"its {name} is {own:.3g} where {experiment.labels[worst]} has {wanted:.3g}"
            )
    return [f"this model does not describe these data: {'; '.join(said)}"] if said else []


Error = tuple[float, float, float, float]


def _errors(data: object, model: object, control: str) -> dict[str, Error]:
    """Figure of the model, that of a closed loop, relative error, and its standard error by noise.

    All are zero for anything else.
    """
    nothing = (0.0, 0.0, 0.0, 0.0)
    if not (isinstance(data, Loop) and isinstance(model, Loop) and data.closed):
        return {"energy per cycle": nothing, "secant stiffness": nothing}
    drive = getattr(data, control)
    answer = "displacement" if control == "force" else "force"
    measured, computed = getattr(data, answer), getattr(model, answer)
    noise = white_noise(computed - measured)
    ends = int(np.argmax(drive)), int(np.argmin(drive))
    spans = [float(column[ends[0]] - column[ends[1]]) for column in (computed, measured)]
    # The work is a sum over the points of the answer times half the way of the drive about each.
    way = np.gradient(drive)
    lost = noise * float(np.linalg.norm(way))
    found: dict[str, Error] = {"energy per cycle": nothing, "secant stiffness": nothing}
    if data.work > SURE * lost:
        work = model.work, data.work
        found["energy per cycle"] = (*work, work[0] / work[1] - 1.0, lost / data.work)
    if min(spans) > 0.0:
        width = float(drive[ends[0]] - drive[ends[1]])
        stiffness = [width / s if control == "force" else s / width for s in spans]
        chance = np.sqrt(2.0) * noise / spans[1]
        error = stiffness[0] / stiffness[1] - 1.0
        found["secant stiffness"] = (stiffness[0], stiffness[1], error, float(chance))
    return found
