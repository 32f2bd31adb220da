r"""The beamshell {v, beta, psi} with linear kinematics and a sharp slider, in plain NumPy.

The same discrete problem as jbeamshell's on its finite-difference grid, and the same answer to
round-off, but solved by guessing who sticks and who slips which way: with a guess the problem is
linear, one banded solve, and its solution says who sticks and slips; until nothing changes.

With k_t = alpha G/min(l, H), a node of length l and plastic slip v_s has the traction
t = k_t (v - v_s) while it sticks and t = +-mu R while it slips, where R = F_N + (dPi/dw)/l.  The
plastic slip is all the memory.  Displacements count from the pressed strip, where R = F_N, t = 0.
"""

import time
from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from jbeamshell.mechanics import elements

from . import FRICTION, LENGTH, POISSON, PRESSURE, STIFFNESS, first_guess, load_path

KAPPA = 10.0 * (1.0 + POISSON) / (12.0 + 11.0 * POISSON)
KAPPA_S = 0.44
ALPHA = 1000.0
ACTIVE, LIFTS = [0, 2, 3, 4, 6, 7], [1, 5]  # of an element's v, w, beta, psi at both ends
FIELDS = 3
BAND = 2 * FIELDS - 1  # unknowns that couple on either side
ROUNDING = 1e-9  # of the cap: less than this is no difference
GUESSES = 100
EPS = np.finfo(float).eps


class Strip:
    """The standard strip on jbeamshell's grid.

    Its matrices hold rows of a band: column BAND + j - i couples the unknowns i and j, which are
    v, beta and psi of one node after the other.

    Attributes
    ----------
    eta : H over L/2
    x : (n,) positions of the nodes; in double precision where JAX has it enabled
    pressing : (n,) their normal forces before the end force
    slider : (n,) their slip stiffness, force per slip
    stiffness : (3 n, 2 BAND + 1) of the strip
    reaction : (n, 2 BAND + 1) normal force from the displacements, as in the row of v
    near : (n, 2 BAND + 1) the unknowns in these columns
    load : (3 n,) of a unit end force
    seconds : what it took to build, without the grid
    """

    def __init__(self, eta: float, nodes: int = 41) -> None:
        half_height = 0.5 * eta * LENGTH
        self.x = np.asarray(elements.vertices(nodes - 1, LENGTH, half_height))
        begin = time.perf_counter()
        self.eta, lengths = eta, np.diff(self.x)
        tributary = 0.5 * (np.append(0.0, lengths) + np.append(lengths, 0.0))
        shear = 0.25 * (1.0 - POISSON) * STIFFNESS / half_height
        self.pressing = PRESSURE * tributary
        self.slider = ALPHA * shear * tributary / np.minimum(tributary, half_height)
        forces = _element_forces(lengths, half_height)
        first, ends, local = np.arange(nodes - 1)[:, None], np.arange(2), np.arange(2 * FIELDS)
        self.stiffness = _banded(FIELDS * nodes, FIELDS * first + local, local, forces[:, ACTIVE])
        self.stiffness[:2] = 0.0  # v = beta = 0 at X = 0
        self.stiffness[:2, BAND] = 1.0
        self.reaction = _banded(nodes, first + ends, FIELDS * ends, forces[:, LIFTS])
        columns = FIELDS * np.arange(nodes)[:, None] + np.arange(-BAND, BAND + 1)
        self.near = np.clip(columns, 0, FIELDS * nodes - 1)  # beyond the ends they count nothing
        self.load = np.zeros(FIELDS * nodes)
        self.load[-FIELDS:] = 1.0, -half_height, 0.0
        self.seconds = time.perf_counter() - begin


def _element_forces(lengths: np.ndarray, half_height: float) -> np.ndarray:
    """Forces on v, w, beta, psi of both ends, from v, beta, psi of both ends: (elements, 8, 6)."""
    plane = 0.5 * STIFFNESS / half_height
    shear, coupling = 0.5 * (1.0 - POISSON) * plane, POISSON / (1.0 - POISSON)
    c11 = plane / (1.0 - coupling**2)
    law = half_height * np.diag(
        [
            2.0 * c11,
            2.0 * KAPPA * shear,
            2.0 / 3.0 * plane * half_height**2,
            2.0 * (plane + c11 * coupling**2),
            2.0 / 3.0 * KAPPA_S * shear * half_height**2,
        ]
    )
    law[0, 3] = law[3, 0] = 2.0 * half_height * c11 * coupling
    strains = np.zeros((2, lengths.size, 5, 8))  # e, g, k, psi, psi' with psi of either end
    slope = np.stack([-1.0 / lengths, 1.0 / lengths], axis=1)
    strains[:, :, 0, 0::4] = slope
    strains[:, :, 0, 2::4] = -half_height * slope
    strains[:, :, 1, 1::4] = slope
    strains[:, :, 1, 2::4] = -0.5
    strains[:, :, 1, 3::4] = half_height * slope
    strains[:, :, 2, 2::4] = strains[:, :, 4, 3::4] = slope
    strains[0, :, 3, 3] = strains[1, :, 3, 7] = 1.0
    # e follows psi to either side of its mean, so that the normal force is even.
    strains[0, :, 0, 3::4] = 0.5 * coupling * np.array([-1.0, 1.0])
    strains[1, :, 0, 3::4] = 0.5 * coupling * np.array([1.0, -1.0])
    stiffness = np.sum(np.swapaxes(strains, 2, 3) @ law @ strains, axis=0)
    return 0.5 * lengths[:, None, None] * stiffness[:, :, ACTIVE]


