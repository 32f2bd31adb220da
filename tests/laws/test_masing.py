"""Laws by Masing's rule: exact along any path, against many sliders; closed forms of energy."""

import tomllib

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jbeamshell.common.errors import InputError
from jbeamshell.laws import LAWS, Bar, Iwan4, Jenkins, Mindlin, sliders
from jbeamshell.laws.masing import MasingLaw

LAW = Iwan4(slip_force=2.0, stiffness=100.0, chi=-0.5, beta=0.3)
NESTED = np.array([0.5, -0.3, 0.2, -0.1, 0.15, 0.05, 0.9, -1.2, 1.2, 0.1, 0.5, 0.2, 1.3, 1.3, -0.4])

masing_energy = MasingLaw.dissipation


def many_sliders(law, path, count=4000):
    """Forces of Jenkins elements whose slip displacements have the law's density."""
    edges = np.linspace(0.0, 1.0, count + 1) ** 3 * float(law.phi_max)
    r, s = map(float, law.density)
    power = float(law.chi) + 1.0
    weight = np.append(r * np.diff(edges**power) / power, s)
    limit = np.append(0.5 * (edges[1:] + edges[:-1]), float(law.phi_max))
    stretch, last, forces = np.zeros(count + 1), 0.0, []
    for u in path:
        stretch, last = np.clip(stretch + u - last, -limit, limit), u
        forces.append(weight @ stretch)
    return np.array(forces)


@pytest.mark.slow
def test_iwan4_follows_many_sliders_along_nested_reversals():
    path = NESTED * float(LAW.phi_max)
    errors = [
        np.max(np.abs(np.asarray(LAW.path_forces(path)) - many_sliders(LAW, path, count)))
        for count in (500, 1000, 2000)
    ]
    assert errors[-1] < 1e-6
    assert np.all(np.diff(np.log2(errors)) < -0.9)


def test_iwan4_meets_its_four_parameters():
    assert float(LAW.backbone(LAW.phi_max)) == pytest.approx(2.0, rel=1e-12)
    assert float(LAW.backbone(2.0 * LAW.phi_max)) == pytest.approx(2.0, rel=1e-12)
    r, s = LAW.density
    lost = r * LAW.phi_max**0.5 / 0.5
    assert float(lost + s) == pytest.approx(100.0, rel=1e-12)
    assert float(s / lost) == pytest.approx(0.3, rel=1e-12)


MASING = {
    "iwan4": LAW,
    "iwan4, even": Iwan4(slip_force=2.0, stiffness=100.0, chi=0.0, beta=2.0),
    "jenkins": Jenkins(slip_force=2.0, stiffness=100.0),
    "bar": Bar(2.0, 0.05),
    "mindlin": Mindlin(2.0, 100.0),
    "sliders": sliders(3)(0.01, 0.05, 0.6, 0.9, 0.5),
}


@pytest.mark.parametrize("name", MASING)
def test_closed_energy_is_that_of_masings_loop_and_never_negative(name):
    law, size = MASING[name], jnp.array([0.0, 1e-7, 0.002, 0.006, 0.02, 0.07])
    closed, doubled = jax.jit(lambda law: (law.dissipation(size), masing_energy(law, size)))(law)
    np.testing.assert_allclose(closed, doubled, rtol=1e-9, atol=1e-15)
    assert np.all(np.asarray(closed) >= 0.0)


@pytest.mark.parametrize("chi", [-0.8, -0.3, 0.0])
def test_iwan4_dissipates_by_a_power_of_its_displacement(chi):
    law = Iwan4(slip_force=2.0, stiffness=100.0, chi=chi, beta=0.2)
    small, twice = law.dissipation(law.phi_max * jnp.array([0.01, 0.02]))
    assert float(jnp.log2(twice / small)) == pytest.approx(chi + 3.0, rel=1e-12)
    r, _ = law.density
    expected = 4.0 * r * (0.01 * law.phi_max) ** (chi + 3.0) / ((chi + 2.0) * (chi + 3.0))
    assert float(small) == pytest.approx(float(expected), rel=1e-12)


def test_the_area_of_a_simulated_loop_is_the_closed_dissipation():
    size = 0.6 * float(LAW.phi_max)
    way = np.cos(np.pi * np.arange(401) / 200)
    force = np.asarray(LAW.path_forces(size * np.append(np.linspace(0, 1, 9), way)))[-401:]
    area = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(size * way))
    assert area == pytest.approx(float(LAW.dissipation(size)), rel=1e-3)


@pytest.mark.slow
def test_displacements_on_a_path_of_forces_are_the_inverse():
    path = 0.7 * NESTED[:9] * float(LAW.phi_max)
    forces = LAW.path_forces(path)
    np.testing.assert_allclose(LAW.path_displacements(forces), path, atol=1e-12)


def test_a_path_may_be_traced_and_differentiated():
    path = jnp.asarray(NESTED * float(LAW.phi_max))

    def last(law, path):
        return law.path_forces(path)[7]

    step, traced = 1e-6, jax.jit(last)
    np.testing.assert_allclose(traced(LAW, path), LAW.path_forces(path)[7], rtol=1e-12)
    found = jax.jit(jax.grad(last))(LAW, path).chi
    ends = (traced(LAW.replace({"iwan4.chi": -0.5 + sign * step}), path) for sign in (1.0, -1.0))
    high, low = ends
    assert float(found) == pytest.approx(float((high - low) / (2.0 * step)), rel=1e-6)


def test_jenkins_is_a_clipped_spring():
    law = Jenkins(slip_force=2.0, stiffness=10.0)
    path, force, last, expected = np.random.default_rng(1).normal(0.0, 0.2, 60), 0.0, 0.0, []
    for u in path:
        force, last = np.clip(force + 10.0 * (u - last), -2.0, 2.0), u
        expected.append(force)
    np.testing.assert_allclose(law.path_forces(path), expected, atol=1e-12)
    np.testing.assert_allclose(law.dissipation([0.1, 0.2, 0.5]), [0.0, 0.0, 8.0 * 0.3], atol=1e-12)


@pytest.mark.parametrize("name", ["jenkins", "iwan4", "mindlin", "dahl", "lugre"])
def test_softening_laws_refuse_gross_slip_and_negative_stiffness(name):
    law = LAWS[name]()
    with pytest.raises(InputError, match=rf"^force of {name} = 1.0: is gross slip"):
        law.displacement(law.capacity)
    with pytest.raises(InputError, match=rf"^{name}.stiffness = -1.0: must be a positive number"):
        law.replace({f"{name}.stiffness": -1.0})
    with pytest.raises(InputError, match=rf"unknown key '{name}.k'"):
        law.replace({f"{name}.k": 1.0})


def test_a_law_is_written_as_entries_of_a_plan():
    entries = tomllib.loads(LAW.as_toml())
    assert entries["model"] == "iwan4"
    assert entries["set"] == {key: float(LAW.get(key)) for key in LAW.table()}


def test_a_traced_force_of_gross_slip_gives_no_number():
    assert jnp.isnan(jax.jit(lambda own: own.displacement(1.5))(Jenkins()))


@pytest.mark.parametrize("chi", [-1.0, 0.1, np.nan])
def test_chi_lies_above_minus_one_and_not_above_zero(chi):
    with pytest.raises(InputError, match=r"^iwan4.chi = .*: must lie above -1 and not above 0"):
        Iwan4(chi=chi)
