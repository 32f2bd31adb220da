"""Segalman's four parameters of a strip or lap joint from its geometry alone, or of another law.

A scene is solved in steady cycles of rising amplitude; F_S is its gross slip, and K_T, chi and
beta follow from the curves of displacement and dissipation, without a test.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.jax_options import ONCE
from jbeamshell.common.pytrees import Tree
from jbeamshell.laws.iwan4 import Iwan4
from jbeamshell.laws.law import Law
from jbeamshell.scene.mounting import in_words
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.steady_cycles import steady_cycles

FRACTIONS = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)  # of gross slip
LITTLE = 0.01  # of gross slip, at which the contact is taken to stick
LEAST = 1e-9  # energy of a cycle that is felt, over F u
ENOUGH = 4  # amplitudes
LOWEST_CHI = -0.99  # at -1 all sliders slip at once
STARTS = [(chi, beta) for chi in (-0.9, -0.5, -0.1) for beta in (0.05, 1.0)]
SIDES = 12.0  # of the logarithms that are found, from their starts


class FourParameters(Tree):
    """Four-parameter Iwan model of a scene or joint, and how far it is from it.

    Attributes
    ----------
    law : model; forces are per unit of width, or totals where the scene has a width
    force, displacement, dissipation : (k,) amplitudes and energies of the joint's steady cycles
    mounting : how a lap joint is held and loaded, in words; empty for anything else
    """

    law: Iwan4
    force: NDArray[np.float64]
    displacement: NDArray[np.float64]
    dissipation: NDArray[np.float64]
    mounting: str = eqx.field(static=True, default="")

    @property
    def dissipation_error(self) -> NDArray[np.float64]:
        """Relative errors (k,) of the model's dissipation, at the forces."""
        reached = self.law.displacement(self.force)
        return np.asarray(self.law.dissipation(reached)) / self.dissipation - 1.0

    @property
    def displacement_error(self) -> NDArray[np.float64]:
        """Relative errors (k,) of the model's displacement, at the forces."""
        return np.asarray(self.law.displacement(self.force)) / self.displacement - 1.0

    @property
    def exponents(self) -> NDArray[np.float64]:
        """Exponents (k,) of the power laws D ~ F^n that touch the dissipation."""
        return np.gradient(np.log(self.dissipation), np.log(self.force))

    def __str__(self) -> str:
        law, n = self.law, self.exponents
        off = np.abs(self.dissipation_error)
        names = (("F_S", law.slip_force), ("K_T", law.stiffness), ("chi", law.chi))
        numbers = [f"{name} = {float(x):.6g}" for name, x in (*names, ("beta", law.beta))]
        return (
            f"four-parameter Iwan model: {', '.join(numbers)}\n"
            f"dissipation: off by {np.median(off):.1%} (median), {np.max(off):.1%} (worst)\n"
            f"displacement: off by {np.max(np.abs(self.displacement_error)):.1%} at most\n"
            f"power law D ~ F^n: n from {np.min(n):.2f} to {np.max(n):.2f}"
            + (f"\n{self.mounting}" if self.mounting else "")
        )


def four_parameters(scene: Scene | Law) -> FourParameters:
    """Four-parameter Iwan model of a strip or lap joint, fitted to no test but to its geometry.

    Parameters
    ----------
    scene : scene, whose load is not used; take ``model.section = plane`` for elasticity's figures.
        Or a law, such as a `Joint`, whose own loops count

    Raises
    ------
    InputError
        for a scene or law without gross slip or of infinite stiffness, a scene that is driven
        otherwise than by a force, or a joint that ends below .3 of gross slip
    UnconvergedError
        if a load step has no equilibrium

    Examples
    --------
    >>> print(jb.dynamics.four_parameters(jb.Scene()))
    """
    found = _of_law(scene) if isinstance(scene, Law) else _of_scene(scene)
    mounting = getattr(scene, "mounting", "") if isinstance(scene, Law) else in_words(scene)
    limit, stiffest, force, u, loss = found
    law = _nearest(limit, stiffest, force, u, loss)
    return FourParameters(law, force, u, loss, mounting)


