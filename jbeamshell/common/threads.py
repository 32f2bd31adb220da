"""One thread for LAPACK while small problems are solved.

Matrices of a strip are so small that threads of LAPACK wait for each other longer than they work.
Beside busy processes they make a run 3 to 20 times as long.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

VARIABLE = "OPENBLAS_NUM_THREADS"  # which `jbeamshell.configure` sets
P = ParamSpec("P")
R = TypeVar("R")


def in_one_lapack_thread(function: Callable[P, R]) -> Callable[P, R]:
    """Function during which LAPACK has one thread, unless `VARIABLE` says how many it has."""

    @functools.wraps(function)
    def limited(*args: P.args, **options: P.kwargs) -> R:
        if os.environ.get(VARIABLE):
            return function(*args, **options)
        with _lapack().limit(limits=1):
            return function(*args, **options)

    return limited


@functools.cache
def _lapack() -> ThreadpoolController:
    """Controller of the library that JAX calls on a CPU, which is SciPy's."""
    import scipy.linalg.lapack  # noqa: F401  (loads the library)

    return ThreadpoolController().select(user_api="blas")
