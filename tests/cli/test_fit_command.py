"""`jbeamshell fit`: what it finds, what it is asked, and the data and words that it refuses."""

import csv
import json
import re

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import laws
from jbeamshell.cli import main
from jbeamshell.identify import plan as fit_plan
from jbeamshell.identify.plan import Plan
from jbeamshell.measured.loop_files import read_loops
from tests import rig
from tests.command import BASE, COARSE, is_png, names, options

TRUE = {"contact.friction": 0.12, "strip.height_ratio": 0.2}
# Of the standard strip, which data with units do not mean unless they are given.
KNOWN = {"strip.length": 2.0, "strip.axial_stiffness": 3.4e4, "contact.pressure": 10.0}
OFF = {"contact.friction": 0.084, "strip.height_ratio": 0.26}  # by 30 %
FIT_FILES = {"overlay.csv", "overlay.png", "residuals.png", "result.json", "scene.toml"}


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


DOOR = {"model.section": "squeeze", "model.nodes": 21}


def rig_file(random):
    """Three noisy cycles of many plays with an offset of the displacement."""
    force = rig.path(3, 100)
    u = 1e-6 * (rig.iwan_by_force(force) + 0.2 + 2e-3 * random.standard_normal(force.size))
    return 1e5 * force, u


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
    assert lines[-2:] == [
        "  the force drives these loops (set load.control to change it)",
        "  the force enters a member that goes on (set load.entry to change it)",
    ]


@pytest.mark.slow
def test_python_and_the_command_line_are_one_door(cli, tmp_path):
    """A file and its loops: the same starts, numbers, doubts and notes, with nothing given."""
    rows = np.column_stack(rig_file(np.random.default_rng(3)))
    path = tmp_path / "rig.csv"
    np.savetxt(path, rows, delimiter=",", header="force [N/m],displacement [m]", comments="")
    code, out, _ = cli("fit", path, *options(DOOR), "--json")
    loops = [loop.but(label="rig.csv") for loop in read_loops(path)]
    fits = [jb.fit(given, DOOR) for given in (str(path), loops)]
    fits.append(jb.fit([jb.identify.Specimen(DOOR, [path])]))
    told = json.loads(out)
    told.pop("wall_s")
    assert told["notes"]
    assert told["doubts"]
    for fit in fits:
        assert fit.describes == (code == 0)
        assert json.loads(json.dumps(fit.figures())) == told
    assert cli("fit", path, *options(DOOR))[1] == f"{fits[0]}\n"


def test_data_of_another_law_end_with_code_3(cli, planted, monkeypatch):
    monkeypatch.setattr(jb.identify.Fit, "describes", False)
    code, out, _ = cli("fit", planted, *FIT, "--json")
    assert code == 3
    assert json.loads(out)["describes"] is False


def test_a_fit_that_does_not_settle(refused, planted, monkeypatch):
    monkeypatch.setattr(fit_plan, "MAX_ITERATIONS", 1)
    line = refused("fit", planted, *FIT, "--json", code=3)
    assert line.startswith("the fit has not converged after 1 iterations, at contact.friction = ")


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
    """Carries the plan that was to be run."""


@pytest.fixture
def asked(monkeypatch):
    def run(plan, **_):
        (one,) = plan.cases
        start = {p.key: p.start for p in plan.free if p.start is not None}
        raise Asked(one.measurements, one.model.own.replace(start), [p.key for p in plan.free])

    monkeypatch.setattr(Plan, "run", run)

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


STARTS = [
    (["--free", "contact.friction"], [0.15, 0.1126]),
    (["--free", "strip.kappa_s"], [0.1, 0.1126]),
    (["--set", "contact.friction=0.3"], [0.3, 0.2]),
    (["--set", "contact.friction=0.3", "--start", "contact.friction=0.4"], [0.4, 0.2]),
    (["--set", "strip.half_height=0.05"], [0.15, 0.05]),
    (["--start", "strip.height_ratio=0.3", "--set", "strip.half_height=0.05"], [0.15, 0.3]),
]


def test_starts_go_before_settings_before_files_before_the_example(asked, tmp_path):
    for words, start in STARTS:
        assert numbers(asked(*words)[1]) == start
    scene = tmp_path / "scene.toml"
    scene.write_text("[contact]\nfriction = 0.25\n[load]\namplitude = 0.5\n")
    got = asked("--scene", scene)[1]
    assert numbers(got) == [0.25, 0.2]
    assert got.load.amplitude == 0.5


def test_the_smooth_column_drives_unless_one_is_set(asked, tmp_path):
    phase = np.linspace(0.0, 2.0 * np.pi, 200)
    noise = 0.02 * np.random.default_rng(5).standard_normal(phase.size)
    table = np.column_stack([np.cos(phase + 0.3) + noise, 0.002 * np.cos(phase)])
    path, scene = tmp_path / "rig.csv", tmp_path / "scene.toml"
    np.savetxt(path, table, delimiter=",", header="force,displacement", comments="")
    scene.write_text("[load]\ncontrol = 'force'\namplitude = 0.5\n")
    free = (path, "--free", "contact.friction")
    load = asked(*free)[1].load
    assert (load.control, float(load.amplitude)) == ("displacement", 0.002)
    load = asked(*free, "--set", "load.control=force")[1].load
    assert float(load.amplitude) == pytest.approx(max(read_loops(path)[0].force), rel=0.1)
    load = asked(*free, "--scene", scene)[1].load
    assert (load.control, float(load.amplitude)) == ("force", 0.5)
    u = rig.path(3)  # cycles, which are averaged along the column that drives
    rows = np.column_stack([7.0 * rig.jenkins(u), 1e-4 * u])
    head = "force [N/m],displacement [m]"
    np.savetxt(path, rows, delimiter=",", header=head, comments="")
    for words, driver in (((), "displacement"), (("--set", "load.control=force"), "force")):
        (loop,), one, _ = asked(*free, *words)
        assert (loop.driver, one.load.control) == (driver, driver)


@pytest.mark.slow
def test_free_keys_that_the_loops_do_not_depend_on(refused, planted):
    bar = options({"model.section": "bar", "model.nodes": 5, "model.kinematics": "linear"})
    line = refused("fit", planted, *bar, "--free", "strip.kappa_s")
    assert line == "free 'strip.kappa_s': the data do not depend on it at its start; leave it out"


def test_a_law_takes_the_place_of_the_strip(tmp_path, capsys):
    u = 0.02 * np.cos(np.linspace(0.0, 2.0 * np.pi, 65))
    path = np.append(np.linspace(0.0, 0.02, 9)[1:], u)
    force = np.asarray(laws.Jenkins(1.0, 100.0).path_forces(path))[-65:]
    rows = "\n".join(f"{a},{b}" for a, b in zip(force, u, strict=True))
    (tmp_path / "loop.csv").write_text(f"force,displacement\n{rows}\n", encoding="utf-8")
    words = ["fit", str(tmp_path / "loop.csv"), "--model", "jenkins", "--starts", "1", "--json"]
    assert main.main(words) == 0
    values = json.loads(capsys.readouterr().out)["values"]
    assert values["jenkins.slip_force"]["value"] == pytest.approx(1.0, rel=1e-6)
    assert values["jenkins.stiffness"]["value"] == pytest.approx(100.0, rel=1e-6)
    assert main.main([*words, "--scene", "standard"]) == 2
    told = capsys.readouterr().err
    assert "scene = 'standard': the law 'jenkins' takes its place: leave it out" in told
