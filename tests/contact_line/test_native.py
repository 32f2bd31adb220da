"""The walk in C beside the walk in JAX: levels, derivatives of both modes, batches."""

import functools
import os
import shutil

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.common import jax_options
from jbeamshell.contact_line import bearings, drives, native, strip
from jbeamshell.contact_line.contact_state import pressed
from jbeamshell.contact_line.walk import Contact, walk, walk_on

COMPILER = any(map(shutil.which, ("cc", "gcc", "clang")))  # which an install has used then
IN_C = COMPILER and os.environ.get(jax_options.WALK) != "jax"
pytestmark = pytest.mark.skipif(not IN_C, reason="no C compiler, or the walk in JAX is asked for")

NODES = 21
ENTRIES = "traction", "face", "member", "guided"
# Loops within loops, a branch that goes on beyond the loop it closes, and a rest.
LOADS = jnp.asarray([1.0, 0.3, -1.0, -0.2, 0.4, 0.4, -0.3, 0.9, -1.1, 1.2])
TURNS = True, True, False, True, False, False, True, True, True, True
STRIP = jax.jit(lambda scene: strip.condensed(scene, NODES).body)


def random_body(seed):
    """Strip of a random height, friction and Poisson's ratio; its friction and a load."""
    random = np.random.default_rng(seed)
    friction = 10 ** random.uniform(-1.2, 0.1)
    values = {
        "model.section": "plane",
        "load.entry": ENTRIES[seed % 4],
        "strip.height_ratio": 10 ** random.uniform(-1.4, -0.4),
        "strip.poisson_ratio": random.uniform(0.1, 0.45),
        "contact.pressure": 10.0,
    }
    body = STRIP(jb.Scene().replace(values))
    return body, friction, 20.0 * friction * 10 ** random.uniform(-1.0, -0.15)


@functools.partial(jax.jit, static_argnames=("in_c", "rounded"))
def levels(body, friction, loads, in_c, rounded=True, lift=None):
    start = pressed(body)
    lift = jnp.zeros_like(start.r_n) if lift is None else lift
    if in_c:
        return walk(body, friction, start, loads, TURNS, lift, rounded=rounded)
    contact = Contact.of(start, lift)
    return walk_on(body, friction, contact, loads, TURNS, rounded=rounded)[0]


def normal_forces(body, found):
    """Normal forces (levels, n) that follow from the displacements."""
    state, lift = found.state, np.asarray(found.lift)
    moved = state.v @ body.K_tn + lift @ body.K_nn - np.outer(state.force, body.f_n)
    return np.asarray(body.r_0 + moved)


def mixed(body, friction, loads, lift, in_c):
    """One number of all that a path gives at all levels."""
    found = levels(body, friction, loads, in_c, lift=lift)
    state = found.state
    lengths = state.displacement, state.v, found.lift
    forces = state.r_t, state.r_n, 10.0 * found.slip_work
    many = jnp.concatenate([1e5 * a.ravel() for a in lengths] + [a.ravel() for a in forces])
    return many @ jnp.cos(jnp.arange(many.size))


FORWARD = jax.jit(lambda at, way: jax.jvp(lambda *at: mixed(*at, True), at, way))
BACK = jax.jit(jax.grad(mixed, argnums=(0, 1, 2, 3)), static_argnums=4)


@pytest.mark.parametrize(
    ("content", "says"),
    [(None, "no C compiler"), (b"no library", "libwalk.so cannot be loaded: install")],
)
def test_a_library_that_is_not_there_leaves_the_walk_to_jax(tmp_path, monkeypatch, content, says):
    monkeypatch.delenv(jax_options.WALK, raising=False)
    monkeypatch.setattr(native, "LIBRARY", tmp_path / "libwalk.so")
    if content is not None:
        native.LIBRARY.write_bytes(content)
    for known in (native.library, native.is_taken):
        known.cache_clear()
    try:
        assert not native.serves()
        assert says in native.in_words()
    finally:
        for known in (native.library, native.is_taken):
            known.cache_clear()


def test_a_refusal_by_jax_is_told_and_leaves_the_walk_to_jax(monkeypatch):
    def refuse(*_, **__):
        raise ValueError("another version")

    monkeypatch.setattr(jax.ffi, "register_ffi_target", refuse)
    native.is_taken.cache_clear()
    try:
        with pytest.warns(RuntimeWarning, match=r"walked in JAX.*refuses.*another version"):
            assert not native.serves(jnp.zeros(()))
        assert native.serves(np.zeros(()))  # which JAX has no part in
    finally:
        native.is_taken.cache_clear()


