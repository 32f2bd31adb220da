"""Scenes and histories that are saved, read and continued give equal results to the last bit."""

import dataclasses
import io
import json
import os
import pickle

import jax
import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from jbeamshell.load_steps.continuation import PathEnd
from jbeamshell.scene.parts import unit_path

OWN = STRIP.replace(
    {
        "model.nodes": 9,
        "model.kinematics": "linear",
        "load.steps_per_half_cycle": 2,
        "load.cycles": 1,
    }
)
SCENE = OWN.pinned()
FIRST = np.array([0.5, 1.0, 0.25, -0.5, -0.25])  # as many as its own, so that less is compiled
MORE = np.array([0.25, 1.0, 0.25, -0.5])


def same(one, other):
    """Check that two histories have equal words, cycles and bits."""
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for (place, a), b in zip(
        jax.tree_util.tree_leaves_with_path(one), jax.tree.leaves(other), strict=True
    ):
        assert a.dtype == b.dtype, place
        np.testing.assert_array_equal(a, b, err_msg=jax.tree_util.keystr(place))


@pytest.fixture(scope="module")
def whole():
    return jb.solve(SCENE, np.append(FIRST, MORE), throw=False)


@pytest.fixture(scope="module")
def begun():
    return jb.solve(SCENE, FIRST, throw=False)


@pytest.fixture(scope="module")
def saved(begun, tmp_path_factory):
    path = tmp_path_factory.mktemp("history") / "a name with\nmuch in it.npz"
    begun.save(path)
    return path


def test_a_saved_history_is_the_same_to_the_last_bit(begun, saved):
    again = jb.read_history(saved)
    same(again, begun)
    assert type(again.sections) is type(begun.sections)
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]


def test_what_was_saved_goes_on_as_if_nothing_had_been(whole, saved):
    end = jb.read_history(saved).continued(MORE, throw=False)
    same(end, whole)
    assert end.cycles == whole.cycles
    assert len(end.cycles) > 0
    assert end.dissipation == whole.dissipation > 0.0


def test_a_scene_read_again_has_the_same_answer(whole, tmp_path):
    third = OWN.replace({"contact.friction": 1.0 / 30.0 + 0.1})
    jb.write_scene(third, tmp_path / "scene.toml")
    again = jb.read_scene(tmp_path / "scene.toml")
    path = np.append(FIRST, MORE)
    one, other = (jb.solve(scene, path, by="steps", throw=False) for scene in (third, again))
    same(one, other)
    assert one.dissipation != whole.dissipation


def test_one_step_after_the_other_is_the_same(whole, begun):
    history = begun
    for load in MORE:
        history = history.continued([load], throw=False)
    same(history, whole)


def test_the_scenes_own_cycles_go_on():
    one = jb.solve(SCENE, throw=False)
    two = one.continued(throw=False)
    assert len(one.cycles) == 1
    assert len(two.cycles) == 2
    path = unit_path(2, SCENE.plan.steps) * float(SCENE.load.amplitude)
    same(two, jb.solve(SCENE, path, throw=False))


def test_what_cannot_go_on_says_why(begun):
    for path, told in ((None, "the last load is -0.25, not load.amplitude = 0.785"), ("x", "give")):
        with pytest.raises(jb.InputError, match=told):
            begun.continued(path)
    with pytest.raises(jb.InputError, match="must stay below gross slip"):
        begun.continued([2.5])
    with pytest.raises(jb.InputError, match="was made by hand"):
        dataclasses.replace(begun, end=None).continued(MORE)
    lost = PathEnd(begun.end.state._replace(converged=np.array(False)))
    with pytest.raises(jb.InputError, match="found no equilibrium: go on from one that did"):
        dataclasses.replace(begun, end=lost).continued(MORE)


def test_a_path_that_goes_on_to_where_nothing_converges_is_loud(begun, monkeypatch):
    monkeypatch.setattr("jbeamshell.load_steps.recovery.PIECES", ())
    hasty = jb.Newton(max_iterations=1, tolerance=1e-18)
    with pytest.raises(jb.UnconvergedError, match=r"load step [6-9] of 9 \(load \S+\) found"):
        begun.continued(MORE, solver=hasty)
    quiet = begun.continued(MORE, solver=hasty, throw=False)
    failed = np.asarray(quiet.status) != 0
    assert failed.tolist() == sorted(failed)
    assert not failed[:6].any()
    assert failed[-1]
    np.testing.assert_array_equal(np.isnan(quiet.displacement), failed)


# --- files that are none --------------------------------------------------------------------------


