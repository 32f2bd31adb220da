"""Sections by name, keys that they replaced, the closed-form bar, one History for all."""

import jax
import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from jbeamshell import reference
from jbeamshell.scene.plan import CLOSED, STEPS
from jbeamshell.scene.sections import SECTIONS
from jbeamshell.scene.toml import overridden, scene_from_values

SMALL = {"model.nodes": 41, "load.steps_per_half_cycle": 8, "model.kinematics": "linear"}


def on(section, **more):
    return jb.Scene().replace(SMALL | {"model.section": section} | more)


@pytest.mark.parametrize("section", SECTIONS)
def test_names_come_back(section, tmp_path):
    scene = on(section)
    assert scene.plan.section == scene.get("model.section") == section
    jb.write_scene(scene, tmp_path / "scene.toml")
    again = jb.read_scene(tmp_path / "scene.toml")
    assert again.model == scene.model
    assert again.plan == scene.plan
    assert f"section {section} " in str(scene)


def test_a_section_keeps_the_lift():
    lifting = STRIP.replace({"model.section": "squeeze"})
    assert lifting.replace({"model.section": "p2"}).plan.fields == ("v", "w", "beta", "psi")
    assert lifting.replace({"model.section": "shell"}).plan.fields == ("v", "w", "beta")
    assert lifting.replace({"model.section": "bar"}).plan.fields == ("v",)
    held = lifting.replace({"contact.normal": "held"})
    assert held.replace({"model.section": "shell"}).plan.fields == ("v", "beta")
    merged = overridden({"model.section": "squeeze"}, {"model.section": "p3"})
    assert scene_from_values(merged).plan.section == "p3"


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
def test_the_closed_bar_is_the_limit_of_load_steps(control, bottom):
    amplitude = {"force": 0.8, "displacement": 1e-5}[control]
    load = {"load.control": control, "load.amplitude": amplitude, "load.cycles": 1}
    load["contact.bottom_pressure"] = bottom
    closed, stepped = (jb.solve(on("bar", **load), by=by) for by in (None, "steps"))
    assert (closed.scene.plan.engine, stepped.scene.plan.engine) == (CLOSED, STEPS)
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
    ("more", "path"),
    [
        (LAYERS, None),
        ({"load.cycles": 0}, None),
        ({}, [0.1, 0.2]),
    ],
    ids=["layers", "pressing", "path"],
)
@pytest.mark.doubtful("few nodes")
@pytest.mark.doubtful("the section bar")
def test_a_bar_without_a_closed_form_takes_load_steps(more, path):
    history = jb.solve(on("bar", **more), path)
    assert history.scene.plan.engine == STEPS
    assert history.converged
