"""Cattaneo's and Mindlin's contact, against independent codes and its own loops."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jbeamshell import reference
from jbeamshell.common.errors import InputError


def test_shift_of_a_sphere_against_a_half_space_code():
    # CONTACT (E. Vollebregt, github eve70a/CONTACT @ d431cdb, Apache-2.0), case "cattaneo":
    # G = 200 MPa, nu = 0.42, a = 1 mm, F_N = 9.195 N, mu = 0.4, Q = 0.875 mu F_N.
    slip = 0.4 * 9.195
    law = reference.sphere_law(slip, 1.0, reference.pair_compliance(200.0, 0.42))
    assert float(law.displacement(0.875 * slip)) == pytest.approx(8.155e-3, rel=3e-3)
    assert float(reference.stuck_part(0.875, "sphere")) == pytest.approx(0.5, rel=1e-12)


def test_stick_and_counter_slip_of_a_cylinder():
    # A finite-element contact code (github illavori/LevelSetWear @ f5a3cad, BSD-3) has both.
    assert float(reference.stuck_part(0.5)) == pytest.approx(0.70711, abs=1e-5)
    assert float(reference.counter_slip_part(0.0, 0.5)) == pytest.approx(0.86603, abs=1e-5)


@pytest.mark.slow
def test_energy_is_that_of_the_law_and_of_its_loop():
    law = reference.sphere_law(3.0, 0.7, 0.02)
    force = jnp.array([0.3, 1.5, 2.9])
    closed = reference.mindlin_energy(force, 3.0, 0.7, 0.02)
    np.testing.assert_allclose(law.dissipation_at_force(force), closed, rtol=1e-9)
    way = 1.5 * np.cos(np.pi * np.arange(801) / 400)
    shift = np.asarray(law.path_displacements(np.append(1e-9, way)))[1:]
    area = -np.sum(0.5 * (shift[1:] + shift[:-1]) * np.diff(way))
    assert area == pytest.approx(float(closed[1]), rel=1e-4)


def test_energy_falls_to_goodmans_cube_with_order_one():
    force = 0.05 / 2.0 ** jnp.arange(5)
    energies = reference.mindlin_energy(force, 1.0, 1.0, 1.0)
    beyond = energies / reference.goodman_energy(force, 1.0, 1.0, 1.0) - 1.0
    orders = jnp.log2(beyond[:-1] / beyond[1:])
    np.testing.assert_allclose(orders, 1.0, atol=0.05)
    assert float(beyond[-1] / force[-1]) == pytest.approx(2.0 / 3.0, rel=0.02)  # its next term


def test_gross_slip_is_refused_and_other_shapes_too():
    with pytest.raises(InputError, match=r"^force_ratio = 1.1: is gross slip"):
        reference.stuck_part(1.1)
    with pytest.raises(InputError, match=r"^shape = 'cube': choose 'cylinder' or 'sphere'"):
        reference.stuck_part(0.1, "cube")
    with pytest.raises(InputError, match=r"^force of mindlin = 3.5: is gross slip"):
        reference.sphere_law(3.0, 0.7, 0.02).displacement(3.5)
    assert jnp.isnan(jax.jit(reference.stuck_part)(1.1))


@pytest.mark.slow
def test_a_rigid_partner_adds_no_compliance():
    one = reference.pair_compliance(200.0, 0.3, jnp.inf, 0.3)
    assert float(one) == pytest.approx(1.7 / 200.0, rel=1e-12)
