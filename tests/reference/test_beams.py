"""Closed forms of beams against their differential equations, each other and other solvers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

from jbeamshell import reference

EA, Q, LENGTH = 3.4e4, 1.0, 2.0
NU = 0.3
FIGURE_3_11 = np.array(
    [0.0305, 0.0716, 0.1126, 0.1537, 0.1947, 0.2358, 0.2768, 0.3179, 0.3589, 0.4000]
)


def strip(eta):
    """Half height H, E', G and kappa of the standard strip."""
    half_height = eta * LENGTH / 2
    youngs = EA / (2 * half_height)
    return half_height, youngs, youngs * (1 - NU) / 2, float(reference.shear_coefficient(NU))


def test_shear_coefficient_of_a_rectangle():
    np.testing.assert_allclose(reference.shear_coefficient(0.0), 5 / 6)
    np.testing.assert_allclose(reference.shear_coefficient(0.3), 13 / 15.3, rtol=1e-14)


def test_bar_backbone_is_odd_and_is_the_end_of_the_slip_profile():
    force = jnp.array([-1.9, -0.3, 0.0, 0.7, 1.6])
    ends = reference.bar_slip_profile(LENGTH, force, LENGTH, EA, Q)
    np.testing.assert_allclose(reference.bar_backbone(force, EA, Q), ends, rtol=1e-14)
    assert (jnp.sign(ends) == jnp.sign(force)).all()


@pytest.mark.parametrize("force", [1.3, -0.6])
def test_slip_profile_balances_forces(force):
    def profile(x):
        return reference.bar_slip_profile(x, force, LENGTH, EA, Q)

    inner = LENGTH - float(reference.bar_slip_length(force, Q))
    stuck, slipping = jnp.linspace(0, inner, 9), jnp.linspace(inner + 1e-9, LENGTH, 9)
    strain, curvature = (
        jax.jit(jax.vmap(f)) for f in (jax.grad(profile), jax.grad(jax.grad(profile)))
    )

    np.testing.assert_array_equal(profile(stuck), 0)
    np.testing.assert_allclose(EA * curvature(slipping), np.sign(force) * Q, rtol=1e-12)
    axial = EA * strain(slipping)
    np.testing.assert_allclose(axial, np.sign(force) * Q * (slipping - inner), atol=1e-12)
    np.testing.assert_allclose(axial[-1], force, rtol=1e-12)


def test_gross_slip_is_the_slip_zone_reaching_the_held_end():
    np.testing.assert_allclose(reference.bar_slip_length(0.1 * 10.0 * LENGTH, 0.1 * 10.0), LENGTH)


def test_masing_of_the_bar_is_the_cubic_law():
    @jax.jit
    def lost(force):
        return reference.masing_dissipation(force, reference.bar_backbone(force, EA, Q))

    for amplitude in (0.1, 1.9):
        law = reference.cubic_law(amplitude, EA, Q)
        graded = amplitude * np.linspace(0, 1, 21) ** 1.7
        for force in (graded, -graded):
            np.testing.assert_allclose(lost(force), law, rtol=1e-13)


def test_masing_dissipation_is_exact_for_cubics_on_a_uniform_table():
    force = jnp.linspace(0, 1.5, 7)
    # 4 A u(A) - 8 A^4/4 for u = F^3
    np.testing.assert_allclose(
        reference.masing_dissipation(force, force**3), 2 * 1.5**4, rtol=1e-13
    )
    np.testing.assert_allclose(reference.masing_dissipation(force, force), 0, atol=1e-14)


def test_bar_hysteresis_closes_and_encloses_the_cubic_law():
    amplitude, points = 1.6, 101
    force, displacement = reference.bar_hysteresis(amplitude, EA, Q, points)
    unload, reload = force[:points], force[points - 1 :]

    assert force.shape == displacement.shape == (2 * points - 1,)
    assert (jnp.diff(unload) < 0).all()
    assert (jnp.diff(reload) > 0).all()
    tip = reference.bar_backbone(amplitude, EA, Q)
    ends = displacement[jnp.array([0, points - 1, -1])]
    np.testing.assert_allclose(ends, tip * np.array([1, -1, 1]), rtol=1e-12)
    area = jnp.trapezoid(force, displacement)  # chords of a parabola miss 1 / intervals^2
    np.testing.assert_allclose(
        area, reference.cubic_law(amplitude, EA, Q), rtol=2 / (points - 1) ** 2
    )