@pytest.mark.parametrize(("rounded", "seeds"), [(True, 12), (False, 4)])
def test_it_walks_as_the_walk_in_jax(rounded, seeds):
    for seed in range(seeds):
        body, friction, size = random_body(seed)
        own, other = (levels(body, friction, size * LOADS, way, rounded) for way in (True, False))
        np.testing.assert_array_equal(own.settled, other.settled)
        # A node that sticks with more than its friction may open late, which both walks leave out
        # of balance: one gives its conditions, the other its forces.
        off_balance = np.max(np.abs(other.state.r_n - normal_forces(body, other)))
        for name in ("v", "r_t", "r_n", "displacement"):
            one, two = (np.asarray(getattr(each.state, name)) for each in (own, other))
            atol = 1e-6 * np.abs(two).max() + off_balance * name.startswith("r")
            np.testing.assert_allclose(one, two, atol=atol, err_msg=name)
        work, scale = np.asarray(own.slip_work), np.asarray(other.slip_work).max()
        # Where a branch goes on beyond the loop that it closes, nodes begin to slip at one load.
        # Rounding decides which of them is the first, by up to 1e-3 of a step's work.
        near = [friction * (1.0 + s * 0.1**p) for s in (-1, 1) for p in range(7, 14)]
        flips = [levels(body, each, size * LOADS, True, rounded).slip_work for each in near]
        undecided = np.max(np.abs(np.array(flips) - work), axis=0)
        off = np.abs(work - np.asarray(other.slip_work))
        late = off_balance * np.abs(own.state.v).max()
        assert np.all(off <= 1e-7 * scale + 1.01 * undecided + late)


def test_a_body_driven_by_displacement_is_walked_as_well():
    body, friction, size = random_body(2)
    reach = levels(body, friction, size * LOADS, False).state.displacement
    driven = drives.driven_by_displacement(body)
    own, other = (levels(driven, friction, reach, way) for way in (True, False))
    np.testing.assert_allclose(own.slip_work, other.slip_work, rtol=1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_are_those_of_the_walk_in_jax_also_on_bearings(seed):
    """Two more nodes without a place; all cotangents, and forward as in reverse."""
    body, friction, size = random_body(seed)
    slip = np.asarray(levels(body, friction, size * LOADS, True).state.v)
    share = np.full(slip.shape[1], 1.0 / slip.shape[1])
    held = bearings.with_bearings(body, jnp.asarray(2e4), share)
    lift = bearings.with_gaps(jnp.zeros(NODES), 0.3 * np.abs(slip.mean(axis=1)).max())
    own, other = (levels(held, friction, size * LOADS, way, lift=lift) for way in (True, False))
    assert np.any(np.asarray(other.state.r_n)[:, -2:] > 0.0)
    np.testing.assert_allclose(own.state.r_n, other.state.r_n, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(own.slip_work, other.slip_work, rtol=1e-7)
    at = held, jnp.asarray(friction), size * LOADS, lift
    back, known = (BACK(*at, way) for way in (True, False))
    for one, two in zip(jax.tree.leaves(back), jax.tree.leaves(known), strict=True):
        if one.ndim == 2 and one.shape[0] == one.shape[1]:  # symmetric matrices by either half
            one, two = one + one.T, two + two.T
        # Both round by eps times the stiffness of the shortest elements, in another order; a slope
        # by one number is a sum of terms that are larger.
        largest = np.abs(two).max() if two.ndim else max(1.0, abs(two))
        np.testing.assert_allclose(one, two, atol=3e-8 * largest)
    random = np.random.default_rng(seed)

    def changed(leaf):
        part = random.uniform(-1.0, 1.0, np.shape(leaf))
        square = part.ndim == 2 and part.shape[0] == part.shape[1]
        return np.asarray(leaf) * (part + part.T if square else part)

    way = jax.tree.map(changed, at)
    slope = float(FORWARD(at, way)[1])
    leaves = zip(*map(jax.tree.leaves, (back, way)), strict=True)
    pairs = [float(np.sum(np.asarray(a) * b)) for a, b in leaves]
    assert slope == pytest.approx(sum(pairs), abs=1e-9 * sum(map(abs, pairs)))


def test_a_batch_is_its_lanes():
    bodies, frictions, sizes = zip(*(random_body(seed) for seed in range(4)), strict=True)
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *bodies)
    frictions, loads = jnp.asarray(frictions), jnp.asarray(sizes)[:, None] * LOADS
    closed = jnp.zeros((4, NODES))
    many = jax.jit(jax.vmap(lambda *at: mixed(*at, True)))(stacked, frictions, loads, closed)
    shared = jax.jit(jax.vmap(lambda load: mixed(bodies[0], frictions[0], load, closed[0], True)))(
        loads
    )
    one = jax.jit(lambda *at: mixed(*at, True))
    slopes = jax.jit(jax.vmap(jax.grad(lambda *at: mixed(*at, True), argnums=1)))
    of_many = slopes(stacked, frictions, loads, closed)
    for i, body in enumerate(bodies):
        np.testing.assert_allclose(
            many[i], one(body, frictions[i], loads[i], closed[i]), rtol=1e-12
        )
        np.testing.assert_allclose(
            shared[i], one(bodies[0], frictions[0], loads[i], closed[i]), rtol=1e-12
        )
        alone = BACK(body, frictions[i], loads[i], closed[i], True)[1]
        np.testing.assert_allclose(of_many[i], alone, rtol=1e-9)
