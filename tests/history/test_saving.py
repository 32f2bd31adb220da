"""Scenes and histories that are saved and read give equal results to the last bit."""

import io
import json
import os
import pickle

import jax
import numpy as np
import pytest
from scenes import STEPPED, held_at

import jbeamshell as jb
from jbeamshell.common.arrays import read_arrays, write_arrays

PATH = held_at([0.5, 1.0, 0.25, -0.5, -0.25, 0.25, 1.0, 0.25, -0.5])


def same(one, other):
    """Check that two histories have equal words, cycles and bits."""
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for (place, a), b in zip(
        jax.tree_util.tree_leaves_with_path(one), jax.tree.leaves(other), strict=True
    ):
        assert a.dtype == b.dtype, place
        np.testing.assert_array_equal(a, b, err_msg=jax.tree_util.keystr(place))


@pytest.fixture(scope="module")
def history():
    return jb.solve(STEPPED, PATH, throw=False)


@pytest.fixture(scope="module")
def saved(history, tmp_path_factory):
    path = tmp_path_factory.mktemp("history") / "a name with\nmuch in it.npz"
    history.save(path)
    return path


def test_a_saved_history_is_the_same_to_the_last_bit(history, saved):
    again = jb.read_history(saved)
    same(again, history)
    assert len(again.cycles) > 0
    assert again.dissipation == history.dissipation > 0.0
    assert type(again.sections) is type(history.sections)
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]


def test_a_scene_read_again_has_the_same_answer(history, tmp_path):
    third = STEPPED.replace({"contact.friction": 1.0 / 30.0 + 0.1})
    jb.write_scene(third, tmp_path / "scene.toml")
    again = jb.read_scene(tmp_path / "scene.toml")
    one, other = (jb.solve(scene, PATH, by="steps", throw=False) for scene in (third, again))
    same(one, other)
    assert one.dissipation != history.dissipation


def test_the_end_of_the_path_that_files_of_before_hold_is_left_out(history, saved, tmp_path):
    end = {"end.state.target": np.array(-0.5), "end.state.converged": np.array(True)}
    write_arrays(tmp_path / "before.npz", read_arrays(saved) | end)
    same(jb.read_history(tmp_path / "before.npz"), history)


def test_a_file_without_an_array_says_which(saved, tmp_path):
    arrays = read_arrays(saved)
    del arrays["slip_work"]
    write_arrays(tmp_path / "less.npz", arrays)
    with pytest.raises(jb.InputError, match=r"less\.npz: slip_work is missing"):
        jb.read_history(tmp_path / "less.npz")


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
        "lacking one": replaced(path, slip_work=None),
        "shorter": replaced(path, displacement=displacement[:-1]),
        "turned": replaced(path, displacement=displacement[:, None]),
        "single": replaced(path, displacement=displacement.astype(np.float32)),
        "complex": replaced(path, displacement=displacement * 1j),
        "of words": replaced(path, displacement=np.array(["a"] * 21)),
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


def test_places_that_are_no_file(history, tmp_path):
    for path in (tmp_path, tmp_path / "none.npz", tmp_path / ("a" * 300), "a\0b", 3, None):
        with pytest.raises(jb.InputError, match=r"cannot be read|is no file name"):
            jb.read_history(path)
    with (tmp_path / "giant.npz").open("wb") as file:
        os.truncate(file.fileno(), 10**9)
    with pytest.raises(jb.InputError, match="cannot be read as a history"):
        jb.read_history(tmp_path / "giant.npz")
    for path in (tmp_path / "none" / "a.npz", tmp_path / "a.csv", "a\0b.npz", 3, "/dev/full"):
        with pytest.raises(jb.InputError):
            history.save(path)
    assert [path.name for path in tmp_path.iterdir()] == ["giant.npz"]


@pytest.mark.parametrize("at", ["numpy.savez", "pathlib.Path.replace"])
def test_a_disk_that_is_full_leaves_the_file_that_was_there(history, saved, monkeypatch, at):
    before = saved.read_bytes()

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(at, full)
    with pytest.raises(jb.InputError, match=r"cannot be written \(No space left on device"):
        history.save(saved)
    monkeypatch.undo()
    assert saved.read_bytes() == before
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]


def test_ones_own_functions_stay_in_code(tmp_path, history):
    own = jb.Scene(energy=lambda *strains: strains[0] ** 2)
    with pytest.raises(jb.InputError, match="cannot be written to TOML"):
        history.but(scene=own).save(tmp_path / "own.npz")
    assert not list(tmp_path.iterdir())


def test_double_precision_is_not_halved_quietly(saved):
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(jb.InputError, match=r"is in double precision: write jax\.config"):
            jb.read_history(saved)
    finally:
        jax.config.update("jax_enable_x64", True)
