"""Pictures: what is drawn is what was solved, with its axes labelled, and files are whole."""

import dataclasses
import itertools
from types import SimpleNamespace

import jax
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image
from toy import STRIP

import jbeamshell as jb
from jbeamshell import plotting
from jbeamshell.common.errors import InputError
from jbeamshell.identify.profile_likelihood import Profile
from jbeamshell.plotting.style import LIFTED, SLIPS, STICKS

COARSE = {
    "model.nodes": 21,
    "model.kinematics": "linear",
    "load.steps_per_half_cycle": 6,
    "load.cycles": 2,
    "contact.stick_stiffness": 100.0,
}


@pytest.fixture(scope="module")
def history():
    with pytest.warns(jb.DoubtfulWarning, match="few nodes"):
        return jb.solve(STRIP.replace(COARSE))


@pytest.fixture(scope="module")
def pull(history):
    # As many steps as the cycles, so that nothing compiles anew.
    return jb.solve(history.scene, np.linspace(0.03, 0.81, history.force.size - 1))


@pytest.fixture(scope="module")
def clamped():
    """A strip that is clamped over X < 5, lifts off beyond, and is pulled to and fro."""
    patch = [[0.0, 100.0], [5.0, 100.0], [5.0, 0.0], [15.0, 0.0]]
    values = {
        "strip.length": 15.0,
        "strip.half_height": 0.5,
        "contact.pressure": patch,
        "load.amplitude": 30.0,
        "load.pressure_steps": 4,
        "load.cycles": 1,
        "model.section": "squeeze",
        "model.nodes": 61,
    }
    return jb.solve(STRIP.replace(COARSE | values), throw=False)


@pytest.fixture(scope="module")
def pressing(clamped):
    """The clamped strip under the growing pressure alone."""
    steps = clamped.force.size
    cut = jax.tree.map(lambda a: a[:4] if a.shape[:1] == (steps,) else a, clamped)
    return dataclasses.replace(cut, cycles=())


def with_scene(history, **values):
    """The history as if of another scene."""
    keys = {key.replace("_", ".", 1): value for key, value in values.items()}
    return dataclasses.replace(history, scene=history.scene.replace(keys))


@pytest.fixture(autouse=True)
def _closed_figures():
    yield
    plt.close("all")


def luminance(colour):
    return float(np.dot(to_rgb(colour), (0.299, 0.587, 0.114)))


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


class TestProfiles:
    def test_takes_turns_and_zero_crossings_of_the_last_cycle(self, history):
        traction = plotting.profiles(history).ravel()[2]
        # The second cycle: steps 15 to 27, through zero at 18 and 24, turning at 21.
        shown = [line.get_ydata() for line in traction.get_lines() if len(line.get_xdata()) == 21]
        np.testing.assert_allclose(shown, history.traction[np.array([18, 21, 24, 27])])
        legend = [text.get_text() for text in traction.get_legend().get_texts()]
        assert legend[0] == "$F = 0$, falling"
        assert legend[2] == "$F = 0$, rising"

    def test_marks_what_slips(self, pull):
        traction = plotting.profiles(pull, [-1]).ravel()[2]
        dots = next(line for line in traction.get_lines() if line.get_marker() == "o")
        np.testing.assert_array_equal(dots.get_xdata(), pull.x[pull.slipping[-1]])
        assert len(dots.get_xdata()) > 0

    def test_shows_the_squeeze_strain_only_where_it_is_modelled(self, pull):
        flat_scene = pull.scene.replace({"model.section": "shell"})
        flat = dataclasses.replace(pull, scene=flat_scene)
        with_squeeze, without = (plotting.profiles(h, [-1]).ravel()[1] for h in (pull, flat))
        assert len(with_squeeze.get_lines()) == 2
        assert len(without.get_lines()) == 1

    def test_counts_the_squeeze_strain_from_the_pressed_strip(self, clamped):
        rotation = plotting.profiles(clamped, [-1]).ravel()[1]
        change = clamped.psi[-1] - clamped.psi[3]
        np.testing.assert_array_equal(rotation.get_lines()[1].get_ydata(), change)

    def test_takes_steps_of_the_pressure_where_nothing_else_happens(self, pressing):
        legend = plotting.profiles(pressing).ravel()[2].get_legend().get_texts()
        shares = ["25 % of $F_N$", "50 % of $F_N$", "75 % of $F_N$", "100 % of $F_N$", "slips"]
        assert [text.get_text() for text in legend] == shares


