"""Sweeps on executors of all kinds: equal to the last bit, and no lane lost with a worker."""

import json
import multiprocessing
import os
import pickle
import subprocess
import sys
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from pathlib import Path

import numpy as np
import pytest
from small import FIGURES, MANY, SCENE, TINY, same

import jbeamshell as jb
from jbeamshell.common.errors import InputError, UnconvergedError
from jbeamshell.sweeping.job import Job, runner_of
from jbeamshell.sweeping.lanes import lanes_of
from jbeamshell.sweeping.runner import Block

SET = [word for key, value in TINY.items() for word in ("--set", f"{key}={value}")]
SWEEP = [sys.executable, "-m", "jbeamshell", "sweep", *SET, "--figures", ",".join(FIGURES)]
SWEEP += ["--set", "model.by=steps", "--over", "load.amplitude=0.2:1.9:60"]
SWEEP += ["--over", "strip.height_ratio=0.05:0.4:60", "--json"]
ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(jb.__file__).parents[1])}


@pytest.fixture(scope="module")
def alone():
    return jb.sweep(SCENE, MANY, FIGURES)


class Here(Executor):
    """Executor that runs what it is given at once, as if it had come from another machine.

    ``faults`` are errors of the first blocks, in place of their answers; None is no fault.
    """

    def __init__(self, *faults):
        self.faults, self.given = list(faults), []

    def submit(self, function, *arguments):
        function, arguments = pickle.loads(pickle.dumps((function, arguments)))
        self.given.append(arguments)
        future, fault = Future(), self.faults.pop(0) if self.faults else None
        if fault is None:
            future.set_result(pickle.loads(pickle.dumps(function(*arguments))))
        else:
            future.set_exception(fault)
        return future


def test_blocks_on_executors_say_what_they_say_here(alone):
    here = Here()
    same(alone, jb.sweep(SCENE, MANY, FIGURES, executor=here))
    assert len(here.given) == 12
    assert all(isinstance(columns, np.ndarray) for (columns,) in here.given)
    with ThreadPoolExecutor(2) as pool:
        same(alone, jb.sweep(SCENE, MANY, FIGURES, executor=pool))


@pytest.mark.parametrize(
    ("fault", "kind", "says"),
    [
        (BrokenExecutor("killed"), UnconvergedError, "its workers died .BrokenExecutor: killed"),
        (ModuleNotFoundError("No module named 'jbeamshell'"), InputError, "install this version"),
        (MemoryError("no room"), UnconvergedError, "cannot run a block .MemoryError: no room"),
        (InputError("executor: is too old"), InputError, "executor: is too old"),
    ],
)
def test_workers_that_cannot_go_on_are_told_and_what_is_done_is_kept(
    fault, kind, says, alone, tmp_path
):
    out, parts = tmp_path / "sweep.csv", tmp_path / "sweep.csv.parts"
    failing = Here(*[None] * 5, fault)
    with pytest.raises(kind, match=f"{says}.*; .*keeps what is done, and .* goes on") as caught:
        jb.sweep(SCENE, MANY, FIGURES, executor=failing, out=out)
    assert "\n" not in str(caught.value)
    assert len(list(parts.glob("block-*"))) == len(failing.given) - 1
    rest = jb.sweep(SCENE, MANY, FIGURES, executor=Here(), out=out)
    same(alone, rest)
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.csv"]


def test_a_place_that_is_none_or_answers_something_else_is_told():
    class Wrong(Here):
        def submit(self, function, *arguments):
            future = Future()
            future.set_result(self.faults[0])
            return future

    for answer in (None, (1, 2), Block(np.zeros((4, 3)), np.zeros(3, np.int8))):
        with pytest.raises(UnconvergedError, match="give an executor that returns what it is told"):
            jb.sweep(SCENE, MANY, FIGURES, executor=Wrong(answer))
    with ThreadPoolExecutor(1) as pool:
        pass
    with pytest.raises(UnconvergedError, match=r"cannot run a block .RuntimeError: cannot"):
        jb.sweep(SCENE, MANY, FIGURES, executor=pool)
    for given in ("tcp://here:8786", ThreadPoolExecutor):
        with pytest.raises(InputError, match=r"give a concurrent\.futures\.Executor"):
            jb.sweep(SCENE, MANY, FIGURES, executor=given)
    forked = ProcessPoolExecutor(1, multiprocessing.get_context("fork"))
    with pytest.raises(InputError, match="forks this process"):
        jb.sweep(SCENE, MANY, FIGURES, executor=forked)


