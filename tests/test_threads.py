"""Threads at once: each answers as if it were alone, and the process is as it was."""

import os
import sys
import threading
import warnings

import numpy as np
import pytest
from identify.test_law_fits import loops
from threadpoolctl import threadpool_info, threadpool_limits

import jbeamshell as jb
from jbeamshell import identify, laws
from jbeamshell.common.files import write_text
from jbeamshell.common.progress import bar
from jbeamshell.common.threads import VARIABLE, on_one_core
from jbeamshell.common.workers import without_main

TINY = {"model.nodes": 9, "load.steps_per_half_cycle": 2, "load.cycles": 1}
OVER = {"load.amplitude": np.linspace(0.2, 1.5, 40), "strip.height_ratio": [0.05, 0.1, 0.2]}


def at_once(jobs):
    """Answers of functions that begin together, each in a thread; an error of one is raised."""
    together, answers, errors = threading.Barrier(len(jobs)), [None] * len(jobs), []

    def go(place):
        try:
            together.wait()
            answers[place] = jobs[place]()
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=go, args=(place,)) for place in range(len(jobs))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if errors:
        raise errors[0]
    return answers


def state():
    """Settings of the process that threads share."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask, sys.modules["__main__"], list(warnings.filters)


def test_threads_leave_the_process_as_it_was(tmp_path):
    before = state()

    def work(name):
        for _ in range(30):
            with without_main():
                write_text(tmp_path / name, name)
            with bar(name):
                pass

    at_once([lambda name=name: work(name) for name in "abcdefgh"])
    assert state() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == list("abcdefgh")
    assert {path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {0o666 & ~before[0]}


@pytest.mark.slow
def test_solves_sweeps_and_fits_at_once_answer_as_alone(tmp_path):
    def solved(scene):
        history = jb.solve(scene)
        return [history.force, history.displacement, history.traction, history.dissipation]

    def swept(scene, name):
        found = jb.sweep(scene, OVER, ["dissipation", "secant_stiffness"], out=tmp_path / name)
        return [found["dissipation"], found["secant_stiffness"], found["status"]]

    def fitted(data):
        found = identify.fit(data, "jenkins", starts=1)
        return [list(found.values.values()), list(found.errors.values())]

    scenes = [jb.Scene().replace(TINY | {"contact.friction": mu}) for mu in (0.1, 0.2)]
    scenes.append(scenes[0].replace({"model.kinematics": "linear"}).by_load_steps())
    data = [
        loops(laws.Jenkins(limit, 100.0), np.random.default_rng(1), sizes=(0.03,))
        for limit in (1.0, 1.2)
    ]
    jobs = [lambda one=one: solved(one) for one in scenes]
    jobs += [lambda i=i, one=one: swept(one, f"{i}.csv") for i, one in enumerate(scenes)]
    jobs += [lambda one=one: fitted(one) for one in data]
    for found, alone in zip(at_once(jobs), [job() for job in jobs], strict=True):
        assert all(map(np.array_equal, found, alone))


def test_lapack_has_one_thread_while_a_strip_is_solved_and_is_left_as_it_was(monkeypatch):
    def threads():
        found = [library for library in threadpool_info() if library["user_api"] == "blas"]
        return {library["num_threads"] for library in found}

    asked = on_one_core(threads)
    with threadpool_limits(2, user_api="blas"):
        monkeypatch.setenv(VARIABLE, "2")
        assert asked() == {2}  # whatever it says: whoever set it has read it
        monkeypatch.delenv(VARIABLE)
        assert asked() == {1}
        assert threads() == {2}
        overlap()
        assert threads() == {2}


def overlap():
    """Two calls in threads of their own, of which the first one to come is the first to leave."""
    inside, go_on = threading.Barrier(2), threading.Event()

    def last():
        inside.wait()
        go_on.wait()

    jobs = [on_one_core(inside.wait), on_one_core(last)]
    workers = [threading.Thread(target=job) for job in jobs]
    for worker in workers:
        worker.start()
    workers[0].join()
    go_on.set()
    workers[1].join()
