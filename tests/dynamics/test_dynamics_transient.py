"""Transients: energy, waves, the slow limit, other solvers, derivatives, bad input."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
from toy import STRIP

import jbeamshell as jb
from jbeamshell import dynamics, identify, plotting
from jbeamshell.dynamics.release import let_go
from jbeamshell.dynamics.strip.equations import Equations, MotionState

build = eqx.filter_jit(Equations)

LINEAR = {"model.kinematics": "linear", "model.nodes": 21, "contact.normal": "held"}
HEAVY = 20.0


def scene(**values):
    return STRIP.replace(LINEAR | {k.replace("__", "."): v for k, v in values.items()})


def heavy(strip):
    return HEAVY * 2.0 * float(strip.strip.half_height * strip.strip.length)


def period(strip):
    return 1.0 / float(dynamics.modes(strip, payload=heavy(strip)).frequency[0])


def left_over(motion):
    return float(jnp.max(jnp.abs(motion.imbalance)))


def test_energy_balances():
    strip = scene(model__nodes=11)
    span = period(strip)
    pull = dynamics.Recorded([0.0, 0.1 * span], [1.0, 0.0])
    start = {"payload": heavy(strip), "released": 1.0, "samples": 101, "step": span / 400.0}
    motion = dynamics.simulate(strip, span, pull, **start)
    assert motion.complete
    assert motion.reached == pytest.approx(float(motion.time[-1]))
    begin = float(motion.energy[0] - jnp.min(motion.energy))
    assert left_over(motion) < 5e-4 * begin
    assert np.all(np.diff(np.asarray(motion.friction_work)) > -1e-4 * begin)
    assert motion.friction_work[-1] > 0.02 * begin


@pytest.fixture(scope="module")
def study():
    return let_go(scene().on_grid(41, 0.0278), 1.0, cycles=20.0, per_cycle=400, whole=True)


@pytest.mark.slow
class TestRingDown:
    def test_damping_is_what_masing_predicts(self, study):
        """The first cycles are left out, because their loops are far from closed."""
        motion, begin = study.motion, float(study.motion.energy[0] - jnp.min(study.motion.energy))
        lost = begin + float(motion.external_work[-1])
        assert motion.friction_work[-1] == pytest.approx(lost, rel=0.02)
        late = study.found.damping < 0.02
        assert np.sum(late) > 20
        assert np.median(np.abs(study.ratio[late] - 1.0)) < 0.05
        at = study.found.amplitude * np.sqrt(study.payload)
        predicted = np.interp(at, study.predicted.amplitude, study.predicted.frequency)
        assert np.allclose(study.found.frequency[late], predicted[late], rtol=5e-3)

    def test_friction_is_found_again_from_damping_over_amplitude(self, study):
        late = study.found.part(slice(5, None))
        curves = late.curves(study.payload)
        start = study.motion.scene.replace({"contact.friction": 0.15, "load.cycles": 1})
        fit = identify.fit(curves, start, ["contact.friction"])
        assert fit.scene.contact.friction == pytest.approx(0.1, rel=0.05)

    def test_its_curves_are_energy_and_stiffness(self, study):
        loss, stiffness = study.found.curves(study.payload)
        predicted = study.predicted
        at = loss.amplitude / stiffness.stiffness * np.sqrt(study.payload)
        mean = np.interp(at, predicted.amplitude, predicted.omega) ** 2 * study.payload
        assert np.allclose(stiffness.stiffness, mean, rtol=0.03)
        energy = np.interp(at, predicted.amplitude, predicted.dissipation)
        assert np.median(np.abs(loss.dissipation / energy - 1.0)) < 0.1
        sheet = plotting.ring_down_sheet(study)
        assert len(sheet.axes) == 4
        assert plotting.spectrogram(study.motion).get_ylabel().startswith("frequency")
        plotting.close(sheet)


@pytest.mark.slow
def test_a_slow_load_walks_the_quasi_static_loop():
    strip = scene()
    slow = 100.0 * period(strip)
    motion = dynamics.simulate(
        strip,
        2.5 * slow,
        dynamics.Harmonic(0.7855, 1.0 / slow, ramp=0.5),
        payload=heavy(strip),
        samples=501,
        step=slow / 5000.0,
    )
    loss = motion.friction_work[-1] - motion.friction_work[-201]
    assert loss == pytest.approx(float(jb.solve(strip).dissipation), rel=5e-3)
    last = slice(-201, None)
    work = jnp.trapezoid(motion.force[last], motion.displacement[last])
    assert work == pytest.approx(float(loss), rel=0.01)


def arrival(time, signal):
    """Time of the maximum of a pulse."""
    top = int(np.argmax(signal))
    before, here, after = signal[top - 1 : top + 2]
    return time[top] + 0.5 * (before - after) / (before - 2 * here + after) * (time[1] - time[0])


def speed_between(motion, signals, places):
    times = [arrival(np.asarray(motion.time), signal) for signal in signals]
    return (places[1] - places[0]) / (times[1] - times[0])


@pytest.mark.slow
@pytest.mark.parametrize("wave", ["axial", "shear"])
def test_fronts_run_at_the_speeds_of_waves(wave):
    axial = wave == "axial"
    strip = STRIP.replace(
        LINEAR
        | {
            "model.section": "bar" if axial else "shell",
            "contact.friction": 0.0,
            "contact.normal": "rigid" if axial else "none",
            "strip.height_ratio": 0.2 if axial else 0.4,
        }
    ).on_grid(401, 1.0)
    modulus, shear = float(strip.strip.plane_modulus), float(strip.strip.shear_modulus)
    kappa = 10.0 * 1.3 / (12.0 + 11.0 * 0.3)
    speed = np.sqrt(modulus if axial else kappa * shear)
    blow = 0.08 * 2.0 / speed
    shape = np.sin(np.pi * np.linspace(0.0, 1.0, 41)) ** 2
    times = np.append(np.linspace(0.0, blow, 41), 10.0)
    excitation = dynamics.Recorded(times, np.append(shape, 0.0), "force" if axial else "across")
    span = 1.7 / speed
    motion = dynamics.simulate(strip, span, excitation, samples=851, step=span / 850)
    field = 0 if axial else 1
    x = np.asarray(motion.x)
    places = (1.4, 0.7) if axial else (0.3, 0.9)
    nodes = [int(np.argmin(np.abs(x - place))) for place in places]
    rates = np.asarray(motion.rates)[:, nodes, field].T
    if not axial:  # the wave is one of the absolute acceleration
        rates = np.gradient(rates, axis=1) / float(motion.time[1])
        rates = rates + np.asarray(jax.vmap(excitation.acceleration)(motion.time)[1])
    assert abs(speed_between(motion, rates, x[nodes])) == pytest.approx(speed, rel=0.01)
    assert left_over(motion) < 1e-2 * float(jnp.max(motion.energy - motion.energy[0]))


@pytest.mark.slow
def test_a_blow_gives_the_payload_its_velocity():
    strip = scene(model__nodes=11)
    for duration in (0.0, 2e-2 * period(strip)):
        motion = dynamics.simulate(
            strip,
            0.2 * period(strip),
            dynamics.Impact(0.01, duration),
            payload=heavy(strip),
            samples=201,
        )
        assert float(motion.velocity[30]) == pytest.approx(0.01 / heavy(strip), rel=0.05)
        assert left_over(motion) < 0.02 * float(jnp.max(motion.kinetic))


def rates(equations, m, time, state):
    """Rates of a state whose friction has a rate: elastic slip's loops at a constant cap.

    A traction beyond its cap decays to it within a time much shorter than the vibration's.
    """
    system, n = equations.system, equations.system.x.size
    (q, p), t = state[:-n].reshape(2, n, -1), state[-n:]
    acceleration, reaction = equations.response(time, MotionState(q, p, t, None))
    cap, speed = system.foundation.friction * jnp.maximum(reaction, 1e-9), p[:, 0]
    used = jnp.where(t * speed > 0.0, jnp.minimum(jnp.abs(t) / cap, 1.0), 0.0)
    slope = system.foundation.slip_stiffness * (1.0 - used**m) ** (1.0 + 1.0 / m)
    beyond = (jnp.clip(t, -cap, cap) - t) / 5e-4
    return jnp.concatenate(
        [p.ravel(), equations.active(acceleration).ravel(), slope * speed + beyond]
    )


@pytest.mark.slow
def test_a_solver_of_differential_equations_finds_the_same_motion():
    """Friction as a rate law, by an explicit Runge-Kutta method of SciPy with small steps."""
    strip = scene(model__nodes=11, contact__smoothing=16.0, contact__stick_stiffness=50.0)
    span, mass = 0.7 * period(strip), heavy(strip)
    excitation = dynamics.Recorded([0.0, 0.2 * span], [0.8, 0.0])
    common = {"payload": mass, "released": 0.8, "samples": 101}
    one = dynamics.simulate(strip, span, excitation, **common, step=span / 3000)
    equations = build(strip, dynamics.Inertia(), jnp.asarray(mass), excitation)
    begun = (equations.active(one.fields[0]), equations.active(one.rates[0]), one.traction[0])
    of_state = jax.jit(lambda time, state: rates(equations, 16.0, time, state))
    other = scipy.integrate.solve_ivp(
        lambda time, state: np.asarray(of_state(time, state)),
        (0.0, span),
        np.concatenate([np.ravel(part) for part in begun]),
        t_eval=np.asarray(one.time),
        rtol=1e-5,
        atol=1e-11,
    )
    fields = jax.vmap(equations.system.embed)(
        other.y[: begun[0].size].T.reshape(101, *begun[0].shape)
    )
    end = jax.vmap(equations.system.end_displacement)(fields)
    off = (end - end[0]) - (one.displacement - one.displacement[0])
    assert float(jnp.max(jnp.abs(off))) < 5e-3 * float(jnp.max(jnp.abs(one.displacement)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["exact", "linear"])
def test_energy_balances_with_exact_kinematics_and_damping(kind):
    strip = scene(model__nodes=11, model__kinematics=kind, model__grid="collocation")
    inertia = dynamics.Inertia(1.0, damping_mass=1.0, damping_stiffness=1e-5)
    motion = dynamics.simulate(
        strip,
        0.5 * period(strip),
        dynamics.Shaker(200.0, 2.0 / period(strip), ramp=0.5),
        inertia=inertia,
        payload=heavy(strip),
        samples=201,
    )
    scale = float(jnp.max(motion.kinetic))
    assert float(motion.damping_work[-1]) > 1e-3 * scale
    assert left_over(motion) < 0.01 * scale


@pytest.mark.slow
def test_a_shaken_strip_lifts_off_where_the_foundation_falls_away():
    strip = scene(model__nodes=11, contact__normal="compliant")
    weight = 2.0 * float(strip.strip.half_height)  # per length, of density 1
    for level, lifts in ((0.5, False), (1.6, True)):
        shaker = dynamics.Shaker(level * 10.0 / weight, 20.0, ramp=0.5, direction="across")
        motion = dynamics.simulate(strip, 0.1, shaker, samples=401, step=1e-5)
        gap = np.asarray(motion.fields)[:, :, 1]
        assert np.all(np.asarray(motion.reaction) >= 0.0)
        assert (gap.max() > 10.0 * abs(gap.min())) == lifts
        apart = gap > 0.1 * abs(gap.min())
        assert np.all(np.asarray(motion.reaction)[apart] == 0.0)
        assert left_over(motion) < (0.1 if lifts else 1e-3) * float(jnp.max(motion.kinetic))


@pytest.mark.slow
def test_a_misfit_has_derivatives_to_friction_and_height():
    base = scene(model__nodes=11, contact__smoothing=4.0, contact__stick_stiffness=20.0)
    span, mass = 0.6 * period(base), heavy(base)
    excitation = dynamics.Recorded([0.0, 0.1 * span], [0.8, 0.0])

    @jax.jit
    def misfit(values):
        keys = ("contact.friction", "strip.height_ratio")
        motion = dynamics.simulate(
            base.replace(dict(zip(keys, values, strict=True))),
            span,
            excitation,
            payload=mass,
            released=0.8,
            samples=41,
            step=span / 200,
            adjoint=diffrax.ForwardMode(),
        )
        return jnp.sum((1e5 * motion.displacement - 0.3) ** 2)

    at, way = jnp.array([0.12, 0.1126]), jnp.array([0.03, 0.02])
    value, slope = jax.jvp(misfit, (at,), (way,))
    steps = 0.5 ** np.arange(2, 7)
    rests = [abs(float(misfit(at + h * way) - value - h * slope)) for h in steps]
    orders = np.diff(np.log(rests)) / np.diff(np.log(steps))
    assert np.median(orders) == pytest.approx(2.0, abs=0.1)


REFUSED = {
    "density": (lambda: dynamics.Inertia(-1.0), r"inertia.density = -1.0"),
    "payload": (lambda: dynamics.modes(scene(), payload=-1.0), "payload = -1.0"),
    "record": (lambda: dynamics.Recorded([0.0, 0.0], [1.0, 1.0]), "increasing times"),
    "nothing": (lambda: dynamics.simulate(scene(), 1.0), "nothing happens"),
    "silent record": (
        lambda: dynamics.simulate(scene(), 1.0, dynamics.Recorded([2.0, 3.0], [0.0, 1.0])),
        "nothing happens",
    ),
    "span": (lambda: dynamics.simulate(scene(), 0.0, released=1.0), "span = 0.0"),
    "samples": (lambda: dynamics.simulate(scene(), 1.0, released=1.0, samples=1), "samples = 1"),
    "step": (
        lambda: dynamics.simulate(scene(), 1.0, released=1.0, step=1e-12),
        r"step = 1e-12: needs .* steps of time: take longer ones",
    ),
    "assumed": (
        lambda: dynamics.simulate(scene(model__section="assumed"), 1.0, released=1.0),
        "model.section = 'assumed': has no inertia",
    ),
    "control": (
        lambda: dynamics.simulate(
            scene(load__control="displacement", load__amplitude=1e-4), 1.0, released=1.0
        ),
        "load.control",
    ),
    "law": (
        lambda: dynamics.simulate(scene(contact__law="tanh-increment"), 1.0, released=1.0),
        "contact.law",
    ),
    "layers": (
        lambda: dynamics.simulate(scene(), 1.0, released=1.0, inertia=dynamics.Inertia([1.0, 2.0])),
        "inertia.density",
    ),
    "gross slip": (lambda: dynamics.simulate(scene(), 1.0, released=3.0), "gross slip"),
}


def test_bad_input_is_one_clear_line():
    for call, message in REFUSED.values():
        with pytest.raises(jb.InputError, match=message) as refusal:
            call()
        assert "\n" not in str(refusal.value)


class Broken(dynamics.Excitation):
    """Force that is no number from some time on."""

    until: float

    def force(self, time):
        return jnp.where(time < self.until, 0.0, jnp.nan)

    def acts(self, span):
        return True


@pytest.mark.slow
def test_an_interrupted_motion_keeps_the_part_computed():
    strip = scene(model__nodes=11)
    common = {"released": 0.5, "samples": 101, "payload": heavy(strip)}
    span = period(strip)
    fine = common | {"step": span / 400}  # the default step is open by .12 % after a sudden release
    with pytest.raises(dynamics.InterruptedMotionError, match=r"ends at t = .*no solution") as cut:
        dynamics.simulate(strip, span, Broken(0.3 * span), **fine)
    motion = cut.value.motion
    assert 0.2 * span < motion.reached < 0.31 * span
    known = np.asarray(motion.time) <= motion.reached
    assert np.all(np.isfinite(np.asarray(motion.displacement)[known]))
    assert np.all(np.isnan(np.asarray(motion.displacement)[~known]))
    kept = dynamics.simulate(strip, span, Broken(0.3 * span), **fine, throw=False)
    assert not kept.complete
    assert kept.figures()["complete"] is False
    assert kept.doubts == ()
    with pytest.warns(jb.DoubtfulWarning, match=r"energy balance.*smaller step or tolerance"):
        coarse = dynamics.simulate(strip, 10.0 * span, **common, step=0.2 * span, throw=False)
    assert f"doubtful: {coarse.doubts[0]}" in str(coarse)
