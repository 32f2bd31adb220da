"""Fits of the squeeze-shear factor kappa_s, to a squeezed strip and to loops of friction.

First kappa_s alone is fitted to the mean sigma_y of a strip squeezed over its middle (finite
elements; Brink 2015, section 4.7.2), for both sets of constants, several windows and several grids.
Then mu, eta and kappa_s together, to loops of friction: those of finite elements, where the
residual is the bias of the model, and the model's own with 1 % noise, to see what loops can
determine. Writes fitted_squeeze.json and squeeze.png beside this file; takes about ten minutes:

    python calibration/fit_squeeze.py
"""

import json
import time
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from provenance import provenance  # noqa: E402
from strip import in_load_steps  # noqa: E402
from tqdm import tqdm  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell import identify, plotting  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.measured.curves import SqueezeCurve  # noqa: E402
from jbeamshell.measured.example import data_folder, example_loops  # noqa: E402
from jbeamshell.measured.loops import Loop, make_loop  # noqa: E402
from jbeamshell.reference import best_kappa_s, squeeze_decay_length  # noqa: E402
from jbeamshell.scene import library  # noqa: E402

HERE = Path(__file__).parent
EDGE = 50.0  # mm, where the pressure ends
START = {"consistent": 1.0, "printed": 0.05}
WINDOW = 5.0  # mm, to either side of the edge
WINDOWS = (1.0, 2.0, 10.0, 20.0)
GRIDS = (201, 401, 801)
FREE = ("contact.friction", "strip.height_ratio", "strip.kappa_s")
SYMBOLS = (r"\mu", r"\eta", r"\kappa_s")
HEIGHT_RATIOS = (0.0511, 0.1126, 0.2358)
TRUE_FRICTION, TRUE_KAPPA_S = 0.1, 0.44
NOISE, SEEDS = 0.01, 3


# --- a squeezed strip -----------------------------------------------------------------------------


def squeezed_curve() -> SqueezeCurve:
    """Mean sigma_y of the squeezed strip by finite elements."""
    path = data_folder() / "squeeze" / "b2.csv"
    table = np.genfromtxt(path, delimiter=",", names=True)
    return SqueezeCurve(table["x_mm"], table["sy_avg"], "finite elements")


def fit_squeeze(half_window: float, nodes: int, constants: str) -> tuple[identify.Fit, dict]:
    """Fit kappa_s in a window around the edge of the load."""
    start = {"strip.kappa_s": START[constants], "model.constants": constants, "model.nodes": nodes}
    scene = library.squeezed().replace(start)
    curve = squeezed_curve().between(EDGE - half_window, EDGE + half_window)
    fit = identify.fit_kappa_s(curve, scene)
    kappa_s, strip = fit.values["strip.kappa_s"], scene.strip
    per_consistent = 1.0 if constants == "consistent" else 24.0
    decay = squeeze_decay_length(strip.half_height, per_consistent * kappa_s, strip.poisson_ratio)
    return fit, {
        "constants": constants,
        "half_window_mm": half_window,
        "nodes": nodes,
        "points": curve.x.size,
        "kappa_s": kappa_s,
        "error": fit.errors["strip.kappa_s"],
        "rms_MPa": fit.misfit * float(np.ptp(curve.stress)),
        "decay_length_mm": float(decay),
        "status": fit.status,
        "model_runs": fit.model_runs,
    }


# --- loops of friction ----------------------------------------------------------------------------


def planted(loops: list[Loop], height_ratio: float, seed: int) -> list[Loop]:
    """Loops of the model itself at the amplitudes of others, with noise."""
    random, own = np.random.default_rng(seed), []
    for loop in loops:
        peak = {"load.amplitude": float(loop.force.max()), "strip.height_ratio": height_ratio}
        force, displacement = map(np.asarray, jb.solve(in_load_steps().replace(peak)).loop)
        noise = NOISE * np.ptp(displacement) * random.standard_normal(displacement.size)
        own.append(make_loop(force, displacement + noise, loop.label))
    return own


def fit_loops(loops: list[Loop], height_ratio: float, free: tuple[str, ...] = FREE) -> dict:
    """Fit that starts at 1.5 times height and friction, and at kappa_s = 1."""
    start = dict(zip(FREE, (0.15, 1.5 * height_ratio, 1.0), strict=True))
    scene = in_load_steps().replace({key: start[key] for key in free})
    begin = time.perf_counter()
    fit = identify.fit(loops, scene, free, throw=False)  # the record says how each ended
    relative = np.array([fit.errors[key] / fit.values[key] for key in free])
    spread = np.linalg.eigvalsh(np.outer(relative, relative) * fit.correlation)
    return fit.figures() | {
        "condition": float(spread[-1] / spread[0]),  # of the covariance of the logarithms
        "wall_s": time.perf_counter() - begin,
    }


