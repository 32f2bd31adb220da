"""Structures with joints, fitted to frequency and damping over amplitude and forced responses."""

import re

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import dynamics
from jbeamshell.dynamics.structure.joint import Joint
from jbeamshell.dynamics.structure.matrices import Attachment, Structure
from jbeamshell.identify import Assembly, Parameter, fit
from jbeamshell.identify.plan_file import plan_from_values
from jbeamshell.measured import DampingCurve, ForcedCurve, FrequencyCurve, SqueezeCurve

SIZE = np.geomspace(0.02, 1.0, 16)
FORCE = np.geomspace(0.02, 0.9, 12)
TRUTH = {"structure.limit": 1.2, "structure.between": -3.0, "structure.damping_ratio": 0.004}


def build(scene, numbers):
    """Two masses, the first on a joint whose slip grows with the square of the force."""
    force = FORCE * numbers["limit"]
    joint = Joint(force + 0.4 * force**2 / numbers["limit"], force)
    joint = joint.in_series(numbers["spring"])
    ratio, between = numbers["damping_ratio"], numbers["between"]
    stiffness = [[3.0, between], [between, 4.0]]  # a list of numbers, of which one is negative
    return Structure(np.diag([1.0, 0.5]), stiffness, [Attachment(joint, 0)], damping_ratio=ratio)


NUMBERS = {"limit": 1.0, "spring": 2.0, "damping_ratio": 0.002, "between": -2.9}
START = Assembly(build, numbers=NUMBERS, point=0, driven=1)


def curves(true, random, noise=(1e-4, 0.02)):
    """Frequency and damping of a mode, with noise that they know."""
    frequency = true.frequency * (1.0 + noise[0] * random.standard_normal(16))
    damping = true.damping * (1.0 + noise[1] * random.standard_normal(16))
    return [
        FrequencyCurve(SIZE, frequency, noise=noise[0] * frequency),
        DampingCurve(SIZE, damping, noise=noise[1] * damping),
    ]


def forced(curve, shapes, random, noise=0.02):
    """Steady responses about the resonance, with noise of the force that they know.

    The force is that of x = |(K_n - omega^2 + i 2 zeta omega_n omega)^-1 phi f phi| of one mode.
    """
    omega = curve.omega * (1.0 + 0.02 * random.uniform(-1.0, 1.0, SIZE.size))
    q = SIZE / abs(shapes[0, 0])
    dynamic = curve.omega**2 - omega**2 + 2j * curve.damping * curve.omega * omega
    force = np.abs(dynamic * q / shapes[1, 0]) * (1.0 + noise * random.standard_normal(16))
    return ForcedCurve(omega / (2.0 * np.pi), force, SIZE, noise=noise * force)


def test_amplitudes_are_those_of_the_point():
    """One mass m swings with omega^2 = F(u)/(u m), u its own displacement, not the modal one."""
    joint = Joint(FORCE + 0.4 * FORCE**2, FORCE)
    alone = Assembly(
        lambda scene, numbers: Structure(
            4.0 * np.eye(1), numbers["spring"] * np.eye(1), [Attachment(joint, 0)]
        ),
        numbers={"spring": 0.5},
        point=0,
    )
    curve, per_force = alone.response(SIZE)
    secant = joint.backbone(SIZE) / SIZE + 0.5
    np.testing.assert_allclose(curve.frequency, np.sqrt(secant / 4.0) / (2.0 * np.pi), rtol=1e-6)
    assert float(per_force) == pytest.approx(0.25)  # 1/m


