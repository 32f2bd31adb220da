"""Invariants of any strip: signs, balances, symmetries and scalings over random scenes."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from toy import STRIP

import jbeamshell as jb
from jbeamshell.load_steps.system import System

# Random beamshells on 41 nodes: what slips may be a corner, or nothing.
pytestmark = pytest.mark.doubtful(
    "within a load step", "few nodes", "in the corner", "single nodes", "nothing slips", "section"
)

# One compiled shape for all that cycles; linear kinematics, for which scalings are exact.
BASE = {"model.nodes": 41, "model.section": "squeeze", "model.kinematics": "linear"}
FINE, COARSE = 8, 2  # load steps per half cycle
ROUNDS = 4  # steps for every coarse one; what is left of them holds the load
PRESSURE, LENGTH = 10.0, 2.0
# Shrinking a failure would run for minutes.
few = settings(max_examples=10, phases=[Phase.generate])


def between(low, high):
    """Numbers spread evenly over their logarithm."""
    return st.floats(np.log(low), np.log(high)).map(lambda x: float(np.exp(x)))


strips = st.fixed_dictionaries(
    {
        "strip.height_ratio": between(0.005, 0.5),
        "contact.friction": between(0.02, 1.0),
        "strip.poisson_ratio": st.floats(0.0, 0.49),
        "strip.kappa_s": between(0.05, 3.0),
        "contact.stick_stiffness": between(2.0, 1e4),
        "load.amplitude": st.floats(0.02, 0.98),  # of gross slip
    }
)


def scene_of(values, **more):
    gross = values["contact.friction"] * PRESSURE * LENGTH
    loaded = values | {"load.amplitude": values["load.amplitude"] * gross}
    return STRIP.replace(BASE | loaded | more)


def path(scene, steps=FINE, first=1.0):
    """Path to the amplitude and two cycles from there, in equal steps, with or without holds."""
    half = steps // 2
    there = np.arange(1, half + 1) / half
    back = 1.0 - 2.0 * np.arange(1, steps + 1) / steps
    levels = np.concatenate([there, *[back, -back] * 2])
    return first * float(scene.load.amplitude) * np.repeat(levels, FINE // steps)


@functools.cache
def _run(items, steps, first):
    scene = scene_of(dict(items))
    return jb.solve(scene, path(scene, steps, first))


def run(values, steps=FINE, first=1.0):
    return _run(tuple(values.items()), steps, first)


def size(history):
    """Scale of energies: the largest work of a branch."""
    return float(jnp.max(jnp.abs(history.force)) * jnp.ptp(history.displacement))


@few
@given(strips)
def test_friction_and_contact_keep_their_signs(values):
    history = run(values)
    pressure = PRESSURE * 1e-9
    cap = history.scene.contact.friction * jnp.maximum(history.reaction, 0.0)
    assert bool(jnp.all(jnp.abs(history.traction) <= cap + values["contact.friction"] * 1e-4))
    assert float(jnp.min(history.slip_work)) >= -1e-12 * size(history)
    assert float(jnp.min(history.reaction)) > -pressure
    assert float(jnp.min(history.gap)) > -1e-12 * LENGTH
    tension = history.gap * history.reaction / (LENGTH * PRESSURE)
    assert float(jnp.max(jnp.abs(tension))) < 1e-9


@few
@given(strips)
def test_displacements_follow_the_force(values):
    history = run(values)
    moves = np.diff(np.asarray(history.displacement)) * np.sign(np.diff(history.force))
    assert np.min(moves) > 0.01 * np.ptp(np.asarray(history.displacement)) / FINE


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


@few
@given(strips)
def test_a_push_first_ends_in_the_same_loop_as_a_pull_first(values):
    pull, push = run(values), run(values, FINE, -1.0)
    width = float(jnp.ptp(pull.displacement))
    # A push is at -A after the first loading, half a cycle ahead.
    up, down = pull.displacement[-FINE - 1 :], pull.displacement[-2 * FINE - 1 : -FINE]
    ahead = push.displacement[-2 * FINE - 1 : -FINE], push.displacement[-FINE - 1 :]
    for one, other in zip((up, down), ahead, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-4 * width)
    np.testing.assert_allclose(
        push.dissipation, pull.dissipation, rtol=1e-4, atol=1e-9 * size(pull)
    )


@few
@given(strips)
def test_the_bar_is_its_own_mirror_image(values):
    """Without rotation the reaction is the pressure, and a push is a pull with another sign."""
    scene = scene_of(values)
    bar = scene.replace({"model.section": "bar"})
    levels = path(scene)
    there, back = jb.solve(bar, levels), jb.solve(bar, -levels)
    width = float(jnp.ptp(there.displacement))
    np.testing.assert_allclose(back.displacement, -there.displacement, atol=1e-13 * width)
    np.testing.assert_allclose(back.slip_work, there.slip_work, atol=1e-13 * size(there))


@few
@given(strips, between(0.1, 10.0))
def test_a_stiffer_strip_moves_less_by_as_much(values, factor):
    soft, stiff = run(values), run(values | {"strip.axial_stiffness": 3.4e4 * factor})
    width = float(jnp.ptp(soft.displacement))
    np.testing.assert_allclose(factor * stiff.displacement, soft.displacement, atol=1e-7 * width)
    reach = PRESSURE * values["contact.friction"]
    np.testing.assert_allclose(stiff.traction, soft.traction, atol=1e-6 * reach)


@few
@given(strips, between(0.1, 10.0))
def test_all_forces_together_scale_the_loop(values, factor):
    one = run(values)
    scene = scene_of(values, **{"contact.pressure": PRESSURE * factor})
    other = jb.solve(scene, factor * path(one.scene))
    width = float(jnp.ptp(one.displacement))
    np.testing.assert_allclose(
        other.displacement, factor * one.displacement, atol=1e-7 * factor * width
    )
    np.testing.assert_allclose(
        other.dissipation, factor**2 * one.dissipation, rtol=1e-6, atol=1e-9 * size(one)
    )


@few
@given(strips, between(0.1, 10.0))
def test_all_lengths_together_scale_the_loop(values, factor):
    one = run(values)
    larger = {"strip.length": LENGTH * factor, "strip.axial_stiffness": 3.4e4 * factor}
    other = jb.solve(scene_of(values, **larger), factor * path(one.scene))
    width = float(jnp.ptp(one.displacement))
    np.testing.assert_allclose(
        other.displacement, factor * one.displacement, atol=1e-7 * factor * width
    )
    np.testing.assert_allclose(
        other.dissipation, factor**2 * one.dissipation, rtol=1e-6, atol=1e-9 * size(one)
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
