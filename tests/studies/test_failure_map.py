"""The failure maps: what a run is called, the record that is there, and its pictures."""

from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from toy import STRIP

import jbeamshell as jb
from calibration.running import read
from verification import failure_map, outcomes

RIGHT = [1.0, 0.004, 0.003, 1e-9, 3.0, 0.0, 1.001, 0]
COARSE = {"model.nodes": 21, "model.kinematics": "linear", "load.steps_per_half_cycle": 4}


@pytest.fixture(scope="module")
def record():
    return read(Path(failure_map.__file__).with_suffix(".json"))


@pytest.fixture(autouse=True)
def _close():
    yield
    plt.close("all")


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({}, "right"),
        ({4: 40.0}, "right, but slow"),
        ({1: 0.03}, "right, but doubted"),
        ({3: 0.01}, "right, but doubted"),
        ({7: 1}, "right, but doubted"),
        ({0: 1.2}, "wrong, silently"),
        ({0: None}, "wrong, silently"),
        ({0: 1.2, 2: 0.05}, "wrong, and says so"),
        ({0: 0.0, 1: None, 2: None}, "wrong, and says so"),
        ({0: None, 5: 1.0}, "fails, and says so"),
        ({0: None, 5: -1, 6: None}, "fails, and says so"),
        ({6: None}, "no reference"),
    ],
)
def test_what_becomes_of_a_run(changes, name):
    assert outcomes.outcome([changes.get(i, value) for i, value in enumerate(RIGHT)]) == name


@pytest.mark.slow
def test_a_cell_of_the_map():
    fine = COARSE | {"model.nodes": 41}
    cell = failure_map.cell(COARSE, fine, {"load": 0.39})
    assert len(cell) == len(failure_map.FIGURES) + 2
    sliders = {"contact.stick_stiffness": failure_map.STANDARD["alpha"]}
    held = {"contact.normal": "held", "load.amplitude": 0.78}
    strip = jb.solve(STRIP.replace(COARSE | sliders | held), throw=False)
    assert cell[0] == pytest.approx(float(strip.dissipation_ratio), rel=1e-5)
    assert max(cell[1:3]) == pytest.approx(float(strip.dissipation_error), rel=1e-5)
    assert 0.0 < abs(cell[0] / cell[6] - 1.0) < 0.1
    assert outcomes.outcome(failure_map.cell(COARSE, fine, {"load": 1.0})) == "fails, and says so"
    points = failure_map.random_points(*failure_map.SCENES["scenes"])
    assert points.shape == (2000, 6)
    assert points.min(axis=0) == pytest.approx(
        [0.005, 0.02, 0.02, 0.0, 0.05, 2.0], rel=0.02, abs=1e-3
    )


def test_every_map_of_the_record_is_drawn(record):
    assert set(outcomes.maps(record)) == set(failure_map.MAPS)
    for name, chart in outcomes.maps(record).items():
        assert [len(row) for row in chart["cells"]] == [len(chart["columns"])] * len(chart["rows"])
        assert outcomes.outcome_map(record, name).get_title() == name
    with pytest.raises(jb.InputError, match="the record has"):
        outcomes.outcome_map(record, "nothing")


def test_the_defaults_are_nowhere_wrong_silently(record):
    for name in ("height and load", "friction and load"):
        chart = record[name]
        for label, row in zip(chart["rows"], chart["cells"], strict=True):
            silent = [outcomes.outcome(cell) for cell in row].count("wrong, silently")
            assert silent == 0, (name, label)
