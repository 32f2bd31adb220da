"""No result of a random structure is off by more than 2 % without an error or a doubt."""

import pytest
import random_structures

SEEDS = {"joint": 30, "law": 30}  # of the quick ones; twelve of the others


@pytest.mark.slow
@pytest.mark.parametrize("name", random_structures.CHECKS)
def test_structures_are_right_or_say_so(name):
    seeds = range(SEEDS.get(name, 12))
    met = [random_structures.verdict(name, seed)[1] for seed in seeds]
    assert "SILENT" not in met
    assert met.count("right") > (0.5 if name in SEEDS else 0.3) * len(met) or name == "curve"
