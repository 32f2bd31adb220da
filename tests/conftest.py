"""Settings of the whole test run."""

import gc
import os
import shutil
import subprocess
import sys
import tempfile

import hypothesis
import jax
import pytest

os.environ["MPLBACKEND"] = "Agg"  # children of the tests inherit it
# Workers and children share what they compile; the run's own folder, so nothing stale is used.
CACHE = "JAX_COMPILATION_CACHE_DIR"
OWNER = CACHE not in os.environ
if OWNER:
    os.environ[CACHE] = tempfile.mkdtemp(prefix="jbeamshell-tests-")
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0.5"
# The tests compile more than they run: a third of the time for code that is slower by half.
os.environ["JAX_DISABLE_MOST_OPTIMIZATIONS"] = "true"  # for children; for this process below
FLAGS = "--xla_cpu_use_fusion_emitters=false"
if OWNER and "XLA_FLAGS" not in os.environ:
    # A release that does not know the flag would abort.
    trial = [sys.executable, "-c", "import jax; jax.devices()"]
    known = subprocess.run(trial, env=os.environ | {"XLA_FLAGS": FLAGS}, capture_output=True)
    if known.returncode == 0:
        os.environ["XLA_FLAGS"] = FLAGS
jax.config.update("jax_compilation_cache_dir", os.environ[CACHE])
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.5)
jax.config.update("jax_disable_most_optimizations", True)
jax.config.update("jax_enable_x64", True)
gc.set_threshold(100_000, 20, 20)  # tracing makes millions of objects that live on

hypothesis.settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=50)
hypothesis.settings.load_profile("repeatable")


def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Forget compiled programs after a folder; its modules share them, all would take gigabytes."""
    if nextitem is None or nextitem.path.parent != item.path.parent:
        jax.clear_caches()
        gc.collect()


def pytest_sessionfinish(session: pytest.Session) -> None:
    if OWNER:
        shutil.rmtree(os.environ[CACHE], ignore_errors=True)
