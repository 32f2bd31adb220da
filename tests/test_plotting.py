"""Pictures: what is drawn is what was solved, with its axes labelled, and files are whole."""

import dataclasses

import matplotlib.pyplot as plt
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import plotting
from jbeamshell.errors import InputError

COARSE = {
    "model.nodes": 21,
    "load.steps_per_half_cycle": 6,
    "load.cycles": 2,
    "contact.stick_stiffness": 100.0,
}


@pytest.fixture(scope="module")
def history():
    return jb.solve(jb.Scene().replace(COARSE))


@pytest.fixture(scope="module")
def pull(history):
    # As many steps as the cycles, so that nothing compiles anew.
    return jb.solve(history.scene, np.linspace(0.03, 0.81, history.force.size - 1))


@pytest.fixture(autouse=True)
def _closed_figures():
    yield
    plt.close("all")


def labels(axes):
    return [text for panel in np.ravel(axes) for text in (panel.get_xlabel(), panel.get_ylabel())]


def drawn(axes):
    """Lines of the axes by label."""
    return {line.get_label(): line for line in axes.get_lines()}


class TestLoop:
    def test_draws_the_path_and_the_last_cycle(self, history):
        axes = plotting.loop(history)
        lines = drawn(axes)
        force, displacement = history.loop
        np.testing.assert_array_equal(lines["last cycle"].get_ydata(), force)
        np.testing.assert_array_equal(lines["last cycle"].get_xdata(), displacement)
        np.testing.assert_array_equal(lines["path"].get_ydata(), history.force)
        assert lines["last cycle"].get_linewidth() > lines["path"].get_linewidth()
        assert all(labels(axes))

    def test_draws_a_path_without_a_cycle(self, pull):
        assert list(drawn(plotting.loop(pull))) == ["path"]

    def test_draws_where_it_is_told(self, history):
        _, axes = plt.subplots()
        assert history.plot(axes) is axes


class TestProfiles:
    def test_labels_four_panels(self, history):
        axes = history.plot_profiles()
        assert axes.shape == (2, 2)
        assert all(labels(axes))
        assert all(panel.get_title() for panel in axes.ravel())

    def test_takes_turns_and_zero_crossings_of_the_last_cycle(self, history):
        traction = plotting.profiles(history).ravel()[2]
        # The second cycle: steps 15 to 27, through zero at 18 and 24, turning at 21.
        shown = [line.get_ydata() for line in traction.get_lines() if len(line.get_xdata()) == 21]
        np.testing.assert_allclose(shown, history.traction[np.array([18, 21, 24, 27])])
        legend = [text.get_text() for text in traction.get_legend().get_texts()]
        assert legend[0] == "$F = 0$, falling"
        assert legend[2] == "$F = 0$, rising"

    def test_takes_four_steps_of_a_pull(self, pull):
        slip = plotting.profiles(pull).ravel()[0]
        shown = [line.get_ydata() for line in slip.get_lines()]
        np.testing.assert_allclose(shown, pull.slip[np.array([7, 14, 20, 27])])

    def test_marks_what_slips(self, pull):
        traction = plotting.profiles(pull, [-1]).ravel()[2]
        dots = next(line for line in traction.get_lines() if line.get_marker() == "o")
        np.testing.assert_array_equal(dots.get_xdata(), pull.x[pull.slipping[-1]])
        assert len(dots.get_xdata()) > 0

    def test_shows_the_squeeze_strain_only_where_it_is_modelled(self, pull):
        flat_scene = pull.scene.replace({"model.fields": ["v", "beta"]})
        flat = dataclasses.replace(pull, scene=flat_scene)
        with_squeeze, without = (plotting.profiles(h, [-1]).ravel()[1] for h in (pull, flat))
        assert len(with_squeeze.get_lines()) == 2
        assert len(without.get_lines()) == 1

    def test_refuses_steps_off_the_path(self, pull):
        with pytest.raises(
            InputError, match="steps: 28 is not on the path, whose steps are 0 to 27"
        ):
            plotting.profiles(pull, [28])

    def test_refuses_other_than_four_axes(self, pull):
        with pytest.raises(InputError, match="four"):
            plotting.profiles(pull, axes=plt.subplots(1, 3)[1])


class TestOverlay:
    def test_draws_data_as_dots_and_the_model_as_lines(self):
        data = [(np.arange(3.0), np.arange(3.0) ** 2, "measured")] * 2
        model = [(np.arange(3.0), np.arange(3.0), "a"), (np.arange(3.0), -np.arange(3.0), "b")]
        axes = plotting.overlay(data, model, title="fit")
        styles = [(line.get_linestyle(), line.get_marker()) for line in axes.get_lines()]
        assert styles == [("-", "None")] * 2 + [("None", "o")] * 2
        np.testing.assert_array_equal(axes.get_lines()[2].get_xdata(), data[0][1])
        legend = [text.get_text() for text in axes.get_legend().get_texts()]
        assert legend == ["a", "b", "measured"]
        assert all(labels(axes))
        assert axes.get_title() == "fit"


class TestStyle:
    def test_leaves_the_settings_alone(self, history):
        before = dict(plt.rcParams)
        plotting.loop(history)
        plotting.profiles(history)
        assert dict(plt.rcParams) == before

    @pytest.mark.parametrize("count", [1, 6, 7, 20])
    def test_colours_differ(self, count):
        assert len({tuple(colour) for colour in plotting.colours(count)}) == count


class TestSave:
    @pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
    def test_writes_the_format_of_the_suffix(self, history, tmp_path, suffix):
        path = tmp_path / f"loop.{suffix}"
        plotting.save(plotting.loop(history).figure, path)
        start = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[suffix]
        assert path.read_bytes().startswith(start)

    def test_leaves_no_half_file(self, history, tmp_path, monkeypatch):
        path = tmp_path / "loop.png"
        path.write_text("old")
        figure = plotting.loop(history).figure

        def half(draft, **_):
            draft.write_text("half")
            raise OSError("disk full")

        monkeypatch.setattr(figure, "savefig", half)
        with pytest.raises(InputError, match="disk full"):
            plotting.save(figure, path)
        assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("loop.png", "old")]

    @pytest.mark.parametrize("name", ["loop", "loop.xyz"])
    def test_refuses_an_unknown_format(self, history, tmp_path, name):
        with pytest.raises(InputError, match=r"end the name in .*\.png"):
            plotting.save(plotting.loop(history).figure, tmp_path / name)
        assert not list(tmp_path.iterdir())
