"""The command line: one line of complaint with the right exit code, and nothing left behind."""

import functools
import os
import re
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
from tests.command import BASE, options

ROOT = Path(jb.__file__).parent.parent

# --- bad input ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("strip.lenght=2", "unknown key 'strip.lenght': did you mean 'strip.length'?"),
        ("friction=0.2", "unknown key 'friction': did you mean 'contact.friction'?"),
        ("strip.length=long", "strip.length = 'long': must be a number"),
        ("strip.length=", "strip.length = '': must be a number"),
        ("strip.length=[1, 2]", "strip.length = [1.0, 2.0]: give one number, not an array"),
        ("strip.length=-1", "strip.length = -1.0: must be a positive number"),
        ("strip.length=0", "strip.length = 0.0: must be a positive number"),
        ("strip.length=nan", "strip.length = nan: must be a positive number"),
        ("strip.youngs_modulus=-3", "strip.youngs_modulus = -3.0: must be a positive number"),
        ("strip.axial_stiffness=0", "strip.axial_stiffness = 0.0: must be a positive number"),
        ("contact.friction=-.1", "contact.friction = -0.1: must be a number, not negative"),
        ("contact.pressure=[[0,1],[1,-1]]", "must be finite and nowhere negative (no tension)"),
        ("contact.pressure=[[0,1],[1,nan]]", "must be finite and nowhere negative (no tension)"),
        ("contact.pressure=[[1,1],[0,1]]", "its X must not decrease from row to row"),
        ("contact.pressure=[[0,1],[2.5,1]]", "contact.pressure = [2.5]: lies off the strip, whose"),
        ("contact.pressure=[[0,1],[1,1],[1,2],[1,3]]", "gives one X three times; two rows make a"),
        ("strip.layers=steel", "strip.layers = 'steel': give rows [thickness, E, nu] of all"),
        ("strip.layers=[[1, 2, .3]]", "add up to 1, but the height 2H is 0.2252; make them equal"),
        ("strip.layers=[[1, 2, 0.3]]", "add up to 1, but the height 2H is 0.2252; make them equal"),
        ("strip.layers=[[0.2252, 2, 0.5]]", "nu = 0.5 is incompressible: C11 is infinite; give"),
        ("model.squeeze=assumed", "model.squeeze: is no key any more; say model.section = assu"),
        ("model.rung=plane", "model.rung: is no key any more; say model.section: bar, shell, s"),
        ("model.section=p13", "model.section = 'p13': choose 'bar' or 'shell' or 'squeeze' or"),
        ("model.section=v,beta", "model.section = ['v', 'beta']: must be a word"),
        ("contact.smoothing=blunt", "contact.smoothing = 'blunt': must be a number above 1, or"),
        ("strip.poisson_ratio=0.5", "strip.poisson_ratio = 0.5: must lie between -1 and 0.5"),
        ("strip.poisson_ratio=-1", "strip.poisson_ratio = -1.0: must lie between -1 and 0.5"),
        ("strip.far_end=glued", "strip.far_end = 'glued': choose 'guided' or 'pinned' or 'free'"),
        ("load.cycles=1.5", "load.cycles = 1.5: must be a whole number, 0 to"),
        ("load.cycles=-1", "load.cycles = -1: must be a whole number, 0 to"),
        ("load.control=displacement", "load.amplitude = None: give the amplitude"),
        ("model.nodes=2", "model.nodes = 2: must be a whole number, 3 to"),
        ("strip.length", "'strip.length': write KEY=VALUE, such as contact.friction=0.2"),
        ("contact.law=a,b", "contact.law = ['a', 'b']: choose 'elastic-slip' or"),
        (
            "load.amplitude=2.5",
            "load.amplitude = 2.5: must stay below gross slip, mu F_N L = 2; set load.control to "
            "'displacement' or 'arc-length' to go beyond",
        ),
    ],
)
def test_bad_settings_are_refused(refused, setting, told):
    assert told in refused("run", "--set", setting)


