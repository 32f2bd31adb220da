"""Responses: of traced scenes, and of numbers that are known while another function is traced."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import FEW, STEPPED

import jbeamshell as jb
from jbeamshell.common.checks import is_traced
from jbeamshell.solving.response import RESPONSES

BAR = {"model.section": "bar"}  # compiles soonest
SCENES = {"contact line": jb.Scene().replace(FEW | BAR), "load steps": STEPPED.replace(BAR)}


def test_a_response_of_a_traced_scene():
    scene = SCENES["load steps"]

    def of_height(ratio):
        ask = jb.response(scene.replace({"strip.height_ratio": ratio}), ("load.amplitude",))
        return ask(scene.load.amplitude)["dissipation"]

    found = jax.jit(of_height)(scene.strip.height_ratio)
    known = jb.response(scene, ("load.amplitude",))(scene.load.amplitude)["dissipation"]
    np.testing.assert_allclose(found, known, rtol=1e-9)


@pytest.mark.parametrize("name", SCENES)
def test_known_numbers_are_answered_now_while_another_function_is_traced(name):
    """They are no part of its program, and nothing that it traces stays in the response."""
    ask, answers = jb.response(SCENES[name], ("load.amplitude",)), []

    def twice(x):
        answers.append(ask(0.5)["dissipation"])
        return x * answers[-1]

    with jax.checking_leaks():
        inside = jax.jit(twice)(2.0)
    assert not is_traced(answers)
    alone = ask(0.5)["dissipation"]
    assert float(answers[0]) == float(alone)
    assert float(inside) == float(2.0 * alone)
    assert float(jax.grad(twice)(3.0)) == float(alone)
    many = jax.vmap(twice)(jnp.array([1.0, 2.0]))
    np.testing.assert_array_equal(many, [alone, 2.0 * alone])
    operations = {equation.primitive.name for equation in jax.make_jaxpr(twice)(1.0).eqns}
    # The compiled function asks whether a function is staged out.
    assert operations <= {"jit", "mul", "convert_element_type"}


def test_a_number_may_be_of_any_kind():
    ask = jb.response(SCENES["contact line"], ("load.amplitude",))
    found = [
        ask(x)["dissipation"] for x in (1, 1.0, np.float64(1.0), np.asarray(1), jnp.asarray(1.0))
    ]
    assert len({float(value) for value in found}) == 1
    within = jax.jit(lambda x: ask(x)["dissipation"])(1.0)
    np.testing.assert_allclose(within, found[0], rtol=1e-9)


def test_every_figure_can_be_traced():
    ask = jb.response(jb.Scene(), ("load.amplitude",), RESPONSES)
    found = jax.eval_shape(ask, 0.5)
    assert set(found) == {*RESPONSES, "status"}


def test_whether_a_run_converged_is_its_status():
    with pytest.raises(jb.InputError, match="figures = 'converged': choose 'force'"):
        jb.response(jb.Scene(), ("load.amplitude",), ("converged",))
