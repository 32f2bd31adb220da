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

NODES = 61
ZEROS_AND_TURNS = np.array([9, 12, 15, 18])  # of the cycle, after four steps of the pressure
NAMES = ("reaction", "gap", "beta", "squeeze_stress", "psi", "squeeze_couple")


@pytest.fixture(scope="module")
def clamped():
    """A strip that is clamped over X < 5, lifts off beyond, and is pulled to and fro."""
    patch = [[0.0, 100.0], [5.0, 100.0], [5.0, 0.0], [15.0, 0.0]]
    values = {
        "strip.length": 15.0,
        "strip.half_height": 0.5,
        "contact.pressure": patch,
        "contact.stick_stiffness": 100.0,
        "load.amplitude": 30.0,
        "load.pressure_steps": 4,
        "load.steps_per_half_cycle": 6,
        "load.cycles": 1,
        "model.section": "squeeze",
        "model.kinematics": "linear",
        "model.nodes": NODES,
    }
    return jb.solve(STRIP.replace(values), throw=False)


@pytest.fixture(scope="module")
def pull(clamped):
    # As many steps as the cycle, so that nothing compiles anew.
    return jb.solve(clamped.scene, np.linspace(2.0, 30.0, clamped.force.size - 4), throw=False)


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


def labels(axes):
    return [text for panel in np.ravel(axes) for text in (panel.get_xlabel(), panel.get_ylabel())]


def texts(legend):
    return [text.get_text() for text in legend.get_texts()]


def curves(panel):
    """Values of the lines over all nodes."""
    return [line.get_ydata() for line in panel.get_lines() if len(line.get_xdata()) == NODES]


def test_a_loop_has_its_path_and_the_last_cycle(clamped):
    axes = plotting.loop(clamped)
    lines = {line.get_label(): line for line in axes.get_lines()}
    np.testing.assert_array_equal(lines["last cycle"].get_ydata(), clamped.loop[0])
    np.testing.assert_array_equal(lines["last cycle"].get_xdata(), clamped.loop[1])
    np.testing.assert_array_equal(lines["path"].get_ydata(), clamped.force)
    assert all(labels(axes))
    plotting.in_units(axes, {"length": "mm", "force/width": "N/mm"})
    assert labels(axes) == ["$u(L)$  [mm]", "$F$  [N/mm]"]


def test_profiles_take_turns_and_zero_crossings_of_the_last_cycle(clamped, pull, pressing):
    panels = plotting.profiles(clamped).ravel()
    shown, legend = curves(panels[2]), texts(panels[2].get_legend())
    np.testing.assert_allclose(shown[:4], clamped.traction[ZEROS_AND_TURNS] / 10.0)  # of mu p
    assert (legend[0], legend[2]) == ("$F = 0$, falling", "$F = 0$, rising")
    change = clamped.psi[ZEROS_AND_TURNS[-1]] - clamped.psi[3]  # from the pressed strip
    np.testing.assert_array_equal(panels[1].get_lines()[-1].get_ydata(), change)
    traction = plotting.profiles(pull, [-1]).ravel()[2]
    dots = next(line for line in traction.get_lines() if line.get_marker() == "o")
    np.testing.assert_array_equal(dots.get_xdata(), pull.x[pull.slipping[-1]])
    assert len(dots.get_xdata()) > 0
    shares = ["25 % of $F_N$", "50 % of $F_N$", "75 % of $F_N$", "100 % of $F_N$", "slips"]
    assert texts(plotting.profiles(pressing).ravel()[2].get_legend()) == shares


class TestContact:
    def test_draws_all_profiles_of_the_scene(self, clamped):
        panels = clamped.plot_contact([-1])
        assert all(labels(panels))
        for name, panel in zip(NAMES, panels, strict=True):
            curve = next(line for line in panel.get_lines() if line.get_color() == "#0072B2")
            values = getattr(clamped, name)[-1]
            x = clamped.x if values.size == clamped.x.size else clamped.middles
            np.testing.assert_array_equal(curve.get_xdata(), x)
            np.testing.assert_array_equal(curve.get_ydata(), values)

    def test_takes_the_pressed_strip_and_the_turns_of_the_last_cycle(self, clamped):
        gap, steps = plotting.contact(clamped, panels=["gap"])[0], np.array([3, 12, 18])
        np.testing.assert_array_equal(curves(gap), clamped.gap[steps])
        legend = texts(gap.figure.legends[0])
        assert legend == ["$F = 0$", "$F = -30$", "$F = 30$", "contact ends"]
        marks = [line for line in gap.get_lines() if line.get_linestyle() == ":"]
        ends = [line.get_xdata()[0] for line in marks]
        np.testing.assert_array_equal(ends, clamped.contact_end[steps])

    def test_takes_the_end_of_a_path_without_a_cycle(self, pull):
        panel = plotting.contact(pull, panels=["beta"])[0]
        np.testing.assert_array_equal(panel.get_lines()[0].get_ydata(), pull.beta[-1])

    def test_draws_only_what_is_modelled(self, clamped):
        held = with_scene(clamped, contact_normal="held")
        assert len(plotting.contact(held)) == 5  # no lift
        flat = with_scene(held, model_section="shell")
        assert [p.get_title() for p in plotting.contact(flat)] == ["normal reaction", "rotation"]
        assumed = with_scene(clamped, model_section="assumed")
        assert len(plotting.contact(assumed)) == 5  # no squeeze couple
        free = plotting.contact(with_scene(clamped, contact_normal="none"), [-1])
        assert free[0].get_title() == "rise of the bottom face"


