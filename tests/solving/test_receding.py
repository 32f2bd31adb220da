"""Contact that recedes, advances or stays, without and with friction."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.scene import library

LINEAR = {"model.kinematics": "linear"}


def from_all_nodes(scene):
    """History of a scene whose search for the contact starts as if no node were named."""
    return jb.solve(scene, contact=np.full(scene.plan.nodes, True))


@pytest.fixture(scope="module")
def receding():
    return from_all_nodes(library.receding())


def test_receding_contact_against_the_prototype_and_finite_elements(receding):
    """Prototype shell .62 mm, 103.1 MPa, 1.990e-4; finite elements .779, 103.12, 1.9858e-4."""
    figures = receding.figures()
    assert figures["contact_end"] - 50.0 == pytest.approx(0.62, rel=0.01)
    assert figures["reaction_max"] == pytest.approx(103.1, rel=0.01)
    assert figures["reaction_max_at"] == pytest.approx(47.5, rel=0.01)
    assert figures["lift_slope"] == pytest.approx(1.990e-4, rel=0.01)
    assert figures["lift_slope"] == pytest.approx(1.9858e-4, rel=0.01)
    assert receding.tributary @ receding.reaction[0] == pytest.approx(5000.0, rel=1e-9)


def test_contact_conditions_hold_at_every_node(receding):
    gap, reaction, touching = (
        np.asarray(getattr(receding, name)[0]) for name in ("gap", "reaction", "touching")
    )
    assert np.min(gap) > -1e-15
    assert np.min(reaction) > -1e-5
    assert np.max(np.abs(np.where(touching, gap, reaction))) < 1e-5
    assert np.all(np.diff(touching.astype(int)) <= 0)  # one patch, from the middle on


@pytest.mark.parametrize("start", ["half", "few", "beyond", "random"])
def test_the_active_set_does_not_depend_on_where_it_starts(receding, start):
    x, rng = np.asarray(receding.x), np.random.default_rng(3)
    contact = {
        "half": x < 25.0,
        "few": np.arange(x.size) < 20,  # from fewer the search may not end: round-off decides
        "beyond": x > 60.0,
        "random": rng.random(x.size) < 0.5,
    }[start]
    again = jb.solve(library.receding(), contact=contact)
    np.testing.assert_array_equal(again.touching, receding.touching)
    np.testing.assert_allclose(again.w, receding.w, atol=1e-12)


@pytest.mark.slow
def test_a_search_that_does_not_end_says_so():
    with pytest.raises(jb.UnconvergedError, match="pressing down"):
        jb.solve(library.receding(), solver=jb.Newton(max_iterations=3))


def test_the_contact_does_not_know_how_hard_it_is_pressed(receding):
    half = [[0, 50.0], [50, 50.0], [50, 0.0], [100, 0.0]]
    gentle = from_all_nodes(library.receding().replace({"contact.pressure": half}))
    np.testing.assert_array_equal(gentle.touching, receding.touching)
    for name in ("w", "beta", "psi", "squeeze_stress"):
        full, twice = (np.asarray(getattr(run, name)) for run in (receding, gentle))
        assert np.max(np.abs(2.0 * twice - full)) < 1e-3 * np.max(np.abs(full)), name
    # The last node in contact carries what the geometry's nonlinearity moves the end by.
    inner = np.flatnonzero(receding.touching[0])[:-1]
    np.testing.assert_allclose(
        2.0 * gentle.reaction[0, inner], receding.reaction[0, inner], atol=1e-3 * 100.0
    )
    assert float(gentle.contact_end[0]) == pytest.approx(float(receding.contact_end[0]), abs=1e-3)


@pytest.mark.slow
def test_the_error_of_a_compliant_contact_falls_with_its_compliance():
    scene = library.receding().replace(LINEAR | {"model.nodes": 201})
    rigid = jb.solve(scene)
    soft = scene.replace({"contact.normal": "compliant"})
    stiffness = np.array([10.0, 40.0, 160.0, 640.0])
    slopes = [
        float(jb.solve(soft.replace({"contact.normal_stiffness": k})).lift_slope[0])
        for k in stiffness
    ]
    error = np.array(slopes) / float(rigid.lift_slope[0]) - 1.0
    assert error[0] == pytest.approx(0.08, abs=0.01)
    order = -np.polyfit(np.log(stiffness), np.log(error), 1)[0]
    assert order == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_gradients_pass_through_a_compliant_contact():
    scene = library.receding().replace(LINEAR | {"model.nodes": 201, "contact.normal": "compliant"})

    def slope(kappa_s, mean):
        table = jnp.array([[0.0, 1.0], [50.0, 1.0], [50.0, 0.0], [100.0, 0.0]]) * jnp.array(
            [1.0, mean]
        )
        changed = scene.replace({"strip.kappa_s": kappa_s, "contact.pressure": table})
        return 1e4 * jb.solve(changed, throw=False).lift_slope[0]

    at = jnp.array([0.44, 100.0])
    function = jax.jit(lambda p: slope(*p))
    value, gradient = jax.jit(jax.value_and_grad(lambda p: slope(*p)))(at)
    for direction in (jnp.array([0.44, 0.0]), jnp.array([0.0, 100.0])):
        sizes = np.array([4e-3, 2e-3, 1e-3])
        rest = [
            abs(float(function(at + h * direction) - value - h * gradient @ direction))
            for h in sizes
        ]
        # The response is proportional to the pressure: nothing but round-off is left of it.
        if rest[0] > 1e-9:
            assert np.polyfit(np.log(sizes), np.log(rest), 1)[0] == pytest.approx(2.0, abs=0.15)


@pytest.mark.slow
def test_the_block_stays_and_the_curved_strip_advances():
    block = jb.solve(library.block())
    assert bool(jnp.all(block.touching))
    assert float(block.contact_end[0]) == 1.0
    np.testing.assert_allclose(block.reaction[0], 100.0, rtol=1e-9)
    advancing = jb.solve(library.advancing())
    ends = np.asarray(advancing.contact_end)
    assert np.all(np.diff(ends) > -1e-9)
    assert ends[0] < 2.0
    assert ends[-1] > 50.0
    total = jnp.sum(advancing.tributary * advancing.reaction, axis=1)
    np.testing.assert_allclose(total, 0.02 * 100.0 * advancing.pressure, rtol=1e-8)


def test_a_point_load_lifts_the_strip_beyond_three_quarters_of_its_height():
    history = from_all_nodes(library.point_load())
    assert float(history.contact_end[0]) / 2.0 == pytest.approx(0.735, abs=0.01)


@pytest.mark.slow
def test_a_plain_call_lifts_off_where_elasticity_does():
    """Contact under a point load, of the singular integral equation of strip and base."""
    pressed = [[0.0, 100.0], [0.05, 100.0], [0.05, 0.0], [20.0, 0.0]]
    values = {"strip.length": 20.0, "strip.half_height": 1.0, "contact.pressure": pressed}
    history = jb.solve(jb.Scene().replace(values | {"load.cycles": 0, "contact.friction": 0.0}))
    length = jb.reference.strip_contact_length(2.0, "rigid")
    assert float(history.contact_end[0]) == pytest.approx(float(length), rel=0.005)


@pytest.mark.slow
def test_the_assumed_squeeze_strain_is_what_it_says():
    history = jb.solve(library.receding_421())
    pressed = np.interp(history.x, [0, 2.405, 2.5], [1000, 1000, 0])
    inner = np.abs(np.asarray(history.x) - 2.45) > 0.1  # nodes whose pressure is not averaged
    assumed = -(pressed + np.asarray(history.reaction[0])) / (2.0 * 3e7)
    np.testing.assert_allclose(history.psi[0][inner], assumed[inner], atol=1e-9)
    assert 2.5 < float(history.contact_end[0]) < 2.52
    assert 1010.0 < float(history.reaction_max[0]) < 1040.0  # rises before the load falls
