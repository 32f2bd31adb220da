r"""Plane-strain finite elements, condensed to the contact line once, then cycled there.

Rectangles with four nodes and incompatible modes on a tensor mesh.  With s the mean and d the
difference of a row's lower and upper displacements (u along X, v across), P and Q the mean and the
difference of neighbours along X, a and b the sizes of an element, its strain energy is exactly

    (ab/2) (C11 (ex^2 + ey^2) + 2 lam ex ey + G g^2) + (E'/24) ((b/a) (Q d_u)^2 + (a/b) (Q d_v)^2),
    ex = Q s_u/a,   ey = P d_v/b,   g = P d_u/b + Q s_v/a:

the mean strains, and bending without parasitic shear.  So a row of elements is a handful of
matrices along X, and the rows are eliminated from the top down to the contact line.

There, quasi-static Coulomb friction and unilateral contact, both exact: an active set guesses which
nodes stick, slip or lift, solves, and judges again until nothing changes.
"""

import time

import numpy as np
from scipy.linalg import block_diag

from . import FRICTION, LENGTH, POISSON, PRESSURE, STIFFNESS, first_guess, load_path

ROUNDING = 1e-9  # of the friction a node can take: less than this is no difference
GUESSES = 100


class Strip:
    """The standard strip, condensed.

    Attributes
    ----------
    eta : H over L/2
    x : (nx,) positions of the contact nodes; the one at X = 0 is held and left out
    stiffness : (2 nx, 2 nx) of the contact line, tangential before normal
    load : (2 nx,) what a unit end force puts on the contact line
    pressing : (nx,) normal forces before the end force
    seconds : what it took to build
    """

    def __init__(
        self, eta: float, nx: int = 40, ny: int = 4, grading: tuple[float, float] = (20.0, 4.0)
    ) -> None:
        """Condense ``nx`` by ``ny`` elements, ``grading`` times smaller at the loaded corner."""
        begin = time.perf_counter()
        height = eta * LENGTH
        a, heights = _sizes(LENGTH, nx, grading[0])[::-1], _sizes(height, ny, grading[1])
        even, uneven, difference, coupling, turn = _rows(a, STIFFNESS / height)
        face = np.zeros(2 * nx + 1)
        face[nx - 1] = 0.5 / height
        stiffness, load = 0.0, 0.0 * face
        for b in heights[::-1]:
            upper = stiffness + b * even + difference / b + coupling
            cross = b * uneven - difference / b + turn
            down = np.linalg.solve(upper, cross.T)
            stiffness = b * even + difference / b - coupling - cross @ down
            load = b * face - (load + b * face) @ down
        kept = np.delete(np.arange(2 * nx + 1), nx)  # the held corner stays down
        self.eta, self.x = eta, np.cumsum(a)
        self.stiffness, self.load = stiffness[np.ix_(kept, kept)], load[kept]
        self.pressing = PRESSURE * 0.5 * (a + np.append(a[1:], 0.0))
        self.seconds = time.perf_counter() - begin


def _sizes(total: float, count: int, grading: float) -> np.ndarray:
    sizes = np.geomspace(1.0, grading, count)
    return sizes * (total / sizes.sum())


def _rows(a: np.ndarray, plane: float) -> tuple[np.ndarray, ...]:
    """Blocks of a row of elements, (2 nx + 1,) squared, u at X = 0 left out.

    With b the row's height, lower-lower and upper-upper are b even + difference/b -+ coupling, and
    lower-upper is b uneven - difference/b + turn.
    """
    shear, coupling = 0.5 * (1.0 - POISSON) * plane, POISSON / (1.0 - POISSON)
    c11 = plane / (1.0 - coupling**2)
    n, size = a.size, a[:, None]
    left, right = np.eye(n, n + 1), np.eye(n, n + 1, 1)
    mean, jump = 0.5 * (left + right), right - left
    mass, slope, mixed = mean.T @ (size * mean), jump.T @ (jump / size), jump.T @ mean
    bending = plane / 12.0 * jump.T @ (size * jump)
    means = 0.25 * block_diag(c11 * slope, shear * slope)
    differences = block_diag(plane / 12.0 * slope, 0.0 * slope)
    across = block_diag(shear * mass, c11 * mass + bending)
    zero = 0.0 * mixed
    x = 0.5 * np.block([[zero, c11 * coupling * mixed], [shear * mixed, zero]])
    blocks = means + differences, means - differences, across, x + x.T, x - x.T
    return tuple(block[1:, 1:] for block in blocks)


def cycle(
    strip: Strip, amplitude: float, steps_per_half_cycle: int = 1, cycles: int = 1
) -> dict[str, float]:
    """Cycle the end force between ``amplitude`` and its negative.

    Returns
    -------
    dissipation : work of friction in the last cycle
    unsettled : load steps whose active set did not come to rest
    """
    moved, pressed = np.zeros(strip.x.size), strip.pressing
    works, unsettled = [], 0
    for force, equivalent in load_path(amplitude, steps_per_half_cycle, cycles):
        guess = first_guess(strip.x, strip.eta, equivalent)
        u, reaction, settled = equilibrium(strip, force, moved, guess)
        caps = 0.5 * FRICTION * (pressed + reaction)
        works.append(caps @ np.abs(u - moved))
        moved, pressed = u, reaction
        unsettled += not settled
    return {
        "dissipation": float(np.sum(works[-2 * steps_per_half_cycle :])),
        "unsettled": unsettled,
    }


def equilibrium(
    strip: Strip, force: float, before: np.ndarray, slips: np.ndarray
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Tangential displacements, normal forces and whether the active set came to rest.

    ``slips`` guesses the direction in which each node slips from ``before``; zero is stick.
    """
    n = before.size
    lifts = np.zeros(n, dtype=bool)
    outer = -force * strip.load
    outer[n:] += strip.pressing
    little = ROUNDING * FRICTION * strip.pressing
    for _ in range(GUESSES):
        loose = (slips != 0.0) | lifts
        free = np.flatnonzero(np.concatenate([loose, lifts]))
        u = np.concatenate([np.where(loose, 0.0, before), np.zeros(n)])
        rows, rest = strip.stiffness.copy(), outer.copy()
        rows[:n] += (FRICTION * slips)[:, None] * strip.stiffness[n:]
        rest[:n] += FRICTION * slips * outer[n:]
        rows = rows[free]
        u[free] = np.linalg.solve(rows[:, free], -(rows @ u + rest[free]))
        pull, press = np.split(strip.stiffness @ u + outer, 2)
        up = np.where(lifts, u[n:] > 0.0, press < -little)
        # A node that slips may stick next, but not slip back, and one that lands slips: else the
        # search goes round in circles.
        way = np.sign(u[:n] - before)
        yields = np.where(np.abs(pull) > FRICTION * press + little, -np.sign(pull), 0.0)
        new = np.where(slips == 0.0, yields, np.where(way == slips, way, 0.0))
        new = np.where(up, 0.0, np.where(lifts, way, new))
        if np.array_equal(new, slips) and np.array_equal(up, lifts):
            return u[:n], press, True
        slips, lifts = new, up
    return u[:n], press, False
