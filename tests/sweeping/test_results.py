"""Results of a sweep as others read them: tables, sets of arrays, HTML; and what is interrupted."""

import copy
import dataclasses
import pickle
import sys

import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from jbeamshell.common import progress
from jbeamshell.sweeping import run
from jbeamshell.sweeping.lanes import Lanes, Outcome
from jbeamshell.sweeping.results import Sweep

AXES = {
    "load.amplitude": np.array([0.2, 0.8, 1.4]),
    "strip.height_ratio": np.array([0.05, 0.2]),
}
STATUS = np.array([[0, 0], [0, Outcome.MAX_ITERATIONS], [Outcome.OUTSIDE, Outcome.UNDEFINED]])


def made_up(paired=False, **replaced):
    """A sweep by a formula instead of a model."""
    scene = STRIP.replace(replaced)
    axes = {key: values[:2] for key, values in AXES.items()} if paired else AXES
    lanes = Lanes(scene, axes, paired)
    status = (STATUS[0] if paired else STATUS).astype(np.int8)
    values = {"dissipation": np.broadcast_to(lanes.difficulty, lanes.shape).copy()}
    values["dissipation_error"] = (
        0.01 * lanes.grid("load.amplitude") / lanes.grid("strip.height_ratio")
    )
    for figure in values.values():
        figure[status > 0] = np.nan
    return Sweep(scene, axes, paired, values, status, 1.0, 0.5, status.size, ("a <note>",))


def test_a_grid_becomes_a_set_with_a_dimension_for_every_key():
    pytest.importorskip("xarray")
    swept = made_up()
    found = swept.to_xarray()
    assert found["dissipation"].dims == tuple(AXES)
    for key, values in AXES.items():
        np.testing.assert_array_equal(found[key], values)
    picked = found["dissipation"].sel({"load.amplitude": 0.8, "strip.height_ratio": 0.05})
    assert float(picked) == swept["dissipation"][1, 0]
    meanings = found["status"].attrs["flag_meanings"].split()
    assert meanings[int(found["status"][1, 1])] == "max_iterations"
    assert found["load.amplitude"].attrs["units"] == "force/width"
    assert found["dissipation"].attrs["units"] == "force"
    assert "[strip]" in found.attrs["scene"]
    moved = made_up(**{"load.control": "displacement", "load.amplitude": 1e-4}).to_xarray()
    assert moved["load.amplitude"].attrs["units"] == "length"


def test_pairs_become_a_set_of_lanes():
    pytest.importorskip("xarray")
    found = made_up(paired=True).to_xarray()
    assert found["dissipation"].dims == ("lane",)
    assert found["strip.height_ratio"].dims == ("lane",)
    assert dict(found.sizes) == {"lane": 2}


def test_the_frame_holds_the_numbers_of_the_set():
    pandas, swept = pytest.importorskip("pandas"), made_up()
    frame = swept.to_dataframe()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame) == [*AXES, "dissipation", "dissipation_error", "status", "doubtful"]
    stacked = swept.to_xarray().to_dataframe().reset_index()
    for name in (*AXES, "dissipation", "doubtful"):
        np.testing.assert_array_equal(stacked[name], frame[name])
    assert frame["status"].tolist()[3:] == ["max_iterations", "outside", "undefined"]


def test_a_sweep_equals_its_copies_and_no_other():
    swept = made_up()
    for copied in (pickle.loads(pickle.dumps(swept)), copy.copy(swept), copy.deepcopy(swept)):
        assert copied == swept
        assert str(copied) == str(swept)
    assert dataclasses.replace(swept, wall_s=9.0) == swept
    swept.values["dissipation"][0, 0] = np.nextafter(swept["dissipation"][0, 0], 9.0)
    assert swept != made_up()
    assert made_up(paired=True) != made_up()
    assert made_up(**{"contact.friction": 0.3}) != made_up()
    assert made_up() != "a sweep"


