"""The command line: JSON on stdout and nothing else, files only when all went well, one line of
complaint with the right exit code when not.
"""

import csv
import functools
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import identify
from jbeamshell.cli import arguments, main
from jbeamshell.measured.loops import read_loops
from jbeamshell.quasistatic import recovery, solver
from jbeamshell.scene import library
from jbeamshell.scene.keys import TABLE

# One shape for nearly everything, so that it compiles once.
COARSE = {
    "model.nodes": 21,
    "model.kinematics": "linear",
    "load.steps_per_half_cycle": 8,
    "load.cycles": 1,
}
TRUE = {"contact.friction": 0.12, "strip.height_ratio": 0.2}
# Of the standard strip, which data with units do not mean unless they are given.
KNOWN = {"strip.length": 2.0, "strip.axial_stiffness": 3.4e4, "contact.pressure": 10.0}
OFF = {"contact.friction": 0.084, "strip.height_ratio": 0.26}  # by 30 %
FIGURES = {
    *("dissipation", "dissipation_loop", "dissipation_ratio", "secant_stiffness", "loss_factor"),
    *("peak_displacement", "slip_length", "reaction_min", "closure", "newton_iterations"),
    *("reaction_max", "reaction_max_at", "squeeze_stress_max", "status", "wall_s", "compile_s"),
    *("contact_end", "lift_slope", "tip_deflection", "doubts"),
}
TIMES = {"wall_s", "compile_s"}
TABLES = {"loop.csv", "profiles.csv", "sections.csv", "result.json", "scene.toml"}
RUN_FILES = TABLES | {"loop.png", "profiles.png", "contact.png"}
FIT_FILES = {"overlay.csv", "overlay.png", "residuals.png", "result.json", "scene.toml"}


def options(values, name="--set"):
    return [word for key, value in values.items() for word in (name, f"{key}={value}")]


BASE = options(COARSE)


@pytest.fixture
def cli(capsys):
    def cli(*words):
        code = main.main([*map(str, words)])
        out, err = capsys.readouterr()
        # Coarse grids are doubted, and rightly.
        lines = (line for line in err.splitlines(True) if "the dissipation may be off" not in line)
        return code, out, "".join(lines)

    return cli


@pytest.fixture
def refused(cli, tmp_path):
    """Runs a command that must fail with one line on stderr and leave nothing; returns the line."""

    def refused(*words, code=2):
        def held():
            return {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}

        before = held()
        words = [*words] if "--out" in words else [*words, "--out", tmp_path / "new" / "out"]
        got, out, err = cli(*words)
        assert (got, out) == (code, "")
        assert re.fullmatch(r"jbeamshell: [^\n]+\n", err), err
        assert "Traceback" not in err
        assert held() == before
        assert not (tmp_path / "new").exists()
        return err.removeprefix("jbeamshell: ").rstrip()

    return refused


def names(folder):
    return {path.name for path in folder.iterdir()}


def is_png(path):
    return path.read_bytes().startswith(b"\x89PNG\r\n")


# --- run ----------------------------------------------------------------------------------------


def test_run_prints_one_json_object(cli):
    code, out, err = cli("run", *BASE, "--json")
    assert (code, err) == (0, "")
    figures = json.loads(out)
    assert set(figures) == FIGURES
    words = {"status", "newton_iterations", "doubts"}
    assert all(isinstance(figures[key], float) for key in FIGURES - words)
    assert isinstance(figures["newton_iterations"], int)
    assert figures["status"] == "converged"
    history = jb.solve(jb.Scene().replace(COARSE))
    assert {k: v for k, v in figures.items() if k not in TIMES} == history.figures()


def test_run_prints_text_to_read(cli):
    code, out, err = cli("run", *BASE, *options({"strip.height_ratio": 0.2, "load.amplitude": 0.5}))
    assert (code, err) == (0, "")
    title, chosen, *lines = out.splitlines()
    assert "v w beta psi on 21 nodes" in title
    assert chosen == "chosen for a tolerance of 0.5 %: rung condensed-squeeze"
    assert "eta = 0.2, force amplitude 0.5" in title
    figures = [line for line in lines if not line.startswith("  doubtful: ")]
    names = {line.split("  ")[1].replace(" ", "_") for line in figures}
    assert names == FIGURES - TIMES - {"doubts"}
    assert figures[-1].split() == ["status", "converged"]
    assert len(figures) < len(lines)
    with pytest.raises(json.JSONDecodeError):
        json.loads(out)


