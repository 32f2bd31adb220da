"""Equilibrium of load steps: reactions, conjugates, controls, supports, curved strips."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import EXACT, HELD, MOVED, STEPPED, STEPS, UNEVEN, two_cycles
from toy import STRIP

import jbeamshell as jb
from jbeamshell import reference
from jbeamshell.load_steps.system import Prescribed, System
from jbeamshell.mechanics import homogeneous
from jbeamshell.mechanics.friction import FrictionLaw

LINEAR = {"model.kinematics": "linear"}
system_of = eqx.filter_jit(System)


# --- the strip alone ------------------------------------------------------------------------------


@eqx.filter_jit
def looked_at(system, q):
    """Energy and positions of a strip at fields q (n, 4)."""
    return system.strain_energy(q), system.sinking(q), system.end_displacement(q), system.gap(q)


def test_collocation_stores_the_energy_of_a_strain_that_varies_along_x():
    """v = X^2 is e = 2 X, with the energy H C11 4 L^3/3 on any mesh."""
    scene = STRIP.replace(LINEAR | {"model.grid": "collocation", "model.nodes": 5})
    system, strip = system_of(scene), scene.strip
    fields = np.zeros((5, 4))
    fields[:, 0] = np.asarray(system.x) ** 2
    c11 = homogeneous.plane_stiffness(strip.plane_modulus, strip.poisson_ratio, strip.plane)[1]
    known = float(strip.half_height * c11 * 4.0 * strip.length**3 / 3.0)
    assert float(looked_at(system, fields)[0]) == pytest.approx(known, rel=1e-12)


def curved(curvature, nodes=41, **values):
    scene = STRIP.replace({"strip.curvature": curvature} | values)
    return system_of(scene.on_grid(nodes, 1.0 / 6.0))


def bottom(system):
    """The bottom face of a strip whose mid-height is an arc, level at X = 0, as (x, y)."""
    alpha, radius = float(system.curvature) * np.asarray(system.x), 1.0 / float(system.curvature)
    outer = radius + float(system.half_height)
    return outer * np.sin(alpha), radius - outer * np.cos(alpha)


def test_turning_a_curved_strip_stores_no_energy_in_the_limit_of_fine_grids():
    strains = []
    for nodes in (41, 81):
        system = curved(0.8, nodes)
        (x, y), (sin, cos) = bottom(system), (np.sin(1.0), np.cos(1.0))
        turned = [x * cos - y * sin - x + 0.3, x * sin + y * cos - y - 0.2, x * 0.0 + 1.0, x * 0.0]
        bent = [x * 0.0, x * 0.0, 0.1 * np.asarray(system.x), x * 0.0]
        energies = [float(looked_at(system, np.stack(q, axis=1))[0]) for q in (turned, bent)]
        strains.append(np.sqrt(energies[0] / energies[1]))
    assert strains[-1] < 4e-2  # .01 on 161 nodes
    assert np.log2(strains[0] / strains[1]) == pytest.approx(2.0, abs=0.1)


def test_the_gap_under_a_curved_strip_is_that_of_its_bottom_face():
    for curvature in (0.8, -0.3):
        system = curved(curvature)
        _, y = bottom(system)
        lift = np.zeros((41, 4))
        lift[:, 1] = 0.1 * np.asarray(system.x)
        np.testing.assert_allclose(looked_at(system, lift)[3], y - y[0] + lift[:, 1], atol=1e-14)


@pytest.mark.parametrize("kinematics", ["exact", "linear"])
def test_a_curvature_that_vanishes_leaves_a_straight_strip(kinematics):
    slight, straight = (curved(c, **{"model.kinematics": kinematics}) for c in (1e-12, 0.0))
    assert straight.curvature is None
    q = 0.1 * np.random.default_rng(3).normal(size=(41, 4))
    for one, other in zip(looked_at(slight, q), looked_at(straight, q), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-11)


# --- balance --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def exact():
    return jb.solve(EXACT, throw=False)


def test_pressure_alone_squeezes_uniformly(exact):
    plane_modulus = exact.scene.strip.plane_modulus
    np.testing.assert_allclose(exact.reaction[0], 10.0, rtol=1e-9)
    np.testing.assert_allclose(exact.psi[0], -10.0 / plane_modulus, rtol=1e-9)
    np.testing.assert_allclose(exact.traction[0], 0.0)
    assert np.max(np.abs(exact.beta[0])) < 1e-15


def test_a_table_may_press_from_above_and_a_gas_from_below():
    history = jb.solve(STEPPED.replace({"contact.bottom_pressure": 3.0}), throw=False)
    np.testing.assert_allclose(history.reaction[0], 7.0, rtol=1e-9)
    np.testing.assert_allclose(history.squeeze_stress[0], -10.0, rtol=1e-9)


def test_tractions_balance_the_end_force_away_from_the_held_end(exact):
    inner = np.asarray(exact.traction)[:, 1:] @ np.asarray(exact.tributary)[1:]
    # What the held node takes is small: the slip front is far from it.
    assert np.max(np.abs(inner - exact.force)) < 0.02 * 0.7855


def test_pull_lowers_the_loaded_end_and_pull_and_push_differ(exact):
    start, turn, _ = exact.cycles[-1]
    assert float(exact.beta[start, -1]) < 0.0 < float(exact.beta[turn, -1])
    assert float(-exact.displacement[turn]) > 1.02 * float(exact.displacement[start])


def test_exact_and_linear_kinematics_agree_at_small_strain(exact):
    linear = float(jb.solve(STEPPED, throw=False).dissipation)
    assert float(exact.dissipation) == pytest.approx(linear, rel=1e-3)
    assert float(exact.dissipation) != linear


def test_end_force_is_conjugate_to_the_mid_height():
    """In a stuck strip the work of F is the energy stored: only with the right conjugate."""
    stuck = {"contact.friction": 1.0, "contact.stick_stiffness": 10.0}
    # The tolerance is a part of mu F_N L.
    history = jb.solve(EXACT.replace(stuck), np.linspace(0.05, 1.0, STEPS), throw=False)
    assert not np.any(history.slipping)
    work = 0.5 * float(history.force[-1] * history.displacement[-1])
    stored = float(history.stored_energy[-1] - history.stored_energy[0])
    assert work == pytest.approx(stored, rel=1e-5)


def test_reactions_carry_a_pressure_with_steps_at_every_load():
    history = jb.solve(STEPPED.replace({"contact.pressure": UNEVEN}), throw=False)
    carried = np.asarray(history.reaction) @ np.asarray(history.tributary)
    x, p = np.transpose(UNEVEN)
    np.testing.assert_allclose(carried, np.trapezoid(p, x), rtol=1e-7)


# --- frozen lift ----------------------------------------------------------------------------------


def off_the_closed_form(nodes):
    """Largest error of the rotation of a stuck strip of {v, beta}, over the largest rotation."""
    stuck = {"contact.friction": 1e3, "contact.stick_stiffness": 1e6, "model.nodes": nodes}
    history = jb.solve(HELD.replace(stuck), np.linspace(0.05, 1.0, STEPS), throw=False)
    strip = history.scene.strip
    exact = reference.stuck_rotation(
        history.x,
        1.0,
        strip.length,
        strip.half_height,
        strip.plane_modulus,
        strip.shear_modulus,
        homogeneous.shear_coefficient(strip.poisson_ratio),
    )
    return float(np.max(np.abs(history.beta[-1] - exact)) / np.max(np.abs(exact)))


def test_stuck_strip_rotates_as_the_closed_form():
    """{v, beta}, small strain: beta decays from the loaded end."""
    assert off_the_closed_form(41) < 0.016  # of second order: .001 on 161 nodes


@pytest.mark.slow
def test_the_rotation_of_a_stuck_strip_is_of_second_order():
    errors = [off_the_closed_form(nodes) for nodes in (81, 161)]
    assert errors[-1] < 1e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.3)


def test_frozen_lift_reports_tension():
    thick = {"strip.height_ratio": 0.4, "contact.friction": 0.5, "load.amplitude": 6.0}
    history = jb.solve(HELD.replace(thick), throw=False)
    assert float(history.reaction_min) < -10.0  # as much as presses
    assert any("in the corner" in doubt for doubt in history.doubts)


@pytest.mark.slow
def test_frozen_lift_drifts_with_the_end_element():
    thick = {"load.amplitude": 0.3247, "load.steps_per_half_cycle": 20}
    runs = [jb.solve(HELD.replace(thick | {"model.nodes": n}), throw=False) for n in (81, 161)]
    reactions = [float(run.reaction_min) for run in runs]
    assert reactions[1] < reactions[0] < 0.0
    assert abs(float(runs[1].dissipation / runs[0].dissipation) - 1.0) > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("section", ["shell", "squeeze"])
def test_unilateral_lift_cures_the_tension_at_the_loaded_end(section):
    """Finite elements stay in contact; a shell whose lift is frozen pulls, more on finer grids."""
    ratios = []
    for nodes in (81, 161, 321):  # end elements of about H/8, H/16 and H/32
        scene = STRIP.replace(
            LINEAR
            | {
                "model.section": section,
                "model.nodes": nodes,
                "load.amplitude": 0.3247,
                "load.cycles": 1,
                "load.steps_per_half_cycle": 20,
            }
        )
        history = jb.solve(scene)
        ratios.append(float(history.dissipation_ratio))
        assert float(history.reaction_min) > -1e-6
        assert float(jnp.min(history.w)) > -1e-15
        assert float(jnp.max(jnp.abs(history.w * history.reaction))) < 1e-10
    assert ratios[2] == pytest.approx(ratios[1], rel=0.005)
    assert ratios[1] == pytest.approx(ratios[0], rel=0.015)


# --- controls and supports ------------------------------------------------------------------------


def test_displacement_control_finds_the_force_of_force_control():
    by_force = jb.solve(STEPPED, two_cycles(0.7855), throw=False)
    by_displacement = jb.solve(MOVED, by_force.displacement[1:], throw=False)
    np.testing.assert_allclose(by_displacement.force, by_force.force, atol=1e-7)
    np.testing.assert_allclose(by_displacement.slip, by_force.slip, atol=1e-12)


@pytest.mark.slow
def test_free_strip_slides_at_the_gross_slip_force():
    free = {"strip.far_end": "free", "load.amplitude": 5e-4, "load.steps_per_half_cycle": 40}
    history = jb.solve(MOVED.replace(free))
    assert float(jnp.max(history.force)) == pytest.approx(2.0, rel=2e-3)
    assert float(jnp.min(history.force)) == pytest.approx(-2.0, rel=2e-3)
    assert float(history.slip_length) == pytest.approx(2.0)


@pytest.mark.slow
def test_strip_held_at_the_contact_point_only_turns_there():
    held, pinned = (
        jb.solve(STEPPED.replace({"strip.far_end": end, "load.amplitude": 1.9}))
        for end in ("guided", "pinned")
    )
    assert float(jnp.max(jnp.abs(held.beta[:, 0]))) < 1e-18
    assert float(jnp.max(jnp.abs(pinned.beta[:, 0]))) > 1e-9
    assert float(jnp.max(jnp.abs(pinned.slip[:, 0]))) < 1e-18


def test_residual_couples_neighbours_only():
    """Blocks couple to their neighbours only, for friction, contact and a displaced end."""

    @jax.jit
    def dense(scene, start):
        system = System(scene)
        prescribed = Prescribed(*map(jnp.asarray, (1e-6, 1.0, 0.0, 1.0)))
        return jax.jacfwd(lambda u: system.advance(u, system.unloaded(), prescribed)[1])(start)

    scene = MOVED.replace({"model.nodes": 9})
    found = np.asarray(dense(scene, 1e-7 * np.random.default_rng(0).normal(size=(9, 4))))
    rows, columns = np.nonzero(np.any(found != 0.0, axis=(1, 3)))
    assert np.max(np.abs(rows - columns)) == 1


def test_a_law_of_your_own_slides_in():
    class Viscous(FrictionLaw):
        coefficient: float = 1e5

        def traction(self, dv, t_n, cap, k_t):
            return self.coefficient * dv

    scene = jb.Scene(contact=jb.Contact(law=Viscous()), model=jb.Model(nodes=9, section="bar"))
    history = jb.solve(scene, np.array([0.2, 0.4]), throw=False)
    np.testing.assert_allclose(history.traction[1:], 1e5 * np.diff(history.v, axis=0))
