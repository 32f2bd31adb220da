"""Settings of the whole test run."""

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
# The tests compile more than they run: half the time for code that is a quarter slower.
FLAGS = (
    "--xla_backend_optimization_level=1 --xla_cpu_use_fusion_emitters=false"
    " --xla_llvm_disable_expensive_passes=true"
)
if OWNER and "XLA_FLAGS" not in os.environ:
    # A release that does not know a flag would abort.
    trial = [sys.executable, "-c", "import jax; jax.devices()"]
    known = subprocess.run(trial, env=os.environ | {"XLA_FLAGS": FLAGS}, capture_output=True)
    if known.returncode == 0:
        os.environ["XLA_FLAGS"] = FLAGS
jax.config.update("jax_compilation_cache_dir", os.environ[CACHE])
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.5)
jax.config.update("jax_enable_x64", True)

hypothesis.settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=50)
hypothesis.settings.load_profile("repeatable")


@pytest.fixture(scope="module", autouse=True)
def _forget_compiled_code():
    """A worker that kept every compiled program would take gigabytes."""
    yield
    jax.clear_caches()


def pytest_sessionfinish(session: pytest.Session) -> None:
    if OWNER:
        shutil.rmtree(os.environ[CACHE], ignore_errors=True)
