"""Unilateral contact of one point."""

import jax
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jbeamshell.contact import complementarity

numbers = st.floats(-1e3, 1e3) | st.just(0.0)


@given(numbers, numbers, st.floats(1e-3, 1e6))
def test_zero_exactly_where_the_contact_conditions_hold(reaction, lift, stiffness):
    holds = reaction >= 0 and lift >= 0 and min(reaction, lift) == 0
    assert (complementarity(reaction, lift, stiffness) == 0) == holds


@pytest.mark.parametrize(("reaction", "lift"), [(2.0, 0.0), (0.0, 1e-3), (0.0, 0.0)])
def test_touching_and_lifted_points_are_at_rest(reaction, lift):
    assert complementarity(reaction, lift, 50.0) == 0


def test_the_stiffness_only_weighs_the_lift():
    assert complementarity(-3.0, 0.5, 10.0) == -3.0
    assert complementarity(3.0, -0.5, 10.0) == -5.0
    slopes = jax.grad(complementarity, (0, 1))
    assert slopes(3.0, 0.0, 10.0) == (0, 10)  # touching: w = 0 is what to solve
    assert slopes(0.0, 1.0, 10.0) == (1, 0)  # lifted: R = 0 is