def test_run_leaves_what_runs_again_to_the_last_bit(cli, tmp_path):
    folder = tmp_path / "new" / "run"
    third = 1.0 / 30.0 + 0.1
    words = (*BASE, "--set", f"contact.friction={third}")
    code, out, err = cli("run", *words, "--json", "--out", folder)
    assert code == 0
    assert names(folder) == RUN_FILES
    assert err.startswith("wrote ")
    assert err.count("\n") == 1
    assert all(str(folder / name) in err for name in RUN_FILES)
    first = json.loads(out)
    assert json.loads((folder / "result.json").read_text()) == first
    assert all(is_png(path) for path in folder.glob("*.png"))
    with (folder / "loop.csv").open(newline="") as table:
        rows = list(csv.DictReader(table))
    assert len(rows) == 21
    assert max(float(row["force"]) for row in rows) == 0.7855

    code, out, _ = cli("run", folder / "scene.toml", "--json")
    assert code == 0
    again = json.loads(out)
    assert {k: again[k] for k in FIGURES - TIMES} == {k: first[k] for k in FIGURES - TIMES}
    assert jb.read_scene(folder / "scene.toml").contact.friction == third


def test_set_overrides_the_file_and_an_alias_its_twin(cli, tmp_path):
    scene = tmp_path / "scene.toml"
    sections = "[strip]\nheight_ratio = 0.1\nlength = 4.0\n[load]\namplitude = 0.5\ncycles = 1\n"
    scene.write_text(sections + "steps_per_half_cycle = 8\n")
    model = options({k: v for k, v in COARSE.items() if k.startswith("model")})
    _, out, _ = cli("run", scene, *model)
    assert "eta = 0.1, force amplitude 0.5\n" in out
    _, out, _ = cli("run", scene, *model, *options({"load.amplitude": 0.625}))
    assert "eta = 0.1, force amplitude 0.625\n" in out
    _, out, _ = cli("run", scene, *model, *options({"strip.half_height": 0.3}))
    assert "eta = 0.15, force amplitude 0.5\n" in out


def test_words_numbers_and_lists_of_the_command_line():
    texts = ["a = 3", "b=.5", "c=8.", "d=inf", "e=free", "f=v,beta", "g=[1, [.2, 3.]]", 'h="v"']
    values = arguments.assignments([*texts, "i=a=b", "model.fields=v", "k=true"])
    assert values == dict(
        zip(
            "abcdefghi",
            [3, 0.5, 8.0, np.inf, "free", ["v", "beta"], [1, [0.2, 3.0]], "v", "a=b"],
            strict=True,
        ),
        **{"model.fields": ["v"], "k": True},
    )
    assert isinstance(values["a"], int)


def test_what_to_be_wary_of_is_told_on_stderr(cli, monkeypatch):
    suspect = ("the last loop does not close", "tension at the contact")
    monkeypatch.setattr(jb.History, "doubts", suspect)
    code, out, err = cli("run", *BASE, "--json")
    assert code == 0
    assert set(json.loads(out)) == FIGURES
    assert json.loads(out)["doubts"] == list(suspect)
    assert err.splitlines() == [f"jbeamshell: warning: {doubt}" for doubt in suspect]


def test_a_reader_that_leaves_early_costs_no_files(monkeypatch, tmp_path):
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        assert main.main(["run", *BASE, "--out", str(tmp_path)]) == 0
    assert names(tmp_path) == RUN_FILES


# --- help -----------------------------------------------------------------------------------------


def test_all_keys_are_listed_and_help_points_to_the_list(cli, capsys):
    code, out, err = cli("keys")
    assert (code, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines() if not line.startswith(" ")][1:] == [
        *TABLE
    ]
    for command in ("run", "sweep", "fit", "advise", "ringdown"):
        with pytest.raises(SystemExit, match="0"):
            cli(command, "--help")
        assert "`jbeamshell keys`" in " ".join(capsys.readouterr().out.split())


# --- scenes that ship ---------------------------------------------------------------------------

PRESSED = {"newton_iterations", "status", "doubts", *TIMES}


