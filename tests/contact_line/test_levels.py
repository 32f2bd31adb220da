"""Levels of load paths: in batches, and their slopes; turns of loads."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.contact_line import drives, strip, walk
from jbeamshell.contact_line.contact_state import pressed
from jbeamshell.contact_line.turns import known_turns, turns_of

NODES = 21
TURNS = jnp.asarray([1.0, 0.3, -1.0, -0.2, 1.0])
TURNED = (True, True, False, True, False)  # -1 and the last 1 go on
PLANE = jb.library.standard().replace({"model.section": "plane"})
STRIP = jax.jit(lambda scene: strip.condensed(scene, NODES).body)
LAYERS = np.array([[0.1, 2e5, 0.3], [0.1252, 4e5, 0.2]])


def strip_body(eta, nu=0.3):
    return STRIP(PLANE.replace({"strip.height_ratio": eta, "strip.poisson_ratio": nu}))


def laminate_body(soft=1.0):
    return STRIP(PLANE.replace({"strip.layers": LAYERS * [[1.0, soft, 1.0], [1.0, 1.0, 1.0]]}))


def open_body(eta):
    """Strip whose last nodes are off the base before any load."""
    body = strip_body(eta)
    return dataclasses.replace(body, r_0=body.r_0.at[:3].set(0.0))


def path(body, friction, amplitude):
    start = pressed(body)
    lift = jnp.where(body.r_0 > 0.0, 0.0, 1e-5 * body.x)
    # Gross slip of the standard pressure is at 20 mu.
    return walk.walk(body, friction, start, 20.0 * amplitude * TURNS, TURNED, lift)


def figures(body, friction, amplitude):
    """Works, displacements, a lift and a slip, in like sizes."""
    found = path(body, friction, amplitude)
    state = found.state
    many = [1e4 * found.slip_work, 1e3 * state.displacement, 1e4 * state.v[:, 1]]
    return jnp.concatenate([*many, 1e4 * found.lift[:, 0]])


FORWARD = jax.jit(lambda at, way: jax.jvp(figures, at, way))
WORK = jax.jit(jax.grad(lambda *at: figures(*at)[4], argnums=(0, 1, 2)))
CASES = {
    "nested": (lambda: (strip_body(0.1), strip_body(0.11)), 0.1, 0.05),
    "lifting": (lambda: (strip_body(0.3), strip_body(0.31, 0.28)), 0.3, 0.2),
    "lifting far": (lambda: (strip_body(0.2), strip_body(0.21, 0.32)), 0.5, 0.3),
    "open before": (lambda: (open_body(0.2), open_body(0.21)), 0.3, 0.1),
    "steep": (lambda: (strip_body(0.4), strip_body(0.38, 0.31)), 0.8, 0.35),
    "laminate": (lambda: (laminate_body(), laminate_body(1.05)), 0.4, 0.3),
}


class TestSlopes:
    @pytest.mark.parametrize("case", CASES)
    def test_taylor_slope_is_two_and_reverse_is_forward(self, case):
        bodies, friction, amplitude = CASES[case]
        body, other = bodies()
        change = jax.tree.map(lambda a, b: b - a, body, other)
        at = (body, jnp.asarray(friction), jnp.asarray(amplitude))
        way = (change, jnp.asarray(0.1 * friction), jnp.asarray(0.05 * amplitude))
        value, slope = FORWARD(at, way)

        def left(h):
            moved, _ = FORWARD(jax.tree.map(lambda a, b: a + h * b, at, way), way)
            return np.linalg.norm(moved - value - h * slope)

        order = np.log2(left(2e-3) / left(1e-3))
        assert order == pytest.approx(2.0, abs=0.15)
        found = WORK(*at)
        pairs = zip(jax.tree.leaves(found), jax.tree.leaves(way), strict=True)
        back = sum(float(jnp.vdot(a, b)) for a, b in pairs)
        assert back == pytest.approx(float(slope[4]), rel=1e-9)

    def test_more_sticking_than_a_trace_holds_has_slopes(self):
        # Far nodes slip and stick in turn after the reversal from near gross slip.
        thin = jax.jit(lambda scene: strip.condensed(scene, 41).body)
        body = drives.driven_by_displacement(thin(PLANE.replace({"strip.height_ratio": 0.0274})))
        start = pressed(body)

        @jax.jit
        def works(friction):
            path = 2.3e-4 * TURNS
            return walk.walk(body, friction, start, path, TURNED).slip_work

        slope = jax.jit(jax.jacfwd(works))(0.4)
        assert np.all(np.isfinite(slope))
        change = (works(0.4 + 1e-6) - works(0.4 - 1e-6)) / 2e-6
        np.testing.assert_allclose(slope, change, rtol=1e-6)

    def test_lift_and_sticking_again_are_among_the_cases(self):
        body = strip_body(0.2)
        found = jax.jit(path)(body, 0.5, 0.3)
        assert np.any(found.lift > 0.0)
        assert np.any(found.slipping[2] & ~found.slipping[3])


class TestLevels:
    def test_a_batch_is_its_lanes(self):
        value = jax.jit(figures)
        frictions = jnp.asarray([0.05, 0.1, 0.5, 0.8])
        bodies = [strip_body(eta) for eta in (0.1, 0.4, 0.1, 0.3)]
        stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *bodies)
        batch = jax.jit(jax.vmap(figures, in_axes=(0, 0, None)))(stacked, frictions, 0.05)
        for i, body in enumerate(bodies):
            one = value(body, frictions[i], 0.05)
            np.testing.assert_allclose(batch[i], one, rtol=1e-9, atol=1e-12)


class TestTurns:
    def test_a_load_that_rests_turns_when_it_leaves(self):
        assert known_turns(np.array([1.0, 1.0, 0.5, 0.5, -1.0])) == (
            True,
            False,
            True,
            False,
            False,
        )
        assert known_turns(np.array([0.0, 1.0, 2.0])) == (True, True, False)

    def test_known_turns_are_those_of_a_traced_path(self):
        traced = jax.jit(turns_of)
        for seed in range(20):
            moves = np.random.default_rng(seed).integers(-1, 2, 12)
            loads = np.cumsum(moves).astype(float)
            assert known_turns(loads) == tuple(np.asarray(traced(loads)).tolist())

    def test_traced_turns_are_walked_as_known_ones(self):
        body = strip_body(0.1)
        given = body, 0.1, pressed(body), 1.2 * TURNS
        known = jax.jit(walk.walk, static_argnums=4)(*given, TURNED)
        traced = jax.jit(walk.walk)(*given, jnp.asarray(TURNED))
        np.testing.assert_allclose(traced.slip_work, known.slip_work, rtol=1e-9)
        np.testing.assert_allclose(traced.state.displacement, known.state.displacement, rtol=1e-9)

    @pytest.mark.slow
    @pytest.mark.parametrize("section", ["plane", "squeeze"])
    def test_a_rest_changes_nothing(self, section):
        # Samples of a sine are alike on both sides of its turn: a rest at every turn.
        scene = jb.library.standard().replace({"model.section": section})
        loads = np.sin(2.0 * np.pi * np.arange(1, 76) / 50)
        rests = np.flatnonzero(np.diff(loads, prepend=0.0) == 0.0)
        assert rests.size
        with_rests = jb.solve(scene, loads).displacement[-75:]
        without = jb.solve(scene, np.delete(loads, rests)).displacement
        assert float(with_rests[-1]) == pytest.approx(float(without[-1]), rel=1e-9)
