"""Plan of a scene: what is given stays, what is left open is decided."""

import dataclasses

import jax
import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

import jbeamshell as jb
from jbeamshell.scene.keys import ENTRIES
from jbeamshell.scene.plan import LINE, STEPS
from jbeamshell.scene.planning import (
    BAR,
    CONTACT_LINE,
    KNOWN,
    LIFTING,
    PLANE,
    SOFT_CONTACT_LINE,
    STEPWISE,
    refinements,
)

FINE = {"model.tolerance": KNOWN}  # for which grids were measured
SQUEEZE = jb.Scene().replace({"model.section": "squeeze"})
ROTATING = {"contact.pressure": 5000.0, "load.amplitude": 400.0}


def test_the_standard_strip_is_solved_on_its_contact_line():
    scene = jb.Scene().replace(FINE | {"load.amplitude": 1.8})
    plan = scene.plan
    assert (plan.section, plan.engine, plan.kinematics) == ("plane", LINE, "linear")
    assert plan.lifts
    assert (plan.nodes, plan.end_size) == (PLANE.nodes, PLANE.end_size)
    model = scene.model
    assert model.section == model.kinematics == model.nodes == model.end_size == "auto"


@pytest.mark.parametrize(
    ("values", "section"),
    [
        ({}, "plane"),
        ({"load.amplitude": 0.01}, "plane"),
        ({"model.tolerance": 0.1}, "plane"),
        ({"load.entry": "traction"}, "plane"),
        ({"contact.pressure": [[0.5, 10.0], [1.5, 10.0]]}, "plane"),
        ({"strip.far_end": "free"}, "plane"),
        ({"strip.layers": [[0.1, 1e5, 0.3], [0.1252, 2e5, 0.3]]}, "plane"),
        ({"load.control": "displacement", "load.amplitude": 1e-5}, "plane"),
        ({"strip.height_ratio": 0.4}, "plane"),
        ({"strip.kappa_s": 0.5}, "squeeze"),
        ({"model.section": "squeeze"}, "squeeze"),
        ({"model.constants": "printed"}, "squeeze"),
    ],
    ids=str,
)
def test_a_strip_is_plane_elasticity_where_that_can_stand_for_it(values, section):
    plan = jb.Scene().replace(values).plan
    assert (plan.section, plan.engine) == (section, LINE)


@pytest.mark.parametrize(
    "values",
    [
        ROTATING,
        {"contact.normal": "compliant"},
        {"strip.curvature": 1e-3},
        {"contact.smoothing": 8.0},
        {"model.grid": "collocation"},
        {"model.kinematics": "exact"},
        {"load.control": "arc-length", "load.amplitude": 1e-5},
    ],
    ids=lambda values: next(reversed(values)),
)
def test_what_needs_load_steps_gets_them(values):
    scene = jb.Scene().replace(values)
    assert scene.plan.engine == STEPS
    assert scene.by_load_steps().plan == scene.plan


def test_the_contact_line_takes_any_number_of_nodes():
    assert jb.Scene().replace({"model.nodes": 401}).plan.on_contact_line


@pytest.mark.parametrize(
    ("values", "engine"),
    [
        ({}, LINE),
        ({"load.steps_per_half_cycle": 1}, LINE),
        ({"contact.pressure": [[0.0, 10.0], [2.0, 8.0]]}, LINE),
        ({"load.amplitude": 1.9, "strip.height_ratio": 0.5, "contact.pressure": 1e3}, LINE),
        ({"load.cycles": 0}, STEPS),
        ({"contact.smoothing": 8.0}, STEPS),
        ({"contact.normal": "held"}, STEPS),
        ({"model.kinematics": "exact"}, STEPS),
    ],
    ids=str,
)
def test_a_bar_is_on_its_contact_line_like_any_section_that_does_not_turn(values, engine):
    bar = jb.Scene().replace({"model.section": "bar"} | values)
    assert (bar.plan.engine, bar.plan.fields) == (engine, ("v",))
    assert bar.by_load_steps().plan.engine == STEPS


def test_a_bar_has_a_grid_of_its_own():
    bar = jb.Scene().replace({"model.section": "bar"})
    assert (bar.plan.nodes, bar.plan.end_size) == (69, BAR.end_size)
    assert bar.replace(FINE).plan.nodes == BAR.nodes
    assert refinements(bar) == BAR.halvings
    phi = jb.Scene(energy=lambda e, g, k, psi, dpsi: 1e4 * (e**2 + e * g + g**2 + k**2 + psi**2))
    assert phi.replace({"model.section": "bar"}).plan.engine == STEPS


