"""One native function: the same values, whatever is in it."""

import importlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.common.native import Native, Program, one_call


def looped(x, y):
    """A loop, a gather, a scatter that is a slice, and a product."""
    turned = jax.lax.fori_loop(0, 7, lambda i, at: at.at[i % 5].add(x * at[i % 3]), jnp.ones(5))
    return {"turned": jnp.outer(turned, turned) @ turned, "y": jnp.cos(y)}


def sorted_by_compiler(x, y):
    return {"turned": jnp.sort(jnp.sin(jnp.arange(9.0) * x)), "y": y}


def scattered(x, y):
    index = (jnp.arange(40.0) * x * 97.0).astype(int) % 11
    return {"turned": jnp.zeros(11).at[index].add(1.0 + jnp.arange(40.0)), "y": y}


def factorised(x, y):
    return {"turned": jnp.linalg.eigh(jnp.eye(3) + x)[0], "y": y}


def called_back(x, y):
    like = jax.ShapeDtypeStruct((), x.dtype)
    return {"turned": jax.pure_callback(lambda a: np.asarray(a) * 2.0, like, x), "y": y}


@pytest.mark.parametrize(
    ("function", "fits"),
    [
        (looped, True),
        (sorted_by_compiler, False),
        (scattered, None),  # by the compiler's release and options
        (factorised, False),
        (called_back, False),
    ],
)
def test_values_are_the_function_s(function, fits):
    native, given = Native(function), (jnp.asarray(0.3), jnp.asarray(0.4))
    for _ in range(2):  # the second time what was found is known
        found, expected = native.now(*given), jax.jit(function)(*given)
        assert native.fits is not None if fits is None else native.fits is fits
        for name, value in found.items():
            np.testing.assert_allclose(value, expected[name], rtol=1e-14)


def test_many_arrays_go_into_one_call_together():
    """One by one, some twenty end the process within the compiler."""
    counts, truths = [jnp.asarray(3)] * 12, [jnp.asarray(True)] * 12

    def function(counts, truths, x, y):
        return looped(jnp.where(truths[3], x, 0.0) * counts[7], y)

    native, given = Native(function), (counts, truths, jnp.asarray(0.1), jnp.asarray(0.4))
    found, expected = native.now(*given), looped(jnp.asarray(0.3), jnp.asarray(0.4))
    assert native.fits is True
    for name, value in found.items():
        np.testing.assert_allclose(value, expected[name], rtol=1e-14)


def test_it_is_for_numbers_only():
    native = Native(looped)
    assert jax.jit(native.now)(0.3, 0.4) is None
    assert jax.vmap(native.now, (0, None))(jnp.linspace(0.1, 0.9, 4), 0.4) is None
    assert native.fits is None  # not asked
    inside = jax.jit(lambda x: x * native.now(0.3, 0.4)["y"])  # numbers that do not depend on x
    np.testing.assert_allclose(inside(2.0), 2.0 * np.cos(0.4))
    assert native.fits is True


def test_what_is_not_worth_it_is_not_tried():
    native = Native(looped, worth=False)
    np.testing.assert_allclose(native.now(0.3, 0.4)["y"], np.cos(0.4))
    assert native.fits is False


def test_a_response_is_native(monkeypatch):
    numbers = {"model.nodes": 11, "model.kinematics": "linear", "load.steps_per_half_cycle": 2}
    scene = jb.Scene().replace(numbers | {"load.cycles": 1}).by_load_steps()
    made = []

    def native(*given, **more):
        made.append(Native(*given, **more))
        return made[-1]

    module = importlib.import_module("jbeamshell.solving.response")  # jb.response is a function
    monkeypatch.setattr(module, "Native", native)
    found = jb.response(scene, ("load.amplitude",))(scene.load.amplitude)
    assert made[0].fits is True
    assert found["status"] == 0
    alone = jb.solve(scene, throw=False)
    np.testing.assert_allclose(found["dissipation"], alone.dissipation, rtol=1e-9)
    module._programs.cache_clear()  # no other test gets what was made here


