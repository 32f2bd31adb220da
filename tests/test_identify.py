import matplotlib.pyplot as plt
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import identify
from jbeamshell.example import example_loops
from jbeamshell.loops import Loop, make_loop
from jbeamshell.observations import SqueezeCurve

FREE = ("contact.friction", "strip.height_ratio")
MODEL = {
    "model.nodes": 41,
    "model.kinematics": "linear",
    "load.steps_per_half_cycle": 24,
    "load.amplitude": 1.0,
}
TRUTH = np.array([0.1, 0.1126])


@pytest.fixture(scope="module")
def planted():
    """The model's own steady loop, and where a fit of it starts."""
    scene = jb.Scene().replace(MODEL)
    force, displacement = map(np.asarray, jb.solve(scene).loop)
    start = scene.replace({"contact.friction": 0.14, "strip.height_ratio": 0.08})
    return force, displacement, start


def test_planted_parameters_come_back(planted):
    force, displacement, start = planted
    lines = []
    fit = identify.fit(make_loop(force, displacement), start, FREE, progress=lines.append)
    np.testing.assert_allclose(list(fit.values.values()), TRUTH, rtol=1e-6)
    assert fit.misfit < 1e-8
    assert fit.status == "converged"
    assert len(lines) < fit.model_runs + 1
    assert "contact.friction" in lines[0]
    assert float(fit.scene.contact.friction) == fit.values["contact.friction"]


def test_noise_is_covered_by_the_standard_errors(planted):
    """Twenty repeats with 1 % noise: within 3 standard errors, neither too small nor too large."""
    force, displacement, start = planted
    random = np.random.default_rng(7)
    scores = []
    for _ in range(20):
        noise = 0.01 * np.ptp(displacement) * random.standard_normal(displacement.size)
        fit = identify.fit(make_loop(force, displacement + noise), start, FREE)
        errors = np.array(list(fit.errors.values()))
        scores.append((np.array(list(fit.values.values())) - TRUTH) / errors)
    scores = np.array(scores)
    assert np.max(np.abs(scores)) < 3.0
    assert np.all(np.abs(scores.mean(axis=0)) < 3.0 / np.sqrt(20))
    assert 0.65 < scores.std() < 1.35


def test_displacement_drives_as_well(planted):
    force, displacement, start = planted
    driven = start.replace({"load.control": "displacement", "load.amplitude": 1e-5})
    fit = identify.fit(make_loop(force, displacement), driven, FREE)
    np.testing.assert_allclose(list(fit.values.values()), TRUTH, rtol=1e-4)


def test_a_mixture_of_loops_a_first_loading_and_a_squeeze_curve():
    """Of one strip, clamped harder at its far part; three lengths, in no order of kinds."""
    clamped = [[0.0, 10.0], [1.4, 10.0], [1.4, 6.0], [2.0, 6.0]]
    scene = jb.Scene().replace(MODEL | {"contact.pressure": clamped})
    history = jb.solve(scene)
    loop, pull = make_loop(*history.loop, "loop"), slice(1, 13)
    first = make_loop(history.force[pull], history.displacement[pull], "pull")
    x = np.linspace(1.0, 1.9, 19)
    stress = np.interp(x, history.middles, history.squeeze_stress[history.pressed])
    assert loop.closed
    assert not first.closed
    start = dict(zip((*FREE, "strip.kappa_s"), (0.12, 0.1, 0.8), strict=True))
    fit = identify.fit([loop, SqueezeCurve(x, stress), first], scene.replace(start), list(start))
    np.testing.assert_allclose(list(fit.values.values()), [*TRUTH, 0.44], rtol=1e-5)
    assert list(fit.figures()["misfits"]) == ["loop", "squeeze", "pull"]
    assert [type(d) for d in fit.model] == [Loop, SqueezeCurve, Loop]
    np.testing.assert_allclose(fit.model[1].stress, stress, rtol=1e-6)
    np.testing.assert_allclose(fit.model[2].displacement, first.displacement, atol=1e-10)
    loops, curves = fit.plot()
    assert len(loops.lines) == 4
    assert len(curves.lines) == 2
    plt.close("all")


@pytest.mark.parametrize(
    ("key", "start", "low", "high"),
    [
        ("contact.friction", 0.1, 0.0, np.inf),
        ("strip.poisson_ratio", 0.3, -1.0, 0.5),
        ("strip.poisson_ratio", 0.0, -1.0, 0.5),
        ("contact.smoothing", 16.0, 1.0, np.inf),
        ("strip.curvature", -2e-4, -np.inf, np.inf),
    ],
)
def test_the_search_space_is_unbounded_and_begins_at_the_start(key, start, low, high):
    assert float(identify._bound(key, start, 0.0)) == pytest.approx(start, abs=1e-15)
    for far in (-20.0, 20.0):
        assert low < float(identify._bound(key, start, far)) < high


def test_finite_element_loops_are_recovered_with_small_bias():
    """True values mu = 0.1, eta = 0.1126; what remains is the model's error, not noise."""
    scene = jb.Scene().replace(
        MODEL | {"model.nodes": 81, "contact.friction": 0.15, "strip.height_ratio": 0.2}
    )
    fit = identify.fit(example_loops(), scene, FREE)
    assert fit.values["contact.friction"] == pytest.approx(0.1, rel=0.01)
    assert fit.values["strip.height_ratio"] == pytest.approx(0.1126, rel=0.03)
    assert fit.misfit < 0.01


@pytest.mark.parametrize(
    ("free", "message"),
    [
        ((), "name at least one"),
        (("contact.fricton",), "did you mean 'contact.friction'"),
        (("model.nodes",), "not a parameter"),
        (("load.amplitude",), "not a parameter"),
        (("contact.smoothing",), "'sharp'"),
        (("contact.friction", "contact.friction"), "twice"),
        (("strip.layers",), "the scene has none"),
        (("contact.bottom_pressure",), "is 0"),
    ],
)
def test_keys_that_cannot_be_fitted(free, message, planted):
    force, displacement, start = planted
    with pytest.raises(jb.InputError, match=message):
        identify.fit(make_loop(force, displacement), start, free)


def test_a_parameter_without_influence_is_named_before_the_fit(planted):
    force, displacement, start = planted
    scene = start.replace({"model.fields": ["v", "beta"]})
    with pytest.raises(jb.InputError, match=r"'strip.kappa_s'.*do not depend"):
        identify.fit(make_loop(force, displacement), scene, ("strip.kappa_s",))


def test_an_unfinished_fit_is_loud(planted):
    force, displacement, start = planted
    with pytest.raises(jb.UnconvergedError, match="not settled after 2 iterations"):
        identify.fit(make_loop(force, displacement), start, FREE, max_iterations=2)
