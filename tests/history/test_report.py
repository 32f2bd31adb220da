"""Files of a run or a fit: every number to the last bit, whole files, no others."""

import csv
import dataclasses
import io
import json
import os
import tomllib

import jax
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure
from scenes import OPEN

import jbeamshell as jb
from jbeamshell import identify, laws
from jbeamshell.common import files
from jbeamshell.common.errors import InputError
from jbeamshell.history import report
from jbeamshell.measured.loops import Loop
from jbeamshell.mechanics.homogeneous import Homogeneous
from jbeamshell.plotting import folder

TABLES = {"loop.csv", "profiles.csv", "sections.csv", "result.json", "scene.toml"}
RUN_FILES = TABLES | {"loop.png", "profiles.png", "contact.png"}
FIT_FILES = {"overlay.csv", "overlay.png", "residuals.png", "result.json", "law.toml"}


@pytest.fixture(scope="module")
def history():
    """Numbers of NumPy, as a run in a folder takes them."""
    scene = OPEN.replace({"contact.normal": "held"})
    return jax.tree.map(np.asarray, jb.solve(scene, throw=False))


def pressed(history, steps, **values):
    """First steps of a history, as of a scene that only presses."""
    scene = history.scene.replace({"load.cycles": 0, "load.pressure_steps": steps} | values)
    kept = {"x", "middles", "tributary", "load"}
    arrays = {field.name: getattr(history, field.name) for field in dataclasses.fields(history)}
    path = {k: v for k, v in arrays.items() if k not in kept | {"scene", "cycles"}}
    path = jax.tree.map(lambda a: a[:steps], path)
    return history.but(**path, scene=scene, cycles=())


@pytest.fixture(scope="module")
def result():
    """Fit of two loops with awkward names and numbers that decimals cannot hold."""
    law = laws.Jenkins(1.0 / 3.0, 7.0)
    loops = [
        Loop(np.asarray(law.path_forces(u)), u, label=label, driver="displacement")
        for label, u in (
            ("A = 1, left", 0.1 * np.array([1.0, 0.1, -0.4, -0.6, -1.0, 0.3, 0.5, 0.6, 1.0])),
            ('the "old" rig', 0.2 * np.array([1.0, 0.4, -0.1, -1.0, -0.3, 0.2, 0.6, 1.0])),
        )
    ]
    return identify.fit(loops, law, ["jenkins.slip_force"], starts=1, throw=False, unchecked=True)


def rows_of(text):
    header, *rows = csv.reader(io.StringIO(text))
    return header, rows


def names(folder):
    return {path.name for path in folder.iterdir()}


def is_png(path):
    return path.read_bytes().startswith(b"\x89PNG\r\n")


# --- tables -------------------------------------------------------------------------------------


