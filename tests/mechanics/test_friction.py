"""Friction of one point: memory, cap, dissipation, and the two traps."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import simpson
from toy import STRIP

from jbeamshell import read_scene, write_scene
from jbeamshell.mechanics import friction
from jbeamshell.mechanics.friction import (
    CappedTrial,
    ElasticSlip,
    FrictionLaw,
    SharpSlip,
    TanhIncrement,
    coulomb_cap,
    plastic_slip,
)

K_T = 7.0
SHARP = SharpSlip()
LAWS = [SHARP, ElasticSlip(8.0)]  # the exponent is a number as others are
laws = pytest.mark.parametrize("law", LAWS, ids=["sharp", "8"])
smooth = pytest.mark.parametrize("law", [ElasticSlip(8.0), ElasticSlip(32.0)], ids=["8", "32"])

ratios = st.floats(-1, 1)
moves = st.floats(-4, 4)  # k_t dv over the cap
caps = st.floats(1e-3, 1e3)


@pytest.fixture(scope="module", autouse=True)
def _optimised():
    """Compile as users do: at some points round-off decides on which side of a kink a slope is."""
    jax.config.update("jax_disable_most_optimizations", False)
    yield
    jax.config.update("jax_disable_most_optimizations", True)


class Hardening(FrictionLaw):
    """Half of every increment is plastic, and the traction rises with all of it."""

    def traction(self, dv, t_n, cap, k_t):
        return t_n + 0.5 * k_t * dv


def test_the_work_of_a_law_of_ones_own_is_exact_where_traction_rises_linearly():
    law, slip = Hardening(), np.linspace(0.0, 2.0, 5)
    whole = law.slip_work(slip[-1], 0.0, K_T, 9.0, 9.0, K_T)  # traction K_T at slip 2
    t = 0.5 * K_T * slip
    parts = [law.slip_work(0.5, *pair, 9.0, 9.0, K_T) for pair in itertools.pairwise(t)]
    assert whole == pytest.approx(sum(parts)) == pytest.approx(0.5 * K_T * 1.0)


def test_an_iterate_thrown_across_the_cone_is_put_to_its_middle():
    t_n = 0.3
    for sign in (1.0, -1.0):
        put = SHARP.limit(sign * 2.0 / K_T, -sign * 9.0 / K_T, t_n, 1.0, K_T)
        assert SHARP.traction(put, t_n, 1.0, K_T) == pytest.approx(0.0, abs=1e-15)
        assert SHARP.limit(sign * 0.1, sign * 9.0, t_n, 1.0, K_T) == sign * 9.0


def test_a_base_that_pulls_has_no_friction():
    np.testing.assert_array_equal(coulomb_cap(0.5, np.array([-2.0, 0.0, 2.0])), [0.0, 0.0, 1.0])


@jax.jit
def _step(law, dv, t_n, cap_n, cap):
    t = law.traction(dv, t_n, cap, K_T)
    return t, law.slip_work(dv, t_n, t, cap_n, cap, K_T)


def step(law, dv, t_n, cap, cap_n=None):
    """Traction and slip work of one step."""
    return _step(law, *map(jnp.asarray, (dv, t_n, cap if cap_n is None else cap_n, cap)))


@jax.jit
def derivatives(law, dv, t_n, cap):
    """Derivatives of traction and slip work by the law's parameters, dv, t_n and the cap."""

    def both(law, dv, t_n, cap):
        t = law.traction(dv, t_n, cap, K_T)
        return jnp.stack([t, law.slip_work(dv, t_n, t, 2 * cap, cap, K_T)])

    return jax.jacrev(both, (0, 1, 2, 3))(law, *map(jnp.asarray, (dv, t_n, cap)))


@jax.jit
def walk(law, path, t_n, cap):
    """Tractions and slip works along a path of increments at a constant cap."""

    def one(t_n, dv):
        t = law.traction(dv, t_n, cap, K_T)
        return t, (t, law.slip_work(dv, t_n, t, cap, cap, K_T))

    return jax.lax.scan(one, jnp.asarray(t_n), path)[1]


@laws
@given(ratio=ratios, cap=caps)
def test_no_motion_no_creep(law, ratio, cap):
    t, work = step(law, 0.0, ratio * cap, cap)
    np.testing.assert_allclose(t, ratio * cap, atol=4e-15 * cap)
    np.testing.assert_allclose(work, 0, atol=1e-14 * cap**2 / K_T)


