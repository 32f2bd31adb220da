"""Settings that a scene leaves open, and what it chooses for them."""

import jax
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.scene.choice import CONTACT_LINE, KNOWN, LIFTING, PLANE, SOFT_CONTACT_LINE, STEPWISE

FINE = {"model.tolerance": KNOWN}  # for which grids were measured
SQUEEZE = jb.Scene().replace({"model.section": "squeeze"})
ROTATING = {"contact.pressure": 500.0, "load.amplitude": 40.0}


def test_the_standard_strip_is_solved_on_its_contact_line():
    model = jb.Scene().replace(FINE | {"load.amplitude": 1.8}).model
    assert model.rung == "condensed-squeeze"
    assert model.kinematics == "linear"
    assert (model.nodes, model.end_size) == (CONTACT_LINE.nodes, CONTACT_LINE.end_size)
    assert model.given("nodes") == model.given("solution") == model.given("fields") == "auto"


@pytest.mark.parametrize(
    ("values", "rung"),
    [
        ({}, "condensed-squeeze"),
        ({"load.amplitude": 0.4}, "plane"),  # its slip reaches 2.5 H
        ({"load.amplitude": 0.4, "model.tolerance": 0.1}, "condensed-squeeze"),
        ({"load.entry": "traction"}, "plane"),
        ({"contact.pressure": [[0.0, 10.0], [2.0, 8.0]]}, "plane"),
        ({"contact.pressure": [[0.0, 9.0], [2.0, 4.0]]}, "condensed-squeeze"),
        ({"contact.pressure": [[0.5, 10.0], [1.5, 10.0]]}, "plane"),  # a patch
        ({"strip.far_end": "free"}, "plane"),
        ({"strip.poisson_ratio": 0.495, "load.amplitude": 1.5}, "plane"),  # none was recorded
        ({"strip.layers": [[0.1, 1e5, 0.3], [0.1252, 2e5, 0.3]]}, "plane"),
        ({"load.control": "displacement", "load.amplitude": 1e-5}, "condensed-squeeze"),
        ({"load.control": "displacement", "load.amplitude": 1e-6}, "plane"),
        ({"strip.kappa_s": 0.5, "load.amplitude": 0.4}, "condensed-squeeze"),
        ({"strip.height_ratio": 0.4}, "plane"),  # though its rotations make more than .2 %
        ({"model.section": "squeeze", "load.amplitude": 0.4}, "condensed-squeeze"),
        ({"model.section": "auto", "load.amplitude": 0.4}, "plane"),
    ],
    ids=str,
)
def test_the_section_is_the_cheapest_that_keeps_the_tolerance(values, rung):
    assert (
        jb.Scene()
        .replace({"model.section": "squeeze"})
        .replace(values)
        .replace({"model.section": values.get("model.section", "auto")})
        .plan.section
        == rung
    )


def test_a_section_that_is_too_far_off_gives_way_to_elasticity():
    """A bar would slip over 4.4 H.  The section slips over 3 H, where it is some 5 % off."""
    scene = jb.Scene().replace({"load.amplitude": 0.5, "model.tolerance": 0.02})
    assert scene.plan.section == "condensed-squeeze"
    history = jb.solve(scene)
    assert history.scene.plan.section == "plane"
    exact = jb.solve(scene.replace({"model.section": "plane", "model.nodes": 193}))
    assert float(history.dissipation) == pytest.approx(float(exact.dissipation), rel=0.02)
    again = history.scene.replace({"load.amplitude": 1.2})
    assert again.plan.section == "condensed-squeeze"


@pytest.mark.parametrize(
    "values",
    [
        ROTATING,
        {"contact.normal": "compliant"},
        {"strip.curvature": 1e-3},
        {"contact.smoothing": 8.0},
        {"model.grid": "collocation"},
        {"model.kinematics": "exact"},
        {"model.nodes": 401},
        {"load.control": "arc-length", "load.amplitude": 1e-5},
    ],
    ids=lambda values: next(reversed(values)),
)
def test_what_needs_load_steps_gets_them(values):
    scene = jb.Scene().replace(values)
    assert scene.model.solution == "stepwise"
    assert scene.by_load_steps().model == scene.model


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


@pytest.mark.parametrize("values", [{"contact.smoothing": 8.0}, {"model.kinematics": "exact"}])
def test_a_bar_stays_a_bar(values):
    assert jb.Scene().replace({"model.fields": ["v"]} | values).plan.fields == ("v",)


def test_linear_load_steps_keep_their_fields():
    scene = jb.Scene().replace({"model.kinematics": "linear"})
    assert scene.replace({"model.solution": "stepwise"}).model.fields == ("v", "beta", "psi")


