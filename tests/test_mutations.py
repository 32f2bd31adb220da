"""Faults planted in the core are found by the ordinary tests; see `verification.mutations`."""

import json
import re

import pytest

from verification import mutations

# Three survive that change no result: from how evenly pressing starts, a margin of a check that
# others of the same branch imply on all strips tried, and fields of a held end, which are zero in
# its displacement anyway.  One is found by the slow tests alone: the
# energies to which a strip of load steps is fitted (TestJoint in `dynamics/test_structure.py`).
FOUND = json.loads(mutations.RECORD.read_text(encoding="utf-8"))


def test_the_record_says_which_test_finds_each_fault():
    every = list(mutations.faults())
    assert set(FOUND) == {fault.name for fault in every}
    assert len(every) >= 100
    assert sum(map(bool, FOUND.values())) >= 0.95 * len(every)


def test_every_fault_has_its_place_in_the_code_and_its_tests():
    for fault in mutations.faults():
        assert fault.right in mutations.text_of(fault), fault.name
        for test in fault.tests:
            path, *names = test.split("::")
            assert (mutations.ROOT / path).exists(), test
            for name in names:
                code = (mutations.ROOT / path).read_text("utf-8")
                assert re.search(rf"(def|class) {name.partition('[')[0]}\b", code), test


@pytest.mark.slow
def test_some_faults_are_found_again(tmp_path):
    project = mutations.copied(tmp_path)
    for fault in mutations.sample(3, seed=22):
        assert mutations.killed(fault, project) or not FOUND[fault.name], fault.name