@laws
@given(ratio=ratios, move=moves, cap=caps)
def test_a_hundred_steps_are_one(law, ratio, move, cap):
    dv = move * cap / K_T
    t, work = step(law, dv, ratio * cap, cap)
    ts, works = walk(law, jnp.full(100, dv / 100), ratio * cap, cap)
    np.testing.assert_allclose(ts[-1], t, atol=2e-13 * cap)
    np.testing.assert_allclose(works.sum(), work, atol=2e-11 * cap**2 / K_T)


@laws
@given(t_n=st.floats(-3, 3), dv=st.floats(-9, 9), cap=caps)
def test_traction_stays_under_the_cap(law, t_n, dv, cap):
    assert abs(step(law, dv, t_n, cap)[0]) <= cap


@laws
@given(ratio=st.floats(0, 1), back=st.floats(0, 1))
def test_unloading_is_elastic(law, ratio, back):
    for sign in (1, -1):
        t, work = step(law, -sign * back * ratio / K_T, sign * ratio, 1.0)
        np.testing.assert_allclose(t, sign * (1 - back) * ratio, atol=1e-15)
        np.testing.assert_allclose(work, 0, atol=1e-15)


@laws
@given(ratio=ratios, move=moves)
def test_both_directions_are_alike(law, ratio, move):
    there, back = step(law, move, ratio, 1.0), step(law, -move, -ratio, 1.0)
    np.testing.assert_allclose(there, (-back[0], back[1]), rtol=1e-12, atol=1e-15)


@laws
def test_a_shrinking_cap_clips_after_the_unloading(law):
    t, _ = step(law, 1.0 / K_T, -0.99, 0.3, cap_n=1.0)
    np.testing.assert_allclose(t, 0.01, rtol=1e-9)


@laws
def test_gradients_are_finite(law):
    for cap, ratio in itertools.product([1.0, 1e-6], [0.0, 0.5, 1.0, -1.0, 3e6]):
        for dv in (0.0, 1e-9, -1e-9, 1 / K_T, -1e3, 1e12):
            gradients = derivatives(law, dv, ratio * cap, cap)
            assert all(np.isfinite(g).all() for g in jax.tree.leaves(gradients)), (cap, ratio, dv)


@laws
@pytest.mark.parametrize("dv", [0.0, 0.7, -0.7, 2.5])
@pytest.mark.parametrize("ratio", [0.0, 0.6, -0.6])
def test_gradients_are_slopes(law, ratio, dv):
    def slope(argument):
        by = 1e-6 * np.eye(3)[argument]
        forth, back = np.array([dv / K_T, ratio, 1.0]) + np.stack([by, -by])
        ends = [np.array(step(law, *at, cap_n=2 * at[2])) for at in (forth, back)]
        return (ends[0] - ends[1]) / 2e-6

    _, *gradients = derivatives(law, dv / K_T, ratio, 1.0)
    for argument, gradient in enumerate(gradients):
        if (argument, dv) != (0, 0.0):  # at a reversal the two slopes differ
            np.testing.assert_allclose(gradient, slope(argument), atol=1e-5)


@smooth
@pytest.mark.parametrize("dv", [0.8, 2.5])
def test_gradient_in_the_exponent_is_a_slope(law, dv):
    ends = [
        np.array(step(ElasticSlip(law.smoothing + by), dv / K_T, 0.6, 1.0, cap_n=2.0))
        for by in (1e-4, -1e-4)
    ]
    in_law, *_ = derivatives(law, dv / K_T, 0.6, 1.0)
    np.testing.assert_allclose(in_law.smoothing, (ends[0] - ends[1]) / 2e-4, atol=1e-8)


@laws
def test_a_stuck_point_is_elastic(law):
    _, along_dv, _, _ = derivatives(law, 0.0, 0.0, 1.0)
    np.testing.assert_allclose(along_dv, [K_T, 0.0], atol=1e-12)


def test_large_exponents_approach_the_sharp_slider():
    path = jnp.array([0.7, 0.9, -1.2, -1.7, 2.6]) / K_T
    sharp = jnp.stack(walk(SHARP, path, 0.0, 1.0))
    gaps = [
        float(jnp.abs(jnp.stack(walk(ElasticSlip(m), path, 0.0, 1.0)) - sharp).max())
        for m in (8.0, 32.0, 128.0, 512.0)
    ]
    assert max(gaps[1] / gaps[0], gaps[2] / gaps[1], gaps[3] / gaps[2]) < 0.5
    assert gaps[-1] < 2e-3


