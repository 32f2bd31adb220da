"""Harmonic balance: closed forms, energy, motions in time, derivatives, bad input."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import dynamics
from jbeamshell.dynamics import Attachment, Joint, Structure

U = np.geomspace(0.05, 4.0, 8)
SLIDERS = (U, np.tanh(U))
FORCE = [0.0, 0.3]
SETTING = {"harmonics": 7, "samples": 256}
TURN = 2.0 * np.pi
SPRING = np.array([[3.0, -3.0], [-3.0, 3.0]])


def two_masses(joint, damping=0.02):
    return Structure(np.eye(2), SPRING, [Attachment(joint, 0)], damping=damping * np.eye(2))


JOINT = Joint(*SLIDERS)
HELD = two_masses(JOINT)


@pytest.fixture(scope="module")
def response():
    return dynamics.forced_response(HELD, FORCE, (0.3 / TURN, 1.2 / TURN), **SETTING)


@pytest.fixture(scope="module")
def mode():
    return dynamics.nonlinear_mode(two_masses(JOINT, 0.0), np.geomspace(0.2, 2.0, 5), **SETTING)


class TestForcedResponse:
    @pytest.mark.slow
    def test_one_harmonic_of_one_mass_is_the_describing_function(self):
        structure = Structure([[1.0]], [[0.3]], [Attachment(JOINT, 0)], damping=[[0.05]])
        with pytest.warns(jb.DoubtfulWarning, match=r"harmonic 3.*more harmonics"):
            found = dynamics.forced_response(
                structure, [0.4], (0.06, 0.32), harmonics=1, samples=256
            )
        a, omega = found.amplitude, 2.0 * np.pi * found.frequency
        stiffness = np.asarray(JOINT.first_harmonic(jnp.asarray(a))) + 0.3
        force = a * np.abs(stiffness - omega**2 + 0.05j * omega)
        np.testing.assert_allclose(force, 0.4, rtol=2e-6)
        np.testing.assert_allclose(found.frequency[[0, -1]], [0.06, 0.32], rtol=1e-12)

    def test_it_passes_its_peak_in_small_steps(self, response):
        assert np.all(np.diff(response.frequency) > 0.0)
        assert np.all(np.abs(np.diff(np.log(response.amplitude))) < 0.2)
        assert response.phase[0] > -0.3
        assert response.phase[-1] < -2.8
        assert np.all(response.truncation < 1e-3)
        assert response.doubts == ()
        (doubt,) = response.but(truncation=np.array([2e-3])).doubts
        assert doubt.startswith("harmonic 9, which is left out, moves the joints by 0.002")
        part = response.harmonic_amplitudes[:, 1] / response.amplitude
        assert 1e-3 < np.max(part) < 0.2
        second = response.frequency[np.argmax(part)] * 3.0  # its superharmonic is largest there
        assert second == pytest.approx(HELD.modes().frequency[1], rel=0.1)

    def test_harmonics_left_out_are_told_by_what_they_change_at_a_resonance(self):
        """A small part of the motion, which a resonance turns into .4 % of its amplitude."""
        stiffness = [[0.3 + 21.6, -21.6], [-21.6, 21.6]]
        slider = Attachment(jb.laws.Jenkins(1.0, 5.2), 1)
        structure = Structure(np.diag([1.0, 0.006]), stiffness, [slider], damping_ratio=0.017)
        top = float(structure.modes(1).frequency[0])
        frequencies = top * np.linspace(0.8, 1.0, 9)
        with pytest.warns(jb.DoubtfulWarning, match=r"may change the amplitude by 0\.\d %"):
            nine = dynamics.steady_response(structure, [0.217, 0.0], frequencies)
        assert np.max(nine.truncation) < 1e-3
        more = dynamics.steady_response(structure, [0.217, 0.0], frequencies, harmonics=41)
        assert more.doubts == ()
        at = int(np.argmax(more.amplitude))
        off = abs(nine.amplitude[at] / more.amplitude[at] - 1.0)
        assert off > 2e-3
        assert off == pytest.approx(nine.truncation_error[at], rel=0.7)

    def test_the_force_supplies_what_joints_and_dampers_lose(self, response):
        harmonic, omega = response.harmonics, 2.0 * np.pi * response.frequency
        x = np.stack([response.at(0), response.at(1)])
        supplied = -np.pi * FORCE[1] * x[1, :, 0].imag
        lost = np.pi * 0.02 * omega * np.sum(harmonic**2 * np.abs(x) ** 2, axis=(0, 2))
        np.testing.assert_allclose(supplied, lost + response.dissipation, rtol=1e-9)

    def test_a_growing_force_ends_on_the_curve(self, response):
        pick = [0, 20, -1]
        amplitudes = [
            dynamics.steady_response(
                HELD, np.multiply(level, FORCE), response.frequency[pick], **SETTING
            ).amplitude
            for level in (0.1, 1.0)
        ]
        np.testing.assert_allclose(amplitudes[1], response.amplitude[pick], rtol=1e-9)
        assert np.all(amplitudes[0] < amplitudes[1])

    def test_it_is_drawn(self, response):
        left, right = response.plot()
        assert left.get_xlabel().startswith("frequency")
        assert len(right.get_lines()) == 4


class TestNonlinearMode:
    def test_its_damping_is_the_energy_that_the_joint_loses(self, mode):
        np.testing.assert_allclose(
            mode.dissipation, JOINT.dissipation(mode.joints[:, 0]), rtol=3e-5
        )
        speed = sum(mode.harmonics**2 * np.abs(mode.at(place)) ** 2 for place in (0, 1))
        sustained = (
            2.0 * mode.damping * (2.0 * np.pi * mode.frequency) ** 2 * np.pi * np.sum(speed, axis=1)
        )
        np.testing.assert_allclose(sustained, mode.dissipation, rtol=1e-9)

    def test_statics_agree_at_small_amplitudes(self, mode):
        static = dynamics.modal_curve(two_masses(JOINT, 0.0), mode.amplitude)
        np.testing.assert_allclose(mode.frequency[:3], static.frequency[:3], rtol=5e-3)
        np.testing.assert_allclose(mode.damping[:3], static.damping[:3], rtol=0.02)

    def test_statics_doubt_themselves_where_they_are_off(self):
        """The second mode has nearly three times the frequency of the first."""
        structure = Structure(np.eye(2), 1.4 / 3.0 * SPRING, [Attachment(JOINT, 0)])
        mode = dynamics.nonlinear_mode(structure, np.geomspace(0.2, 2.0, 5), **SETTING)
        with pytest.warns(jb.DoubtfulWarning, match="damping may be off by.*take nonlinear_mode"):
            static = dynamics.modal_curve(structure, mode.amplitude)
        off = np.abs(static.damping / mode.damping - 1.0)
        assert np.max(off) > 0.2
        assert np.all(off < np.abs(static.damping_error))

    def test_small_motion_is_linear_and_has_the_dampers(self):
        found = dynamics.nonlinear_mode(HELD, np.geomspace(1e-4, 1e-3, 5), **SETTING)
        k = float(JOINT.stiffness)  # of the joint that holds the first of two masses on a spring
        omega = np.sqrt(0.5 * (k + 6.0 - np.sqrt(k**2 + 36.0)))
        assert found.frequency[0] == pytest.approx(omega / (2.0 * np.pi), rel=1e-9)
        assert HELD.modes().frequency[0] == pytest.approx(omega / (2.0 * np.pi), rel=1e-9)
        assert found.damping[0] == pytest.approx(0.01 / omega, rel=1e-9)


@pytest.mark.slow
def test_a_mode_does_not_jump_to_another():
    """Three masses whose second mode has nearly three times the frequency of the first."""
    joint = Joint.of(jb.Scene().replace({"model.section": "plane"}), 1.99)
    stiff = float(joint.stiffness)
    spring = 0.5 * stiff * np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    structure = Structure(20.0 * np.eye(3), spring, [Attachment(joint, 0)])
    try:
        found = dynamics.nonlinear_mode(structure, np.geomspace(4.73e-5, 4.26e-4, 8)).frequency
    except jb.UnconvergedError:
        return
    assert np.all(np.abs(np.diff(np.log(found))) < 0.3)


def varied(values):
    """Structure whose joint, mass and damping are varied."""
    stretch, mass, damping = values
    joint = Joint(SLIDERS[0] * stretch, jnp.asarray(SLIDERS[1]))
    masses = jnp.diag(jnp.stack([1.0 + 0.0 * mass, mass]))
    return Structure(masses, SPRING, [Attachment(joint, 0)], damping=damping * jnp.eye(2))


def assert_slope_two(figures):
    """Assert that what a derivative leaves falls with the square of the step."""
    at, way = jnp.array([1.0, 1.0, 0.02]), jnp.array([0.05, 0.01, 0.002])
    value, slope = jax.jvp(figures, (at,), (way,))
    steps = 0.1 * 0.5 ** np.arange(3)
    left = [np.abs(figures(at + h * way) - value - h * slope) for h in steps]
    np.testing.assert_allclose(np.diff(np.log2(left), axis=0), -2.0, atol=0.15)


@pytest.mark.slow
def test_frequency_and_damping_at_an_amplitude_have_derivatives():
    @jax.jit
    def figures(values):
        found = dynamics.nonlinear_mode(varied(values), [1.0], **SETTING)
        return jnp.concatenate([found.frequency, found.damping])

    assert_slope_two(figures)


@pytest.mark.slow
def test_forced_amplitudes_have_derivatives():
    @jax.jit
    def figures(values):
        omegas = jnp.array([0.45, 0.5, 0.6])
        return dynamics.steady_response(
            varied(values), FORCE, omegas / TURN, place=1, **SETTING
        ).amplitude

    assert_slope_two(figures)


@pytest.mark.slow
@pytest.mark.parametrize("omega", [0.35, 0.532, 0.8])
def test_a_transient_ends_on_the_balance(omega):
    """Below, at and above the resonance of two masses with a joint."""
    found = dynamics.steady_response(HELD, FORCE, [omega / TURN], harmonics=15)
    rate = 1j * np.arange(1, 16, 2)[:, None] * omega
    start = {
        "displacement": found.coefficients[0].real.sum(axis=0),
        "velocity": (rate * found.coefficients[0]).real.sum(axis=0),
    }
    motion = dynamics.shake(
        HELD,
        60.0 * TURN / omega,
        force=lambda time: jnp.asarray(FORCE) * jnp.cos(omega * time),
        **start,
        samples=60 * 128 + 1,
        tolerance=1e-5,
    )
    last = slice(-128, None)
    turned = np.exp(-1j * omega * np.asarray(motion.time)[last])
    amplitude = abs(np.mean(np.asarray(motion.displacement)[last, 1] * turned)) * 2.0
    assert amplitude == pytest.approx(found.amplitude[0], rel=1e-4)


@pytest.mark.slow
def test_a_load_has_one_steady_motion():
    """Up or down in frequency or from a small force, two motions under one load approach."""
    for seed in range(8):
        draw = np.random.default_rng(seed)
        joint = Joint(U, draw.uniform(0.5, 3.0) * np.tanh(U))
        mass = np.diag(draw.uniform(0.5, 2.0, 2))
        stiffness = draw.uniform(0.5, 2.0) * SPRING
        structure = Structure(mass, stiffness, [Attachment(joint, 0)], damping=0.01 * mass)
        ends = np.array([0.4, 1.6]) * structure.modes(1).frequency[0]
        force = [0.0, draw.uniform(0.1, 0.6)]
        up, down = (dynamics.forced_response(structure, force, e) for e in (ends, ends[::-1]))
        for found in (up, down):
            pick = np.linspace(0, found.frequency.size - 1, 7).astype(int)
            grown = dynamics.steady_response(structure, force, found.frequency[pick])
            np.testing.assert_allclose(found.amplitude[pick], grown.amplitude, rtol=1e-6)


CAPPED = two_masses(Joint(*SLIDERS, capacity=1.2))
REFUSED = {
    "force": (lambda: dynamics.forced_response(HELD, [1.0], (0.3, 1.0)), "force.*2 numbers"),
    "no force": (lambda: dynamics.forced_response(HELD, [0.0, 0.0], (0.3, 1.0)), "force.*zero"),
    "range": (lambda: dynamics.forced_response(HELD, FORCE, (0.3, -1.0)), "frequencies.*positive"),
    "even": (lambda: dynamics.nonlinear_mode(HELD, [0.1], harmonics=4), "harmonics = 4.*odd"),
    "place": (lambda: dynamics.forced_response(HELD, FORCE, (0.3, 1.0), place=2), "place = 2"),
    "falling": (lambda: dynamics.nonlinear_mode(HELD, [0.2, 0.1]), "amplitudes.*rise"),
    "mode": (lambda: dynamics.nonlinear_mode(HELD, [0.1], mode=2), "mode = 2"),
    "gross slip": (
        lambda: dynamics.nonlinear_mode(CAPPED, np.linspace(1.0, 9.0, 5), **SETTING),
        r"attachments\[0\].*beyond its backbone.*ends at 4",
    ),
}


def test_bad_input_is_one_clear_line():
    for call, message in REFUSED.values():
        with pytest.raises(jb.InputError, match=message) as refusal:
            call()
        assert "\n" not in str(refusal.value)
