"""The squeeze strain at work: laminates, Filon's layer, and a strip without a foundation."""

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import reference
from jbeamshell.measured.example import data_folder
from jbeamshell.scene import library

PRESSURE, SOFT = 0.209, 2090.0
DECAY = reference.squeeze_decay_length(1.0, 0.44, 0.3)
LINEAR = {"model.kinematics": "linear"}  # compiles in half the time


def recorded(name):
    return np.genfromtxt(data_folder() / "squeeze" / name, delimiter=",", names=True)


@pytest.mark.parametrize("plane", ["stress", pytest.param("strain", marks=pytest.mark.slow)])
def test_a_squeezed_laminate_bends_as_the_closed_form_and_the_finite_elements(plane):
    scene = library.bimaterial().replace({"strip.plane": plane})
    history = jb.solve(scene.on_grid(41, 1.0 / 0.6))  # even elements: small ones round off by 1e-8
    closed = reference.bimetal_curvature(PRESSURE, 2.0, SOFT, 100 * SOFT, 0.3, plane)
    curvature = np.diff(history.beta[0]) / np.diff(history.x)
    np.testing.assert_allclose(curvature, closed, rtol=1e-8)
    tip = reference.tip_deflection(closed, 100.0)
    assert float(history.tip_deflection[0]) == pytest.approx(float(tip), rel=1e-8)
    measured = recorded(f"b1_{plane}.csv")
    at = np.arange(10.0, 91.0, 10.0)  # nodes of both
    for name, field in (("deflection_fe", history.w), ("slope_fe", history.beta)):
        finite_elements = np.interp(at, measured["x_mm"], measured[name]) * PRESSURE / SOFT
        model = np.interp(at, history.x, field[0])
        np.testing.assert_allclose(model, finite_elements, rtol=1e-4, err_msg=name)


@pytest.mark.slow
def test_one_squeeze_strain_shared_by_the_layers_cannot_bend():
    history = jb.solve(library.bimaterial().replace({"model.constants": "printed"}))
    consistent = reference.bimetal_curvature(PRESSURE, 2.0, SOFT, 100 * SOFT, 0.3, "stress")
    assert abs(float(history.curvature[0])) < 1e-10 * float(consistent)


@pytest.fixture(scope="module")
def squeezed():
    return jb.solve(library.squeezed().replace(LINEAR))


def test_the_squeeze_reaches_beyond_the_load_as_exponentials(squeezed):
    distance = np.asarray(squeezed.middles) - 50.0
    closed = -100.0 * np.asarray(reference.squeeze_step(distance, DECAY))
    assert np.max(np.abs(squeezed.squeeze_stress[0] - closed)) < 0.1


def test_the_squeeze_against_finite_elements(squeezed):
    measured = recorded("b2.csv")
    x = np.linspace(45.0, 55.0, 1001)
    model = np.interp(x, squeezed.middles, squeezed.squeeze_stress[0])
    rms = np.sqrt(np.mean((model - np.interp(x, measured["x_mm"], measured["sy_avg"])) ** 2))
    assert 0.6 < rms < 0.8
    assert np.max(measured["sy_avg"]) > 1.3  # Filon's tension, which a single psi cannot have
    assert np.max(squeezed.squeeze_stress) < 1e-9


@pytest.mark.slow
def test_nodal_quadrature_does_not_oscillate_and_converges():
    short = library.squeezed().replace(
        {
            "strip.length": 20.0,
            "strip.half_height": 1.0,
            "contact.pressure": [[0, 100.0], [10, 100.0], [10, 0.0], [20, 0.0]],
            "contact.bottom_pressure": [[0, 100.0], [10, 100.0], [10, 0.0], [20, 0.0]],
            "model.kinematics": "linear",
        }
    )
    errors = []
    for elements in (44, 88, 176, 352):  # h = 2 lam, lam, lam/2, lam/4
        history = jb.solve(short.on_grid(elements + 1, 20.0 / 60.0))
        stress = np.asarray(history.squeeze_stress[0])
        assert np.ptp(np.diff(history.x)) < 1e-9
        assert np.all(np.diff(stress) > -1e-8)  # monotonic, so no oscillation
        assert np.min(stress) > -100.0 - 1e-8
        closed = -100.0 * reference.squeeze_step(np.asarray(history.middles) - 10.0, DECAY)
        errors.append(np.sqrt(np.mean((stress - closed) ** 2)))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders[1:] > 1.8), (errors, orders)
