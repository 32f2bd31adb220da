"""Elements along X: exactness of their rules, graded nodes, and loads with steps."""

import functools
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import jbeamshell as jb
from jbeamshell.mechanics import elements as grid
from jbeamshell.mechanics.elements import element_rule

# Degrees that are integrated exactly: by the strain points, by the nodes.
DEGREES = {"finite-difference": (1, 1), "collocation": (3, 3)}
rules = pytest.mark.parametrize("name", DEGREES)
ETAS = [1e-4, 1e-2, 0.1126, 0.4, 2.0]
COUNTS = [2, 41, 200]


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
        coarse, fine = (np.asarray(vertices(n * elements, 2.0, eta)) for n in (1, 2))
        np.testing.assert_allclose(fine[::2], coarse, atol=2e-14)
        parts = np.diff(fine).reshape(-1, 2) / np.diff(coarse)[:, None]
        if elements >= 200:
            np.testing.assert_allclose(parts, 0.5, atol=0.03)


def test_end_element_follows_the_height_at_the_design_count():
    for eta in (0.0511, 0.1126, 0.2358, 0.4):
        x = vertices(160, 2.0, eta)
        assert 1 / 18 < (x[-1] - x[-2]) / eta < 1 / 12
        assert x[1] - x[0] < 2.0 / 100


def test_small_elements_grow_fast_up_to_where_others_begin():
    eta, end = 0.1, 2.0**-16 / 48.0
    its, larger = (jb.Scene().on_grid(97, size).plan for size in (end, 1e-3))
    assert its.small_growth == grid.SMALL_GROWTH > larger.small_growth
    grading = {"far_size": 1.0 / 15.0, "small_growth": its.small_growth}
    x = np.asarray(grid.vertices(96, 2.0, eta, end, **grading))
    sizes = np.diff(x)
    assert (np.diff(sizes) < 1e-12).all()
    # Before scaling, elements grow from the end to H/48 at SMALL_GROWTH per distance, and then at
    # GROWTH to L/15: as many as two logarithms and a straight line say.
    small, far = grid.SMALL * eta, 2.0 / 15.0
    first = np.log(small / (end * eta)) / grid.SMALL_GROWTH
    second = np.log(far / small) / grid.GROWTH
    reach = (small - end * eta) / grid.SMALL_GROWTH + (far - small) / grid.GROWTH
    before_scaling = first + second + (2.0 - reach) / far
    within = np.count_nonzero(2.0 - x[:-1] <= (small - end * eta) / grid.SMALL_GROWTH)
    assert within == int(first * 96 / before_scaling)
    last = np.expm1(grid.SMALL_GROWTH * before_scaling / 96) / grid.SMALL_GROWTH
    assert sizes[-1] == pytest.approx(end * eta * last, rel=1e-6)


@functools.partial(jax.jit, static_argnums=0)
def nodes_of(name, ends):
    """Nodes and their tributary lengths."""
    rule = element_rule(name)
    return grid.nodes(rule, ends), grid.tributary_lengths(rule, ends)


@rules
def test_tributary_lengths_fill_the_strip(name):
    for eta in ETAS:
        x, lengths = map(np.asarray, nodes_of(name, vertices(10, 2.0, eta)))
        assert x.shape == lengths.shape == (10 * grid.ORDER[name] + 1,)
        assert (np.diff(x) > 0).all()
        assert (lengths > 0).all()
        np.testing.assert_allclose(lengths.sum(), 2.0, rtol=1e-14)
        np.testing.assert_allclose(lengths @ x, 2.0, rtol=1e-14)  # int x dx over [0, 2]


@rules
def test_gather_and_scatter_are_adjoint(name):
    order, rng = grid.ORDER[name], np.random.default_rng(1)
    nodal = rng.normal(size=(7 * order + 1, 4))
    elementwise = rng.normal(size=(7, order + 1, 4))
    gathered, scattered = jax.jit(lambda a, b: (grid.gather(a, order), grid.scatter(b)))(
        nodal, elementwise
    )
    np.testing.assert_allclose(
        np.vdot(gathered, elementwise), np.vdot(nodal, scattered), rtol=1e-13
    )


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
    if eta in ETAS:  # the last height is where the grid becomes uniform: a kink
        for slope, by in zip(slopes, 1e-6 * np.diag([2.0, eta]), strict=True):
            forth, back = (vertices(12, 2.0 + s * by[0], eta + s * by[1]) for s in (1, -1))
            np.testing.assert_allclose(slope, (forth - back) / (2 * by.sum()), atol=1e-6)


# --- steps of the load --------------------------------------------------------------------------

STEPS = [(0.7,), (0.7, 1.1), (0.02, 1.99), (0.0, 1.2), (0.5, 2.0)]


