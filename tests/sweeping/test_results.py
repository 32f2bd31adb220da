"""Results of a sweep as others read them: a set of arrays, its files, pictures; interruptions."""

import numpy as np
import pytest
import xarray
from small import FIGURES, MANY, SCENE
from toy import STRIP

import jbeamshell as jb
from jbeamshell import plotting
from jbeamshell.common import progress
from jbeamshell.sweeping import run
from jbeamshell.sweeping.lanes import Lanes, Outcome
from jbeamshell.sweeping.results import dataset, write_csv

AXES = {"load.amplitude": np.array([0.2, 0.8, 1.4]), "strip.height_ratio": np.array([0.05, 0.2])}
STATUS = np.array([[0, 0], [0, Outcome.MAX_ITERATIONS], [Outcome.OUTSIDE, Outcome.UNDEFINED]])


def made_up(paired=False, estimated=True, **replaced):
    """A sweep by a formula instead of a model."""
    scene = STRIP.replace(replaced)
    axes = {key: values[:2] for key, values in AXES.items()} if paired else AXES
    lanes = Lanes(scene, axes, paired)
    status = (STATUS[0] if paired else STATUS).astype(np.int8)
    values = {"dissipation": np.broadcast_to(lanes.difficulty, lanes.shape).copy()}
    if estimated:
        errors = lanes.grid("load.amplitude") / lanes.grid("strip.height_ratio")
        values["dissipation_error"] = 0.01 * errors
    for figure in values.values():
        figure[status > 0] = np.nan
    return dataset(lanes, values, status, ["a note"])


def test_a_grid_has_a_dimension_for_every_key():
    found = made_up()
    assert found["dissipation"].dims == tuple(AXES)
    for key, values in AXES.items():
        np.testing.assert_array_equal(found[key], values)
    picked = found["dissipation"].sel({"load.amplitude": 0.8, "strip.height_ratio": 0.05})
    assert float(picked) == found["dissipation"][1, 0]
    meanings = found["status"].attrs["flag_meanings"].split()
    assert meanings[int(found["status"][1, 1])] == "max_iterations"
    assert found["load.amplitude"].attrs["units"] == "force/width"
    assert found["dissipation"].attrs["units"] == "force"
    scaled = found["amplitude_over_height"]
    np.testing.assert_allclose(scaled, AXES["load.amplitude"][:, None] / [0.05, 0.2])
    assert "[strip]" in found.scene
    assert found.plan == str(STRIP.plan)
    assert found.version == jb.__version__
    assert found.notes.startswith("a note; 1 lanes lie outside the model's domain: ")
    moved = made_up(**{"load.control": "displacement", "load.amplitude": 1e-4})
    assert moved["load.amplitude"].attrs["units"] == "length"
    assert "amplitude_over_height" not in moved.coords


@pytest.mark.parametrize("paired", [False, True])
def test_a_netcdf_file_holds_all_of_it(paired, tmp_path):
    swept = made_up(paired)
    swept.to_netcdf(tmp_path / "sweep.nc")
    with xarray.open_dataset(tmp_path / "sweep.nc") as file:
        assert swept.identical(file.load())


@pytest.mark.parametrize("paired", [False, True])
def test_the_table_has_a_row_for_every_lane(paired, tmp_path):
    write_csv(made_up(paired), tmp_path / "sweep.csv")
    header, first, *_, last = (tmp_path / "sweep.csv").read_text().splitlines()
    assert header == ",".join([*AXES, "dissipation", "dissipation_error", "status", "doubtful"])
    assert first.startswith("0.2,0.05,")
    assert last.startswith("0.8,0.2," if paired else "1.4,0.2,,,undefined,False")


def test_lanes_are_doubtful_without_a_result_and_with_a_large_error():
    """The errors are .04, .01; .16; and unknown where nothing is dissipated."""
    expected = [[True, False], [True, True], [True, False]]
    np.testing.assert_array_equal(made_up()["doubtful"], expected)
    plain = made_up(estimated=False)
    np.testing.assert_array_equal(plain["doubtful"], [[False, False], [False, True], [True, False]])
    assert plain.doubts.startswith("1 of 6 lanes found no equilibrium")
    assert "; the dissipation of 2 of 6 lanes may be off by more than 2 %" in made_up().doubts


def test_a_map_marks_the_lanes_not_to_rely_on():
    swept = made_up()
    axes = plotting.sweep_contour(swept, along="load.amplitude", per="strip.height_ratio")
    (mesh,) = axes.collections
    drawn = np.sort(mesh.get_array().compressed())
    known = swept["dissipation"].values
    np.testing.assert_array_equal(drawn, np.sort(known[np.isfinite(known)]))
    (crosses,) = axes.get_lines()
    assert crosses.get_xdata().size == np.sum(swept["doubtful"])
    with pytest.raises(jb.InputError, match="a map needs two keys"):
        plotting.sweep_contour(made_up(paired=True))


# --- interrupted ----------------------------------------------------------------------------------


def cut(done, total):
    if done >= 40:
        raise KeyboardInterrupt


def test_what_is_interrupted_in_a_notebook_is_returned(monkeypatch):
    whole = jb.sweep(SCENE, MANY, FIGURES)
    with pytest.raises(KeyboardInterrupt, match="interrupted; nothing is kept: give out="):
        jb.sweep(SCENE, MANY, FIGURES, progress=cut)
    monkeypatch.setattr(run, "in_notebook", lambda: True)
    with pytest.warns(UserWarning, match="sweep interrupted after 40 of 96 lanes"):
        part = jb.sweep(SCENE, MANY, FIGURES, progress=cut)
    ran = part["status"].values != Outcome.NOT_RUN
    assert np.sum(~ran) == 56
    for name in ("status", "dissipation"):
        np.testing.assert_array_equal(part[name].values[ran], whole[name].values[ran])
    assert np.all(np.isnan(part["dissipation"].values[~ran]))
    assert np.all(part["doubtful"].values[~ran])
    assert "interrupted after 40 of 96 lanes; the others are not_run" in part.notes
    with pytest.raises(KeyboardInterrupt):
        jb.sweep(SCENE, MANY, FIGURES, progress=lambda *_: cut(99, 99))


def test_progress_is_shown_where_a_person_watches(monkeypatch, capsys):
    monkeypatch.setattr(progress, "DELAY", 0.0)
    jb.sweep(SCENE, MANY, FIGURES)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(progress, "watched", lambda: True)
    jb.sweep(SCENE, MANY, FIGURES)
    assert "0/96" in capsys.readouterr().err