def test_a_strip_that_is_pressed_unevenly_alone_is_plane_elasticity():
    pressed = {"load.cycles": 0, "contact.pressure": [[0.0, 10.0], [1.0, 10.0], [1.0, 0.0]]}
    scene = jb.Scene().replace(pressed | {"strip.half_height": 0.02})
    assert (scene.plan.section, scene.plan.nodes) == ("plane", 513)  # 50 times as long as high
    thick = scene.replace({"strip.half_height": 0.2})
    assert thick.plan.nodes == jb.Scene().replace({"model.section": "plane"}).plan.nodes + 80
    for more in (
        {"contact.pressure": 10.0},
        {"strip.kappa_s": 1.0},
        {"contact.normal": "held"},
        {"model.section": "squeeze"},
    ):
        assert scene.replace(more).plan.section == "squeeze"


def test_load_steps_stick_through_changes():
    steps = jb.Scene().by_load_steps()
    assert steps.plan.engine == STEPS
    assert steps.replace({"contact.friction": 0.2, "model.section": "shell"}).plan.engine == STEPS
    assert jb.Scene(model=jb.Model(by="steps")).plan == steps.plan


@pytest.mark.parametrize(
    "values",
    [
        {},
        ROTATING,
        {"contact.smoothing": 8.0},
        {"model.kinematics": "exact"},
        {"contact.normal": "compliant"},
        {"strip.curvature": 1e-3},
    ],
    ids=str,
)
def test_a_strip_may_lift(values):
    assert jb.Scene().replace(values).plan.fields == ("v", "w", "beta", "psi")


def test_a_strip_that_is_held_down_does_not_lift():
    held = jb.Scene().replace({"contact.normal": "held"})
    assert held.plan.fields == ("v", "beta", "psi")
    assert held.plan.engine == STEPS
    assert "held down in load steps" in str(held.plan)


@pytest.mark.slow
def test_load_steps_lift_as_the_contact_line_does():
    """Kept down, this strip would dissipate 5 % less, and as much with sliders of alpha G/H."""
    thick = {"strip.height_ratio": 0.35, "contact.friction": 0.4, "load.amplitude": 2.0}
    scene = jb.Scene().replace(thick)
    linear = {"model.kinematics": "linear", "model.nodes": 129, "model.section": "squeeze"}
    line = jb.solve(scene.replace(linear))
    steps = jb.solve(scene.replace({"model.kinematics": "exact"}), throw=False)
    assert (line.scene.plan.engine, steps.scene.plan.engine) == (LINE, STEPS)
    allowed = steps.scene.model.tolerance
    assert float(steps.dissipation) == pytest.approx(float(line.dissipation), rel=allowed)


def test_ideal_sliders_hold_as_much_on_small_elements_as_on_large_ones():
    steps = jb.Scene().by_load_steps()
    strip, lengths = steps.strip, steps.strip.half_height * np.array([0.01, 0.5, 1.0, 3.0])
    unit = float(strip.shear_modulus / strip.half_height)
    ideal = steps.slip_stiffness(lengths)
    np.testing.assert_allclose(ideal / unit, 1000.0 / np.array([0.01, 0.5, 1.0, 1.0]))
    for alpha in (50.0, 1000.0):
        soft = steps.replace({"contact.stick_stiffness": alpha}).slip_stiffness(lengths)
        np.testing.assert_allclose(soft / unit, alpha)
    assert np.all(jb.Scene().slip_stiffness(lengths) == np.inf)


def test_rotations_are_exact_where_their_bound_says_so():
    assert jb.Scene().replace(ROTATING).plan.kinematics == "exact"
    pressed = {"contact.pressure": 500.0, "load.amplitude": 40.0}  # linear ones are .8 % off
    assert jb.Scene().replace(pressed).plan.kinematics == "linear"
    assert SQUEEZE.replace(pressed).plan.kinematics == "exact"
    assert SQUEEZE.replace(pressed | {"model.tolerance": 0.1}).plan.kinematics == "linear"


def test_an_overhang_near_buckling_rotates():
    slender = {"strip.height_ratio": 0.01, "contact.friction": 0.3, "load.amplitude": 1.0}
    pressure = {"contact.pressure": [[0.0, 30.0], [0.6, 30.0], [0.6, 0.0], [2.0, 0.0]]}
    assert jb.Scene().replace(slender | pressure).plan.kinematics == "exact"
    thick = slender | pressure | {"strip.height_ratio": 0.1}
    assert jb.Scene().replace(thick).plan.kinematics == "linear"


def test_given_settings_stay():
    scene = jb.Scene().replace({"model.nodes": 41})
    assert scene.replace({"contact.friction": 0.2}).plan.nodes == 41
    chosen = jb.Scene().plan.nodes
    assert scene.replace({"model.nodes": "auto"}).plan.nodes == chosen
    pinned = jb.Scene().pinned()
    assert pinned.replace({"model.tolerance": 0.05}).plan.nodes == chosen


