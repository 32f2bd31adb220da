import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from jbeamshell import reference
from jbeamshell.load_steps.system import Prescribed, System
from jbeamshell.mechanics import homogeneous
from jbeamshell.mechanics.friction import FrictionLaw

SMALL = {
    "model.nodes": 41,
    "model.kinematics": "linear",  # compiles in half the time
    "load.steps_per_half_cycle": 20,
    "load.cycles": 1,
}
EXACT = SMALL | {"model.kinematics": "exact"}  # by Newton's method, where the system is the subject


def test_collocation_stores_the_energy_of_a_strain_that_varies_along_x():
    """v = X^2 is e = 2 X, with the energy H C11 4 L^3/3 on any mesh."""
    linear = {"model.kinematics": "linear", "model.grid": "collocation", "model.nodes": 5}
    scene = STRIP.replace(linear)
    system, strip = System(scene), scene.strip
    fields = jnp.zeros((system.x.size, 4)).at[:, 0].set(system.x**2)
    c11 = homogeneous.plane_stiffness(strip.plane_modulus, strip.poisson_ratio, strip.plane)[1]
    known = float(strip.half_height * c11 * 4.0 * strip.length**3 / 3.0)
    assert float(system.strain_energy(fields)) == pytest.approx(known, rel=1e-12)


def curved(curvature, nodes=41, **values):
    scene = STRIP.replace({"strip.curvature": curvature} | values)
    return System(scene.on_grid(nodes, 1.0 / 6.0))


def bottom(system):
    """The bottom face of a strip whose mid-height is an arc, level at X = 0, as (x, y)."""
    alpha, radius = system.curvature * system.x, 1.0 / system.curvature
    outer = radius + system.half_height
    return outer * jnp.sin(alpha), radius - outer * jnp.cos(alpha)


def test_turning_a_curved_strip_stores_no_energy_in_the_limit_of_fine_grids():
    strains = []
    for nodes in (81, 161):
        system = curved(0.8, nodes)
        x, y = bottom(system)
        sin, cos = jnp.sin(1.0), jnp.cos(1.0)
        turned = [
            x * cos - y * sin - x + 0.3,
            x * sin + y * cos - y - 0.2,
            jnp.ones_like(x),
            jnp.zeros_like(x),
        ]
        bent = jnp.zeros((nodes, 4)).at[:, 2].set(0.1 * system.x)
        energy = eqx.filter_jit(system.strain_energy)
        ratio = energy(jnp.stack(turned, axis=1)) / energy(bent)
        strains.append(float(jnp.sqrt(ratio)))
    assert strains[-1] < 1e-2
    assert np.log2(strains[0] / strains[1]) == pytest.approx(2.0, abs=0.1)


def test_the_gap_under_a_curved_strip_is_that_of_its_bottom_face():
    for curvature in (0.8, -0.3):
        system = curved(curvature)
        _, y = bottom(system)
        lift = jnp.zeros((41, 4)).at[:, 1].set(0.1 * system.x)
        np.testing.assert_allclose(system.gap(lift), y - y[0] + 0.1 * system.x, atol=1e-14)


@pytest.mark.parametrize("kinematics", ["exact", "linear"])
def test_a_curvature_that_vanishes_leaves_a_straight_strip(kinematics):
    same = {"model.kinematics": kinematics}
    slight, straight = (curved(c, **same) for c in (1e-12, 0.0))
    assert straight.curvature is None
    q = 0.1 * jax.random.normal(jax.random.key(3), (41, 4))
    for name in ("strain_energy", "sinking", "end_displacement", "gap"):
        one, other = (eqx.filter_jit(getattr(system, name))(q) for system in (slight, straight))
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-11)


@pytest.mark.doubtful("few nodes")
def test_pressure_alone_squeezes_uniformly():
    history = jb.solve(STRIP.replace(EXACT))
    plane_modulus = history.scene.strip.plane_modulus
    np.testing.assert_allclose(history.reaction[0], 10.0, rtol=1e-9)
    np.testing.assert_allclose(history.psi[0], -10.0 / plane_modulus, rtol=1e-9)
    np.testing.assert_allclose(history.traction[0], 0.0)
    assert float(jnp.max(jnp.abs(history.beta[0]))) < 1e-15


