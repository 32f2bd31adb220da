"""`jbeamshell run`, keys and scenes: JSON on stdout and nothing else, files when all went well."""

import csv
import json
import os
import sys

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.cli import arguments, main
from jbeamshell.scene import library
from jbeamshell.scene.keys import TABLE
from tests.command import BASE, COARSE, is_png, names, options

FIGURES = {
    *("dissipation", "dissipation_loop", "dissipation_ratio", "secant_stiffness", "loss_factor"),
    *("peak_displacement", "slip_length", "reaction_min", "closure", "newton_iterations"),
    *("reaction_max", "reaction_max_at", "squeeze_stress_max", "status", "wall_s", "compile_s"),
    *("contact_end", "lift_slope", "tip_deflection", "doubts"),
}
TIMES = {"wall_s", "compile_s"}
TABLES = {"loop.csv", "profiles.csv", "sections.csv", "result.json", "scene.toml"}
RUN_FILES = TABLES | {"loop.png", "profiles.png", "contact.png"}


# --- run ----------------------------------------------------------------------------------------


@pytest.mark.doubtful("few nodes")
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


def test_bolts_of_a_specimen_press_both_members_of_a_single_lap():
    """Whatever the entry of the force: a clamp would take what is not balanced, silently."""
    lap = {"member.support": "clamped", "strip.far_end": "free", "load.entry": "face"}
    lap |= {"model.section": "shell", "model.nodes": 9}
    size = ("--length", "120mm", "--thickness", "12mm", "--width", "50mm", "--modulus", "210GPa")
    words = ("--bolts", "2x8kN@30mm,90mm", "--head", "13mm", *options(lap))
    given = main._parser().parse_args(["run", *size, *words, "--set", "load.amplitude=1kN"])
    chosen = arguments.scene_of(given)
    assert np.asarray(chosen.contact.bolts).shape == (2, 3)
    assert np.array_equal(chosen.contact.bottom_pressure, chosen.contact.pressure)


def test_run_prints_text_to_read(cli):
    own = {"strip.height_ratio": 0.2, "load.amplitude": 0.5, "load.steps_per_half_cycle": "auto"}
    code, out, err = cli("run", *BASE, *options(own))
    assert code == 0
    assert err.startswith("jbeamshell: warning: where slip reaches 1 H the section squeeze")
    title, entered, *lines = out.splitlines()
    assert "eta = 0.2, force amplitude 0.5: section squeeze on its contact line" in title
    assert title.endswith("linear kinematics, 21 nodes")
    assert "load.entry = member); where slip reaches 1 H the section squeeze" in entered
    figures = [line for line in lines if not line.startswith("  doubtful: ")]
    names = {line.split("  ")[1].replace(" ", "_") for line in figures}
    assert names == FIGURES - TIMES - {"doubts"}
    assert figures[-1].split() == ["status", "converged"]
    assert len(figures) < len(lines)
    with pytest.raises(json.JSONDecodeError):
        json.loads(out)


SPECIMEN = ["--length", "120mm", "--thickness", "12mm", "--modulus", "210GPa", "--width", "50mm"]


@pytest.mark.doubtful("slip")
def test_run_takes_a_specimen_and_a_reader_that_leaves_early_costs_no_files(monkeypatch, tmp_path):
    folder, (reading, writing) = tmp_path / "out", os.pipe()
    os.close(reading)
    load = ["--pressure", "8MPa", "--set", "load.amplitude=2.4kN", "--out", str(folder)]
    with os.fdopen(writing, "w") as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        assert main.main(["run", *BASE, *SPECIMEN, *load, "--json"]) == 0
    assert names(folder) == RUN_FILES
    values = {"strip.length": 0.12, "strip.half_height": 0.006, "strip.youngs_modulus": 210e9}
    values |= {"contact.pressure": 8e6, "strip.width": 0.05, "load.amplitude": 2.4e3}
    history = jb.solve(jb.Scene().replace(COARSE | values))
    figures = json.loads((folder / "result.json").read_text())
    assert figures["dissipation"] == pytest.approx(float(history.dissipation), rel=1e-9)
    text = (folder / "scene.toml").read_text()
    for line in ("half_height = 0.006", "youngs_modulus = 210000000000.0", "amplitude = 2400.0"):
        assert line in text


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


def test_set_overrides_the_file_and_an_alias_its_twin(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text("[strip]\nheight_ratio = 0.1\nlength = 4.0\n[load]\namplitude = 0.5\n")

    def scene(**values):
        words = options({key.replace("__", "."): value for key, value in values.items()})
        return arguments.scene_of(main._parser().parse_args(["run", str(file), *words]))

    assert (float(scene().strip.height_ratio), float(scene().load.amplitude)) == (0.1, 0.5)
    assert float(scene(load__amplitude=0.625).load.amplitude) == 0.625
    assert float(scene(strip__half_height=0.3).strip.height_ratio) == pytest.approx(0.15)


def test_words_numbers_and_lists_of_the_command_line():
    texts = ["a = 3", "b=.5", "c=8.", "d=inf", "e=free", "f=v,beta", "g=[1, [.2, 3.]]", 'h="v"']
    values = arguments.assignments([*texts, "i=a=b", "k=true"])
    assert values == dict(
        zip(
            "abcdefghi",
            [3, 0.5, 8.0, np.inf, "free", ["v", "beta"], [1, [0.2, 3.0]], "v", "a=b"],
            strict=True,
        ),
        k=True,
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


def test_a_scene_without_cycles_by_name(cli, tmp_path):
    pressure = [[0.0, 10.0], [1.0, 10.0], [1.0, 0.0], [2.0, 0.0]]
    settings = COARSE | {"load.cycles": 0, "contact.pressure": pressure, "contact.normal": "held"}
    words = ("standard", *options(settings), "--json", "--out", tmp_path)
    code, out, err = cli("run", *words)
    assert code == 0
    figures = json.loads(out)
    assert set(figures) == {"reaction_max", "reaction_max_at", "squeeze_stress_max"} | PRESSED
    assert names(tmp_path) == TABLES | {"contact.png"}
    with (tmp_path / "loop.csv").open(newline="") as table:
        (row,) = csv.DictReader(table)
    assert (row["force"], row["pressure"]) == ("0.0", "1.0")
    # It may not lift, so the part that nothing presses is pulled down.
    assert err.startswith("jbeamshell: warning: tension at the contact (")
    assert "take contact.normal = rigid for unilateral contact" in err


def test_a_file_goes_before_a_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "receding").mkdir()
    assert library.values_from("receding") == library.values_of("receding")
    (tmp_path / "block").write_text("[strip]\nlength = 3.0\n")
    assert library.values_from("block") == {"strip.length": 3.0}