def test_nodes_follow_the_tolerance():
    def nodes(tolerance):
        return SQUEEZE.replace({"model.tolerance": tolerance}).plan.nodes

    assert nodes(0.005) == CONTACT_LINE.nodes
    assert (nodes(0.00125) - 1) == 2 * (nodes(0.005) - 1)  # second order
    assert nodes(0.02) < nodes(0.005)
    ramp = {"contact.pressure": [[0.0, 10.0], [2.0, 8.0]]} | FINE
    # Half as many more for each row at which the pressure may jump.
    assert SQUEEZE.replace(ramp).plan.nodes - 1 == 1.5 * (nodes(0.005) - 1)


def test_elements_at_the_loaded_end_are_small_where_the_corner_opens():
    def chosen(**values):
        plan = SQUEEZE.replace(FINE | values).plan
        return plan.nodes, plan.end_size

    def grid(known):
        return known.nodes, known.end_size

    soft = {"contact.stick_stiffness": 1000.0}
    assert chosen(**soft) == grid(SOFT_CONTACT_LINE)
    assert chosen() == grid(CONTACT_LINE)
    given = soft | {"model.nodes": 41}
    assert chosen(**given) == (41, SOFT_CONTACT_LINE.end_size)
    steps = {"model.kinematics": "exact"}
    assert chosen(**steps) == grid(LIFTING)
    assert chosen(**steps, **soft) == grid(STEPWISE)
    assert chosen(**steps, **{"model.section": "bar"}) == grid(STEPWISE)
    assert chosen(**steps, **{"contact.normal": "held"}) == grid(STEPWISE)
    assert chosen(**{"strip.curvature": 0.01}) == grid(STEPWISE)
    over = _numbers({"contact.stick_stiffness": [50.0, 1000.0]})
    assert SQUEEZE.replace(FINE).pinned(over).plan.nodes == SOFT_CONTACT_LINE.nodes
    over = _numbers({"contact.friction": [0.1, 0.2]})
    assert SQUEEZE.replace(FINE).pinned(over).plan.nodes == CONTACT_LINE.nodes


@pytest.mark.slow
def test_the_chosen_elements_resolve_the_slider_of_the_last_node():
    soft = {"contact.stick_stiffness": 33.0, "contact.friction": 0.19, "load.amplitude": 1.74}
    chosen = SQUEEZE.replace(FINE | soft | {"strip.height_ratio": 0.25}).pinned()
    end = chosen.plan.end_size

    def dissipation(end_size):
        scene = chosen.on_grid(chosen.plan.nodes, end_size)
        return float(jb.solve(scene, throw=False).dissipation)

    found = dissipation(end)
    assert abs(dissipation(0.25 * end) / found - 1.0) < 0.005
    assert abs(dissipation(CONTACT_LINE.end_size) / found - 1.0) > 0.02


def test_traced_numbers_take_elasticity_unless_the_section_is_named():
    found = []

    def dissipation(friction):
        for before in (jb.Scene(), SQUEEZE):
            scene = before.replace(FINE | {"contact.friction": friction})
            found.append((scene.plan.section, scene.plan.nodes))
        return scene.contact.friction

    jax.jit(jax.grad(dissipation))(0.1)
    assert found == [("plane", PLANE.nodes), ("squeeze", CONTACT_LINE.nodes)]
    whole = jax.jit(lambda: jb.Scene().contact.friction)  # numbers that are known within jit
    assert float(whole()) == 0.1


def test_a_file_keeps_what_was_left_open():
    text = jb.scene_to_toml(jb.Scene())
    assert 'nodes = "auto"' in text
    assert 'section = "auto"' in text
    assert "end_size" not in text
    assert "nodes = 65" in jb.scene_to_toml(SQUEEZE.replace(FINE).pinned())


def test_a_sweep_chooses_for_all_its_strips():
    over = {"contact.pressure": [10.0, 500.0], "load.amplitude": [0.5]}
    assert SQUEEZE.pinned(_numbers(over)).plan.kinematics == "exact"
    assert SQUEEZE.pinned(_numbers({"load.amplitude": [0.5]})).plan.kinematics == "linear"


def _numbers(over):
    from jbeamshell.sweeping.lanes import lanes_of

    return lanes_of(jb.Scene(), over).value