def test_masing_loop_is_what_sliders_in_parallel_do():
    """Jenkins elements stepped along the load path give the loop of Masing's rule."""
    stiffness, cap, slip = np.array([3.0, 2.0, 1.0]), np.array([0.3, 0.9, 5.0]), np.zeros(3)
    first = np.linspace(0, 1.2, 25)
    path = np.concatenate([first, first[-2::-1], -first[1:], -first[-2::-1], first[1:]])
    stepped = []
    for u in path:
        spring = np.clip(stiffness * (u - slip), -cap, cap)
        slip = u - spring / stiffness
        stepped.append(spring.sum())

    force, displacement = reference.masing_loop(np.array(stepped[:25]), first)
    np.testing.assert_allclose(displacement, path[24::2], atol=1e-14)
    np.testing.assert_allclose(force, stepped[24::2], atol=1e-13)


def test_backbone_tables_that_cannot_be_meant_are_refused():
    line = jnp.linspace(0, 1, 6)
    with pytest.raises(ValueError, match="odd number of points, at least 3, not 6"):
        reference.masing_dissipation(line, line)
    with pytest.raises(ValueError, match="not 1"):
        reference.masing_dissipation(line[:1], line[:1])
    with pytest.raises(ValueError, match=r"\(6,\), \(1,\)"):
        reference.masing_loop(line, line[:1])


def test_stuck_decay_rate_with_and_without_a_bending_stiffness():
    half_height, youngs, shear, kappa = strip(0.1126)
    classical = 2 / 3 * youngs * half_height**3
    expected = np.sqrt(2 * kappa * shear * half_height / (8 / 3 * youngs * half_height**3))
    rates = [
        reference.stuck_decay_rate(half_height, youngs, shear, kappa, bending)
        for bending in (None, classical, 10 * classical)
    ]
    np.testing.assert_allclose(rates[:2], expected, rtol=1e-14)
    np.testing.assert_allclose(rates[2], expected * np.sqrt(1 / 3.25), rtol=1e-14)


@pytest.mark.parametrize("bending_over_classical", [None, 1 / 16, 3.0])
def test_stuck_rotation_solves_its_equation(bending_over_classical):
    half_height, youngs, shear, kappa = strip(0.4)
    classical = 2 / 3 * youngs * half_height**3
    bending = None if bending_over_classical is None else bending_over_classical * classical
    stiffness = 2 * youngs * half_height**3 + (classical if bending is None else bending)
    force = 0.7

    def beta(x):
        return reference.stuck_rotation(
            x, force, LENGTH, half_height, youngs, shear, kappa, bending
        )

    slope = jax.grad(beta)
    of_point = jax.jit(jax.vmap(lambda x: (beta(x), slope(x), jax.grad(slope)(x))))
    value, first, second = map(np.asarray, of_point(np.linspace(0, LENGTH, 13)))
    right = 2 * kappa * shear * half_height * value
    np.testing.assert_allclose(stiffness * second, right, rtol=1e-11, atol=1e-14)
    assert value[0] == 0
    np.testing.assert_allclose(stiffness * first[-1], -force * half_height, rtol=1e-12)


def test_stuck_rotation_minimises_the_discretised_energy():
    """Linear elements minimise the energy of the section strains, without the equation."""
    half_height, youngs, shear, kappa = strip(0.2358)
    force, cells = 0.5, 400
    step = LENGTH / cells

    def energy(rotation):
        beta = jnp.concatenate([jnp.zeros(1), rotation])
        slope, middle = jnp.diff(beta) / step, (beta[1:] + beta[:-1]) / 2
        stretch = half_height * youngs * (half_height * slope) ** 2
        bend = youngs * half_height**3 / 3 * slope**2
        section = stretch + bend + kappa * shear * half_height * middle**2
        return step * section.sum() + force * half_height * beta[-1]

    matrix, right = jax.jit(lambda at: (jax.hessian(energy)(at), jax.grad(energy)(at)))(
        np.zeros(cells)
    )
    rotation = -np.linalg.solve(matrix, right)
    x = np.linspace(0, LENGTH, cells + 1)[1:]
    rotated = jax.jit(reference.stuck_rotation)
    exact = np.asarray(rotated(x, force, LENGTH, half_height, youngs, shear, kappa))
    np.testing.assert_allclose(rotation, exact, atol=1.2e-5 * abs(exact[-1]))