def test_scenes_are_listed_with_a_line_each(cli):
    code, out, err = cli("scenes")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert [line.split()[0] for line in lines] == list(library.NAMES)
    assert all(len(line) < 110 and line.endswith(".") for line in lines)
    code, out, err = cli("scenes", "--json")
    assert (code, err) == (0, "")
    assert json.loads(out) == {name: library.summary(name) for name in library.NAMES}


def test_a_bent_laminate_by_name(cli):
    code, out, err = cli("run", "bimaterial", "--json", "--set", "model.nodes=41")
    assert (code, err) == (0, "")
    figures = json.loads(out)
    assert set(figures) == {"curvature", "tip_deflection", "squeeze_stress_max"} | PRESSED
    curvature = 0.0312604e-4  # per mm, at 1e-4 of the soft layer's modulus
    assert figures["curvature"] == pytest.approx(curvature, rel=1e-5)
    assert figures["tip_deflection"] == pytest.approx(0.5 * curvature * 100.0**2, rel=1e-5)
    assert figures["squeeze_stress_max"] == pytest.approx(0.209)


def test_a_scene_without_cycles_by_name(cli, tmp_path):
    code, out, err = cli("run", "block", "--json", "--set", "model.nodes=41", "--out", tmp_path)
    assert code == 0
    assert "warning" not in err
    figures = json.loads(out)
    contact = {"contact_end", "tip_deflection", "lift_slope", "reaction_max", "reaction_max_at"}
    assert set(figures) == contact | {"squeeze_stress_max"} | PRESSED
    assert figures["contact_end"] == 1.0
    assert figures["reaction_max"] == pytest.approx(100.0)
    assert figures["squeeze_stress_max"] == pytest.approx(100.0)
    assert names(tmp_path) == TABLES | {"contact.png"}
    assert is_png(tmp_path / "contact.png")
    with (tmp_path / "loop.csv").open(newline="") as table:
        (row,) = csv.DictReader(table)
    assert (row["force"], row["pressure"], row["contact_end"]) == ("0.0", "1.0", "1.0")


def test_the_standard_strip_without_cycles(cli):
    pressure = [[0.0, 10.0], [1.0, 10.0], [1.0, 0.0], [2.0, 0.0]]
    settings = COARSE | {"load.cycles": 0, "contact.pressure": pressure}
    code, out, err = cli("run", "standard", *options(settings), "--json")
    assert code == 0
    figures = json.loads(out)
    assert set(figures) == {"reaction_max", "reaction_max_at", "squeeze_stress_max"} | PRESSED
    # It cannot lift, so the part that nothing presses is pulled down.
    assert re.fullmatch(r"jbeamshell: warning: tension at the contact \([^\n]*\n", err)
    assert "add w to model.fields" in err


def test_a_file_goes_before_a_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "receding").mkdir()
    assert library.values_from("receding") == library.values_of("receding")
    (tmp_path / "block").write_text("[strip]\nlength = 3.0\n")
    assert library.values_from("block") == {"strip.length": 3.0}


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("recedng", "unknown scene 'recedng': did you mean 'receding'? (`jbeamshell scenes` lists"),
        ("point_load", "unknown scene 'point_load': did you mean 'point-load'? (`jbeamshell scen"),
        (
            "block.tml",
            "unknown scene 'block.tml': did you mean 'block'? (`jbeamshell scenes` lists",
        ),
        ("xyz", "unknown scene 'xyz': scenes are standard, calibrated, bimaterial, squeezed"),
        ("receding.toml", "receding.toml: cannot be read (No such file"),
        ("./receding", "receding: cannot be read (No such file"),
        (".", ".: cannot be read (Is a directory)"),
        ("long" * 100, "unknown scene 'long"),
    ],
)
@pytest.mark.parametrize("command", [["run"], ["fit", "--scene"]])
def test_unknown_scenes_are_refused(refused, command, word, told):
    assert refused(*command, word).startswith(told)


# --- fit ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def planted(tmp_path_factory):
    """Files of a run, as data: first loading and one cycle of a strip with planted parameters."""
    folder = tmp_path_factory.mktemp("data")
    assert main.main(["run", *BASE, *options(TRUE), "--out", str(folder)]) == 0
    return folder / "loop.csv"