class Evil:
    """Makes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def replaced(path, **arrays):
    """Contents of the file with other arrays; None removes one."""
    with np.load(path, allow_pickle=False) as file:
        held = dict(file) | arrays
    data = io.BytesIO()
    np.savez(data, **{name: a for name, a in held.items() if a is not None}, allow_pickle=True)
    return data.getvalue()


def with_about(path, **values):
    with np.load(path) as file:
        about = json.loads(str(file["about"])) | values
    return replaced(path, about=np.array(json.dumps(about)))


def damaged(path, evil):
    """Contents of damaged histories, by the damage."""
    good = path.read_bytes()
    with np.load(path) as file:
        displacement = file["displacement"]
    other = io.BytesIO()
    np.savez(other, force=np.arange(9.0))
    flipped = bytearray(good)
    flipped[good.index(displacement.tobytes()) + 9] ^= 255
    return {
        "empty": b"",
        "text": b"force,displacement\n1,2\n",
        "cut": good[: len(good) // 2],
        "without its end": good[:-30],
        "flipped": bytes(flipped),
        "pickle": pickle.dumps(Evil(evil)),
        "pickled array": replaced(path, displacement=np.array([Evil(evil)], object)),
        "pickled about": replaced(path, about=np.array([Evil(evil)], object)),
        "of other arrays": other.getvalue(),
        "lacking one": replaced(path, **{"end.state.reversal.depth": None}),
        "shorter": replaced(path, displacement=displacement[:-1]),
        "turned": replaced(path, displacement=displacement[:, None]),
        "single": replaced(path, displacement=displacement.astype(np.float32)),
        "complex": replaced(path, displacement=displacement * 1j),
        "of words": replaced(path, displacement=np.array(["a"] * 5)),
        "of another format": with_about(path, format="jbeamshell history 2"),
        "no scene": with_about(path, scene=""),
        "no toml": with_about(path, scene="[strip"),
        "another scene": with_about(path, scene="[model]\nnodes = 11\n"),
        "hostile scene": with_about(path, scene="[strip]\nlength = nan\n"),
        "hostile type": with_about(path, dtype="object"),
        "hostile cycles": with_about(path, cycles=[["a", None, {}]]),
        "no json": replaced(path, about=np.array("{")),
    }


def test_files_that_are_none_are_one_clear_line_and_execute_nothing(saved, tmp_path):
    evil, path = tmp_path / "evil", tmp_path / "broken.npz"
    kinds = damaged(saved, evil)
    for kind, content in kinds.items():
        path.write_bytes(content)
        with pytest.raises(jb.InputError) as caught:
            jb.read_history(path)
        assert len(str(caught.value).splitlines()) == 1, kind
        assert str(path) in str(caught.value), kind
        assert "save it again" in str(caught.value), kind
    assert not evil.exists()
    pickle.loads(kinds["pickle"]).close()
    assert evil.exists()  # it would have


def test_places_that_are_no_file(begun, tmp_path):
    for path in (tmp_path, tmp_path / "none.npz", tmp_path / ("a" * 300), "a\0b", 3, None):
        with pytest.raises(jb.InputError, match=r"cannot be read|is no file name"):
            jb.read_history(path)
    with (tmp_path / "giant.npz").open("wb") as file:
        os.truncate(file.fileno(), 10**9)
    with pytest.raises(jb.InputError, match="cannot be read as a history"):
        jb.read_history(tmp_path / "giant.npz")
    for path in (tmp_path / "none" / "a.npz", tmp_path / "a.csv", "a\0b.npz", 3, "/dev/full"):
        with pytest.raises(jb.InputError):
            begun.save(path)
    assert [path.name for path in tmp_path.iterdir()] == ["giant.npz"]


@pytest.mark.parametrize("at", ["numpy.savez", "pathlib.Path.replace"])
def test_a_disk_that_is_full_leaves_the_file_that_was_there(begun, saved, monkeypatch, at):
    before = saved.read_bytes()

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(at, full)
    with pytest.raises(jb.InputError, match=r"cannot be written \(No space left on device"):
        begun.save(saved)
    monkeypatch.undo()
    assert saved.read_bytes() == before
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]


def test_ones_own_functions_stay_in_code(tmp_path, begun):
    own = jb.Scene(energy=lambda *strains: strains[0] ** 2)
    history = jb.History(**vars(begun) | {"scene": own})
    with pytest.raises(jb.InputError, match="cannot be written to TOML"):
        history.save(tmp_path / "own.npz")
    assert not list(tmp_path.iterdir())


def test_double_precision_is_not_halved_quietly(saved):
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(jb.InputError, match=r"is in double precision: write jax\.config"):
            jb.read_history(saved)
    finally:
        jax.config.update("jax_enable_x64", True)


def test_a_cycle_that_goes_on_is_none_where_the_pressures_do_not_close():
    path = [[0.2, 1.0], [-0.2, 1.0]]
    begun = jb.solve(OWN, path, by="steps", throw=False)
    assert len(begun.continued([[0.2, 1.0]], throw=False).cycles) == 1
    assert begun.continued([[0.2, 0.9]], throw=False).cycles == ()
