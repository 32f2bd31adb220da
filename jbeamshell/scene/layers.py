"""Checks of the layers of a laminated strip."""

from __future__ import annotations

from typing import Any

import numpy as np
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require, shown
from jbeamshell.common.errors import InputError
from jbeamshell.scene.keys import LAYERS, TABLE

TOLERANCE = 1e-6  # of the height, by which the sum of the thicknesses may miss it


def fill_height(thickness: ArrayLike, height: ArrayLike) -> np.ndarray:
    """True where the sum of the thicknesses is the height 2H; any shapes that broadcast."""
    height = np.asarray(height, float)
    return np.asarray(abs(np.asarray(thickness, float) - height) <= TOLERANCE * height)


def check_layers(layers: Any, height: ArrayLike, plane: str, key: str = "strip.layers") -> None:
    """Refuse layers that make no section of the height 2H; traced values are left unchecked.

    Parameters
    ----------
    layers : array_like, (n, 3)
        Rows from the bottom to the top: thickness (length), E (stress), nu.
    height : array_like, scalar
        2H, length.
    plane : str
        "strain" or "stress".
    key : str
        Key that messages name.

    Raises
    ------
    InputError
        If the layers are no table of such rows, if a thickness or an E is not a positive number,
        if a nu is out of its range (-1 < nu < 0.5 in plane strain, -1 < nu <= 0.5 in plane
        stress), or if the thicknesses miss the height by more than 1e-6 of it.
    """
    if is_traced(layers):
        return
    table = _rows(layers, key)
    for place, row in enumerate(table.tolist(), start=1):
        fix = _fault(row, plane)
        if fix:
            raise InputError(f"{key} = {row} (row {place} from the bottom): {fix}")
    if is_traced(height):
        return
    total, height = float(table[:, 0].sum()), float(np.asarray(height))
    fix = (
        f"the thicknesses add up to {total:.9g}, but the height 2H is {height:.9g}; make them equal"
    )
    require(key, table, bool(fill_height(total, height)), fix)


def _rows(layers: Any, key: str) -> np.ndarray:
    """Layers in double precision; raises `InputError` unless they are rows of three numbers."""
    try:
        table = np.asarray(layers)
    except (ValueError, OverflowError):  # rows of different length
        table = np.empty(0)
    shaped = table.ndim == 2 and table.shape[0] > 0 and table.shape[1] == 3
    if not shaped or table.dtype.kind not in "fiu":
        raise InputError(f"{key} = {shown(layers)}: {LAYERS}")
    return table.astype(np.float64)


def _fault(row: list[float], plane: str) -> str:
    """Fault of a layer in words; empty if it can be used."""
    thickness, modulus, nu = row
    for name, value in (("thickness", thickness), ("E", modulus)):
        if not 0.0 < value < np.inf:
            return f"the {name} must be a positive number, not {value!r}"
    if plane == "strain" and nu == 0.5:
        return "nu = 0.5 is incompressible: C11 is infinite; give 0.499 or choose plane stress"
    if not (TABLE["strip.poisson_ratio"].holds(nu) or nu == 0.5):
        return f"nu must lie between -1 and 0.5, not {nu!r}"
    return ""
