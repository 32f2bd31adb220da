"""Options of the whole process: precision, speed and start of JAX; opt in by `configure`."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import jax
from threadpoolctl import threadpool_limits

from jbeamshell.common.checks import require_choice
from jbeamshell.common.errors import InputError

EXTRA = "--xla_backend_extra_options="
FAST_LOOPS = "xla_cpu_small_while_loop_byte_threshold=100000000"
WALK = "JBEAMSHELL_WALK"  # variable that names the walk of this process and of those it starts
ASYNCHRONOUS = "jax_cpu_enable_async_dispatch"
ONCE = {"xla_backend_optimization_level": 0}  # compiler options for a program that runs few times
WORTH_KEEPING = 0.02  # seconds of compilation, from which on a program is kept in the cache


def configure(
    *,
    double: bool = True,
    fast_loops: bool = True,
    asynchronous: bool = False,
    cache: str | os.PathLike[str] | bool = True,
    walk: str | None = None,
) -> None:
    """Prepare this process: double precision, compiled programs that are kept, one thread.

    LAPACK gets one thread, unless OPENBLAS_NUM_THREADS says otherwise.  Processes that this one
    starts inherit that, ``fast_loops`` and ``walk``, not the other options.

    Parameters
    ----------
    double : True to compute in double precision, as ``jax.config.update("jax_enable_x64", True)``
        does; False leaves JAX's setting as it is
    fast_loops : True to compile every loop on a CPU to one native function, instead of a call for
        each of its operations.  Loops then run several times faster, load steps above all, and
        compile a little slower.  The option is the compiler's and holds for everything the process
        compiles.
    asynchronous : True to compute calls on a CPU in another thread, which is JAX's own default.
        Handing over to that thread takes as long as a cycle of a small strip.
    cache : folder in which compiled programs are kept, so that the next process need not compile
        them again; True is ``~/.cache/jbeamshell``, or JAX's own folder if it has one; False
        leaves JAX's setting as it is
    walk : "jax" to walk load paths in JAX, which says the same more slowly, or "c" to walk them in
        C where jbeamshell was installed with a C compiler; None leaves it to the variable `WALK`,
        and takes C without it.  ``jbeamshell --version`` says which

    Raises
    ------
    InputError
        if JAX has already started: it takes no options any more

    Notes
    -----
    The command line calls this by itself.

    Examples
    --------
    ::

        import jbeamshell as jb

        jb.configure()  # before anything is computed
    """
    if walk is not None and walk != os.environ.get(WALK, "c"):
        require_choice("walk", walk, ("c", "jax"))
        _check_not_started(f"walk = {walk!r}")
        os.environ[WALK] = walk
    if double:
        jax.config.update("jax_enable_x64", True)
    # Matrices here are small: threads of LAPACK would wait for each other longer than they work.
    threads = os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if threads.isdigit():  # NumPy has read it already
        threadpool_limits(int(threads), user_api="blas")
    folder = _default_cache() if cache is True else cache
    if folder:
        jax.config.update("jax_compilation_cache_dir", str(folder))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", WORTH_KEEPING)
    if is_asynchronous() != asynchronous:
        _check_not_started(f"asynchronous = {asynchronous}")
        jax.config.update(ASYNCHRONOUS, asynchronous)
    flags = os.environ.get("XLA_FLAGS", "")
    if not fast_loops or FAST_LOOPS in flags:
        return
    _check_not_started("fast_loops = True")
    if EXTRA in flags:  # the compiler reads the option once, as a list with commas
        flags = flags.replace(EXTRA, f"{EXTRA}{FAST_LOOPS},", 1)
    else:
        flags = f"{flags} {EXTRA}{FAST_LOOPS}".strip()
    os.environ["XLA_FLAGS"] = flags


def _check_not_started(asked: str) -> None:
    if started():
        fix = "call jbeamshell.configure() before anything else that computes"
        raise InputError(f"{asked}: JAX has already started in this process: {fix}")


def is_asynchronous() -> bool:
    """True if JAX computes calls on a CPU in another thread."""
    config: Any = jax.config
    return bool(config.values[ASYNCHRONOUS])


def started() -> bool:
    """True if JAX has started; its compiler takes no options afterwards."""
    config: Any = jax.config
    before = config.jax_num_cpu_devices
    try:
        config.update("jax_num_cpu_devices", before + 1)  # refused once JAX has started
    except RuntimeError:
        return True
    config.update("jax_num_cpu_devices", before)
    return False


def memory() -> float:
    """Memory of this machine in bytes; infinite if it does not say."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return math.inf


def _default_cache() -> Path | None:
    """Folder for compiled programs; None if JAX has one already, or if none can be made."""
    config: Any = jax.config
    if config.jax_compilation_cache_dir:
        return None
    try:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "jbeamshell"
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # no home folder to write to: it works without a cache
        return None
    return folder