def test_the_loop_table_keeps_every_bit(history):
    header, rows = rows_of(report.loop_table(history))
    columns = dict(zip(header, np.array(rows, dtype=float).T, strict=True))
    expected = {
        "step": np.arange(21),
        "force": history.force,
        "displacement": history.displacement,
        "pressure": np.ones(21),
        "friction_work": np.cumsum(history.slip_work),
        "newton_iterations": history.iterations,
        "error": history.error,
    }
    assert header == list(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(columns[name], values)
    assert [row[5] for row in rows] == [str(int(i)) for i in history.iterations]


def test_a_frame_holds_the_load_path(history):
    frame = history.to_dataframe()
    assert len(frame) == history.force.size
    np.testing.assert_array_equal(frame["displacement"], history.displacement)


def test_the_loop_table_says_where_unilateral_contact_ends(history):
    lifting = pressed(history, 3, **{"contact.normal": "rigid"})
    header, rows = rows_of(report.loop_table(lifting))
    assert header.index("contact_end") == 5
    np.testing.assert_array_equal([float(row[5]) for row in rows], lifting.contact_end)
    hanging = pressed(history, 3, **{"contact.normal": "none"})
    for other in (history, hanging):
        assert "contact_end" not in rows_of(report.loop_table(other))[0]


def test_the_profile_table_keeps_every_bit(history):
    steps = report.turning_steps(history)
    assert steps == [0, 4, 12, 20]  # the pressure, the first peak, the turn, the end
    header, rows = rows_of(report.profile_table(history, steps))
    names = ["step", "force", "x", "slip", "w", "beta", "psi", "gap"]
    names += ["traction", "reaction", "slipping"]
    assert header == names
    assert len(rows) == 4 * 41
    columns = dict(zip(header, zip(*rows, strict=True), strict=True))
    assert set(columns["slipping"]) == {"True", "False"}
    flags = np.array([c == "True" for c in columns["slipping"]]).reshape(4, 41)
    np.testing.assert_array_equal(flags, history.slipping[np.array(steps)])
    for name in names[3:-1]:
        column = np.array(columns[name], dtype=float).reshape(4, 41)
        np.testing.assert_array_equal(column, getattr(history, name)[np.array(steps)])
    for name, values in (("x", [history.x] * 4), ("force", history.force[np.array(steps), None])):
        column = np.array(columns[name], dtype=float).reshape(4, 41)
        np.testing.assert_array_equal(column, np.broadcast_to(values, (4, 41)))


def test_the_section_table_keeps_every_bit(history):
    steps = [0, 12]
    header, rows = rows_of(report.section_table(history, steps))
    assert header == ["step", "x", "N", "Q", "M", "chi", "xi", "squeeze_stress"]
    columns = dict(zip(header, np.array(rows, dtype=float).reshape(2, 40, 8).T, strict=True))
    np.testing.assert_array_equal(columns["step"].T, np.repeat(steps, 40).reshape(2, 40))
    np.testing.assert_array_equal(columns["x"].T, [history.middles] * 2)
    for name, values in zip(header[2:], (*history.sections, history.squeeze_stress), strict=True):
        np.testing.assert_array_equal(columns[name].T, values[np.array(steps)])
    # Under the pressure alone the mean stress over the height is the pressure.
    np.testing.assert_allclose(columns["squeeze_stress"].T[0], -10.0, rtol=1e-9)


def test_steps_to_look_at(history):
    several = {"cycles": ((4, 12, 20), (20, 28, 36), (36, 44, 52)), "force": np.zeros(53)}
    assert report.turning_steps(history.but(**several)) == [0, 4, 36, 44, 52]
    for steps, shown in [(1, [0]), (2, [0, 1]), (20, [0, 9, 19])]:
        assert report.turning_steps(pressed(history, steps)) == shown
    # Pressed in steps, then loaded one way.
    scene = history.scene.replace({"load.pressure_steps": 5})
    one_way = history.but(cycles=(), scene=scene)
    assert report.turning_steps(one_way) == [0, 2, 4, 20]


def test_json_refuses_what_is_no_number():
    third = 1.0 / 3.0
    assert json.loads(files.as_json({"a": third, "b": [1, "c"]})) == {"a": third, "b": [1, "c"]}
    for value in (np.nan, np.inf):
        with pytest.raises(ValueError, match="not JSON compliant"):
            files.as_json({"a": [value]})


# --- folders ------------------------------------------------------------------------------------


def test_a_run_in_a_folder(history, tmp_path):
    folder = tmp_path / "new" / "run"
    open_figures = plt.get_fignums()
    paths = report.write_run(folder, history, history.figures())
    assert plt.get_fignums() == open_figures
    assert {path.name for path in paths} == names(folder) == RUN_FILES
    assert len(paths) == len(RUN_FILES)
    assert (folder / "loop.csv").read_text() == report.loop_table(history)
    assert (folder / "profiles.csv").read_text().count("\n") == 1 + 4 * 41
    assert json.loads((folder / "result.json").read_text()) == history.figures()
    assert jb.scene_to_toml(jb.read_scene(folder / "scene.toml")) == jb.scene_to_toml(
        history.scene.pinned()
    )
    assert (folder / "sections.csv").read_text().count("\n") == 1 + 4 * 40
    assert all(is_png(path) for path in folder.glob("*.png"))


@pytest.mark.parametrize(
    ("values", "pictures"),
    [
        ({}, {"contact.png"}),
        ({"model.section": "shell", "contact.normal": "rigid"}, {"contact.png"}),
        ({"model.section": "shell"}, set()),
    ],
)
def test_a_run_that_only_presses_has_no_loop_to_draw(history, tmp_path, values, pictures):
    paths = report.write_run(tmp_path, pressed(history, 3, **values), {})
    assert {path.name for path in paths} == names(tmp_path) == TABLES | pictures


def test_a_run_without_friction_has_no_traction_to_draw(history, tmp_path):
    scene = history.scene.replace({"contact.friction": 0.0})
    smooth = history.but(scene=scene)
    report.write_run(tmp_path, smooth, {})
    assert names(tmp_path) == RUN_FILES - {"profiles.png"}


def test_only_what_was_written_is_listed(history, tmp_path):
    (tmp_path / "measured.csv").write_text("mine")
    (tmp_path / "loop.csv").write_text("old")
    paths = report.write_run(tmp_path, history, {})
    assert {path.name for path in paths} == RUN_FILES
    assert names(tmp_path) == RUN_FILES | {"measured.csv"}
    assert (tmp_path / "measured.csv").read_text() == "mine"
    assert (tmp_path / "loop.csv").read_text() == report.loop_table(history)


def test_a_run_of_ones_own_energy_has_no_scene_file(history, tmp_path):
    own = Homogeneous(0.1126, 1.5e5, 0.3, 0.44)
    scene = jb.Scene(history.scene.strip, model=history.scene.model, energy=own)
    paths = report.write_run(tmp_path, history.but(scene=scene), {})
    assert {path.name for path in paths} == names(tmp_path) == RUN_FILES - {"scene.toml"}


def test_a_fit_in_a_folder(result, tmp_path):
    folder = tmp_path / "fit"
    open_figures = plt.get_fignums()
    paths = result.save(folder)
    assert plt.get_fignums() == open_figures
    assert {path.name for path in paths} == names(folder) == FIT_FILES
    header, rows = rows_of((folder / "overlay.csv").read_text())
    assert header == ["loop", "force", "displacement", "model_force", "model_displacement"]
    for i, (data, model) in enumerate(zip(result.data, result.model, strict=True)):
        own = [row for row in rows if row[0] == data.label]
        assert len(own) == (9, 8)[i]
        table = np.array([row[1:] for row in own], dtype=float).T
        np.testing.assert_array_equal(table, [*data.columns, *model.columns])
    told = tomllib.loads((folder / "law.toml").read_text())["set"]
    assert told["jenkins.slip_force"] == result.values["jenkins.slip_force"]
    assert json.loads((folder / "result.json").read_text()) == result.figures()
    assert is_png(folder / "overlay.png")
    assert is_png(folder / "residuals.png")


def test_what_cannot_be_written_leaves_nothing(history, result, tmp_path):
    folder = tmp_path / "out"
    bad = {"loss_factor": np.nan}
    for write in (
        lambda: report.write_run(folder, history, bad),
        lambda: result.save(folder, figures=bad),
    ):
        with pytest.raises(ValueError, match="not JSON compliant"):
            write()
        assert not folder.exists()


def test_an_interrupted_picture_leaves_whole_files(history, tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(Figure, "savefig", interrupted)
    with pytest.raises(KeyboardInterrupt):
        report.write_run(tmp_path, history, {})
    assert names(tmp_path) == {name for name in RUN_FILES if not name.endswith(".png")}
    plt.close("all")


def test_folders_are_checked_before_anything_is_made(tmp_path):
    for place in (tmp_path, tmp_path / "new", tmp_path / "new" / "nested"):
        assert folder.check_folder(place) == place
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["file", "file/below", "file/below/deeper"])
def test_a_file_is_no_folder(tmp_path, name):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match=rf"--out .*{name}: .*/file is a file: name a folder"):
        folder.check_folder(tmp_path / name)
    assert names(tmp_path) == {"file"}


def test_folders_that_cannot_be_made(tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"--out .*: cannot be made \(File name too long"):
        folder.check_folder(tmp_path / ("long" * 100))
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(InputError, match=r"--out .*new: .* cannot be written to: name another"):
        folder.check_folder(tmp_path / "new")