def test_a_response_of_a_traced_scene():
    small = {"model.nodes": 11, "model.section": "bar", "model.kinematics": "linear"}
    small |= {"load.cycles": 1, "load.steps_per_half_cycle": 2}
    scene = jb.Scene().replace(small).by_load_steps()

    def of_height(ratio):
        ask = jb.response(scene.replace({"strip.height_ratio": ratio}), ("load.amplitude",))
        return ask(scene.load.amplitude)["dissipation"]

    found = jax.jit(of_height)(scene.strip.height_ratio)
    np.testing.assert_allclose(found, jb.solve(scene, throw=False).dissipation, rtol=1e-9)


def polynomial(x, coefficients, power, native):
    def body(i, at):
        return at * x**power + coefficients[i]

    def loop(x):
        return jax.lax.fori_loop(0, 3, body, jnp.zeros_like(x))

    return one_call(loop, x) if native else loop(x)


class TestProgram:
    @pytest.fixture
    def optimised(self):
        jax.config.update("jax_disable_most_optimizations", False)
        yield
        jax.config.update("jax_disable_most_optimizations", True)

    def test_native_calls_and_plain_ones_have_the_same_values(self, optimised):
        function, x, given = Program(polynomial), jnp.asarray(0.7), np.array([1.0, -2.0, 3.0])
        expected = (1.0 * 0.49 - 2.0) * 0.49 + 3.0
        for native in (True, False):
            assert function(x, given, 2, native=native) == pytest.approx(expected, rel=1e-14)

    def test_the_first_run_has_the_digits_of_the_hundredth(self, optimised):
        few = {"model.nodes": 5, "model.section": "bar", "model.kinematics": "exact"}
        few |= {"load.cycles": 1, "load.steps_per_half_cycle": 2}
        scene = jb.Scene().replace(few).by_load_steps()
        first, *rest = (jb.solve(scene, throw=False) for _ in range(100))
        assert first.converged
        for name in ("force", "displacement", "traction", "slip_work"):
            values = np.asarray(getattr(first, name))
            assert all(np.array_equal(values, getattr(history, name)) for history in rest)

    def test_one_program_serves_values_of_one_kind(self):
        function, given = Program(polynomial), np.array([1.0, -2.0, 3.0])
        for x, power in ((0.7, 2), (0.8, 2), (0.7, 3)):
            function(jnp.asarray(x), given, power)
        assert function._compiled[True]._cache_size() == 2

    def test_what_cannot_be_one_call_runs_as_it_is(self):
        def sorted_by_compiler(x, native):
            return one_call(jnp.sort, x) if native else jnp.sort(x)

        function, x = Program(sorted_by_compiler), jnp.asarray([3.0, 1.0, 2.0])
        for _ in range(2):
            assert function(x).tolist() == [1.0, 2.0, 3.0]
        assert len(function._refused) == 1

    def test_other_errors_of_the_compiler_pass(self):
        def failing(x, native):
            raise jax.errors.JaxRuntimeError("out of memory")

        with pytest.raises(jax.errors.JaxRuntimeError, match="out of memory"):
            Program(failing)(jnp.asarray(1.0))

    def test_it_goes_into_every_transformation(self):
        function, x = Program(polynomial), jnp.asarray(0.7)
        given = jnp.asarray([1.0, -2.0, 3.0])

        def of(x):
            return function(x, given, 2)

        slope = 4.0 * x**3 - 4.0 * x
        assert jax.jit(of)(x) == pytest.approx(of(x))
        assert jax.jacfwd(of)(x) == pytest.approx(slope)
        assert jax.grad(of)(x) == pytest.approx(slope)
        both = jax.vmap(of)(jnp.stack([x, 2.0 * x]))
        np.testing.assert_allclose(both, [of(x), of(2.0 * x)])