@pytest.fixture(scope="module")
def closed(planted):
    """Its cycle alone, in kN and micrometres."""
    loop = read_loops(planted)[0]
    path = planted.with_name("closed.csv")
    rows = zip(loop.force[4:] * 1e-3, loop.displacement[4:] * 1e6, strict=True)
    lines = [
        "displacement [um];force [kN]",
        *(f"{u!r};{f!r}" for f, u in np.array([*rows]).tolist()),
    ]
    path.write_text("\n".join(lines))
    return path


FIT = (*BASE, *options(OFF, "--start"))


def test_fit_finds_what_was_planted(cli, planted, tmp_path):
    folder = tmp_path / "new" / "fit"
    code, out, err = cli("fit", planted, *FIT, "--json", "--out", folder)
    assert code == 0
    figures = json.loads(out)
    assert {"values", "misfit", "status", "model_runs", "wall_s"} <= set(figures)
    assert list(figures["values"]) == list(TRUE)
    for key, value in TRUE.items():
        assert figures["values"][key]["value"] == pytest.approx(value, rel=1e-2)
        assert 0.0 <= figures["values"][key]["error"] < 0.01 * value
    assert figures["status"] == "converged"
    assert figures["misfit"] < 1e-3
    assert isinstance(figures["model_runs"], int)
    assert 2 < figures["model_runs"] < 40
    assert figures["wall_s"] > 0.0
    # The unexplained rest is rounding here, and the correlation is a number all the same.
    np.testing.assert_allclose(np.diag(figures["correlation"]), 1.0)

    assert names(folder) == FIT_FILES
    assert all(str(folder / name) in err for name in FIT_FILES)
    assert json.loads((folder / "result.json").read_text()) == figures
    assert is_png(folder / "overlay.png")
    with (folder / "overlay.csv").open(newline="") as table:
        rows = list(csv.DictReader(table))
    data = read_loops(planted)[0]
    for name in ("force", "displacement"):
        np.testing.assert_array_equal([float(row[name]) for row in rows], getattr(data, name))
    model = np.array([float(row["model_displacement"]) for row in rows])
    assert np.max(np.abs(model - data.displacement)) < 1e-3 * np.ptp(data.displacement)

    # The fitted scene runs as it is, at the amplitude of the data.
    code, out, _ = cli("run", folder / "scene.toml", "--json")
    assert code == 0
    loop = json.loads((planted.parent / "result.json").read_text())
    assert json.loads(out)["dissipation"] == pytest.approx(loop["dissipation"], rel=1e-2)


def test_fit_prints_text_to_read(cli, planted):
    code, out, err = cli("fit", planted, *FIT)
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert re.fullmatch(r"  contact.friction +0\.1[12]\d* \+- \S+", lines[0])
    assert re.fullmatch(r"  strip.height_ratio +0\.(2|19)\d* \+- \S+", lines[1])
    assert re.fullmatch(r"  misfit \S+ % of the range", lines[2])
    assert re.fullmatch(r"  converged after \d+ model runs", lines[3])
    assert lines[-1] == "  the force drives these loops (set load.control to change it)"


def test_a_fit_that_does_not_settle(refused, planted, monkeypatch):
    hasty = functools.partial(identify.fit, max_iterations=1)
    monkeypatch.setattr(identify, "fit", hasty)
    line = refused("fit", planted, *FIT, "--json", code=3)
    assert line.startswith("the fit has not converged after 1 iterations, at contact.friction = ")


@pytest.mark.slow
def test_fit_driven_by_the_displacement(cli, closed, tmp_path):
    drive = options(KNOWN | {"load.control": "displacement", "load.amplitude": 2e-5})
    code, out, _ = cli("fit", closed, *FIT, *drive, "--json", "--out", tmp_path)
    assert code == 0
    values = json.loads(out)["values"]
    for key, value in TRUE.items():
        assert values[key]["value"] == pytest.approx(value, rel=1e-2)
    load = tomllib.loads((tmp_path / "scene.toml").read_text())["load"]
    assert (load["control"], load["amplitude"]) == ("displacement", 2e-5)


