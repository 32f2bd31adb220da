"""Many loads on one body beside each load by itself."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.contact_line import branches, events, strip

SCENE = jb.Scene().replace(
    {
        "model.section": "squeeze",
        "model.kinematics": "linear",
        "strip.height_ratio": 0.3,
        "strip.far_end": "free",
        "contact.friction": 0.3,
    }
)
UNIT = jnp.asarray([1.0, 0.0, -1.0, 0.0, 1.0, -1.0, 1.0])
TURNED = (True, True, False, True, False, True, True)
GROSS = 6.0


@pytest.fixture(scope="module")
def body():
    return jax.jit(lambda scene: strip.condensed(scene, 21).body)(SCENE)


def walked(body, amplitude, turns):
    return events.walk(body, jnp.asarray(0.3), branches.pressed(body), amplitude * UNIT, turns)


LOADS = jnp.asarray([0.9, 5.0, 2.1, 0.0, 5.1, 5.6, 3.6, 1.1 * GROSS, -2.7, jnp.nan])


@jax.jit
def all_of(body):
    return jax.vmap(lambda amplitude: walked(body, amplitude, TURNED))(LOADS)


@pytest.fixture(scope="module")
def together(body):
    alone = jax.jit(lambda amplitude: walked(body, amplitude, jnp.asarray(TURNED)))
    return all_of(body), [alone(amplitude) for amplitude in LOADS]


@pytest.mark.parametrize("number", [0, 1, 2, 3, 4, 5, 6, 8])
def test_a_load_among_many_is_the_load_by_itself(together, number):
    many, alone = together
    found, expected = jax.tree.map(lambda a: a[number], many), alone[number]
    assert np.all(expected.settled)
    # Where a node begins to slip at the very end of a branch, round-off says whether it slips yet.
    step = np.abs(np.diff(np.asarray(expected.state.v), axis=0, prepend=0.0))
    slips = step > 1e-9 * np.max(step)
    found, expected = (
        level._replace(slipping=level.slipping & slips) for level in (found, expected)
    )
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * (1e-12 + np.max(abs(other))))


def test_loads_lift_off_at_different_events(together):
    many, _ = together
    opened = np.sum(np.asarray(many.lift) > 0.0, axis=2)
    assert len({tuple(row) for row in opened}) > 2


def test_a_load_that_slides_is_told_and_spoils_no_other(together):
    many, alone = together
    np.testing.assert_array_equal(many.settled[7], alone[7].settled)
    assert not many.settled[7].all()
    assert many.settled[:9][np.arange(9) != 7].all()


def test_a_load_without_a_number_comes_to_an_end_and_is_told(together):
    many, _ = together
    assert not many.settled[9].any()


def test_a_body_without_numbers_comes_to_an_end_and_is_told(body):
    assert not all_of(jax.tree.map(lambda a: jnp.nan * a, body)).settled.any()


def test_a_closed_loop_is_walked_once_and_its_copy_is_exact(body):
    path = jnp.asarray([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0])

    @jax.jit
    def both(amplitude):
        given = body, jnp.asarray(0.3), branches.pressed(body), amplitude * path
        return events.walk(*given, (True,) * 7), events.walk(*given, jnp.ones(7, bool))

    copied, walked_again = both(3.0)
    assert copied.slip_work[5] == copied.slip_work[3]
    np.testing.assert_allclose(copied.slip_work, walked_again.slip_work, rtol=1e-9)
    np.testing.assert_allclose(copied.state.r_n, walked_again.state.r_n, atol=1e-9)
