"""Compiler options of small programs: those that this release of JAX knows."""

import jax

from jbeamshell.common import small


def test_an_option_that_the_compiler_does_not_know_is_left_out():
    assert small._is_known("xla_backend_optimization_level", 1)
    assert not small._is_known("xla_cpu_no_such_option", 1)


def test_small_programs_take_only_known_options(monkeypatch):
    monkeypatch.setattr(small, "QUICK", {"xla_cpu_no_such_option": 1})
    jax.config.update("jax_disable_most_optimizations", False)
    try:
        assert small.quick_options.__wrapped__() == {}
    finally:
        jax.config.update("jax_disable_most_optimizations", True)
    assert small.quick_options.__wrapped__() is None
