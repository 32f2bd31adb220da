"""The command line: one line of complaint with the right exit code, and nothing left behind."""

import functools
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import jbeamshell as jb
from jbeamshell.cli import main
from jbeamshell.load_steps import recovery
from jbeamshell.solving import solve as solving
from tests.command import BASE

ROOT = Path(jb.__file__).parent.parent

# --- bad input ----------------------------------------------------------------------------------

FEW = "--set model.nodes=11 --set model.kinematics=linear"
PLANE = "--set model.section=plane --set model.nodes=33"
LAYERS = "--set 'strip.layers=[[0.1, 1e4, 0.3], [0.1252, 1e5, 0.2]]'"
TIPPING = "--set 'contact.bottom_pressure=[[0, 0], [1, 0], [1, 19], [2, 19]]'"
SPECIMEN = "--length 120mm --thickness 12mm --modulus 210GPa --width 50mm"
OVER = "--over load.amplitude=0.5:2.5:3"

# Words of the command line, and a part of the line of complaint.
REFUSED = [
    ("run --set strip.lenght=2", "unknown key 'strip.lenght': did you mean 'strip.length'?"),
    ("run --set friction=0.2", "unknown key 'friction': did you mean 'contact.friction'?"),
    ("run --set strip.length", "'strip.length': write KEY=VALUE, such as contact.friction=0.2"),
    ("run --set strip.length=long", "strip.length = 'long': must be a number"),
    ("run --set strip.length=", "strip.length = '': must be a number"),
    ("run --set 'strip.length=[1, 2]'", "strip.length = [1.0, 2.0]: give one number, not an array"),
    ("run --set strip.length=-1", "strip.length = -1.0: must be a positive number"),
    ("run --set strip.length=nan", "strip.length = nan: must be a positive number"),
    ("run --set strip.youngs_modulus=-3", "strip.youngs_modulus = -3.0: must be a positive number"),
    ("run --set contact.friction=-.1", "contact.friction = -0.1: must be a number, not negative"),
    ("run --set contact.pressure=[[0,1],[1,-1]]", "be finite and nowhere negative (no tension)"),
    ("run --set contact.pressure=[[0,1],[1,nan]]", "be finite and nowhere negative (no tension)"),
    ("run --set contact.pressure=[[1,1],[0,1]]", "its X must not decrease from row to row"),
    ("run --set contact.pressure=[[0,1],[2.5,1]]", "contact.pressure = [2.5]: lies off the strip"),
    ("run --set contact.pressure=[[0,1],[1,1],[1,2],[1,3]]", "gives one X three times; two rows"),
    ("run --set strip.layers=steel", "strip.layers = 'steel': give rows [thickness, E, nu] of all"),
    ("run --set strip.layers=[[1,2,.3]]", "add up to 1, but the height 2H is 0.2252; make them eq"),
    (
        "run --set strip.layers=[[0.2252,2,0.5]]",
        "nu = 0.5 is incompressible: C11 is infinite; give",
    ),
    ("run --set model.squeeze=assumed", "is no key any more; say model.section = assu"),
    ("run --set model.rung=plane", "model.rung: is no key any more; say model.section: bar, shell"),
    ("run --set model.section=p13", "'p13': choose 'bar' or 'shell' or 'squeeze' or"),
    ("run --set model.section=v,beta", "model.section = ['v', 'beta']: must be a word"),
    ("run --set contact.smoothing=blunt", "'blunt': must be a number above 1, or"),
    ("run --set strip.poisson_ratio=0.5", "strip.poisson_ratio = 0.5: must lie between -1 and 0.5"),
    ("run --set strip.far_end=glued", "'glued': choose 'guided' or 'pinned' or 'free'"),
    ("run --set load.cycles=1.5", "load.cycles = 1.5: must be a whole number, 0 to"),
    ("run --set load.control=displacement", "load.amplitude = None: give the amplitude"),
    ("run --set model.nodes=2", "model.nodes = 2: must be a whole number, 3 to"),
    ("run --set contact.law=a,b", "contact.law = ['a', 'b']: choose 'elastic-slip' or"),
    ("run --set load.amplitude=2.5", "load.amplitude = 2.5: must stay below gross slip, mu F_N L"),
    ("run --set strip.half_height=0.1 --set strip.height_ratio=0.1", "height_ratio say the same"),
    ("run --set model.section=bar --set contact.normal=none", "'none': needs a section that may"),
    ("run --set contact.normal=held --set strip.curvature=.1", "0.1: needs a strip that may lift"),
    ("run --set contact.normal=held --set model.section=plane", "must be rigid for plane elastici"),
    ("run --set contact.normal=compliant --set contact.normal_stiffness=0", "0.0: must be a posi"),
    ("run --set contact.bottom_pressure=10", "nothing holds the strip down (rigid-body motion)"),
    (f"run {TIPPING} --set strip.far_end=pinned", ": the strip tips over (rigid-body motio"),
    ("run --set contact.normal=none --set strip.far_end=free", "is all that holds a strip without"),
    ("run --set contact.friction=0 --set strip.far_end=free", "nothing holds the strip along X"),
    *(
        (f"run {LAYERS} --set strip.{key}", "strip.layers say it already; leave it out")
        for key in ("axial_stiffness=1e4", "youngs_modulus=1e4", "poisson_ratio=0.3")
    ),
    (f"run {LAYERS} --set model.section=assumed", "'assumed': is for a homogeneous strip"),
    (f"run {SPECIMEN} --pressure 8MPa", "slides at mu F_N L = 4.8 kN: give a part of it, such"),
    (f"run {SPECIMEN}", "contact.pressure: the specimen is in SI, the standard strip is not: give"),
    ("run --set load.amplitude=2kN", "load.amplitude = '2kN': forces are per width: give --wi"),
    ("run --set strip.length=2kg", "strip.length = '2kg': 'kg' is no unit of it: write m"),
    ("run --set contact.friction=2mm", "contact.friction = '2mm': takes no unit"),
    ("run 'no\nsuch.toml'", "no such.toml: cannot be read ("),
    ("run --out mine.txt", "mine.txt: mine.txt is a file: name a folder"),
    ("fit --out mine.txt/below", "mine.txt/below: mine.txt is a file: name a folder"),
    ("advise --tol 1e-9", "model.tolerance = 1e-09: must lie between 0.0001 and 0.1"),
    ("advise --tol nan", "model.tolerance = nan: must lie"),
    ("advise --set load.amplitude=3", "load.amplitude = 3.0: must stay below gross slip"),
    ("advise bimaterial --set model.section=bar", "contact.normal = 'none': needs a section"),
    (f"export {PLANE} --to table --force 5", "gross slip"),
    (f"export {PLANE} --to table --width 0", "width = 0.0"),
    (f"export {PLANE} --to table --units mm", "name those of length and force"),
    (f"export {PLANE} --to opensees", "end the name of a file for 'opensees' in .py"),
    (f"ringdown {FEW} --density -1", "inertia.density = -1.0"),
    (f"ringdown {FEW} --force 5", "gross slip"),
    (f"ringdown {FEW} --payload 0", "payload = 0.0"),
    (f"ringdown {FEW} --cycles 0", "cycles = 0.0"),
    (f"ringdown {FEW} --strip whole --set model.section=plane", "model.section = 'plane'"),
    (f"ringdown {FEW} --strip sliders --set contact.smoothing=8", "no sliders"),
    ("sweep --over contact.law=1", "no single number"),
    (f"sweep {OVER} --paired --over contact.friction=0.1,0.2", "equally many"),
    (f"sweep {OVER} --figures nonsense", "choose"),
    ("sweep --json --over load.amplitude=0:1:600000", "3,000,000 numbers are more than"),
    (f"sweep {OVER} --processes 2", "--processes: is no option any more"),
    (f"sweep {OVER} --out folder", "end the name in .csv"),
    (f"sweep {OVER} --plot nowhere/sweep.png", "there is no folder nowhere"),
    (f"sweep {OVER} --plot sweep.doc", "end the name in .png"),
    (f"sweep {OVER} --dask nowhere", "--dask nowhere: finds no dask scheduler there"),
    (f"sweep no-such-scene {OVER}", "no-such-scene"),
    ("fit --free ''", "free: name at least one key, such as contact.friction"),
    ("fit --free contact.mu", "unknown key 'contact.mu': "),
    ("fit --free contact.friction,contact.friction", "names a key twice"),
    ("fit --free load.amplitude", "free 'load.amplitude': is not a parameter of the strip"),
    ("fit --free model.nodes", "free 'model.nodes': is not a parameter of the strip"),
    ("fit --free contact.smoothing", "is 'sharp' in this scene; give a number"),
    ("fit --start strip.kappa_s=1", "--start strip.kappa_s: is not among the free keys cont"),
    ("fit --start contact.friction", "'contact.friction': write KEY=VALUE, such as"),
    ("fit --start contact.friction=high", "start = 'high': give a finite number"),
    ("fit --start contact.friction=-1", "contact.friction = -1.0: must be a number, not"),
    ("fit --bounds contact.friction=0.2", "--bounds contact.friction=0.2: write two numbers"),
    ("fit --bounds contact.friction=0.2:0.3", "start = 0.15: must lie between low = 0.2"),
    ("fit --prior contact.friction=0.1:a", "write two numbers with a colon between"),
    ("fit --profile strip.kappa_s", "--profile strip.kappa_s: is not among the free keys"),
    ("fit --noise -1", "noise = -1.0: give a positive part of the range"),
    ("fit --starts 0", "starts = 0: must be a whole number, 1 to"),
    ("fit plan.toml", "plan.toml: cannot be read (No such file"),
    ("fit plan.toml a.csv", "plan.toml a.csv: give one plan, or files of data"),
    ("fit plan.toml --kind loop", "--kind: plan.toml is a plan; write this into the plan"),
    ("fit a.csv --kind lop", "kind = 'lop': choose among 'loop', 'backbone'"),
    ("fit a.csv --unit kN", "'kN': write KEY=VALUE, such as force=kN"),
    ("fit --set load.control=stress", "load.control = 'stress': choose 'force' or 'displ"),
    ("fit --set load.control=a,b", "load.control = ['a', 'b']: must be a word"),
    ("fit --set contact.pressure=1", "contact.friction = 0.15: slides at mu F_N L = 0.3"),
    ("fit no.csv", "no.csv: cannot be read (No such file"),
    ("fit empty.csv", "empty.csv: is empty: give a header and rows"),
    ("fit word.csv", "word.csv: line 3, column 'displacement' holds 'x'"),
    ("fit travel.csv", "travel.csv: needs one column named 'displacement' in line 1"),
    *(
        (f"{command} {scene}", told)
        for command in ("run", "fit --scene")
        for scene, told in (
            ("none.toml", "none.toml: cannot be read (No such file"),
            ("cut.toml", "cut.toml: is not a TOML file ("),
            ("stripe.toml", "unknown section 'stripe'; sections are strip, contact"),
            ("short.toml", "strip.length = -2.0: must be a positive number"),
            ("recedng", "unknown scene 'recedng': did you mean 'receding'? (`jbeamshell scenes` l"),
            ("point_load", "unknown scene 'point_load': did you mean 'point-load'? (`jbeamshell"),
            ("block.tml", "unknown scene 'block.tml': did you mean 'block'? (`jbeamshell scenes`"),
            ("xyz", "unknown scene 'xyz': scenes are standard, calibrated, bimaterial, squeezed"),
            ("./receding", "receding: cannot be read (No such file"),
            (".", ".: cannot be read (Is a directory)"),
            ("long" * 100, "unknown scene 'long"),
        )
    ),
]
FILES = {
    "mine.txt": "mine",
    "empty.csv": "",
    "word.csv": "force,displacement\n1,2\n1,x\n",
    "travel.csv": "force,travel\n1,2\n",
    "cut.toml": "[strip\n",
    "stripe.toml": "[stripe]\nlength = 2\n",
    "short.toml": "[strip]\nlength = -2\n",
}


@pytest.mark.parametrize(("words", "told"), REFUSED)
def test_bad_input_is_one_line(refused, tmp_path, monkeypatch, words, told):
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    assert told in refused(*shlex.split(words))


@pytest.mark.parametrize("words", [[], ["walk"], ["run", "--sett", "a=1"], ["run", "a", "b"]])
def test_commands_that_do_not_exist(cli, capsys, words):
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
    # One Newton iteration per step: enough for the pressure and for sticking, not for slip.
    monkeypatch.setattr(solving, "Newton", functools.partial(jb.Newton, max_iterations=1))
    monkeypatch.setattr(recovery, "PIECES", ())
    line = refused("run", *BASE, "--set", "contact.smoothing=16", "--json", code=3)
    pattern = r"load step \d+ of 20 \(load \S+\) found no equilibrium \(max iterations, .*\): take"
    assert re.match(pattern, line)
    assert "more load.steps_per_half_cycle, softer sliders (contact.stick_stiffness" in line


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
