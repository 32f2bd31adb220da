"""Filon's strip and receding contact against elasticity, finite elements and other methods."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from jbeamshell import reference
from jbeamshell.measured.example import data_folder
from jbeamshell.mechanics.homogeneous import Homogeneous, shear_coefficient

# compiled as a whole: eager JAX compiles operation by operation for every new shape
SYMBOLS = {
    "average": jax.jit(reference.filon_average),
    "midplane": jax.jit(reference.filon_midplane),
}
STEPS = {
    "average": jax.jit(reference.filon_average_step),
    "midplane": jax.jit(reference.filon_midplane_step),
}


def slope_of(function):
    return jax.jit(jax.vmap(jax.grad(function)))


def table(name):
    """Columns of a reference table by their heading."""
    return np.genfromtxt(data_folder() / "squeeze" / f"{name}.csv", delimiter=",", names=True)


# --- symbols ---------------------------------------------------------------------------------


@pytest.mark.parametrize("where", SYMBOLS)
def test_symbols_of_the_table(where):
    rows = table("exact_symbols")
    np.testing.assert_allclose(SYMBOLS[where](rows["m"]), rows[where], rtol=6e-8)


@pytest.mark.parametrize("m", [0.3, 1.7, 6.0])
def test_symbols_solve_plane_elasticity(m):
    """A biharmonic Airy function gives the pressure on the faces, without shear there."""
    cosh, sinh = np.cosh(m), np.sinh(m)
    even = np.linalg.solve([[cosh, sinh], [m * sinh, m * cosh + sinh]], [1 / m**2, 0])

    def airy(y):  # times cos(m x)
        return even[0] * jnp.cosh(m * y) + even[1] * y * jnp.sinh(m * y)

    y, weights = np.polynomial.legendre.leggauss(20)
    stress = -(m**2) * airy(y)
    derivatives = [airy]
    for _ in range(4):
        derivatives.append(jax.grad(derivatives[-1]))
    second, fourth = (jax.jit(jax.vmap(derivatives[n]))(y) for n in (2, 4))
    np.testing.assert_allclose(fourth - 2 * m**2 * second + m**4 * airy(y), 0, atol=1e-12 * m**2)
    np.testing.assert_allclose(-(m**2) * airy(1.0), -1, rtol=1e-13)
    assert abs(m * derivatives[1](1.0)) < 1e-12  # the shear
    np.testing.assert_allclose(m**2 * airy(0.0), SYMBOLS["midplane"](m), rtol=1e-12)
    np.testing.assert_allclose(-stress @ weights / 2, SYMBOLS["average"](m), rtol=1e-12)


def test_symbols_of_long_and_short_waves():
    average, midplane = SYMBOLS.values()
    long, short = jnp.array([0.03, 0.1]), jnp.array([40.0, 300.0])
    np.testing.assert_allclose(1 - average(long), long**4 / 45, rtol=5e-3)
    np.testing.assert_allclose(1 - midplane(long), long**4 / 24, rtol=5e-3)
    np.testing.assert_allclose(average(short), 2 / short, rtol=1e-14)
    np.testing.assert_allclose(midplane(short), 2 * (1 + short) * jnp.exp(-short), rtol=1e-13)
    m = jnp.linspace(0, 60, 1201)
    for symbol in (average, midplane):
        assert symbol(m)[0] == 1
        np.testing.assert_array_equal(symbol(-m), symbol(m))
        assert (jnp.diff(symbol(m)[2:]) < 0).all()


@pytest.mark.parametrize("where", SYMBOLS)
def test_symbols_have_their_gradients_everywhere(where):
    symbol, slope = SYMBOLS[where], slope_of(SYMBOLS[where])
    # 0.025 and 0.05 lie where exponentials replace series
    m = jnp.array([1e-12, 1e-6, 0.0249999, 0.0250001, 0.0499999, 0.0500001, 0.4, 3.0, 30.0])
    leading = {"average": 45, "midplane": 24}[where]
    np.testing.assert_allclose(slope(m[:6]), -4 * m[:6] ** 3 / leading, rtol=2e-3, atol=1e-14)
    step = 1e-5
    difference = (symbol(m[6:] + step) - symbol(m[6:] - step)) / (2 * step)
    np.testing.assert_allclose(slope(m[6:]), difference, rtol=1e-7, atol=1e-12)
    assert slope(jnp.zeros(1)) == 0
    extreme = jnp.array([0.0, 1e-30, 88.0, 400.0, 1e6, 1e12])
    for dtype in (jnp.float32, jnp.float64):
        for values in (symbol(extreme.astype(dtype)), slope(extreme.astype(dtype))):
            assert values.dtype == dtype
            assert jnp.isfinite(values).all()


# --- step responses --------------------------------------------------------------------------


def test_steps_of_the_table():
    """Step responses of the table, whose average is good to 3e-4 at the edge only."""
    rows = table("exact_step")
    t = rows["t"]
    np.testing.assert_allclose(STEPS["midplane"](t), rows["midplane"], atol=6e-8)
    average = np.asarray(STEPS["average"](t))
    for inner, outer, error in ((0, 0.1, 3.2e-4), (0.1, 1, 4e-5), (1, 6, 4e-6)):
        band = (t >= inner) & (t <= outer)
        np.testing.assert_allclose(average[band], rows["average"][band], atol=error)


@pytest.mark.parametrize("where", STEPS)
def test_steps_by_residues(where):
    """Sum over the eigenfunctions of the strip, sinh 2m + 2m = 0 with complex m."""
    order = 4 * np.arange(1, 4001) - 1
    m = np.log(order * np.pi) / 2 + 1j * order * np.pi / 4
    for _ in range(30):
        twice = np.exp(-2 * m)
        m = m - ((1 - twice**2) / 2 + 2 * m * twice) / (1 + twice) ** 2
    twice = np.exp(-2 * m)
    amplitude = {
        "average": (1 - twice) ** 2 / m,
        "midplane": np.exp(-m) * (1 - twice + m * (1 + twice)),
    }[where]
    amplitude = amplitude / (1 + twice) ** 2 / m
    t = np.array([0.01, 0.1, 0.5, 1, 2, 4, 8, 12])
    series = -2 * (np.exp(1j * np.outer(t, m)) @ amplitude).real
    np.testing.assert_allclose(STEPS[where](t), series, rtol=0, atol=5e-14)


def test_midplane_step_by_a_fourier_series():
    """Square wave of pressure whose edges, 40 H apart, do not influence each other."""
    half_period, t = 40.0, np.linspace(-7, 7, 29)
    m = np.pi * np.arange(1, 601, 2) / half_period
    series = 2 / half_period * np.sin(np.outer(t, m)) @ (SYMBOLS["midplane"](m) / m)
    np.testing.assert_allclose(STEPS["midplane"](t), 0.5 - series, atol=1e-14)


@pytest.mark.parametrize("where", STEPS)
def test_steps_mirror_at_the_edge_and_settle(where):
    t = jnp.array([0.0, 0.3, 1.0, 5.0, 17.0, 19.0, 1e6])
    step = STEPS[where]
    np.testing.assert_allclose(step(-t), 1 - step(t), atol=1e-15)
    assert step(t)[0] == step(0) == 0.5
    np.testing.assert_allclose(step(t)[-3:], 0, atol=5e-14)
    single = step(t.astype(jnp.float32))
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, step(t), atol=5e-6)


def test_step_gradients():
    average, midplane = (slope_of(step) for step in STEPS.values())
    t, width = jnp.array([-40.0, -2.0, 0.01, 0.7, 3.0, 40.0]), 1e-5
    for slope, step in ((average, STEPS["average"]), (midplane, STEPS["midplane"])):
        difference = (step(t + width) - step(t - width)) / (2 * width)
        np.testing.assert_allclose(slope(t), difference, rtol=1e-6, atol=1e-10)
    m = np.linspace(0, 60, 601)  # the trapezoidal rule is spectral for an even symbol
    at_edge = -np.trapezoid(SYMBOLS["midplane"](m), m) / np.pi
    np.testing.assert_allclose(midplane(0 * t), at_edge, rtol=1e-12)
    infinite = average(0 * t)
    assert jnp.isfinite(infinite).all()
    assert (infinite < -100).all()


@pytest.mark.parametrize("where", STEPS)
def test_steps_are_what_finite_elements_find(where):
    rows = table("b2")
    t, column = rows["x_mm"] - 50, {"average": "sy_avg", "midplane": "sy_mid"}[where]
    difference = np.abs(STEPS[where](t) + rows[column] / 100)
    assert difference.max() < 1e-3  # at the edge itself, where the average has no slope
    assert difference[np.abs(t) > 0.02].max() < 1.5e-4


# --- the psi model ---------------------------------------------------------------------------


@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_squeeze_decay_length_is_that_of_the_energy(nu):
    """``lambda^2`` is the stiffness of Phi against psi' over that against psi at N = 0."""
    half_height, kappa_s = 0.7, 0.6
    energy = Homogeneous(half_height, 11.0, nu, kappa_s)
    hessian = jax.jit(jax.hessian(lambda strains: energy(*strains)))(jnp.zeros(5))
    e, psi, slope = 0, 3, 4
    relaxed = hessian[psi, psi] - hessian[e, psi] ** 2 / hessian[e, e]
    decay_length = reference.squeeze_decay_length(half_height, kappa_s, nu)
    np.testing.assert_allclose(decay_length**2, hessian[slope, slope] / relaxed, rtol=1e-13)


