"""`jbeamshell advise`, and `run --tol`."""

import json

import jbeamshell as jb
from tests.command import BASE, COARSE


def test_the_answer_as_json(cli):
    code, out, err = cli("advise", "--tol", "0.05", "--json")
    told = json.loads(out)
    assert (code, err) == (0, "")
    assert told["settings"]["model.section"] == "plane"
    assert told["settings"]["model.kinematics"] == "linear"
    assert told["tolerance"] == 0.05
    assert told["to"] == "plane elasticity"


def test_the_answer_in_words(cli):
    code, out, _ = cli("advise", "--set", "strip.height_ratio=0.4", "--set", "load.amplitude=0.3")
    assert code == 0
    assert out.startswith("section plane on its contact line, ")
    assert "for 1 % of plane elasticity: the scene has all that plane elasticity needs" in out


def test_run_takes_the_tolerance(cli):
    code, out, _ = cli("run", *BASE, "--set", "model.nodes=auto", "--tol", "0.03")
    assert code == 0
    nodes = jb.Scene().replace(COARSE | {"model.nodes": "auto", "model.tolerance": 0.03}).plan.nodes
    assert "planned to be within 3 % of its own fine mesh" in out
    assert f"linear kinematics, {nodes} nodes" in out