@pytest.mark.parametrize(
    "pressure",
    [pytest.param(10.0, marks=pytest.mark.slow), [[0.0, 4.0], [1.0, 12.0], [2.0, 9.0]]],
)
@pytest.mark.doubtful("few nodes")
def test_reactions_carry_the_pressure_at_every_load(pressure):
    history = jb.solve(STRIP.replace(SMALL | {"contact.pressure": pressure}))
    system = System(history.scene)
    carried = history.reaction @ history.tributary
    applied = jnp.sum(system.load)
    np.testing.assert_allclose(carried, applied, rtol=1e-7)


@pytest.mark.doubtful("few nodes")
def test_tractions_balance_the_end_force_away_from_the_held_end():
    history = jb.solve(STRIP.replace(EXACT))
    inner = history.traction[:, 1:] @ history.tributary[1:]
    # What the held node takes is small: the slip front is far from it.
    assert float(jnp.max(jnp.abs(inner - history.force))) < 0.02 * 0.7855


@pytest.mark.doubtful("few nodes")
def test_pull_lowers_the_loaded_end_and_pull_and_push_differ():
    history = jb.solve(STRIP.replace(EXACT))
    start, turn, _ = history.cycles[-1]
    assert float(history.beta[start, -1]) < 0.0 < float(history.beta[turn, -1])
    assert float(-history.displacement[turn]) > 1.02 * float(history.displacement[start])


def test_end_force_is_conjugate_to_the_mid_height():
    """In a stuck strip the work of F is the energy stored: only with the right conjugate."""
    stuck = EXACT | {"contact.friction": 100.0, "contact.stick_stiffness": 10.0}
    # The tolerance is a part of mu F_N L, which is huge here.
    history = jb.solve(STRIP.replace(stuck), [0.5, 1.0], solver=jb.Newton(tolerance=1e-14))
    work = 0.5 * float(history.force[-1] * history.displacement[-1])
    stored = float(history.stored_energy[-1] - history.stored_energy[0])
    assert work == pytest.approx(stored, rel=1e-5)


def frozen(nodes):
    """A strip of {v, beta}, small strain; one program for each number of nodes."""
    return STRIP.replace(
        {
            "model.section": "shell",
            "contact.normal": "held",
            "model.nodes": nodes,
            "load.amplitude": 0.3247,
            "load.cycles": 1,
            "load.steps_per_half_cycle": 20,
            "model.kinematics": "linear",
        }
    )


def test_stuck_strip_rotates_as_the_closed_form():
    """{v, beta}, small strain: beta decays from the loaded end; second order in the grid."""
    errors = []
    for nodes in (81, 161):
        stuck = {"contact.friction": 1e3, "contact.stick_stiffness": 1e6}
        history = jb.solve(frozen(nodes).replace(stuck), np.ones(50))
        scene = history.scene
        strip = scene.strip
        exact = reference.stuck_rotation(
            history.x,
            1.0,
            strip.length,
            strip.half_height,
            strip.plane_modulus,
            strip.shear_modulus,
            homogeneous.shear_coefficient(strip.poisson_ratio),
        )
        errors.append(float(jnp.max(jnp.abs(history.beta[1] - exact)) / jnp.max(jnp.abs(exact))))
    assert errors[-1] < 1e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("section", ["shell", "squeeze"])
def test_unilateral_lift_cures_the_tension_at_the_loaded_end(section):
    """Finite elements stay in contact; a shell whose lift is frozen pulls, more on finer grids."""
    ratios = []
    for nodes in (81, 161, 321):  # end elements of about H/8, H/16 and H/32
        scene = STRIP.replace(
            {
                "model.section": section,
                "model.nodes": nodes,
                "load.amplitude": 0.3247,
                "load.cycles": 1,
                "load.steps_per_half_cycle": 20,
                "model.kinematics": "linear",
            }
        )
        history = jb.solve(scene)
        ratios.append(float(history.dissipation_ratio))
        assert float(history.reaction_min) > -1e-6
        assert float(jnp.min(history.w)) > -1e-15
        assert float(jnp.max(jnp.abs(history.w * history.reaction))) < 1e-10
    assert ratios[2] == pytest.approx(ratios[1], rel=0.005)
    assert ratios[1] == pytest.approx(ratios[0], rel=0.015)


