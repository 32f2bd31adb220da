"""Searches of a least-squares problem end in a minimum, or say that they have not."""

import numpy as np
import pytest

from jbeamshell.identify.runs import Evaluation
from jbeamshell.identify.search import minimise

A = np.array([[1.0, 2.0], [0.5, -1.0], [2.0, 0.3]])


def problem(of, wall=np.inf):
    """Problem of residuals r(x), which have no answer beyond a wall of the first coordinate."""

    def evaluate(x):
        residual, jacobian = of(x)
        known = residual if x[0] < wall else np.full_like(residual, np.inf)
        return Evaluation(known, jacobian, residual, bool(x[0] < wall))

    return evaluate


def linear(x):
    return A @ (x - [1.5, -0.5]), A


def curved(x):
    jacobian = np.array([[1.0, 0.0], [-2.0 * x[0], 1.0], [0.0, 0.0]])
    return np.array([x[0] - 1.0, x[1] - x[0] ** 2, 3.0]), jacobian


@pytest.mark.parametrize(("of", "least"), [(linear, [1.5, -0.5]), (curved, [1.0, 1.0])])
def test_it_ends_in_a_minimum(of, least):
    end = minimise(problem(of), np.zeros(2), 100, 1e-7)
    assert end.converged
    np.testing.assert_allclose(end.point, least, atol=1e-4)


def test_a_search_that_stops_before_a_wall_has_not_converged():
    # Its steps shrink to nothing there, which looks like convergence.
    end = minimise(problem(linear, wall=0.4), np.zeros(2), 100, 1e-7)
    assert end.point[0] < 0.4
    assert not end.converged