def test_a_wider_strip_and_more_mass_are_what_they_say(monkeypatch):
    def of(scene, force):  # any joint; those of scenes are tested elsewhere
        return Joint(FORCE, FORCE)

    monkeypatch.setattr(Joint, "of", of)
    model = Assembly.of(jb.Scene(), [[2.0]], [[1e4]], width=3.0)
    one = model.structure()
    more = {"structure.mass": 1.5, "structure.stiffness": 0.5, "structure.width": 6.0}
    other = model.replace(more).structure()
    np.testing.assert_allclose(other.mass, 1.5 * np.asarray(one.mass))
    np.testing.assert_allclose(other.stiffness, 0.5 * np.asarray(one.stiffness))
    narrow, wide = (each.attachments[0].law for each in (one, other))
    np.testing.assert_allclose(wide.forces, 2.0 * np.asarray(narrow.forces), rtol=1e-12)
    np.testing.assert_allclose(wide.displacements, narrow.displacements, rtol=1e-12)


def test_planted_numbers_are_recovered_with_honest_intervals():
    """Errors of 12 fits of three numbers each are as large as the fits say."""
    model, errors = START.replace(TRUTH), []
    true, shapes = model.curve(SIZE), model.structure().modes(1).shapes
    for seed in range(12):
        random = np.random.default_rng(seed)
        data = [*curves(true, random), forced(true, shapes, random)]
        found = fit(data, START, list(TRUTH))
        errors.append([(found.values[k] - v) / found.errors[k] for k, v in TRUTH.items()])
    assert 0.75 < np.sqrt(np.mean(np.square(errors))) < 1.3
    assert np.mean(np.abs(errors) < 1.96) > 0.88
    assert found.converged
    for key, (low, high) in found.intervals.items():
        assert high - low < 0.1 * abs(TRUTH[key])
    assert 0.7 < found.uncertainty.scatter < 1.3
    assert isinstance(found.scene, Assembly)
    bounded = Parameter("structure.between", low=-3.5, high=-2.0)  # a negative number may have
    limit, _, ratio = TRUTH
    other = fit(data, START, [limit, bounded, ratio], starts=1)
    for key, value in found.values.items():
        assert other.values[key] == pytest.approx(value, rel=1e-4)
    assert Parameter(limit).coordinate(25.0).log  # a positive one stays positive
    again = found.scene.curve(SIZE).damping
    np.testing.assert_allclose(again, found.model[1].damping, rtol=1e-6)


def test_a_builder_that_jax_cannot_trace_is_told_so():
    def with_numpy(scene, numbers):
        return Structure(np.eye(1), np.diag([numbers["k"]]), [Attachment(jb.laws.Iwan4(), 0)])

    def with_float(scene, numbers):
        stiffness = [[float(numbers["k"])]]
        return Structure(np.eye(1), stiffness, [Attachment(jb.laws.Iwan4(), 0)])

    for built in (with_numpy, with_float):
        start = Assembly(built, numbers={"k": 1.0}, point=0)
        with pytest.raises(jb.InputError, match=r"^build: JAX traces its numbers.*jax\.numpy"):
            fit(DAMPING, start, ["structure.k"])
    with pytest.raises(jb.InputError, match=r"^stiffness = .*give a square matrix"):
        Structure(np.eye(2), [[1.0, 0.0], [0.0]])


def soft(scene, numbers):
    """One mass on a joint alone that softens much, whose secant is not its first harmonic."""
    force = np.linspace(0.05, 0.9, 18) * numbers["limit"]
    joint = Joint(force + 4.0 * force**4 / numbers["limit"] ** 3, force)
    return Structure(np.eye(1), 0.01 * np.eye(1), [Attachment(joint, 0)], damping_ratio=0.004)


