"""Progress for people who watch: bars on a terminal and in a notebook, and nothing elsewhere."""

from __future__ import annotations

import contextlib
import contextvars
import functools
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import jax.monitoring

DELAY = 1.0  # seconds before anything is shown
TICK = 1.0  # seconds between two signs of life
WORTH_TELLING = 0.5  # seconds of compilation
COMPILE = "/jax/core/compile/"  # events of JAX: tracing, lowering, compiling
_shows: contextvars.ContextVar[bool] = contextvars.ContextVar("_shows", default=False)


def in_notebook() -> bool:
    """True in a notebook's kernel."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell is not None and "IPKernelApp" in shell.config


def watched() -> bool:
    """True if a person watches: standard error is a terminal, or this is a notebook."""
    return in_notebook() or sys.stderr.isatty()


@contextlib.contextmanager
def bar(what: str, unit: str = "step", **options: Any) -> Iterator[Any]:
    """Progress bar of tqdm, which shows nothing unless a person watches.

    Parameters
    ----------
    what : words before the bar
    unit : name of what is counted
    options : further arguments of ``tqdm``
    """
    if in_notebook():
        with warnings.catch_warnings():  # changes the filters of all threads
            warnings.simplefilter("ignore")  # without widgets, where the bar is text
            from tqdm.auto import tqdm
    else:
        from tqdm import tqdm
    if not watched():
        options["disable"] = True  # else as the environment says: TQDM_DISABLE=1
    looks = {"desc": what, "unit": unit, "file": sys.stderr, "leave": False, "delay": DELAY}
    with tqdm(**looks, **options) as shown:
        token = _shows.set(True)
        try:
            yield shown
        finally:
            _shows.reset(token)


@contextlib.contextmanager
def counting(
    told: Callable[[int, int], None] | None, what: str, unit: str
) -> Iterator[Callable[[int, int], None]]:
    """Function to call with the numbers done and to do: the one that is told, or a bar's."""
    if told is not None:
        yield told
        return
    with bar(what, unit) as shown:

        def count(done: int, total: int) -> None:
            if shown.total != total:
                shown.reset(total)
                shown.initial = done  # done before: no part of the rate
            shown.update(done - shown.n)

        yield count


@contextlib.contextmanager
def patience(what: str) -> Iterator[None]:
    """Show the seconds that pass, for work that cannot tell how far it is, and what compiles.

    It also serves as a decorator.  Within itself, and within a `bar`, it shows nothing.
    """
    if _shows.get() or not watched():
        yield
        return
    token = _shows.set(True)
    over = threading.Event()
    ticking = threading.Thread(target=_tick, args=(what, over), daemon=True)
    ticking.start()
    try:
        yield
    finally:
        over.set()
        ticking.join()
        _shows.reset(token)


def _tick(what: str, over: threading.Event) -> None:
    before = seconds_of_compiling()
    if over.wait(DELAY):
        return
    with bar(what, bar_format="{desc} ... {elapsed}") as shown:
        while not over.wait(TICK):
            spent = seconds_of_compiling() - before
            if spent > WORTH_TELLING:
                told = f"{spent:.0f} s of it to compile, once for calls of this kind"
                shown.set_description_str(f"{what}, {told}", refresh=False)
            shown.refresh()


class _Compiling:
    """Seconds for which JAX has traced and compiled in this process since it was made."""

    def __init__(self) -> None:
        self.seconds = 0.0
        jax.monitoring.register_event_duration_secs_listener(self._add)

    def _add(self, event: str, duration_secs: float, **_: Any) -> None:
        if event.startswith(COMPILE):
            self.seconds += duration_secs


def seconds_of_compiling() -> float:
    """Seconds for which JAX has traced and compiled in this process since this was asked first."""
    return _compiling().seconds


@functools.cache
def _compiling() -> _Compiling:
    return _Compiling()
