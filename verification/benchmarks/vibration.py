"""Time of harmonic balance: forced responses beside tmdsimpy, and a structure of 10,000.

The record has the core's seconds of warm calls, which other work on the machine disturbs least, and
those of the wall; compile time apart.  Its parts:

- peer: forced response of ten masses with Segalman's four-parameter joint of 100 sliders,
  harmonics 1, 3, ... 9, by jbeamshell and by tmdsimpy (github.com/tmd-lab/tmdsimpy) if it is
  installed or on PYTHONPATH; differences at the frequencies of the peer, and errors against 2,048
  samples of a cycle;
- large: backbone of 40 points of a lattice of 10,000 degrees of freedom with four joints.
"""

import importlib.util
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp

from jbeamshell import dynamics

U = np.geomspace(0.05, 4.0, 9)
MASSES, DAMPING, FORCE = 10, 0.02, 0.3
RANGE = (0.10, 0.30)  # angular
HARMONICS, SAMPLES = (1, 3, 5, 7, 9), 256
IWAN = {"kt": 1.0, "Fs": 1.0, "chi": -0.5, "beta": 0.5}
SLIDERS = 100
EXACT = 2048  # samples of the reference
REPEATED = 2
COMPARED = 20  # points


def timed(call: Callable[[], Any]) -> tuple[Any, dict[str, float]]:
    """Result of a call, its first time, and the best of repeated ones."""
    begin = time.perf_counter()
    found = call()
    first = time.perf_counter() - begin
    wall, core = [], []
    for _ in range(REPEATED):
        begins = time.perf_counter(), time.process_time()
        call()
        wall.append(time.perf_counter() - begins[0])
        core.append(time.process_time() - begins[1])
    return found, {"first_s": first, "core_s": min(core), "wall_s": min(wall)}


def matrices() -> tuple[np.ndarray, np.ndarray]:
    """Chain of masses on springs, of which a joint holds the first; its mass and stiffness."""
    stiffness = 3.0 * (2.0 * np.eye(MASSES) - np.eye(MASSES, k=1) - np.eye(MASSES, k=-1))
    stiffness[0, 0] = stiffness[-1, -1] = 3.0
    return np.eye(MASSES), stiffness


def iwan() -> dynamics.Joint:
    """Joint with the sliders of tmdsimpy's VectorIwan4: slip at the middle of even intervals."""
    stiffness, force, chi, beta = IWAN.values()
    shape = beta + (chi + 1.0) / (chi + 2.0)
    most = force * (1.0 + beta) / stiffness / shape
    slip = most * (np.arange(SLIDERS) + 0.5) / SLIDERS
    springs = force * (chi + 1.0) / (most ** (chi + 2.0) * shape) * slip**chi * most / SLIDERS
    slip, springs = np.append(slip, most), np.append(springs, force * beta / (most * shape))
    u = np.append(slip, 2.0 * most)
    return dynamics.Joint(u, np.minimum(u[:, None], slip) @ springs)


def peer() -> dict[str, Any]:
    """Forced response of a chain, ours and theirs."""
    joint = iwan()
    mass, stiffness = matrices()
    held = [dynamics.Attachment(joint, 0)]
    structure = dynamics.Structure(mass, stiffness, held, damping=DAMPING * mass)
    force = np.zeros(MASSES)
    force[-1] = FORCE * 0.2
    setting = {"harmonics": HARMONICS[-1], "samples": SAMPLES}
    span = tuple(np.array(RANGE) / (2.0 * np.pi))
    found, times = timed(lambda: dynamics.forced_response(structure, force, span, **setting))
    points = found.frequency.size
    record: dict[str, Any] = {
        "harmonics": list(HARMONICS),
        "samples": SAMPLES,
        "ours": times | {"points": points, "core_ms_a_point": 1e3 * times["core_s"] / points},
    }
    if importlib.util.find_spec("tmdsimpy") is None:
        return record | {"tmdsimpy": "is not installed"}
    theirs, their_times = timed(lambda: tmdsimpy_response(joint, mass, stiffness, force))
    omega, amplitude = theirs
    points = omega.size
    pick = np.linspace(0, points - 1, COMPARED).astype(int)
    omega, amplitude = omega[pick], amplitude[pick]
    record["tmdsimpy"] = their_times | {
        "points": points,
        "core_ms_a_point": 1e3 * their_times["core_s"] / points,
    }
    at = {
        name: dynamics.steady_response(
            structure, force, omega / (2.0 * np.pi), harmonics=HARMONICS[-1], samples=samples
        ).amplitude
        for name, samples in {"ours": SAMPLES, "exact": EXACT}.items()
    }
    off = {"ours": at["ours"], "tmdsimpy": amplitude}
    record["error"] = {k: float(np.max(np.abs(a / at["exact"] - 1.0))) for k, a in off.items()}
    record["difference"] = float(np.max(np.abs(amplitude / at["ours"] - 1.0)))
    ours, other = record["ours"], record["tmdsimpy"]
    record["times_faster"] = {
        "curve": other["core_s"] / ours["core_s"],
        "point": other["core_ms_a_point"] / ours["core_ms_a_point"],
    }
    return record


