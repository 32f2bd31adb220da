"""Strain energy of a homogeneous section against plane strain, and a user's own energy."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import STEPPED

from jbeamshell import InputError, Load, Model, Scene, solve
from jbeamshell.mechanics.homogeneous import Homogeneous, forces, shear_coefficient
from jbeamshell.mechanics.kinematics import Strains

H, PLANE, NU, KAPPA_S = 0.3, 2.5e3, 0.27, 0.44
YOUNGS = PLANE * (1 - NU**2)
G = YOUNGS / (2 * (1 + NU))
LAM = YOUNGS * NU / ((1 + NU) * (1 - 2 * NU))
C11 = LAM + 2 * G
SECTION = Homogeneous(H, PLANE, NU, KAPPA_S)
STRAINS = Strains(*jnp.array([1.1e-3, -0.7e-3, 2.3e-3, 0.9e-3, -1.7e-3]))

BY_STEPS = {"by": "steps", "kinematics": "linear"}


def test_forces_are_the_closed_expressions():
    e, g, k, psi, dpsi = STRAINS
    expected = Strains(
        e=2 * H * (C11 * e + LAM * psi),
        g=2 * shear_coefficient(NU) * G * H * g,
        k=2 / 3 * PLANE * H**3 * k,
        psi=2 * H * (LAM * e + C11 * psi),
        dpsi=2 / 3 * KAPPA_S * G * H**3 * dpsi,
    )
    np.testing.assert_allclose(forces(SECTION, STRAINS), expected, rtol=1e-13)


def test_forces_of_the_model_without_squeeze():
    section = Homogeneous(H, PLANE, NU, KAPPA_S, squeeze=False)
    n, q, m, chi, xi = forces(section, STRAINS)
    np.testing.assert_allclose(n, 2 * H * PLANE * STRAINS.e, rtol=1e-14)
    np.testing.assert_allclose((q, m), forces(SECTION, STRAINS)[1:3], rtol=1e-14)
    assert (chi, xi) == (0, 0)


@given(st.floats(-1e-2, 1e-2), st.floats(-1e-2, 1e-2))
def test_uniform_strains_store_the_plane_strain_energy(e, psi):
    sigma_x, sigma_y = C11 * e + LAM * psi, LAM * e + C11 * psi
    stored = SECTION(e, 0.0, 0.0, psi, 0.0)
    np.testing.assert_allclose(stored, H * (sigma_x * e + sigma_y * psi), rtol=1e-12, atol=1e-15)


def test_pure_bending_stores_that_of_fibres_free_to_thicken():
    heights, weights = np.polynomial.legendre.leggauss(2)
    fibres = 0.5 * PLANE * (H * heights * STRAINS.k) ** 2
    bending = SECTION(0.0, 0.0, STRAINS.k, 0.0, 0.0)
    np.testing.assert_allclose(bending, H * weights @ fibres, rtol=1e-14)


@given(st.floats(-0.99, 0.49), st.floats(-1e-2, 1e-2))
def test_free_thickening_condenses_to_the_model_without_squeeze(nu, e):
    with_psi = Homogeneous(H, PLANE, nu, KAPPA_S)
    without = Homogeneous(H, PLANE, nu, KAPPA_S, squeeze=False)
    free = Strains(*jnp.array([e, 0.0, 0.0, -nu / (1 - nu) * e, 0.0]))
    np.testing.assert_allclose(with_psi(*free), H * PLANE * e**2, rtol=1e-12)
    np.testing.assert_allclose(without(*free), H * PLANE * e**2, rtol=1e-12)
    np.testing.assert_allclose(forces(with_psi, free).psi, 0, atol=1e-9)


@jax.jit
def stiffness(nu):
    return jax.hessian(lambda s: Homogeneous(H, PLANE, nu, KAPPA_S)(*s))(jnp.zeros(5))


@given(st.floats(-0.99, 0.49))
def test_positive_definite(nu):
    assert np.linalg.eigvalsh(stiffness(nu)).min() > 0


def test_printed_constants():
    printed = Homogeneous(H, PLANE, NU, KAPPA_S, constants="printed")
    of = forces(printed, STRAINS)
    consistent = forces(SECTION, STRAINS)
    np.testing.assert_allclose(of.k, consistent.k / 16, rtol=1e-14)
    np.testing.assert_allclose(of.dpsi, consistent.dpsi * 24, rtol=1e-14)
    np.testing.assert_allclose(of[:2], consistent[:2], rtol=1e-14)


class Weighed(eqx.Module):
    """Energy of a user's own with a parameter: the shear term scaled."""

    section: Homogeneous
    shear: jax.Array = eqx.field(converter=jnp.asarray)

    def __call__(self, e, g, k, psi, dpsi):
        return self.section(e, jnp.sqrt(self.shear) * g, k, psi, dpsi)


def test_own_energy_takes_the_place_of_the_homogeneous_one():
    parts = STEPPED.strip, STEPPED.contact, STEPPED.load, STEPPED.model
    own, softer = (
        Scene(*parts, energy=Weighed(STEPPED.strain_energy(), shear)) for shear in (1.0, 0.5)
    )
    expected, got, soft = (solve(scene, throw=False) for scene in (STEPPED, own, softer))
    for name in ("displacement", "traction", "reaction", "slip_work", "stored_energy"):
        scale = float(np.abs(getattr(expected, name)).max())
        np.testing.assert_allclose(
            getattr(got, name) / scale, getattr(expected, name) / scale, atol=1e-9, err_msg=name
        )
    assert np.all(soft.displacement[1:3] > 1.15 * expected.displacement[1:3])  # 20 and 25 %


@pytest.mark.slow
def test_a_plain_function_is_an_energy_as_a_module_is():
    standard = Scene(model=Model(nodes=9, **BY_STEPS), load=Load(steps_per_half_cycle=2))
    section = standard.strain_energy()
    module = Scene(model=standard.model, energy=Weighed(section, 0.5))

    def weighed(e, g, k, psi, dpsi):
        return section(e, jnp.sqrt(0.5) * g, k, psi, dpsi)

    plain = Scene(model=standard.model, energy=weighed)
    expected, got = (solve(scene, [0.3, 0.7, 0.1]) for scene in (module, plain))
    np.testing.assert_allclose(got.displacement, expected.displacement, rtol=1e-12, atol=1e-18)
    assert got.doubts == expected.doubts
    assert all(map(eqx.is_array, jax.tree.leaves(plain.replace({"contact.friction": 0.2}))))


@pytest.mark.parametrize(
    "energy",
    [
        lambda e, g, k, psi, dpsi: jnp.stack([e, g]) ** 2,
        lambda e, g, k, psi, dpsi: (e**2, g**2),
        lambda e, g, k: e**2 + g**2 + k**2,
        "e**2",
    ],
    ids=["vector", "tuple", "three arguments", "no function"],
)
def test_energies_that_make_no_model(energy):
    with pytest.raises(InputError, match=r"energy.*(one number|function of)"):
        Scene(energy=energy)