@smooth
@pytest.mark.parametrize(
    ("ratio", "move"),
    [(0, 0.8), (0, 1), (0, 3), (0.5, 0.6), (0.99, 0.1), (-0.7, 3), (-0.99, 1.9), (0.3, -2)],
)
def test_slip_work_is_work_less_what_is_stored(law, ratio, move):
    cap = 2.0
    path = np.linspace(0, move * cap / K_T, 20001)
    t = jax.vmap(lambda dv: law.traction(dv, ratio * cap, jnp.asarray(cap), K_T))(path)
    expected = simpson(t, x=path) - (t[-1] ** 2 - t[0] ** 2) / (2 * K_T)
    _, work = step(law, path[-1], ratio * cap, cap)
    np.testing.assert_allclose(work, expected, rtol=1e-5, atol=1e-9)


def test_sharp_slider_is_exact_on_ramps_of_slip_and_cap():
    path = np.linspace(0, 1, 101)
    for start, move, end in [(0.2, 3.0, 0.4), (0.2, 3.0, 1.9), (-0.9, -0.4, 0.3), (0.9, -0.5, 0.3)]:
        t, work = step(SHARP, move / K_T, start, end, cap_n=1.0)
        caps, fine, total = 1 + (end - 1) * path, start, 0.0
        for before, after in itertools.pairwise(caps):
            fine, part = step(SHARP, move / K_T / 100, fine, after, cap_n=before)
            total += part
        np.testing.assert_allclose((fine, total), (t, work), rtol=1e-12, atol=1e-15)


@laws
@given(ratio=ratios, dv=st.floats(-4, 4), cap=caps, cap_n=caps)
def test_slip_never_gives_energy_back(law, ratio, dv, cap, cap_n):
    t, work = step(law, dv, ratio * cap_n, cap, cap_n)
    assert work >= 0
    slip = plastic_slip(dv, ratio * cap_n, t, K_T)
    assert work <= max(cap, cap_n) * abs(slip) * (1 + 1e-12) + 1e-14 * cap**2 / K_T


@given(st.floats(0, 0.999), st.integers(1, 20))
def test_small_cycles_of_the_sharp_slider_dissipate_nothing(reach, steps):
    quarter = np.full(steps, reach / steps / K_T)
    cycle = jnp.concatenate([quarter, -quarter, -quarter, quarter])
    t, work = walk(SHARP, jnp.pad(cycle, (0, 80 - cycle.size)), 0.0, 1.0)
    np.testing.assert_allclose(t[-1], 0, atol=1e-14)
    np.testing.assert_allclose(work, 0, atol=1e-16)


@laws
def test_energy_balance_of_a_cycle(law):
    half = np.full(2000, 2.4 / K_T / 2000)
    path = np.concatenate([half / 2, -half, half])
    t, work = walk(law, jnp.asarray(path), 0.0, 1.0)
    supplied = np.sum(0.5 * (t + np.append(0.0, t[:-1])) * path)
    np.testing.assert_allclose(work.sum() + t[-1] ** 2 / (2 * K_T), supplied, rtol=1e-5)


def test_trap_a_capped_trial_relaxes_with_the_number_of_steps():
    trap = CappedTrial(8.0)
    ends = [float(walk(trap, jnp.full(n, 0.9 / K_T / n), 0.0, 1.0)[0][-1]) for n in (1, 10, 100)]
    assert ends[0] > ends[1] + 0.01 > ends[2] + 0.02
    creeping, _ = walk(trap, jnp.zeros(100), 0.9, 1.0)
    assert creeping[-1] < 0.8


def test_trap_a_tanh_of_the_increment_depends_on_the_number_of_steps():
    paths = [jnp.full(n, 2 / K_T / n) for n in (1, 4, 16)]
    works = [float(walk(TanhIncrement(), path, 0.0, 1.0)[1].sum()) for path in paths]
    assert works[0] > 1.9 * works[1] > 3.6 * works[2] > 0
    np.testing.assert_allclose(works[0], 2 / K_T * np.tanh(2))
    assert step(TanhIncrement(), 0.0, 0.9, 1.0)[0] == 0


class Doubled(FrictionLaw):
    """Law of a user's own."""

    def traction(self, dv, t_n, cap, k_t):
        return jnp.clip(t_n + 2.0 * k_t * dv, -cap, cap)


def test_a_law_is_known_everywhere_once_it_has_a_name(monkeypatch, tmp_path):
    own = STRIP.replace({"contact.law": Doubled()})
    assert isinstance(own.get("contact.law"), Doubled)
    monkeypatch.setitem(friction.LAWS, "doubled", Doubled)
    scene = STRIP.replace({"contact.smoothing": 8.0}).replace({"contact.law": "doubled"})
    assert isinstance(scene.contact.law, Doubled)
    write_scene(scene, tmp_path / "scene.toml")
    assert read_scene(tmp_path / "scene.toml").get("contact.law") == "doubled"