@pytest.mark.doubtful("the section squeeze")
def test_load_steps_lift_as_the_contact_line_does():
    """Kept down, this strip would dissipate 5 % less, and as much with sliders of alpha G/H."""
    thick = {"strip.height_ratio": 0.35, "contact.friction": 0.4, "load.amplitude": 2.0}
    scene = jb.Scene().replace(thick)
    linear = {"model.kinematics": "linear", "model.nodes": 129, "model.section": "squeeze"}
    line = jb.solve(scene.replace(linear))
    steps = jb.solve(scene.replace({"model.kinematics": "exact"}), throw=False)
    assert (line.scene.model.solution, steps.scene.model.solution) == ("condensed", "stepwise")
    allowed = steps.scene.model.tolerance
    assert float(steps.dissipation) == pytest.approx(float(line.dissipation), rel=allowed)


def test_ideal_sliders_hold_as_much_on_small_elements_as_on_large_ones():
    steps = jb.Scene().replace({"model.solution": "stepwise"})
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
    loose = jb.Scene().replace(ROTATING | {"model.tolerance": 0.1})
    assert loose.plan.kinematics == "linear"
    assert jb.Scene().replace({"model.section": "p2"} | ROTATING).plan.kinematics == "exact"


def test_an_overhang_near_buckling_rotates():
    slender = {"strip.height_ratio": 0.01, "contact.friction": 0.3, "load.amplitude": 1.0}
    pressure = {"contact.pressure": [[0.0, 30.0], [0.6, 30.0], [0.6, 0.0], [2.0, 0.0]]}
    assert jb.Scene().replace(slender | pressure).plan.kinematics == "exact"
    thick = slender | pressure | {"strip.height_ratio": 0.1}
    assert jb.Scene().replace(thick).plan.kinematics == "linear"


def test_given_settings_stay():
    scene = jb.Scene().replace({"model.nodes": 41})
    assert scene.replace({"contact.friction": 0.2}).model.nodes == 41
    chosen = jb.Scene().plan.nodes
    assert scene.replace({"model.nodes": "auto"}).model.nodes == chosen
    pinned = jb.Scene().pinned()
    assert pinned.replace({"model.tolerance": 0.05}).model.nodes == chosen


def test_nodes_follow_the_tolerance():
    def nodes(tolerance):
        return SQUEEZE.replace({"model.tolerance": tolerance}).model.nodes

    assert nodes(0.005) == CONTACT_LINE.nodes
    assert (nodes(0.00125) - 1) == 2 * (nodes(0.005) - 1)  # second order
    assert nodes(0.02) < nodes(0.005)
    ramp = {"contact.pressure": [[0.0, 10.0], [2.0, 8.0]]} | FINE
    # Half as many more for each row at which the pressure may jump.
    assert SQUEEZE.replace(ramp).plan.nodes - 1 == 1.5 * (nodes(0.005) - 1)


def test_elements_at_the_loaded_end_are_small_where_the_corner_opens():
    def chosen(**values):
        model = SQUEEZE.replace(FINE | values).model
        return model.nodes, model.end_size

    def grid(known):
        return known.nodes, known.end_size

    soft = {"contact.stick_stiffness": 1000.0}
    assert chosen(**soft) == grid(SOFT_CONTACT_LINE)
    assert chosen() == grid(CONTACT_LINE)
    given = soft | {"model.nodes": 41}
    assert chosen(**given) == (41, CONTACT_LINE.end_size)
    steps = {"model.kinematics": "exact"}
    assert chosen(**steps) == grid(LIFTING)
    assert chosen(**steps, **soft) == grid(STEPWISE)
    assert chosen(**steps, **{"model.fields": ["v"]}) == grid(STEPWISE)
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
        scene = chosen.replace({"model.end_size": end_size})
        return float(jb.solve(scene, throw=False).dissipation)

    found = dissipation(end)
    assert abs(dissipation(0.25 * end) / found - 1.0) < 0.005
    assert abs(dissipation(CONTACT_LINE.end_size) / found - 1.0) > 0.02


def test_traced_numbers_take_elasticity_unless_the_section_is_named():
    found = []

    def dissipation(friction):
        for given in (jb.Scene(), SQUEEZE):
            scene = given.replace(FINE | {"contact.friction": friction})
            found.append((scene.plan.section, scene.plan.nodes))
        return scene.contact.friction

    jax.jit(jax.grad(dissipation))(0.1)
    assert found == [("plane", PLANE.nodes), ("condensed-squeeze", CONTACT_LINE.nodes)]
    whole = jax.jit(lambda: jb.Scene().contact.friction)  # numbers that are known within jit
    assert float(whole()) == 0.1


