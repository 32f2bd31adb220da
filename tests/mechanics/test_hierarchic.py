"""Sections of order p: energy, rigid motions, and convergence to plane elasticity."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from jbeamshell.mechanics.hierarchic import Hierarchic
from jbeamshell.mechanics.homogeneous import Homogeneous
from jbeamshell.mechanics.kinematics import linear_strains

H, E, NU = 0.3, 7.0, 0.25
LOCKED = {"strain": 1.0 / (1.0 - (NU / (1.0 - NU)) ** 2), "stress": 1.0 / (1.0 - NU**2)}  # C11/E'


def section(order, kinematics="linear", plane="strain"):
    return Hierarchic(H, E, NU, order, kinematics, plane)


def random_fields(order, seed=0, size=1.0):
    random = np.random.default_rng(seed)
    return [list(size * random.standard_normal(2 * order + 2)) for _ in range(2)]


@pytest.mark.parametrize("order", [2, 3, 5])
@pytest.mark.parametrize("kinematics", ["linear", "exact"])
def test_further_fields_leave_the_faces_alone(order, kinematics):
    fields, _ = random_fields(order, size=0.1)
    one = section(order, kinematics)
    straight = fields[:4] + [0.0] * (2 * order - 2)
    for height in (-H, H):
        got, expected = (one.displacement(f, jnp.asarray(height)) for f in (fields, straight))
        np.testing.assert_allclose(got, expected, atol=1e-15)
    inside = [one.displacement(f, jnp.asarray(0.1 * H)) for f in (fields, straight)]
    assert np.min(np.abs(np.subtract(*inside))) > 1e-3


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_the_first_order_is_the_beamshell_without_its_factors(plane):
    """Order 1 has kappa = kappa_s = 1, and bends with C11 as eps_y cannot vary."""
    values, slope = random_fields(1)
    shell = Homogeneous(H, E, NU, 1.0, plane=plane)
    strains = linear_strains(values, slope, H)
    got = section(1, plane=plane).energy(values, slope)
    shear = shell.shear_modulus * H * strains.g**2
    bending = LOCKED[plane] * shell.bending_stiffness * strains.k**2 / 2.0
    ours = shell(*strains._replace(g=0.0, k=0.0)) + shear + bending
    assert float(got) == pytest.approx(float(ours), rel=1e-13)


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_bending_of_the_second_order_has_the_right_stiffness(plane):
    """In pure bending b_2 takes the linear eps_y that one psi cannot, and D is E' 2H^3/3."""
    curvature = 0.01

    def energy(b2):
        slope = [H * curvature, 0.0, curvature, 0.0, 0.0, 0.0]  # e = v' - H beta' = 0
        return section(2, plane=plane).energy([0.0] * 5 + [b2], slope)

    best = -jax.grad(energy)(0.0) / jax.grad(jax.grad(energy))(0.0)
    stiffness = 2.0 / 3.0 * E * H**3
    assert float(energy(best)) == pytest.approx(0.5 * stiffness * curvature**2, rel=1e-12)
    assert float(energy(0.0)) > 1.05 * float(energy(best))  # locked


@pytest.mark.parametrize("order", [1, 2, 4])
def test_a_rigid_motion_stores_nothing(order):
    """A strip rotated by 0.7 rad about any point has no strains but round-off."""
    angle, zeros = 0.7, [0.0] * (2 * order - 2)
    values = [0.3, -0.2, angle, 0.0, *zeros]
    slope = [np.cos(angle) - 1.0, np.sin(angle), 0.0, 0.0, *zeros]
    assert abs(float(section(order, "exact").energy(values, slope))) < 1e-28
    assert float(section(order).energy(values, slope)) > 1e-3  # linear strains do


def test_small_exact_strains_are_the_linear_ones():
    """Exact and linear energies differ at third order."""
    values, slope = random_fields(3)
    differences = []
    for size in (1e-3, 5e-4):
        small = [[size * v for v in fields] for fields in (values, slope)]
        exact, linear = (section(3, k).energy(*small) for k in ("exact", "linear"))
        differences.append(abs(float(exact - linear)))
    assert np.log2(differences[0] / differences[1]) == pytest.approx(3.0, abs=0.05)


def test_forces_are_those_of_the_straight_part():
    values, slope = random_fields(1)
    got = section(1).forces(values, slope)
    strains = linear_strains(values, slope, H)
    shell = Homogeneous(H, E, NU, 1.0)
    expected = jax.grad(lambda s: shell(*s))(strains)
    for name, factor in {"e": 1.0, "k": LOCKED["strain"], "psi": 1.0, "dpsi": 1.0}.items():
        wanted = factor * float(getattr(expected, name))
        assert float(getattr(got, name)) == pytest.approx(wanted, rel=1e-12)
    assert float(got.g) == pytest.approx(2.0 * H * float(shell.shear_modulus) * float(strains.g))


# Dissipation over finite elements at eta = .1126 and .2358, A = .5851 and 1, from an independent
# prototype (linear kinematics, end element H/12).
LADDER = {1: (1.11, 1.03, 2.4, 1.21), 2: (1.014, 1.002, 1.58, 1.034), 3: (1.002, 1.0, 1.19, 1.009)}
TRUTH = {
    (0.1126, 0.5851): 0.5869,
    (0.1126, 1.0): 0.8462,
    (0.2358, 0.5851): 0.1089,
    (0.2358, 1.0): 0.4335,
}


def ratios(order):
    base = {"model.section": f"p{order}", "model.kinematics": "linear", "contact.normal": "held"}
    scene = STRIP.replace(base | {"load.entry": "traction"}).on_grid(101, 1 / 12)

    def one(cell):
        to = {"strip.height_ratio": cell[0], "load.amplitude": cell[1]}
        history = jb.solve(scene.replace(to), throw=False)
        by_loop = history.dissipation_loop / history.dissipation
        return history.dissipation_ratio, by_loop, jnp.max(history.status), history.closure

    ratio, by_loop, status, closure = jax.jit(lambda cells: jax.lax.map(one, cells))(
        jnp.array(list(TRUTH))
    )
    assert not np.any(status)
    assert np.max(np.abs(closure)) < 1e-9
    np.testing.assert_allclose(by_loop, 1.0, atol=2e-3)  # F works on the mean displacement
    return np.asarray(ratio) / list(TRUTH.values())


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 3])
def test_the_ladder_climbs_to_elasticity(order):
    np.testing.assert_allclose(ratios(order), LADDER[order], rtol=0.02)
