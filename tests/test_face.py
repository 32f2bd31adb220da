"""The names of `jbeamshell` itself: each is there, and loaded only when it is used."""

import ast
import subprocess
import sys
import types
from pathlib import Path

import pytest

import jbeamshell as jb

STUB = Path(jb.__file__).with_suffix(".pyi")
HEAVY = {"jax", "numpy", "matplotlib", "diffrax", "pint", "scipy", "xarray"}


def promised():
    """Names of the stub, by the module that it takes them from."""
    tree = ast.parse(STUB.read_text("utf-8"))
    for node in tree.body:
        if isinstance(node, ast.ImportFrom):
            yield from ((alias.asname, node.module) for alias in node.names)


NAMES = dict(promised())


def loaded_by(code):
    """Modules that a fresh process has loaded after some code."""
    tell = "; import sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code + tell], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


def test_every_name_of_the_stub_is_there_and_no_other():
    for name, home in NAMES.items():
        value = getattr(jb, name)
        if isinstance(value, types.ModuleType):
            assert value.__name__ == ".".join(filter(None, ("jbeamshell", home, name)))
        else:
            assert value is getattr(sys.modules[f"jbeamshell.{home}"], name)
    assert sorted(jb.__all__) == sorted(NAMES)
    assert set(NAMES) <= set(dir(jb))
    with pytest.raises(AttributeError, match="sovle"):
        _ = jb.sovle


def test_a_name_loads_what_it_needs_alone():
    assert not loaded_by("import jbeamshell; dir(jbeamshell)") & HEAVY
    solving = loaded_by(
        "import jax, jbeamshell; jbeamshell.solve; jbeamshell.Scene;"
        "assert not jax.config.jax_enable_x64"
    )
    assert not solving & (HEAVY - {"jax", "numpy", "scipy"})
    assert "matplotlib" in loaded_by("import jbeamshell; jbeamshell.plotting.loop")
