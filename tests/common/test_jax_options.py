"""Options of the process: each in a process of its own, because they come before JAX starts."""

import os
import subprocess
import sys

import pytest

from jbeamshell.common import jax_options
from jbeamshell.common.errors import InputError

FAST = f"{jax_options.EXTRA}{jax_options.FAST_LOOPS}"


def flags_after(flags, call="jbeamshell.configure()"):
    """XLA_FLAGS after a call in a process that was started with some."""
    code = f"import os, jbeamshell; {call}; print(os.environ.get('XLA_FLAGS', ''))"
    given = {k: v for k, v in os.environ.items() if k != "XLA_FLAGS"} | flags
    done = subprocess.run([sys.executable, "-c", code], env=given, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ({}, FAST),
        ({"XLA_FLAGS": "--xla_dump_to=there"}, f"--xla_dump_to=there {FAST}"),
        ({"XLA_FLAGS": f"{jax_options.EXTRA}a=b"}, f"{FAST},a=b"),
        ({"XLA_FLAGS": FAST}, FAST),
    ],
)
def test_flags_are_added_to_what_is_there(before, after):
    assert flags_after(before) == after


def test_nothing_is_chosen_by_import():
    assert flags_after({}, "pass") == ""
    assert flags_after({}, "jbeamshell.configure(fast_loops=False)") == ""


def test_calls_wait_unless_told_otherwise():
    look = f"print(jax.config.values[{jax_options.ASYNCHRONOUS!r}])"
    assert flags_after({}, f"import jax; {look}") == "True"
    assert flags_after({}, f"import jax; jbeamshell.configure(fast_loops=False); {look}") == "False"


def test_too_late_is_said(monkeypatch):
    monkeypatch.setattr(jax_options, "is_asynchronous", lambda: False)
    monkeypatch.setenv("XLA_FLAGS", "")
    monkeypatch.setattr(jax_options, "started", lambda: True)
    with pytest.raises(InputError, match=r"fast_loops = True.*already started.*before anything"):
        jax_options.configure()
    monkeypatch.setenv("XLA_FLAGS", FAST)
    jax_options.configure()  # already so
    monkeypatch.setattr(jax_options, "is_asynchronous", lambda: True)
    with pytest.raises(InputError, match=r"asynchronous = False.*already started"):
        jax_options.configure()
