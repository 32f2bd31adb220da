"""Sweeps on executors of all kinds: equal to the last bit, and no lane lost with a worker."""

import contextlib
import json
import multiprocessing
import os
import pickle
import subprocess
import sys
import time
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
from jbeamshell.sweeping import executors, run
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
SMALL, LARGE = (60, 60), (300, 200)  # lanes: of the large there is time to kill somebody
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
    return jb.sweep(SCENE, over(SMALL), FIGURES, processes=1)


@pytest.fixture(scope="module")
def large():
    return jb.sweep(SCENE, over(LARGE), FIGURES, processes=1)


def same(one, other):
    """To the last bit."""
    np.testing.assert_array_equal(one.status, other.status)
    for name in one.values:
        np.testing.assert_array_equal(other[name], one[name])


def close(found, right):
    """To 1e-12, and where nothing slips of what the figure is elsewhere."""
    np.testing.assert_allclose(found, right, rtol=1e-12, atol=1e-12 * np.nanmax(np.abs(right)))


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
    assert all(isinstance(columns, np.ndarray) for _, _, columns in here.given)
    with ThreadPoolExecutor(2) as pool:
        same(alone, jb.sweep(SCENE, over(SMALL), FIGURES, executor=pool))


def test_blocks_that_are_lost_are_given_out_again(alone):
    """All of them once, and two workers on top of that."""
    died = BrokenExecutor("killed")
    first = [died] * len(Job(lanes_of(SCENE, over(SMALL)), FIGURES).blocks)
    hurt = Here(*first, died, None, None, died)
    found = jb.sweep(SCENE, over(SMALL), FIGURES, executor=hurt)
    same(alone, found)
    assert len(hurt.given) == 2 * len(first) + 2
    (note,) = found.notes
    assert "workers that were lost: 2, their blocks given out again" in note


@pytest.mark.parametrize(
    ("fault", "kind", "says"),
    [
        (BrokenExecutor("killed"), UnconvergedError, "lost 3 times .*BrokenExecutor: killed"),
        (ModuleNotFoundError("No module named 'jbeamshell'"), InputError, "install this version"),
        (MemoryError("no room"), UnconvergedError, "cannot run its block .MemoryError: no room"),
        (InputError("executor: is too old"), InputError, "executor: is too old"),
    ],
)
def test_workers_that_cannot_go_on_are_told_and_what_is_done_is_kept(
    fault, kind, says, alone, tmp_path
):
    out, parts = tmp_path / "sweep.csv", tmp_path / "sweep.csv.parts"
    count = len(Job(lanes_of(SCENE, over(SMALL)), FIGURES).blocks)
    failing = Here(*[None] * 5, *[fault] * 3 * count)
    with pytest.raises(kind, match=f"{says}.*; .*keeps what is done, and .* goes on") as caught:
        jb.sweep(SCENE, over(SMALL), FIGURES, executor=failing, out=out)
    assert "\n" not in str(caught.value)
    assert len(list(parts.glob("block-*"))) == 5
    rest = jb.sweep(SCENE, over(SMALL), FIGURES, executor=Here(), out=out)
    same(alone, rest)
    assert rest.computed < alone.computed
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
    with pytest.raises(InputError, match=r"takes no blocks .RuntimeError: cannot schedule new"):
        jb.sweep(SCENE, over(SMALL), FIGURES, executor=pool)

    class Broken(Here):
        def submit(self, function, *arguments):
            raise BrokenExecutor("a process died")

    with pytest.raises(UnconvergedError, match=r"its workers died .*: give a new one"):
        jb.sweep(SCENE, over(SMALL), FIGURES, executor=Broken())


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"executor": "tcp://here:8786"}, "give a concurrent.futures.Executor"),
        ({"executor": ThreadPoolExecutor}, "give a concurrent.futures.Executor"),
        ({"executor": Here(), "processes": 2}, "processes and executor: each says where"),
        ({"executor": Here(), "devices": []}, "executor and devices: each says where"),
        ({"devices": []}, "give a list such as"),
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
    about = Job(lanes_of(SCENE, over(SMALL)), FIGURES).description()
    other = json.dumps(json.loads(about) | {"version": "0.0.1"})
    with pytest.raises(InputError, match=r"this process 0\.0\.1: install the same version"):
        runner_of(other, [])


