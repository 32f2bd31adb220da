"""`jbeamshell advise`, and `run --tol`."""

import json

import pytest

import jbeamshell as jb
from jbeamshell.cli import main
from tests.command import BASE, COARSE


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
    assert told["settings"]["model.section"] == "squeeze"
    assert told["settings"]["model.kinematics"] == "linear"
    assert 0.0 < told["section_error"] <= 0.05
    assert told["tolerance"] == 0.05
    assert told["to"] == "plane elasticity"


def test_the_answer_in_words(cli):
    code, out, _ = cli("advise", "--set", "strip.height_ratio=0.4", "--set", "load.amplitude=0.3")
    assert code == 0
    assert out.startswith("section plane on its contact line, ")
    assert "for 1 % of plane elasticity: a squeeze section may be off by" in out


def test_run_takes_the_tolerance(cli):
    code, out, _ = cli("run", *BASE, "--set", "model.nodes=auto", "--tol", "0.03")
    assert code == 0
    nodes = jb.Scene().replace(COARSE | {"model.nodes": "auto", "model.tolerance": 0.03}).plan.nodes
    assert "planned to be within 3 % of its own fine mesh" in out
    assert f"linear kinematics, {nodes} nodes" in out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--tol", "1e-9"), "model.tolerance = 1e-09: must lie between 0.0001 and 0.1"),
        (("--tol", "nan"), "model.tolerance = nan: must lie"),
        (("--set", "model.section=p99"), "model.section = 'p99': choose 'bar' or 'shell'"),
        (("--set", "load.amplitude=3"), "load.amplitude = 3.0: must stay below gross slip"),
        (("bimaterial", "--set", "model.section=bar"), "contact.normal = 'none': needs a section"),
    ],
)
def test_bad_input_is_one_line(cli, words, told):
    code, out, err = cli("advise", *words)
    assert (code, out) == (2, "")
    assert told in err
    assert err.count("\n") == 1