def _banded(count: int, rows: np.ndarray, shift: np.ndarray, parts: np.ndarray) -> np.ndarray:
    band = np.zeros((count, 2 * BAND + 1))
    columns = BAND - shift[:, None] + np.arange(2 * FIELDS)
    np.add.at(band, (rows[:, :, None], columns), parts)
    return band


class Level(NamedTuple):
    """End of a load step, (n,) each: v, its plastic part, and the sliders' force and cap."""

    v: np.ndarray
    plastic: np.ndarray
    traction: np.ndarray
    cap: np.ndarray


def cycle(
    strip: Strip, amplitude: float, steps_per_half_cycle: int = 4, cycles: int = 1
) -> dict[str, float]:
    """Cycle the end force between ``amplitude`` and its negative.

    Returns
    -------
    dissipation : work of friction in the last cycle
    unsettled : load steps in which the guesses did not come to rest
    """
    zero = np.zeros(strip.x.size)
    level = Level(zero, zero, zero, FRICTION * strip.pressing)
    works, unsettled = [], 0
    for force, equivalent in load_path(amplitude, steps_per_half_cycle, cycles):
        guess = first_guess(strip.x, strip.eta, equivalent)
        after, settled = equilibrium(strip, force, level.plastic, guess)
        works.append(_slip_work(strip, level, after))
        unsettled += not settled
        level = after
    return {
        "dissipation": float(np.sum(works[-2 * steps_per_half_cycle :])),
        "unsettled": unsettled,
    }


def equilibrium(
    strip: Strip, force: float, plastic: np.ndarray, slips: np.ndarray
) -> tuple[Level, bool]:
    """The strip under an end force, and whether the guesses came to rest.

    ``slips`` guesses the direction in which each node slips; zero is stick.
    """
    for _ in range(GUESSES):
        # The rows of a band are the columns of its transpose's, as LAPACK wants them.
        rows = np.zeros((strip.load.size, 3 * BAND + 1))
        rows[:, BAND:] = strip.stiffness
        rubbing = FRICTION * slips
        rows[::FIELDS, BAND:] += rubbing[:, None] * strip.reaction
        rows[::FIELDS, 2 * BAND] += np.where(slips == 0.0, strip.slider, 0.0)
        right = force * strip.load
        right[::FIELDS] += np.where(slips == 0.0, strip.slider * plastic, -rubbing * strip.pressing)
        factors, pivots, _ = lapack.dgbtrf(rows.T, BAND, BAND, overwrite_ab=1)
        q, _ = lapack.dgbtrs(factors, BAND, BAND, right, pivots, trans=1, overwrite_b=1)
        v = q[::FIELDS]
        cap = FRICTION * (strip.pressing + np.sum(strip.reaction * q[strip.near], axis=1))
        trial = strip.slider * (v - plastic)
        little = ROUNDING * cap + 64.0 * EPS * strip.slider * np.max(np.abs(v))
        # A node that slips may stick next, but not slip back: else the search goes in circles.
        new = np.where(
            slips == 0.0,
            np.sign(trial) * (np.abs(trial) > cap + little),
            slips * (slips * trial >= cap - little),
        )
        settled = np.array_equal(new, slips)
        if settled:
            break
        slips = new
    traction = np.where(slips == 0.0, trial, slips * cap)
    return Level(v, v - traction / strip.slider, traction, cap), settled


def _slip_work(strip: Strip, before: Level, after: Level) -> float:
    """Caps and displacements change linearly, and slip begins where a slider meets its cap."""
    slip = after.plastic - before.plastic
    way = np.where(slip >= 0.0, 1.0, -1.0)
    gap = before.cap - way * before.traction
    closing = way * strip.slider * (after.v - before.v) + before.cap - after.cap
    meeting = np.divide(gap, closing, out=np.ones_like(gap), where=closing > 0.0)
    rest = 1.0 - np.clip(meeting, 0.0, 1.0)
    return float((after.cap + 0.5 * rest * (before.cap - after.cap)) @ np.abs(slip))
