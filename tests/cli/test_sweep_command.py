"""`jbeamshell sweep`: ranges in words, JSON and files out, one line of complaint."""

import csv
import json

import matplotlib.pyplot as plt
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import plotting
from jbeamshell.cli.sweep import ranges
from jbeamshell.common.errors import InputError
from jbeamshell.sweeping import lanes, run
from jbeamshell.sweeping.lanes import Outcome
from jbeamshell.sweeping.results import dataset

FIGURES = "dissipation,dissipation_ratio,secant_stiffness,reaction_max"  # of test_sweep
SWEEP = [
    "sweep",
    *("--set", "model.nodes=9", "--set", "model.kinematics=linear"),
    *("--set", "load.steps_per_half_cycle=2", "--set", "load.cycles=1", "--figures", FIGURES),
]
AMPLITUDES = ("--over", "load.amplitude=0.5:2.5:3")
HEIGHTS = ("--over", "strip.height_ratio=0.05, .4")


RANGES = {
    "load.amplitude=1:3:5": [1.0, 1.5, 2.0, 2.5, 3.0],
    "load.amplitude=3:1:2": [3.0, 1.0],
    "load.amplitude = 0.1 : 10 : 3 : log": [0.1, 1.0, 10.0],
    "load.amplitude=.5": [0.5],
    "load.amplitude=1,2e-1, 3": [1.0, 0.2, 3.0],
    "load.amplitude=2:7:1": [2.0],
}
NO_RANGES = {
    "": "at least one key",
    "load.amplitude": "write KEY=START:STOP:COUNT",
    "load.amplitud=1:2:3": "did you mean 'load.amplitude'",
    "load.amplitude=": "is empty",
    "load.amplitude=1:2:0": "is empty; COUNT",
    "load.amplitude=1:2:-3": "is empty; COUNT",
    "load.amplitude=1:2:2.5": "COUNT must be a whole number",
    "load.amplitude=1:2": "write KEY",
    "load.amplitude=1:2:3:cubic": "write KEY",
    "load.amplitude=0:2:3:log": "must be positive for a log range",
    "load.amplitude=1,,2": "'' is not a finite number",
    "load.amplitude=1,two": "'two' is not a finite number",
    "load.amplitude=0:inf:3": "'inf' is not a finite number",
    "load.amplitude=0:1:99999999999": "99,999,999,999 lanes .* take",
    "load.amplitude=1 load.amplitude=2": "is given twice",
}


def test_ranges_are_what_they_say_or_refused_in_one_line():
    for text, values in RANGES.items():
        np.testing.assert_allclose(ranges([text])["load.amplitude"], values, rtol=1e-14)
    for text, says in NO_RANGES.items():
        with pytest.raises(InputError, match=says) as caught:
            ranges(text.split())
        assert "\n" not in str(caught.value)


def test_json_is_strict_and_files_hold_the_same(cli, tmp_path):
    table, picture = tmp_path / "sweep.csv", tmp_path / "sweep.png"
    code, out, err = cli(*SWEEP, *AMPLITUDES, *HEIGHTS, "--json", "--out", table, "--plot", picture)
    assert code == 0
    assert "2 lanes lie outside the model's domain: load.amplitude = 2.5: must stay below" in err
    found = json.loads(out, parse_constant=pytest.fail)
    assert (found["lanes"], found["failed"]) == (6, 0)
    assert found["axes"]["load.amplitude"] == [0.5, 1.5, 2.5]
    assert found["status"] == [["converged"] * 2, ["converged"] * 2, ["outside"] * 2]
    assert found["values"]["dissipation"][2] == [None, None]
    with table.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    listed = [row["dissipation"] for row in rows]
    flat = np.ravel(found["values"]["dissipation"]).tolist()
    assert [float(word) if word else None for word in listed] == flat
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["sweep.csv", "sweep.png"]
    assert f"wrote {table}, {picture}" in err


def test_the_summary_counts_and_a_lane_that_fails_shows_in_the_exit_code(cli, monkeypatch):
    answer = run.sweep

    def failing(*words, **settings):
        result = answer(*words, **settings)
        result["status"][0, 0] = Outcome.MAX_ITERATIONS
        return result

    code, out, err = cli(*SWEEP, "--over", "load.amplitude=.5,1.5", *HEIGHTS)
    assert (code, err) == (0, "")
    assert out.startswith("4 lanes over load.amplitude (2), strip.height_ratio (2): 4 converged")
    monkeypatch.setattr(run, "sweep", failing)
    code, out, err = cli(*SWEEP, "--over", "load.amplitude=.5,1.5", *HEIGHTS)
    assert code == 3


# --- pictures -------------------------------------------------------------------------------------


def made_up(control="force", paired=False, **over):
    """A sweep by a formula instead of a model."""
    scene = jb.Scene().replace({"load.control": control, "load.amplitude": 1.0})
    found = lanes.Lanes(scene, {k: np.array(v) for k, v in over.items()}, paired)
    scaled = np.nan_to_num(np.broadcast_to(found.difficulty, found.shape))
    ratio = scaled / (1.0 + scaled)
    bar = 1e-5 * found.value("load.amplitude") ** 3 / found.value("contact.friction")
    bar = bar * (1.0 if control == "force" else found.value("strip.height_ratio"))
    values = {"dissipation": ratio * bar, "dissipation_ratio": ratio}
    status = np.zeros(found.shape, np.int8)
    status.flat[0] = Outcome.NOT_FINITE
    for figure in values.values():
        figure.flat[0] = np.nan
    return dataset(found, values, status)


AXES = {"load.amplitude": np.linspace(0.1, 1.9, 7), "strip.height_ratio": [0.05, 0.1, 0.2]}


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


def test_a_curve_for_every_height_and_the_bar_for_all():
    result = made_up(**AXES, **{"contact.friction": [0.1, 0.2]})
    axes = plotting.sweep(result, per="strip.height_ratio")
    assert len(axes.lines) == 3  # friction varies: no one bar for all
    np.testing.assert_array_equal(axes.lines[1].get_ydata(), result["dissipation"][:, 1, 1])
    assert axes.get_title() == r"$\mu$ = 0.2"
    assert "force/width" in axes.get_xlabel()
    bar = plotting.sweep(made_up(**AXES)).lines[-1]
    assert bar.get_label() == "bar"
    assert np.all(np.diff(bar.get_ydata()) > 0.0)
    refused = {
        "the sweep is over": {"along": "strip.length"},
        "along the axis already": {"along": "contact.friction", "per": "contact.friction"},
        "choose": {"figure": "loss_factor"},
    }
    for says, words in refused.items():
        with pytest.raises(InputError, match=says):
            plotting.sweep(result, **words)
    paired = AXES | {"strip.height_ratio": np.geomspace(0.05, 0.4, 7)}
    axes = plotting.sweep(made_up(paired=True, **paired))
    assert len(axes.collections[0].get_offsets()) == 7
    assert len(axes.figure.axes) == 2  # with a bar of colours


def test_the_master_curve_has_a_dot_for_every_lane_that_converged():
    result = made_up(**AXES)
    (dots,) = plotting.master_curve(result).collections
    x, y = np.asarray(dots.get_offsets()).T
    assert x.size == result["status"].size - 1
    np.testing.assert_allclose(y, x / 2.0 / (1.0 + x / 2.0))
    assert x.max() == pytest.approx(1.9 / 0.05)
    with pytest.raises(InputError, match="no lane with a force"):
        plotting.master_curve(made_up("displacement", **AXES))
