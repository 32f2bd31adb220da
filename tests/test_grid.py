"""Element rules integrate to their order; nodes are graded, nested and smooth in the geometry."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jbeamshell import grid
from jbeamshell.grid import element_rule

# Exact degrees of: strain quadrature, nodal quadrature.
DEGREES = {"finite-difference": (1, 1), "collocation": (3, 3)}
rules = pytest.mark.parametrize("name", DEGREES)
ETAS = [1e-4, 1e-2, 0.1126, 0.4, 2.0]
COUNTS = [2, 3, 10, 41, 200, 1000]


def powers(degree, x):
    """Monomials up to a degree at the points x, and their slopes."""
    values = np.stack([x**k for k in range(degree + 1)])
    slopes = np.stack([k * x ** max(k - 1, 0) for k in range(degree + 1)])
    return values, slopes


@rules
def test_weights_integrate_to_their_order(name):
    rule = element_rule(name)
    points = rule.values @ rule.nodes
    strain, nodal = DEGREES[name]
    for x, weights, degree in [
        (points, rule.weights, strain),
        (rule.nodes, rule.node_weights, nodal),
    ]:
        integrals = powers(degree + 1, x)[0] @ weights
        exact = 1 / np.arange(1, degree + 3)
        np.testing.assert_allclose(integrals[:-1], exact[:-1], rtol=1e-14)
        assert abs(integrals[-1] - exact[-1]) > 1e-3


@rules
def test_values_and_slopes_are_those_of_polynomials(name):
    rule, order = element_rule(name), grid.ORDER[name]
    points = rule.values @ rule.nodes
    nodal, _ = powers(order, rule.nodes)
    values, slopes = powers(order, points)
    np.testing.assert_allclose(nodal @ rule.values.T, values, atol=1e-14)
    np.testing.assert_allclose(nodal @ rule.slopes.T, slopes, atol=1e-14)


def test_collocation_slopes_at_gauss_points_are_exact_one_degree_higher():
    rule = element_rule("collocation")
    cubic = rule.nodes * (rule.nodes - 0.5) * (rule.nodes - 1)
    np.testing.assert_allclose(cubic, 0, atol=1e-15)
    np.testing.assert_allclose(rule.slopes @ (cubic + rule.nodes**2), 2 * rule.values @ rule.nodes)


def test_lobatto_weights():
    np.testing.assert_allclose(element_rule("finite-difference").node_weights, [1 / 2, 1 / 2])
    weights = element_rule("collocation").node_weights
    np.testing.assert_allclose(weights, [1 / 6, 4 / 6, 1 / 6], rtol=1e-14)


def test_squeeze_is_taken_at_the_nodes_of_the_box_scheme():
    rule = element_rule("finite-difference")
    psi = np.array([0.3, -0.7])
    np.testing.assert_array_equal(rule.squeeze @ psi, psi)
    np.testing.assert_allclose(rule.values @ psi, [-0.2, -0.2])


@functools.partial(jax.jit, static_argnums=0)
def vertices(elements, length, half_height):
    return grid.vertices(elements, length, half_height)


@pytest.mark.parametrize("elements", COUNTS)
def test_vertices_increase_and_elements_grade_one_way(elements):
    for eta in ETAS:
        for length in (2.0, 170.0):
            x = np.asarray(vertices(elements, length, eta * length / 2))
            assert (x[0], x[-1], x.size) == (0, length, elements + 1)
            sizes = np.diff(x)
            assert (sizes > 0).all()
            towards_the_end = np.diff(sizes) * (1 if eta * length / 12 > length / 60 else -1)
            assert (towards_the_end >= -1e-12 * length).all()


@pytest.mark.parametrize("elements", COUNTS)
def test_doubling_the_count_halves_every_element(elements):
    for eta in ETAS:
        coarse = vertices(elements, 2.0, eta)
        fine = vertices(2 * elements, 2.0, eta)
        np.testing.assert_allclose(fine[::2], coarse, atol=2e-14)
        parts = jnp.diff(fine).reshape(-1, 2) / jnp.diff(coarse)[:, None]
        if elements >= 200:
            np.testing.assert_allclose(parts, 0.5, atol=0.03)


def test_end_element_follows_the_height_at_the_design_count():
    for eta in (0.0511, 0.1126, 0.2358, 0.4):
        x = vertices(160, 2.0, eta)
        assert 1 / 18 < (x[-1] - x[-2]) / eta < 1 / 12
        assert x[1] - x[0] < 2.0 / 100


@rules
@pytest.mark.parametrize("eta", ETAS)
def test_tributary_lengths_fill_the_strip(name, eta):
    rule, ends = element_rule(name), vertices(10, 2.0, eta)
    x, lengths = grid.nodes(rule, ends), grid.tributary_lengths(rule, ends)
    assert x.shape == lengths.shape == (10 * grid.ORDER[name] + 1,)
    assert (jnp.diff(x) > 0).all()
    assert (lengths > 0).all()
    np.testing.assert_allclose(lengths.sum(), 2.0, rtol=1e-14)
    np.testing.assert_allclose(lengths @ x, 2.0, rtol=1e-14)  # int x dx over [0, 2]


@rules
def test_gather_and_scatter_are_adjoint(name):
    order, rng = grid.ORDER[name], np.random.default_rng(1)
    nodal = jnp.asarray(rng.normal(size=(7 * order + 1, 4)))
    elementwise = jnp.asarray(rng.normal(size=(7, order + 1, 4)))
    gathered = jnp.vdot(grid.gather(nodal, order), elementwise)
    np.testing.assert_allclose(gathered, jnp.vdot(nodal, grid.scatter(elementwise)), rtol=1e-13)


@rules
def test_gather_hands_every_element_its_nodes(name):
    rule, ends = element_rule(name), vertices(3, 2.0, 0.4)
    x = grid.gather(grid.nodes(rule, ends), grid.ORDER[name])
    np.testing.assert_allclose(x, ends[:-1, None] + jnp.diff(ends)[:, None] * rule.nodes)


@jax.jit
def in_geometry(length, half_height):
    """Slopes of all vertices in the length and the half height."""
    return jax.jacrev(functools.partial(grid.vertices, 12), (0, 1))(length, half_height)


@pytest.mark.parametrize("eta", [*ETAS, 20 * grid.FAR_SIZE])
def test_vertices_are_smooth_in_the_geometry(eta):
    slopes = in_geometry(2.0, eta)
    assert all(jnp.isfinite(s).all() for s in slopes)
    if eta in ETAS:  # the other is the height from which the grid is uniform: a kink
        for slope, by in zip(slopes, 1e-6 * np.diag([2.0, eta]), strict=True):
            forth, back = (vertices(12, 2.0 + s * by[0], eta + s * by[1]) for s in (1, -1))
            np.testing.assert_allclose(slope, (forth - back) / (2 * by.sum()), atol=1e-6)
