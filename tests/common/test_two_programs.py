"""Tests of functions with two programs: the same values by each, and which of them runs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jbeamshell.common.native import one_call
from jbeamshell.common.two_programs import TwoPrograms


def polynomial(x, coefficients, power, native):
    def body(i, at):
        return at * x**power + coefficients[i]

    def loop(x):
        return jax.lax.fori_loop(0, 3, body, jnp.zeros_like(x))

    return one_call(loop, x) if native else loop(x)


def sorted_by_compiler(x, native):
    found = one_call(jnp.sort, x) if native else jnp.sort(x)
    return found, native


@pytest.fixture
def optimised():
    jax.config.update("jax_disable_most_optimizations", False)
    yield
    jax.config.update("jax_disable_most_optimizations", True)


def test_values_are_the_same_before_and_after_the_second_compilation(optimised):
    function, x, given = TwoPrograms(polynomial), jnp.asarray(0.7), np.array([1.0, -2.0, 3.0])
    expected = (1.0 * 0.49 - 2.0) * 0.49 + 3.0

    def compiled():
        return {name: made._cache_size() for name, made in function._compiled.items()}

    assert function(x, given, 2) == pytest.approx(expected, rel=1e-14)
    assert compiled() == {"first": 1, "often": 0, "ordinary": 0}
    program = next(iter(function._patience))
    left = function._patience[program]
    assert left > 0.0  # the time of the first call, which compiled
    function(x, given, 2)
    assert function._patience[program] < left
    function._patience[program] = -1.0
    for _ in range(2):
        assert function(x, given, 2) == pytest.approx(expected, rel=1e-14)
    assert compiled() == {"first": 1, "often": 1, "ordinary": 0}
    assert function(x, given, 2, native=False) == pytest.approx(expected, rel=1e-14)
    assert compiled() == {"first": 1, "often": 1, "ordinary": 1}


def test_values_of_other_shapes_and_settings_have_their_own_patience():
    function, given = TwoPrograms(polynomial), np.array([1.0, -2.0, 3.0])
    function(jnp.asarray(0.7), given, 2)
    function._patience = dict.fromkeys(function._patience, -1.0)
    function(jnp.asarray(0.7), given, 3)
    function(jnp.linspace(0.0, 1.0, 5), given, 2)
    assert sorted(left > 0.0 for left in function._patience.values()) == [False, True, True]


def test_without_optimisations_there_is_one_program():
    function = TwoPrograms(polynomial)
    assert function._compiled["first"] is function._compiled["often"]


def test_what_cannot_be_one_call_runs_as_it_is():
    function, x = TwoPrograms(sorted_by_compiler), jnp.asarray([3.0, 1.0, 2.0])
    for _ in range(2):
        found, native = function(x)
        assert found.tolist() == [1.0, 2.0, 3.0]
        assert not native


def test_other_errors_of_the_compiler_pass():
    def failing(x, native):
        raise jax.errors.JaxRuntimeError("out of memory")

    with pytest.raises(jax.errors.JaxRuntimeError, match="out of memory"):
        TwoPrograms(failing)(jnp.asarray(1.0))


def test_it_goes_into_every_transformation():
    function, x, given = TwoPrograms(polynomial), jnp.asarray(0.7), jnp.asarray([1.0, -2.0, 3.0])

    def slope(x):
        return 4.0 * x**3 - 4.0 * x

    assert jax.jit(lambda x: function(x, given, 2))(x) == pytest.approx(function(x, given, 2))
    assert jax.jacfwd(lambda x: function(x, given, 2))(x) == pytest.approx(slope(x))
    assert jax.grad(lambda x: function(x, given, 2))(x) == pytest.approx(slope(x))
    both = jax.vmap(lambda x: function(x, given, 2))(jnp.stack([x, 2.0 * x]))
    np.testing.assert_allclose(both, [function(x, given, 2), function(2.0 * x, given, 2)])
