"""Stores of sweeps and fits: a number that was changed is never taken for one that was computed."""

import json
import os
import subprocess
import sys
from pathlib import Path

import hostile
import numpy as np
import pytest
from damaged import BLOCK, saved_runs

import jbeamshell as jb
from jbeamshell.common import files
from jbeamshell.identify.runs import Evaluation
from jbeamshell.sweeping.store import Store

EVIL = Path("evil")  # what unpickling would make
WRONG = [  # arrays that are no block of three figures of seven lanes
    {"values": np.zeros((3, 8)), "status": BLOCK.status},
    {"values": np.zeros(7), "status": BLOCK.status},
    {"values": np.array([["x"] * 7] * 3), "status": BLOCK.status},
    {"values": BLOCK.values, "status": BLOCK.status * 1.0},
    {"values": BLOCK.values},
    {"something": BLOCK.values},
    {"values": BLOCK.values, "status": np.array([hostile.Evil(EVIL)] * 7)},
]
FLIPS = 300


def flipped(content, random):
    """Content with a bit changed, or a few bytes of it elsewhere."""
    changed, at = bytearray(content), int(random.integers(len(content)))
    if random.integers(4):
        changed[at] ^= 1 << int(random.integers(8))
    else:
        changed[at : at + 8] = random.bytes(8)
    return bytes(changed)


def test_a_block_that_was_changed_or_belongs_elsewhere_is_computed_again(tmp_path):
    random, store, taken = np.random.default_rng(22), Store(tmp_path / "parts", "a sweep"), 0
    with store.opened():
        store.save(3, BLOCK)
        place = store.folder / "block-000003.npz"
        good = place.read_bytes()
        for _ in range(FLIPS):
            place.write_bytes(flipped(good, random))
            found = store.load(3, 3, 7)
            taken += found is not None
            assert found is None or all(map(np.array_equal, found, BLOCK))
        assert taken < FLIPS // 2  # bytes that mean nothing, such as dates
        for number, content in ((2, good), (3, good)):
            (store.folder / f"block-{number:06d}.npz").write_bytes(content)
        assert store.load(2, 3, 7) is None
        assert store.load(3, 3, 7) is not None
        assert store.load(3, 3, 8) is None
        for arrays in WRONG:
            np.savez(place, **arrays)
            assert store.load(3, 3, 7) is None
        for content in (b"", b"noise", bytes(1000), b"PK\3\4" + bytes(range(256))):
            place.write_bytes(content)
            assert store.load(3, 3, 7) is None
        assert not EVIL.exists()
        store.save(3, BLOCK)
    other = Store(tmp_path / "other", "another sweep")
    with other.opened():
        (other.folder / place.name).write_bytes(good)
        with pytest.raises(jb.InputError, match="holds another sweep that is not finished"):
            other.load(3, 3, 7)
        assert (other.folder / place.name).read_bytes() == good


def test_two_sweeps_do_not_write_into_one_folder(tmp_path):
    one, two = Store(tmp_path / "parts", "a sweep"), Store(tmp_path / "parts", "a sweep")
    with one.opened():
        with pytest.raises(jb.InputError, match="another sweep writes to it now"):
            two.opened().__enter__()
        one.save(0, BLOCK)
    with two.opened():
        assert two.load(0, 3, 7) is not None
        two.remove()
    assert not list(tmp_path.iterdir())
    with pytest.raises(ZeroDivisionError), one.opened():
        raise ZeroDivisionError
    with two.opened():
        assert not list(two.folder.iterdir())


def test_a_lock_ends_with_the_process_that_holds_it(tmp_path):
    path = tmp_path
    program = (
        f"import pathlib, time; from jbeamshell.common.files import locked\n"
        f"with locked(pathlib.Path({str(path)!r})) as alone:\n"
        "    print(alone, flush=True)\n"
        "    time.sleep(60)"
    )
    environment = os.environ | {"PYTHONPATH": str(Path(jb.__file__).parents[1])}
    words = [sys.executable, "-c", program]
    with subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout.readline() == "True\n"
        with files.locked(path) as alone:
            assert not alone
        holder.kill()
        holder.wait()
    with files.locked(path) as alone:
        assert alone


def test_a_run_of_a_fit_that_was_changed_is_made_again(tmp_path):
    random, path = np.random.default_rng(23), tmp_path / "state"
    runs = saved_runs(path)
    assert runs.read() == []
    made = [
        (random.random(2), Evaluation(random.random(4), random.random((4, 2)), random.random(4), c))
        for c in (True, False, True)
    ]
    runs.append(made)
    good = path.read_bytes()
    known = {values.tobytes(): run for values, run in made}
    header = good.index(b"\n") + 1
    for _ in range(FLIPS):
        path.write_bytes(good[:header] + flipped(good[header:], random))
        found = runs.read()
        assert len(found) >= 1
        for values, run in found:
            right = known[values.tobytes()]
            assert all(map(np.array_equal, run, right))
    assert path.read_bytes().count(b"\n") == len(found) + 1
    _, *rest = good.splitlines(keepends=True)
    other = saved_runs(path, tolerance=1e-9)
    path.write_bytes(json.dumps(json.loads(other._header)).encode() + b"\n" + b"".join(rest))
    assert other.read() == []
    path.write_bytes(good + b"".join(rest))
    assert len(runs.read()) == 3
    assert path.read_bytes() == good