def test_stuck_rotation_does_not_overflow():
    half_height, *material = strip(9e-5)
    decay = reference.stuck_decay_rate(half_height, *material)
    assert decay * LENGTH > 1e4
    x = np.array([0.0, 0.5, 1.0]) * LENGTH

    def beta(x):
        return reference.stuck_rotation(x, 1.0, LENGTH, half_height, *material)

    slope = -half_height / (8 / 3 * material[0] * half_height**3)
    value, first = jax.jit(jax.vmap(jax.value_and_grad(beta)))(x)
    np.testing.assert_allclose(value, [0, 0, slope / decay], rtol=1e-12)
    np.testing.assert_allclose(first, [0, 0, slope], rtol=1e-12)


@pytest.mark.parametrize(
    ("constants", "slope", "intercept"),
    [("printed", 1.768, -0.0015), ("consistent", 2.693, -0.0047)],
)
def test_first_slip_force_fits_a_line(constants, slope, intercept):
    force = reference.first_slip_force(FIGURE_3_11, constants=constants)
    fitted = np.polyfit(FIGURE_3_11, np.asarray(force), 1)
    assert abs(fitted[0] - slope) < 0.002
    assert abs(fitted[1] - intercept) < 0.0003


def test_printed_first_slip_is_the_printed_line():
    """Line of Brink 2015, eq. 3.65, within the deviation of the curve from it."""
    force = reference.first_slip_force(FIGURE_3_11, constants="printed")
    np.testing.assert_allclose(force, 1.767 * FIGURE_3_11 - 0.0013, atol=0.005)


def test_consistent_first_slip_of_the_standard_strip():
    expected = FIGURE_3_11 / (0.3542 * np.tanh(0.4723 * LENGTH / FIGURE_3_11) + 0.0223)
    np.testing.assert_allclose(reference.first_slip_force(FIGURE_3_11), expected, rtol=2e-4)


@pytest.mark.parametrize(("constants", "bending_share"), [("consistent", 1.0), ("printed", 1 / 16)])
@pytest.mark.parametrize(("length", "friction", "pressure"), [(2.0, 0.1, 10.0), (3.0, 0.6, 4.0)])
def test_first_slip_force_by_a_boundary_value_solver(
    constants, bending_share, length, friction, pressure
):
    eta = 0.4
    half_height = eta * length / 2
    youngs = EA / (2 * half_height)
    shear, kappa = youngs * (1 - NU) / 2, 10 * (1 + NU) / (12 + 11 * NU)
    bending = bending_share * 2 / 3 * youngs * half_height**3
    stretch_moment = 2 * youngs * half_height**3

    def margin(force):
        """Largest excess of |t| over mu R along the stuck strip, from the solver's beta."""
        end_slope = {
            "consistent": -force * half_height / (stretch_moment + bending),
            "printed": -force / (2 * youngs * half_height**2),
        }[constants]
        ratio = 2 * kappa * shear * half_height / (stretch_moment + bending)
        solution = solve_bvp(
            lambda x, y: np.vstack([y[1], ratio * y[0]]),
            lambda held, loaded: np.array([held[0], (loaded[1] - end_slope) / abs(end_slope)]),
            np.linspace(0, length, 201),
            np.zeros((2, 201)),
            tol=1e-9,
        )
        assert solution.success
        slope, curvature = solution.sol(solution.x)[1], solution.sol(solution.x, 1)[1]
        traction = -2 * youngs * half_height**2 * curvature
        reaction = pressure + 2 * kappa * shear * half_height * slope
        return np.max(np.abs(traction) - friction * reaction)

    force = brentq(margin, 1e-3, 10.0, xtol=1e-9)
    expected = reference.first_slip_force(
        eta, length=length, friction=friction, pressure=pressure, constants=constants
    )
    np.testing.assert_allclose(expected, force, rtol=1e-6)


def test_first_slip_force_names_an_unknown_choice():
    with pytest.raises(ValueError, match=r"\['consistent', 'printed'\], not 'exact'"):
        reference.first_slip_force(0.1, constants="exact")


def test_closed_forms_differentiate():
    grad = jax.jit(jax.grad(reference.first_slip_force))(0.1126)
    difference = (reference.first_slip_force(0.1136) - reference.first_slip_force(0.1116)) / 0.002
    np.testing.assert_allclose(grad, difference, rtol=1e-5)

    force = np.linspace(0, 1.0, 11)
    slope = jax.jit(
        jax.grad(
            lambda q: reference.masing_dissipation(force, reference.bar_backbone(force, EA, q))
        )
    )(Q)
    np.testing.assert_allclose(slope, -reference.cubic_law(1.0, EA, Q) / Q, rtol=1e-12)
