"""Options of the whole process that make JAX start and run faster, taken only when asked for."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import jax

from jbeamshell.common.errors import InputError

EXTRA = "--xla_backend_extra_options="
FAST_LOOPS = "xla_cpu_small_while_loop_byte_threshold=100000000"
ASYNCHRONOUS = "jax_cpu_enable_async_dispatch"
WORTH_KEEPING = 0.2  # seconds of compiling


def configure(
    *,
    fast_loops: bool = True,
    asynchronous: bool = False,
    cache: str | os.PathLike[str] | None = None,
) -> None:
    """Choose how JAX compiles and calls, for this process and, but for calls, those it starts.

    Parameters
    ----------
    fast_loops : whether every loop on a CPU becomes one native function, instead of a call for each
        of its operations: load paths run several times faster, and compile a little slower.  It is
        the compiler's own option and holds for all that the process compiles.
    asynchronous : whether a call on a CPU computes in another thread, as JAX's do unless told
        otherwise; handing over takes as long as a small strip's cycle
    cache : folder in which compiled programs are kept, so that the next process need not compile
        them again; None leaves that as it is

    Raises
    ------
    InputError
        if JAX has already started, so that these would come too late

    Notes
    -----
    The command line does this by itself, with the folder that `default_cache` names.
    """
    if cache is not None:
        jax.config.update("jax_compilation_cache_dir", str(cache))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", WORTH_KEEPING)
    if is_asynchronous() != asynchronous:
        _check_not_started(f"asynchronous = {asynchronous}")
        jax.config.update(ASYNCHRONOUS, asynchronous)
    flags = os.environ.get("XLA_FLAGS", "")
    if not fast_loops or FAST_LOOPS in flags:
        return
    _check_not_started("fast_loops = True")
    if EXTRA in flags:  # given once only, with commas
        flags = flags.replace(EXTRA, f"{EXTRA}{FAST_LOOPS},", 1)
    else:
        flags = f"{flags} {EXTRA}{FAST_LOOPS}".strip()
    os.environ["XLA_FLAGS"] = flags


def _check_not_started(asked: str) -> None:
    if started():
        fix = "call jbeamshell.configure() before anything else that computes"
        raise InputError(f"{asked}: JAX has already started in this process: {fix}")


def is_asynchronous() -> bool:
    """Whether JAX is set to compute in other threads than calls come from."""
    config: Any = jax.config
    return bool(config.values[ASYNCHRONOUS])


def started() -> bool:
    """Whether JAX has started, after which its compiler takes no options."""
    from jax._src import xla_bridge  # nothing public tells without starting it

    return xla_bridge.backends_are_initialized()


def memory() -> float:
    """Bytes of memory that this machine has; infinite where it does not say."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return math.inf


def start_of_a_command() -> None:
    """What the command line chooses: fast loops, and a cache unless the user has one."""
    if started():
        return
    cache = None
    if not os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        try:
            cache = default_cache()
            cache.mkdir(parents=True, exist_ok=True)
        except (OSError, RuntimeError):  # no home, or none to write to: everything works without
            cache = None
    configure(cache=cache)


def default_cache() -> Path:
    """Folder of the compiled programs that the command line keeps."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "jbeamshell"