def test_squeeze_step_solves_the_balance():
    """Balance ``f - (lambda / H)^2 f'' = load``."""
    ratio, t = 0.37, jnp.array([-2.0, -0.2, 0.3, 1.4])

    def step(t):
        return reference.squeeze_step(t, ratio)

    curvature = slope_of(jax.grad(step))(t)
    np.testing.assert_allclose(step(t) - ratio**2 * curvature, jnp.where(t < 0, 1, 0), atol=1e-14)
    edge = jnp.array([-1e-12, 0.0, 1e-12, 1e4])
    np.testing.assert_allclose(step(edge), [0.5, 0.5, 0.5, 0], atol=1e-11)
    slope = -0.5 / ratio
    np.testing.assert_allclose(slope_of(step)(edge), [slope, slope, slope, 0], rtol=1e-11)
    np.testing.assert_array_equal(step(-edge)[-1], 1)
    np.testing.assert_array_equal(slope_of(step)(-edge)[-1], 0)


def edge_layer():
    """Distances from the edge and weights; ``t = r^3`` removes the logarithmic slope there."""
    root, weights = np.polynomial.legendre.leggauss(200)
    root, weights = 1.3 * (root + 1), 1.3 * weights
    return root**3, 3 * root**2 * weights


def test_best_step_is_the_least_squares_minimum():
    t, weights = edge_layer()
    exact = np.asarray(STEPS["average"](t))
    squeeze_step = jax.jit(reference.squeeze_step)

    def squared_error(ratio):
        return weights @ (exact - np.asarray(squeeze_step(t, ratio))) ** 2

    best = minimize_scalar(squared_error, bounds=(0.1, 0.5), options={"xatol": 1e-9}).x
    np.testing.assert_allclose(reference.best_decay_ratio(), best, atol=1e-7)
    assert abs(best - 0.2268) < 5e-5
    np.testing.assert_allclose(
        reference.best_kappa_s(jnp.array([0, 0.3])), [0.309, 0.441], atol=3e-4
    )