def test_a_fit_by_statics_says_how_far_it_may_be_off():
    """Data that differ by the stated errors of statics move the value by what the doubt says."""
    start, size = Assembly(soft, numbers={"limit": 1.0}, point=0), np.geomspace(0.1, 3.0, 8)
    curve = start.replace({"structure.limit": 1.2}).response(size)[0]

    def found(size, frequency, damping):
        data = [FrequencyCurve(size, frequency), DampingCurve(size, damping)]
        return fit(data, start, ["structure.limit"])

    own = found(size, curve.frequency, curve.damping)
    assert own.values["structure.limit"] == pytest.approx(1.2, rel=1e-4)
    (doubt,) = (warning for warning in own.doubts if "statics" in warning)
    told = re.search(r"amplitude (.*) on, .*to (.*)% and .*by (.*)%, .*limit by (.*): ", doubt)
    first, damping, frequency, moved = map(float, told.groups())
    off = np.abs([curve.frequency_error, curve.damping_error])
    assert first == pytest.approx(size[np.argmax(np.max(off, axis=0) > 0.02)], rel=2e-3)
    assert frequency == pytest.approx(100.0 * off[0].max(), abs=0.051)
    assert damping == pytest.approx(100.0 * off[1].max(), abs=0.51)
    true = (
        curve.frequency / (1.0 - curve.frequency_error),
        curve.damping / (1.0 - curve.damping_error),
    )
    other = found(size, *true).values["structure.limit"]
    assert abs(other - 1.2) == pytest.approx(moved, rel=0.3)
    small = np.geomspace(0.1, 0.7 * first, 8)  # the fix
    curve = start.replace({"structure.limit": 1.2}).response(small)[0]
    well = found(small, curve.frequency, curve.damping)
    assert not [warning for warning in well.doubts if "statics" in warning]


@pytest.mark.slow
def test_a_strip_in_a_structure_is_recovered():
    truth = {
        "contact.friction": 0.12,
        "structure.stiffness": 1.1,
        "structure.damping_ratio": 2e-3,
    }
    scene = jb.Scene().replace({"model.section": "plane", "model.nodes": 17})
    stiffness = np.array([[1.0, -1.0], [-1.0, 1.5]]) * 1e5
    start = Assembly.of(scene, np.diag([1.0, 0.3]), stiffness, point=1, damping_ratio=1e-3)
    size = np.geomspace(1e-6, 1.5e-5, 8)
    curve = start.replace(truth).curve(size)
    data = [FrequencyCurve(size, curve.frequency), DampingCurve(size, curve.damping)]
    found = fit(data, start, list(truth))
    for key, value in truth.items():
        assert found.values[key] == pytest.approx(value, rel=1e-4)


def test_a_plan_names_the_structure(tmp_path):
    rows = "amplitude [m],damping,noise\n" + "".join(f"{1e-6 * n},0.01,1e-4\n" for n in (1, 2, 3))
    (tmp_path / "d.csv").write_text(rows)
    values = {
        "structure": {"mass": [[2.0]], "stiffness": [[1e4]], "point": 0, "damping_ratio": 0.01},
        "set": {"model.section": "plane", "model.nodes": 17},
        "free": {"contact.friction": {}, "structure.damping_ratio": {"high": 0.1}},
        "specimen": [{"data": ["d.csv"], "kind": "damping"}],
    }
    plan = plan_from_values(values, tmp_path)
    (case,) = plan.cases
    assert float(case.model.get("structure.damping_ratio")) == 0.01
    assert case.model.point == 0
    assert case.measurements[0].amplitude.tolist() == [1e-6, 2e-6, 3e-6]
    with pytest.raises(jb.InputError, match="structure: 'masses' is unknown"):
        plan_from_values(values | {"structure": {"masses": 1.0}}, tmp_path)
    with pytest.raises(jb.InputError, match="free"):
        plan_from_values(values | {"free": {}}, tmp_path)


