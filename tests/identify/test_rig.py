"""The rig between strip and sensors: closed forms behind it, and planted rigs found again."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import identify, laws
from jbeamshell.identify import rig
from jbeamshell.identify.models import LawModel
from jbeamshell.identify.parameters import RIG
from jbeamshell.identify.plan import planned
from jbeamshell.identify.specimens import Specimen
from jbeamshell.measured.curves import Backbone, DissipationCurve
from jbeamshell.measured.loops import make_loop
from jbeamshell.numerics.newton import Newton

LAW = laws.Iwan4(slip_force=0.6, stiffness=1.0, chi=-0.3, beta=0.3)  # slides at 1.1
SLIP, COMPLIANCE = "iwan4.slip_force", "rig.compliance"
MU = "contact.friction"


def cycle(amplitude, points=60):
    """Path (n,) from zero, and two cycles."""
    down = 1.0 - 2.0 * np.arange(1, points + 1) / points
    return amplitude * np.concatenate(
        [np.arange(1, points // 2 + 1) / (points // 2), *[down, -down] * 2]
    )


def behind(amplitude, **values):
    """Last cycle of the law as seen through a rig, and its phase."""
    path = cycle(amplitude)
    force = np.asarray(LAW.path_forces(path))
    own = rig.rig_of({f"rig.{name}": value for name, value in values.items()})
    bare, moved = own.seen(force, path, 0.0)
    last = np.asarray(moved)[-121:]
    off = (last - 0.5 * (last.max() + last.min())) / (0.5 * np.ptp(last))
    rising = np.append(-np.ones(61), np.ones(60))
    phase = rising * np.sqrt(np.maximum(1.0 - off**2, 0.0))
    seen = np.asarray(bare)[-121:] + float(own.loss) * phase
    seen = seen + float(own.drift) * np.linspace(0.0, 1.0, 121)
    return make_loop(seen, last).but(driver="displacement"), phase


def seen_by(loop, control="displacement", **values):
    given = {f"rig.{name}": value for name, value in values.items()}
    return rig.observed(loop, LawModel(LAW, control), given)


@pytest.mark.parametrize("compliance", [0.1, 1.0, 30.0])
@pytest.mark.parametrize("amplitude", [0.3, 1.0, 2.0])
def test_behind_a_spring_the_strip_follows_its_own_path(compliance, amplitude):
    loop, _ = behind(amplitude, compliance=compliance)
    found, converged = seen_by(loop, compliance=compliance).predict(LawModel(LAW), Newton())
    assert converged
    assert np.max(np.abs(found[-121:] - loop.force)) < 0.01 * np.ptp(loop.force)


def test_slopes_pass_through_the_spring():
    loop, _ = behind(1.0, compliance=1.0)
    observation = seen_by(loop, compliance=1.0)

    def response(compliance):
        changed = rig.with_rig(observation, {COMPLIANCE: compliance})
        return changed.predict(LawModel(LAW), Newton())[0]

    at, tangent = (jnp.asarray(value) for value in (1.0, 1.0))
    _, slope = jax.jvp(response, (at,), (tangent,))
    rise = (response(at + 1e-5) - response(at - 1e-5)) / 2e-5
    far = np.abs(slope - rise) > 1e-3 * np.max(np.abs(rise))
    assert np.mean(far) < 0.05  # but for points at corners


def test_springs_zeros_and_damping_are_seen_in_closed_form():
    values = {"stiffness": 0.4, "loss": 0.05, "force_zero": 0.2, "displacement_zero": -0.3}
    plain, phase = behind(1.0)
    loop = plain.but(
        force=plain.force + 0.4 * plain.displacement + 0.05 * phase + 0.2,
        displacement=plain.displacement - 0.3,
    )
    found, _ = seen_by(loop, **values, drift=0.1).predict(LawModel(LAW), Newton())
    expected = loop.force + 0.1 * np.linspace(0.0, 1.0, 121)
    np.testing.assert_allclose(found[-121:], expected, atol=1e-12)
    # An ellipse dissipates pi times its half axes, a spring nothing.
    assert loop.work - plain.work == pytest.approx(np.pi * 0.05, rel=0.01)


def test_under_a_force_the_spring_adds_its_stretch():
    force = np.linspace(0.05, 0.55, 12)
    stretched = np.asarray(LAW.displacement(force - 0.02)) + 0.5 * (force - 0.02)
    pull = Backbone(force, stretched + 0.1)
    values = {"compliance": 0.5, "force_zero": 0.02, "displacement_zero": 0.1}
    found, _ = seen_by(pull, "force", **values).predict(LawModel(LAW, "force"), Newton())
    np.testing.assert_allclose(found[-12:], pull.displacement, rtol=1e-9)


def test_a_planted_rig_is_found():
    planted = {"compliance": 0.8, "stiffness": 0.1, "loss": 0.05, "drift": 0.03}
    loop, _ = behind(3.0, **planted)  # with a plateau
    free = [SLIP, *(f"rig.{name}" for name in planted)]
    fit = identify.fit(loop, LAW.replace({SLIP: 0.8}), free, points=200, starts=1)
    assert fit.values[SLIP] == pytest.approx(0.6, rel=0.01)
    for name, value in planted.items():
        assert fit.values[f"rig.{name}"] == pytest.approx(value, rel=0.05, abs=1e-3)
    assert fit.misfit < 3e-3


def test_a_plan_holds_and_frees_values_of_the_rig():
    loop, _ = behind(1.0, compliance=1.0)
    plan = planned(Specimen(LAW, [loop], set={COMPLIANCE: 1.0}), free=["rig.drift"])
    assert plan.cases[0].rig == {COMPLIANCE: 1.0}
    (drift,) = rig.with_starts(plan.free, plan.cases)
    assert (drift.start, drift.high) == (0.0, np.ptp(loop.force))


def test_what_a_rig_cannot_be_is_refused():
    loop, _ = behind(1.0)
    weak = make_loop(0.5 * loop.force, loop.displacement)
    with pytest.raises(jb.InputError, match=r"rig.stiffness: carries a part of a prescribed force"):
        seen_by(weak, "force", stiffness=1.0)
    with pytest.raises(jb.InputError, match=r"unknown key 'rig.mass': keys of the rig are rig.com"):
        rig.rig_of({"rig.mass": 1.0})
    with pytest.raises(jb.InputError, match=r"unknown key 'rig.mass': keys of the rig are rig.com"):
        identify.Parameter("rig.mass")
    for bad in (-1.0, "soft", True, np.nan):
        with pytest.raises(jb.InputError, match=r"rig.compliance = .*: give a number, 0 or more"):
            rig.rig_of({COMPLIANCE: bad})
    curve = DissipationCurve(np.array([0.3, 0.6]), np.array([1.0, 2.0]))
    with pytest.raises(jb.InputError, match="only loops and backbones show it"):
        identify.fit(curve, LAW, [COMPLIANCE])
    assert all(key.startswith("rig.") for key in RIG)


@pytest.mark.slow
def test_friction_of_a_strip_behind_a_spring():
    """Below gross slip, from a loop with .1 % noise."""
    amplitude, compliance = 2e-5, 1e-5
    scene = jb.Scene().replace(
        {
            "model.nodes": 21,
            "model.kinematics": "linear",
            "contact.normal": "held",
            "load.control": "displacement",
            "load.amplitude": amplitude,
            "strip.far_end": "guided",
        }
    )
    path = cycle(amplitude, 120)
    force = np.asarray(jb.solve(scene, path).force)[1:]
    noise = 1e-3 * np.ptp(force) * np.random.default_rng(0).standard_normal(241)
    loop = make_loop(force[-241:] + noise, (path + compliance * force)[-241:])
    start = scene.replace({MU: 0.12})
    specimen = Specimen(start, [loop.but(driver="displacement")])
    fit = identify.fit([specimen], free=[MU, COMPLIANCE])
    assert fit.values[MU] == pytest.approx(0.1, rel=3e-3)
    assert fit.values[COMPLIANCE] == pytest.approx(compliance, rel=5e-3)