def test_a_plan_of_two_strips_is_fitted_profiled_saved_and_resumed(cli, closed, tmp_path):
    plan = tmp_path / "plan.toml"
    given = (COARSE | KNOWN).items()
    settings = "".join(f'"{key}" = {json.dumps(value)}\n' for key, value in given)
    plan.write_text(
        f"[set]\n{settings}"
        f"""
        [free."contact.friction"]
        start = 0.084
        [free."strip.height_ratio"]
        start = 0.26
        each = true
        [[specimen]]
        label = "a"
        data = ["{closed}"]
        [[specimen]]
        label = "b"
        data = ["{closed}"]
        """
    )
    words = ("fit", plan, "--json", "--save", tmp_path / "state", "--profile", "contact.friction")
    code, out, _ = cli(*words, "--noise", 0.001, "--out", tmp_path / "out")
    assert code == 0
    figures = json.loads(out)
    keys = ["contact.friction", "strip.height_ratio[a]", "strip.height_ratio[b]"]
    assert list(figures["values"]) == keys
    for key, value in zip(keys, (0.12, 0.2, 0.2), strict=True):
        assert figures["values"][key]["value"] == pytest.approx(value, rel=1e-2)
    low, high = figures["profiles"]["contact.friction"]["interval"]
    assert low < figures["values"]["contact.friction"]["value"] < high
    made = names(tmp_path / "out")
    assert {"scene_1.toml", "scene_2.toml", "profiles.csv", "profiles.png"} < made
    # The state holds every run: the same again asks the model nothing.
    states = (tmp_path / "state").read_text()
    code, out, _ = cli(*words, "--noise", 0.001)
    assert code == 0
    assert json.loads(out)["values"] == figures["values"]
    assert (tmp_path / "state").read_text() == states


# --- what a fit is asked to do --------------------------------------------------------------------


class Asked(Exception):
    """Carries what `identify.fit` was called with."""


@pytest.fixture
def asked(monkeypatch):
    def fit(specimens, *, free, **_):
        (one,) = specimens
        start = {p.key: p.start for p in free if p.start is not None}
        raise Asked(one.data, one.scene.replace(start), [p.key for p in free])

    monkeypatch.setattr(identify, "fit", fit)

    def asked(*words):
        with pytest.raises(Asked) as caught:
            main.main(["fit", *map(str, words)])
        return caught.value.args

    return asked


def numbers(scene):
    return [float(scene.get(key)) for key in TRUE]


def test_without_data_the_example_is_fitted(asked):
    data, scene, free = asked()
    assert [loop.label for loop in data] == ["A = 0.3247", "A = 0.5851", "A = 1", "A = 1.6"]
    assert free == list(TRUE)
    assert numbers(scene) == [0.15, 0.2]
    assert scene.load.control == "force"
    assert scene.load.amplitude == 1.6


@pytest.mark.parametrize(
    ("words", "start"),
    [
        (["--free", "contact.friction"], [0.15, 0.1126]),
        (["--free", "strip.kappa_s"], [0.1, 0.1126]),
        (["--set", "contact.friction=0.3"], [0.3, 0.2]),
        (["--set", "contact.friction=0.3", "--start", "contact.friction=0.4"], [0.4, 0.2]),
        (["--set", "strip.half_height=0.05"], [0.15, 0.05]),
        (["--start", "strip.height_ratio=0.3", "--set", "strip.half_height=0.05"], [0.15, 0.3]),
    ],
)
def test_starts_go_before_settings_before_the_example(asked, words, start):
    assert numbers(asked(*words)[1]) == start


