"""Page without a browser: sliders move numbers, figures follow, failures are one line."""

import re
import socket
import sys

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.explorer.views import curve_of, drawable, view_of
from jbeamshell.measured.example import example_loops
from jbeamshell.scene.toml import read_scene

pytest.importorskip("panel", reason="the explorer needs panel: pip install 'jbeamshell[explore]'")

from jbeamshell.explorer.page import Page
from jbeamshell.explorer.serve import _free

COARSE = {"model.nodes": 33, "load.steps_per_half_cycle": 8, "load.cycles": 1}


@pytest.fixture(scope="module")
def scene():
    return jb.Scene().replace(COARSE | {"model.section": "squeeze"})


@pytest.fixture(scope="module")
def made(scene):
    return Page(scene, example_loops(amplitudes=(0.5851, 1.0)))


@pytest.fixture
def page(made):
    """Page as it was, in whatever order the tests come that share it."""
    made.reset()
    made._figures.show_loops(example_loops(amplitudes=(0.5851, 1.0)))
    return made


def drawn(page, name):
    return {k: np.asarray(v) for k, v in page._figures.source(name).data.items()}


def test_the_curve_holds_the_work_of_the_first_cycle_at_each_amplitude(scene):
    curve = curve_of(scene)
    amplitude = float(curve.amplitude[5])
    own = view_of(scene.replace({"load.amplitude": amplitude}))
    # The smaller loops before it are wiped out as far as the nodes resolve them: 3e-5 on 65 nodes.
    assert curve.dissipation[5] == pytest.approx(own.figures["dissipation"], rel=5e-4)
    assert np.all(np.diff(curve.dissipation) > 0.0)
    order = np.argsort(own.history.x)
    assert own.states[-1, order[[0, -1]]].tolist() == [0, 1]  # slip begins at the loaded end


def test_a_slider_redraws_the_loop_in_place(page):
    before, source = drawn(page, "loop"), page._figures.source("loop")
    page.sliders["contact.friction"].value = 0.3
    assert page._figures.source("loop") is source
    after = drawn(page, "loop")
    history = jb.solve(drawable(page.scene), throw=False)
    assert float(page.scene.contact.friction) == 0.3
    assert np.array_equal(after["F"], before["F"])
    assert np.array_equal(after["u"], history.loop[1])
    assert drawn(page, "point")["D"] == pytest.approx([float(history.dissipation)])
    assert f"{float(history.dissipation):.6g}" in page._cards.object


def test_a_load_beyond_gross_slip_is_one_line_and_the_picture_stays(page):
    before = drawn(page, "loop")
    page.sliders["contact.pressure"].value = 3.0
    assert re.fullmatch(r"load\.amplitude = 0\.7855: must stay below gross slip.*", page.message)
    assert 'role="alert"' in page._head.object
    assert np.array_equal(drawn(page, "loop")["u"], before["u"])
    assert page._figures.loop.background_fill_color != "white"
    page.reset()
    assert page.message == ""
    assert page._figures.loop.background_fill_color == "white"


def test_the_moment_moves_the_point_and_the_members(page):
    page._moment.value = 4
    here, loop = drawn(page, "here"), drawn(page, "loop")
    assert here["u"] == pytest.approx(loop["u"][[4]])
    assert page.view.force[4] == pytest.approx(0.0, abs=1e-12)
    assert drawn(page, "pull")["x"].size == 0  # no force, no arrow
    states = drawn(page, "states")["image"][0]
    assert states.shape[0] == page.view.steps.size
    assert set(np.unique(states)) == {0, 1}


def test_measured_loops_and_kept_curves_lie_over_the_loop(page):
    measured = drawn(page, "measured")
    assert np.isnan(measured["u"]).sum() == 3  # around and between two loops
    assert drawn(page, "measured works")["A"] == pytest.approx([0.5851, 1.0])
    loop = drawn(page, "loop")
    page._keep.value = True
    page.sliders["strip.height_ratio"].value = 0.3
    assert np.array_equal(drawn(page, "kept")["u"], loop["u"])
    assert not np.array_equal(drawn(page, "loop")["u"], loop["u"])
    page._keep.value = False
    assert drawn(page, "kept")["u"].size == 0


def test_loops_less_their_stiffness_keep_their_area_and_stand_upright(page):
    whole, measured = drawn(page, "loop"), drawn(page, "measured")
    page._less.value = True
    loop, stiffness = drawn(page, "loop"), page.view.figures["secant_stiffness"]
    assert loop["u"] == pytest.approx(whole["u"] - whole["F"] / stiffness, abs=1e-12)
    work = [np.trapezoid(one["F"], one["u"]) for one in (loop, whole)]
    assert work[0] == pytest.approx(work[1], rel=1e-9)
    ends = loop["u"][np.argmax(loop["F"])], loop["u"][np.argmin(loop["F"])]
    assert np.ptp(ends) < 1e-3 * np.ptp(whole["u"])  # one cycle is not closed yet
    assert page._figures.loop.xaxis[0].axis_label.endswith("less F/K")
    page._less.value = False
    np.testing.assert_array_equal(drawn(page, "measured")["u"], measured["u"])


def test_a_file_that_is_no_table_is_one_line(page):
    page._file.param.update(value=b"\x00\x01 no table", filename="odd.csv")
    assert re.search(r'role="alert".*odd\.csv', page._head.object)
    assert "/tmp" not in page._head.object
    good = b"displacement,force\n" + b"".join(b"%g,%g\n" % (i, i % 3) for i in range(9))
    page._file.param.update(value=good, filename="good.csv")
    assert "good.csv: 1 loop" in page._head.object


def test_the_text_is_the_scene_of_the_sliders(page, tmp_path):
    page.sliders["strip.poisson_ratio"].value = 0.2
    (tmp_path / "scene.toml").write_text(page.text, encoding="utf-8")
    scene = read_scene(tmp_path / "scene.toml")
    assert float(scene.strip.poisson_ratio) == 0.2
    assert (
        float(view_of(drawable(scene)).figures["dissipation"]) == page.view.figures["dissipation"]
    )


def test_settings_stay_as_they_were_chosen():
    scene = jb.Scene()
    fixed = drawable(scene)
    moved = fixed.replace({"strip.height_ratio": 0.012, "load.amplitude": 1.9})
    assert moved.plan.section == "plane"
    assert drawable(jb.Scene().replace({"model.section": "squeeze"})).plan.section == "squeeze"
    assert drawable(jb.library.single_lap()).plan.nodes == 65
    assert drawable(jb.library.single_lap().replace({"model.nodes": 97})).plan.nodes == 97


def test_without_panel_there_is_one_clear_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "panel", None)
    with pytest.raises(jb.InputError, match=r"pip install 'jbeamshell\[explore\]'"):
        jb.explore()


def test_a_port_that_is_taken_is_refused():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(jb.InputError, match="take another port"):
            _free(other.getsockname()[1])
    assert _free(0) > 0


def test_a_notebook_gets_the_page_as_an_object(scene):
    assert "jbeamshell" not in type(jb.explore(scene)).__module__
    with pytest.raises(jb.InputError, match=r"scene = 'standard': give a jbeamshell\.Scene"):
        jb.explore("standard")
