"""Numbers as leaves, which are made once, and copies that are not checked anew."""

import jax
import jax.numpy as jnp
import numpy as np

import jbeamshell as jb
from jbeamshell.common.checks import as_leaf


def test_zero_keeps_its_sign():
    assert not np.signbit(np.asarray(as_leaf(0.0)))
    assert np.signbit(np.asarray(as_leaf(-0.0)))


def test_a_leaf_has_the_precision_of_its_time():
    assert as_leaf(0.1).dtype == np.float64
    with jax.enable_x64(False):
        assert as_leaf(0.1).dtype == np.float32
        assert jb.Scene().strip.length.dtype == np.float32
    assert jb.Scene().strip.length.dtype == np.float64


def test_a_number_inside_a_transformation_is_known_there_and_afterwards():
    friction = 0.123456789  # which no other test gives

    @jax.jit
    def inside():
        return jb.Contact(friction=friction).friction + 0.0

    assert float(inside()) == friction
    assert float(as_leaf(friction)) == friction


def test_a_copy_leaves_the_original_as_it_is():
    contact = jb.Contact()
    copy = contact.but(friction=jnp.asarray(0.3))
    assert type(copy) is jb.Contact
    assert (float(copy.friction), float(contact.friction)) == (0.3, 0.1)
    assert copy.pressure is contact.pressure