@pytest.mark.doubtful("in the corner", "few nodes", "the section shell")
def test_frozen_lift_reports_tension_and_drifts_with_the_end_element():
    ratios, reactions = [], []
    for nodes in (81, 161):
        history = jb.solve(frozen(nodes))
        ratios.append(float(history.dissipation_ratio))
        reactions.append(float(history.reaction_min))
    assert reactions[1] < reactions[0] < 0.0
    assert abs(ratios[1] / ratios[0] - 1.0) > 0.01


@pytest.mark.doubtful("few nodes")
def test_displacement_control_finds_the_force_of_force_control():
    by_force = jb.solve(STRIP.replace(SMALL))
    scene = by_force.scene.replace({"load.control": "displacement", "load.amplitude": 1.0})
    by_displacement = jb.solve(scene, by_force.displacement[1:])
    np.testing.assert_allclose(by_displacement.force, by_force.force, atol=1e-7)
    np.testing.assert_allclose(by_displacement.slip, by_force.slip, atol=1e-12)


def test_free_strip_slides_at_the_gross_slip_force():
    scene = STRIP.replace(
        SMALL
        | {
            "strip.far_end": "free",
            "load.control": "displacement",
            "load.amplitude": 5e-4,
            "load.steps_per_half_cycle": 40,
        }
    )
    history = jb.solve(scene)
    assert float(jnp.max(history.force)) == pytest.approx(2.0, rel=2e-3)
    assert float(jnp.min(history.force)) == pytest.approx(-2.0, rel=2e-3)
    assert float(history.slip_length) == pytest.approx(2.0)


def test_strip_held_at_the_contact_point_only_turns_there():
    held, pinned = (
        jb.solve(STRIP.replace(SMALL | {"strip.far_end": end, "load.amplitude": 1.9}))
        for end in ("guided", "pinned")
    )
    assert float(jnp.max(jnp.abs(held.beta[:, 0]))) < 1e-18
    assert float(jnp.max(jnp.abs(pinned.beta[:, 0]))) > 1e-9
    assert float(jnp.max(jnp.abs(pinned.slip[:, 0]))) < 1e-18


@pytest.mark.doubtful("few nodes")
def test_exact_and_linear_kinematics_agree_at_small_strain():
    exact, linear = (
        jb.solve(STRIP.replace(SMALL | {"model.kinematics": name})).dissipation
        for name in ("exact", "linear")
    )
    assert float(exact) == pytest.approx(float(linear), rel=1e-3)
    assert float(exact) != float(linear)


def test_residual_couples_neighbours_only():
    """Blocks couple to their neighbours only, for friction, contact and both controls."""
    scene = STRIP.replace({"model.nodes": 9, "model.section": "squeeze"})
    for control in ("force", "displacement"):
        system = System(scene.replace({"load.control": control, "load.amplitude": 1e-6}))
        prescribed = Prescribed(*map(jnp.asarray, (1e-6, 1.0, 0.0, 1.0)))
        start = 1e-7 * jax.random.normal(jax.random.key(0), (9, 4))
        before = system.unloaded()
        residual = jax.jacfwd(lambda u: system.advance(u, before, prescribed)[1])  # noqa: B023
        dense = jax.jit(residual)(start)
        rows, columns = np.nonzero(np.any(np.asarray(dense) != 0.0, axis=(1, 3)))
        assert np.max(np.abs(rows - columns)) == 1


def test_a_law_of_your_own_slides_in():
    class Viscous(FrictionLaw):
        coefficient: float = 1e5

        def traction(self, dv, t_n, cap, k_t):
            return self.coefficient * dv

    scene = jb.Scene(contact=jb.Contact(law=Viscous()), model=jb.Model(nodes=9))
    history = jb.solve(scene, np.array([0.2, 0.4]))
    np.testing.assert_allclose(history.traction[1:], 1e5 * jnp.diff(history.v, axis=0))
