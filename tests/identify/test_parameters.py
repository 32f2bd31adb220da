"""Bounds, scales and ties: the way from an unbounded search space to the scene and back."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from toy import STRIP

import jbeamshell as jb
from jbeamshell.identify.parameters import Parameter, as_parameters
from jbeamshell.identify.search_space import search_space
from jbeamshell.identify.specimens import Specimen

MU = "contact.friction"
INTERVALS = (
    (None, None, "log"),
    (None, None, "linear"),
    (0.01, None, "log"),
    (0.01, None, "linear"),
    (None, 3.0, "log"),
    (0.01, 3.0, "log"),
    (0.01, 3.0, "linear"),
)


@st.composite
def coordinates(draw):
    low, high, scale = draw(st.sampled_from(INTERVALS))
    start = draw(st.floats(0.011, 2.9))
    return Parameter(MU, low=low, high=high, scale=scale).coordinate(start)


@given(coordinates(), st.floats(0.0102, 2.99))
def test_there_and_back(coordinate, value):
    assert coordinate.at(coordinate.of(value))[0] == pytest.approx(value, rel=1e-9)


@given(coordinates(), st.floats(-2.0, 2.0))
def test_every_point_lies_within_the_bounds_and_slopes_are_derivatives(coordinate, point):
    assert coordinate.low <= coordinate.at(point)[0] <= coordinate.high
    assert coordinate.low < coordinate.at(100.0 * point)[0] < coordinate.high
    step = 1e-5
    rise = coordinate.at(point + step)[0] - coordinate.at(point - step)[0]
    # Differences lose what they take from numbers of another size.
    rounding = 1e-10 * abs(coordinate.at(point)[0])
    assert rise / (2.0 * step) == pytest.approx(coordinate.at(point)[1], rel=1e-6, abs=rounding)
    assert coordinate.at(point)[1] > 0.0


@given(coordinates())
def test_zero_is_the_start(coordinate):
    assert coordinate.at(0.0)[0] == pytest.approx(coordinate.start, rel=1e-14)
    assert coordinate.of(coordinate.start) == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize(
    ("key", "start", "low", "high"),
    [
        ("strip.poisson_ratio", 0.3, -1.0, 0.5),
        ("strip.poisson_ratio", 0.0, -1.0, 0.5),
        ("contact.smoothing", 16.0, 1.0, np.inf),
        ("strip.curvature", -2e-4, -np.inf, np.inf),
        ("strip.youngs_modulus", 2e11, 0.0, np.inf),
    ],
)
def test_where_parameters_live(key, start, low, high):
    coordinate = Parameter(key).coordinate(start)
    assert coordinate.at(0.0)[0] == pytest.approx(start, rel=1e-15, abs=1e-15)
    for far in (-20.0, 20.0):
        assert low < coordinate.at(far)[0] < high
    for farthest in (-1e6, 1e6):
        assert np.isfinite(coordinate.at(farthest)[0])


def test_what_stands_at_a_bound():
    coordinate = Parameter(MU, low=0.1, high=10.0).coordinate(1.0)
    assert coordinate.bound_at(0.1001) == 0.1
    assert coordinate.bound_at(9.99) == 10.0
    assert coordinate.bound_at(0.12) is None
    assert Parameter(MU).coordinate(1.0).bound_at(1e-12) is None  # of a logarithm zero is no end


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"key": "contact.fricton"}, "did you mean 'contact.friction'"),
        ({"key": "model.nodes"}, "is not a parameter"),
        ({"key": "load.amplitude"}, "is not a parameter"),
        ({"start": np.nan}, "start = nan: give a finite number"),
        ({"low": True}, "low = True: give a finite number"),
        ({"low": -0.1}, "low = -0.1: must lie between 0 and inf"),
        ({"key": "strip.poisson_ratio", "high": 0.6}, r"high = 0.6: .* between -1 and 0.5"),
        ({"low": 2.0, "high": 1.0}, "low = 2.0: must lie below high = 1"),
        ({"scale": "cubic"}, "scale = 'cubic': choose 'log' or 'linear'"),
        ({"key": "strip.curvature", "scale": "log"}, "scale = 'log': needs positive values"),
        ({"prior": 0.1}, "prior = 0.1: give"),
        ({"prior": (0.1, 0.0)}, r"prior = \(0.1, 0.0\): give"),
    ],
)
def test_parameters_that_make_no_sense(options, message):
    with pytest.raises(jb.InputError, match=message):
        Parameter(**{"key": MU} | options)


@pytest.mark.parametrize(
    ("free", "message"),
    [((), "name at least one"), ((MU, Parameter(MU)), "twice"), ((3,), "free 3: give a key")],
)
def test_lists_that_make_no_sense(free, message):
    with pytest.raises(jb.InputError, match=message):
        as_parameters(free)


def space_of(free, **scenes):
    cases = [Specimen(label=label).case(one, []) for label, one in scenes.items()]
    return search_space(as_parameters(free), cases)


def test_shared_and_own_values():
    two = {label: STRIP.replace({"strip.kappa_s": k}) for label, k in (("a", 0.3), ("b", 0.6))}
    free = (Parameter("strip.kappa_s", each=True), Parameter(MU, start=0.2))
    space, begun = space_of(free, **two)
    assert space.names == ("strip.kappa_s[a]", "strip.kappa_s[b]", MU)
    np.testing.assert_allclose(space.values(np.zeros(3)), [0.3, 0.6, 0.2])
    assert space.of([1.0, 2.0, 3.0], 1) == {"strip.kappa_s": 2.0, MU: 3.0}
    assert float(begun[1].model.get(MU)) == 0.2
    points = np.array([-1.0, 0.5, 2.0])
    np.testing.assert_allclose(space.point(space.values(points)), points)
    assert space_of(free, alone=STRIP)[0].names == ("strip.kappa_s", MU)


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        ("strip.height_ratio", 0.1126),
        ("strip.half_height", 0.1126),
        ("strip.youngs_modulus", 3.4e4 / (2 * 0.1126) * (1.0 - 0.3**2)),
        ("strip.kappa_s", 0.44),
        (MU, 0.1),
    ],
)
def test_what_users_fit_starts_from_the_scene(key, expected):
    space, _ = space_of(key, one=STRIP)
    assert space.values([0.0])[0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("free", "message"),
    [
        (("contact.smoothing",), "'sharp' in this scene; give a number"),
        (("strip.curvature",), "the scene has no value for it; give a start"),
        (("contact.bottom_pressure",), "is 0 in this scene; give another"),
        ((Parameter(MU, low=0.2),), "start = 0.1: must lie between low = 0.2 and high = inf"),
        ((Parameter(MU, start=0.5, high=0.4),), "start = 0.5: must lie between"),
    ],
)
def test_starts_that_make_no_sense(free, message):
    with pytest.raises(jb.InputError, match=message):
        space_of(free, one=STRIP)


def test_a_shared_parameter_needs_one_start():
    other = STRIP.replace({MU: 0.3})
    with pytest.raises(jb.InputError, match=r"shared, but the specimens start from 0.1 to 0.3"):
        space_of(MU, a=STRIP, b=other)


def test_a_table_is_no_number():
    rows = [[0.0, 10.0], [2.0, 5.0]]
    with pytest.raises(jb.InputError, match="is a table in this scene"):
        space_of("contact.pressure", one=STRIP.replace({"contact.pressure": rows}))
