"""Small problems on the processor, with one thread of LAPACK.

Matrices of a strip are so small that threads of LAPACK wait for each other longer than they work.
Beside busy processes they make a run 3 to 20 times as long.  A graphics card is slower still: on an
H200 a run takes 6 times, and a sweep of 1,600 lanes 50 times, as long as on the processor beside
it.
"""

from __future__ import annotations

import contextlib
import functools
import os
import threading
from collections.abc import Callable, Iterator
from typing import Any, ParamSpec, TypeVar

import jax
from threadpoolctl import ThreadpoolController

VARIABLE = "OPENBLAS_NUM_THREADS"  # which `jbeamshell.configure` sets
PLATFORMS = "JAX_PLATFORMS"
P = ParamSpec("P")
R = TypeVar("R")


class _Limit:
    """Limit of LAPACK's threads, which calls that overlap share: the last one lifts it."""

    def __init__(self) -> None:
        self._lock, self._calls = threading.Lock(), 0
        self._before: Any = None

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Context in which LAPACK has one thread."""
        with self._lock:
            if self._calls == 0:
                self._before = _lapack().limit(limits=1)
            self._calls += 1
        try:
            yield
        finally:
            with self._lock:
                self._calls -= 1
                if self._calls == 0:
                    self._before.restore_original_limits()


_LIMIT = _Limit()


def on_one_core(function: Callable[P, R]) -> Callable[P, R]:
    """Function that runs on the processor, during which LAPACK has one thread.

    A device that ``jax.default_device`` or `PLATFORMS` names stays, and so does the number of
    threads that `VARIABLE` says.
    """

    @functools.wraps(function)
    def limited(*args: P.args, **options: P.kwargs) -> R:
        with _processor():
            if os.environ.get(VARIABLE):
                return function(*args, **options)
            with _LIMIT.held():
                return function(*args, **options)

    return limited


def on_processor() -> bool:
    """True if new arrays lie on the processor."""
    config: Any = jax.config
    device = config.jax_default_device
    name = getattr(device, "platform", device) or jax.default_backend()  # a device may be its name
    return str(name).startswith("cpu")


def _processor() -> contextlib.AbstractContextManager[object]:
    """Context in which new arrays lie on the processor, unless the user chose a device."""
    config: Any = jax.config
    chosen = config.jax_default_device is not None or PLATFORMS in os.environ
    if chosen or on_processor():
        return contextlib.nullcontext()
    return jax.default_device(jax.local_devices(backend="cpu")[0])


@functools.cache
def _lapack() -> ThreadpoolController:
    """Controller of the libraries of NumPy and of SciPy; JAX calls the latter on a CPU."""
    import scipy.linalg.lapack  # noqa: F401  (loads the library)

    return ThreadpoolController().select(user_api="blas")
