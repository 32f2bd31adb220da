"""Sweeps and fits that are killed at any moment: resumed, they end as if nothing had been."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import jbeamshell as jb

TINY = {
    "model.nodes": 9,
    "model.kinematics": "linear",
    "load.steps_per_half_cycle": 2,
    "load.cycles": 1,
}
SET = [word for key, value in TINY.items() for word in ("--set", f"{key}={value}")]
ROOT = str(Path(jb.__file__).parents[1])
GONE = 10.0  # seconds in which a worker must have noticed that its parent is no more
FREE = "contact.friction,strip.height_ratio"


def command(*words, folder):
    environment = os.environ | {"PYTHONPATH": ROOT}
    return subprocess.Popen(
        [sys.executable, "-m", "jbeamshell", *map(str, words)],
        cwd=folder,
        env=environment,
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finished(*words, folder):
    """Output of an undisturbed run, and its time."""
    begin = time.monotonic()
    process = command(*words, folder=folder)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    return out, time.monotonic() - begin


def alive_in(group):
    """Processes of a group."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if os.getpgid(int(place.name)) == group:
                found.append(int(place.name))
    return found


def killed_again_and_again(words, folder, kills, seed, whole_run, check):
    """Kill a run at random moments of an undisturbed one, each time going on from what is left.

    A run that was faster than its executioner is checked, and begun anew.
    """
    random, done = np.random.default_rng(seed), 0
    while done < kills:
        process = command(*words, folder=folder)
        try:
            out, err = process.communicate(timeout=random.uniform(0.0, whole_run))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.communicate()
            done += 1
            end = time.monotonic() + GONE
            while alive_in(process.pid) and time.monotonic() < end:
                time.sleep(0.05)
            assert alive_in(process.pid) == []
        else:
            assert process.returncode == 0, err
            check(out)
    check(finished(*words, folder=folder)[0])


def sweep_words(size, table):
    amplitudes, heights = f"load.amplitude=0.2:2.2:{size}", f"strip.height_ratio=.03:.4:{size}:log"
    over = "--over", amplitudes, "--over", heights
    return ["sweep", *SET, *over, "--out", table]


def sweep_survives(tmp_path, size, kills):
    _, whole_run = finished(*sweep_words(size, tmp_path / "whole.csv"), folder=tmp_path)
    whole = (tmp_path / "whole.csv").read_bytes()
    assert whole.count(b"\n") == size**2 + 1
    folder = tmp_path / "killed"
    folder.mkdir()
    table = folder / "sweep.csv"

    def check(_):
        assert table.read_bytes() == whole
        assert [path.name for path in folder.iterdir()] == ["sweep.csv"]
        table.unlink()

    words = sweep_words(size, table)
    killed_again_and_again(words, folder, kills, 1, whole_run, check)


def fit_survives(tmp_path, kills):
    data = tmp_path / "loop.csv"
    true = {"contact.friction": 0.12, "strip.height_ratio": 0.2}
    scene = jb.Scene().replace(TINY | true | {"load.steps_per_half_cycle": 8})
    history = jb.solve(scene, throw=False)
    columns = np.column_stack([history.force, history.displacement])
    np.savetxt(data, columns, delimiter=",", header="force,displacement", comments="")
    folder = tmp_path / "killed"
    folder.mkdir()
    state = folder / "state"
    words = ["fit", data, *SET, "--free", FREE, "--noise", 0.01, "--json"]
    out, whole_run = finished(*words, "--save", tmp_path / "whole", folder=tmp_path)
    whole = json.loads(out)
    lines = (tmp_path / "whole").read_text()
    assert len(lines.splitlines()) > 5

    def check(out):
        found = json.loads(out)
        assert found | {"wall_s": 0.0} == whole | {"wall_s": 0.0}
        assert state.read_text() == lines
        state.unlink()

    words += ["--save", state]
    killed_again_and_again(words, folder, kills, 0, whole_run, check)


@pytest.mark.slow
def test_a_sweep_survives_twenty_kills(tmp_path):
    sweep_survives(tmp_path, 200, kills=20)


@pytest.mark.slow
def test_a_fit_survives_twenty_kills(tmp_path):
    fit_survives(tmp_path, kills=20)