def cells(axes):
    """States (steps, nodes) of a map of contact, and its edges along the path."""
    mesh = axes.collections[0]
    return mesh.get_array().T, mesh.get_coordinates()[0, :, 0]


def test_a_map_tells_lifted_stuck_and_slipping_nodes_apart(clamped, pressing):
    axes = clamped.plot_contact_map()
    states, _ = cells(axes)
    touching, slipping = np.asarray(clamped.touching)[3:], np.asarray(clamped.slipping)[3:]
    np.testing.assert_array_equal(states == 0, ~touching)
    np.testing.assert_array_equal(states == 2, touching & slipping)
    assert {0, 1, 2} == set(states.ravel().tolist())
    assert texts(axes.get_legend()) == ["lifted", "sticks", "slips", "contact ends"]
    assert np.all(np.diff([float(np.dot(to_rgb(c), (0.299, 0.587, 0.114))) for c in SHADES]) > 0.2)
    states, along = cells(plotting.contact_map(pressing))
    np.testing.assert_array_equal(along, [0.0, 0.25, 0.5, 0.75, 1.0])
    np.testing.assert_array_equal(states, pressing.touching)
    lost = {name: getattr(clamped, name).at[15:].set(np.nan) for name in ("force", "reaction")}
    blank = cells(plotting.contact_map(dataclasses.replace(clamped, **lost)))[0]
    np.testing.assert_array_equal(blank.mask.all(axis=1), np.arange(16) >= 12)


SHADES = (SLIPS, STICKS, LIFTED)  # told apart in grey
PROFILES = (
    Profile("mu", np.array([0.1, 0.2, 0.4]), np.array([4.0, 0.0, 5.0]), (0.11, 0.38), 0.95),
    Profile("kappa_s", np.array([0.1, 0.2]), np.array([4.0, 0.0]), (0.11, np.inf), 0.68),
)


def test_likelihoods_have_the_ends_of_their_intervals():
    mu, kappa_s = plotting.likelihoods(PROFILES)
    assert [line.get_xdata()[0] for line in mu.get_lines()[2:]] == [0.11, 0.38]
    assert len(kappa_s.get_lines()) == 3  # the other end is at infinity
    assert kappa_s.get_title() == "68 %: 0.11 to inf"


def test_a_film_shows_every_step_on_the_loop(clamped, tmp_path):
    film = clamped.animate([12, 18], seconds=0.4)
    film.save(tmp_path / "cycle.gif")
    with Image.open(tmp_path / "cycle.gif") as gif:
        assert (gif.n_frames, gif.info["duration"]) == (2, 200)
    point = film.still(1).axes[1].get_lines()[-1]
    assert point.get_xydata().tolist() == [[clamped.displacement[18], clamped.force[18]]]
    names = [field.name for field in dataclasses.fields(jb.ContactHistory)]
    given = {"places": clamped.x, "loads": clamped.force[:, None]}
    given |= {"displacements": clamped.displacement[:, None]}
    given |= {"friction_force": clamped.traction * clamped.tributary}
    given |= {"normal_force": clamped.reaction * clamped.tributary}
    held = {name: getattr(clamped, name, None) for name in names}
    traction = jb.ContactHistory(**held | given).animate([18]).still().axes[0]  # without a shape
    slips = {line.get_label(): line for line in traction.get_lines()}["slips"]
    np.testing.assert_array_equal(slips.get_xdata(), clamped.x[clamped.slipping[18]])


def test_files_have_the_format_of_their_suffix_and_are_whole(clamped, tmp_path, monkeypatch):
    figure = plotting.loop(clamped).figure
    for suffix, start in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")):
        plotting.save(figure, path := tmp_path / f"loop.{suffix}")
        assert path.read_bytes().startswith(start)

    def half(draft, **_):
        draft.write_text("half")
        raise OSError("disk full")

    path.write_text("old")
    monkeypatch.setattr(figure, "savefig", half)
    with pytest.raises(InputError, match="disk full"):
        plotting.save(figure, path)
    assert (path.read_text(), len([*tmp_path.iterdir()])) == ("old", 3)


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
        lambda *_: plotting.likelihoods(PROFILES, plt.subplots()[1]),
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
