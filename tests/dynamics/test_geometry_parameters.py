"""Four parameters of a scene from its geometry, and of a joint from its loops."""

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.dynamics import Joint, four_parameters
from jbeamshell.laws import Iwan4
from jbeamshell.solving.steady_cycles import steady_cycles

U = np.geomspace(1e-3, 3.0, 60)
LAW = Iwan4(slip_force=1.0, stiffness=1.0, chi=-0.4, beta=0.5)


@pytest.mark.slow
def test_the_loops_of_a_joint_give_its_parameters():
    u = np.asarray(LAW.displacement(np.linspace(0.01, 0.96, 200)))
    joint = Joint(u, LAW.backbone(u), capacity=1.0)
    found = four_parameters(joint)
    assert float(found.law.chi) == pytest.approx(-0.4, abs=0.01)
    assert float(found.law.beta) == pytest.approx(0.5, abs=0.02)
    assert np.max(np.abs(found.dissipation_error)) < 0.01
    assert np.all(found.exponents > 2.0)
    assert "chi = -0.39" in str(found)


def test_the_parameters_of_the_model_itself_come_back():
    found = four_parameters(LAW)
    for key in LAW.table():
        assert float(found.law.get(key)) == pytest.approx(float(LAW.get(key)), rel=1e-4)


def test_a_joint_without_gross_slip_has_no_parameters():
    with pytest.raises(jb.InputError, match=r"joint\.capacity = inf: has no gross slip"):
        four_parameters(Joint(U, np.tanh(U)))
    with pytest.raises(jb.InputError, match=r"^stiffest = inf: must be a number, 500 or more"):
        four_parameters(jb.laws.Bar(1.0, 0.02))
    with pytest.raises(jb.InputError, match="ends too far below gross slip"):
        four_parameters(Joint(U, np.tanh(U), capacity=50.0))


def test_scenes_without_gross_slip_are_refused():
    driven = {"load.control": "displacement", "load.amplitude": 1e-5}
    with pytest.raises(jb.InputError, match="must be 'force'"):
        four_parameters(jb.Scene().replace(driven))
    with pytest.raises(jb.InputError, match="must have gross slip: give it friction and contact"):
        four_parameters(jb.Scene().replace({"contact.friction": 0.0}))


@pytest.mark.slow
class TestScenes:
    def test_a_bolt(self):
        rows = [[0.5, 0.0], [0.5, 20.0], [1.5, 20.0], [1.5, 0.0]]
        fine = {"model.section": "plane", "model.nodes": 129}  # for the smallest load
        scene = jb.Scene().replace(fine | {"contact.pressure": rows})
        found = four_parameters(scene.of_width(3.0))
        assert float(found.law.slip_force) == pytest.approx(6.0)
        assert np.median(np.abs(found.dissipation_error)) < 0.12
        assert np.max(np.abs(found.displacement_error)) < 0.05

    def test_a_single_lap_joint_is_nearly_an_iwan_model(self):
        found = four_parameters(jb.library.single_lap())
        assert str(found).splitlines()[-1].startswith("single lap: held at X = 0")
        assert np.median(np.abs(found.dissipation_error)) < 0.04
        assert np.max(np.abs(found.displacement_error)) < 0.05

    def test_an_even_pressure_up_to_the_end_is_none(self):
        found = four_parameters(
            jb.library.standard().replace({"model.section": "plane", "model.nodes": 129})
        )
        assert np.max(found.exponents) > 6.0
        assert np.max(np.abs(found.dissipation_error)) > 5.0
        assert "n from 3.0" in str(found)

    def test_a_lap_joint_dissipates_as_its_own_cycles(self):
        scene = jb.library.single_lap()
        force = float(scene.gross_slip) * np.array([0.1, 0.25, 0.5, 0.75, 0.93])
        cycles = steady_cycles(scene, force)
        joint = Joint.of(scene, force[-1])
        u = np.interp(force, np.append(0.0, joint.forces), np.append(0.0, joint.displacements))
        np.testing.assert_allclose(u, cycles.displacement, rtol=0.025)
        np.testing.assert_allclose(joint.dissipation(u), cycles.dissipation, rtol=0.05)