class TestContact:
    NAMES = ("reaction", "gap", "beta", "squeeze_stress", "psi", "squeeze_couple")

    def test_draws_all_profiles_of_the_scene(self, clamped):
        panels = clamped.plot_contact([-1])
        assert panels.shape == (6,)
        assert all(labels(panels))
        for name, panel in zip(self.NAMES, panels, strict=True):
            curve = next(line for line in panel.get_lines() if line.get_color() == "#0072B2")
            values = getattr(clamped, name)[-1]
            x = clamped.x if values.size == clamped.x.size else clamped.middles
            np.testing.assert_array_equal(curve.get_xdata(), x)
            np.testing.assert_array_equal(curve.get_ydata(), values)

    def test_takes_the_pressed_strip_and_the_turns_of_the_last_cycle(self, clamped):
        gap = plotting.contact(clamped, panels=["gap"])[0]
        shown = [line.get_ydata() for line in gap.get_lines() if len(line.get_xdata()) == 61]
        np.testing.assert_array_equal(shown, clamped.gap[np.array([3, 12, 18])])
        legend = [text.get_text() for text in gap.figure.legends[0].get_texts()]
        assert legend == ["$F = 0$", "$F = -30$", "$F = 30$", "contact ends"]

    def test_takes_the_end_of_a_path_without_a_cycle(self, pull):
        panel = plotting.contact(pull, panels=["beta"])[0]
        np.testing.assert_array_equal(panel.get_lines()[0].get_ydata(), pull.beta[-1])
        assert len(panel.get_lines()) == 1

    def test_shows_the_corners_of_the_pressure_that_acts(self, pressing):
        reaction = plotting.contact(pressing, [1, 2])[0]
        x, pressure = reaction.get_lines()[0].get_data()
        np.testing.assert_array_equal(x, [0, 0, 5, 5, 15, 15])
        np.testing.assert_array_equal(pressure, [75, 75, 75, 0, 0, 0])

    def test_marks_the_ends_of_contact(self, clamped):
        steps = [3, 12, 18]
        for panel in plotting.contact(clamped, steps):
            marks = [line for line in panel.get_lines() if line.get_linestyle() == ":"]
            ends = [line.get_xdata()[0] for line in marks]
            np.testing.assert_array_equal(ends, clamped.contact_end[np.array(steps)])

    def test_puts_a_reference_beside_it(self, clamped):
        reference = {"gap": ([4.0, 5.0, 6.0], [0.0, 0.1, 0.2])}
        panels = plotting.contact(clamped, [-1], reference=reference, reference_label="test")
        dots = [[line for line in p.get_lines() if line.get_marker() == "o"] for p in panels]
        assert [len(d) for d in dots] == [0, 1, 0, 0, 0, 0]
        np.testing.assert_array_equal(dots[1][0].get_xydata().T, reference["gap"])
        assert panels[1].get_ylim()[1] > 0.2
        legend = panels[0].figure.legends[0]
        assert "test" in [text.get_text() for text in legend.get_texts()]

    def test_draws_only_what_is_modelled(self, clamped, history):
        assert len(plotting.contact(history)) == 6
        held = with_scene(history, contact_normal="held")
        assert len(plotting.contact(held)) == 5  # no lift
        flat = with_scene(held, model_section="shell")
        assert [p.get_title() for p in plotting.contact(flat)] == ["normal reaction", "rotation"]
        assumed = with_scene(clamped, model_section="assumed")
        assert len(plotting.contact(assumed)) == 5  # no squeeze couple

    def test_without_a_foundation_shows_the_rise_and_no_reaction(self, clamped):
        free = with_scene(clamped, contact_normal="none")
        panels = plotting.contact(free, [-1])
        assert panels[0].get_title() == "rise of the bottom face"
        assert [len(p.get_lines()) for p in panels] == [1, 1, 2, 1, 1]
        stress = panels[2].get_lines()[0].get_ydata()
        np.testing.assert_array_equal(stress, [-100, -100, -100, 0, 0, 0])