def test_best_shear_meets_the_exact_peak_of_xi():
    t, weights = edge_layer()
    ratio = reference.best_decay_ratio("shear")
    for step in (STEPS["average"](t), reference.squeeze_step(t, ratio)):
        np.testing.assert_allclose(2 * weights @ np.asarray(step), ratio, rtol=1e-10)
    assert abs(ratio - 0.19196) < 1e-5
    assert abs(reference.best_kappa_s(0.3, "shear") - 0.316) < 2e-4
    peak = 100 * ratio  # H^2 p lambda / H of the strip of b2
    assert 0.98 * peak < table("b2")["xi"].max() < peak


def test_best_kappa_s_differentiates_and_compiles():
    slope = jax.jit(jax.grad(reference.best_kappa_s))(0.3)
    np.testing.assert_allclose(slope, reference.best_kappa_s(0.3) / 0.7, rtol=1e-12)
    with pytest.raises(ValueError, match="'step' or 'shear', not 'peak'"):
        reference.best_decay_ratio("peak")


@pytest.mark.parametrize("kappa_s", [0.44, 2.5641, 24.0])
def test_reaction_jump_of_the_discretised_psi_model(kappa_s):
    """Linear elements for psi and beta of a strip held down, with the energy of Brink 2015."""
    nu, half_height, cells, step = 0.3, 1.0, 600, 0.01
    section = Homogeneous(half_height, 1.0, nu, kappa_s)
    kappa = float(shear_coefficient(nu))
    nodes = cells + 1
    slope = (np.eye(cells, nodes, 1) - np.eye(cells, nodes)) / step
    middle = (np.eye(cells, nodes, 1) + np.eye(cells, nodes)) / 2
    lengths = np.full(nodes, step)
    lengths[[0, -1]] /= 2
    shear = np.hstack([half_height * slope, -middle])  # g of (psi, beta)
    shear_stiffness = 2 * kappa * float(section.shear_modulus) * half_height
    stiffness = shear_stiffness * step * shear.T @ shear
    squeeze = float(section.squeeze_stiffness) * step * slope.T @ slope
    stiffness[:nodes, :nodes] += squeeze + np.diag(2 * half_height * lengths)
    stiffness[nodes:, nodes:] += float(section.bending_stiffness) * step * slope.T @ slope
    pressure = np.where(np.arange(nodes) < cells // 2, 0.0, 1.0)
    pressure[cells // 2] = 0.5
    load = np.concatenate([-2 * half_height * pressure * lengths, np.zeros(nodes)])
    force = shear_stiffness * shear @ np.linalg.solve(stiffness, load)
    reaction = pressure[1:-1] - np.diff(force) / step

    left, right = reaction[cells // 2 - 3 : cells // 2 - 1], reaction[cells // 2 : cells // 2 + 2]
    jump = (2 * right[0] - right[1]) - (2 * left[1] - left[0])
    np.testing.assert_allclose(reference.reaction_jump(1.0, kappa_s, kappa), jump, atol=2e-3)


# --- two layers ------------------------------------------------------------------------------


@pytest.mark.parametrize(("plane", "curvature"), [("stress", 0.0312604), ("strain", 0.0406385)])
def test_bimetal_strip_is_what_finite_elements_find(plane, curvature):
    bent = reference.bimetal_curvature(1.0, 2.0, 1.0, 100.0, 0.3, plane)
    np.testing.assert_allclose(bent, curvature, atol=5e-8)
    rows = table(f"b1_{plane}")
    deflection = reference.tip_deflection(bent, rows["x_mm"])
    np.testing.assert_allclose(deflection, rows["deflection_closed"], rtol=1e-6)
    np.testing.assert_allclose(bent * rows["x_mm"], rows["slope_closed"], rtol=1e-6)
    inside = (rows["x_mm"] >= 10) & (rows["x_mm"] <= 90)
    np.testing.assert_allclose(deflection[inside], rows["deflection_fe"][inside], rtol=3e-5)
    np.testing.assert_allclose(deflection[-1], rows["deflection_fe"][-1], rtol=2.5e-4)


@pytest.mark.parametrize("plane", ["stress", "strain"])
@pytest.mark.parametrize("ratio", [0.05, 1.0, 7.0])
def test_bimetal_curvature_of_two_free_layers(plane, ratio):
    """Curvature at which layers squeezed by p carry neither axial force nor moment."""
    pressure, height, youngs, nu = 1.7, 0.6, 3.0, 0.2
    modulus = np.array([youngs, youngs * ratio])
    contraction = nu
    if plane == "strain":
        modulus, contraction = modulus / (1 - nu**2), nu / (1 - nu)
    bounds = np.array([-height / 2, 0, height / 2])
    first, second, third = (modulus @ np.diff(bounds**k) / k for k in (1, 2, 3))
    stretch = contraction * pressure / modulus
    forces = [(modulus * stretch) @ np.diff(bounds**k) / k for k in (1, 2)]
    _, curvature = np.linalg.solve([[first, -second], [second, -third]], forces)
    bent = reference.bimetal_curvature(pressure, height, youngs, youngs * ratio, nu, plane)
    np.testing.assert_allclose(bent, curvature, rtol=1e-12, atol=1e-15)
    assert np.sign(bent) == np.sign(ratio - 1)


def test_bimetal_curvature_names_an_unknown_plane():
    with pytest.raises(ValueError, match="'strain' or 'stress', not 'both'"):
        reference.bimetal_curvature(1.0, 1.0, 1.0, 1.0, 0.3, "both")


# --- receding contact ------------------------------------------------------------------------
# Height, E' and load are 1. Filon's strip by cosine integrals: half of a pressure cos(a x) on one
# face bends the strip (BEND), half squeezes it (SQUEEZE). BEND is as singular as 1/a^4; leaving out
# a rigid motion makes its kernel integrable.

A, WEIGHTS = np.polynomial.legendre.leggauss(400)
A, WEIGHTS = 20 * (A + 1), 20 * WEIGHTS / np.pi
BEND = 2 / A * (np.cosh(A) + 1) / (np.sinh(A) - A) / 2
SQUEEZE = 2 / A * (np.cosh(A) - 1) / (np.sinh(A) + A) / 2
LOCAL = 2 / A * -np.expm1(-A)  # like 2 / a of a half-plane at large a, with a known integral
CUT = np.exp(-(A**4))


def pushed_down(r, face):
    """Sinking of the bottom at a distance from a line load on the top (-1) or the bottom (1).

    Without `LOCAL` of a load on the bottom.
    """
    z = np.multiply.outer(r, A)
    squeeze = SQUEEZE - LOCAL if face > 0 else -SQUEEZE
    bend = np.cos(z) - CUT * (1 - z**2 / 2)
    return bend @ (WEIGHTS * BEND) + np.cos(z) @ (WEIGHTS * squeeze)


def slope_down(r, face):
    """Derivative of `pushed_down`, with the part of `LOCAL` that is not -2 / (pi r)."""
    z = np.multiply.outer(r, A)
    squeeze = SQUEEZE - LOCAL if face > 0 else -SQUEEZE
    smooth = (CUT * z - np.sin(z)) @ (WEIGHTS * A * BEND) - np.sin(z) @ (WEIGHTS * A * squeeze)
    return smooth + (2 / np.pi * r / (1 + r**2) if face > 0 else 0)


CASES = {"beam": 1.2, "rigid": 0.9, "elastic": 1.3}  # approximate lengths


def loads_of(case):
    """Number of half-planes that the reaction indents: the face of the strip, the base."""
    return (case != "beam") + (case != "rigid")


def gauss_chebyshev(case, points, bracket, pressed=0.0):
    """Contact half-length, places and reaction by the singular integral equation of the slopes.

    The reaction is ``sqrt(c^2 - x^2)`` times a polynomial, and c is right when it carries the load:
    one force, or a pressure 1 where ``|x| < pressed``.
    """
    half = points // 2
    angle = np.pi * np.arange(1, points + 1) / (points + 1)
    node, place = np.cos(angle), np.cos(angle - angle[0] / 2)[:half]

    def reaction(c):
        distance, x = c * (place[:, None] - node), c * place
        slope = (lambda r, face: 3 * r * np.abs(r)) if case == "beam" else slope_down
        matrix = slope(distance, 1) - 2 / np.pi * loads_of(case) / distance
        matrix *= c * angle[0] * np.sin(angle)
        matrix = (matrix + matrix[:, ::-1])[:, :half]
        load = slope(x, -1)
        if pressed:
            load = pushed_down(x + pressed, -1) - pushed_down(x - pressed, -1)
        return np.linalg.solve(matrix, load)

    def imbalance(c):
        return 2 * c * angle[0] * np.sin(angle[:half]) @ reaction(c) - (2 * pressed or 1)

    c = brentq(imbalance, *bracket, xtol=1e-12)
    return c, c * node[:half], reaction(c)


def small_elements(case, length, cells):
    """Contact half-length by elements of constant pressure; those that pull are left out."""
    width = length / cells
    x, r = width * (np.arange(cells) + 0.5), width * np.arange(2 * cells)

    def mean(integral):  # over an element
        return (integral(r + width / 2) - integral(r - width / 2)) / width

    if case == "beam":
        sinking, load = r**3, x**3  # |r|^3 / (12 D) with D = 1/12
    else:
        log1p = mean(lambda s: s * np.log1p(1 / s**2) + 2 * np.arctan(s))
        sinking, load = pushed_down(r, 1) + log1p / np.pi, pushed_down(x, -1)
    if case != "rigid":
        sinking = sinking - 2 / np.pi * mean(lambda s: s * np.log(np.abs(s)) - s)
    i = np.arange(cells)
    matrix = width * (sinking[np.abs(i[:, None] - i)] + sinking[i[:, None] + i + 1])
    for n in range(cells, 0, -1):
        system = np.ones((n + 1, n + 1))  # for the reactions and a rigid motion
        system[:n, :n], system[n, :n], system[n, n] = matrix[:n, :n], 2 * width, 0
        *pressure, rigid = np.linalg.solve(system, np.append(load[:n], 1.0))
        if min(pressure) >= 0:
            break
    gap = matrix[:, :n] @ pressure + rigid - load
    assert gap[n:].min() > 0
    before, last = np.square(pressure[-2:])
    return x[n - 1] + width * last / (before - last)  # end of a square root


@pytest.mark.parametrize("case", CASES)
def test_contact_length_by_two_methods(case):
    if case == "beam":
        length = reference.beam_contact_length(1.0, 1.0, 0.0, 1.0, 0.0)
    else:
        length = reference.strip_contact_length(1.0, case)
    points = 80 if case == "beam" else 20
    by_elements = small_elements(case, 1.25 * CASES[case], 150)
    by_series, _, reaction = gauss_chebyshev(case, points, (0.97 * by_elements, 1.03 * by_elements))
    assert (reaction > 0).all()
    np.testing.assert_allclose(length, by_series, atol=6e-6)
    np.testing.assert_allclose(length, by_elements, atol=1.5e-3)


def test_the_kernels_of_contact_hold_filons_mid_plane():
    """A strip of height h bonded to a rigid base is half of one of height 2 h."""
    a = A[(A > 0.1) & (A < 15)]
    bend, squeeze = ((np.cosh(a) + s) / (np.sinh(a) - s * a) for s in (1, -1))
    np.testing.assert_allclose(
        (bend - squeeze) / (bend + squeeze), reference.filon_midplane(a), rtol=1e-9, atol=1e-12
    )


def test_contact_of_a_pressed_strip_is_what_finite_elements_find():
    """Table b3 has pressure over 25 h from the middle; the edge sees no more than 4 h of it."""
    pressed = 4.0
    length, x, reaction = gauss_chebyshev("rigid", 80, (4.3, 4.5), pressed)
    assert (reaction > 0).all()
    rows, finest = table("b3"), table("b3_convergence")[-1]
    end = 50 + 2 * (length - pressed)
    assert finest["xc_pressure"] - 0.003 < end < finest["xc_gap"] + 0.003
    x = 50 + 2 * (x - pressed)
    near = (x > 46) & (x < end - 0.1)
    fe = 100 * reaction[near] - np.interp(x[near], rows["x_mm"], rows["R"])
    assert np.abs(fe).max() < 0.15
    assert abs(100 * reaction.max() - rows["R"].max()) < 0.05


def test_beam_contact_length_of_two_materials():
    length = reference.beam_contact_length(3.0, 70.0, 0.33, 210.0, 0.3)
    ratio = 70 / (1 - 0.33**2) / (210 / (1 - 0.3**2))
    np.testing.assert_allclose(length, 3 * 1.22452 * np.cbrt(ratio), rtol=1e-14)
    printed = reference.beam_contact_length(3.0, 70.0, 0.33, 210.0, 0.3, coefficient="printed")
    np.testing.assert_allclose(printed / length, 1.845 / 1.22452, rtol=1e-14)


def test_bilateral_contact_ends_where_filons_mid_plane_pulls():
    """The stress under a force is the derivative of that at a load edge."""
    stress = jax.grad(reference.filon_midplane_step)
    zero = reference.strip_contact_length(1.0, "bilateral")
    assert abs(zero - 1.338) < 5e-4
    assert abs(stress(zero)) < 1e-12
    assert stress(zero - 0.01) < 0 < stress(zero + 0.01)
    rows = table("exact_step")
    assert abs(rows["t"][rows["midplane"].argmin()] - zero) <= 0.01
    assert abs(reference.strip_contact_length(1.0, "quoted") - zero) < 0.013
    compiled = jax.jit(jax.value_and_grad(reference.strip_contact_length), static_argnums=1)
    np.testing.assert_allclose(compiled(2.5, "bilateral"), (2.5 * zero, zero))


def test_contact_lengths_name_unknown_choices():
    with pytest.raises(ValueError, match=r"\['printed', 'recomputed'\], not 'exact'"):
        reference.beam_contact_length(1.0, 1.0, 0.3, 1.0, 0.3, coefficient="exact")
    with pytest.raises(
        ValueError, match=r"'bilateral', 'elastic', 'quoted', 'rigid'\], not 'soft'"
    ):
        reference.strip_contact_length(1.0, "soft")
