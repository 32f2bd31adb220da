"""`jbeamshell advise`, and `run --tol`."""

import json

import pytest

from jbeamshell.cli import main
from tests.command import BASE


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
    assert told["settings"]["model.section"] == "condensed-squeeze"
    assert 0.0 < told["section_error"] <= 0.05
    assert told["tolerance"] == 0.05
    assert told["to"] == "plane elasticity"


def test_the_answer_in_words(cli):
    code, out, _ = cli("advise", "--set", "strip.height_ratio=0.4", "--set", "load.amplitude=0.3")
    assert code == 0
    assert out.startswith("plane on ")
    assert "for 1 % of plane elasticity: a squeeze section may be off by" in out


def test_run_takes_the_tolerance(cli):
    code, out, _ = cli("run", *BASE, "--tol", "0.03")
    assert code == 0
    assert "chosen to be within 3 % of its own fine mesh" in out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--tol", "1e-9"), "model.tolerance = 1e-09: must lie between 0.0001 and 0.1"),
        (("--tol", "nan"), "model.tolerance = nan: must lie"),
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