LAYERS = {"strip.layers": [[0.1, 1e4, 0.3], [0.1252, 1e5, 0.2]]}
TIPPING = {"contact.bottom_pressure": [[0.0, 0.0], [1.0, 0.0], [1.0, 19.0], [2.0, 19.0]]}


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (
            {"model.section": "bar", "contact.normal": "none"},
            "contact.normal = 'none': needs a section that may lift off: take another model.sect",
        ),
        (
            {"contact.normal": "held", "strip.curvature": 0.1},
            "strip.curvature = 0.1: needs a strip that may lift off: take contact.normal = rigid",
        ),
        (
            {"contact.normal": "held", "model.section": "plane"},
            "contact.normal = 'held': must be rigid for plane elasticity, which may lift off",
        ),
        (
            {"contact.normal": "compliant", "contact.normal_stiffness": 0},
            "contact.normal_stiffness = 0.0: must be a positive number",
        ),
        (
            {"contact.bottom_pressure": 10},
            "contact.bottom_pressure = 10.0: nothing holds the strip down (rigid-body motion)",
        ),
        (
            TIPPING | {"strip.far_end": "pinned"},
            ": the strip tips over (rigid-body motio",
        ),
        (
            {"contact.normal": "none", "strip.far_end": "free"},
            "strip.far_end = 'free': is all that holds a strip without a foundation: take 'guided'",
        ),
        (
            {"contact.friction": 0, "strip.far_end": "free"},
            "contact.friction = 0.0: nothing holds the strip along X (rigid-body mot",
        ),
        *[
            (LAYERS | {key: value}, f"{key} = {value}: strip.layers say it already; leave it out")
            for key, value in [
                ("strip.axial_stiffness", 1e4),
                ("strip.youngs_modulus", 1e4),
                ("strip.poisson_ratio", 0.3),
            ]
        ],
        (LAYERS | {"model.section": "assumed"}, "'assumed': is for a homogeneous strip"),
    ],
)
def test_settings_that_do_not_go_together_are_refused(refused, settings, told):
    assert told in refused("run", *options(settings))


def test_settings_that_say_the_same_are_refused(refused):
    twins = options({"strip.half_height": 0.1, "strip.height_ratio": 0.1})
    assert "strip.half_height and strip.height_ratio say the same" in refused("run", *twins)


@pytest.mark.parametrize("command", [["run"], ["fit", "--scene"]])
@pytest.mark.parametrize(
    ("content", "told"),
    [
        (None, "cannot be read (No such file"),
        ("[strip\n", "is not a TOML file ("),
        ("[stripe]\nlength = 2\n", "unknown section 'stripe'; sections are strip, contact"),
        ("[strip]\nlength = -2\n", "strip.length = -2.0: must be a positive number"),
    ],
)
def test_bad_scenes_are_refused(refused, tmp_path, command, content, told):
    path = tmp_path / "scene.toml"
    if content is not None:
        path.write_text(content)
    line = refused(*command, path)
    assert told in line
    assert "length" in line or str(path) in line


def test_one_line_whatever_a_file_is_called(refused):
    assert refused("run", "no\nsuch.toml").startswith("no such.toml: cannot be read (")


@pytest.mark.parametrize("command", ["run", "fit"])
@pytest.mark.parametrize("name", ["mine.txt", "mine.txt/below"])
def test_a_file_is_no_place_for_results(refused, tmp_path, command, name):
    (tmp_path / "mine.txt").write_text("mine")
    line = refused(command, "--out", tmp_path / name)
    assert f"--out {tmp_path / name}: " in line
    assert line.endswith("mine.txt is a file: name a folder")


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
    assert version.stdout == f"jbeamshell {jb.__version__}\n"
    bad = python("-m", "jbeamshell", "run", "--set", "strip.length=-1")
    assert (bad.returncode, bad.stdout) == (2, "")
    assert bad.stderr == "jbeamshell: strip.length = -1.0: must be a positive number\n"


def test_the_library_is_light_and_leaves_settings_alone():
    code = (
        "import sys, jax, jbeamshell; "
        "print(jax.config.jax_enable_x64, {'matplotlib', 'jaxopt', 'pint'} & set(sys.modules))"
    )
    done = python("-c", code)
    assert (done.returncode, done.stdout) == (0, "False set()\n"), done.stderr
