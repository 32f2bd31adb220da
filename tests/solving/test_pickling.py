"""Pickles and copies: scenes, results and responses go to other processes and come back equal."""

import copy
import multiprocessing
import pickle

import jax
import numpy as np
import pytest
from scenes import FEW, PLANE

import jbeamshell as jb

COPIES = {
    "pickle": lambda made: pickle.loads(pickle.dumps(made)),
    "deep copy": copy.deepcopy,
}


@pytest.mark.parametrize("how", COPIES)
def test_scenes_histories_and_sweeps_are_copied_whole(how):
    history = jb.solve(PLANE, throw=False)
    table = PLANE.replace({"contact.pressure": [[0.0, 8.0], [2.0, 10.0]]})
    for made in (table, history):
        again = COPIES[how](made)
        assert jax.tree.structure(again) == jax.tree.structure(made)
        jax.tree.map(np.testing.assert_array_equal, again, made)
    bar = jb.Scene().replace(FEW | {"model.section": "bar"})
    sweep = jb.sweep(bar, {"load.amplitude": [0.5, 1.0]})
    again = COPIES[how](sweep)
    assert again.identical(sweep)


@pytest.mark.parametrize("how", COPIES)
def test_a_response_is_copied_whole(how):
    ask = jb.response(PLANE, ["load.amplitude"], ["dissipation", "loss_factor"])
    again = COPIES[how](ask)
    assert again is not ask
    np.testing.assert_equal(again(0.7), ask(0.7))


@pytest.mark.slow
@pytest.mark.parametrize("start", ["spawn", "forkserver"])
def test_a_process_started_anew_gives_the_same(start, monkeypatch):
    monkeypatch.setenv("JAX_ENABLE_X64", "1")
    ask = jb.response(jb.Scene(), ["load.amplitude"], ["dissipation", "loss_factor"])
    with multiprocessing.get_context(start).Pool(1) as pool:
        there = pool.apply(ask, (0.7,))
        history = pool.apply(jb.solve, (jb.Scene(),))
    for name, value in ask(0.7).items():
        np.testing.assert_allclose(there[name], value, rtol=1e-12)
    assert float(history.dissipation) == pytest.approx(
        float(jb.solve(jb.Scene()).dissipation), rel=1e-12
    )
