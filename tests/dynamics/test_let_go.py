"""A mass on a strip, pulled and let go: energy, damping, and the choice of the model."""

import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from jbeamshell.dynamics import Joint
from jbeamshell.dynamics.release import LIGHT, let_go, on_contact_line

SCENE = jb.Scene().replace({"model.section": "plane", "model.nodes": 33, "load.entry": "traction"})
CYCLES = 12.0


@pytest.fixture(scope="module")
def study():
    return let_go(SCENE, 1.0, cycles=CYCLES)


def test_energies_of_the_sliders_add_up(study):
    motion = study.motion
    assert np.abs(motion.imbalance).max() < 1e-5 * motion.stored[0]
    assert np.all(np.diff(motion.friction_work) > -1e-12 * motion.stored[0])
    assert motion.friction_work[-1] > 0.5 * motion.stored[0]


def test_the_first_swing_follows_the_branch_of_the_sliders(study):
    """The mass is at rest at both turns, so the force of Masing's branch has done no work."""
    motion, joint = study.motion, Joint.of(SCENE, 1.0)
    u = np.asarray(motion.displacement)
    turn = np.min(u[: u.size // 15])  # within the first period
    half = np.linspace(0.0, 0.5 * (u[0] - turn), 4001)
    force = 1.0 - 2.0 * np.asarray(joint.backbone(half))
    work = np.trapezoid(force, 2.0 * half)
    assert work == pytest.approx(0.0, abs=1e-3 * motion.stored[0])


class TestLetGo:
    def test_a_heavy_mass_takes_the_sliders_by_itself(self, study):
        assert study.light
        assert study.share < LIGHT
        assert study.figures()["strip"] == "network of sliders"
        late = study.found.damping < 0.02
        assert late.sum() > 8
        # A ring-down fits frequency and damping over a few swings, in which both change.
        assert np.median(np.abs(study.ratio[late] - 1.0)) < 0.1

    def test_a_light_mass_needs_the_strips_inertia(self):
        with pytest.raises(jb.InputError, match=r"plane.*inertia"):
            let_go(SCENE, 1.0, payload=1.0, cycles=CYCLES)
        assert let_go(SCENE, 1.0, payload=1.0, cycles=CYCLES, whole=False).light

    def test_the_sliders_are_those_of_the_section_or_of_plane_elasticity(self):
        for section in ("auto", "plane", "squeeze", "bar"):
            line = on_contact_line(jb.Scene().replace({"model.section": section}))
            assert line.plan.section == ("plane" if section == "auto" else section)

    def test_a_strip_without_sliders_is_refused_where_one_is_asked_for(self):
        smooth = STRIP.replace({"contact.smoothing": 8.0, "model.nodes": 11})
        with pytest.raises(jb.InputError, match=r"whole = False.*has no sliders"):
            let_go(smooth, 1.0, whole=False)

    @pytest.mark.slow
    def test_the_strips_inertia_lowers_frequency_and_damping_as_said(self):
        strip = STRIP.replace({"model.kinematics": "linear"}).on_grid(41, 0.0278)
        strip_mass = 2.0 * float(strip.strip.half_height * strip.strip.length)
        curves = {}
        for times in (1000.0, 10.0):
            study = let_go(strip, 0.5, payload=times * strip_mass, whole=True)
            curves[times] = study.found
        heavy, light = curves[1000.0], curves[10.0]
        rising = np.argsort(heavy.amplitude)
        inside = light.amplitude < heavy.amplitude.max()
        at = light.amplitude[inside]
        share = let_go(strip, 0.5, payload=10.0 * strip_mass, whole=False).share
        frequency = np.interp(at, heavy.amplitude[rising], heavy.frequency[rising]) * 10.0
        damping = np.interp(at, heavy.amplitude[rising], heavy.damping[rising])
        lower = np.median(light.frequency[inside] / frequency) - 1.0
        assert lower == pytest.approx(-0.5 * share, rel=0.2)
        less = np.median(light.damping[inside] / damping) - 1.0
        assert less == pytest.approx(-2.0 * share, rel=0.4)
