"""Calculations apart from a transformation that is being traced."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import jax

from jbeamshell.common.checks import is_staged

R = TypeVar("R")


def apart(function: Callable[[], R]) -> R:
    """Result of a function of no tracers, found at once, also while another function is traced.

    A thread of its own finds it then, because transformations belong to a thread.  Under
    `jax.ensure_compile_time_eval` each operation on constants would be compiled by itself.
    """
    if not is_staged():
        return function()
    config: Any = jax.config
    x64, device = config.jax_enable_x64, config.jax_default_device

    def elsewhere() -> R:
        with jax.enable_x64(x64), jax.default_device(device):
            return function()

    with ThreadPoolExecutor(1) as thread:
        return thread.submit(elsewhere).result()