def test_several_processes_take_over_where_they_pay(alone, monkeypatch):
    job = Job(lanes_of(SCENE, over(SMALL)), FIGURES)
    monkeypatch.setattr(os, "cpu_count", lambda: 8)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(6), raising=False)
    for load, cores in ((0.3, 6), (1.0, 6), (4.2, 4), (9.0, 1)):
        monkeypatch.setattr(os, "getloadavg", lambda load=load: (load, 0.0, 0.0), raising=False)
        assert executors._cores() == cores
    monkeypatch.setattr(executors, "_cores", lambda: 4)
    assert executors.processes_that_pay(job, rest_s=60.0, compile_s=10.0, blocks=9) == 4
    assert executors.processes_that_pay(job, rest_s=60.0, compile_s=10.0, blocks=3) == 3
    assert executors.processes_that_pay(job, rest_s=60.0, compile_s=10.0, blocks=1) == 1
    assert executors.processes_that_pay(job, rest_s=30.0, compile_s=10.0, blocks=9) == 1
    taken = []

    def pays(job, rest_s, compile_s, blocks):
        return 2 if blocks < len(job.blocks) - 3 else 1

    def taking(job, numbers, count, losses):
        taken.extend(numbers)
        yield from executors.on_executor(job, numbers, Here(), losses)

    monkeypatch.setattr(run, "processes_that_pay", pays)
    monkeypatch.setattr(run, "in_processes", taking)
    same(alone, jb.sweep(SCENE, over(SMALL), FIGURES))
    assert taken == list(range(4, len(job.blocks)))
    jb.sweep(SCENE, over(SMALL), FIGURES, processes=1)
    assert len(taken) == len(job.blocks) - 4


def test_processes_are_started_anew_where_they_die(alone, monkeypatch):
    """Two crews finish three blocks each before they are gone; the third ends the sweep."""
    died, begun = BrokenExecutor("killed"), []
    blocks = len(Job(lanes_of(SCENE, over(SMALL)), FIGURES).blocks)

    class Mortal(Here):
        def submit(self, function, *arguments):
            if not self.faults:
                raise died
            return super().submit(function, *arguments)

    @contextlib.contextmanager
    def crew(count, environment):
        done = 3 * len(begun)
        begun.append(environment["JAX_PLATFORMS"])
        yield Mortal(*[None] * 3, *[died] * (blocks - done - 3)) if len(begun) < 3 else Here()

    monkeypatch.setattr(executors, "processes", crew)
    found = jb.sweep(SCENE, over(SMALL), FIGURES, processes=2)
    same(alone, found)
    assert begun == ["cpu"] * 3
    assert found.notes == ("workers that were lost: 2, their blocks given out again",)
    monkeypatch.setattr(executors, "processes", lambda *_: contextlib.nullcontext(Mortal()))
    with pytest.raises(UnconvergedError, match="lost 3 times without"):
        jb.sweep(SCENE, over(SMALL), FIGURES, processes=2)


def test_two_processes_say_what_one_says(alone):
    two = jb.sweep(SCENE, over(SMALL), FIGURES, processes=2)
    same(alone, two)
    assert (two.notes, two.computed) == ((), alone.computed)
    assert not multiprocessing.active_children()


# --- minutes --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_two_processes_say_what_one_says_even_if_one_is_killed(alone):
    killed = []

    def kill(done, total):
        if done and not killed:
            killed.append(multiprocessing.active_children()[0])
            killed[0].kill()

    two = jb.sweep(SCENE, over(SMALL), FIGURES, processes=2, progress=kill)
    same(alone, two)
    assert two.notes == ("workers that were lost: 1, their blocks given out again",)
    assert two.computed == alone.computed
    assert not multiprocessing.active_children()


