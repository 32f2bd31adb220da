r"""Four-parameter Iwan model of a strip by short formulas, for a drawing and no test.

With eta = 2H/L, E A = E' 2H and the free length L_0 between the pressed part and the load,

    F_S = mu F_N,

    pressed on its middle half, evenly (as by a bolt; L_0 = L/4)
        K_T = E A/(L_0 + 1.19 H),   chi = .107 ln eta - .08,   beta = .28 + 3.3 eta^1.2,

    pressed from end to end, rising from the ends to the middle by 1 to 19 (as by a cone)
        K_T = E A/(2.17 H),   chi = -.99/(1 + (eta/.325)^1.71),   beta = .92 eta + 10.4 eta^3.

They are fits to plane elasticity with nu = .3, eta from .01 to .4 (.2 for the cone), mu from .05 to
.2 and .1 to .95 of gross slip (`calibration/studies/four_parameters.py`).  A strip that is pressed
evenly up to the loaded end has no such model: see `jbeamshell.reference.height_factor`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from jbeamshell.common.checks import is_traced, require
from jbeamshell.laws.iwan4 import Iwan4
from jbeamshell.scene.pressure import is_table, resultant
from jbeamshell.scene.scene import Scene

LOWEST, HIGHEST_FRICTION = 0.01, 0.3
PLACES = np.linspace(0.0, 1.0, 2001)  # X/L at which patches are compared
ALIKE = 0.05  # mean difference of pressures that are alike, over their mean


class Formula(NamedTuple):
    """Short formula of a pressure patch.

    Attributes
    ----------
    shape : rows [X/L, p] of the pressure, whose mean is 1
    highest : largest eta
    free : free length L_0 over L
    end : length beside it that yields, over H
    chi, beta : functions of eta
    """

    shape: list[list[float]]
    highest: float
    free: float
    end: float
    chi: Callable[[Array], Array]
    beta: Callable[[Array], Array]


FORMULAS = {
    "middle": Formula(
        [[0.25, 0.0], [0.25, 2.0], [0.75, 2.0], [0.75, 0.0]],
        0.4,
        free=0.25,
        end=1.19,
        chi=lambda eta: 0.107 * jnp.log(eta) - 0.08,
        beta=lambda eta: 0.28 + 3.3 * eta**1.2,
    ),
    "tapered": Formula(
        [[0.0, 0.1], [0.5, 1.9], [1.0, 0.1]],
        0.2,
        free=0.0,
        end=2.17,
        chi=lambda eta: -0.99 / (1.0 + (eta / 0.325) ** 1.71),
        beta=lambda eta: 0.92 * eta + 10.4 * eta**3,
    ),
}
NUMERICALLY = "take jbeamshell.dynamics.four_parameters(scene), which solves it"


def iwan4_of_strip(scene: Scene) -> Iwan4:
    """Four-parameter Iwan model of a strip, by a short formula; per width.

    Parameters
    ----------
    scene : homogeneous strip on a rigid base, pressed as a formula says, whose load is not used;
        its numbers may be traced, but not its pressure

    Raises
    ------
    InputError
        for any other scene, such as an even pressure up to the loaded end, for which the model is
        the wrong form

    Notes
    -----
    Error of D to plane elasticity, up to mu = .3: 11 % (median) and 57 % (worst) for the middle
    half, 21 % and 46 % for the taper (`calibration/studies/four_parameters.json`).
    """
    strip, contact = scene.strip, scene.contact
    plain = scene.member.support == "none" and strip.layers is None and scene.energy is None
    fix = f"has no formula: give a homogeneous strip on a rigid base, or {NUMERICALLY}"
    require("scene", "laminate, lap joint or energy of one's own", plain, fix)
    fix = f"has no formula: take the middle half or a taper from end to end, or {NUMERICALLY}"
    found = [formula for formula in FORMULAS.values() if _alike(scene, formula)]
    require("contact.pressure", contact.pressure, bool(found), fix)
    formula, eta = found[0], strip.height_ratio
    if not is_traced(eta, contact.friction):
        fix = f"must be {LOWEST} to {formula.highest} for this pressure: {NUMERICALLY}"
        require("strip.height_ratio", eta, bool(LOWEST <= eta <= formula.highest), fix)
        fix = f"must be at most {HIGHEST_FRICTION} for the formula: {NUMERICALLY}"
        require(
            "contact.friction", contact.friction, bool(contact.friction <= HIGHEST_FRICTION), fix
        )
    down, _ = resultant(contact.pressure, contact.bottom_pressure, strip.length, "none")
    yielding = formula.free * strip.length + 0.5 * formula.end * eta * strip.length
    return Iwan4(
        slip_force=contact.friction * down,
        stiffness=strip.stretching_stiffness / yielding,
        chi=formula.chi(eta),
        beta=formula.beta(eta),
    )


def _alike(scene: Scene, formula: Formula) -> bool:
    """True if the net pressure has the shape of a formula."""
    pressures = (scene.contact.pressure, scene.contact.bottom_pressure)
    fix = "must not be traced: its shape chooses the formula"
    require("contact.pressure", "traced", not is_traced(*pressures, scene.strip.length), fix)
    length = float(scene.strip.length)
    top, bottom = (_over_places(np.asarray(each), length) for each in pressures)
    net, wanted = top - bottom, _over_places(np.array(formula.shape), 1.0)
    return float(np.mean(np.abs(net / np.mean(net) - wanted))) < ALIKE


def _over_places(pressure: np.ndarray, length: float) -> np.ndarray:
    """Pressure at `PLACES`."""
    if not is_table(pressure):
        return np.full(PLACES.size, float(pressure))
    return np.interp(PLACES, pressure[:, 0] / length, pressure[:, 1])