def test_history_says_its_plan():
    history = jb.solve(jb.Scene())
    plan = "section plane on its contact line, linear kinematics"
    first, second, *_ = str(history).splitlines()
    assert first.endswith(f": {plan}, {history.x.size} nodes")
    assert second == "planned to be within 1 % of plane elasticity"
    assert history.doubts == ()
    assert "planned" not in str(jb.solve(jb.Scene().pinned()))
    # Plane elasticity on 257 nodes.
    assert float(history.dissipation) == pytest.approx(7.252e-06, rel=0.01)
    assert float(history.secant_stiffness) == pytest.approx(79457.0, rel=0.01)


@pytest.mark.slow
def test_a_doubt_about_chosen_nodes_names_the_tolerance():
    little = {"strip.height_ratio": 0.4, "load.amplitude": 0.01, "model.tolerance": 0.02}
    chosen = jb.solve(jb.Scene().replace(little), throw=False)
    # A second doubt, of the loaded corner, names the nodes.
    assert chosen.doubts[0].partition("; ")[2] == "take a smaller model.tolerance"
    given = jb.solve(jb.Scene().replace(little | {"model.nodes": 33}), throw=False)
    assert "more model.nodes" in given.doubts[0]


def test_a_plan_does_not_depend_on_the_plan_before():
    little = {"strip.height_ratio": 0.3, "strip.kappa_s": 0.6, "load.amplitude": 0.02}
    before = [jb.Scene().replace(values) for values in ({}, {"strip.kappa_s": 0.5})]
    assert [scene.plan.section for scene in before] == ["plane", "squeeze"]
    assert before[0].replace(little).plan == before[1].replace(little).plan


@st.composite
def scenes(draw):
    """Scenes of all engines, with settings open and given."""
    values = {
        "strip.height_ratio": draw(st.floats(0.01, 0.5)),
        "contact.friction": draw(st.floats(0.05, 0.6)),
        "load.entry": draw(st.sampled_from(ENTRIES)),
        "load.cycles": draw(st.integers(0, 2)),
        "model.tolerance": draw(st.sampled_from([0.005, 0.01, 0.05])),
    }
    gross = 20.0 * values["contact.friction"]
    values["load.amplitude"] = gross * draw(st.floats(0.01, 0.9))
    of = {
        "strip.curvature": [0.01],
        "strip.far_end": ["pinned", "free"],
        "strip.kappa_s": [0.6],
        "strip.layers": [[[0.5 * values["strip.height_ratio"], e, 0.3] for e in (1e5, 3e5)] * 2],
        "contact.pressure": [500.0, [[0.0, 10.0], [2.0, 8.0]]],
        "contact.stick_stiffness": [1.0, 50.0],
        "contact.smoothing": [8.0],
        "contact.normal": ["held", "compliant"],
        "load.steps_per_half_cycle": [1, 6],
        "model.section": ["bar", "shell", "squeeze", "assumed", "plane"],
        "model.kinematics": ["exact", "linear"],
        "model.grid": ["collocation"],
        "model.nodes": [41, 401],
    }
    for key in draw(st.sets(st.sampled_from(sorted(of)), max_size=4)):
        values[key] = draw(st.sampled_from(of[key]))
    try:
        scene = jb.Scene().replace(values)
        return scene.by_load_steps() if draw(st.booleans()) else scene
    except jb.InputError:  # they do not go together
        reject()


@given(scene=scenes())
def test_a_pinned_scene_keeps_its_plan(scene, tmp_path_factory):
    """Also in a file, which does not say what a convergence study or load steps are asked of."""
    pinned = scene.pinned()
    assert pinned.plan == scene.plan
    assert dataclasses.replace(pinned).plan == scene.plan
    assert pinned.replace({"contact.friction": 0.9 * scene.contact.friction}).plan == scene.plan
    refined = scene.refined().pinned()
    assert dataclasses.replace(refined).plan == refined.plan
    if scene.model.by == "auto":
        path = tmp_path_factory.getbasetemp() / "pinned.toml"
        jb.write_scene(pinned, path)
        assert jb.read_scene(path).plan == scene.plan


@pytest.mark.parametrize(
    "section",
    ["shell", "squeeze"],
)
@pytest.mark.slow
def test_load_steps_dissipate_as_the_contact_line_does(section):
    """The two engines share the section and the base, not the grid nor the solver."""
    scene = jb.Scene().replace({"model.section": section, "model.kinematics": "linear"})
    scene = scene.replace({"load.entry": "face"})
    line, steps = jb.solve(scene), jb.solve(scene, by="steps")
    assert (line.scene.plan.engine, steps.scene.plan.engine) == (LINE, STEPS)
    allowed = scene.model.tolerance
    assert float(steps.dissipation) == pytest.approx(float(line.dissipation), rel=allowed)
    stiffness = float(line.secant_stiffness)
    assert float(steps.secant_stiffness) == pytest.approx(stiffness, rel=allowed)
