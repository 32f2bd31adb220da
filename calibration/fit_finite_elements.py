"""Fit friction and height ratio (and the stick stiffness) to finite-element loops of five strips.

The true values are mu = 0.1 and the eta of the file, so the residual is the bias of the model.
Writes fitted_finite_elements.json and finite_elements.png beside this file:

    python calibration/fit_finite_elements.py
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

import jbeamshell as jb  # noqa: E402
from jbeamshell import identify, plotting  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.measured.example import HEIGHT_RATIOS, example_loops  # noqa: E402

HERE = Path(__file__).parent
FREE = {
    "mu": ("contact.friction",),
    "eta": ("strip.height_ratio",),
    "mu, eta": ("contact.friction", "strip.height_ratio"),
    "mu, eta, alpha": ("contact.friction", "strip.height_ratio", "contact.stick_stiffness"),
}
TRUE_FRICTION = 0.1


def study(height_ratio: float, free: tuple[str, ...]) -> tuple[identify.Fit, dict]:
    """Fit one strip; height and friction start at 1.5 times their true values."""
    truth = {"contact.friction": TRUE_FRICTION, "strip.height_ratio": height_ratio}
    start = {key: 1.5 * value for key, value in truth.items()} | {"contact.stick_stiffness": 30.0}
    begin = time.perf_counter()
    scene = in_load_steps().replace(truth | {key: start[key] for key in free})
    loops = example_loops(height_ratio)
    fit = identify.fit(loops, scene, free, throw=False)  # the record says how each ended
    bias = {key: fit.values[key] / truth[key] - 1.0 for key in truth if key in free}
    seconds = time.perf_counter() - begin
    return fit, fit.figures() | {"relative_bias": bias, "wall_s_with_compilation": seconds}


def main() -> None:
    """Run all fits, print a table, write the record and the picture."""
    record, fits = {}, {}
    for height_ratio in HEIGHT_RATIOS:
        record[f"{height_ratio:g}"] = {}
        for name, free in FREE.items():
            fit, figures = study(height_ratio, free)
            record[f"{height_ratio:g}"][name] = figures
            fits[height_ratio, name] = fit
            bias = [
                f"{symbol} {100 * figures['relative_bias'][key]:+.2f} %  "
                for symbol, key in zip(("mu", "eta"), FREE["mu, eta"], strict=True)
                if key in free
            ]
            print(
                f"eta {height_ratio:<7g} free {name:15s} {''.join(bias)}"
                f"misfit {100 * fit.misfit:.3f} %  {fit.model_runs} runs, {fit.status}"
            )
    text = json.dumps({"provenance": provenance(), "true_friction": TRUE_FRICTION, "fits": record})
    write_text(HERE / "fitted_finite_elements.json", json.dumps(json.loads(text), indent=1) + "\n")
    plotting.save(picture(fits[0.1126, "mu, eta"]), HERE / "finite_elements.png")


def picture(fit: identify.Fit) -> plt.Figure:
    """Picture of the fitted loops over finite elements, and of friction at the peak load."""
    with plotting.style():
        figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2))
        fit.plot(left)
        values = fit.values
        left.set_title(
            f"fitted: $\\mu$ = {values['contact.friction']:.4f} (true 0.1), "
            f"$\\eta$ = {values['strip.height_ratio']:.4f} (true 0.1126)"
        )
        history = jb.solve(fit.scene.replace({"load.amplitude": 1.0}))
        start, turn, _ = history.cycles[-1]
        shades = plotting.colours(5)
        for step, shade in zip(np.linspace(start, turn, 5).astype(int), shades, strict=True):
            cap = history.scene.contact.friction * 10.0
            force = float(history.force[step])
            right.plot(
                history.x, history.traction[step] / cap, color=shade, label=f"F = {force:.2g}"
            )
        right.set(
            xlabel="$X$  [length]",
            ylabel="friction traction  $t/\\mu F_N$  [1]",
            title="unloading from $F$ = 1: slip comes back from the loaded end",
        )
        right.legend()
    return figure


if __name__ == "__main__":
    main()
