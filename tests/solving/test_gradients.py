"""Derivatives of a whole load path: Taylor slopes, forward against reverse, batches."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from jbeamshell.mechanics.friction import ElasticSlip

SMALL = {"model.nodes": 41, "load.steps_per_half_cycle": 20, "load.cycles": 1}
KEYS = ("contact.friction", "strip.height_ratio", "strip.kappa_s", "contact.stick_stiffness")
AT = jnp.array([0.1, 0.1126, 0.44, 900.0])


def dissipation(values, **more):
    scene = STRIP.replace(SMALL | more | dict(zip(KEYS, values, strict=True)))
    return jb.solve(scene, throw=False).dissipation


# Compiled once for all that needs them.
SHARP = jax.jit(jax.value_and_grad(dissipation))
OF_SCENE = jax.jit(jax.value_and_grad(lambda scene: jb.solve(scene, throw=False).dissipation))
TABLE = jnp.array([[0.0, 10.0], [1.0, 9.0], [2.0, 10.0]])
SCENE = jb.Scene(
    contact=jb.Contact(pressure=TABLE, stick_stiffness=900.0, law=ElasticSlip(16.0)),
    load=jb.Load(steps_per_half_cycle=20, cycles=1),
    model=jb.Model(nodes=41, kinematics="linear", by="steps"),
)


def smooth(values):
    """Value and gradient of a smooth law by `KEYS`, from the gradient of the whole scene."""

    def scene(values):
        return SCENE.replace(dict(zip(KEYS, values, strict=True)))

    value, gradient = OF_SCENE(scene(values))
    return value, jax.vjp(scene, values)[1](gradient)[0]


@pytest.mark.parametrize(
    "both",
    [pytest.param(SHARP, marks=pytest.mark.slow, id="sharp"), pytest.param(smooth, id="16.0")],
)
def test_gradients_have_taylor_slope_two(both):
    value, gradient = both(AT)
    for i in range(len(KEYS)):
        direction = jnp.zeros(4).at[i].set(AT[i])
        # Small enough that no node changes between sticking and slipping on the way.
        sizes = np.array([4e-4, 2e-4, 1e-4, 5e-5])
        rest = [
            abs(float(both(AT + h * direction)[0] - value - h * gradient @ direction))
            for h in sizes
        ]
        slope = np.polyfit(np.log(sizes), np.log(rest), 1)[0]
        assert slope == pytest.approx(2.0, abs=0.1), KEYS[i]


@pytest.mark.slow
def test_forward_and_reverse_agree_and_batches_equal_loops():
    reverse, forward = SHARP(AT)[1], jax.jit(jax.jacfwd(dissipation))(AT)
    np.testing.assert_allclose(forward, reverse, rtol=1e-8)
    points = AT * jnp.array([[1.0], [1.1], [0.8]])
    batch = jax.jit(jax.vmap(dissipation))(points)
    single = jnp.stack([SHARP(p)[0] for p in points])
    np.testing.assert_allclose(batch, single, rtol=1e-10)


def test_gradient_reaches_every_number_of_a_scene():
    gradient = OF_SCENE(SCENE)[1]
    leaves, names = jax.tree.leaves(gradient), jax.tree_util.tree_flatten_with_path(SCENE)[0]
    moved = {path[-1].name for (path, _), leaf in zip(names, leaves, strict=True) if leaf.any()}
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in leaves)
    # A rigid foundation has no use for this one.
    assert {path[-1].name for path, _ in names} - moved == {"normal_stiffness"}


BAR = jb.Scene().replace({"model.section": "bar"})


@pytest.mark.parametrize(
    ("scene", "status"),
    [
        (BAR, jb.Status.MAX_ITERATIONS),
        pytest.param(STRIP, jb.Status.NOT_REACHED, marks=pytest.mark.slow),
    ],
    ids=["contact line", "load steps"],
)
def test_a_traced_force_beyond_gross_slip_has_no_result(scene, status):
    few = {"model.nodes": 9, "model.kinematics": "linear", "load.steps_per_half_cycle": 2}
    ask = jb.response(scene.replace(few), ["contact.friction"])
    both = jax.jit(jax.vmap(ask))(jnp.array([0.04, 0.039]))  # mu F_N L = 0.8 and 0.78
    assert both["status"].tolist() == [0, status]
    assert np.isnan(both["dissipation"]).tolist() == [False, True]


def test_a_lane_that_fails_has_no_derivative():
    few = {"model.nodes": 9, "model.kinematics": "linear", "load.steps_per_half_cycle": 2}
    keys = ["contact.friction", "load.amplitude", "strip.axial_stiffness"]
    ask = jb.response(BAR.replace(few), keys)

    def dissipation(*values):
        return ask(*values)["dissipation"]

    mu = jnp.array([0.1, 0.03])
    slopes = jax.jit(jax.vmap(jax.grad(dissipation, (0, 1, 2)), (0, None, None)))(mu, 0.7, 3e4)
    assert np.isnan(slopes).tolist() == [[False, True]] * 3


def test_a_response_takes_one_number_of_each_key():
    ask = jb.response(STRIP, ["contact.friction", "load.amplitude"])
    with pytest.raises(jb.InputError, match=r"contact.friction: is an array of shape \(2,\): give"):
        ask(jnp.array([0.1, 0.2]), 1.0)
    with pytest.raises(jb.InputError, match="needs as many numbers, not 1"):
        ask(0.1)
