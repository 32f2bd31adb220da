"""Inertia and natural vibrations, against closed forms."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from toy import STRIP

import jbeamshell as jb
from jbeamshell import dynamics
from jbeamshell.dynamics.strip.equations import Equations
from jbeamshell.mechanics.homogeneous import shear_coefficient

build = eqx.filter_jit(Equations)  # one program instead of hundreds
jitted = eqx.filter_jit(lambda method, *arguments: method(*arguments))
LINEAR = {"model.kinematics": "linear", "model.nodes": 21, "contact.normal": "held"}
RHO = 2.5


def scene(**values):
    return STRIP.replace(LINEAR | {k.replace("__", "."): v for k, v in values.items()})


def stuck(scene, shear=True):
    """Lowest frequencies of a stuck strip, where v and beta are sin(pi X/2L) on springs k_t."""
    strip = scene.strip
    height, modulus = float(strip.half_height), float(strip.plane_modulus)
    rubs = float(scene.contact.stick_stiffness * strip.shear_modulus / strip.half_height)
    wave = 0.5 * np.pi / float(strip.length)
    kappa = float(shear_coefficient(strip.poisson_ratio) * strip.shear_modulus)
    turning = 8.0 / 3.0 * modulus * height**3 * wave**2 + 2.0 * kappa * height
    coupling = -2.0 * modulus * height**2 * wave**2
    stiffness = [[2.0 * height * modulus * wave**2 + rubs, coupling], [coupling, turning]]
    mass = np.array([[2.0 * height, -2.0 * height**2], [-2.0 * height**2, 8.0 / 3.0 * height**3]])
    return np.sqrt(scipy.linalg.eigh(stiffness, RHO * mass)[0])


def test_a_stuck_strip_vibrates_as_in_closed_form():
    errors = []
    for nodes in (11, 21):
        elastic = {"contact__stick_stiffness": 100.0, "model__nodes": nodes}
        strip = scene(model__section="shell", **elastic)
        found = dynamics.modes(strip, dynamics.Inertia(RHO)).frequency[0]
        errors.append(abs(found / (stuck(strip)[0] / (2.0 * np.pi)) - 1.0))
    assert errors[-1] < 5e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def cantilever(strip):
    """Lowest frequency of Timoshenko's cantilever (Huang 1961), from its determinant."""
    height, modulus, length = (float(a) for a in (strip.half_height, strip.plane_modulus, 2.0))
    kappa = float(shear_coefficient(strip.poisson_ratio) * strip.shear_modulus)
    area, inertia = 2.0 * height, 2.0 / 3.0 * height**3

    def determinant(omega):
        # Amplitudes (w, beta) e^(r X): kappa A (r^2 w - r beta) = -rho A omega^2 w, and so on.
        mass, turning = RHO * area * omega**2, RHO * inertia * omega**2
        stiff, bend = kappa * area, modulus * inertia
        square = np.roots(
            [bend * stiff, bend * mass + stiff * turning, mass * turning - mass * stiff]
        ).astype(complex)
        roots = np.concatenate([np.sqrt(square), -np.sqrt(square)])
        tilt = (stiff * roots**2 + mass) / (stiff * roots)
        grown = np.exp(roots * length)
        rows = [np.ones(4), tilt, roots * tilt * grown, (roots - tilt) * grown]
        return np.linalg.det(np.array(rows))

    guesses = np.linspace(5.0, 30.0, 101)
    values = np.array([determinant(g) for g in guesses])
    values = (values / values[0]).real
    first = np.flatnonzero(values[:-1] * values[1:] < 0.0)[0]
    scale = determinant(guesses[0])
    return scipy.optimize.brentq(
        lambda g: (determinant(g) / scale).real, guesses[first], guesses[first + 1]
    )


def test_a_cantilever_vibrates_as_timoshenkos():
    errors = []
    for nodes in (11, 21):
        strip = scene(
            model__section="shell",
            model__nodes=nodes,
            contact__normal="none",
            contact__friction=0.0,
        )
        found = dynamics.modes(strip, dynamics.Inertia(RHO)).frequency[0]
        errors.append(abs(found / (cantilever(strip.strip) / (2.0 * np.pi)) - 1.0))
    assert errors[-1] < 5e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.3)


