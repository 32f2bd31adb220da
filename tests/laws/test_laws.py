"""Laws against closed forms, quadrature, one another and their limits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jbeamshell import laws, reference
from jbeamshell.common.errors import InputError

SIZES = jnp.array([0.3, 0.8, 2.5])
SMOOTH = {
    "dahl": laws.Dahl(slip_force=1.2, stiffness=3.0),
    "bouc-wen": laws.BoucWen(slip_force=1.2, stiffness=3.0, exponent=1.4, unloading=0.7),
    "lugre": laws.LuGre(
        slip_force=1.2, stiffness=3.0, damping=0.2, breakaway=1.3, viscous=0.1, speed=0.5
    ),
}


def steady_loop(law, size, points=200, cycles=10):
    """Energy and force amplitude of the last of many cycles, from the forces alone."""
    way = np.linspace(-1.0, 1.0, points + 1)
    path = size * np.concatenate([way, *[np.append(-way[1:], way[1:])] * cycles])
    force = np.asarray(law.path_forces(path))
    rows = slice(-points - 1, None)
    up, down = force[rows], force[-2 * points - 1 : -points]
    middle = np.trapezoid(up - down[::-1], path[rows])
    return middle, force[-1]


@pytest.mark.parametrize("name", SMOOTH)
def test_closed_energy_and_force_are_those_of_a_simulated_cycle(name):
    law = SMOOTH[name]
    size = 0.7
    energy, force = steady_loop(law, size)

    @jax.jit
    def closed(law):
        reached = law.secant_stiffness(size) * size
        return law.dissipation(size), reached, law.displacement(reached)

    expected, reached, found = closed(law)
    rounding = 5e-3 if name == "lugre" else 3e-4  # its force jumps where the loop turns
    assert energy == pytest.approx(float(expected), rel=rounding)
    assert force == pytest.approx(float(reached), rel=3e-4)
    assert float(found) == pytest.approx(size, rel=1e-6)


@pytest.mark.slow
def test_bouc_wen_with_exponent_one_and_straight_unloading_rises_like_dahl():
    law = laws.BoucWen(slip_force=2.0, stiffness=5.0, exponent=1.0, hardening=0.0)
    np.testing.assert_allclose(law.backbone(SIZES), laws.Dahl(2.0, 5.0).backbone(SIZES), rtol=1e-9)


@pytest.mark.parametrize(("exponent", "unloading"), [(1.0, 0.01), (1.7, 0.8), (50.0, 1.0 - 1e-6)])
def test_bouc_wen_is_exact_on_long_straight_pieces(exponent, unloading):
    law = laws.BoucWen(2.0, 5.0, exponent, unloading, 0.1)
    ends = np.array([0.7, 0.1, -0.5, 9.0, -0.4, 0.05])
    fine = np.concatenate(
        [np.linspace(a, b, 501)[1:] for a, b in zip([0.0, *ends[:-1]], ends, strict=True)]
    )
    np.testing.assert_allclose(law.path_forces(ends), law.path_forces(fine)[499::500], atol=1e-6)

    def step(z, move):
        """Midpoint rule, the law in its own words."""
        middle = z + 0.5 * move * rate(z, move)
        return z + move * rate(middle, move)

    def rate(z, move):
        return 1.0 - abs(z) ** exponent * (unloading * np.sign(z * move) + 1.0 - unloading)

    z, last, found = 0.0, 0.0, []
    for u in fine[:1500]:
        for _ in range(4):
            z = step(z, 0.25 * (u - last) * 5.0 / 2.0)
        last = u
        found.append(0.5 * u + 1.8 * z)
    np.testing.assert_allclose(law.path_forces(fine[:1500]), found, atol=1e-5)


def test_bouc_wen_loses_energy_at_all_sizes_within_its_bounds():
    sizes = np.logspace(-3, 6, 10)
    dissipation = jax.jit(lambda law: law.dissipation(sizes))
    for exponent in (1.0, 1.5, 50.0):
        for unloading in (1e-3, 0.5, 1.0 - 1e-6):
            law = laws.BoucWen(2.0, 5.0, exponent, unloading, 0.0)
            lost = np.asarray(dissipation(law))
            assert np.all(np.diff(lost) > 0.0)
            assert lost[-1] == pytest.approx(4.0 * 2.0 * sizes[-1], rel=1e-3)


@pytest.mark.slow
def test_lugre_at_rest_is_dahl_and_slides_at_its_stribeck_force():
    slow = laws.LuGre(slip_force=1.0, stiffness=3.0, damping=0.0, breakaway=1.5, speed=0.0)
    path = np.array([0.2, 0.7, -0.4, 0.1, 1.4])
    np.testing.assert_allclose(
        slow.path_forces(path), laws.Dahl(1.5, 3.0).path_forces(path), rtol=1e-12
    )
    law = laws.LuGre(slip_force=1.0, stiffness=3.0, breakaway=1.5, viscous=0.2, stribeck_speed=2.0)
    far = law.path_forces([100.0, 200.0], time=[50.0, 100.0])
    expected = 1.0 + 0.5 * np.exp(-1.0) + 0.2 * 2.0
    np.testing.assert_allclose(far, expected, rtol=1e-9)


def test_the_bar_is_the_closed_bar():
    law = laws.Bar.of(3.4e4, 1.0, 2.0)
    force = jnp.array([0.2, 0.7855, 1.9])
    np.testing.assert_allclose(law.displacement(force), reference.bar_backbone(force, 3.4e4, 1.0))
    np.testing.assert_allclose(law.backbone(law.displacement(force)), force, rtol=1e-12)
    expected = reference.cubic_law(force, 3.4e4, 1.0)
    np.testing.assert_allclose(law.dissipation_at_force(force), expected, rtol=1e-12)


def test_sliders_by_name_have_a_number_each():
    law = laws.law_named("sliders4").started(1.0, 0.01, 0.01, 150.0)
    names = ("first", "last", "force1", "force2", "force3", "force4")
    assert law.free() == tuple(f"sliders4.{name}" for name in names)
    assert float(law.capacity) == pytest.approx(1.05, rel=1e-9)
    assert bool(jnp.all(law.springs > 0.0))


@pytest.mark.slow
def test_a_node_under_a_normal_force_in_phase_has_a_quadrangle():
    node = laws.JangBarber(stiffness=4.0, friction=0.5, normal_force=2.0)
    size, slope = 1.0, 0.8
    path = size * np.cos(2.0 * np.pi * np.arange(6001) / 2000)
    force = np.asarray(node.path_forces(path, 2.0 + slope * path))[-2001:]
    area = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(path[-2001:]))
    assert float(node.dissipation_in_phase(size, slope)) == pytest.approx(area, rel=1e-4)
    assert float(node.dissipation_of_phase(size, slope, 0.0, 2000)) == pytest.approx(area, rel=1e-4)
    constant = laws.Jenkins(slip_force=1.0, stiffness=4.0)
    assert float(node.dissipation(size)) == pytest.approx(float(constant.dissipation(size)))


def test_the_phase_of_the_normal_force_matters_and_its_sign_does_not():
    node = laws.JangBarber(stiffness=4.0, friction=0.5, normal_force=2.0)
    phases = jnp.pi * jnp.array([0.0, 0.5, 1.0, 1.5])

    @jax.jit
    def energies(swing):
        return jax.vmap(lambda phase: node.dissipation_of_phase(1.0, swing, phase, 1000))(phases)

    held, lifted = energies(1.6), energies(4.0)
    # N + swing cos and u turned over together are the same node seen from behind.
    np.testing.assert_allclose(held[:2], held[2:], rtol=1e-6)
    assert float(held[1]) > 1.1 * float(held[0])  # most of all a quarter of a turn apart
    assert float(lifted[1]) > 1.3 * float(held[1])  # and where the node lifts off


def test_bad_input_is_one_clear_line():
    node = laws.JangBarber(stiffness=4.0, friction=0.5, normal_force=2.0)
    with pytest.raises(InputError, match=r"^slope = 3.0: lifts the node off: take path_forces"):
        node.dissipation_in_phase(1.0, 3.0)
    with pytest.raises(InputError, match=r"^model = 'iwan5': choose jenkins, iwan4, "):
        laws.law_named("iwan5")
    with pytest.raises(InputError, match=r"^sliders = 1: must be a whole number, 2 to 32"):
        laws.law_named("sliders1")
    with pytest.raises(InputError, match=r"^lugre.breakaway = 0.5: "):
        laws.LuGre(breakaway=0.5)
