"""`jbeamshell advise`, and `run --tol`."""

import json

import pytest

from jbeamshell.cli import main


@pytest.fixture
def cli(capsys):
    def cli(*words):
        code = main.main(words)
        return code, *capsys.readouterr()

    return cli


def test_the_answer_as_json(cli):
    code, out, err = cli("advise", "--tol", "0.05", "--json")
    told = json.loads(out)
    assert (code, err) == (0, "")
    assert told["rung"] == told["settings"]["model.rung"]
    assert told["rung"] == "squeeze"
    assert 0.0 < told["estimated_error"] <= 0.05
    assert told["estimated_ms"] > 0.0
    assert (told["quantity"], told["tolerance"]) == ("dissipation", 0.05)


@pytest.mark.slow
def test_the_answer_in_words(cli):
    code, out, _ = cli("advise", "standard", "--tol", ".2", "--set", "strip.height_ratio=0.02")
    assert code == 0
    assert out.startswith("bar: estimated to be ")
    assert "model.rung = bar" in out


def test_a_thick_corner_takes_plane_elasticity(cli):
    thick = ("--set", "strip.height_ratio=0.4", "--set", "load.amplitude=0.3")
    code, out, _ = cli("advise", "--json", *thick)
    assert (code, json.loads(out)["rung"]) == (0, "plane")


def test_none_of_these(cli):
    """A strip so soft that it rotates, and so thick that no rung that rotates is good enough."""
    soft = {"strip.height_ratio": 0.4, "load.amplitude": 0.3, "strip.axial_stiffness": 400}
    values = [word for key, value in soft.items() for word in ("--set", f"{key}={value}")]
    code, out, _ = cli("advise", "--json", *values)
    told = json.loads(out)
    assert code == 0
    assert told["rung"] == "none"
    assert told["advice"] == "none of these: use finite elements"
    code, out, err = cli("run", "--tol", "0.05", *values)
    assert (code, out) == (2, "")
    assert err.startswith("jbeamshell: tolerance = 0.05: none of these: use finite elements")


@pytest.mark.slow
def test_run_takes_the_model_advised(cli):
    code, out, _ = cli("run", "--tol", "0.2", "--json", "--set", "strip.height_ratio=0.02")
    told = json.loads(out)
    assert code == 0
    assert told["dissipation_ratio"] == pytest.approx(1.0, rel=1e-12)  # the bar's


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--tol", "1e-9"), "tolerance = 1e-09: must be a number from 0.005 to 1"),
        (("--tol", "nan"), "tolerance = nan: must be"),
        (
            ("--set", "model.rung=p0"),
            "model.rung = 'p0': choose 'auto', 'bar', 'shell', 'squeeze', 'p1'",
        ),
        (("--set", "model.rung=p99"), "model.rung = 'p99': choose"),
        (("--set", "load.amplitude=3"), "load.amplitude = 3.0: must stay below gross slip"),
        (("bimaterial", "--set", "model.rung=bar"), "model.solution = 'closed-form'"),
        (("--set", "model.rung=p3", "--set", "model.order=2"), "disagree: give one"),
    ],
)
def test_bad_input_is_one_line(cli, words, told):
    code, out, err = cli("advise", *words)
    assert (code, out) == (2, "")
    assert told in err
    assert err.count("\n") == 1
