"""Displacement control and elastic slip of condensed bodies."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.contact_line import drives, strip, walk
from jbeamshell.contact_line.body import Body
from jbeamshell.contact_line.contact_state import pressed

NODES = 33
MU = 0.3
TURNS = jnp.asarray([1.0, -1.0, 1.0, -1.0, 1.0])
ALL = jnp.ones(TURNS.size, bool)
WALK = jax.jit(functools.partial(walk.walk, rounded=False))  # the polygon is exact
STRIP = jax.jit(lambda scene: strip.condensed(scene, NODES))


@pytest.fixture(scope="module", params=["guided", "free"])
def body(request):
    changed = {
        "model.section": "plane",
        "load.entry": "traction",
        "contact.friction": MU,
        "contact.pressure": 1.0 / MU,
        "strip.far_end": request.param,
    }
    scene = jb.Scene().replace(changed)
    return STRIP(scene).body


def by_events(body, turns, friction=MU):
    turned = np.diff(np.sign(np.diff(np.append([0.0, 0.0], turns))), append=0.0)[:-1] != 0.0
    turned[0] = True
    levels = WALK(body, friction, pressed(body), jnp.asarray(turns), jnp.asarray(turned))
    assert np.all(levels.settled)
    return levels


def stored(body, state, lift):
    """Energy that the body has taken up since the pressure."""
    v, w = state.v, lift
    inner = v @ body.K_tt @ v + 2.0 * v @ body.K_tn @ w + w @ body.K_nn @ w
    return 0.5 * (inner + body.c * state.force**2) + body.r_0 @ w


def two_nodes():
    """Two nodes that a lift does not reach."""
    return Body(
        x=jnp.array([1.0, 0.0]),
        tributary=jnp.ones(2),
        K_tt=jnp.array([[2.0, -2.0], [-2.0, 5.0]]),
        K_tn=jnp.zeros((2, 2)),
        K_nn=10.0 * jnp.eye(2),
        f_t=jnp.array([1.0, 0.0]),
        f_n=jnp.zeros(2),
        r_0=jnp.ones(2),
        t_0=jnp.zeros(2),
        c=jnp.asarray(0.25),
    )


class TestDisplacementControl:
    def test_both_controls_walk_one_loop(self, body):
        pushed = by_events(body, 1.0 * TURNS)
        driven = by_events(drives.driven_by_displacement(body), pushed.state.displacement)
        state = drives.exchanged(driven.state)
        np.testing.assert_allclose(state.force, TURNS, atol=1e-10)
        np.testing.assert_allclose(state.displacement, pushed.state.displacement, rtol=1e-12)
        np.testing.assert_allclose(state.v, pushed.state.v, atol=1e-10 * np.abs(state.v).max())
        np.testing.assert_allclose(driven.slip_work, pushed.slip_work, rtol=1e-10)

    def test_gross_slip_stays_on_its_plateau_and_energy_balances(self, body):
        turns = np.array([1.0, 2.0, 3.0, -2.0, -3.0, -4.0]) * 1e-4
        driven = by_events(drives.driven_by_displacement(body), turns)
        state = drives.exchanged(driven.state)
        free = body.f_t.size == NODES
        if free:  # nothing but friction holds it: mu F_N L
            np.testing.assert_allclose(state.force[1:3], 2.0, rtol=1e-8)
            np.testing.assert_allclose(state.force[4:], -2.0, rtol=1e-8)
        else:  # the held end takes up the rest, as a bar of stiffness E' 2H / L does
            slope = np.diff(state.force[1:3]) / np.diff(turns[1:3])
            np.testing.assert_allclose(slope, 3.4e4 / 2.0, rtol=1e-6)
        assert np.all(driven.slipping[2])
        # Between the levels on the plateau all is linear, so that the trapezoid is exact there.
        energy = jax.vmap(stored, in_axes=(None, 0, 0))(body, state, driven.lift)
        for i in (2, 5):
            done = 0.5 * (state.force[i] + state.force[i - 1]) * (turns[i] - turns[i - 1])
            balance = done - (energy[i] - energy[i - 1])
            np.testing.assert_allclose(driven.slip_work[i], balance, rtol=1e-8)


class TestSprings:
    def test_two_nodes_by_hand(self):
        # Each node alone: springs of 8 in series with the body, sliders of 0.3.
        springs = jnp.array([8.0, 8.0])
        sprung, parts = drives.with_springs(two_nodes(), springs)
        # First slip of node 1 under F: r_t = -0.3, (K + D) v = f F, 8 v_1 = 0.3.
        inverse = np.linalg.inv(np.array([[10.0, -2.0], [-2.0, 13.0]]))
        first = 0.3 / (8.0 * inverse[0, 0])
        before, after = by_events(sprung, [0.999 * first, 1.2 * first]).slipping
        assert not np.any(before)
        np.testing.assert_array_equal(after, [True, False])
        # Beyond it node 1 carries 0.3: 2 (v_1 - v_2) = F - 0.3 and 5 v_2 - 2 v_1 = -8 v_2.
        force = 1.2 * first
        v_2 = (force - 0.3) / 11.0
        v_1 = 0.5 * (force - 0.3) + v_2
        level = by_events(sprung, [force])
        v = parts.slip(level.state.v[-1], level.lift[-1], level.state.force[-1])
        np.testing.assert_allclose(v, [v_1, v_2], rtol=1e-12)
        np.testing.assert_allclose(level.state.r_t[-1], [-0.3, -8.0 * v_2], rtol=1e-12)
        np.testing.assert_allclose(level.state.v[-1], [v_1 - 0.3 / 8.0, 0.0], atol=1e-14)
        np.testing.assert_allclose(level.state.displacement[-1], 0.25 * force + v_1, rtol=1e-12)

    def test_stiff_springs_are_none(self, body):
        hard, _ = drives.with_springs(body, 1e9 * 3.4e4 * body.tributary[: body.f_t.size])
        ideal, sprung = by_events(body, TURNS), by_events(hard, TURNS)
        np.testing.assert_allclose(sprung.slip_work, ideal.slip_work, rtol=1e-6)
        np.testing.assert_allclose(
            sprung.state.displacement, ideal.state.displacement, rtol=1e-6, atol=1e-12
        )

    def test_energy_balances_with_the_springs(self, body):
        soft, parts = drives.with_springs(body, 3.4e5 * body.tributary[: body.f_t.size])
        forces = np.concatenate([np.linspace(0.1, 1.2, 12), np.linspace(1.1, -1.2, 24)])
        levels = by_events(soft, forces)
        state = levels.state
        v = jax.vmap(parts.slip)(state.v, levels.lift, state.force)
        energy = jax.vmap(stored, in_axes=(None, 0, 0))(
            body, state._replace(v=v), levels.lift
        ) + drives.spring_energy(parts.stiffness, state.r_t)
        f, u = np.append(0.0, forces), np.append(0.0, state.displacement)
        done = np.cumsum(0.5 * (f[1:] + f[:-1]) * np.diff(u))  # trapezoids between 36 levels
        work = np.cumsum(levels.slip_work)
        assert work[-1] > 0.1 * done.max()
        np.testing.assert_allclose(done, energy + work, atol=0.01 * work[-1])
        # What the sliders carry is what the springs carry.
        stretch = np.asarray(v - state.v) * np.asarray(parts.stiffness)
        np.testing.assert_allclose(stretch, -state.r_t, atol=1e-9)
