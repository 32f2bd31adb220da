"""No result of a random structure is off by more than 2 % without an error or a doubt."""

import pytest
import random_structures

SEEDS = {"joint": 12, "law": 10}  # of the quick ones
SLOW_SEEDS = 12
MANY_SEEDS = 30


@pytest.mark.parametrize(
    ("name", "seeds"),
    [*SEEDS.items(), *(pytest.param(n, MANY_SEEDS, marks=pytest.mark.slow) for n in SEEDS)],
)
def test_joints_and_laws_are_right_or_say_so(name, seeds):
    met = [random_structures.verdict(name, seed)[1] for seed in range(seeds)]
    assert "SILENT" not in met
    assert met.count("right") > 0.5 * len(met)


@pytest.mark.slow
@pytest.mark.parametrize("name", [each for each in random_structures.CHECKS if each not in SEEDS])
def test_structures_are_right_or_say_so(name):
    met = [random_structures.verdict(name, seed)[1] for seed in range(SLOW_SEEDS)]
    assert "SILENT" not in met
    assert met.count("right") > 0.3 * len(met) or name == "curve"