def test_lanes_are_doubtful_without_a_result_and_with_a_large_error():
    """The errors are .04, .01; .16; and unknown where nothing is dissipated."""
    expected = [[True, False], [True, True], [True, False]]
    np.testing.assert_array_equal(made_up().doubtful, expected)
    plain = made_up()
    del plain.values["dissipation_error"]
    np.testing.assert_array_equal(plain.doubtful, [[False, False], [False, True], [True, False]])


def test_a_map_marks_the_lanes_not_to_rely_on():
    axes = made_up().plot_contour(along="load.amplitude", per="strip.height_ratio")
    (mesh,) = axes.collections
    drawn = np.sort(mesh.get_array().compressed())
    known = made_up()["dissipation"]
    np.testing.assert_array_equal(drawn, np.sort(known[np.isfinite(known)]))
    (crosses,) = axes.get_lines()
    assert crosses.get_xdata().size == np.sum(made_up().doubtful)
    with pytest.raises(jb.InputError, match="a map needs two keys"):
        made_up(paired=True).plot_contour()


@pytest.mark.parametrize(("name", "method"), [("xarray", "to_xarray"), ("pandas", "to_dataframe")])
def test_a_library_that_is_missing_is_named(name, method, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(jb.InputError, match=rf"{name}: is not installed: pip install 'jbeam.*\]'"):
        getattr(made_up(), method)()


def test_a_notebook_shows_a_table_and_a_picture():
    pyplot = pytest.importorskip("matplotlib.pyplot")
    before = pyplot.get_fignums()
    shown = made_up()._repr_html_()
    assert shown.startswith("<div>6 lanes over load.amplitude (3), strip.height_ratio (2): 3 conv")
    assert "<tr><td>dissipation error</td><td>0.01 to 0.16</td></tr>" in shown
    assert '<img src="data:image/png;base64,iVBOR' in shown
    assert "a &lt;note&gt;" in shown
    assert pyplot.get_fignums() == before


def test_a_sweep_with_nothing_to_draw_is_shown_too():
    swept = made_up()
    for figure in swept.values.values():
        figure[:] = np.nan
    assert "<td>dissipation</td><td>none</td>" in swept._repr_html_()


# --- interrupted ----------------------------------------------------------------------------------

TINY = {
    "model.nodes": 9,
    "model.kinematics": "linear",
    "load.steps_per_half_cycle": 2,
    "load.cycles": 1,
}
SCENE = STRIP.replace(TINY)
OVER = {"load.amplitude": np.linspace(0.2, 2.2, 12), "strip.height_ratio": [0.05, 0.1, 0.2, 0.4]}


def cut(done, total):
    if done >= 32:
        raise KeyboardInterrupt


def test_what_is_interrupted_in_a_notebook_is_returned(monkeypatch):
    whole = jb.sweep(SCENE, OVER, ["dissipation"])
    with pytest.raises(KeyboardInterrupt, match="interrupted; nothing is kept: give out="):
        jb.sweep(SCENE, OVER, ["dissipation"], progress=cut)
    monkeypatch.setattr(run, "in_notebook", lambda: True)
    with pytest.warns(UserWarning, match="sweep interrupted after 32 of 40 lanes"):
        part = jb.sweep(SCENE, OVER, ["dissipation"], progress=cut)
    assert part.computed == 32
    ran = part.status != Outcome.NOT_RUN
    assert np.sum(~ran) == 8
    np.testing.assert_array_equal(part.status[ran], whole.status[ran])
    np.testing.assert_array_equal(part["dissipation"][ran], whole["dissipation"][ran])
    assert np.all(np.isnan(part["dissipation"][~ran]))
    assert np.all(part.doubtful[~ran])
    assert "interrupted after 32 of 40 lanes; the others are not_run" in str(part)
    with pytest.raises(KeyboardInterrupt):
        jb.sweep(SCENE, OVER, ["dissipation"], progress=lambda *_: cut(99, 99))


def test_progress_is_shown_where_a_person_watches(monkeypatch, capsys):
    monkeypatch.setattr(progress, "DELAY", 0.0)
    jb.sweep(SCENE, OVER, ["dissipation"])
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(progress, "watched", lambda: True)
    jb.sweep(SCENE, OVER, ["dissipation"])
    assert "0/40" in capsys.readouterr().err
