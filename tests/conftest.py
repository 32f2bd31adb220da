"""Settings of the whole test run."""

import ctypes
import gc
import math
import os
import subprocess
import sys
import tempfile
import time
import zlib
from pathlib import Path

# Threads of LAPACK wait for each other by spinning, which starves what runs beside small systems.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import hypothesis
import jax
import pytest
import slow_sample
from durations import Recorder

os.environ["MPLBACKEND"] = "Agg"  # children of the tests inherit it
CACHE = "JAX_COMPILATION_CACHE_DIR"
OWNER = CACHE not in os.environ
DAYS = 14.0  # after which a compiled program is compiled anew
FLAGS = "--xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=1"


def programs() -> Path:
    """Folder of compiled programs, which runs share; one for each release of JAX and processor."""
    try:
        features = Path("/proc/cpuinfo").read_text(encoding="utf-8").partition("flags")[2]
    except OSError:
        features = sys.platform
    told = f"{FLAGS} {features.partition(chr(10))[0]}".encode()
    home = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    folder = home / "jbeamshell-tests" / f"jax-{jax.__version__}-{zlib.crc32(told):08x}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return Path(tempfile.mkdtemp(prefix="jbeamshell-tests-"))
    for old in folder.iterdir():
        if old.stat().st_mtime < time.time() - 86400.0 * DAYS:
            old.unlink(missing_ok=True)
    return folder


if OWNER:
    os.environ[CACHE] = str(programs())
    # Small programs too: reading one takes a tenth of the time that compiling it takes.
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
# The tests compile more than they run: a third of the time for code that is slower by half.
os.environ["JAX_DISABLE_MOST_OPTIMIZATIONS"] = "true"  # for children; for this process below
if OWNER and "XLA_FLAGS" not in os.environ:
    # A release that does not know the flag would abort.
    trial = [sys.executable, "-c", "import jax; jax.devices()"]
    known = subprocess.run(trial, env=os.environ | {"XLA_FLAGS": FLAGS}, capture_output=True)
    if known.returncode == 0:
        os.environ["XLA_FLAGS"] = FLAGS
jax.config.update("jax_compilation_cache_dir", os.environ[CACHE])
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
jax.config.update("jax_disable_most_optimizations", True)
jax.config.update("jax_traceback_in_locations_limit", 0)  # no program carries its lines of Python
jax.config.update("jax_enable_x64", True)
gc.set_threshold(100_000, 20, 20)  # tracing makes millions of objects that live on

hypothesis.settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=50)
hypothesis.settings.load_profile("repeatable")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--part", help="K/N: the K-th of N parts of the tests, K from 0")
    parser.addoption(
        "--slow-sample",
        metavar="SEED",
        help="a tenth of the slow tests too, drawn by SEED; HEAD takes the commit, or the date",
    )
    parser.addoption("--record", metavar="FILE", help="time of every test, and what XLA compiles")


def pytest_configure(config: pytest.Config) -> None:
    """Turn HEAD into the seed of a sample, which workers then share."""
    if given := config.option.slow_sample:
        config.option.slow_sample = slow_sample.seed_of(given)
        if config.option.markexpr == "not slow":
            config.option.markexpr = ""
    if path := config.option.record:
        config.pluginmanager.register(
            Recorder(None if hasattr(config, "workerinput") else Path(path).resolve())
        )


def pytest_report_header(config: pytest.Config) -> list[str]:
    seed = config.option.slow_sample
    return [f"slow sample: repeat it by --slow-sample {seed}"] if seed else []


def pytest_itemcollected(item: pytest.Item) -> None:
    """Let pass the doubts that a test says it meets, and all doubts of studies of many scenes."""
    met = [words for mark in item.iter_markers("doubtful") for words in mark.args]
    met += [""] if item.get_closest_marker("slow") else []
    for words in met:
        item.add_marker(pytest.mark.filterwarnings(f"ignore:doubtful.*{words}:UserWarning"))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep one part of the tests, the same on all machines, and of the slow ones the sample.

    The sample comes first: what is left for the end is short, so that no worker waits long.
    """
    kept = list(items)
    if given := config.getoption("--part"):
        part, parts = (int(number) for number in given.split("/"))
        kept = [item for item in kept if zlib.crc32(item.nodeid.encode()) % parts == part % parts]
    if seed := config.getoption("--slow-sample"):
        minutes = {
            item: max(mark.kwargs.get("minutes", 0.0) for mark in item.iter_markers("slow"))
            for item in kept
            if item.get_closest_marker("slow")
        }
        sample = [x for x in minutes if slow_sample.drawn(x.nodeid, minutes[x], seed)]
        kept = sample + [item for item in kept if item not in minutes]
    left = set(kept)
    config.hook.pytest_deselected(items=[item for item in items if item not in left])
    items[:] = kept


def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Forget compiled programs after a module where they take much memory.

    Modules share programs, and forgetting takes seconds; all of them would take many gigabytes.
    """
    if nextitem is not None and nextitem.path != item.path and memory_used() > most_memory():
        forget()


def forget() -> None:
    """Drop compiled programs, and give their memory back, so that what is used can be told."""
    jax.clear_caches()
    gc.collect()
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "malloc_trim"):
        libc.malloc_trim(0)


def memory_used() -> float:
    """Bytes of memory that this process holds; infinite where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return math.inf
    return float(pages * os.sysconf("SC_PAGE_SIZE"))


def most_memory() -> float:
    """Bytes that a worker may hold: a third of the machine shared by all, and 4 GB at most."""
    machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return min(4e9, machine / 3.0 / int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")))
