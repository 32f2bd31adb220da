"""Networks of sliders: loops of any reversals, Masing's rule, energy, moving volume."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.contact_line.branches import factorise, pressed
from jbeamshell.contact_line.network import Network
from jbeamshell.contact_line.turns import known_turns
from jbeamshell.contact_line.walk import walk

PLANE = {"model.section": "plane", "model.nodes": 33}
SCENE = jb.library.standard().replace(PLANE)
NESTED = [0.5, 1.0, 0.6, -0.2, -0.6, -0.2, 0.2, -0.3, -0.6, -1.0, -0.5, 0.0, 0.5, 1.0, 1.1]
of = eqx.filter_jit(Network.of)
along = jax.jit(lambda network, path: network.along(path))


@jax.jit
def step(network, state, turn):
    """Branch to a turn: its end, work of friction, validity, sliders, and gain of energy."""
    found = network.branch(state, turn)
    line = network.sliders(state, jnp.sign(turn - state.force))
    return *found, line, network.stored(found[0]) - network.stored(state)


@pytest.fixture(scope="module")
def network():
    return of(SCENE)


class TestNetwork:
    def test_loops_of_nested_reversals_are_those_of_the_strip(self, network):
        body, turns = network.body, known_turns(np.asarray(NESTED))

        @jax.jit
        def polygon(body):
            start, loads = pressed(body), jnp.asarray(NESTED)
            return walk(body, network.friction, start, loads, turns, rounded=False)

        levels = polygon(body)
        found = along(network, levels.state.displacement)
        assert np.all(found.valid)
        np.testing.assert_allclose(found.state.force, NESTED, atol=1e-10)
        work = np.diff(np.asarray(found.slip_work), prepend=0.0)
        np.testing.assert_allclose(work, levels.slip_work, atol=1e-10 * work.max())
        scale = np.abs(levels.state.r_t).max()
        np.testing.assert_allclose(found.state.r_t, levels.state.r_t, atol=1e-10 * scale)

    def test_decaying_paths_conserve_energy(self, network):
        random = np.random.default_rng(3)
        signs = np.where(np.arange(12) % 2, 1.0, -1.0)
        state = network.rest
        for turn in 1.2 * signs * np.cumprod(random.uniform(0.6, 0.98, 12)):
            end, work, valid, line, gained = step(network, state, turn)
            sense, reach = np.sign(turn - state.force), abs(turn - state.force)
            inside = np.asarray(line.force) < reach
            forces = state.force + sense * np.append(line.force[inside], reach)
            moved = abs(end.displacement - state.displacement)
            supplied = np.trapezoid(forces, sense * np.append(line.displacement[inside], moved))
            assert valid
            assert work >= 0.0
            assert float(supplied) == pytest.approx(float(gained + work), rel=1e-10)
            state = end

    def test_without_coupling_reversals_double_the_thresholds(self, network):
        """Iwan's network and Masing's rule."""
        alone = eqx.tree_at(
            lambda b: (b.K_tn, b.f_n),
            network.body,
            (0.0 * network.body.K_tn, 0.0 * network.body.f_n),
        )
        factors = jax.jit(factorise)(alone, network.friction)
        iwan = Network(alone, factors, network.friction, network.volume)
        pull, push = (iwan.sliders(iwan.rest, jnp.asarray(way)) for way in (1.0, -1.0))
        np.testing.assert_allclose(pull.force, push.force, rtol=1e-12)
        np.testing.assert_allclose(pull.compliance, push.compliance, rtol=1e-12)
        pulled, _, _ = iwan.branch(iwan.rest, jnp.asarray(1.0))
        back = iwan.sliders(pulled, jnp.asarray(-1.0))
        slipped = np.asarray(pull.force) < 1.0
        assert slipped.sum() > 5
        np.testing.assert_allclose(back.force[slipped], 2.0 * pull.force[slipped], rtol=1e-10)

    def test_pull_and_push_differ_by_the_coupling(self, network):
        pull, push = (network.sliders(network.rest, jnp.asarray(way)) for way in (1.0, -1.0))
        apart = np.asarray(pull.displacement_after(1.0) / push.displacement_after(1.0)) - 1.0
        assert 1e-4 < abs(apart) < 0.1

    def test_lines_are_inverse_to_each_other(self, network):
        line = network.sliders(network.rest, jnp.asarray(1.0))
        forces = jnp.linspace(0.0, 1.5, 40)
        np.testing.assert_allclose(line.force_after(line.displacement_after(forces)), forces)

    def test_the_moving_volume_is_that_of_its_layers(self, network):
        strip = SCENE.strip
        half, modulus = float(strip.half_height), float(strip.plane_modulus) * (1.0 - 0.3**2)
        rows = [[0.5 * half, modulus, 0.3], [1.5 * half, modulus, 0.3]]
        layered = of(SCENE.replace({"strip.layers": rows}))
        whole = float(network.volume[0])
        assert float(jnp.sum(layered.volume)) == pytest.approx(whole, rel=0.01)
        # A half strip above the contact moves more than its share.
        assert 0.75 * whole < float(layered.volume[1]) < whole
        assert 0.0 < whole < float(2.0 * strip.half_height * strip.length) / 3.0
