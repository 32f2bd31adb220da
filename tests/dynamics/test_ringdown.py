"""Ring-downs: planted frequency and damping lie in the stated intervals, and doubts are told."""

import warnings

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.dynamics import Joint, ring_down

TIME = np.linspace(0.0, 30.0, 6001)
PLAIN = np.exp(-0.1 * TIME) * np.cos(10.0 * TIME)


def log_uniform(random, low, high):
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def drawn_noise(random):
    """None, of any size up to 5 %, or of any decade."""
    return float(random.choice([0.0, random.uniform(0.0, 0.05), 10 ** random.uniform(-5, -1.3)]))


def linear(random):
    """A viscous oscillator: times, values, zeta and omega as functions of the amplitude."""
    zeta, omega = log_uniform(random, 1e-3, 0.3), log_uniform(random, 0.1, 1e3)
    damped = omega * np.sqrt(1.0 - zeta**2)
    per_cycle, cycles = log_uniform(random, 4.0, 200.0), log_uniform(random, 3.0, 100.0)
    time = np.arange(max(8, int(cycles * per_cycle))) * 2.0 * np.pi / damped / per_cycle
    values = np.exp(-zeta * omega * time) * np.cos(damped * time + random.uniform(0.0, 6.3))
    values += random.uniform(-1.0, 1.0) + drawn_noise(random) * random.standard_normal(time.size)
    size = log_uniform(random, 1e-6, 1e3)
    return time + random.uniform(-5.0, 5.0), size * values, lambda a: zeta, lambda a: omega


def nonlinear(random):
    """A vibration whose zeta grows with the amplitude, while omega falls, integrated in time."""
    low, more = log_uniform(random, 1e-3, 0.03), log_uniform(random, 3e-3, 0.1)
    power, softer = random.choice([0.5, 1.0, 1.5]), random.uniform(0.0, 0.1)
    per_cycle, cycles = log_uniform(random, 5.0, 200.0), log_uniform(random, 8.0, 100.0)

    def zeta(a):
        return low + more * a**power

    def omega(a):
        return 10.0 * (1.0 - softer * a**power) / np.sqrt(1.0 - zeta(a) ** 2)

    def decay(a):
        return zeta(a) * omega(a)

    finer = int(np.ceil(200.0 / per_cycle))
    step = 2.0 * np.pi / 10.0 / per_cycle / finer
    level, phase, found = 0.0, random.uniform(0.0, 6.3), []
    for _ in range(int(cycles * per_cycle) * finer):
        found.append((level, phase))
        a = np.exp(level - 0.5 * step * decay(np.exp(level)))
        level -= step * decay(a)
        phase += step * 10.0 * (1.0 - softer * a**power)
    levels, phases = np.array(found)[::finer].T
    values = np.exp(levels) * np.cos(phases) + random.uniform(-1.0, 1.0)
    values += drawn_noise(random) * random.standard_normal(values.size)
    return np.arange(values.size) * step * finer, values, zeta, omega


def covered(draw, count, seed):
    """Parts of the points whose intervals hold zeta and omega, width, and number of refusals.

    The width is the median of the half widths of zeta over zeta.
    """
    random, held, wide, refused = np.random.default_rng(seed), [], [], 0
    for _ in range(count):
        time, values, zeta, omega = draw(random)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", jb.DoubtfulWarning)
                found = ring_down(time, values)
        except jb.InputError:
            refused += 1
            continue
        truths = zeta(found.amplitude), omega(found.amplitude)
        ends = found.damping_interval, found.omega_interval
        wide.append(np.median(0.5 * np.ptp(ends[0], axis=1) / truths[0]))
        held.append(
            [
                np.mean((low <= truth) & (truth <= high))
                for truth, (low, high) in zip(truths, (each.T for each in ends), strict=True)
            ]
        )
    return np.mean(held, axis=0), np.median(wide), refused


def test_planted_values_lie_in_the_stated_intervals():
    part, wide, refused = covered(linear, 30, seed=1)
    assert np.all(part > 0.88)
    assert wide < 0.03
    assert refused == 0


@pytest.mark.slow
@pytest.mark.parametrize(("draw", "most"), [(linear, 0.99), (nonlinear, 1.0)])
def test_planted_values_lie_in_the_stated_intervals_of_200(draw, most):
    """Rates that depend on the amplitude are stated with what the splines may leave out."""
    part, wide, refused = covered(draw, 200, seed=2)
    assert np.all((part > 0.9) & (part < most))
    assert wide < 0.03
    assert refused <= 4


