"""Normal contact of one point: residual of each law, and reaction as derivative of the energy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jbeamshell.mechanics.normal_contact import Absent, Compliance, NormalLaw, Rigid

K, ROUND = 40.0, 0.25
SOFT = Compliance(jnp.asarray(K), jnp.asarray(ROUND))
numbers = st.floats(-1e3, 1e3) | st.just(0.0)
gaps = st.floats(-4 * ROUND, 4 * ROUND) | st.sampled_from([-ROUND, 0.0, ROUND])


def rigid(stiffness=50.0):
    return Rigid(jnp.asarray(stiffness))


@given(numbers, numbers, st.floats(1e-3, 1e6))
def test_rigid_contact_is_at_rest_exactly_where_its_conditions_hold(reaction, gap, stiffness):
    holds = reaction >= 0 and gap >= 0 and min(reaction, gap) == 0
    assert (rigid(stiffness).residual(reaction, gap) == 0) == holds
    assert rigid(stiffness).reaction(reaction, gap) == reaction


@pytest.mark.parametrize(("reaction", "gap"), [(2.0, 0.0), (0.0, 1e-3), (0.0, 0.0)])
def test_touching_and_lifted_points_are_at_rest(reaction, gap):
    assert rigid().residual(reaction, gap) == 0


def test_the_stiffness_only_weighs_the_gap():
    residual = rigid(10.0).residual
    assert residual(-3.0, 0.5) == -3.0
    assert residual(3.0, -0.5) == -5.0
    slopes = jax.grad(residual, (0, 1))
    assert slopes(3.0, 0.0) == (0, 10)  # touching: the residual is the gap
    assert slopes(0.0, 1.0) == (1, 0)  # lifted: the residual is R
    assert slopes(0.0, 0.0) == (0, 10)  # a tie counts as contact


@given(numbers, numbers, st.floats(1e-3, 1e6))
def test_a_point_at_rest_has_its_status_and_another_can_be_held_to_the_one_that_it_loses(
    reaction, gap, stiffness
):
    law = rigid(stiffness)
    if law.residual(reaction, gap) == 0:
        assert not law.changes_status(reaction, gap)
    if law.changes_status(reaction, gap):
        held, far, residual = law.kept_status(reaction, gap)
        assert residual == max(reaction, stiffness * gap)
        assert held == 0.0  # a point without pressure, which has no friction
        slopes = jax.grad(law.residual, (0, 1))
        if reaction != stiffness * gap:
            assert slopes(held, far) != slopes(reaction, gap)


@given(gaps, gaps)
def test_compliant_contact_has_no_kink(one, other):
    slope = jax.grad(SOFT.reaction, 1)
    here, there = slope(0.0, one), slope(0.0, other)
    assert -K <= here <= 0.0
    assert abs(here - there) <= K / (2.0 * ROUND) * abs(one - other) + 1e-12
    if one < other:
        assert SOFT.reaction(0.0, one) >= SOFT.reaction(0.0, other) >= 0.0


@given(st.floats(ROUND, 1e3))
def test_compliant_contact_is_a_spring_beyond_the_rounding(distance):
    assert SOFT.reaction(0.0, distance) == 0.0
    np.testing.assert_allclose(SOFT.reaction(0.0, -distance), K * distance, rtol=1e-12)
    assert SOFT.energy(distance) == 0.0


@given(numbers, gaps)
def test_compliant_contact_returns_what_presses(pressed, gap):
    np.testing.assert_allclose(SOFT.residual(pressed, gap), pressed - SOFT.reaction(pressed, gap))


@pytest.mark.parametrize("law", [rigid(), SOFT, Absent()])
def test_the_energy_falls_as_the_gap_opens_by_the_reaction(law):
    gap = jnp.linspace(-4 * ROUND, 4 * ROUND, 65)
    pressed = jnp.zeros_like(gap)  # a rigid foundation stores nothing
    slope = jax.vmap(jax.grad(law.energy))(gap)
    np.testing.assert_allclose(slope, -jax.vmap(law.reaction)(pressed, gap), atol=1e-12)


@given(numbers, numbers)
def test_without_a_foundation_nothing_reacts(balance, gap):
    assert Absent().reaction(balance, gap) == 0
    assert Absent().residual(balance, gap) == balance


def test_a_law_must_say_what_it_returns():
    with pytest.raises(TypeError, match="abstract"):
        NormalLaw()
