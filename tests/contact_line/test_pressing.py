"""Contact under the pressures alone, which may leave gaps, and cycles from there."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.contact_line import strip
from jbeamshell.contact_line.pressing import press
from jbeamshell.scene import library

PRESS = jax.jit(press)
STRIP = jax.jit(lambda scene: strip.condensed(scene, scene.plan.nodes))
PLANE = {"model.section": "plane", "model.nodes": 129}


def problem(seed, n=6, k=5):
    """Random stiffness, symmetric and positive, and forces that lift some nodes."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(k + n, k + n))
    whole = root @ root.T + 0.5 * np.eye(k + n)
    forces = rng.normal(size=k + n) + np.append(np.zeros(k), np.full(n, 0.7))
    return whole[:k, :k], whole[:k, k:], whole[k:, k:], forces[:k], forces[k:]


def by_trial(k_tt, k_tn, k_nn, press_t, press_n):
    """Lift of the only contact that holds, from all of them."""
    known = np.linalg.solve(k_tt, np.column_stack([k_tn, press_t]))
    a, r_0 = k_nn - k_tn.T @ known[:, :-1], press_n - k_tn.T @ known[:, -1]
    for opened in itertools.product([False, True], repeat=r_0.size):
        o = np.array(opened)
        w = np.zeros(r_0.size)
        w[o] = np.linalg.solve(a[np.ix_(o, o)], -r_0[o])
        if np.all(w >= 0.0) and np.all((r_0 + a @ w)[~o] >= 0.0):
            return r_0, w
    raise AssertionError("no contact holds")


class TestPress:
    @pytest.mark.parametrize("seed", range(12))
    def test_the_contact_is_the_only_one_that_holds(self, seed):
        given = problem(seed)
        r_0, lift = by_trial(*given)
        found = PRESS(*given)
        if r_0.sum() <= 0.0:
            assert np.all(np.isnan(found.lift))
            return
        np.testing.assert_allclose(found.lift, lift, atol=1e-10)
        np.testing.assert_allclose(found.lift * found.reaction, 0.0, atol=1e-10)
        assert found.reaction.min() > -1e-10
        k_tt, k_tn, _, press_t, _ = given  # without friction: no tangential force
        np.testing.assert_allclose(
            k_tt @ found.settled + k_tn @ found.lift + press_t, 0.0, atol=1e-10
        )

    def test_its_slope_is_that_of_the_contact(self):
        given = problem(3)
        way = problem(5)
        way = tuple(part + part.T if part.shape in ((5, 5), (6, 6)) else part for part in way)
        value, slope = jax.jit(lambda *at: jax.jvp(press, at, way))(*given)
        assert 0 < np.sum(value.lift > 0.0) < 6
        h = 1e-6
        moved = [PRESS(*(a + s * h * b for a, b in zip(given, way, strict=True))) for s in (1, -1)]
        for name in value._fields:
            up, down = (getattr(one, name) for one in moved)
            np.testing.assert_allclose(getattr(slope, name), (up - down) / (2 * h), rtol=1e-5)


class TestSqueezed:
    def test_a_strip_squeezed_from_both_sides_is_in_tension_beyond(self):
        """Filon's exact solution: 1.345 MPa at 1.285 H beyond the load."""
        history = jb.solve(library.squeezed().replace(PLANE))
        stress = np.asarray(history.squeeze_stress[0])
        peak = int(np.argmax(stress))
        assert stress[peak] == pytest.approx(1.345, rel=0.02)
        assert float(history.middles[peak]) - 50.0 == pytest.approx(1.285, abs=0.1)
        # Clapeyron: loads that do not change lose twice what the strip stores.
        lost = -float(history.sinking[0])
        assert float(history.stored_energy[0]) == pytest.approx(-0.5 * lost, rel=1e-9)

    def test_loads_need_a_foundation(self):
        moved = {"load.control": "displacement", "load.amplitude": 1e-3, "load.cycles": 1}
        with pytest.raises(jb.InputError, match=r"contact\.normal = 'none'.*load\.cycles = 0"):
            jb.solve(library.squeezed().replace(PLANE | moved))


class TestLaminate:
    def test_unlike_layers_press_as_those_of_the_beamshell_do(self):
        """They would bend under an even pressure, so that the end leans less on the base."""
        layers = [[0.1, 2.0e4, 0.3], [0.1252, 1.5e5, 0.2]]
        found = {}
        for section in ("plane", "squeeze"):
            given = {"model.section": section, "model.kinematics": "linear", "model.nodes": 33}
            own = STRIP(jb.Scene().replace({"strip.layers": layers} | given))
            assert float(jnp.sum(own.body.r_0)) == pytest.approx(20.0, rel=1e-9)
            reaction = np.asarray(own.body.r_0 / own.body.tributary)[::-1]
            found[section] = np.interp([1.0, 1.6, 1.7, 1.8, 1.9, 2.0], own.x, reaction)
        plane, shell = found.values()
        np.testing.assert_allclose(plane[:-1], shell[:-1], rtol=0.03)
        assert plane[2] > 10.3
        assert plane[-1] < 7.0


class TestReceding:
    def test_finite_elements_are_met(self):
        """Finite elements of the plane: .779, 103.12, 1.9858e-4; mean squeeze 101.78 and -.8901."""
        history = jb.solve(library.receding().replace({"model.section": "plane"}))
        figures = history.figures()
        assert figures["contact_end"] - 50.0 == pytest.approx(0.779, rel=0.01)
        assert figures["reaction_max"] == pytest.approx(103.12, rel=2e-3)
        assert figures["lift_slope"] == pytest.approx(1.9858e-4, rel=2e-3)
        squeeze = np.asarray(history.squeeze_stress[0])
        assert -squeeze.min() == pytest.approx(101.78, rel=1e-3)
        assert squeeze.max() == pytest.approx(0.8901, rel=0.02)
        gap, reaction = np.asarray(history.gap[0]), np.asarray(history.reaction[0])
        assert gap.min() == 0.0
        assert reaction.min() == 0.0
        np.testing.assert_array_equal(gap * reaction, 0.0)
        assert float(history.tributary @ reaction) == pytest.approx(5000.0, rel=1e-9)

    def test_cycles_go_on_from_the_gap_and_energy_balances(self):
        few = {"model.nodes": 65, "load.steps_per_half_cycle": 40}
        history = jb.solve(library.receding_rough().replace(PLANE | few))
        assert history.converged
        assert np.ptp(history.contact_end[1:]) > 0.2  # friction moves the end of the contact
        assert abs(float(history.closure)) < 1e-5  # a node that slips by a part settles slowly
        assert float(history.dissipation_loop / history.dissipation) == pytest.approx(1.0, abs=1e-3)
        worst = np.max(np.abs(history.energy_imbalance))
        assert worst < 3e-3 * np.sum(history.slip_work)  # of the trapezoid of F du
        opened = ~np.asarray(history.touching)
        assert np.any(opened & (history.x < 50.9))
        np.testing.assert_allclose(history.traction[opened], 0.0, atol=1e-3)
