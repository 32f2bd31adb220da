r"""Exact path of a strip with linear kinematics, from one change of status to the next.

With a sharp slider every node sticks or slips one way.  As long as no node changes, the response
is linear in the load: with the rates dq/dF from one linear solve,

    sticking:  dt_i = k_t dv_i,      slipping:  dt_i = +-mu dR_i,

the next event is the smallest load at which a sticking node meets its cap.  There, and where the
load reverses, new rates decide which nodes slip on: a slipping node whose rate has the wrong sign
sticks, a sticking node at its cap whose traction would leave it slips.  Tractions and slips are
linear between events, so the work of friction is exact too; nothing depends on load steps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

import jbeamshell as jb
from jbeamshell.load_steps.system import BETA, PSI, System, V, W
from verification.compared import grids

FIELDS = [V, BETA, PSI]
ROUNDING = 1e-11  # of the cap, or of the fastest node


class Matrices(NamedTuple):
    """A strip of n nodes as matrices; unknowns are v, beta, psi of one node after the other.

    Attributes
    ----------
    stiffness : (3n, 3n), with the supports at X = 0
    reaction : (n, 3n) R per unknown
    pressed : (n,) R under the pressure alone
    pull : (3n,) nodal forces of a unit end force
    tributary : (n,)
    friction : mu
    slip_stiffness : (n,) k_t
    """

    stiffness: sparse.csr_array
    reaction: sparse.csr_array
    pressed: np.ndarray
    pull: np.ndarray
    tributary: np.ndarray
    friction: float
    slip_stiffness: np.ndarray


class Branch(NamedTuple):
    """Branch of the load path between two reversals.

    Attributes
    ----------
    force, displacement : (events,) F and u(L), the start and every event
    work : work of friction
    """

    force: np.ndarray
    displacement: np.ndarray
    work: float


def matrices(scene: jb.Scene) -> Matrices:
    """Matrices of a scene of v, beta, psi with linear kinematics and a sharp slider, held."""
    system = System(scene)
    whole = grids.stiffness(scene, np.asarray(system.x), grids.RULES[grids.LIBRARY])
    columns = whole.reshape(system.x.size, 4, system.x.size, 4)[..., FIELDS]
    columns = columns.reshape(*columns.shape[:2], -1)
    stiffness = columns[:, FIELDS].reshape(columns.shape[-1], -1)
    stiffness[:2] = 0.0  # v = beta = 0 at X = 0
    stiffness[[0, 1], [0, 1]] = 1.0
    tributary = np.asarray(system.tributary)
    pull = np.zeros(len(stiffness))
    pull[-3:-1] = 1.0, -float(scene.strip.half_height)
    return Matrices(
        sparse.csr_array(stiffness),
        sparse.csr_array(columns[:, W] / tributary[:, None]),
        np.asarray(system.load) / tributary,
        pull,
        tributary,
        float(system.foundation.friction),
        np.asarray(system.foundation.slip_stiffness),
    )


class March:
    """State of the strip along a load path.

    Attributes
    ----------
    force : F
    q : (3n,) since the pressing
    traction : (n,) t
    status : (n,) 0 for a node that sticks, else the direction in which it slips
    events : changes of status so far
    """

    def __init__(self, strip: Matrices) -> None:
        self.strip, self.force, self.events = strip, 0.0, 0
        self.q, self.traction = np.zeros(strip.pull.size), np.zeros(strip.pressed.size)
        self.status = np.zeros(strip.pressed.size)

    @property
    def cap(self) -> np.ndarray:
        """Coulomb cap mu R of the nodes, (n,)."""
        return self.strip.friction * (self.strip.pressed + self.strip.reaction @ self.q)

    def to(self, target: float) -> Branch:
        """Load or unload to a force."""
        strip, along = self.strip, np.sign(target - self.force)
        path, work = [(self.force, float(strip.pull @ self.q))], 0.0
        while abs(target - self.force) > 0.0:
            rate = self._rate(along)
            dv, dcap = rate[::3], strip.friction * (strip.reaction @ rate)
            cap, sticks = self.cap, self.status == 0.0
            dt = np.where(sticks, strip.slip_stiffness * dv, self.status * dcap)
            slip = dv - dt / strip.slip_stiffness  # a slider's spring moves with its cap
            left = abs(target - self.force)
            for side in (1.0, -1.0):
                closing = side * strip.slip_stiffness * dv - dcap
                gap = np.maximum(cap - side * self.traction, 0.0)
                closes = sticks & (closing > 0.0) & (gap > ROUNDING * cap)
                left = min(left, np.min(gap[closes] / closing[closes], initial=np.inf))
            work += left * np.sum(
                (strip.tributary * (cap + 0.5 * left * dcap) * np.abs(slip))[~sticks]
            )
            self.q, self.traction = self.q + left * rate, self.traction + left * dt
            last = left >= abs(target - self.force)
            self.force = target if last else self.force + along * left
            path.append((self.force, float(strip.pull @ self.q)))
        return Branch(*np.array(path).T, work)

    def _rate(self, along: float) -> np.ndarray:
        """Change of q per load along a direction, (3n,), and statuses consistent with it."""
        for _ in range(10 * self.status.size):
            rate = self._solve(along)
            wrong = self._wrong(rate)
            if not np.any(wrong):
                return rate
            self.events += 1
            new = np.where(self.status == 0.0, np.sign(self.traction), 0.0)
            self.status = np.where(wrong, new, self.status)
        raise jb.UnconvergedError(f"no status goes on from F = {self.force:.6g}")

    def _solve(self, along: float) -> np.ndarray:
        strip, sticks = self.strip, self.status == 0.0
        elastic = strip.tributary * strip.slip_stiffness * sticks
        rubbing = strip.friction * strip.tributary * self.status
        elastic[0] = rubbing[0] = 0.0  # held
        into_v = sparse.csr_array(np.kron(np.eye(sticks.size), [[1.0], [0.0], [0.0]]))
        foundation = sparse.diags_array(elastic) @ into_v.T + rubbing[:, None] * strip.reaction
        return spsolve((strip.stiffness + into_v @ foundation).tocsc(), along * strip.pull)

    def _wrong(self, rate: np.ndarray) -> np.ndarray:
        """Node whose status the rates contradict most; after a reversal, all that slip back."""
        strip, dv = self.strip, rate[::3]
        fastest = np.max(np.abs(dv))
        back = self.status * dv < -ROUNDING * fastest
        if np.any(back):
            return back
        cap = self.cap
        side = np.sign(self.traction)
        at_cap = (self.status == 0.0) & (np.abs(self.traction) >= (1.0 - 10.0 * ROUNDING) * cap)
        at_cap[0] = False
        leaving = side * dv - strip.friction * (strip.reaction @ rate) / strip.slip_stiffness
        leaving = np.where(at_cap, leaving, -np.inf)
        worst = int(np.argmax(leaving))
        wrong = np.zeros(dv.size, bool)
        wrong[worst] = leaving[worst] > ROUNDING * fastest
        return wrong


def dissipation(scene: jb.Scene, cycles: int = 2) -> tuple[float, float, int]:
    """Work of friction and secant stiffness of the last cycle, and the events of the path."""
    amplitude = float(scene.load.amplitude)
    march = March(matrices(scene))
    march.to(amplitude)
    for _ in range(cycles):
        down, up = march.to(-amplitude), march.to(amplitude)
    ends = (up.displacement[-1], down.displacement[-1])
    return down.work + up.work, 2.0 * amplitude / float(np.ptp(ends)), march.events
