"""Plain calls beside finite elements: the record, and some of its scenes solved again."""

from pathlib import Path

import pytest

import jbeamshell as jb
from calibration.running import read
from verification import plain_call

RECORD = read(Path(plain_call.__file__).with_suffix(".json"))
AGAIN = ("standard", "double-shear")
AGAIN_SLOWLY = [pytest.param(kind, marks=pytest.mark.slow) for kind in ("member", "guided")]


def test_nearly_all_are_within_the_tolerance_and_none_far_off_is_silent():
    found = RECORD["all"]
    assert found["scenes"] == len(RECORD["rows"]) > 250
    assert found["within_percent"]["1.2"] > 0.95
    assert found["worst_undoubted_percent"] < 2.0
    assert found["elasticity"] == 1.0  # one model serves all


@pytest.mark.parametrize("kind", [*AGAIN, *AGAIN_SLOWLY])
def test_a_scene_of_the_record(kind):
    pairs = zip(RECORD["rows"], plain_call.scenes(), strict=True)
    own = [(row, scene) for row, scene in pairs if row["kind"] == kind]
    row, (_, scene, work, _) = own[len(own) // 2]
    history = jb.solve(scene, throw=False)
    assert history.scene.plan.section == row["section"]
    off = 100.0 * (float(history.dissipation) / work - 1.0)
    assert off == pytest.approx(row["D_percent"], abs=1e-2)
