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
from toy import STRIP

import jbeamshell as jb
from jbeamshell.common.errors import InputError, UnconvergedError
from jbeamshell.sweeping.job import Job, runner_of
from jbeamshell.sweeping.lanes import lanes_of
from jbeamshell.sweeping.runner import Block

TINY = {
    "model.nodes": 9,
    "model.kinematics": "linear",
    "contact.normal": "held",
    "model.by": "steps",
    "load.steps_per_half_cycle": 2,
    "load.cycles": 1,
}
FIGURES = ("dissipation", "dissipation_ratio", "secant_stiffness", "reaction_max")  # of test_sweep
SCENE = STRIP.replace(TINY)
SMALL = (60, 60)  # lanes
SET = [word for key, value in TINY.items() for word in ("--set", f"{key}={value}")]
SWEEP = [sys.executable, "-m", "jbeamshell", "sweep", *SET, "--figures", ",".join(FIGURES)]
ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(jb.__file__).parents[1])}


def over(size):
    amplitudes, heights = np.linspace(0.2, 2.2, size[0]), np.geomspace(0.03, 0.4, size[1])
    return {"load.amplitude": amplitudes, "strip.height_ratio": heights}


def words_over(size):
    lengths = f"load.amplitude=0.2:2.2:{size[0]}", f"strip.height_ratio=0.03:0.4:{size[1]}:log"
    return [word for text in lengths for word in ("--over", text)]


@pytest.fixture(scope="module")
def alone():
    return jb.sweep(SCENE, over(SMALL), FIGURES)


def same(one, other):
    """To the last bit."""
    assert one.equals(other)


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
    same(alone, jb.sweep(SCENE, over(SMALL), FIGURES, executor=here))
    assert len(here.given) > 9
    assert all(isinstance(columns, np.ndarray) for (columns,) in here.given)
    with ThreadPoolExecutor(2) as pool:
        same(alone, jb.sweep(SCENE, over(SMALL), FIGURES, executor=pool))


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
        jb.sweep(SCENE, over(SMALL), FIGURES, executor=failing, out=out)
    assert "\n" not in str(caught.value)
    assert len(list(parts.glob("block-*"))) == len(failing.given) - 1
    rest = jb.sweep(SCENE, over(SMALL), FIGURES, executor=Here(), out=out)
    same(alone, rest)
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.csv"]


@pytest.mark.parametrize("answer", [None, (1, 2), Block(np.zeros((4, 3)), np.zeros(3, np.int8))])
def test_a_worker_that_answers_something_else_is_told(answer):
    class Wrong(Here):
        def submit(self, function, *arguments):
            future = Future()
            future.set_result(answer)
            return future

    with pytest.raises(UnconvergedError, match="give an executor that returns what it is told"):
        jb.sweep(SCENE, over(SMALL), FIGURES, executor=Wrong())


def test_an_executor_that_takes_no_blocks_is_told():
    with ThreadPoolExecutor(1) as pool:
        pass
    with pytest.raises(UnconvergedError, match=r"cannot run a block .RuntimeError: cannot"):
        jb.sweep(SCENE, over(SMALL), FIGURES, executor=pool)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"executor": "tcp://here:8786"}, "give a concurrent.futures.Executor"),
        ({"executor": ThreadPoolExecutor}, "give a concurrent.futures.Executor"),
        (
            {"executor": ProcessPoolExecutor(1, multiprocessing.get_context("fork"))},
            "forks this process",
        ),
    ],
)
def test_what_is_no_place_for_blocks_is_refused(given, says):
    with pytest.raises(InputError, match=says):
        jb.sweep(SCENE, over(SMALL), FIGURES, **given)


def test_workers_of_another_version_are_refused():
    about = Job(lanes_of(SCENE, over(SMALL)), SCENE, FIGURES).description()
    other = json.dumps(json.loads(about) | {"version": "0.0.1"})
    with pytest.raises(InputError, match=r"this process 0\.0\.1: install the same version"):
        runner_of(other)


# --- minutes --------------------------------------------------------------------------------------


def processes(count):
    return ProcessPoolExecutor(count, multiprocessing.get_context("spawn"))


@pytest.mark.slow
def test_two_processes_say_what_one_says_and_what_is_done_is_kept_if_one_is_killed(alone, tmp_path):
    with processes(2) as pool:
        same(alone, jb.sweep(SCENE, over(SMALL), FIGURES, executor=pool))
    out, killed = tmp_path / "sweep.csv", []

    def kill(done, total):
        if done and not killed:
            killed.append(multiprocessing.active_children()[0])
            killed[0].kill()

    with (
        processes(2) as pool,
        pytest.raises(UnconvergedError, match=r"its workers died .*keeps what is done"),
    ):
        jb.sweep(SCENE, over(SMALL), FIGURES, executor=pool, out=out, progress=kill)
    assert list((tmp_path / "sweep.csv.parts").glob("block-*"))
    rest = jb.sweep(SCENE, over(SMALL), FIGURES, out=out)
    same(alone, rest)
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
def test_a_dask_cluster_that_loses_a_worker_says_what_one_process_says(alone, tmp_path):
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
        found = jb.sweep(SCENE, over(SMALL), FIGURES, executor=executor, out=out, progress=kill)
        same(alone, found)
        assert out.read_text().count("\n") == alone["status"].size + 1
        words = [*SWEEP, *words_over(SMALL), "--json", "--dask", cluster.scheduler_address]
        said = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, timeout=300)
        assert json.loads(said.stdout)["failed"] == 0, said.stderr
    assert len(killed) == 2
    with pytest.raises(UnconvergedError, match="cannot run a block"):
        jb.sweep(SCENE, over(SMALL), FIGURES, executor=executor)
