"""Bias of parameters fitted to noisy loops, and coverage of their confidence intervals.

The model's own loops of one strip at three amplitudes get independent noise of 0.1, 1 and 5 % of
their range, fifty times each.  To each set mu, eta, kappa_s and alpha are fitted, with the noise
estimated from the residual.  Two figures count: the mean of the estimates less the true values, in
standard errors on the scale of the search; and how often the 68 % and 95 % intervals hold the true
values, both those of `Fit.intervals_at` and those of the likelihood ratio, for which the true value
is held and all others are fitted again.  Takes a quarter of an hour on two cores, a process for
each.
"""

import multiprocessing
import os
import warnings
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import Any

import jax
import numpy as np
from scipy import stats
from tqdm import tqdm

import jbeamshell as jb
from calibration.strip import in_load_steps
from jbeamshell import identify
from jbeamshell.measured.loops import Loop, make_loop

TRUTH = {
    "contact.friction": 0.1,
    "strip.height_ratio": 0.2358,
    "strip.kappa_s": 0.44,
    "contact.stick_stiffness": 10.0,
}
START = {
    "contact.friction": 0.12,
    "strip.height_ratio": 0.2,
    "strip.kappa_s": 0.8,
    "contact.stick_stiffness": 20.0,
}
MODEL = {"model.kinematics": "linear", "model.nodes": 81}  # plants and fits: no model is wrong here
AMPLITUDES = (0.4, 0.8, 1.6)
NOISES = (0.001, 0.01, 0.05)
REPEATS = 50
LEVELS = (0.68, 0.95)


def clean_loops() -> list[Loop]:
    """Steady loops of the strip."""
    loops = []
    for amplitude in AMPLITUDES:
        scene = in_load_steps().replace(MODEL | TRUTH | {"load.amplitude": amplitude})
        loops.append(make_loop(*map(np.asarray, jb.solve(scene).loop), f"A = {amplitude:g}"))
    return loops


def noisy(loops: list[Loop], noise: float, seed: int) -> list[Loop]:
    """Loops with noise on the displacement, given as a part of its range."""
    random = np.random.default_rng(seed)
    return [
        loop.but(
            displacement=loop.displacement
            + noise * np.ptp(loop.displacement) * random.standard_normal(loop.displacement.size)
        )
        for loop in loops
    ]


def recovered(noise: float, seed: int) -> dict:
    """Estimates and errors of one fit, and if its intervals and likelihoods hold the truth."""
    loops = noisy(clean_loops(), noise, seed)
    scene = in_load_steps().replace(MODEL | START | {"load.amplitude": max(AMPLITUDES)})
    fit = identify.fit(loops, scene, tuple(TRUTH), throw=False)
    figures = {
        "values": fit.values,
        "status": fit.status.name.lower(),
        "model_runs": fit.model_runs,
        "points": sum(loop.force.size for loop in fit.data),
        "log_errors": {key: fit.errors[key] / fit.values[key] for key in TRUTH},
        "likelihood_root": {key: likelihood_root(fit, loops, key) for key in TRUTH},
    }
    for level in LEVELS:
        ends = fit.intervals_at(level)
        figures[f"holds_{100 * level:.0f}"] = {
            key: bool(ends[key][0] <= TRUTH[key] <= ends[key][1]) for key in TRUTH
        }
    return figures


def likelihood_root(fit: identify.Fit, loops: list[Loop], key: str) -> float:
    """Root of the rise of the cost, in units of the noise, with a parameter held at the truth."""
    others = tuple(name for name in TRUTH if name != key)
    scene = fit.scene.replace({key: TRUTH[key]})
    held = identify.fit(loops, scene, others, throw=False)
    freedom = sum(loop.force.size for loop in fit.data) - len(TRUTH)
    least, rest = (f.misfit**2 for f in (fit, held))
    return float(np.sqrt(max(rest / least - 1.0, 0.0) * freedom))


def summary(noise: float, fits: list[dict]) -> dict[str, Any]:
    """Bias and coverage at one level of noise."""
    record: dict[str, Any] = {"noise": noise, "repeats": len(fits)}
    record["settled"] = sum(fit["status"] == "converged" for fit in fits)
    record["model_runs"] = float(np.mean([fit["model_runs"] for fit in fits]))
    points = fits[0]["points"]
    for key, truth in TRUTH.items():
        values = np.array([fit["values"][key] for fit in fits])
        error = np.array([fit["log_errors"][key] for fit in fits])
        shift = np.log(values / truth)
        roots = np.array([fit["likelihood_root"][key] for fit in fits])
        own = {
            "median": float(np.median(values)),
            "spread": float(np.std(shift, ddof=1)),
            "standard_error": float(np.nanmedian(error)),
            "bias_in_standard_errors": float(np.mean(shift) / np.nanmedian(error)),
            "median_bias_in_standard_errors": float(np.median(shift) / np.nanmedian(error)),
        }
        for level in LEVELS:
            name = f"{100 * level:.0f}"
            own[f"holds_{name}"] = float(np.mean([f[f"holds_{name}"][key] for f in fits]))
            within = roots <= stats.t.ppf(0.5 * (1.0 + level), points - len(TRUTH))
            own[f"likelihood_holds_{name}"] = float(np.mean(within))
        record[key] = own
    return record


def measure() -> dict[str, Any]:
    """Fit to all sets of loops, on all cores."""
    everything: dict[float, list[dict]] = {noise: [{}] * REPEATS for noise in NOISES}
    total = len(NOISES) * REPEATS
    spawned = multiprocessing.get_context("spawn")
    with (
        ProcessPoolExecutor(os.cpu_count(), mp_context=spawned, initializer=_double) as pool,
        tqdm(total=total, disable=None, unit="set") as bar,
    ):
        # The noisiest take longest: they come first.
        tasks = {
            pool.submit(recovered, noise, seed): (noise, seed)
            for noise in sorted(NOISES, reverse=True)
            for seed in range(REPEATS)
        }
        for done in as_completed(tasks):
            noise, seed = tasks[done]
            everything[noise][seed] = done.result()
            bar.update()
    noises = [summary(noise, fits) for noise, fits in everything.items()]
    return {"truth": TRUTH, "amplitudes": list(AMPLITUDES), "noises": noises}


def _double() -> None:
    """Double precision, without doubts, in a process of its own."""
    jax.config.update("jax_enable_x64", True)
    warnings.simplefilter("ignore", jb.DoubtfulWarning)


def tell(record: dict[str, Any]) -> str:
    """Bias and coverage in lines."""
    lines = []
    for own in record["noises"]:
        lines.append(f"noise {100 * own['noise']:g} %: {own['settled']} of {REPEATS} settled")
        for key in TRUTH:
            told = own[key]
            lines.append(
                f"  {key:24s} median {told['median']:.4g} (planted {TRUTH[key]:g}), error "
                f"{100 * told['standard_error']:.2g} %, spread {100 * told['spread']:.2g} %, "
                f"bias {told['bias_in_standard_errors']:+.2f} errors; holds "
                f"{100 * told['holds_68']:.0f} and {100 * told['holds_95']:.0f} %, by "
                f"likelihood {100 * told['likelihood_holds_68']:.0f} and "
                f"{100 * told['likelihood_holds_95']:.0f} %"
            )
    return "\n".join(lines)