class TestContactMap:
    @staticmethod
    def cells(axes):
        """States (steps, nodes), and the edges along the path and along X."""
        mesh = axes.collections[0]
        edges = mesh.get_coordinates()
        return mesh.get_array().T, edges[0, :, 0], edges[:, 0, 1]

    def test_tells_lifted_stuck_and_slipping_nodes_apart(self, clamped):
        axes = clamped.plot_contact_map()
        states, _, across = self.cells(axes)
        touching, slipping = np.asarray(clamped.touching)[3:], np.asarray(clamped.slipping)[3:]
        np.testing.assert_array_equal(states == 0, ~touching)
        np.testing.assert_array_equal(states == 2, touching & slipping)
        assert {0, 1, 2} == set(states.ravel().tolist())
        np.testing.assert_allclose(np.diff(across), clamped.tributary)
        legend = [text.get_text() for text in axes.get_legend().get_texts()]
        assert legend == ["lifted", "sticks", "slips", "contact ends"]
        assert all(labels(axes))

    def test_goes_by_the_pressure_where_only_that_grows(self, pressing):
        axes = plotting.contact_map(pressing)
        states, along, _ = self.cells(axes)
        np.testing.assert_array_equal(along, [0.0, 0.25, 0.5, 0.75, 1.0])
        np.testing.assert_array_equal(states, pressing.touching)
        legend = [text.get_text() for text in axes.get_legend().get_texts()]
        assert legend == ["lifted", "touches", "contact ends"]

    def test_leaves_steps_without_equilibrium_blank(self, clamped):
        lost = {name: getattr(clamped, name).at[15:].set(np.nan) for name in ("force", "reaction")}
        axes = plotting.contact_map(dataclasses.replace(clamped, **lost))
        np.testing.assert_array_equal(self.cells(axes)[0].mask.all(axis=1), np.arange(16) >= 12)
        ticks = [text.get_text() for text in axes.get_xticklabels()]
        assert ticks == ["$0$", "$30$", "$-30$", "$-10$"]


class TestLikelihoods:
    PROFILES = (
        Profile("mu", np.array([0.1, 0.2, 0.4]), np.array([4.0, 0.0, 5.0]), (0.11, 0.38), 0.95),
        Profile("kappa_s", np.array([0.1, 0.2]), np.array([4.0, 0.0]), (0.11, np.inf), 0.68),
    )

    def test_draws_each_with_the_ends_of_its_interval(self):
        mu, kappa_s = plotting.likelihoods(self.PROFILES)
        np.testing.assert_array_equal(mu.get_lines()[1].get_ydata(), [4.0, 0.0, 5.0])
        assert [line.get_xdata()[0] for line in mu.get_lines()[2:]] == [0.11, 0.38]
        assert len(kappa_s.get_lines()) == 3  # the other end is at infinity
        parabola = np.interp(0.3, *mu.get_lines()[0].get_data())
        assert parabola == pytest.approx(5.0 * 0.5**2, rel=0.01)
        assert kappa_s.get_title() == "68 %: 0.11 to inf"
        assert all(labels(mu))


class TestStyle:
    def test_states_of_a_contact_are_told_apart_in_grey(self):
        shades = [luminance(state) for state in (SLIPS, STICKS, LIFTED)]
        assert np.all(np.diff(shades) > 0.2)

    def test_units_take_the_place_of_words(self, history):
        axes = plotting.loop(history)
        plotting.in_units(axes, {"length": "mm", "force/width": "N/mm"})
        assert labels(axes) == ["$u(L)$  [mm]", "$F$  [N/mm]"]


class TestFilm:
    def test_shows_every_step_on_the_loop(self, history, tmp_path):
        film = history.animate([15, 21], seconds=0.4)
        film.save(tmp_path / "cycle.gif")
        with Image.open(tmp_path / "cycle.gif") as gif:
            assert (gif.n_frames, gif.info["duration"]) == (2, 200)
        body, path = film.still(1).axes
        point = path.get_lines()[-1]
        assert point.get_xydata().tolist() == [[history.displacement[21], history.force[21]]]
        assert body.get_title().startswith(f"$F = {float(history.force[21]):.4g}$")

    def test_draws_the_traction_of_bodies_without_a_shape(self, history):
        names = [field.name for field in dataclasses.fields(jb.ContactHistory)]
        given = {"places": history.x, "loads": history.force[:, None]}
        given |= {"displacements": history.displacement[:, None]}
        given |= {"friction_force": history.traction * history.tributary}
        given |= {"normal_force": history.reaction * history.tributary}
        held = {name: getattr(history, name, None) for name in names}
        film = jb.ContactHistory(**held | given).animate([21])
        traction = film.still().axes[0]
        slips = {line.get_label(): line for line in traction.get_lines()}["slips"]
        np.testing.assert_array_equal(slips.get_xdata(), history.x[history.slipping[21]])