def _of_scene(scene: Scene) -> tuple[Any, ...]:
    """Gross slip, largest stiffness, and curves of force, displacement and energy."""
    force = scene.load.control == "force"
    require("load.control", scene.load.control, force, "must be 'force' for amplitudes of it")
    fix = "must be 'force': a moment has no gross slip"
    require("load.kind", scene.load.kind, scene.load.kind == "force", fix)
    limit = float(scene.gross_slip)
    slips = limit > 0.0 and scene.contact.normal != "none"
    fix = "must have gross slip: give it friction and contact"
    require("contact.friction", scene.contact.friction, slips, fix)
    f = limit * np.array([LITTLE, *FRACTIONS])
    cycles = steady_cycles(scene, f)
    u, d = np.asarray(cycles.displacement), np.asarray(cycles.dissipation)
    felt = d > LEAST * f * u
    felt[0] = False
    fix = "slips at too few amplitudes, if at all: the contact sticks, or take more model.nodes"
    require("scene", int(np.sum(felt)), int(np.sum(felt)) >= ENOUGH, fix)
    return limit, float(np.max(f / u)), f[felt], u[felt], d[felt]


def _of_law(law: Law) -> tuple[Any, ...]:
    """The same of the loops of a law, as far as it is known below gross slip."""
    capacity = float(law.capacity)
    fix = "has no gross slip that is known: take Joint.of(scene), or give capacity="
    require(f"{law.heading}.capacity", capacity, bool(np.isfinite(capacity)), fix)
    top = capacity if np.isinf(law.reach) else float(law.backbone(law.reach))
    f = capacity * np.array(FRACTIONS)
    f = f[f <= top]
    fix = f"ends too far below gross slip, {capacity:.6g}: take Joint.of(scene) with more force"
    require(f"{law.heading}.forces", top, f.size >= ENOUGH, fix)
    u = np.asarray(law.displacement(f))
    return capacity, float(law.stiffness), f, u, np.asarray(law.dissipation(u))


def _nearest(limit: float, stiffest: float, *curves: NDArray[np.float64]) -> Iwan4:
    """Four-parameter model nearest to curves (k,) of force, displacement and dissipation.

    The squares of the relative errors of dissipation and displacement, both at one force, are
    least in sum: sum_i ln(D/D_i)^2 + ln(U/U_i)^2.  F_S is the gross slip of the curves, and K_T
    at most their largest stiffness.
    """
    softest = float(np.max(curves[0] / curves[1]))
    fix = f"must be a number, {softest:.6g} or more, the secant stiffness of the curves"
    require("stiffest", stiffest, softest <= stiffest < np.inf, fix)
    from scipy.optimize import least_squares  # slow to import

    given = limit, *map(jnp.asarray, curves)
    start, low = np.log(softest) - 1e-3, [np.log(softest) - SIDES, LOWEST_CHI, -SIDES]
    found = min(
        (
            least_squares(
                lambda x: np.asarray(_errors(x, *given)[0]),
                [start, chi, np.log(beta)],
                lambda x: np.asarray(_errors(x, *given)[1]),
                (low, [np.log(stiffest), 0.0, SIDES]),
            )
            for chi, beta in STARTS
        ),
        key=lambda fit: float(fit.cost),
    )
    return _law_at(found.x, limit)


def _law_at(x: Any, limit: Any) -> Iwan4:
    """Model with the logarithm of K_T, chi, and the logarithm of beta."""
    return Iwan4(slip_force=limit, stiffness=jnp.exp(x[0]), chi=x[1], beta=jnp.exp(x[2]))


@partial(jax.jit, compiler_options=ONCE)
def _errors(x: Array, limit: Array, f: Array, u: Array, d: Array) -> tuple[Array, Array]:
    """Logarithms (2k,) of dissipation and displacement over the given ones, and their slopes."""

    def errors(x: Array) -> tuple[Array, Array]:
        law = _law_at(x, limit)
        reached = law.displacement(f)
        off = jnp.concatenate([jnp.log(law.dissipation(reached) / d), jnp.log(reached / u)])
        return off, off

    slopes, off = jax.jacfwd(errors, has_aux=True)(x)
    return off, slopes