def tmdsimpy_response(
    joint: dynamics.Joint, mass: np.ndarray, stiffness: np.ndarray, force: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies, and amplitudes of the first harmonic where the force acts, by tmdsimpy."""
    from tmdsimpy.continuation import Continuation
    from tmdsimpy.nlforces.vector_iwan4 import VectorIwan4
    from tmdsimpy.solvers import NonlinearSolver
    from tmdsimpy.utils import harmonic
    from tmdsimpy.vibration_system import VibrationSystem

    size, h = mass.shape[0], np.array(HARMONICS)
    to = np.zeros((1, size))
    to[0, 0] = 1.0
    system = VibrationSystem(mass, stiffness, C=DAMPING * mass)
    system.add_nl_force(VectorIwan4(to, to.T, **IWAN, Nsliders=SLIDERS))
    load = np.zeros(harmonic.Nhc(h) * size)
    load[:size] = force
    solver = NonlinearSolver()

    def residual(unknowns: np.ndarray, calc_grad: bool = True) -> Any:
        return system.hbm_res(unknowns, load, h, Nt=SAMPLES, calc_grad=calc_grad)

    def at_start(unknowns: np.ndarray, calc_grad: bool = True) -> Any:
        return residual(np.append(unknowns, RANGE[0]), calc_grad)[:2]

    stuck = stiffness + float(joint.stiffness) * to.T @ to
    first = np.linalg.solve(stuck - RANGE[0] ** 2 * mass, force)
    guess = np.append(first, np.zeros(load.size - size))
    start, _, slopes, _ = solver.nsolve(at_start, guess, verbose=False)
    begin = np.append(start, RANGE[0])
    scales = harmonic.harmonic_wise_conditioning(begin, size, h, delta=1e-3 * abs(first).max())
    scales[-1] = RANGE[1]
    setting = {
        "DynamicCtoP": True,
        "TargetNfev": 100,
        "MaxSteps": 4000,
        "dsmin": 1e-4,
        "dsmax": 0.1,
        "verbose": -1,
        "xtol": 1e-9 * load.size,
        "corrector": "Ortho",
    }
    rows = 1.0 / np.max(np.abs(np.diag(slopes * scales[:-1])))
    curve = Continuation(solver, ds0=0.02, CtoP=scales, RPtoC=rows, config=setting)
    found = curve.continuation(residual, begin, *RANGE)
    return found[:, -1], np.abs(found[:, size - 1] - 1j * found[:, 2 * size - 1])


def large() -> dict[str, Any]:
    """Backbone of a lattice with a joint at each corner of its end."""

    def line(count: int) -> Any:
        ends = np.full(count, 2.0)
        ends[[0, -1]] = 1.0
        return sp.diags_array([-np.ones(count - 1), ends, -np.ones(count - 1)], offsets=[-1, 0, 1])

    long, wide = (sp.eye_array(count) for count in (100, 10))
    grid = sp.kron(sp.kron(line(100), wide), wide) + sp.kron(sp.kron(long, line(10)), wide)
    grid = (grid + sp.kron(sp.kron(long, wide), line(10))).tocsr()
    mass = 1e-2 * sp.eye_array(grid.shape[0])
    joint = dynamics.Joint(1e-3 * U, 3e3 * np.tanh(U))
    corners = [dynamics.Attachment(joint, place) for place in (0, 9, 90, 99)]
    structure, built = timed(
        lambda: dynamics.Structure(mass, 4e6 * grid, corners, damping=10.0 * mass)
    )
    shapes = structure.modes(1).shapes
    amplitudes = 1e-3 * np.geomspace(0.01, 3.0, 40) / np.max(np.abs(shapes[:100, 0]))
    found, times = timed(lambda: dynamics.nonlinear_mode(structure, amplitudes))
    return {
        "degrees_of_freedom": grid.shape[0],
        "points": amplitudes.size,
        "structure": built,
        "backbone": times,
        "frequency": [float(found.frequency[0]), float(found.frequency[-1])],
        "damping": [float(found.damping[0]), float(found.damping[-1])],
    }


PARTS = {"peer": peer, "large": large}
