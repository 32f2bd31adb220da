"""Laminated section against plane elasticity, its homogeneous limit and the bimetal strip."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jbeamshell.common.errors import InputError
from jbeamshell.mechanics.homogeneous import PLANES, Homogeneous, forces, shear_coefficient
from jbeamshell.mechanics.kinematics import Strains
from jbeamshell.mechanics.laminate import Laminate
from jbeamshell.scene.layers import check_layers

KAPPA_S = 0.44
SAMPLES = 200
RATIOS = np.array([1e-6, 1e-3, 0.01, 0.3, 1.0, 1.7, 10.0, 100.0, 1e4, 1e6])
GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(4)


# Batches of one size share one compilation.
@eqx.filter_jit
@jax.vmap
def _evaluate(energy, strains):
    return energy(*strains), forces(energy, strains)


def evaluate(energies, strains):
    """Energies Phi of a batch of sections."""
    return _evaluate(energies, strains)[0]


def evaluate_forces(energies, strains):
    """Section forces of a batch of sections."""
    return _evaluate(energies, strains)[1]


squeeze_each = eqx.filter_jit(jax.vmap(Laminate.uniform_squeeze))


def random_layers(layers, count=SAMPLES, seed=0):
    """Random layers: thickness over two decades, E over four, nu over nearly its whole range."""
    rng = np.random.default_rng(seed)
    shape = (count, layers)
    thickness, modulus = 10 ** rng.uniform(-1, 1, shape), 10 ** rng.uniform(-2, 2, shape)
    return np.stack([thickness, modulus, rng.uniform(-0.9, 0.49, shape)], axis=-1)


def random_strains():
    return Strains(*np.random.default_rng(1).uniform(-1e-2, 1e-2, (5, SAMPLES)))


def laminates(layers, **choices):
    """Batch of laminates from (count, n, 3) layers."""
    return jax.vmap(lambda layers: Laminate(layers, KAPPA_S, **choices))(jnp.asarray(layers))


def in_plane(layers, plane):
    """Modulus Eb and contraction nb of a layer: E and nu in plane stress."""
    modulus, nu = layers[:, 1], layers[:, 2]
    return (modulus, nu) if plane == "stress" else (modulus / (1 - nu**2), nu / (1 - nu))


def points(layers):
    """Gauss points over the height: index of the layer, s from mid-height, weight."""
    thickness = layers[:, 0]
    top = np.cumsum(thickness)
    s = (top - 0.5 * thickness - 0.5 * top[-1])[:, None] + 0.5 * thickness[:, None] * GAUSS
    weights = 0.5 * thickness[:, None] * WEIGHTS
    return np.repeat(np.arange(len(layers)), len(GAUSS)), s.ravel(), weights.ravel()


@jax.jit
def stiffness(laminate):
    return jax.hessian(lambda s: laminate(*s))(jnp.zeros(5))


# --- limits -------------------------------------------------------------------------------------


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("squeeze", [True, False])
def test_one_layer_is_the_homogeneous_section(plane, squeeze):
    layers, strains = random_layers(1), random_strains()
    modulus, _ = in_plane(layers[:, 0], plane)

    def homogeneous(thickness, modulus, nu):
        half = 0.5 * thickness
        return Homogeneous(half, modulus, nu, KAPPA_S, squeeze=squeeze, plane=plane)

    expected = jax.vmap(homogeneous)(layers[:, 0, 0], modulus, layers[:, 0, 2])
    got = laminates(layers, plane=plane, squeeze=squeeze)
    np.testing.assert_allclose(evaluate(got, strains), evaluate(expected, strains), rtol=1e-12)
    np.testing.assert_allclose(
        evaluate_forces(got, strains), evaluate_forces(expected, strains), rtol=1e-11, atol=1e-17
    )


def test_one_layer_with_the_printed_constants():
    """Bending with C11, as sigma_y is not relaxed, and a squeeze-shear 24 times as stiff."""
    layers, strains = random_layers(1), random_strains()
    printed = evaluate_forces(laminates(layers, constants="printed"), strains)
    consistent = evaluate_forces(laminates(layers), strains)
    _, contraction = in_plane(layers[:, 0], "strain")
    np.testing.assert_allclose(printed.k * (1 - contraction**2), consistent.k, rtol=1e-11)
    np.testing.assert_allclose(printed.dpsi, 24 * consistent.dpsi, rtol=1e-11)
    for name in ("e", "g", "psi"):
        got, expected = (getattr(of, name) for of in (printed, consistent))
        np.testing.assert_allclose(got, expected, rtol=1e-10)


@pytest.mark.parametrize("constants", ["consistent", "printed"])
@pytest.mark.parametrize("plane", PLANES)
def test_equal_layers_are_one(plane, constants):
    one = random_layers(1)
    shares = np.random.default_rng(2).dirichlet(np.ones(5), SAMPLES)
    five = np.repeat(one, 5, axis=1)
    five[..., 0] *= shares
    got, expected = (
        evaluate(laminates(rows, plane=plane, constants=constants), random_strains())
        for rows in (five, one)
    )
    np.testing.assert_allclose(got, expected, rtol=1e-12)


@pytest.mark.parametrize("plane", PLANES)
def test_free_squeeze_condenses_to_the_section_without(plane):
    layers = random_layers(3)
    squeezed = laminates(layers, plane=plane)
    without = laminates(layers, plane=plane, squeeze=False)
    e, g, k, _, _ = random_strains()
    zero = np.zeros_like(e)
    chi = evaluate_forces(squeezed, Strains(e, g, k, zero, zero)).psi
    per_psi = evaluate_forces(squeezed, Strains(zero, zero, zero, zero + 1, zero)).psi
    free = Strains(e, g, k, -chi / per_psi, zero)
    np.testing.assert_allclose(evaluate(squeezed, free), evaluate(without, free), rtol=1e-12)
    of = evaluate_forces(without, Strains(e, g, k, zero + 1, zero + 1))
    np.testing.assert_array_equal((of.psi, of.dpsi), 0)


def test_public_stiffnesses():
    laminate = Laminate([[1.0, 10.0, 0.25], [3.0, 2.0, 0.0]], KAPPA_S)
    np.testing.assert_allclose(laminate.height, 4.0)
    np.testing.assert_allclose(laminate.stretching_stiffness, 10 / (1 - 0.25**2) + 6)
    np.testing.assert_allclose(laminate.mean_shear_modulus, (4.0 + 3 * 1.0) / 4)
    np.testing.assert_allclose(
        laminate.shear_coefficient, shear_coefficient((4.0 * 0.25 + 3 * 0.0) / 7)
    )


# --- uniform squeeze ----------------------------------------------------------------------------


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("nu_top", [0.3, -0.2, 0.45])
def test_two_equal_layers_bend_like_a_bimetal_strip(plane, nu_top):
    t, pressure, soft = 0.7, 3e-3, 5.0
    layers = np.array([[[t, soft, 0.3], [t, n * soft, nu_top]] for n in RATIOS])
    bottom, top = (in_plane(layers[:, i], plane) for i in (0, 1))
    free = [contraction * pressure / modulus for modulus, contraction in (bottom, top)]
    n = top[0] / bottom[0]
    bimetal = 24 / (2 * t * (14 + n + 1 / n))
    got = squeeze_each(laminates(layers, plane=plane), jnp.full(len(RATIOS), pressure))
    error = (got.k - bimetal * (free[0] - free[1])) / (bimetal * np.abs(free).max(axis=0))
    assert np.abs(error).max() < 1e-12


@pytest.mark.parametrize("plane", PLANES)
def test_uniform_squeeze_leaves_no_force_and_no_moment(plane):
    batch = laminates(random_layers(3), plane=plane)
    pressure = np.linspace(-1.0, 1.0, SAMPLES)
    strains = squeeze_each(batch, jnp.asarray(pressure))
    normal, shear, moment, chi, xi = evaluate_forces(batch, strains)
    height = np.asarray(batch.layers[..., 0].sum(axis=1))
    np.testing.assert_allclose(chi, -pressure * height, rtol=1e-9)
    np.testing.assert_allclose(normal / height, 0, atol=1e-9)
    np.testing.assert_allclose(moment / height**2, 0, atol=1e-9)
    np.testing.assert_array_equal((shear, xi), 0)


@pytest.mark.parametrize("plane", PLANES)
def test_one_psi_for_all_layers_cannot_bend_a_laminate_of_equal_nu(plane):
    """With one psi for all layers, a laminate bends only where nu differs."""
    pressure = 1e-3

    def bent(layers):
        laminate = Laminate(layers, KAPPA_S, plane=plane, constants="printed")
        e_k_psi = np.ix_([0, 2, 3], [0, 2, 3])
        load = np.array([0.0, 0.0, -pressure * laminate.height])
        k = np.linalg.solve(np.asarray(stiffness(laminate))[e_k_psi], load)[1]
        return k / laminate.uniform_squeeze(pressure).k

    for n in [0.01, 0.3, 1.7, 100.0, 1e4]:
        layers = np.array([[1.0, 1.0, 0.3], [0.6, n, 0.3], [0.9, 2 * n, 0.3]])
        assert abs(bent(layers)) < 1e-10
        layers[:, 2] = 0.3, 0.2, 0.1
        assert abs(bent(layers)) > 1e-3


# --- the condensed energy against plane elasticity -----------------------------------------------


def least_energy(layers, plane, e, k, psi, shared):
    """Minimum over eps_y of the plane energy, its mean psi: energy and sigma_y at the points.

    `shared` lists the Gauss points that share an eps_y.  The minimum solves a linear system with
    the mean as a constraint; nothing of uniform stress is put in.
    """
    layer, s, weights = points(layers)
    modulus, contraction = (values[layer] for values in in_plane(layers, plane))
    c11 = modulus / (1 - contraction**2)
    eps_x = e - s * k
    spread = np.eye(shared.max() + 1)[shared]
    mean = weights / weights.sum() @ spread
    rows = len(mean)
    system = np.zeros((rows + 1, rows + 1))
    system[:rows, :rows] = spread.T @ (weights * c11 * spread.T).T
    system[:rows, rows] = system[rows, :rows] = mean
    load = np.append(-spread.T @ (weights * c11 * contraction * eps_x), psi)
    eps_y = spread @ np.linalg.solve(system, load)[:rows]
    stored = 0.5 * weights @ (c11 * (eps_x**2 + 2 * contraction * eps_x * eps_y + eps_y**2))
    return stored, c11 * (eps_y + contraction * eps_x)


@pytest.mark.parametrize("plane", PLANES)
def test_energy_is_the_least_plane_energy_of_that_mean_squeeze(plane):
    batch = random_layers(3)
    e, g, k, psi, dpsi = random_strains()
    strains = Strains(e, 0 * g, k, psi, 0 * dpsi)
    consistent = laminates(batch, plane=plane)
    stored, chi = evaluate(consistent, strains), evaluate_forces(consistent, strains).psi
    printed = evaluate(laminates(batch, plane=plane, constants="printed"), strains)
    for i, layers in enumerate(batch[:40]):
        layer = points(layers)[0]
        height = layers[:, 0].sum()
        case = layers, plane, e[i], k[i], psi[i]
        pointwise, sigma_y = least_energy(*case, np.arange(len(layer)))
        per_layer, _ = least_energy(*case, layer)
        shared, _ = least_energy(*case, 0 * layer)
        np.testing.assert_allclose(stored[i], pointwise, rtol=1e-11)
        np.testing.assert_allclose(sigma_y, chi[i] / height, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(printed[i], shared, rtol=1e-11)
        assert stored[i] < per_layer
        assert per_layer <= shared * (1 + 1e-12)


def test_uniform_strains_of_one_layer_store_the_plane_stress_energy():
    layers, strains = random_layers(1), random_strains()
    layers[::2, 0, 2] = 0.5
    thickness, modulus, nu = layers[:, 0].T
    e, psi = strains.e, strains.psi
    sigma_x, sigma_y = np.array([e + nu * psi, nu * e + psi]) * modulus / (1 - nu**2)
    flat = strains._replace(g=0 * e, k=0 * e, dpsi=0 * e)
    of = evaluate_forces(laminates(layers, plane="stress"), flat)
    np.testing.assert_allclose(of.e, thickness * sigma_x, rtol=1e-10)
    np.testing.assert_allclose(of.psi, thickness * sigma_y, rtol=1e-10)


# --- shear and symmetry --------------------------------------------------------------------------


def shear_points(layers):
    """Quadrature weights times G, their s, and kappa at the G-weighted mean of nu."""
    layer, s, weights = points(layers)
    rigidity = weights * (layers[:, 1] / (2 * (1 + layers[:, 2])))[layer]
    return rigidity, s, shear_coefficient(rigidity @ layers[layer, 2] / rigidity.sum())


def sheared(strains):
    return strains._replace(e=0 * strains.e, k=0 * strains.k, psi=0 * strains.psi)


def test_the_shear_is_split_at_mid_height():
    """Shear energy in three terms by quadrature."""
    batch, strains = random_layers(3), sheared(random_strains())
    consistent, printed, without = (
        evaluate(laminates(batch, **choices), strains)
        for choices in ({}, {"constants": "printed"}, {"squeeze": False})
    )
    for i, layers in enumerate(batch[:20]):
        rigidity, s, kappa = shear_points(layers)
        g, dpsi = strains.g[i], strains.dpsi[i]
        mean = 0.5 * kappa * g**2 * rigidity.sum()
        both = np.sqrt(kappa * KAPPA_S) * g * dpsi * (rigidity @ s)
        squeeze = 0.5 * KAPPA_S * dpsi**2 * (rigidity @ s**2)
        np.testing.assert_allclose(consistent[i], mean + both + squeeze, rtol=1e-11)
        np.testing.assert_allclose(printed[i], mean + 24 * squeeze, rtol=1e-11)
        np.testing.assert_allclose(without[i], mean, rtol=1e-11)


def test_equal_shear_factors_make_one_square():
    layers, strains = random_layers(3)[0], Strains(*jnp.array([0.0, 3e-3, 0.0, 0.0, 2e-3]))
    rigidity, s, kappa = shear_points(layers)
    expected = 0.5 * kappa * rigidity @ (strains.g + s * strains.dpsi) ** 2
    np.testing.assert_allclose(Laminate(layers, kappa)(*strains), expected, rtol=1e-12)


@pytest.mark.parametrize("constants", ["consistent", "printed"])
@pytest.mark.parametrize("plane", PLANES)
def test_positive_definite(plane, constants):
    batch = random_layers(3)
    sections = laminates(batch, plane=plane, constants=constants)
    of = np.asarray(eqx.filter_jit(jax.vmap(stiffness))(sections))
    np.testing.assert_allclose(of, of.transpose(0, 2, 1))
    scale = 1 / np.sqrt(np.diagonal(of, axis1=1, axis2=2))
    assert np.linalg.eigvalsh(scale[:, :, None] * of * scale[:, None, :]).min() > 1e-8


@pytest.mark.parametrize("constants", ["consistent", "printed"])
@pytest.mark.parametrize("plane", PLANES)
def test_upside_down(plane, constants):
    """In a laminate turned over, s, k and g change sign; e, psi and psi' do not."""
    batch, strains = random_layers(3), random_strains()
    choices = {"plane": plane, "constants": constants}
    upright, over = laminates(batch, **choices), laminates(batch[:, ::-1], **choices)
    turned = strains._replace(k=-strains.k, g=-strains.g)
    np.testing.assert_allclose(evaluate(over, turned), evaluate(upright, strains), rtol=1e-11)
    of, of_over = evaluate_forces(upright, strains), evaluate_forces(over, turned)
    np.testing.assert_allclose(
        of_over._replace(k=-of_over.k, g=-of_over.g), of, rtol=1e-9, atol=1e-12
    )
    pressed, pressed_over = (squeeze_each(batch, jnp.ones(SAMPLES)) for batch in (upright, over))
    np.testing.assert_allclose(
        pressed_over._replace(k=-pressed_over.k), pressed, rtol=1e-9, atol=1e-12
    )