def verdict(height_ratio: float, record: dict) -> str:
    """Figures of the fits to the loops of one strip."""
    truth = dict(zip(FREE, (TRUE_FRICTION, height_ratio, TRUE_KAPPA_S), strict=True))
    noisy, free = record["planted"], record["finite_elements"]
    errors = {k: np.median([fit["values"][k]["error"] for fit in noisy]) for k in FREE}
    percent = [f"{100.0 * errors[k] / truth[k]:.2g} %" for k in FREE]
    share = errors["strip.kappa_s"] / TRUE_KAPPA_S
    word = "fix" if share < 0.1 else "hardly fix" if share < 0.5 else "do not fix"
    kappa_s = free["values"]["strip.kappa_s"]["value"]
    hidden = abs(kappa_s - TRUE_KAPPA_S) < errors["strip.kappa_s"]
    correlation = np.median([fit["correlation"] for fit in noisy], axis=0)
    condition = np.median([fit["condition"] for fit in noisy])
    return (
        f"eta = {height_ratio:g}: {len(free['misfits'])} loops with {100 * NOISE:g} % noise {word} "
        f"kappa_s: they leave {percent[0]} of mu, {percent[1]} of eta and {percent[2]} of kappa_s "
        f"open (one standard error; correlation of eta and kappa_s {correlation[1, 2]:.2f}, "
        f"condition {condition:.2g}). The finite-element loops ask for kappa_s = "
        f"{'0' if kappa_s < 0.01 else format(kappa_s, '.2g')}, for a misfit of "
        f"{100 * free['misfit']:.2g} % instead of {100 * record['held']['misfit']:.2g} % at "
        f"{TRUE_KAPPA_S:g}: that is the model's bias, "
        f"{'which such noise would hide' if hidden else 'and more than such noise would hide'}."
    )


# --- all of it ------------------------------------------------------------------------------------


def main() -> None:
    """Run all fits, print the results, write the record and the picture."""
    cases = [(WINDOW, nodes, constants) for constants in START for nodes in GRIDS]
    cases += [(window, GRIDS[-1], "consistent") for window in WINDOWS]
    squeeze, loops, fits = [], {}, {}
    total = len(cases) + len(HEIGHT_RATIOS) * (2 + SEEDS)
    with tqdm(total=total, disable=None, unit="fit") as bar:
        for case in cases:
            fits[case], figures = fit_squeeze(*case)
            squeeze.append(figures)
            bar.update()
        for height_ratio in HEIGHT_RATIOS:
            measured = example_loops(height_ratio)
            record = loops[f"{height_ratio:g}"] = {"planted": []}
            for name, free in (("finite_elements", FREE), ("held", FREE[:2])):
                record[name] = fit_loops(measured, height_ratio, free)
                bar.update()
            for seed in range(SEEDS):
                own = planted(measured, height_ratio, seed)
                record["planted"].append(fit_loops(own, height_ratio))
                bar.update()
            record["verdict"] = verdict(height_ratio, record)
    for figures in squeeze:
        print(
            f"{figures['constants']:10s} {figures['nodes']} nodes, "
            f"{EDGE:g} +- {figures['half_window_mm']:g} mm: "
            f"kappa_s = {figures['kappa_s']:.5f} +- {figures['error']:.5f}, "
            f"lam = {figures['decay_length_mm']:.4f} mm, rms {figures['rms_MPa']:.3f} MPa"
        )
    print(*(record["verdict"] for record in loops.values()), sep="\n")
    truth = {"contact.friction": TRUE_FRICTION, "strip.kappa_s": TRUE_KAPPA_S, "noise": NOISE}
    text = {"provenance": provenance(), "squeeze": squeeze, "truth": truth, "loops": loops}
    write_text(HERE / "fitted_squeeze.json", json.dumps(text, indent=1, allow_nan=False) + "\n")
    best = {constants: fits[WINDOW, GRIDS[-1], constants] for constants in START}
    plotting.save(picture(best, squeeze, loops), HERE / "squeeze.png")


# --- picture --------------------------------------------------------------------------------------


def picture(best: dict[str, identify.Fit], squeeze: list[dict], loops: dict) -> plt.Figure:
    """Picture of the squeezed strip above, and of the fits to loops below."""
    with plotting.style():
        figure = plt.figure(figsize=(11.0, 7.4))
        above, below = figure.subfigures(2, 1)
        edge, study = above.subplots(1, 2, width_ratios=(3, 2))
        draw_edge(best, edge)
        draw_windows_and_grids(squeeze, study)
        *panels, pairs = below.subplots(1, 4, width_ratios=(3, 3, 3, 4))
        for key, symbol, panel in zip(FREE, SYMBOLS, panels, strict=True):
            draw_deviation(loops, key, symbol, panel)
        panels[0].legend(loc="best")
        draw_correlation(loops, pairs)
    return figure


