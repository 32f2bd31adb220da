"""Four-parameter Iwan model through curves of force, displacement and dissipation."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.jax_options import ONCE
from jbeamshell.laws.iwan4 import Iwan4

LOWEST_CHI = -0.99  # at -1 all sliders slip at once
STARTS = [(chi, beta) for chi in (-0.9, -0.5, -0.1) for beta in (0.05, 1.0)]
LIMITS = 12.0  # of the unknowns, which are logarithms
CURVES = "give (k,) positive numbers each, and forces below the slip force"


def iwan4_through(
    slip_force: float,
    stiffest: float,
    force: ArrayLike,
    displacement: ArrayLike,
    dissipation: ArrayLike,
) -> Iwan4:
    """Four-parameter model nearest to a joint's curves, with a given force of gross slip.

    The squares of the relative errors of dissipation and displacement, both at one force, are
    least in sum: sum_i ln(D/D_i)^2 + ln(U/U_i)^2.

    Parameters
    ----------
    slip_force : F_S
    stiffest : stiffness of the stuck joint, which K_T may not exceed
    force, displacement, dissipation : (k,) amplitudes and energies of steady cycles, k >= 2

    Raises
    ------
    InputError
        for curves that are none, or forces beyond gross slip
    """
    curves = np.array([np.asarray(each, float) for each in (force, displacement, dissipation)])
    sound = curves.ndim == 2 and curves.shape[1] > 1 and bool(np.all(curves > 0.0))
    require("curves", curves, sound and bool(np.all(curves[0] < slip_force)), CURVES)
    softest = np.max(curves[0] / curves[1])
    fix = f"must be a number, {softest:.6g} or more, the secant stiffness of the curves"
    require("stiffest", stiffest, bool(softest <= stiffest < np.inf), fix)
    from scipy.optimize import least_squares  # slow to import

    known = [jnp.asarray(each) for each in (slip_force, *curves)]
    low, high = np.log(softest) - LIMITS, np.log(stiffest)
    found = min(
        (
            least_squares(
                lambda x: np.asarray(_misfits(x, *known)),
                [np.log(softest) - 1e-3, _logit(chi), np.log(beta)],
                jac=lambda x: np.asarray(_slopes(x, *known)),
                bounds=([low, -LIMITS, -LIMITS], [high, LIMITS, LIMITS]),
            )
            for chi, beta in STARTS
        ),
        key=lambda fit: fit.cost,
    )
    stiffness, chi, beta = _numbers(found.x)
    return Iwan4(slip_force=known[0], stiffness=stiffness, chi=chi, beta=beta)


def _logit(chi: float) -> float:
    part = chi / LOWEST_CHI
    return float(np.log((1.0 - part) / part))


def _numbers(x: ArrayLike) -> Array:
    """Stiffness, chi and beta of the unknowns: ln K_T, a logit of chi, ln beta."""
    stiffness, chi, beta = jnp.asarray(x)
    return jnp.stack([jnp.exp(stiffness), LOWEST_CHI * jax.nn.sigmoid(-chi), jnp.exp(beta)])


def _of_unknowns(x: Array, slip_force: Array, f: Array, u: Array, d: Array) -> Array:
    """Relative errors (2k,) of dissipation and displacement, as logarithms."""
    stiffness, chi, beta = _numbers(x)
    law = Iwan4(slip_force=slip_force, stiffness=stiffness, chi=chi, beta=beta)
    reached = law.displacement(f)
    return jnp.concatenate([jnp.log(law.dissipation(reached) / d), jnp.log(reached / u)])


_misfits = jax.jit(_of_unknowns, compiler_options=ONCE)
_slopes = jax.jit(jax.jacfwd(_of_unknowns), compiler_options=ONCE)


def exponents(force: ArrayLike, dissipation: ArrayLike) -> NDArray[np.float64]:
    """Exponents (k,) of the power laws of dissipation over force that touch a curve."""
    return np.gradient(np.log(np.asarray(dissipation)), np.log(np.asarray(force)))
