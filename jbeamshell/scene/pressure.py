"""scene.pressure."""

from __future__ import annotations

import numpy as np
from jax.typing import ArrayLike

from jbeamshell.common.checks import require

PRESSURE = "give a number or a table of [X, pressure] rows"


@np.errstate(over="ignore", invalid="ignore")  # infinite forces are told by those who ask
def resultant(
    pressure: ArrayLike, length: ArrayLike, *, table: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Force of a pressure, a table or numbers, on strips; and its moment about X = 0."""
    load, length = np.asarray(pressure, float), np.asarray(length, float)
    if not table:
        return load * length, 0.5 * load * length**2
    end = length[..., None]
    x, p = (np.broadcast_to(column, (*length.shape, column.size)) for column in load.T)
    x = np.concatenate([np.zeros_like(end), x, end], axis=-1)
    p = np.concatenate([p[..., :1], p, p[..., -1:]], axis=-1)
    run, begin, stop = np.diff(x), p[..., :-1], p[..., 1:]
    force, middle = 0.5 * run * (begin + stop), 0.5 * (x[..., 1:] + x[..., :-1])
    moment = force * middle + run**2 * (stop - begin) / 12.0
    return np.sum(force, axis=-1), np.sum(moment, axis=-1)


def pressure_values(pressure: np.ndarray) -> np.ndarray:
    """Pressures of a table, or the one number."""
    return pressure[:, 1] if pressure.ndim == 2 else pressure


def check_pressure(key: str, pressure: np.ndarray) -> None:
    """Raise `InputError` unless it is a number or a table of [X, pressure] rows."""
    table = pressure.ndim == 2 and pressure.shape[1] == 2 and pressure.shape[0] >= 2
    require(key, pressure, pressure.ndim == 0 or table, PRESSURE)
    compressive = bool(np.all(np.isfinite(pressure)) and np.all(pressure_values(pressure) >= 0.0))
    require(key, pressure, compressive, "must be finite and nowhere negative (no tension)")
    if table:
        run = np.diff(pressure[:, 0])
        require(key, pressure, bool(np.all(run >= 0.0)), "its X must not decrease from row to row")
        thrice = bool(np.any((run[1:] == 0.0) & (run[:-1] == 0.0)))
        require(key, pressure, not thrice, "gives one X three times; two rows make a step")