class TestSave:
    def test_writes_the_format_of_the_suffix(self, history, tmp_path):
        figure = plotting.loop(history).figure
        for suffix, start in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")):
            plotting.save(figure, path := tmp_path / f"loop.{suffix}")
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


REFUSED = {
    "steps": (lambda h, _: plotting.profiles(h, [19]), "steps: 19 is not on the path, whose"),
    "axes": (lambda h, _: plotting.profiles(h, axes=plt.subplots(1, 3)[1]), "profiles need 4"),
    "panels": (lambda h, _: plotting.contact(h, panels=["heat"]), "there is no 'heat' in reaction"),
    "reference": (
        lambda h, _: plotting.contact(h, reference={"w": ([0.0], [0.0])}),
        "reference: there is no 'w'",
    ),
    "contact steps": (lambda h, _: plotting.contact(h, steps=[19]), "steps: 19 is not on the path"),
    "few axes": (lambda h, _: plotting.contact(h, axes=[], panels=["gap"]), "gap need 1, not 0"),
    "no foundation": (
        lambda h, _: plotting.contact_map(with_scene(h, contact_normal="none")),
        "no contact to draw",
    ),
    "likelihoods": (
        lambda *_: plotting.likelihoods(TestLikelihoods.PROFILES, plt.subplots()[1]),
        "need 2, not 1",
    ),
    "film": (lambda h, folder: h.animate([0]).save(folder / "a.mp4"), r"end the name in \.gif"),
    "no suffix": (
        lambda _, folder: plotting.save(plt.figure(), folder / "loop"),
        r"end the name in .*\.png",
    ),
    "suffix": (
        lambda _, folder: plotting.save(plt.figure(), folder / "loop.xyz"),
        r"end the name in .*\.png",
    ),
}


def test_what_cannot_be_drawn_is_refused(clamped, tmp_path):
    for call, message in REFUSED.values():
        with pytest.raises(InputError, match=message):
            call(clamped, tmp_path)
    assert not list(tmp_path.iterdir())


def gaps_between_labels(axis):
    """Distances of the labels of an axis from the ones before, in pixels."""
    figure = axis.axes.figure
    figure.canvas.draw()
    low, high = axis.get_view_interval()
    boxes = [
        mark.label1.get_window_extent()
        for mark in (*axis.get_major_ticks(), *axis.get_minor_ticks())
        if low <= mark.get_loc() <= high and mark.label1.get_text()
    ]
    ends = sorted(tuple(box.intervalx if axis.axis_name == "x" else box.intervaly) for box in boxes)
    return [after[0] - before[1] for before, after in itertools.pairwise(ends)]


@pytest.mark.parametrize("ratio", [1.15, 60.0])
def test_labels_of_a_ring_down_do_not_touch(ratio):
    amplitude, time = np.geomspace(1.3e-6, 1.3e-6 / ratio, 9), np.linspace(0.0, 1.0, 9)
    part = amplitude / amplitude[0]
    found = SimpleNamespace(amplitude=amplitude, frequency=90.0 - part, damping=0.05 * part)
    names = ("kinetic", "stored", "friction_work", "damping_work", "external_work")
    scene = jb.Scene()
    motion = SimpleNamespace(
        time=time, displacement=time, scene=scene, **dict.fromkeys(names, time)
    )
    study = SimpleNamespace(found=found, predicted=found, motion=motion, payload=1.0)
    figure = plotting.ring_down_sheet(study)
    for axes in figure.axes[2:]:
        for axis in (axes.xaxis, axes.yaxis):
            gaps = gaps_between_labels(axis)
            assert gaps
            assert min(gaps) > 2.0
    plotting.close(figure)
