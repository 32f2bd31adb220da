"""Charts of the speed record: drawn from a small made-up one."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import jbeamshell as jb
from calibration import charts


def timed(what, by, us, error, to_elements):
    return {
        "what": what,
        "by": by,
        "median_us": us,
        "error": error,
        "error_to_elements": to_elements,
    }


@pytest.fixture
def record():
    study = [
        {"end_size": size, "nodes": n, "D_error": 1.0 / n**2, "error": 0.0 if n == 81 else 1.0 / n}
        for size in ("1/36", "1/3")
        for n in (21, 41, 81)
    ]
    return {
        "one": {
            "eta": 0.1126,
            "A": 0.7855,
            "rows": [
                timed("dissipation, 1 step", "jbeamshell", 80.0, -0.002, 0.008),
                timed("History, 1 step", "jbeamshell", 900.0, -0.002, 0.008),
                timed("CalculiX, 20 steps", "CalculiX", 2.5e7, 0.0007, 0.0007),
            ],
        },
        "nodes": {
            "steps": 1,
            "slope": 1.0,
            "rows": [{"nodes": n, "median_us": 2.0 * n, "best_us": 1.5 * n} for n in (33, 65, 129)],
        },
        "gradient": {
            "parameters": ["contact.friction", "strip.kappa_s"],
            "rows": [
                {"what": "run", "median_runs": 1.0, "best_runs": 1.0},
                {"what": "reverse", "median_runs": 4.0, "best_runs": 3.5},
            ],
            "study": {
                "steps": 4,
                "against": {"nodes": 81, "end_size": "1/3"},
                "rows": study,
            },
        },
    }


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def points(axes, marker):
    """Places of the single marks that are drawn with it."""
    lines = [line for line in axes.lines if line.get_marker() == marker]
    return [(float(line.get_xdata()[0]), float(line.get_ydata()[0])) for line in lines]


def test_every_time_stands_at_both_its_errors(record):
    axes = charts.speed.draw(record, "errors")
    np.testing.assert_allclose(sorted(points(axes, "s")), [(900.0, 0.2), (900.0, 0.8)])
    assert len(points(axes, "o")) == 4  # the first of either family
    assert "[µs]" in axes.get_xlabel()
    assert "[%]" in axes.get_ylabel()
    told = [text.get_text() for text in axes.get_legend().get_texts()]
    assert told == [row["what"] for row in record["one"]["rows"]]


def test_slopes_and_ratios_are_those_of_the_record(record):
    told = [text.get_text() for text in charts.speed.draw(record, "nodes").get_legend().get_texts()]
    assert "slope 1.00" in told
    shown = [text.get_text() for text in charts.speed.draw(record, "gradients").texts]
    assert shown == ["1.00", "4.00"]


def test_the_reference_itself_is_left_out(record):
    axes = charts.speed.draw(record, "derivative")
    for line in axes.lines:
        np.testing.assert_allclose(line.get_xdata(), [21, 41])


def test_a_sheet_holds_what_the_record_has(record):
    assert sum(axes.axison for axes in charts.speed.sheet(record).axes) == 4
    del record["one"]
    assert len(charts.speed.sheet({"nodes": record["nodes"]}).axes) == 1
    with pytest.raises(jb.InputError, match="no section 'one'"):
        charts.speed.draw(record, "errors")
    with pytest.raises(jb.InputError, match="nothing to draw"):
        charts.speed.sheet({})
