"""Faults from outside: whatever is typed, handed over, or found in a file, there is one clear line,
the right exit code, no traceback, no file half-written, and nothing in a file is executed.
"""

import errno
import json
import os
import pathlib
import re
import resource
import subprocess
import sys
import time

import hostile
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import identify
from jbeamshell.cli import arguments, main, terminal
from jbeamshell.common.errors import LONGEST
from jbeamshell.identify import plan_file as plan
from jbeamshell.load_steps import recovery
from jbeamshell.measured import curve_files, curves, loops, steady
from jbeamshell.measured.loop_files import read_loops
from jbeamshell.scene import library
from jbeamshell.scene.keys import KEYS, NUMBERS
from jbeamshell.scene.toml import overridden, scene_from_values

TINY = {
    "model.nodes": 9,
    "model.kinematics": "linear",
    "load.steps_per_half_cycle": 2,
    "load.cycles": 1,
}
BASE = [word for key, value in TINY.items() for word in ("--set", f"{key}={value}")]
SWEEP = ("--over", "load.amplitude=.5")
RUN_IN = np.linspace(0.0, 2.0 * np.pi, 41)
ROOT = str(pathlib.Path(jb.__file__).parents[1])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with good data, to work in."""
    monkeypatch.chdir(tmp_path)
    table = np.column_stack([np.sin(RUN_IN), 1e-4 * np.sin(RUN_IN - 0.3)])
    np.savetxt("good.csv", table, delimiter=",", header="force,displacement", comments="")
    return tmp_path


@pytest.fixture
def fault(capsys):
    """Fault in the way the command line refuses some words; empty if there is none."""

    def fault(*words, code=2):
        before = {place.name for place in pathlib.Path().iterdir()}
        try:
            got = main.main([*map(str, words)])
        except BaseException as error:  # a traceback
            return f"{words} -> {error!r}"[:500]
        out, err = capsys.readouterr()
        line = re.fullmatch(r"jbeamshell: [^\n]+\n", err) and len(err) < LONGEST + 100
        if (got, out) == (code, "") and line:
            fresh = {place.name for place in pathlib.Path().iterdir()} - before
            return f"{words} -> left {fresh}" if fresh else ""
        return f"{words} -> {got}, {out[:80]!r}, {err[:200]!r}"[:500]

    return fault


def refusal(ask, label):
    """Fault in the way the library refuses something; empty if there is none."""
    try:
        found = ask()
    except (jb.InputError, jb.UnconvergedError) as error:
        line = str(error)
        return "" if len(line.splitlines()) == 1 and len(line) <= LONGEST + 10 else f"{label}: long"
    except Exception as error:
        return f"{label}: {error!r}"[:300]
    return f"{label}: gives a {type(found).__name__}"


def none_of(faults):
    found = [fault for fault in faults if fault]
    assert not found, "\n".join([f"{len(found)} faults", *found[:20]])


# --- what is typed and handed over ----------------------------------------------------------------

TYPED = [("strip.length", kind) for kind in hostile.WORDS]
PARTS = {
    jb.Strip: "length height_ratio axial_stiffness poisson_ratio kappa_s far_end layers "
    "plane curvature",
    jb.Contact: "friction pressure bottom_pressure stick_stiffness law normal normal_stiffness",
    jb.Load: "control amplitude cycles steps_per_half_cycle pressure_steps",
    jb.Model: "section kinematics grid nodes constants tolerance by end_size",
    jb.Scene: "strip contact load model",
}


@pytest.mark.parametrize("part", ["strip", "contact", "member", "load", "model"])
def test_what_no_key_takes(part):
    def ask(key, value):
        return lambda: scene_from_values(overridden({}, arguments.assignments([f"{key}={value}"])))

    for key in (key for key in KEYS if key.partition(".")[0] == part):
        none_of(refusal(ask(key, word), (key, kind)) for kind, word in hostile.WORDS.items())
        for kind, value in hostile.OBJECTS.items():
            none_of([refusal(lambda k=key, v=value: jb.Scene().replace({k: v}), (key, kind))])


def test_what_no_part_of_a_scene_takes():
    for part, names in PARTS.items():
        for name in names.split():
            none_of(
                refusal(lambda p=part, n=name, v=value: p(**{n: v}), (name, kind))
                for kind, value in hostile.OBJECTS.items()
            )


def test_what_is_typed_is_refused_in_one_line(folder, fault):
    none_of(fault("run", "--set", f"{key}={hostile.WORDS[kind]}") for key, kind in TYPED)


NAMES = ["", "a\0b", "x" * 300, "\ud800", "x\ny", "block/", "*", "~", "-", ".toml", "/dev/zero"]
NAMES += ["a\0.toml", "x" * 300 + ".toml", "x y.toml", "loop", "here", "/dev/null.toml"]


def test_names_of_no_scene_or_data(folder, fault):
    os.symlink("loop", "loop")
    os.mkdir("here")
    for words in (["run"], ["fit"], ["fit", "--scene"]):
        none_of(fault(*words, name) for name in NAMES)


GOOD = np.cos(RUN_IN), np.sin(RUN_IN)
UP = np.arange(1.0, 12.0)
OPTIONS = ("starts", "noise", "points", "max_iterations", "tolerance", "solver", "save")
ENTRIES = {
    "solve": lambda x: jb.solve(x),
    "path": lambda x: jb.solve(SCENE, x),
    "contact": lambda x: jb.solve(SCENE, contact=x),
    "solver": lambda x: jb.solve(SCENE, solver=x),
    "tolerance": lambda x: jb.solve(SCENE, tolerance=x),
    "get": lambda x: SCENE.get(x),
    "replace": lambda x: SCENE.replace(x),
    "read_scene": lambda x: jb.read_scene(x),
    "write_scene": lambda x: jb.write_scene(SCENE, x),
    "scene_to_toml": lambda x: jb.scene_to_toml(x),
    "read_history": lambda x: jb.read_history(x),
    "named": lambda x: library.named(x),
    "values_from": lambda x: library.values_from(x),
    "sweep": lambda x: jb.sweep(x, {"load.amplitude": [0.5]}),
    "over": lambda x: jb.sweep(SCENE, x),
    "values": lambda x: jb.sweep(SCENE, {"load.amplitude": x}),
    "figures": lambda x: jb.sweep(SCENE, {"load.amplitude": [0.5]}, x),
    "out": lambda x: jb.sweep(SCENE, {"load.amplitude": [0.5]}, out=x),
    "executor": lambda x: jb.sweep(SCENE, {"load.amplitude": [0.5]}, executor=x),
    "solver of a sweep": lambda x: jb.sweep(SCENE, {"load.amplitude": [0.5]}, solver=x),
    "response": lambda x: jb.response(x, ["load.amplitude"]),
    "keys": lambda x: jb.response(SCENE, x),
    "responses": lambda x: jb.response(SCENE, ["load.amplitude"], x),
    "advise": lambda x: jb.advise(x, 0.05),
    "of a part": lambda x: jb.advise(SCENE, x),
    "recordings": lambda x: read_loops(x),
    "columns": lambda x: read_loops("good.csv", columns=x),
    "units": lambda x: read_loops("good.csv", units=x),
    "decimal": lambda x: read_loops("good.csv", decimal=x),
    "curves": lambda x: curve_files.read_curves(x, "squeeze"),
    "kind": lambda x: curve_files.read_curves("good.csv", x),
    "force": lambda x: loops.make_loop(x, RUN_IN),
    "displacement": lambda x: loops.make_loop(RUN_IN, x),
    "steady": lambda x: steady.steady_loops(x),
    "driver": lambda x: steady.steady_loops(loops.make_loop(*GOOD), x),
    "squeeze": lambda x: curves.SqueezeCurve(x, -UP),
    "stress": lambda x: curves.SqueezeCurve(UP, x),
    "backbone": lambda x: curves.Backbone(UP, x),
    "amplitudes": lambda x: curves.DissipationCurve(x, UP),
    "stiffness": lambda x: curves.StiffnessCurve(UP, x),
    "noise of a curve": lambda x: curves.StiffnessCurve(UP, UP, noise=x),
    "weight of a curve": lambda x: curves.StiffnessCurve(UP, UP, weight=x),
    "fit": lambda x: identify.fit(x, SCENE, ["contact.friction"]),
    "scene of a fit": lambda x: identify.fit(loops.make_loop(*GOOD), x, ["contact.friction"]),
    "free": lambda x: identify.fit(loops.make_loop(*GOOD), SCENE, x),
    "one free": lambda x: identify.fit(loops.make_loop(*GOOD), SCENE, [x]),
    "weights": lambda x: identify.fit(
        loops.make_loop(*GOOD), SCENE, ["contact.friction"], weights=x
    ),
    **{
        f"{name} of a fit": lambda x, name=name: identify.fit(
            loops.make_loop(*GOOD), SCENE, ["contact.friction"], **{name: x}
        )
        for name in OPTIONS
    },
    "parameter": lambda x: identify.Parameter(x),
    **{
        f"{name} of a parameter": lambda x, name=name: identify.Parameter(
            "contact.friction", **{name: x}
        )
        for name in ("start", "low", "high", "scale", "prior", "each")
    },
    "plan": lambda x: plan.read_plan(x),
    "values of a plan": lambda x: plan.plan_from_values(x, pathlib.Path()),
}
SCENE = jb.Scene().replace(TINY)
# Python itself writes no number of thousands of digits into a message, and no file can hold one.
ASKABLE = [kind for kind in hostile.OBJECTS if kind != "beyond Python's digits"]
# As good as nothing, or what they seem to be.
HARMLESS = {("weights", "no rows")}


def test_what_no_function_takes(folder):
    for entry, ask in ENTRIES.items():
        none_of(
            refusal(lambda ask=ask, kind=kind: ask(hostile.OBJECTS[kind]), (entry, kind))
            for kind in ASKABLE
            if (entry, kind) not in HARMLESS
        )
    assert [place.name for place in folder.iterdir()] == ["good.csv"]


def test_precision_and_masks_are_minded():
    assert jb.Strip(kappa_s=np.float16(0.5)).kappa_s.dtype == np.float64
    assert jb.Strip(kappa_s=jnp.float16(0.5)).kappa_s.dtype == np.float64
    assert jb.Strip(length=np.int8(3)).length == 3.0
    assert jb.Model(nodes=np.int64(9)).nodes == 9
    masked = np.ma.masked_greater(GOOD[0], 0.99)
    assert loops.make_loop(masked, GOOD[1]).dropped == np.count_nonzero(masked.mask) > 0


@pytest.mark.slow
def test_numbers_at_the_ends_of_what_there_is_give_figures_or_one_line(capsys, monkeypatch):
    monkeypatch.setattr(recovery, "PIECES", ())
    for key in (key for key in NUMBERS if key != "strip.layers"):
        for value in ("5e-324", "1.7e308"):
            code = main.main(["run", *BASE, "--json", "--set", f"{key}={value}"])
            out, err = capsys.readouterr()
            if code == 0:
                figures = json.loads(out, parse_constant=pytest.fail)
                assert figures["status"] == "converged"
                assert "nan" not in err
            else:
                assert (code, out) in ((2, ""), (3, "")), (key, value)
                assert re.fullmatch(r"jbeamshell: [^\n]+\n", err), (key, value, err)


# --- files ----------------------------------------------------------------------------------------


def test_broken_scenes(folder, fault):
    path = folder / "broken file.toml"
    faults = []
    for content in hostile.TOML.values():
        path.write_bytes(content)
        faults += [fault(*words, path) for words in (["run"], ["fit"])]
    none_of(faults)


def test_a_scene_larger_than_memory(folder, fault):
    (folder / "huge.toml").write_bytes(hostile.HUGE)
    none_of([fault("run", "huge.toml")])


def test_plans_that_are_none(folder, fault):
    path, faults = folder / "plan.toml", []
    for text in hostile.PLANS.values():
        path.write_text(text)
        faults.append(fault("fit", path))
    for option in hostile.OPTIONS:
        path.write_text(f"{option}\n{hostile.FREE}[[specimen]]\ndata = ['good.csv']\n")
        faults.append(fault("fit", path))
    none_of(faults)


def test_files_of_a_gigabyte_are_refused_at_once(folder, fault):
    before, begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    *files, state = hostile.giants(folder)
    fit = ["fit", "good.csv", *BASE, "--free", "contact.friction"]
    none_of([*(fault("fit", path) for path in files), fault("run", files[0])])
    none_of([fault(*fit, "--save", state), fault(*fit, "--save", "/dev/full")])
    assert time.process_time() - begin < 10.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000  # kB


# --- places to write to ---------------------------------------------------------------------------

NO_FOLDERS = ["file", "file/x", "broken", "broken/x", "loop", "", "a\0b", "x" * 300, "/dev/null"]
NO_FILES = ["file/x", "none/x", "here", "x" * 300, "a\0b", "/proc/x"]
NO_TABLES = ["file/x.csv", "none/x.csv", "here", "x" * 300 + ".csv", "a\0b.csv", "", "x.txt"]


def test_no_place_for_results(folder, fault):
    (folder / "file").write_text("mine")
    (folder / "here").mkdir()
    os.symlink("nowhere/x", "broken")
    os.symlink("loop", "loop")
    fit = ["fit", "good.csv", *BASE, "--free", "contact.friction"]
    none_of(fault("run", *BASE, "--out", name) for name in NO_FOLDERS)
    none_of(fault(*fit, "--out", name) for name in NO_FOLDERS)
    none_of(fault(*fit, "--save", name) for name in [*NO_FILES, "", "file"])
    none_of(fault("sweep", *BASE, *SWEEP, "--out", name) for name in NO_TABLES)
    plots = [name.replace(".csv", ".png") for name in NO_TABLES if not name.startswith("x" * 9)]
    none_of(fault("sweep", *BASE, *SWEEP, "--plot", name) for name in plots if name)
    assert (folder / "file").read_text() == "mine"


def full(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("at", ["write_text", "replace"])
def test_a_full_disk_leaves_what_was_there(folder, capsys, monkeypatch, at):
    out = folder / "a name with\nmuch in it"
    out.mkdir()
    (out / "loop.csv").write_text("old")
    monkeypatch.setattr(f"pathlib.Path.{at}", full)
    assert main.main(["run", *BASE, "--json", "--out", str(out)]) == 2
    told = capsys.readouterr()
    assert json.loads(told.out)["status"] == "converged"  # what was computed is not lost
    assert told.err.endswith("loop.csv: cannot be written (No space left on device)\n")
    assert told.err.count("Traceback") == 0
    monkeypatch.undo()
    assert [path.name for path in out.iterdir()] == ["loop.csv"]
    assert (out / "loop.csv").read_text() == "old"


def test_a_disk_that_fills_during_a_sweep_loses_nothing(folder, fault, capsys, monkeypatch):
    words = ["sweep", *BASE, "--over", "load.amplitude=.2:1.9:200", "--out", "sweep.csv"]
    write, saved = np.savez, []

    def filling(*arguments, **arrays):
        saved.append(arguments)
        return full() if len(saved) > 3 else write(*arguments, **arrays)

    monkeypatch.setattr("numpy.savez", filling)
    told = fault(*words)
    assert told.endswith("left {'sweep.csv.parts'}"), told
    monkeypatch.undo()
    monkeypatch.chdir(folder)
    monkeypatch.setattr("pandas.DataFrame.to_csv", full)
    assert main.main(words) == 2
    assert "table.csv: cannot be written (No space left on device)" in capsys.readouterr().err
    assert not (folder / "sweep.csv").exists()
    monkeypatch.undo()
    monkeypatch.chdir(folder)
    assert main.main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["notes"] == "200 lanes were done before"
    left = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))
    assert left == ["good.csv", "sweep.csv"]
    assert (folder / "sweep.csv").read_text().count("\n") == 201


# --- as a program ---------------------------------------------------------------------------------


def test_a_full_device_for_standard_output():
    environment = os.environ | {"PYTHONPATH": ROOT}
    with open("/dev/full", "w") as device:
        done = subprocess.run(
            [sys.executable, "-m", "jbeamshell", "scenes"],
            stdout=device,
            stderr=subprocess.PIPE,
            env=environment,
            text=True,
        )
    assert done.returncode == 2
    told = "jbeamshell: standard output: cannot be written (No space left on device)\n"
    assert done.stderr == told


def test_labels_in_letters_that_a_terminal_has_not(monkeypatch, tmp_path):
    path = tmp_path / "out"
    with path.open("w", encoding="ascii") as stream:
        monkeypatch.setattr(sys, "stdout", stream)
        terminal.put("größe\n")
    assert path.read_text() == "gr\\xf6\\xdfe\n"
