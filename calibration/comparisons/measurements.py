"""Measurements from a folder of their files: laws fitted to one part, the other part predicted.

The files are their owners' and not part of this repository; sources.md says where they are and
under which licence.  What is kept in measured.json are derived figures: energies and forces of
steady cycles, fitted numbers, and what became of a plain fit.  Each study needs one call,
``jb.identify.compare(loops, models)``, which chooses the law by the fitted part alone.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import jbeamshell as jb
from calibration.comparisons.case import Floats, rounded
from jbeamshell import dynamics, identify, laws, plotting
from jbeamshell.cli.main import main as command
from jbeamshell.common.files import write_text
from jbeamshell.identify import Parameter
from jbeamshell.measured import (
    Backbone,
    DampingCurve,
    FrequencyCurve,
    Loop,
    make_loop,
    read_loops,
    split_cycles,
    steady_loops,
)

RECORD = Path(__file__).with_name("measured.json")
MODELS = ("jenkins", "iwan4", "bouc-wen", "bar", "mindlin")
INCH, KIP = 25.4, 4.4482216  # mm, kN
Figures = dict[str, Any]


def figures(loops: Sequence[Loop]) -> Figures:
    """Amplitude of the displacement, energy of a cycle and amplitude of the force of loops."""
    return {
        "amplitude": rounded(np.array([0.5 * np.ptp(loop.displacement) for loop in loops])),
        "energy": rounded(np.array([abs(loop.work) for loop in loops])),
        "force": rounded(np.array([0.5 * np.ptp(loop.force) for loop in loops])),
    }


def fitted(loops: Sequence[Loop], models: Sequence[str] = MODELS) -> Figures:
    """Laws fitted to loops by a plain call: numbers and misfit of each, and the one it chooses."""
    found = identify.compare(list(loops), list(models))
    print(found)
    rows = {
        row.name: {
            "values": {} if row.fit is None else row.fit.values,
            "misfit": row.misfit,
            "told": row.told,
        }
        for row in found.rows
        if row.fit is not None
    }
    return {"models": rows, "chosen": None if found.chosen is None else found.chosen.name}


def study(known: Sequence[Loop], unseen: Sequence[Loop]) -> Figures:
    """Laws fitted to some loops, and the figures of others that were not fitted."""
    return fitted(known) | {"fitted": figures(known), "held_out": figures(unseen)}


def bolt(folder: Path) -> Figures:
    """Preloaded M12 bolt, members on rollers: the widest of three loops is fitted."""
    loops = bolt_loops(folder)
    found = study(loops[2:], loops[:2])
    draw_bolt(loops, found)
    return found


def bolt_loops(folder: Path) -> list[Loop]:
    """Steady loops of the bolt, the narrowest first; m and N."""
    loops = []
    for name in ("0p03", "0p05", "0p1"):
        (recording,) = read_loops(
            [folder / f"rousseau2025_loop_steel_amp{name}.csv"],
            columns={"force": "Ftr_kN", "displacement": "delta_mm"},
            units={"force": "kN", "displacement": "mm"},
        )
        loops.append(steady_loops(recording, "displacement")[-1].centred())
    return loops


def draw_bolt(loops: Sequence[Loop], found: Figures) -> None:
    """Picture of the fitted loop, and of those that the same law predicts."""
    name = found["chosen"]
    values = found["models"][name]["values"]
    law = laws.law_named(name)(**{key.split(".")[1]: value for key, value in values.items()})
    with plotting.style():
        figure, axes = plt.subplots(1, 3, figsize=(10.0, 3.4), sharey=True, layout="constrained")
        for panel, loop, what in zip(
            axes, loops[::-1], ("fitted", "predicted", "predicted"), strict=True
        ):
            reach = 0.5 * float(np.ptp(loop.displacement))
            way = reach * np.cos(np.linspace(0.0, 2.0 * np.pi, 201))
            answer = np.asarray(law.path_forces(way))
            panel.plot(
                1e6 * loop.displacement, 1e-3 * loop.force, label="measured", **plotting.DOTS
            )
            panel.plot(1e6 * way, 1e-3 * answer, color=plotting.PALETTE[1], label=f"{name}, {what}")
            panel.set(xlabel="displacement  [um]", title=f"{1e3 * reach:.3f} mm")
            panel.legend(loc="lower right")
        axes[0].set(ylabel="transverse force  [kN]")
        plotting.save(figure, RECORD.with_name("bolt.png"))
        plt.close(figure)


def damper(folder: Path, tension: int = 36) -> Figures:
    """Friction damper with backlash: the middle of three strokes is fitted; mm and kN."""
    loops = []
    for stroke in ("0.5", "1", "1.5"):
        path = folder / f"0.5Hz{tension}lbtension{stroke}amplitude.json"
        rows = np.array(json.loads(path.read_text("utf-8"))["data"])[::10]
        time, displacement, force = rows[:, 0], rows[:, 1] * INCH, rows[:, 2] * KIP
        recording = make_loop(force, displacement, path.stem, time=time)
        loops.append(steady_loops(recording, "displacement", points=200)[-1].centred())
    return study(loops[1:2], [loops[0], loops[2]])


def contact(folder: Path) -> Figures:
    """Reciprocating contact: the steady mean of the first half of the cycles is fitted."""
    (recording,) = read_loops([folder / "reciprocating_contact_early.csv"])
    found = split_cycles(recording, "displacement").cycles
    half = found[len(found) // 2].start
    parts = slice(0, half + 1), slice(half, found[-1].end + 1)
    head, tail = (
        steady_loops(recording.part(part), "displacement", points=200)[-1].centred()
        for part in parts
    )
    return study([head], [tail]) | {"cycles": len(found)}


def cable(folder: Path) -> Figures:
    """First bending of a stranded conductor: every other point is fitted."""
    with (folder / "FLEXION_CARDINAL_H40kN_mu0.7_FOTI.csv").open(encoding="utf-8") as file:
        rows = np.array([[float(text) for text in row] for row in list(csv.reader(file))[1:]])
    curvature, moment = rows.T
    known = Backbone(moment[1::2], curvature[1::2], label="every other point")
    found: Figures = {"models": {}}
    best = np.inf
    for name in MODELS:
        try:
            fit = identify.fit(known, name, throw=False)
        except jb.InputError as error:
            print(f"{name}: {error}")
            continue
        law = fit.law
        told = np.asarray(law.backbone(curvature[::2]))
        off = float(np.sqrt(np.mean((told - moment[::2]) ** 2)) / np.max(moment))
        found["models"][name] = {
            "values": fit.values,
            "misfit": fit.misfit,
            "describes": bool(fit.describes),
            "misfit_of_points_not_fitted": off,
        }
        if fit.misfit < best:
            best, found["chosen"] = fit.misfit, name
    return found | {
        "held_out": {"curvature": rounded(curvature[::2]), "moment": rounded(moment[::2])}
    }


def screws(folder: Path) -> Figures:
    """Cyclic shear tests of screwed sheets by the plain line: exit code and last words of each."""
    paths = sorted(folder.glob("Tao_2016_*-C*.json")) + sorted(folder.glob("Peterman*.json"))
    if not paths:
        raise FileNotFoundError(f"no Tao_2016_*-C*.json or Peterman*.json in {folder}")
    found = {}
    for path in paths:
        test = json.loads(path.read_text("utf-8"))["test"]
        found[path.stem] = plainly(np.array(test["force"]), np.array(test["displacement"]))
    return {"answers": found}


def plainly(force: Floats, displacement: Floats) -> Figures:
    """Ending of ``jbeamshell fit FILE --model iwan4``."""
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "test.csv"
        rows = zip(displacement.tolist(), force.tolist(), strict=True)
        write_text(path, "displacement,force\n" + "".join(f"{u},{f}\n" for u, f in rows))
        said, wrong = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(wrong):
            code = command(["fit", str(path), "--model", "iwan4"])
    lines = (wrong.getvalue().strip() or said.getvalue().strip()).splitlines()
    return {"exit_code": code, "words": lines[-1].replace(str(path), "test.csv") if lines else ""}


def backbones(folder: Path) -> Figures:
    """Computed frequency and damping of a bolted beam: every other amplitude is fitted."""
    found: Figures = {}
    for kind in ("flat", "meso"):
        lines = (folder / f"brb_epmc_{kind}.yaml").read_text("utf-8").splitlines()
        columns = {key.strip(): np.array(json.loads(text)) for key, text in map(_halves, lines)}
        names = ("modal_amplitude", "frequency_rad_per_s", "damping_factor_frac_crit")
        amplitude, omega, damping = (columns[name] for name in names)
        frequency = omega / (2.0 * np.pi)
        curves = [
            FrequencyCurve(amplitude[::2], frequency[::2]),
            DampingCurve(amplitude[::2], damping[::2]),
        ]
        half = 0.5 * omega[0] ** 2
        start = {
            "spring": half,
            "slip_force": half * amplitude[-1],
            "stiffness": half,
            "beta": 1.0,
            "damping_ratio": damping[0],
        }
        free = [Parameter("structure.chi", low=-0.999, high=0.0)]
        model = identify.Assembly(mode, None, start | {"chi": -0.3}, point=0)
        fit = identify.fit(curves, model, [*free, *(f"structure.{name}" for name in start)])
        assert isinstance(fit.scene, identify.Assembly)
        curve = fit.scene.curve(amplitude[1::2])
        found[kind] = {
            "values": fit.values,
            "misfit": fit.misfit,
            "describes": bool(fit.describes),
            "frequency_over_theirs": rounded(np.asarray(curve.frequency) / frequency[1::2]),
            "damping_over_theirs": rounded(np.asarray(curve.damping) / damping[1::2]),
        }
    return found


def _halves(line: str) -> list[str]:
    return line.split(":", 1)


def mode(_: Any, numbers: Mapping[str, jax.Array]) -> dynamics.Structure:
    """Mode of unit mass on a spring and a four-parameter Iwan element, with damping of its own."""
    law = laws.Iwan4(**{name: numbers[name] for name in ("slip_force", "stiffness", "chi", "beta")})
    spring, joint = jnp.reshape(numbers["spring"], (1, 1)), dynamics.Attachment(law, 0)
    return dynamics.Structure([[1.0]], spring, [joint], damping_ratio=numbers["damping_ratio"])


STUDIES: dict[str, Callable[[Path], Figures]] = {
    "bolt": bolt,
    "damper": damper,
    "contact": contact,
    "cable": cable,
    "screws": screws,
    "backbones": backbones,
}


def record(folder: Path, names: Sequence[str] = ()) -> None:
    """Take the studies again, all or some, whose files the folder has, and renew the record."""
    kept: Figures = json.loads(RECORD.read_text("utf-8")) if RECORD.exists() else {}
    for name, take in STUDIES.items():
        if names and name not in names:
            continue
        try:
            kept[name] = take(folder)
        except (FileNotFoundError, jb.InputError) as error:
            print(f"{name}: {error}")
            continue
        write_text(RECORD, json.dumps(kept, indent=1) + "\n")
