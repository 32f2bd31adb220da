"""The command line: one line of complaint with the right exit code, and nothing left behind."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import pytest

import jbeamshell as jb
from jbeamshell.cli import arguments, main, terminal
from jbeamshell.solving import solve as solving
from jbeamshell.solving.advice import within

ROOT = Path(jb.__file__).parent.parent

# --- bad input ----------------------------------------------------------------------------------

SPECIMEN = "--length 120mm --thickness 12mm --modulus 210GPa --width 50mm"
OVER = "--over load.amplitude=0.5:2.5:3"

# What the command line alone refuses, a row for each way in; scenes, tables and fits are refused in
# the tests of the library.
REFUSED = [
    ("run --set strip.lenght=2", "unknown key 'strip.lenght': did you mean 'strip.length'?"),
    ("run --set strip.length", "'strip.length': write KEY=VALUE, such as contact.friction=0.2"),
    ("run --set strip.length=", "strip.length = '': must be a number"),
    ("run --set 'strip.length=[1, 2]'", "strip.length = [1.0, 2.0]: give one number, not an array"),
    (f"run {SPECIMEN} --pressure 8MPa", "slides at mu F_N L = 4.8 kN: give a part of it, such"),
    (f"run {SPECIMEN}", "contact.pressure: the specimen is in SI, the standard strip is not: give"),
    ("run --set load.amplitude=2kN", "load.amplitude = '2kN': forces are per width: give --wi"),
    ("run --set strip.length=2kg", "strip.length = '2kg': 'kg' is no unit of it: write m"),
    ("run --set contact.friction=2mm", "contact.friction = '2mm': takes no unit"),
    ("run 'no\nsuch.toml'", "no such.toml: cannot be read ("),
    ("run --out mine.txt", "mine.txt: mine.txt is a file: name a folder"),
    ("run .", ".: cannot be read (Is a directory)"),
    ("run ./receding", "receding: cannot be read (No such file"),
    ("run point_load", "unknown scene 'point_load': did you mean 'point-load'? (`jbeamshell"),
    ("run block.tml", "unknown scene 'block.tml': did you mean 'block'? (`jbeamshell scenes`"),
    ("advise --tol 1e-9", "model.tolerance = 1e-09: must lie between 0.0001 and 0.1"),
    ("ringdown --set model.section=plane --payload 0", "payload = 0.0"),
    ("ringdown --set model.section=plane --cycles 0", "cycles = 0.0"),
    ("sweep --json --over load.amplitude=0:1:600000", "3,000,000 numbers are more than"),
    (f"sweep {OVER} --processes 2", "--processes: is no option any more"),
    (f"sweep {OVER} --plot nowhere/sweep.png", "there is no folder nowhere"),
    (f"sweep {OVER} --plot sweep.doc", "end the name in .png"),
    (f"sweep {OVER} --dask nowhere", "--dask nowhere: finds no dask scheduler there"),
    ("fit --out mine.txt/below", "mine.txt/below: mine.txt is a file: name a folder"),
    ("fit --scene cut.toml", "cut.toml: is not a TOML file ("),
    ("fit --free ''", "free: name at least one key, such as contact.friction"),
    ("fit --free contact.friction,contact.friction", "names a key twice"),
    ("fit --free load.amplitude", "free 'load.amplitude': is not a parameter of the strip"),
    ("fit --free contact.smoothing", "is 'sharp' in this scene; give a number"),
    ("fit --start strip.kappa_s=1", "--start strip.kappa_s: is not among the free keys cont"),
    ("fit --start contact.friction=-1", "contact.friction = -1.0: must be a number, not"),
    ("fit --bounds contact.friction=0.2", "--bounds contact.friction=0.2: write two numbers"),
    ("fit --prior contact.friction=0.1:a", "write two numbers with a colon between"),
    ("fit --profile strip.kappa_s", "--profile strip.kappa_s: is not among the free keys"),
    ("fit --set contact.pressure=1", "contact.friction = 0.15: slides at mu F_N L = 0.3"),
    ("fit plan.toml", "plan.toml: cannot be read (No such file"),
    ("fit plan.toml a.csv", "plan.toml a.csv: give one plan, or files of data"),
    ("fit plan.toml --kind loop", "--kind: plan.toml is a plan; write this into the plan"),
    ("fit a.csv --unit kN", "'kN': write KEY=VALUE, such as force=kN"),
    ("fit word.csv", "word.csv: line 3, column 'displacement' holds 'x'"),
]
FILES = {
    "mine.txt": "mine",
    "word.csv": "force,displacement\n1,2\n1,x\n",
    "cut.toml": "[strip\n",
}


def test_bad_input_is_one_line(refused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    for words, told in REFUSED:
        assert told in refused(*shlex.split(words)), words


def test_commands_that_do_not_exist(cli, capsys):
    for words in ([], ["walk"], ["run", "--sett", "a=1"], ["run", "a", "b"]):
        with pytest.raises(SystemExit) as caught:
            cli(*words)
        assert caught.value.code == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert "usage: jbeamshell" in err


def test_an_interrupt_within_the_hook_of_the_collector_is_not_lost():
    def _xla_gc_callback():
        main._interrupt(signal.SIGINT, sys._getframe())

    before = signal.signal(signal.SIGINT, main._interrupt)
    try:
        _xla_gc_callback()
        with pytest.raises(KeyboardInterrupt):
            time.sleep(5.0)
    finally:
        signal.signal(signal.SIGINT, before)


def test_options_that_messages_name_exist():
    commands = next(a for a in main._parser()._actions if a.choices).choices.values()
    known = {option for command in commands for option in command._option_string_actions}
    named = set()
    for file in (ROOT / "jbeamshell").rglob("*.py"):
        # Options of XLA and of pythonfmu, and a missing number.
        if file.name not in ("jax_options.py", "fmu.py", "text_tables.py"):
            named |= set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", file.read_text("utf-8")))
    assert {"--drift", "--reverse", "--column", "--unit"} <= named
    assert named <= known | {"--version"}


# --- what goes wrong later ----------------------------------------------------------------------


def test_a_step_without_equilibrium(refused, monkeypatch):
    def unconverged(*_, **__):
        raise jb.UnconvergedError("load step 3 found no equilibrium: take more")

    monkeypatch.setattr(solving, "run", unconverged)
    line = refused("run", "--json", code=3)
    assert line == "load step 3 found no equilibrium: take more"


def test_an_interruption(refused, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(solving, "check", interrupted)
    assert refused("run", code=130) == "interrupted; no file is left half-written"


def test_a_program_ends_without_taking_python_down(monkeypatch, capsys):
    def ended(code):
        raise SystemExit(f"ended with {code}")

    monkeypatch.setattr(main.os, "_exit", ended)
    monkeypatch.setattr(main.gc, "set_threshold", lambda *_: None)
    monkeypatch.setattr(main.signal, "signal", lambda *_: None)
    for code in (130, 2, 0):
        monkeypatch.setattr(main, "main", lambda code=code: code)
        with pytest.raises(SystemExit, match=f"^ended with {code}$"):
            main.program()


# --- advice ---------------------------------------------------------------------------------------


def test_advice_as_json_and_in_words(cli):
    code, out, err = cli("advise", "--tol", "0.05", "--json")
    told = json.loads(out)
    assert (code, err) == (0, "")
    assert told["settings"]["model.section"] == "plane"
    assert told["settings"]["model.kinematics"] == "linear"
    assert (told["tolerance"], told["to"]) == (0.05, "plane elasticity")
    code, out, _ = cli("advise", "--set", "strip.height_ratio=0.4", "--set", "load.amplitude=0.3")
    assert code == 0
    assert out.startswith("section plane on its contact line, ")
    assert "for 1 % of plane elasticity: the scene has all that plane elasticity needs" in out
    given = main._parser().parse_args(["run", "--tol", "0.03"])
    assert within(arguments.scene_of(given), given.tol).model.tolerance == 0.03


def test_doubts_are_one_line_each(capsys):
    with terminal.doubts_in_lines():
        for text in ("doubtful: few\nnodes", "doubtful: few\nnodes", "doubtful: soft"):
            warnings.warn(text, jb.DoubtfulWarning, stacklevel=1)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [f"jbeamshell: warning: doubtful: {end}" for end in ("few nodes", "soft")]


# --- as a program -------------------------------------------------------------------------------


def python(*words):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, *words]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_the_program():
    version = python("-m", "jbeamshell", "--version")
    assert (version.returncode, version.stderr) == (0, "")
    assert version.stdout.startswith(f"jbeamshell {jb.__version__}: load paths are walked in ")
    bad = python("-m", "jbeamshell", "run", "--set", "strip.length=-1")
    assert (bad.returncode, bad.stdout) == (2, "")
    assert bad.stderr == "jbeamshell: strip.length = -1.0: must be a positive number\n"
