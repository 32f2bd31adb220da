"""One pair (kappa_s, alpha) for strips of any height, fitted to their dissipation.

The friction is known.  The logarithm of the dissipation of five strips by finite elements, at
amplitudes of 0.3 and more, is fitted with one squeeze-shear factor and one stick stiffness for all
strips, for several smoothings m of Coulomb's law: a smooth law imitates a corner that slips a
little at any load.  A sixth strip that is not fitted checks the result.  Writes
fitted_universal.json and universal.png beside this file; takes some minutes:

    python calibration/fit_universal.py
"""

import csv
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
from jbeamshell.measured.curves import DissipationCurve  # noqa: E402
from jbeamshell.measured.example import HEIGHT_RATIOS, data_folder  # noqa: E402

HERE = Path(__file__).parent
FREE = ("strip.kappa_s", "contact.stick_stiffness")
START = {"strip.kappa_s": 1.0, "contact.stick_stiffness": 8.0}
SMOOTHINGS = (4.0, 6.0, 8.0, 11.0, 16.0)
CHOSEN = 8.0
UNSEEN = 0.01
LEAST_AMPLITUDE = 0.3
STRONG = 0.3  # of the cubic law: strips that dissipate more are what a joint is about


def curve(height_ratio: float) -> tuple[DissipationCurve, np.ndarray]:
    """Dissipation of a strip by finite elements, and its ratio to the cubic law."""
    with (data_folder() / "energy.csv").open(newline="", encoding="utf-8") as file:
        rows = [
            [float(r[name]) for name in ("eta", "A", "D", "ratio")] for r in csv.DictReader(file)
        ]
    own = [row for row in rows if row[0] == height_ratio and row[1] >= LEAST_AMPLITUDE]
    _, amplitude, dissipation, ratio = np.transpose(own)
    return DissipationCurve(amplitude, dissipation, f"eta = {height_ratio:g}"), ratio


def specimen(height_ratio: float, values: dict[str, float]) -> identify.Specimen:
    """Strip with its curve; linear kinematics change the dissipation by 0.1 %."""
    base = {"model.kinematics": "linear", "strip.height_ratio": height_ratio}
    return identify.Specimen(
        in_load_steps().replace(base | values), curve(height_ratio)[0], f"eta = {height_ratio:g}"
    )


def errors(fit: identify.Fit) -> np.ndarray:
    """Logarithm of the model's dissipation over that of finite elements, (strips, amplitudes)."""
    pairs = zip(fit.model, fit.data, strict=True)
    return np.array([np.log(m.dissipation / d.dissipation) for m, d in pairs])


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def study(smoothing: float) -> tuple[identify.Fit, dict]:
    """Fit all strips together with one smoothing."""
    begin = time.perf_counter()
    values = START | {"contact.smoothing": smoothing}
    fit = identify.fit([specimen(eta, values) for eta in HEIGHT_RATIOS], free=FREE, throw=False)
    error = errors(fit)
    strong = np.array([curve(eta)[1] for eta in HEIGHT_RATIOS]) > STRONG
    unseen = specimen(UNSEEN, fit.values | {"contact.smoothing": smoothing})
    return fit, fit.figures() | {
        "smoothing": smoothing,
        "rms_all": rms(error),
        "rms_strong": rms(error[strong]),
        "worst_strong": float(np.abs(error[strong]).max()),
        "cells": [int(error.size), int(strong.sum())],
        "log_error": dict(zip(map(str, HEIGHT_RATIOS), error.tolist(), strict=True)),
        "rms_unseen": rms(predicted(unseen)),
        "wall_s_with_compilation": time.perf_counter() - begin,
    }


def predicted(strip: identify.Specimen) -> np.ndarray:
    """Logarithm of the model's dissipation over that of finite elements, without a fit."""
    data = strip.data
    model = [
        float(jb.solve(strip.scene.replace({"load.amplitude": float(a)})).dissipation)
        for a in data.amplitude
    ]
    return np.log(model / data.dissipation)


def main() -> None:
    """Run all fits, print a table, write the record and the picture."""
    fits, record = {}, []
    for smoothing in tqdm(SMOOTHINGS, disable=None, unit="fit"):
        fits[smoothing], figures = study(smoothing)
        record.append(figures)
        values = fits[smoothing].values
        print(
            f"m = {smoothing:<4g} kappa_s = {values[FREE[0]]:.3f}, alpha = {values[FREE[1]]:.3f}: "
            f"rms error of log D {100 * figures['rms_all']:.1f} % ({figures['cells'][0]} cells), "
            f"{100 * figures['rms_strong']:.2f} % where D exceeds {STRONG:g} of the cubic law "
            f"({figures['cells'][1]}), unseen strip {100 * figures['rms_unseen']:.2f} %; "
            f"{fits[smoothing].model_runs} runs, {fits[smoothing].status}"
        )
    text = {
        "provenance": provenance(),
        "chosen_smoothing": CHOSEN,
        "unseen": UNSEEN,
        "fits": record,
    }
    write_text(HERE / "fitted_universal.json", json.dumps(text, indent=1, allow_nan=False) + "\n")
    plotting.save(picture(fits[CHOSEN], record), HERE / "universal.png")


def picture(fit: identify.Fit, record: list[dict]) -> plt.Figure:
    """Picture of the dissipation with one pair for all strips, and of the error by smoothing."""
    with plotting.style():
        figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2))
        shades = plotting.colours(len(HEIGHT_RATIOS))
        for data, model, eta, shade in zip(fit.data, fit.model, HEIGHT_RATIOS, shades, strict=True):
            ratio = curve(eta)[1]
            left.loglog(data.amplitude, ratio, **plotting.DOTS | {"markersize": 4.0})
            left.loglog(
                model.amplitude,
                ratio * model.dissipation / data.dissipation,
                color=shade,
                label=rf"$\eta$ = {eta:g}",
            )
        values = fit.values
        left.set(
            xlabel=r"amplitude  $A\,/\,\mu F_N a$  [1]",
            ylabel=r"$D\,/\,(2/3)A^3$  [1]",
            title=rf"one $\kappa_s$ = {values[FREE[0]]:.2f} and $\alpha$ = {values[FREE[1]]:.2f} "
            f"for all strips ($m$ = {CHOSEN:g})",
        )
        left.legend()
        places = [figures["smoothing"] for figures in record]
        for name, label, shade in (
            ("rms_all", f"all cells, $A \\geq$ {LEAST_AMPLITUDE:g}", plotting.PALETTE[0]),
            ("rms_strong", f"$D$ above {STRONG:g} of the cubic law", plotting.PALETTE[1]),
        ):
            right.loglog(places, [100 * f[name] for f in record], "o-", color=shade, label=label)
        right.set_xticks(places, [f"{m:g}" for m in places])
        right.set_yticks((2, 5, 10, 20), ("2", "5", "10", "20"))
        right.minorticks_off()
        right.set(
            xlabel="smoothing $m$ of Coulomb's law  [1]",
            ylabel=r"rms error of $\log D$  [%]",
            title="what is left after the fit",
        )
        right.legend()
    return figure


if __name__ == "__main__":
    main()
