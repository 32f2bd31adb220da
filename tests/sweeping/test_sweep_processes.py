"""Sweeps on several devices, processes and machines: the same numbers, and none lost with one."""

import json
import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.common.errors import UnconvergedError
from jbeamshell.sweeping import processes
from jbeamshell.sweeping.run import LOST

TINY = {
    "model.nodes": 9,
    "model.kinematics": "linear",
    "load.steps_per_half_cycle": 2,
    "load.cycles": 1,
}
FIGURES = ("dissipation", "dissipation_ratio", "secant_stiffness", "reaction_max")  # of test_sweep
SCENE = jb.Scene().replace(TINY)
SMALL, LARGE = (120, 80), (300, 200)  # lanes: of the large there is time to kill somebody
SET = [word for key, value in TINY.items() for word in ("--set", f"{key}={value}")]
SWEEP = [sys.executable, "-m", "jbeamshell", "sweep", *SET, "--figures", ",".join(FIGURES)]


def over(size):
    amplitudes, heights = np.linspace(0.2, 2.2, size[0]), np.geomspace(0.03, 0.4, size[1])
    return {"load.amplitude": amplitudes, "strip.height_ratio": heights}


def words_over(size):
    lengths = f"load.amplitude=0.2:2.2:{size[0]}", f"strip.height_ratio=0.03:0.4:{size[1]}:log"
    return [word for text in lengths for word in ("--over", text)]


@pytest.fixture(scope="module")
def alone():
    return jb.sweep(SCENE, over(SMALL), FIGURES)


@pytest.fixture(scope="module")
def large():
    return jb.sweep(SCENE, over(LARGE), FIGURES)


def agree(found, right):
    """To 1e-12, and where nothing slips of what the figure is elsewhere."""
    np.testing.assert_allclose(found, right, rtol=1e-12, atol=1e-12 * np.nanmax(np.abs(right)))


def same(one, other):
    np.testing.assert_array_equal(one.status, other.status)
    for name in one.values:
        agree(other[name], one[name])


def same_numbers(alone, text):
    """JSON of the command against the result."""
    found = json.loads(text, parse_constant=pytest.fail)
    for name, values in alone.values.items():
        agree(np.array(found["values"][name], float), values)
    return found


def start(*words, size=SMALL, **variables):
    return subprocess.Popen(
        [*SWEEP, *words_over(size), *map(str, words)],
        env=os.environ | variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for_blocks(parts, count, process, limit=120.0):
    end = time.monotonic() + limit
    while len(list(parts.glob("block-*"))) < count:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.01)


def test_two_processes_say_what_one_says_even_if_one_is_killed(alone, monkeypatch):
    started, popen, ready = [], subprocess.Popen, processes.Crew._look_ready

    def remembered(*words, **settings):
        started.append(popen(*words, **settings))
        return started[-1]

    def look(crew):
        if len(started) == 2 and processes.mark(crew.store, 0).exists():
            started[1].kill()
            started[1].wait()
        ready(crew)

    monkeypatch.setattr(processes.subprocess, "Popen", remembered)
    monkeypatch.setattr(processes.Crew, "_look_ready", look)
    two = jb.sweep(SCENE, over(SMALL), FIGURES, processes=2)
    assert len(started) == 3
    assert all(process.poll() is not None for process in started)
    assert two.notes == ("worker processes that died: 1, replaced",)
    assert two.computed == int(np.sum(over(SMALL)["load.amplitude"] < 2.0)) * 80
    same(alone, two)


def test_workers_that_keep_dying_are_given_up_and_what_is_done_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(processes.sys, "executable", "/bin/false")
    out = tmp_path / "sweep.csv"
    with pytest.raises(UnconvergedError, match=r"worker process . of 2 died 3 times .*goes on"):
        jb.sweep(SCENE, over(SMALL), FIGURES, processes=2, out=out)
    assert (tmp_path / "sweep.csv.parts" / "sweep.npz").exists()
    assert not out.exists()


# --- minutes --------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("devices", [2, 4])
def test_devices_say_what_one_says(alone, devices):
    flags = f"{os.environ.get('XLA_FLAGS', '')} --xla_force_host_platform_device_count={devices}"
    out, err = start("--json", XLA_FLAGS=flags).communicate(timeout=300)
    assert same_numbers(alone, out)["computed"] == alone.computed, err


@pytest.mark.slow
@pytest.mark.parametrize("hands", [2, 4])
def test_processes_of_jax_distributed_say_what_one_says(alone, hands, tmp_path):
    out = tmp_path / "sweep.csv"
    team = distributed(hands, "--json", "--out", out)
    (first, _), *others = [process.communicate(timeout=300) for process in team]
    assert [process.returncode for process in team] == [0] * hands
    same_numbers(alone, first)
    assert all(said == "" for said, _ in others)
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.csv"]


@pytest.mark.slow
def test_processes_of_jax_distributed_that_sweep_different_things_are_refused():
    team = distributed(2, last=["--set", "contact.friction=0.2"])
    for process in team:
        out, err = process.communicate(timeout=300)
        assert (process.returncode, out) == (2, "")
        assert "process 1 sweeps something else than process 0" in err


@pytest.mark.slow
def test_lanes_of_a_lost_process_of_jax_distributed_are_run_by_the_others(large, tmp_path):
    out = tmp_path / "sweep.csv"
    first, second = distributed(2, "--json", "--out", out, size=LARGE)
    wait_for_blocks(Path(f"{out}.parts"), 5, first)
    second.kill()
    text, err = first.communicate(timeout=300)
    assert first.returncode == 0, err
    assert LOST in same_numbers(large, text)["notes"]
    second.communicate()


@pytest.mark.slow
@pytest.mark.parametrize("hands", [1, 2])
def test_a_sweep_that_was_killed_goes_on(large, hands, tmp_path):
    out, parts = tmp_path / "sweep.csv", tmp_path / "sweep.csv.parts"
    process = start("--out", out, "--processes", hands, size=LARGE)
    wait_for_blocks(parts, 3, process)
    process.kill()
    process.communicate()
    time.sleep(3.0)  # workers without a parent stop by themselves
    left = len(list(parts.glob("block-*")))
    time.sleep(1.0)
    assert len(list(parts.glob("block-*"))) == left >= 3
    rest = jb.sweep(SCENE, over(LARGE), FIGURES, out=out)
    same(large, rest)
    assert 0 < rest.computed < large.computed
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.csv"]


def distributed(hands, *words, last=(), size=SMALL):
    """The command as several processes that talk on loopback."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    team = ["--coordinator", f"127.0.0.1:{port}", "--of", hands]
    own = [()] * (hands - 1) + [last]
    return [start(*words, *team, "--process", k, *extra, size=size) for k, extra in enumerate(own)]
