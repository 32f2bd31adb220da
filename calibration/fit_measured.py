"""Friction and stiffness of a measured contact, cycled beyond gross slip.

Takes any file with the columns time, displacement (imposed), force (driving) and normal force, with
their units in the header:

    python calibration/fit_measured.py FILE [FOLDER]

The mean of the steady cycles of the first half is fitted; the fitted model then predicts the second
half as recorded. The contact is a strip of length 1 that is free at its far end and carries the
mean normal force. Parameters are freed in turn, to see which of them the loop determines: friction
with the elasticity of the slider (alpha), of the strip (E' 2H), of both, and with the roundness of
the shoulder (m). A loop of force over displacement contains no length, so this does not show that
the specimen is a beamshell. Writes measured.json and measured.png into the folder, if one is given.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from strip import in_load_steps  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell import identify, plotting  # noqa: E402
from jbeamshell.common.errors import InputError, UnconvergedError  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.measured.loops import Loop  # noqa: E402
from jbeamshell.measured.recordings import Recording, read_recordings  # noqa: E402
from jbeamshell.measured.splitting import split_cycles  # noqa: E402
from jbeamshell.measured.steady import steady_loops  # noqa: E402

MU, STRIP, SLIDER, SHOULDER = (
    "contact.friction",
    "strip.axial_stiffness",
    "contact.stick_stiffness",
    "contact.smoothing",
)
CASES = {
    "slider": (MU, SLIDER),
    "strip": (MU, STRIP),
    "slider and strip": (MU, SLIDER, STRIP),
    "slider and shoulder": (MU, SLIDER, SHOULDER),
}
STIFF = {SLIDER: 300.0, STRIP: 30.0}  # over what starts: far from where it would be felt
ROUND = 6.0
POINTS = 160
APPROACH = 9


def part(recording: Recording, first: int, last: int) -> Recording:
    """Part of a recording, from one point to another."""
    own = slice(first, last + 1)
    time_ = None if recording.time is None else recording.time[own]
    normal = None if recording.normal_force is None else recording.normal_force[own]
    return recording._replace(
        force=recording.force[own],
        displacement=recording.displacement[own],
        time=time_,
        normal_force=normal,
    )


def start(loop: Loop, normal: float, free: tuple[str, ...]) -> jb.Scene:
    """Scene whose friction and stiffness are estimated from the loop."""
    # A steady loop starts at its upper turn: how far back until the force is gone?
    gone = int(np.argmax(loop.force < 0.0))
    stiffness = float(loop.force[0] / (loop.displacement[0] - loop.displacement[gone]))
    scene = in_load_steps().replace(
        {
            "strip.length": 1.0,
            "strip.far_end": "free",
            STRIP: stiffness * (3.0 if STRIP in free else STIFF[STRIP]),
            "contact.pressure": normal,
            MU: 0.5 * float(np.ptp(loop.force)) / normal,
            "load.control": "displacement",
            "load.amplitude": float(np.max(np.abs(loop.displacement))),
            "model.kinematics": "linear",
        }
    )
    per_slider = float(scene.strip.shear_modulus) / float(scene.strip.half_height)
    slider = stiffness / per_slider * (1.0 if SLIDER in free else STIFF[SLIDER])
    return scene.replace({SLIDER: slider} | ({SHOULDER: ROUND} if SHOULDER in free else {}))


def answered(scene: jb.Scene, drive: np.ndarray) -> np.ndarray:
    """Force of the model along a path of displacements, (points,)."""
    approach = np.linspace(0.0, drive[0], APPROACH)[1:-1]
    return np.asarray(jb.solve(scene, np.append(approach, drive)).force)[-drive.size :]


def study(recording: Recording) -> tuple[dict, identify.Fit, tuple[Loop, np.ndarray]]:
    """Fits of all cases: record, fit to draw, and the cycles not fitted with the model's force."""
    if recording.normal_force is None:
        raise InputError(f"{recording.label}: needs a column of the normal force")
    found = split_cycles(recording, "displacement")
    if len(found.cycles) < 4:
        raise InputError(f"{recording.label}: has {len(found.cycles)} cycles; record 4 or more")
    half, end = found.cycles[len(found.cycles) // 2].start, found.cycles[-1].end
    head, tail = part(recording, 0, half), part(recording, half, end)
    mean = steady_loops(head, "displacement")[-1]
    loop = mean.centred()
    zero = float(np.mean(mean.force - loop.force))
    normal = float(np.mean(recording.normal_force[half : end + 1]))
    centre = float(np.mean(mean.displacement - loop.displacement))
    unseen = Loop(tail.force - zero, tail.displacement - centre, "cycles not fitted")
    thin = unseen.thinned(POINTS * (len(found.cycles) // 2), "displacement")
    record: dict = {
        "file": recording.label,
        "points": int(recording.force.size),
        "cycles": len(found.cycles),
        "cycles_fitted": mean.cycles,
        "noise_of_the_range": mean.noise / float(np.ptp(mean.force)) if mean.noise else None,
        "work_per_cycle": float(abs(np.trapezoid(mean.force, mean.displacement))),
        "zero_of_the_force": zero,
        "normal_force": normal,
        "notes": mean.notes,
        "cases": {},
    }
    fits, answers = {}, {}
    for name, free in CASES.items():
        begin = time.perf_counter()
        # What is left is the model's, not the noise's: errors come from it.
        bare = loop._replace(noise=None, scatter=None)
        try:
            fit = identify.fit(bare, start(loop, normal, free), free, points=POINTS, throw=False)
            answer = answered(fit.scene, thin.displacement)
        except UnconvergedError as error:
            record["cases"][name] = {"status": str(error)}
            continue
        left = float(np.sqrt(np.mean((answer - thin.force) ** 2)) / np.ptp(loop.force))
        fits[name], answers[name] = fit, answer
        record["cases"][name] = fit.figures() | {
            "misfit_of_cycles_not_fitted": left,
            "wall_s_with_compilation": time.perf_counter() - begin,
        }
        print(
            f"{name}: {100 * fit.misfit:.2f} % of the force range, cycles not fitted "
            f"{100 * left:.2f} %\n{fit}",
            flush=True,
        )
    if not fits:
        raise InputError(f"{recording.label}: the model finds no equilibrium along these cycles")
    # The simplest that is as good as any.
    least = min(fit.misfit for fit in fits.values())
    best = next(name for name, fit in fits.items() if fit.misfit < 1.1 * least)
    record["simplest"] = best
    return record, fits[best], (thin, answers[best])


def picture(fit: identify.Fit, unseen: tuple[Loop, np.ndarray]) -> plt.Figure:
    """Picture of the mean loop with its fit, and of the cycles that were not fitted."""
    with plotting.style():
        figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2), sharey=True)
        fit.plot(left)
        loop, answer = unseen
        right.plot(loop.displacement, loop.force, label=loop.label, **plotting.DOTS)
        right.plot(loop.displacement, answer, color=plotting.PALETTE[1], label="the same model")
        left.set(title="fitted: mean of the first steady cycles")
        right.set(title="not fitted: the second half", xlabel=plotting.DISPLACEMENT)
        right.legend()
    return figure


def main() -> int:
    """Fit a file, print the results, write the record and the picture."""
    parser = argparse.ArgumentParser(description="mu and stiffness of a measured contact")
    parser.add_argument("file")
    parser.add_argument("folder", nargs="?")
    options = parser.parse_args()
    try:
        (recording,) = read_recordings([options.file])
        record, fit, unseen = study(recording)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"the simplest that is as good as any: {record['simplest']}")
    if options.folder:
        folder = Path(options.folder)
        folder.mkdir(parents=True, exist_ok=True)
        write_text(folder / "measured.json", json.dumps(record, indent=1, default=str) + "\n")
        plotting.save(picture(fit, unseen), folder / "measured.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
