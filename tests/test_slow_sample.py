"""A tenth of the slow tests is drawn, another one by each seed; see `slow_sample`."""

import slow_sample

TESTS = [f"tests/test_one.py::test_{number}" for number in range(400)]


def sample(seed, minutes=0.0):
    return {test for test in TESTS if slow_sample.drawn(test, minutes, seed)}


def test_many_seeds_draw_every_test():
    samples = [sample(seed) for seed in range(150)]
    assert 0.09 < sum(map(len, samples)) / (150 * len(TESTS)) < 0.11
    assert all(20 < len(one) < 65 for one in samples)
    assert set.union(*samples) == set(TESTS)


def test_a_seed_draws_the_same_again_and_nothing_long():
    assert sample("f0bc4b3") == sample("f0bc4b3") != sample("8121cdc")
    assert not sample("f0bc4b3", minutes=2.0)


def test_a_seed_stays_itself_and_a_commit_has_its_name():
    assert slow_sample.seed_of("of mine") == "of mine"
    assert slow_sample.seed_of("HEAD") not in ("", "HEAD")