def test_a_scene_file_goes_before_the_example(asked, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text("[contact]\nfriction = 0.25\n[load]\namplitude = 0.5\n")
    got = asked("--scene", scene)[1]
    assert numbers(got) == [0.25, 0.2]
    assert got.load.amplitude == 0.5


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    """A smooth displacement to 0.002 and a noisy force."""
    phase = np.linspace(0.0, 2.0 * np.pi, 200)
    noise = 0.02 * np.random.default_rng(5).standard_normal(phase.size)
    table = np.column_stack([np.cos(phase + 0.3) + noise, 0.002 * np.cos(phase)])
    path = tmp_path_factory.mktemp("noisy") / "rig.csv"
    np.savetxt(path, table, delimiter=",", header="force,displacement", comments="")
    return path


def test_the_smooth_column_drives(asked, noisy, tmp_path):
    free = ("--free", "contact.friction")
    load = asked(noisy, *free)[1].load
    assert (load.control, float(load.amplitude)) == ("displacement", 0.002)
    load = asked(noisy, *free, "--set", "load.control=displacement")[1].load
    assert (load.control, float(load.amplitude)) == ("displacement", 0.002)
    load = asked(noisy, *free, "--set", "load.control=force")[1].load
    assert load.control == "force"
    assert load.amplitude == max(read_loops(noisy)[0].force)
    scene = tmp_path / "scene.toml"
    scene.write_text("[load]\ncontrol = 'force'\namplitude = 0.5\n")
    load = asked(noisy, *free, "--scene", scene)[1].load
    assert (load.control, float(load.amplitude)) == ("force", 0.5)


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
        ("contact.normal=compliant", "contact.normal = 'compliant': needs w in model.fields"),
        ("contact.pressure=[[0,1],[1,-1]]", "must be finite and nowhere negative (no tension)"),
        ("contact.pressure=[[0,1],[1,nan]]", "must be finite and nowhere negative (no tension)"),
        ("contact.pressure=[[1,1],[0,1]]", "its X must not decrease from row to row"),
        ("contact.pressure=[[0,1],[2.5,1]]", "contact.pressure = [2.5]: lies off the strip, whose"),
        ("contact.pressure=[[0,1],[1,1],[1,2],[1,3]]", "gives one X three times; two rows make a"),
        ("strip.curvature=.1", "strip.curvature = 0.1: needs w in model.fields"),
        ("strip.layers=steel", "strip.layers = 'steel': give rows [thickness, E, nu] of all"),
        ("strip.layers=[[1, 2, .3]]", "add up to 1, but the height 2H is 0.2252; make them equal"),
        ("strip.layers=[[1, 2, 0.3]]", "add up to 1, but the height 2H is 0.2252; make them equal"),
        ("strip.layers=[[0.2252, 2, 0.5]]", "nu = 0.5 is incompressible: C11 is infinite; give"),
        ("model.squeeze=assumed", "model.squeeze = 'assumed': needs w and psi in model.fields"),
        ("contact.smoothing=blunt", "contact.smoothing = 'blunt': must be a number above 1, or"),
        ("strip.poisson_ratio=0.5", "strip.poisson_ratio = 0.5: must lie between -1 and 0.5"),
        ("strip.poisson_ratio=-1", "strip.poisson_ratio = -1.0: must lie between -1 and 0.5"),
        ("strip.far_end=glued", "strip.far_end = 'glued': choose 'held' or 'pinned' or 'free'"),
        ("load.cycles=1.5", "load.cycles = 1.5: must be a whole number, 0 to"),
        ("load.cycles=-1", "load.cycles = -1: must be a whole number, 0 to"),
        ("load.control=displacement", "load.amplitude = None: give the amplitude"),
        ("model.fields=v,psi", "model.fields = ['v', 'psi']: make no model; choose ['v'] or"),
        ("model.fields=psi", "model.fields = ['psi']: make no model; choose ['v'] or"),
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


LIFTING = {"model.fields": "v,w,beta,psi"}
LAYERS = {"strip.layers": [[0.1, 1e4, 0.3], [0.1252, 1e5, 0.2]]}
TIPPING = {"contact.bottom_pressure": [[0.0, 0.0], [1.0, 0.0], [1.0, 19.0], [2.0, 19.0]]}


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (
            LIFTING | {"contact.normal": "compliant", "contact.normal_stiffness": 0},
            "contact.normal_stiffness = 0.0: must be a positive number",
        ),
        (
            LIFTING | {"contact.bottom_pressure": 10},
            "contact.bottom_pressure = 10.0: nothing holds the strip down (rigid-body motion)",
        ),
        (
            LIFTING | TIPPING | {"strip.far_end": "pinned"},
            ": the strip tips over (rigid-body motio",
        ),
        (
            LIFTING | {"contact.normal": "none", "strip.far_end": "free"},
            "strip.far_end = 'free': is all that holds a strip without a foundation: take 'held'",
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
        (LIFTING | LAYERS | {"model.squeeze": "assumed"}, "'assumed': is for a homogeneous strip"),
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


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--free", ""], "free: name at least one key, such as contact.friction"),
        (["--free", "contact.mu"], "unknown key 'contact.mu': "),
        (["--free", "contact.friction,contact.friction"], "names a key twice"),
        (["--free", "load.amplitude"], "free 'load.amplitude': is not a parameter of the strip"),
        (["--free", "model.nodes"], "free 'model.nodes': is not a parameter of the strip"),
        (["--free", "contact.smoothing"], "is 'sharp' in this scene; give a number"),
        (["--start", "strip.kappa_s=1"], "--start strip.kappa_s: is not among the free keys cont"),
        (["--start", "contact.friction"], "'contact.friction': write KEY=VALUE, such as"),
        (["--start", "contact.friction=high"], "start = 'high': give a finite number"),
        (["--start", "contact.friction=-1"], "contact.friction = -1.0: must be a number, not"),
        (["--bounds", "contact.friction=0.2"], "--bounds contact.friction=0.2: write two numbers"),
        (["--bounds", "contact.friction=0.2:0.3"], "start = 0.15: must lie between low = 0.2"),
        (["--prior", "contact.friction=0.1:a"], "write two numbers with a colon between"),
        (["--profile", "strip.kappa_s"], "--profile strip.kappa_s: is not among the free keys"),
        (["--noise", "-1"], "noise = -1.0: give a positive part of the range"),
        (["--starts", "0"], "starts = 0: must be a whole number, 1 to"),
        (["--method", "simplex"], "method = 'simplex': choose"),
        (["plan.toml"], "plan.toml: cannot be read (No such file"),
        (["plan.toml", "a.csv"], "plan.toml a.csv: give one plan, or files of data"),
        (["plan.toml", "--kind", "loop"], "--kind: plan.toml is a plan; write this into the plan"),
        (["a.csv", "--kind", "lop"], "kind = 'lop': choose among 'loop', 'backbone'"),
        (["a.csv", "--unit", "kN"], "'kN': write KEY=VALUE, such as force=kN"),
        (["--set", "load.control=stress"], "load.control = 'stress': choose 'force' or 'displ"),
        (["--set", "load.control=a,b"], "load.control = ['a', 'b']: must be a word"),
        (["--set", "contact.pressure=1"], "contact.friction = 0.15: slides at mu F_N L = 0.3"),
    ],
)
def test_bad_fits_are_refused(refused, words, told):
    assert told in refused("fit", *words)


