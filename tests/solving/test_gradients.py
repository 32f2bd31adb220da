"""Derivatives of whole load paths: Taylor slopes, forward against reverse, batches."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import FEW, HELD, PLANE, SQUEEZE
from toy import STRIP

import jbeamshell as jb
from jbeamshell.mechanics.friction import ElasticSlip

LAP = {"strip.far_end": "free", "member.support": "rolling"}
EXACT = {"model.section": "squeeze", "model.kinematics": "exact"}
SCENES = {
    "plane": PLANE.replace({"strip.overhang": 0.15}),
    "lap joint with elastic sliders that is moved": SQUEEZE.replace(
        LAP
        | {
            "contact.stick_stiffness": 50.0,
            "load.control": "displacement",
            "load.amplitude": 2e-5,
        }
    ),
    "load steps": HELD,
    "smooth load steps": HELD.replace({"contact.law": ElasticSlip(16.0)}),
    "contact line": SQUEEZE,
    "lap joint": SQUEEZE.replace(LAP | {"load.amplitude": 1.5}),
    "exact rotations": jb.Scene().replace(FEW | EXACT | {"model.nodes": 17}),
}
ORDINARY = list(SCENES)[:3]


def dissipation(scene):
    history = jb.solve(scene, throw=False)
    pressed = history.reaction * history.tributary  # stresses of short elements round off
    return history.dissipation, (history.force, history.displacement, pressed)


@pytest.mark.parametrize(
    "name",
    ORDINARY + [pytest.param(n, marks=pytest.mark.slow) for n in SCENES if n not in ORDINARY],
)
def test_whole_scenes_may_be_compiled_stacked_and_differentiated(name):
    """Lanes are the scenes alone, and the slope over all numbers is that of the Taylor test."""
    one = SCENES[name]
    leaves, tree = jax.tree.flatten(one)
    parts = np.random.default_rng(0).uniform(-1.0, 1.0, len(leaves))

    def moved(step):
        numbers = [
            np.asarray(leaf) * (1.0 + step * p) for leaf, p in zip(leaves, parts, strict=True)
        ]
        return jax.tree.unflatten(tree, numbers)

    # Small enough that no node changes between sticking and slipping on the way; a displacement in
    # load steps is met to 1e-8 of the work, which small steps would see.
    steps = (1.6e-3 if "moved" in name else 2e-4) * np.array([1.0, 0.5, 0.25])
    scenes = [moved(step) for step in (0.0, *steps)]
    stacked = jax.tree.map(lambda *numbers: np.stack(numbers), *scenes)
    both = jax.jit(jax.vmap(jax.value_and_grad(dissipation, has_aux=True)))
    found, gradient = both(stacked)
    for place, scene in enumerate(scenes[:2]):
        alone = dissipation(scene)
        force, displacement, pressed = (float(np.max(np.abs(column))) for column in alone[1])
        scales = force * displacement, force, displacement, pressed
        columns = zip(jax.tree.leaves(found), jax.tree.leaves(alone), scales, strict=True)
        for lanes, expected, scale in columns:
            np.testing.assert_allclose(lanes[place], expected, rtol=0.0, atol=1e-10 * scale)
    slope = sum(
        part * np.sum(leaf * slopes[0])
        for part, leaf, slopes in zip(parts, leaves, jax.tree.leaves(gradient), strict=True)
    )
    lost = np.asarray(found[0])
    left = np.abs(lost[1:] - lost[0] - steps * float(slope))
    assert np.polyfit(np.log(steps), np.log(left), 1)[0] == pytest.approx(2.0, abs=0.1), left
    if name == "load steps":
        names = jax.tree_util.tree_flatten_with_path(one)[0]
        still = {
            path[-1].name
            for (path, _), slopes in zip(names, jax.tree.leaves(gradient), strict=True)
            if not np.any(slopes)
        }
        # Of no use where the lift is frozen, and in a section that is not squeezed.
        assert still == {"normal_stiffness", "kappa_s"}


KEYS = ("contact.friction", "strip.height_ratio", "strip.kappa_s", "contact.stick_stiffness")
AT = np.array([0.1, 0.1126, 0.44, 900.0])


@pytest.mark.slow
def test_forward_and_reverse_agree_and_batches_equal_loops():
    def lost(values):
        scene = STRIP.replace(FEW | {"model.nodes": 41} | dict(zip(KEYS, values, strict=True)))
        return jb.solve(scene, throw=False).dissipation

    sharp = jax.jit(jax.value_and_grad(lost))
    reverse, forward = sharp(AT)[1], jax.jit(jax.jacfwd(lost))(AT)
    np.testing.assert_allclose(forward, reverse, rtol=1e-8)
    points = AT * np.array([[1.0], [1.1], [0.8]])
    batch = jax.jit(jax.vmap(lost))(points)
    np.testing.assert_allclose(batch, [sharp(p)[0] for p in points], rtol=1e-10)
    for i in range(len(KEYS)):
        direction = np.zeros(4)
        direction[i] = AT[i]
        sizes = np.array([4e-4, 2e-4, 1e-4, 5e-5])
        value = sharp(AT)[0]
        rest = [
            abs(float(sharp(AT + h * direction)[0] - value - h * reverse @ direction))
            for h in sizes
        ]
        slope = np.polyfit(np.log(sizes), np.log(rest), 1)[0]
        assert slope == pytest.approx(2.0, abs=0.1), KEYS[i]


BAR = jb.Scene().replace({"model.section": "bar"})


@pytest.mark.parametrize(
    ("scene", "status"),
    [
        (BAR, jb.Status.MAX_ITERATIONS),
        pytest.param(STRIP, jb.Status.NOT_REACHED, marks=pytest.mark.slow),
    ],
    ids=["contact line", "load steps"],
)
def test_a_traced_force_beyond_gross_slip_has_no_result_and_no_derivative(scene, status):
    few = {"model.nodes": 9, "model.kinematics": "linear", "load.steps_per_half_cycle": 2}
    keys = ["contact.friction", "load.amplitude", "strip.axial_stiffness"]
    ask = jb.response(scene.replace(few), keys)

    def dissipation(*values):
        found = ask(*values)
        return found["dissipation"], found["status"]

    of_lane = jax.value_and_grad(dissipation, (0, 1, 2), has_aux=True)
    lanes = jax.jit(jax.vmap(of_lane, (0, None, None)))
    (lost, found), slopes = lanes(jnp.array([0.04, 0.039]), 0.7855, 3.4e4)  # mu F_N L = 0.8, 0.78
    assert found.tolist() == [0, status]
    assert np.isnan(lost).tolist() == [False, True]
    assert np.isnan(slopes).tolist() == [[False, True]] * 3


def test_a_response_takes_one_number_of_each_key():
    ask = jb.response(BAR, ["contact.friction", "load.amplitude"])
    with pytest.raises(jb.InputError, match=r"contact.friction: is an array of shape \(2,\): give"):
        ask(np.array([0.1, 0.2]), 1.0)
    with pytest.raises(jb.InputError, match="needs as many numbers, not 1"):
        ask(0.1)