def test_workers_of_another_version_are_refused():
    about = Job(lanes_of(SCENE, MANY), SCENE, FIGURES).description()
    other = json.dumps(json.loads(about) | {"version": "0.0.1"})
    with pytest.raises(InputError, match=r"this process 0\.0\.1: install the same version"):
        runner_of(other)


# --- minutes --------------------------------------------------------------------------------------


LARGE = {key: np.linspace(values[0], values[-1], 60) for key, values in MANY.items()}


@pytest.fixture(scope="module")
def whole():
    return jb.sweep(SCENE, LARGE, FIGURES)


def processes(count):
    return ProcessPoolExecutor(count, multiprocessing.get_context("spawn"))


@pytest.mark.slow
def test_two_processes_say_what_one_says_and_what_is_done_is_kept_if_one_is_killed(whole, tmp_path):
    with processes(2) as pool:
        same(whole, jb.sweep(SCENE, LARGE, FIGURES, executor=pool))
    out, killed = tmp_path / "sweep.csv", []

    def kill(done, total):
        if done and not killed:
            killed.append(multiprocessing.active_children()[0])
            killed[0].kill()

    with (
        processes(2) as pool,
        pytest.raises(UnconvergedError, match=r"its workers died .*keeps what is done"),
    ):
        jb.sweep(SCENE, LARGE, FIGURES, executor=pool, out=out, progress=kill)
    assert list((tmp_path / "sweep.csv.parts").glob("block-*"))
    rest = jb.sweep(SCENE, LARGE, FIGURES, out=out)
    same(whole, rest)
    assert "lanes were done before" in rest.notes


@pytest.mark.slow
def test_a_script_without_a_guard_sweeps_in_processes(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "print('once')\nimport jbeamshell as jb\n"
        "from concurrent.futures import ProcessPoolExecutor\n"
        "from multiprocessing import get_context\n"
        f"over = {{'load.amplitude': [0.1 * i for i in range(1, 19)]}}\n"
        f"scene = jb.Scene().replace({TINY})\n"
        "with ProcessPoolExecutor(2, get_context('spawn')) as two:\n"
        "    found = jb.sweep(scene, over, executor=two)\n"
        "print(int(found['status'].sum()))\n"
    )
    said = {"capture_output": True, "text": True, "timeout": 300}
    done = subprocess.run([sys.executable, script], env=ENVIRONMENT, **said)
    assert (done.returncode, done.stdout.split()) == (0, ["once", "0"]), done.stderr


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of dask
def test_a_dask_cluster_that_loses_a_worker_says_what_one_process_says(whole, tmp_path):
    distributed = pytest.importorskip("distributed")
    out, killed = tmp_path / "sweep.csv", []
    place = {"dashboard_address": None, "local_directory": str(tmp_path / "dask")}
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, **place) as cluster,
        distributed.Client(cluster) as client,
    ):

        def kill(done, total):
            if done and not killed:
                killed.extend(client.run(os.getpid).values())
                os.kill(killed[0], 9)

        executor = client.get_executor()
        found = jb.sweep(SCENE, LARGE, FIGURES, executor=executor, out=out, progress=kill)
        same(whole, found)
        assert out.read_text().count("\n") == whole["status"].size + 1
        words = [*SWEEP, "--dask", cluster.scheduler_address]
        said = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, timeout=300)
        assert json.loads(said.stdout)["failed"] == 0, said.stderr
    assert len(killed) == 2
    with pytest.raises(UnconvergedError, match="cannot run a block"):
        jb.sweep(SCENE, LARGE, FIGURES, executor=executor)
