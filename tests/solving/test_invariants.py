"""Invariants of any strip in load steps: signs, balances, symmetries and scalings."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scenes import EXACT, STEPPED, UNEVEN, held_at, two_cycles
from toy import STRIP

import jbeamshell as jb
from jbeamshell.load_steps.system import System
from jbeamshell.scene import library

FINE, COARSE = 8, 2  # load steps per half cycle
PRESSURE, LENGTH = 10.0, 2.0
# Shrinking a failure would run for minutes.
few = settings(max_examples=10, phases=[Phase.generate])


def between(low, high):
    """Numbers spread evenly over their logarithm."""
    return st.floats(np.log(low), np.log(high)).map(lambda x: float(np.exp(x)))


strips = st.fixed_dictionaries(
    {  # from thin to thick, with soft to stiff sliders, stuck to nearly sliding
        "strip.height_ratio": between(0.005, 0.5),
        "contact.friction": between(0.02, 1.0),
        "strip.poisson_ratio": st.floats(0.0, 0.49),
        "strip.kappa_s": between(0.05, 3.0),
        "contact.stick_stiffness": between(2.0, 1e4),
        "load.amplitude": st.floats(0.02, 0.98),  # of gross slip
    }
)


def scene_of(values, base=STEPPED, **more):
    gross = values["contact.friction"] * PRESSURE * LENGTH
    return base.replace(values | {"load.amplitude": values["load.amplitude"] * gross} | more)


def path(scene, steps=FINE, first=1.0):
    """Path to the amplitude and one cycle from there, in equal steps, with or without holds."""
    half = steps // 2
    there = np.arange(1, half + 1) / half
    back = 1.0 - 2.0 * np.arange(1, steps + 1) / steps
    levels = np.concatenate([there, back, -back])
    return first * float(scene.load.amplitude) * np.repeat(levels, FINE // steps)


@functools.cache
def _run(items, steps, first):
    scene = scene_of(dict(items))
    return jb.solve(scene, path(scene, steps, first), throw=False)


def run(values, steps=FINE, first=1.0):
    return _run(tuple(values.items()), steps, first)


def size(history):
    """Scale of energies: the largest work of a branch."""
    return float(np.max(np.abs(history.force)) * np.ptp(history.displacement))


def check_friction_and_contact(history, pressure=PRESSURE):
    """Traction in its cone, no work gained, no tension and no overlap."""
    assert history.converged
    cap = float(history.scene.contact.friction) * np.maximum(history.reaction, 0.0)
    assert np.all(np.abs(history.traction) <= cap * (1.0 + 1e-12) + 1e-5 * pressure)
    assert float(np.min(history.slip_work)) >= -1e-12 * size(history)
    assert float(np.min(history.reaction)) > -1e-9 * pressure
    assert float(np.min(history.gap)) > -1e-12 * LENGTH
    tension = history.gap * history.reaction / (LENGTH * pressure)
    assert float(np.max(np.abs(tension))) < 1e-9


@few
@given(strips)
def test_friction_and_contact_keep_their_signs_and_displacements_follow_the_force(values):
    history = run(values)
    check_friction_and_contact(history)
    moves = np.diff(np.asarray(history.displacement)) * np.sign(np.diff(history.force))
    assert np.min(moves) > 0.01 * np.ptp(np.asarray(history.displacement)) / FINE


@settings(max_examples=30, phases=[Phase.generate])
@given(strips)
def test_no_step_under_pressures_with_a_jump_needs_recovery(values):
    scene = scene_of(values, **{"contact.pressure": UNEVEN})
    recovered = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("jbeamshell.solving.solve.recover", lambda *_: recovered.append(values))
        jb.solve(scene, path(scene), throw=False)
    assert not recovered


@few
@given(strips)
def test_exact_rotations_converge_obey_friction_and_close_their_loop(values):
    scene = scene_of(values, EXACT)
    history = jb.solve(scene, two_cycles(float(scene.load.amplitude)), throw=False)
    check_friction_and_contact(history)
    assert abs(float(history.closure)) < 1e-6


@pytest.mark.slow
@few
@given(strips)
def test_the_number_of_load_steps_hardly_matters_and_holding_the_load_not_at_all(values):
    fine, coarse = run(values), run(values, COARSE)
    width = float(jnp.ptp(fine.displacement))
    turns = slice(FINE // 2, None, FINE)
    off = fine.displacement[turns] - coarse.displacement[turns]
    assert float(jnp.max(jnp.abs(off))) < 0.01 * width
    # The cap changes within a step, the more the larger mu is.
    by = abs(float(fine.dissipation / coarse.dissipation) - 1.0)
    nothing = float(fine.dissipation) < 1e-9 * size(fine)
    assert by < 0.02 + 0.3 * values["contact.friction"] or nothing
    holds = np.arange(1, coarse.force.size) % (FINE // COARSE) != 1
    assert float(jnp.max(jnp.abs(jnp.diff(coarse.displacement)[holds]))) < 1e-14 * width
    assert float(jnp.max(jnp.abs(coarse.slip_work[1:][holds]))) < 1e-14 * size(fine)


@few
@given(strips)
def test_the_energy_of_every_step_balances(values):
    """The error is round-off where nothing slips, and of second order where many steps slip."""

    def left(history):
        return np.abs(np.diff(np.asarray(history.energy_imbalance))) / size(history)

    fine, coarse = left(run(values)), left(run(values, COARSE))
    work = np.asarray(run(values).slip_work)[1:]
    assert np.max(fine[work == 0.0], initial=0.0) < 1e-10
    often = np.mean(work > 1e-3 * np.max(work)) > 0.4  # else a coarse step holds all of a slip
    order = np.log(np.sum(coarse) / max(np.sum(fine), 1e-300)) / np.log(FINE / COARSE)
    assert order > 1.5 or not often or np.sum(coarse) < 1e-9


def test_the_bar_is_its_own_mirror_image():
    """Without rotation the reaction is the pressure, and a push is a pull with another sign."""
    bar = STEPPED.replace({"model.section": "bar"})
    there, back = (jb.solve(bar, sign * path(bar), throw=False) for sign in (1.0, -1.0))
    width = float(np.ptp(there.displacement))
    np.testing.assert_allclose(back.displacement, -there.displacement, atol=1e-13 * width)
    np.testing.assert_allclose(back.slip_work, there.slip_work, atol=1e-13 * size(there))


@few
@given(strips, between(0.1, 10.0), between(0.1, 10.0))
def test_the_loop_scales_with_all_forces_all_lengths_and_the_stiffness(values, force, length):
    """Pi theorem, with another unit of force and of length, and the stiffness by itself."""
    one = run(values)
    scaled = {
        "contact.pressure": np.asarray(STEPPED.contact.pressure) * [length, force / length],
        "strip.length": LENGTH * length,
        "strip.axial_stiffness": 2.0 * 3.4e4 * force,
    }
    scene = scene_of(values, **scaled)
    other = jb.solve(scene, force * path(one.scene), throw=False)
    width = float(np.ptp(one.displacement))
    np.testing.assert_allclose(
        2.0 / length * other.displacement, one.displacement, atol=1e-7 * width
    )
    np.testing.assert_allclose(
        2.0 / (force * length) * other.dissipation,
        one.dissipation,
        rtol=1e-6,
        atol=1e-9 * size(one),
    )
    reach = PRESSURE * values["contact.friction"]
    np.testing.assert_allclose(length / force * other.traction, one.traction, atol=1e-6 * reach)


@few
@given(strips)
def test_a_push_first_ends_in_the_same_loop_as_a_pull_first(values):
    scene = scene_of(values)
    pull, push = (
        jb.solve(scene, two_cycles(sign * float(scene.load.amplitude)), throw=False)
        for sign in (1.0, -1.0)
    )
    width = float(np.ptp(pull.displacement))
    # A push is at -A after the first loading, half a cycle ahead.
    up, down = pull.displacement[-5:], pull.displacement[-9:-4]
    ahead = push.displacement[-9:-4], push.displacement[-5:]
    for one, other in zip((up, down), ahead, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-4 * width)
    np.testing.assert_allclose(
        push.dissipation, pull.dissipation, rtol=1e-4, atol=1e-9 * size(pull)
    )


@jax.jit
def _moved(scene, angle, along, up):
    """Strain energies of a rigid motion, and of one that is bent a little."""
    system = System(scene)
    x, still = system.x, jnp.zeros_like(system.x)
    turned = [x * (jnp.cos(angle) - 1.0) + along, x * jnp.sin(angle) + up, still + angle, still]
    rigid = jnp.stack(turned, axis=1)
    bent = rigid.at[:, 2].add(0.01 * x)
    return system.strain_energy(rigid), system.strain_energy(bent)


@pytest.mark.parametrize("model", [{}, {"model.grid": "collocation"}])
@given(values=strips, angle=st.floats(-3.1, 3.1), along=st.floats(-5, 5), up=st.floats(-5, 5))
def test_a_rigid_motion_stores_no_energy(model, values, angle, along, up):
    material = {key: values[key] for key in values if key.startswith("strip")}
    scene = STRIP.replace({"model.nodes": 41} | model | material)
    rigid, bent = _moved(scene, angle, along, up)
    assert abs(float(rigid)) < 1e-18 * float(bent)


# --- hundreds of strips ---------------------------------------------------------------------------


def random_values(random):
    """One of `strips`."""

    def between(low, high):
        return float(np.exp(random.uniform(np.log(low), np.log(high))))

    friction = between(0.02, 1.0)
    return {
        "strip.height_ratio": between(0.005, 0.5),
        "contact.friction": friction,
        "load.amplitude": random.uniform(0.02, 0.98) * friction * 20.0,
        "strip.poisson_ratio": random.uniform(0.0, 0.49),
        "strip.kappa_s": between(0.05, 3.0),
        "contact.stick_stiffness": between(2.0, 1e4),
    }


@pytest.mark.slow(minutes=5)
@pytest.mark.parametrize("smoothing", ["sharp", 16.0])
def test_hundreds_of_random_strips_converge_without_recovery(smoothing):
    random = np.random.default_rng(3)
    base = STRIP.replace({"contact.smoothing": smoothing})
    run = jax.jit(lambda v: jnp.max(jb.solve(base.replace(v), throw=False).status))
    failed = sum(int(run(random_values(random))) > 0 for _ in range(400))
    assert failed == 0


def random_clamp(random):
    """A strip under a bolt-like patch, its end sticking out, pulled to and fro below buckling."""
    length = random.uniform(8.0, 80.0)
    patch, pressure = length * random.uniform(0.3, 0.95), 10 ** random.uniform(0.0, 2.3)
    friction = 10 ** random.uniform(-2.0, 0.0)
    buckling = np.pi**2 * (2.0 / 3.0 * 2.09e5) / (4.0 * (length - patch) ** 2)
    amplitude = min(random.uniform(0.02, 0.98) * friction * pressure * patch, 0.5 * buckling)
    return {
        "strip.length": length,
        "strip.half_height": 1.0,
        "strip.poisson_ratio": random.uniform(0.0, 0.49),
        "strip.kappa_s": 10 ** random.uniform(-1.3, 0.5),
        "contact.stick_stiffness": 10 ** random.uniform(0.3, 4.0),
        "contact.friction": friction,
        "contact.pressure": [[0, pressure], [patch, pressure], [patch, 0.0], [length, 0.0]],
        "load.amplitude": amplitude,
    }


def check_lift(history):
    assert float(np.min(history.gap)) > -1e-9
    assert float(np.min(history.reaction)) > -1e-6 * float(np.max(history.reaction))


def test_a_contact_that_goes_round_in_circles_is_found_node_by_node():
    # The overhang lies on the foundation almost without pressure, with a gap of 1e-9 H at most.
    length, patch, pressure = 74.14693231686438, 28.683243705831167, 7.221957102710951
    clamp = {
        "strip.length": length,
        "strip.half_height": 1.0,
        "strip.poisson_ratio": 0.2008159601237034,
        "strip.kappa_s": 1.386771473292275,
        "contact.stick_stiffness": 2.3475173273096646,
        "contact.friction": 0.7971740930774074,
        "contact.pressure": [[0, pressure], [patch, pressure], [patch, 0.0], [length, 0.0]],
    }
    history = jb.solve(STEPPED.replace(clamp), held_at([21.272827844424842]), throw=False)
    assert history.converged
    assert int(np.max(history.iterations)) > 100
    check_lift(history)


@pytest.mark.slow(minutes=2)
def test_random_clamps_lift_and_touch_again_and_balance_their_energy():
    random = np.random.default_rng(1)
    base = library.receding_rough().by_load_steps().on_grid(201, 0.02)
    for _ in range(100):
        history = jb.solve(base.replace(random_clamp(random)))
        check_lift(history)
        scale = float(history.peak_displacement * jnp.max(history.force))
        # What is left of the balance comes from touching down within a load step.
        difference = float(history.dissipation_loop - history.dissipation)
        assert abs(difference) < max(0.01 * float(history.dissipation), 1e-5 * scale)
        assert float(np.min(history.slip_work)) >= -1e-12 * size(history)
        assert abs(float(history.closure)) < 1e-4