@pytest.mark.slow
def test_free_keys_that_the_loops_do_not_depend_on(refused, planted):
    bar = options({"model.fields": "v", "model.nodes": 5, "model.kinematics": "linear"})
    line = refused("fit", planted, *bar, "--free", "strip.kappa_s")
    assert line == "free 'strip.kappa_s': the data do not depend on it at its start; leave it out"


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("", "rig.csv: is empty: give a header and rows"),
        ("force,displacement\n1,2\n1,x\n", "rig.csv: line 3, column 'displacement' holds 'x'"),
        ("force,travel\n1,2\n", "rig.csv: needs one column named 'displacement' in line 1"),
        (None, "rig.csv: cannot be read (No such file"),
    ],
)
def test_bad_data_are_refused(refused, tmp_path, content, told):
    path = tmp_path / "rig.csv"
    if content is not None:
        path.write_text(content)
    assert told in refused("fit", path)


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


# --- what goes wrong later ----------------------------------------------------------------------


def test_a_step_without_equilibrium(refused, monkeypatch):
    # One Newton iteration per step: enough for the pressure and for sticking, not for slip.
    monkeypatch.setattr(solver, "Newton", functools.partial(jb.Newton, max_iterations=1))
    monkeypatch.setattr(recovery, "PIECES", ())
    line = refused("run", *BASE, "--set", "contact.smoothing=16", "--json", code=3)
    pattern = r"load step \d+ of 20 \(load \S+\) found no equilibrium \(max iterations, .*\): take"
    assert re.match(pattern, line)
    assert "more load.steps_per_half_cycle, a lower contact.stick_stiffness" in line


def test_an_interruption(refused, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(solver, "check", interrupted)
    assert refused("run", code=130) == "interrupted; no file is left half-written"


# --- as a program -------------------------------------------------------------------------------

ROOT = Path(jb.__file__).parent.parent


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
