"""The rungs of the ladder: names, the closed-form bar, one History for all."""

import jax
import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from jbeamshell import reference
from jbeamshell.scene import rungs
from jbeamshell.scene.rungs import general_rung
from jbeamshell.scene.toml import overridden, scene_from_values

SMALL = {"model.nodes": 41, "load.steps_per_half_cycle": 8, "model.kinematics": "linear"}
STRIP = STRIP.replace(SMALL)


def on(rung, **more):
    return STRIP.replace({"model.section": rung} | more)


NAMES = ("bar", "stepwise-bar", "shell", "squeeze", "p1", "p6")


@pytest.mark.parametrize("rung", NAMES)
def test_names_come_back(rung, tmp_path):
    scene = on(rung)
    assert scene.plan.section == scene.get("model.section") == rung
    jb.write_scene(scene, tmp_path / "scene.toml")
    again = jb.read_scene(tmp_path / "scene.toml")
    assert again.model == scene.model
    assert rungs.values_of(rung)["model.order"] == scene.plan.order


@pytest.mark.parametrize("rung", ["p0", "p13", "p99", "p-1", "p", "beam", "masing-", "Bar", ""])
def test_unknown_names_are_refused(rung):
    with pytest.raises(jb.InputError, match=r"model\.rung = .*choose 'auto', 'bar', 'shell'"):
        on(rung)


@pytest.mark.parametrize(
    ("rung", "now"),
    [("masing", "squeeze"), ("masing-bar", "bar"), ("masing-pull-p2", "p2")],
)
def test_old_names_are_told_the_new_one(rung, now, tmp_path):
    told = f"model.rung = '{rung}': is no model any more: take '{now}'"
    with pytest.raises(jb.InputError, match=told):
        on(rung)
    (tmp_path / "scene.toml").write_text(f"[model]\nrung = '{rung}'\n", encoding="utf-8")
    with pytest.raises(jb.InputError, match=told):
        jb.read_scene(tmp_path / "scene.toml")
    with pytest.raises(jb.InputError, match=r"model\.solution = 'masing': .*leave it out"):
        STRIP.replace({"model.solution": "masing"})


def test_a_rung_keeps_the_lift():
    lifting = STRIP.replace({"model.section": "squeeze"})
    assert lifting.replace({"model.section": "p2"}).model.fields == ("v", "w", "beta", "psi")
    assert lifting.replace({"model.section": "shell"}).model.fields == ("v", "w", "beta")
    assert lifting.replace({"model.section": "bar"}).model.fields == ("v",)
    given = {"model.section": "squeeze", "model.nodes": 31}
    merged = scene_from_values(overridden(given, {"model.section": "p3"}))
    assert general_rung(merged.plan.section) == "p3"
    assert "w" in merged.plan.fields


def test_a_rung_and_what_it_stands_for_may_not_disagree():
    with pytest.raises(jb.InputError, match="disagree: give one"):
        STRIP.replace({"model.section": "p3", "model.section": "p2"})
    assert STRIP.replace({"model.section": "p3", "model.section": "p3"}).model.order == 3
    merged = overridden({"model.section": "p3"}, {"model.section": "p2"})
    assert general_rung(scene_from_values(merged).plan.section) == "p2"


@pytest.mark.doubtful("the section bar")
def test_the_bar_is_the_cubic_law():
    history = jb.solve(on("bar"))
    assert float(history.dissipation_ratio) == pytest.approx(1.0, rel=1e-12)
    assert float(history.dissipation_loop / history.dissipation) == pytest.approx(1.0, rel=1e-12)
    force, displacement = reference.bar_hysteresis(0.7855, 3.4e4, 1.0, 9)
    np.testing.assert_allclose(history.loop[0], force, atol=1e-15)
    np.testing.assert_allclose(history.loop[1], displacement, atol=1e-18)
    assert history.converged
    assert float(history.reaction_min) == 10.0


@pytest.mark.parametrize(
    ("control", "bottom"),
    [("force", 4.0), pytest.param("displacement", 0.0, marks=pytest.mark.slow)],
)
@pytest.mark.doubtful("few nodes")
def test_the_closed_bar_is_the_limit_of_the_stepwise_one(control, bottom):
    amplitude = {"force": 0.8, "displacement": 1e-5}[control]
    load = {"load.control": control, "load.amplitude": amplitude, "load.cycles": 1}
    load["contact.bottom_pressure"] = bottom
    closed, stepped = (jb.solve(on(rung, **load)) for rung in ("bar", "stepwise-bar"))
    assert float(stepped.dissipation) == pytest.approx(float(closed.dissipation), rel=2e-3)
    np.testing.assert_allclose(stepped.force, closed.force, atol=6e-3)
    np.testing.assert_allclose(stepped.v[-1], closed.v[-1], atol=6e-3 * float(closed.v.max()))


@pytest.mark.doubtful("the section bar")
def test_gradients_pass_through_the_bar():
    def dissipation(mu):
        return jb.solve(on("bar", **{"contact.friction": mu})).dissipation

    slope, step = jax.jacfwd(dissipation)(0.1), 1e-5
    differences = (dissipation(0.1 + step) - dissipation(0.1 - step)) / (2.0 * step)
    assert float(slope) == pytest.approx(float(differences), rel=1e-5)
    assert float(slope) == pytest.approx(-float(dissipation(0.1)) / 0.1, rel=1e-12)


LAYERS = {"strip.layers": [[0.1, 1e5, 0.3], [0.1252, 2e5, 0.3]]}


@pytest.mark.parametrize(
    ("rung", "more", "message"),
    [
        ("bar", LAYERS, "closed-form.*needs a straight homogeneous strip"),
        ("p2", LAYERS, r"model\.order = 2: is for a straight homogeneous strip"),
        ("bar", {"contact.pressure": [[0.0, 10.0], [2.0, 5.0]]}, "under uniform pressures"),
        ("bar", {"contact.friction": 0.0}, r"contact\.friction = 0\.0: the bar needs friction"),
        ("bar", {"load.cycles": 0}, r"model\.solution = 'closed-form'.*load\.cycles"),
        ("bar", {"load.control": "displacement", "load.amplitude": 1e-3}, "bar's gross slip"),
    ],
)
def test_what_a_rung_cannot_represent(rung, more, message):
    with pytest.raises(jb.InputError, match=message):
        jb.solve(on(rung, **more))


def test_the_bar_knows_the_scenes_own_cycles_only():
    with pytest.raises(jb.InputError, match=r"model\.solution = 'closed-form'.*leave the path out"):
        jb.solve(on("bar"), [0.1, 0.2])