def test_a_file_keeps_what_was_left_open():
    text = jb.scene_to_toml(jb.Scene())
    assert 'nodes = "auto"' in text
    assert 'fields = "auto"' in text
    assert "nodes = 65" in jb.scene_to_toml(SQUEEZE.replace(FINE).pinned())


@pytest.mark.parametrize(
    ("key", "value", "fix"),
    [
        ("model.tolerance", 0.0, "must lie between 0.0001 and 0.1"),
        ("model.tolerance", 1e-6, "must lie between 0.0001 and 0.1"),
        ("model.order", "auto", "must be a whole number"),
        ("load.cycles", "auto", "must be a whole number"),
        ("model.nodes", "many", "must be a whole number"),
        ("model.kinematics", "best", "choose 'exact' or 'linear'"),
    ],
)
def test_bad_settings_name_the_fix(key, value, fix):
    with pytest.raises(jb.InputError, match=rf"{key} = .*{fix}"):
        jb.Scene().replace({key: value})


def test_a_sweep_chooses_for_all_its_strips():
    over = {"contact.pressure": [10.0, 500.0], "load.amplitude": [0.5]}
    assert SQUEEZE.pinned(_numbers(over)).plan.kinematics == "exact"
    assert SQUEEZE.pinned(_numbers({"load.amplitude": [0.5]})).model.kinematics == "linear"
    slips = {"load.amplitude": [0.4, 1.2]}  # over 2.5 H at least
    assert jb.Scene().pinned(_numbers(slips)).plan.section == "plane"
    slips = {"load.amplitude": [0.9, 1.2]}
    assert jb.Scene().pinned(_numbers(slips)).plan.section == "condensed-squeeze"


def _numbers(over):
    from jbeamshell.sweeping.lanes import lanes_of

    return lanes_of(jb.Scene(), over).value


def test_history_says_what_was_chosen():
    history = jb.solve(jb.Scene())
    rung = "chosen to be within 1 % of plane elasticity: rung condensed-squeeze that may lift off"
    assert f"{rung}, linear kinematics, {history.x.size} nodes" in str(history)
    assert history.doubts == ()
    assert "chosen" not in str(jb.solve(jb.Scene().pinned()))
    # Plane elasticity on 257 nodes.
    assert float(history.dissipation) == pytest.approx(7.252e-06, rel=0.01)
    assert float(history.secant_stiffness) == pytest.approx(79457.0, rel=0.01)


@pytest.mark.slow
def test_a_doubt_about_chosen_nodes_names_the_tolerance():
    little = {"strip.height_ratio": 0.4, "load.amplitude": 0.01, "model.tolerance": 0.02}
    chosen = jb.solve(jb.Scene().replace(little), throw=False)
    assert [doubt.partition("; ")[2] for doubt in chosen.doubts] == [
        "take a smaller model.tolerance"
    ]
    given = jb.solve(jb.Scene().replace(little | {"model.nodes": 33}), throw=False)
    assert "more model.nodes" in given.doubts[0]


def test_pressures_that_change_beside_elastic_sliders_take_load_steps():
    path = np.array([[0.2, 1.0], [0.2, 0.5]])
    soft = jb.Scene().replace({"model.nodes": 11, "contact.stick_stiffness": 10.0})
    history = jb.solve(soft, path, throw=False)
    assert history.scene.model.solution == "stepwise"
    with pytest.raises(jb.InputError, match="must act wholly beside elastic sliders"):
        jb.solve(soft.pinned(), path)


def test_a_history_on_the_contact_line_goes_on():
    scene = jb.Scene().replace({"model.nodes": 33, "load.cycles": 1})
    begun = jb.solve(scene)
    further = begun.continued([0.5, -0.2])
    whole = jb.solve(scene, np.append(np.asarray(begun.target)[begun.pressed + 1 :], [0.5, -0.2]))
    np.testing.assert_array_equal(further.displacement, whole.displacement)
    assert further.force.size == begun.force.size + 2


def test_a_choice_does_not_depend_on_the_choice_before():
    little = {"strip.height_ratio": 0.3, "strip.kappa_s": 0.6, "load.amplitude": 0.02}
    strip = jb.Scene().replace({"load.entry": "traction"})
    before = [strip.replace({"load.amplitude": size}) for size in (0.5, 1.6)]
    assert [scene.model.solution for scene in before] == ["plane", "condensed"]
    assert before[0].replace(little).model == before[1].replace(little).model