def test_a_decay_under_friction_tells_the_damping_of_steady_cycles():
    """A mass on sliders is let go: its decrement is more than steady cycles of Masing's rule have.

    They lose D = 8 W - 4 U F at the amplitude U, of which zeta is D/(2 pi F U).
    """
    law = jb.laws.Iwan4(1.0, 1.0, -0.5, 0.2)
    joint, step, speed = Joint.of(law), 2.0 * np.pi / 400.0, 0.0
    springs, slips = np.asarray(joint.springs), np.asarray(joint.slips)
    path = [0.5 * float(law.phi_max)]
    held = np.clip(path[0], -slips, slips)
    for _ in range(40 * 400):
        speed -= step * float(springs @ held)
        path.append(path[-1] + step * speed)
        held = np.clip(held + path[-1] - path[-2], -slips, slips)
    values = np.array(path[::5])
    found = ring_down(5.0 * step * np.arange(values.size), values)

    def steady(size):
        return np.asarray(law.dissipation(size) / (2.0 * np.pi * law.backbone(size) * size))

    true = steady(found.amplitude)
    assert np.max(np.abs(found.damping / true - 1.0)) > 0.2
    off = 0.5 * np.ptp(found.damping_interval, axis=1) / found.damping  # of noise
    assert np.all(np.abs(found.steady_damping / true - 1.0) < 0.04 + off)
    assert "in steady cycles of friction" in str(found)
    lost, _ = found.curves(mass=1.0)
    u = np.asarray(law.displacement(lost.amplitude))
    np.testing.assert_allclose(lost.dissipation[4:], law.dissipation(u)[4:], rtol=0.1)
    damping = found.modal_curves()[1]
    np.testing.assert_allclose(damping.damping[4:], steady(damping.amplitude)[4:], rtol=0.06)


def test_little_noise_leaves_frequency_and_damping():
    """Turning points of this signal gave zeta from -1 to 1."""
    noise = 1e-3 * np.random.default_rng(0).standard_normal(TIME.size)
    found = ring_down(TIME, PLAIN + noise)
    assert found.numbers == 1
    assert np.allclose(found.omega, np.hypot(10.0, 0.1), rtol=1e-5)
    assert np.allclose(found.damping, 0.1 / np.hypot(10.0, 0.1), rtol=1e-3)
    assert "at all amplitudes" in str(found)
    turn = 2.0 * np.pi * TIME
    swings = ring_down(TIME, np.exp(-0.01 * turn) * np.cos(turn) + 0.3, method="hilbert")
    inner = slice(swings.time.size // 10, -swings.time.size // 10)
    assert np.allclose(swings.frequency[inner], 1.0, rtol=2e-3)
    assert np.allclose(swings.damping[inner], 0.01, rtol=0.05)


def test_intervals_are_no_wider_than_the_noise_makes_them():
    """The Cramer-Rao bound of a long decay: the rate's variance is 16 s^2 sigma^3 h/A^2."""
    noise = 0.01
    found = ring_down(TIME, PLAIN + noise * np.random.default_rng(3).standard_normal(TIME.size))
    rate = np.sqrt(16.0 * noise**2 * 0.1**3 * (TIME[1] - TIME[0]))
    width = np.ptp(found.damping_interval, axis=1) * 10.0
    assert np.allclose(width, 2.0 * 1.96 * rate, rtol=0.15)


def test_lead_in_drift_and_steps_of_a_converter_do_no_harm():
    random = np.random.default_rng(1)
    late = np.where(TIME > 5.0, np.exp(-0.1 * (TIME - 5.0)) * np.sin(10.0 * (TIME - 5.0)), 0.0)
    for values in (late, PLAIN + 0.1 * TIME, np.round(50.0 * PLAIN) / 50.0):
        found = ring_down(TIME, values + 1e-3 * random.standard_normal(TIME.size))
        assert np.allclose(found.omega, 10.0005, rtol=2e-5)
        assert np.allclose(found.damping, 0.01, rtol=3e-3)


def test_rounded_times_do_no_harm():
    even = 0.0033 * np.arange(6000)
    found = ring_down(np.round(even, 3), np.exp(-0.1 * even) * np.cos(10.0 * even))
    assert np.allclose(found.frequency, 10.0 / (2.0 * np.pi), rtol=1e-4)
    kept = np.arange(6000) != 3000
    with pytest.raises(jb.InputError, match="evenly spaced"):
        ring_down(even[kept], np.cos(10.0 * even[kept]))


@pytest.mark.doubtful("another vibration")
def test_another_vibration_is_doubted_and_the_band_given_mends_it():
    both = PLAIN + 0.4 * np.exp(-0.2 * TIME) * np.cos(37.0 * TIME)
    with pytest.warns(jb.DoubtfulWarning, match=r"frequency 5\.89.*band=\(0\.796, 3\.06\)"):
        ring_down(TIME, both)
    found = ring_down(TIME, both, band=(0.796, 3.06))
    assert found.doubts == ()
    assert np.allclose(found.damping, 0.01, rtol=0.02)


def test_what_the_record_leaves_open_is_doubted_or_refused():
    random = np.random.default_rng(0)
    short = TIME[:300]
    with pytest.warns(jb.DoubtfulWarning, match="damping lies between"):
        ring_down(short, np.cos(30.0 * short) + 0.3 * random.standard_normal(short.size))
    with pytest.warns(jb.DoubtfulWarning, match="grows"):
        ring_down(TIME, np.exp(0.02 * TIME) * np.sin(9.0 * TIME))
    for nothing in (random.standard_normal(TIME.size), np.exp(-TIME), TIME):
        with pytest.raises(jb.InputError, match="no decaying vibration stands out"):
            ring_down(TIME, nothing)


def test_points_of_a_fit_share_its_noise():
    """Curves of a constant rate tell it once, however many bins there are."""
    noise = 0.01 * np.random.default_rng(2).standard_normal(TIME.size)
    found = ring_down(TIME, PLAIN + noise)
    error = 0.5 * np.ptp(found.damping_interval[0]) / 1.96
    for points in (4, 10):
        _, damping = found.modal_curves(points)
        assert np.sum(damping.noise**-2) ** -0.5 == pytest.approx(error, rel=1e-6)