@functools.partial(jax.jit, static_argnums=0)
def vertices_at(elements, steps=None):
    return grid.vertices(elements, 2.0, 0.05, 0.1, steps)


@pytest.mark.parametrize("steps", STEPS)
def test_every_element_takes_its_share_of_the_size_it_should_have(steps):
    """Sizes grow linearly with the distance from the next step or the loaded end, up to L/60."""
    steps = jnp.array(steps)
    x = np.asarray(vertices_at(120, steps))
    assert (x[0], x[-1], x.size) == (0.0, 2.0, 121)
    assert (np.diff(x) > 0).all()
    fine = np.linspace(0.0, 2.0, 400_001)
    distance = np.min(np.abs(fine - np.append(steps, 2.0)[:, None]), axis=0)
    size = np.minimum(0.1 * 0.05 + grid.GROWTH * distance, grid.FAR_SIZE * 2.0)
    middle = 0.5 * (1.0 / size[1:] + 1.0 / size[:-1])
    count = np.interp(x, fine, np.append(0.0, np.cumsum(middle * np.diff(fine))))
    np.testing.assert_allclose(count, count[-1] * np.arange(121) / 120, rtol=1e-6, atol=1e-6)
    for step in steps:  # the smallest elements are there
        assert np.diff(x)[np.argmin(np.abs(x[1:-1] - step))] < 1.2 * np.diff(x).min()


@pytest.mark.parametrize("steps", STEPS)
def test_doubling_the_count_halves_every_element_between_steps_too(steps):
    coarse, fine = vertices_at(60, jnp.array(steps)), vertices_at(120, jnp.array(steps))
    np.testing.assert_allclose(fine[::2], coarse, atol=2e-14)


def test_a_load_without_a_step_leaves_the_grid_alone():
    unmoved = vertices_at(60, jnp.array([2.0, 2.0]))
    np.testing.assert_allclose(unmoved, vertices_at(60), atol=1e-15)
    smooth = jnp.array([[0.0, 1.0], [0.4, 2.0], [2.0, 0.0]])
    np.testing.assert_array_equal(grid.table_steps(smooth, 2.0), [2.0, 2.0])
    stepped = jnp.array([[0.0, 1.0], [0.4, 2.0], [0.4, 1.0], [0.9, 0.0], [0.9, 1.0]])
    np.testing.assert_array_equal(grid.table_steps(stepped, 2.0), [0.4, 0.9, 2.0, 2.0])


def test_the_single_focus_is_geometric_and_then_uniform():
    """With sizes e + g d at the distance d from the end, d = e (exp(g n) - 1)/g after n of them."""
    x = vertices_at(60)
    end, far = 0.1 * 0.05, grid.FAR_SIZE * 2.0
    turn = (far - end) / grid.GROWTH
    at_turn = np.log(far / end) / grid.GROWTH
    total = at_turn + (2.0 - turn) / far
    n = total * np.arange(60, -1, -1) / 60
    near = end * np.expm1(grid.GROWTH * np.minimum(n, at_turn)) / grid.GROWTH
    np.testing.assert_allclose(x, 2.0 - near - far * np.maximum(n - at_turn, 0.0), atol=1e-14)


def test_vertices_are_smooth_in_the_steps():
    slope = jax.jit(jax.jacrev(functools.partial(vertices_at, 60)))(jnp.array([0.7, 1.1]))
    for i, by in enumerate(1e-6 * np.eye(2)):
        forth, back = (vertices_at(60, jnp.array([0.7, 1.1]) + s * by) for s in (1, -1))
        np.testing.assert_allclose(slope[:, i], (forth - back) / 2e-6, atol=1e-6)


# --- loads --------------------------------------------------------------------------------------


@functools.partial(jax.jit, static_argnums=0)
def loads(name, ends, table):
    return grid.nodal_loads(element_rule(name), ends, table)


def integrals(name, ends, table):
    """Nodal loads by NumPy: quadrature on every piece between vertices and rows of the table."""
    rule = element_rule(name)
    (x, value), ends = np.asarray(table).T, np.asarray(ends)
    cuts = np.unique(np.concatenate([ends, np.clip(x, ends[0], ends[-1])]))
    points, weights = np.polynomial.legendre.leggauss(3)
    order = grid.ORDER[name]
    total = np.zeros(order * (ends.size - 1) + 1)
    for low, high in itertools.pairwise(cuts):
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        element = np.searchsorted(ends, middle) - 1
        begin, size = ends[element], ends[element + 1] - ends[element]
        # Line of the table on this piece, without steps at its ends.
        row = np.searchsorted(x, middle)
        left, right = max(row - 1, 0), min(row, x.size - 1)
        run = x[right] - x[left]
        rise = (value[right] - value[left]) / run if 0 < row < x.size else 0.0
        for point, weight in zip(middle + half * points, half * weights, strict=True):
            inside = (point - begin) / size
            shape = [
                np.prod([(inside - b) / (a - b) for b in rule.nodes if b != a]) for a in rule.nodes
            ]
            load = value[left] + rise * (point - x[left])
            total[order * element : order * (element + 1) + 1] += weight * load * np.array(shape)
    return total


