"""Cost of fitting four parameters to five loops, beside searches that know no derivatives.

The loops are the model's own with noise of a
thousandth of their range; every search starts from the same values, off by a third to a half, and
counts as done when its cost is within 1 % of the least.  Differential evolution searches between a
quarter and four times the start, and is stopped after CAP runs.  Times are warm, compile time
apart; the peers run the model without derivatives, which is cheaper.
"""

import contextlib
import statistics
import time
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from scipy.optimize import differential_evolution, minimize

import jbeamshell as jb
from jbeamshell import identify
from jbeamshell.measured.loops import Loop, make_loop

HELD = {"model.kinematics": "exact", "contact.normal": "held"}

ROUNDS = 2
CAP = 1500  # runs of the model
TARGET = 1.01  # of the least cost
NOISE = 1e-3  # of the range
WIDEST = 4.0  # of the start: the box of the evolution
AMPLITUDES = (0.4, 0.6, 0.8, 1.0, 1.4)
START = {
    "contact.friction": 0.15,
    "strip.height_ratio": 0.17,
    "strip.kappa_s": 0.66,
    "contact.stick_stiffness": 60.0,
}
# Beyond some hundreds the loops no longer tell one stick stiffness from another.
TRUTH = {"contact.stick_stiffness": 100.0}
SCENES = {
    "linear, 41 nodes": {"model.kinematics": "linear", "model.nodes": 41},
    "linear, 161 nodes": {"model.kinematics": "linear"},
    "exact, 161 nodes": {},
}
COMPARED = "linear, 41 nodes"


class Done(Exception):
    """The target is reached, or the cap."""


class Counted:
    """Cost without derivatives, counted, in the search space of the fit."""

    def __init__(self, fit: identify.Fit, target: float) -> None:
        self.problem, self.space = fit.problem, fit.uncertainty.space
        self.target, self.runs, self.best = target, 0, np.inf
        self.experiment = self.problem.experiment

    def __call__(self, point: np.ndarray) -> float:
        """Cost at a point."""
        if self.runs == CAP:
            raise Done
        self.runs += 1
        table = self.space.values(point)[self.space.table]
        costs = self.experiment._run(_cost, table, self.space.keys, jb.Newton())
        cost = float(np.sum(costs))
        self.best = min(self.best, cost)
        if cost <= self.target:
            raise Done
        return cost


@eqx.filter_jit
def _cost(values, observation, model, strip, keys, solver):
    model = model.replace(dict(zip(keys, values, strict=True)))
    return (jnp.sum(observation.residual(model, solver)[0] ** 2),)


def planted(scene: jb.Scene) -> list[Loop]:
    """The model's own loops with noise."""
    random, loops = np.random.default_rng(0), []
    for amplitude in AMPLITUDES:
        history = jb.solve(scene.replace({"load.amplitude": amplitude}))
        force, displacement = map(np.asarray, history.loop)
        noise = NOISE * np.ptp(displacement) * random.standard_normal(displacement.size)
        loops.append(make_loop(force, displacement + noise, f"A = {amplitude:g}"))
    return loops


def timed(function, *arguments, **options):
    """Result of a function, and its seconds."""
    begin = time.perf_counter()
    return function(*arguments, **options), time.perf_counter() - begin


def fitted(keys: dict) -> tuple[identify.Fit, dict]:
    """A fit, cold and warm."""
    truth = jb.library.standard().replace(HELD | TRUTH | keys)
    asked = planted(truth), truth.replace(START), tuple(START)
    _, cold = timed(identify.fit, *asked, starts=1)
    rounds = [timed(identify.fit, *asked, starts=1) for _ in range(ROUNDS)]
    result = rounds[0][0]
    warm = statistics.median(seconds for _, seconds in rounds)
    record = {
        "wall_s": warm,
        "compile_s": cold - warm,
        "model_runs": result.model_runs,
        "run_ms": 1e3 * warm / result.model_runs,
        "cost": result.minima[0][1],
        "values": result.values,
        "errors": result.errors,
    }
    print(record, flush=True)
    return result, {"levenberg-marquardt": record}


def peers(fit: identify.Fit) -> dict:
    """Runs and seconds of searches without derivatives until they are as good."""
    target, size = TARGET * fit.minima[0][1], len(START)
    box = [(-np.log(WIDEST), np.log(WIDEST))] * size
    every = {
        "maxiter": 10 * CAP,
        "maxfev": 10 * CAP,
        "adaptive": True,
        "xatol": 1e-8,
        "fatol": 1e-12,
    }
    searches = {
        "nelder-mead": lambda f: minimize(f, np.zeros(size), method="Nelder-Mead", options=every),
        "differential evolution": lambda f: differential_evolution(
            f, box, seed=0, x0=np.zeros(size), maxiter=CAP, polish=False
        ),
    }
    Counted(fit, target)(np.zeros(size))  # compiles
    record = {}
    for name, search in searches.items():
        cost = Counted(fit, target)
        begin = time.perf_counter()
        with contextlib.suppress(Done):
            search(cost)
        record[name] = {
            "model_runs": cost.runs,
            "wall_s": time.perf_counter() - begin,
            "run_ms": 1e3 * (time.perf_counter() - begin) / cost.runs,
            "cost_over_least": cost.best / fit.minima[0][1],
            "reached": bool(cost.best <= target),
        }
        print(name, record[name], flush=True)
    return record


def measure() -> dict[str, Any]:
    """Fits of all models, and of one its peers."""
    record: dict[str, Any] = {}
    for name, keys in SCENES.items():
        print(name, flush=True)
        fit, record[name] = fitted(keys)
        if name == COMPARED:
            record[name] |= peers(fit)
    return {"scenes": record}