# --- gradients -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("plane", "constants"), [("strain", "consistent"), ("stress", "printed")])
def test_gradients_with_respect_to_every_number(plane, constants):
    layers = jnp.array([[0.3, 2.0, 0.3], [1.1, 40.0, 0.1], [0.2, 0.7, -0.4]])
    laminate = Laminate(layers, KAPPA_S, plane=plane, constants=constants)
    strains = jnp.array([1.1e-3, -0.7e-3, 2.3e-3, 0.9e-3, -1.7e-3])

    @eqx.filter_jit
    def outcome(laminate):
        squeezed = laminate.uniform_squeeze(1e-3)
        return jnp.stack([1e3 * laminate(*strains), squeezed.e, squeezed.k, squeezed.psi])

    of = eqx.filter_jit(jax.jacrev(outcome))(laminate)
    assert all((np.abs(np.asarray(leaf)).sum() > 0) for leaf in jax.tree.leaves(of))
    leaves, structure = jax.tree.flatten(laminate)
    for place, leaf in enumerate(leaves):
        for index in np.ndindex(leaf.shape):
            step = 1e-5 * abs(leaf[index])
            ends = []
            for side in (-1, 1):
                moved = [*leaves]
                moved[place] = leaf.at[index].add(side * step)
                ends.append(outcome(jax.tree.unflatten(structure, moved)))
            expected = (ends[1] - ends[0]) / (2 * step)
            got = jax.tree.leaves(of)[place][(slice(None), *index)]
            np.testing.assert_allclose(got, expected, rtol=1e-5, atol=1e-9)


# --- layers that are refused ---------------------------------------------------------------------


def test_traced_layers_and_heights_are_left_unchecked():
    bad = jnp.array([[1.0, -5.0, 0.3]])
    jax.jit(lambda layers: check_layers(layers, 2.0, "strain"))(bad)
    good = jnp.array([[1.0, 5.0, 0.3]])
    jax.jit(lambda height: check_layers(good, height, "strain"))(2.0)
    with pytest.raises(InputError, match="the E must"):
        jax.jit(lambda height: check_layers(bad, height, "strain"))(2.0)


@pytest.mark.parametrize(
    ("choice", "line"),
    [
        ({"plane": "Stress"}, "plane = 'Stress': choose 'strain' or 'stress'"),
        ({"constants": "exact"}, "constants = 'exact': choose 'consistent' or 'printed'"),
    ],
)
def test_unknown_choices(choice, line):
    with pytest.raises(InputError) as refusal:
        Laminate([[1.0, 5.0, 0.3]], KAPPA_S, **choice)
    assert str(refusal.value) == line