places = st.integers(0, 2000).map(lambda i: i * 1e-3) | st.sampled_from([0.0, 0.25, 0.5, 2.0])
NODES = np.array([0.0, 0.25, 0.5, 0.6, 1.0, 1.7, 2.0])


@rules
@given(
    st.lists(places, min_size=3, max_size=3, unique=True),
    st.integers(0, 2),
    st.lists(st.floats(0.0, 10.0), min_size=4, max_size=4),
)
def test_loads_are_exact_wherever_they_step(name, x, step, value):
    x = sorted([*x, x[step]])  # one step; at a node, between nodes, at an end
    table = jnp.stack([jnp.array(x), jnp.array(value)], axis=1)
    got, exact = loads(name, NODES, table), integrals(name, NODES, table)
    np.testing.assert_allclose(got, exact, rtol=1e-12, atol=1e-13)


@rules
def test_the_force_and_its_moment_do_not_depend_on_the_nodes(name):
    step = jnp.array([[0.0, 3.0], [0.7, 3.0], [0.7, 1.0], [2.0, 1.0]])
    for count in (10, 41):
        ends = vertices(count, 2.0, 0.1)
        got, x = np.asarray(loads(name, ends, step)), np.asarray(nodes_of(name, ends)[0])
        np.testing.assert_allclose(got.sum(), 2.1 + 1.3, rtol=1e-13)
        np.testing.assert_allclose(got @ x, 2.1 * 0.35 + 1.3 * 1.35, rtol=1e-13)


@rules
def test_a_table_goes_on_with_its_end_values(name):
    short = jnp.array([[0.55, 3.0], [0.6, 3.0], [0.6, 5.0], [0.9, 5.0]])
    whole = short.at[0, 0].set(0.0).at[-1, 0].set(2.0)
    np.testing.assert_allclose(loads(name, NODES, short), loads(name, NODES, whole), atol=1e-15)
    for load in (jnp.array(7.0), jnp.array([[0.3, 7.0], [0.3, 7.0], [0.3, 7.0], [1.0, 7.0]])):
        _, lengths = nodes_of(name, NODES)
        np.testing.assert_allclose(loads(name, NODES, load), 7.0 * lengths, rtol=1e-14)


@rules
@pytest.mark.parametrize("at", [0.7, 0.5, 0.93])  # 0.5 is a vertex
def test_loads_are_differentiable_in_where_they_step(name, at):
    @jax.jit
    def stepped(at):
        table = jnp.array([[0.0, 3.0], [0.0, 3.0], [0.0, 1.0], [2.0, 1.0]])
        return loads(name, NODES, table.at[1:3, 0].set(at))

    slope = np.asarray(jax.jit(jax.jacrev(stepped))(at))
    forth, back = stepped(at + 1e-6), stepped(at - 1e-6)
    np.testing.assert_allclose(slope, (forth - back) / 2e-6, atol=5e-5)
    # Moving the step adds load of the height 3 - 1 at X = at.
    x = np.asarray(nodes_of(name, NODES)[0])
    np.testing.assert_allclose([slope.sum(), slope @ x], [2.0, 2.0 * at], rtol=1e-12)


@rules
@pytest.mark.parametrize("row", [0, 1, 2])
def test_rows_on_nodes_and_ends_have_their_slopes(name, row):
    """No kink is there: the slopes from both sides are one, and the force's is in closed form."""
    table = jnp.array([[0.0, 3.0], [0.5, 7.0], [2.0, 4.0]])
    way = jnp.zeros_like(table).at[row, 0].set(1.0)
    along = jax.jit(lambda t, way: jax.jvp(lambda t: loads(name, NODES, t), (t,), (way,))[1])
    slope = np.asarray(along(table, way))
    forth, back = (loads(name, NODES, table + h * way) for h in (1e-6, -1e-6))
    np.testing.assert_allclose(slope, (forth - back) / 2e-6, atol=5e-5)
    # The force is the area of two trapezoids, between end values that go on.
    force = [0.5 * (3.0 - 7.0), 0.5 * (3.0 - 4.0), 0.5 * (7.0 - 4.0)]
    assert float(slope.sum()) == pytest.approx(force[row], abs=1e-12)
