"""Strains of a section: none in a rigid motion, and in agreement with the positions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from jbeamshell.mechanics.kinematics import (
    KINEMATICS,
    exact_position,
    exact_strains,
    linear_strains,
)

H = 0.3
fields = arrays(float, 4, elements=st.floats(-0.9, 0.9))


def gradient(position, section, slope, height):
    """Displacement at a height, and its derivative along X, by differentiating positions."""
    return jax.jvp(lambda q: jnp.stack(position(q, H, height)), (section,), (slope,))


def along_and_across(rotation, dx, dy):
    """Extension along T and shear along B of the deformed line X."""
    cos, sin = jnp.cos(rotation), jnp.sin(rotation)
    return (1 + dx) * cos + dy * sin - 1, dy * cos - (1 + dx) * sin


@given(st.floats(-np.pi, np.pi), st.floats(-1, 1))
def test_rigid_rotation_and_lift_strain_nothing(angle, lift):
    section = jnp.array([0.2, lift, angle, 0.0])
    slope = jnp.array([jnp.cos(angle) - 1, jnp.sin(angle), 0.0, 0.0])
    np.testing.assert_allclose(jnp.stack(exact_strains(section, slope, H)), 0, atol=4e-16)


def test_linear_strains_do_see_a_large_rotation():
    slope = jnp.array([jnp.cos(1.0) - 1, jnp.sin(1.0), 0.0, 0.0])
    assert linear_strains(jnp.array([0, 0, 1.0, 0]), slope, H).e < -0.4


def test_rigid_rotation_turns_every_height_alike():
    x, angle = 0.7, 1.0
    section = jnp.array([x * (np.cos(angle) - 1), x * np.sin(angle), angle, 0.0])
    for s in (-H, 0.1, H):
        moved = jnp.stack(exact_position(section, H, s)) + jnp.array([x, H + s])
        turned = [
            x * np.cos(angle) - (H + s) * np.sin(angle),
            x * np.sin(angle) + (H + s) * np.cos(angle),
        ]
        np.testing.assert_allclose(moved, turned, atol=1e-15)


@given(fields, fields)
def test_exact_strains_are_those_of_the_positions_at_mid_height(section, slope):
    strains = exact_strains(section, slope, H)
    _, (dx, dy) = gradient(exact_position, section, slope, 0.0)
    e, g = along_and_across(section[2], dx, dy)
    np.testing.assert_allclose(strains.e, e, atol=4e-15)
    np.testing.assert_allclose(strains.g, g, atol=4e-15)
    assert (strains.k, strains.psi, strains.dpsi) == (slope[2], section[3], slope[3])


@given(fields, fields, st.floats(-H, H))
def test_strains_at_a_height(section, slope, s):
    strains = exact_strains(section, slope, H)
    _, (dx, dy) = gradient(exact_position, section, slope, s)
    e, g = along_and_across(section[2], dx, dy)
    np.testing.assert_allclose(e, strains.e - s * (1 + strains.psi) * strains.k, atol=4e-15)
    np.testing.assert_allclose(g, strains.g + s * strains.dpsi, atol=4e-15)


@given(fields, fields, st.floats(-H, H))
def test_small_strains_at_a_height(section, slope, s):
    strains = linear_strains(section, slope, H)
    _, (dx, dy) = gradient(KINEMATICS["linear"].position, section, slope, s)
    np.testing.assert_allclose(dx, strains.e - s * strains.k, atol=4e-15)
    np.testing.assert_allclose(dy - section[2], strains.g + s * strains.dpsi, atol=4e-15)


@given(fields, st.floats(-H, H))
def test_height_changes_by_the_squeeze_strain(section, s):
    def position(height):
        return jnp.stack(exact_position(section, H, height)) + jnp.array([0.0, height])

    _, across = jax.jvp(position, (s,), (1.0,))
    normal = jnp.array([-jnp.sin(section[2]), jnp.cos(section[2])])
    np.testing.assert_allclose(across, (1 + section[3]) * normal, atol=4e-15)


@pytest.mark.parametrize("beta", [1e-9, 1e-5])
def test_small_rotations_do_not_cancel(beta):
    section = jnp.array([0.0, 0.0, beta, 0.0])
    turned = exact_strains(section, jnp.zeros(4), H)
    np.testing.assert_allclose(turned.e, -(beta**2) / 2, rtol=1e-10)
    climbing = exact_strains(section, jnp.array([0.0, beta, 0.0, 0.0]), H)
    np.testing.assert_allclose(climbing.e, beta**2 / 2, rtol=1e-10)
    _, y = exact_position(section, H, H)
    np.testing.assert_allclose(y, -2 * H * beta**2 / 2, rtol=1e-10)


@given(fields, fields, st.floats(-H, H))
def test_linear_kinematics_linearise_the_exact(section, slope, s):
    exact, linear = KINEMATICS["exact"], KINEMATICS["linear"]
    at_rest = (jnp.zeros(4), jnp.zeros(4))
    _, strains = jax.jvp(lambda q, dq: exact.strains(q, dq, H), at_rest, (section, slope))
    np.testing.assert_allclose(strains, linear.strains(section, slope, H), atol=1e-15)
    _, position = gradient(exact.position, jnp.zeros(4), section, s)
    np.testing.assert_allclose(position, linear.position(section, H, s), atol=1e-15)