def test_a_strip_on_a_rigid_base_is_held_down_in_motion():
    held, rigid, soft = (
        dynamics.modes(
            scene(model__nodes=11, contact__normal=base, contact__normal_stiffness=0.1)
        ).frequency[0]
        for base in ("held", "rigid", "compliant")
    )
    assert held == rigid
    assert soft < 0.99 * held


def test_the_first_thickness_stretch_is_ten_per_cent_off():
    """A straight line over the height, beside the exact sine."""
    strip = scene()
    half, modulus = strip.strip.half_height, strip.strip.plane_modulus
    c11 = modulus / (1.0 - (0.3 / 0.7) ** 2)
    exact = 0.5 * np.pi * jnp.sqrt(c11 / RHO) / half
    mass = build(strip, dynamics.Inertia(RHO), 0.0, dynamics.Excitation()).mass
    rates = jnp.array([0.0, -half, 0.0, 1.0])  # about mid-height
    found = jnp.sqrt(half * c11 / mass.section_energy(jnp.zeros(4), rates))
    assert found / exact == pytest.approx(np.sqrt(12.0) / np.pi, rel=1e-12)


def test_the_mass_of_layers_adds_up():
    half = 0.5 * 0.1126 * 2.0
    layers = [[0.5 * half, 1e5, 0.3], [1.5 * half, 2e5, 0.3]]
    strip = scene(strip__layers=layers)
    inertia = dynamics.Inertia([8.0, 2.0])
    mass = build(strip, inertia, 0.0, dynamics.Excitation()).mass
    along = mass.section_energy(jnp.zeros(4), jnp.array([1.0, 0.0, 0.0, 0.0]))
    turned = mass.section_energy(jnp.zeros(4), jnp.array([0.0, 0.0, 1.0, 0.0]))
    assert along == pytest.approx(0.5 * (8.0 * 0.5 + 2.0 * 1.5) * half, rel=1e-12)
    cube = (8.0 * 0.5**3 + 2.0 * (2.0**3 - 0.5**3)) * half**3 / 3.0
    assert turned == pytest.approx(0.5 * cube, rel=1e-12)


def test_exact_kinematics_keep_energy_and_momentum_of_a_turning_section():
    strip = STRIP.replace({"model.nodes": 11})
    mass = build(strip, dynamics.Inertia(RHO), 3.0, dynamics.Excitation()).mass
    rng = np.random.default_rng(1)
    q, p = 0.3 * rng.standard_normal((2, 11, 4))
    blocks = jitted(mass.blocks, jnp.asarray(q))
    energy = 0.5 * np.einsum("ni,nij,nj", p, blocks, p)
    assert jitted(mass.energy, jnp.asarray(q), jnp.asarray(p)) == pytest.approx(energy, rel=1e-12)
    # In free motion the inertia forces balance, so the kinetic energy does not change.
    force = -jitted(mass.velocity_forces, jnp.asarray(q), jnp.asarray(p))
    speed = np.linalg.solve(blocks, np.asarray(force)[..., None])[..., 0]
    step = 1e-5
    ahead, behind = (
        jitted(mass.energy, jnp.asarray(q + s * step * p), jnp.asarray(p + s * step * speed))
        for s in (1.0, -1.0)
    )
    assert abs(ahead - behind) / (2.0 * step) < 1e-6 * energy


@pytest.mark.slow
def test_reaction_has_elasticity_and_inertia():
    strip = scene(model__nodes=11)
    shaker = dynamics.Shaker(3.0, 0.25, direction="across")
    equations = build(strip, dynamics.Inertia(RHO), 0.0, shaker)
    history = jb.solve(strip, np.zeros(1))
    state = jitted(equations.initial_state, history.fields[-1], history.traction[-1])
    still, shaken = (jitted(equations.response, jnp.asarray(t), state)[1] for t in (0.0, 1.0))
    assert np.allclose(still, 10.0, rtol=1e-9)
    # The strip weighs more on a foundation that accelerates upwards; its squeeze reduces this.
    weight = 2.0 * float(strip.strip.half_height) * RHO * 3.0
    assert np.all(shaken > still)
    assert np.allclose((shaken - still) / weight, 0.25, atol=0.02)