class TestRingDown:
    TIME = np.linspace(0.0, 6.0, 12001)

    def test_an_accelerometer_among_other_modes_tells_the_displacement(self):
        """The first of two modes, whose damping grows: an amplitude a/(1 + c t)."""
        size, omega = 1e-4 / (1.0 + 0.5 * self.TIME), 2.0 * np.pi * 30.0
        other = 3e-5 * np.exp(-2.0 * self.TIME) * np.sin(2.0 * np.pi * 180.0 * self.TIME)
        acceleration = -(omega**2) * size * np.sin(omega * self.TIME) - (6.0 * omega) ** 2 * other
        noise = 0.01 * np.random.default_rng(0).standard_normal(self.TIME.size)
        found = dynamics.ring_down(
            self.TIME,
            acceleration + noise,
            method="hilbert",
            smoothing=6.0,
            band=(15.0, 60.0),
            kind="acceleration",
        )
        frequency, damping = found.modal_curves(12, low=3e-5, high=8e-5)
        expected = 0.5 * damping.amplitude / 1e-4 / omega
        assert np.allclose(frequency.frequency, 30.0, rtol=1e-3)
        off = np.abs(damping.damping - expected)
        assert np.all(off < 4.0 * damping.noise + 0.01 * expected)
        assert np.all(damping.noise < 0.1 * damping.damping)

    def test_noise_of_a_bin_is_that_of_its_mean(self):
        random = np.random.default_rng(1)
        size = np.repeat(np.geomspace(1.0, 2.0, 10), 100)
        known = np.full(size.size, 0.01) + 1e-3 * random.standard_normal(size.size)
        found = dynamics.RingDown(size, size, 1.0 + known, known)
        _, damping = found.modal_curves(10)
        assert np.allclose(damping.noise, 1e-4, rtol=0.4)
        assert np.std((damping.damping - 0.01) / damping.noise) < 2.0


def plain(**changed):
    return Assembly.of(jb.Scene(), **({"mass": [[1.0]], "stiffness": [[1.0]]} | changed))


SQUEEZE = SqueezeCurve(SIZE, -SIZE)
DAMPING = DampingCurve([0.1, 0.2], [0.01, 0.02])
FORCED = ForcedCurve([1.0, 1.1], [1.0, 1.0], [0.1, 0.2])
REFUSED = {
    "strip": (lambda: fit(DAMPING, jb.Scene(), ["contact.friction"]), "Assembly"),
    "law": (lambda: fit(DAMPING, jb.laws.Iwan4(), ["iwan4.chi"]), "Assembly"),
    "squeeze": (lambda: fit(SQUEEZE, START, ["structure.limit"]), "give a Scene"),
    "unknown": (lambda: fit(DAMPING, START, ["structure.limits"]), "structure.limits.*limit"),
    "no scene": (lambda: fit(DAMPING, START, ["contact.friction"]), "give the assembly a scene"),
    "nothing free": (lambda: fit(DAMPING, START), "free: name"),
    "no name": (lambda: Parameter("structure."), "unknown key 'structure.'"),
    "undriven": (
        lambda: fit(FORCED, Assembly(build, numbers=START.numbers), ["structure.limit"]),
        "driven=",
    ),
    "no function": (lambda: Assembly(3.0), "build = 3.0"),
    "no structure": (lambda: Assembly(lambda scene, numbers: 1.0).structure(), "must return"),
    "numbers": (lambda: Assembly(build, numbers={"limit": "much"}), "limit = 'much'"),
    "place": (lambda: Assembly(build, point=-1), "point = -1"),
    "beyond": (lambda: Assembly(build, numbers=START.numbers, point=7).structure(), "from 0 to 1"),
    "reach": (lambda: plain(reach=1.2), "reach = 1.2"),
    "joint": (lambda: plain(joint=[None]), "joint"),
    "forces": (
        lambda: ForcedCurve([1.0], [1.0], [1.0, 2.0]),
        "amplitude have 1 and 2 points",
    ),
    "band": (
        lambda: dynamics.ring_down(np.arange(9.0), np.ones(9), band=(0.1, 3.0)),
        "band = .*below 0.5",
    ),
    "kind": (lambda: dynamics.ring_down(np.arange(9.0), np.ones(9), kind="jerk"), "kind"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_input_is_one_clear_line(name):
    call, message = REFUSED[name]
    with pytest.raises(jb.InputError, match=message) as refusal:
        call()
    assert "\n" not in str(refusal.value)
