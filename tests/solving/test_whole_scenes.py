"""Transformations over whole scenes: jit, vmap and grad give what `jbeamshell.solve` gives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb

FEW = {"model.nodes": 17, "load.steps_per_half_cycle": 2, "load.cycles": 1}
SQUEEZE = FEW | {"model.section": "squeeze"}
JOINT = {"strip.far_end": "free", "member.support": "rolling"}
KINDS = {
    "plane": FEW | {"model.section": "plane"},
    "contact line": SQUEEZE,
    "elastic sliders that are moved": SQUEEZE
    | {
        "contact.stick_stiffness": 50.0,
        "load.control": "displacement",
        "load.amplitude": 2e-5,
    },
    "lap joint": SQUEEZE | JOINT | {"load.amplitude": 1.5},
    "exact rotations": SQUEEZE | {"model.kinematics": "exact"},
}
STEP = 1e-5  # of every number, for differences


def dissipation(scene):
    history = jb.solve(scene, throw=False)
    pressed = history.reaction * history.tributary  # stresses of short elements round off
    return history.dissipation, (history.force, history.displacement, pressed)


@pytest.mark.parametrize("kind", KINDS)
def test_whole_scenes_may_be_compiled_stacked_and_differentiated(kind):
    one = jb.Scene().replace(KINDS[kind]).pinned()
    scenes = [one, one.replace({"contact.friction": 0.11})]
    stacked = jax.tree.map(lambda *numbers: jnp.stack(numbers), *scenes)
    both = jax.jit(jax.vmap(jax.value_and_grad(dissipation, has_aux=True)))
    found, gradient = both(stacked)
    for place, scene in enumerate(scenes):
        alone = dissipation(scene)
        force, displacement, pressed = (float(jnp.max(jnp.abs(column))) for column in alone[1])
        scales = force * displacement, force, displacement, pressed
        columns = zip(jax.tree.leaves(found), jax.tree.leaves(alone), scales, strict=True)
        for lanes, expected, scale in columns:
            np.testing.assert_allclose(lanes[place], expected, rtol=0.0, atol=1e-10 * scale)

    leaves, tree = jax.tree.flatten(one)
    parts = np.random.default_rng(0).uniform(-1.0, 1.0, len(leaves))

    def moved(step):
        numbers = [
            leaf * np.asarray(1.0 + step * part) for leaf, part in zip(leaves, parts, strict=True)
        ]
        return float(dissipation(jax.tree.unflatten(tree, numbers))[0])

    slopes = [
        part * np.sum(leaf * slope[0])
        for part, leaf, slope in zip(parts, leaves, jax.tree.leaves(gradient), strict=True)
    ]
    difference = (moved(STEP) - moved(-STEP)) / (2.0 * STEP)
    assert np.sum(slopes) == pytest.approx(difference, rel=1e-4)