def draw_edge(best: dict[str, identify.Fit], axes: plt.Axes) -> None:
    """Draw the squeeze stress around the edge of the pressure."""
    curve = squeezed_curve().between(EDGE - 3.0, EDGE + 3.0)
    wide = jb.solve(best["consistent"].scene.replace({"strip.kappa_s": 1.0}))
    blue, _, green, _, yellow, _ = plotting.PALETTE
    consistent, printed = (best[name].model[0] for name in START)
    fitted, small = (best[name].values["strip.kappa_s"] for name in START)
    zoom = axes.inset_axes((0.6, 0.13, 0.38, 0.45), xlim=(EDGE + 0.4, EDGE + 2.4), ylim=(-7, 2))
    for panel in (axes, zoom):
        label = rf"model, $\kappa_s$ = {fitted:.3f} (fitted)"
        panel.plot(consistent.x, consistent.stress, color=blue, linewidth=2.6, label=label)
        label = rf"printed constants, $\kappa_s$ = {small:.4f} (fitted)"
        panel.plot(printed.x, printed.stress, "--", color=yellow, label=label)
        label = r"model, $\kappa_s$ = 1"
        panel.plot(wide.middles, wide.squeeze_stress[-1], color=green, label=label)
        panel.plot(curve.x, curve.stress, ".", color=plotting.DATA, ms=3.5, label=curve.label)
    zoom.set_title("no single $\\psi$ has Filon's tension", fontsize=9)
    axes.set(
        xlim=(EDGE - 2.4, EDGE + 2.4),
        xlabel="$X$  [mm]",
        ylabel=r"mean of $\sigma_y$  [MPa]",
        title="(a) a strip squeezed up to $X$ = 50 mm",
    )
    axes.legend(loc="upper left")


def draw_windows_and_grids(squeeze: list[dict], axes: plt.Axes) -> None:
    """Draw kappa_s by window and by grid, side by side."""
    same = [f for f in squeeze if f["constants"] == "consistent"]
    windows = sorted(
        (f for f in same if f["nodes"] == GRIDS[-1]), key=lambda f: f["half_window_mm"]
    )
    grids = [f for f in same if f["half_window_mm"] == WINDOW]
    ticks = [f"$\\pm${f['half_window_mm']:g}" for f in windows] + [f"{f['nodes']}" for f in grids]
    values = [f["kappa_s"] for f in (*windows, *grids)]
    errors = [f["error"] for f in (*windows, *grids)]
    place = np.append(np.arange(len(windows)), len(windows) + 0.8 + np.arange(len(grids)))
    exact = float(best_kappa_s(0.3))
    axes.axhline(exact, color=plotting.FAINT, linewidth=1.0, label=f"exact stress: {exact:.4f}")
    axes.errorbar(place, values, errors, fmt="o", color=plotting.PALETTE[0], capsize=3.0)
    axes.set_xticks(place, ticks)
    axes.set(
        xlabel="window about the edge  [mm]          nodes",
        ylabel=r"$\kappa_s$  [1]",
        title=f"fitted, with {GRIDS[-1]} nodes          within $\\pm${WINDOW:g} mm",
    )
    axes.legend(loc="best")


def draw_deviation(loops: dict, key: str, symbol: str, axes: plt.Axes) -> None:
    """Draw the error of one parameter, strip by strip."""
    series: dict[str, list] = {f"own loops, {100 * NOISE:g} % noise": [], "finite elements": []}
    own, measured = series.values()
    for place, (height_ratio, record) in enumerate(loops.items()):
        truth = dict(zip(FREE, (TRUE_FRICTION, float(height_ratio), TRUE_KAPPA_S), strict=True))
        fits = [*record["planted"], record["finite_elements"]]
        for at, fit in zip(np.linspace(-0.24, 0.24, len(fits)), fits, strict=True):
            value, error = (fit["values"][key][name] / truth[key] for name in ("value", "error"))
            to = measured if fit is fits[-1] else own
            to.append((place + at, 100.0 * (value - 1.0), 100.0 * error))
    for (label, points), marker, colour in zip(
        series.items(), "oD", plotting.PALETTE[:2], strict=True
    ):
        place, value, error = np.transpose(points)
        dots = {"fmt": marker, "markersize": 4.0, "capsize": 2.5, "color": colour}
        axes.errorbar(place, value, error, label=label, **dots)
    axes.axhline(0.0, color=plotting.FAINT, linewidth=1.0)
    axes.set_xticks(range(len(loops)), [f"{float(ratio):.3g}" for ratio in loops])
    axes.set(xlabel=r"$\eta$ of the strip  [1]", title=f"(b) ${symbol}$ from loops: off by  [%]")


def draw_correlation(loops: dict, axes: plt.Axes) -> None:
    """Draw correlations of the parameters under noise, a bar for every strip."""
    pairs = [(0, 1), (0, 2), (1, 2)]
    shades = plotting.colours(len(loops) + 2)[2:]
    for i, ((height_ratio, record), shade) in enumerate(zip(loops.items(), shades, strict=True)):
        correlation = np.median([fit["correlation"] for fit in record["planted"]], axis=0)
        heights = [correlation[pair] for pair in pairs]
        place = np.arange(len(pairs)) + 0.26 * (i - 1)
        axes.bar(place, heights, 0.24, color=shade, label=rf"$\eta$ = {float(height_ratio):.3g}")
    names = [f"${SYMBOLS[a]},\\,{SYMBOLS[b]}$" for a, b in pairs]
    axes.set_xticks(range(len(pairs)), names)
    axes.set(title="(c) correlation under noise  [1]", ylim=(0.0, 1.0))
    axes.legend(loc="upper left")


if __name__ == "__main__":
    main()