@pytest.mark.slow
def test_processes_that_keep_dying_are_given_up_and_what_is_done_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(executors, "_environment", lambda: {"JAX_PLATFORMS": "none"})
    out = tmp_path / "sweep.csv"
    with pytest.raises(UnconvergedError, match=r"cannot run its block .*goes on"):
        jb.sweep(SCENE, over(SMALL), FIGURES, processes=2, out=out)

    def kill(done, total):
        for process in multiprocessing.active_children():
            process.kill()

    monkeypatch.undo()
    monkeypatch.setattr(executors, "TRIES", 1)
    with pytest.raises(UnconvergedError, match=r"lost 1 times .*goes on"):
        jb.sweep(SCENE, over(SMALL), FIGURES, processes=2, out=out, progress=kill)
    assert list((tmp_path / "sweep.csv.parts").glob("block-*"))
    assert not out.exists()


@pytest.mark.slow
def test_a_script_without_a_guard_sweeps_in_processes(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "print('once')\nimport jbeamshell as jb\n"
        f"over = {{'load.amplitude': [0.1 * i for i in range(1, 19)]}}\n"
        f"found = jb.sweep(jb.Scene().replace({TINY}), over, processes=2)\n"
        "print(found.failed)\n"
    )
    said = {"capture_output": True, "text": True, "timeout": 300}
    done = subprocess.run([sys.executable, script], env=ENVIRONMENT, **said)
    assert (done.returncode, done.stdout.split()) == (0, ["once", "0"]), done.stderr


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of dask
def test_a_dask_cluster_that_loses_a_worker_says_what_one_process_says(large, tmp_path):
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
        found = jb.sweep(SCENE, over(LARGE), FIGURES, executor=executor, out=out, progress=kill)
        same(large, found)
        assert found.computed == large.computed
        assert out.read_text().count("\n") == large.status.size + 1
        words = [*SWEEP, *words_over(SMALL), "--json", "--dask", cluster.scheduler_address]
        said = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, timeout=300)
        assert json.loads(said.stdout)["failed"] == 0, said.stderr
    assert len(killed) == 2
    with pytest.raises(InputError, match="takes no blocks"):
        jb.sweep(SCENE, over(SMALL), FIGURES, executor=executor)


@pytest.mark.slow
@pytest.mark.parametrize("devices", [2, 4])
def test_devices_say_what_one_says(alone, devices):
    flags = f"{os.environ.get('XLA_FLAGS', '')} --xla_force_host_platform_device_count={devices}"
    out, err = start("--json", XLA_FLAGS=flags).communicate(timeout=300)
    found = json.loads(out, parse_constant=pytest.fail)
    assert found["computed"] == alone.computed, err
    for name, right in alone.values.items():
        close(np.array(found["values"][name], float), right)


@pytest.mark.slow
@pytest.mark.parametrize("hands", [1, 2])
def test_a_sweep_that_was_killed_goes_on(large, hands, tmp_path):
    out, parts = tmp_path / "sweep.csv", tmp_path / "sweep.csv.parts"
    process = start("--out", out, "--processes", hands, size=LARGE)
    wait_for_blocks(parts, 3, process)
    process.kill()
    process.communicate()
    left = len(list(parts.glob("block-*")))
    assert left >= 3
    rest = jb.sweep(SCENE, over(LARGE), FIGURES, out=out)
    for name, right in large.values.items():  # the command compiles faster loops
        close(rest[name], right)
    assert 0 < rest.computed < large.computed
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.csv"]


def start(*words, size=SMALL, **variables):
    return subprocess.Popen(
        [*SWEEP, *words_over(size), *map(str, words)],
        env=ENVIRONMENT | variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for_blocks(parts: Path, count, process, limit=120.0):
    end = time.monotonic() + limit
    while len(list(parts.glob("block-*"))) < count:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.01)
