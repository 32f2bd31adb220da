"""Waiting is announced to a person who watches, and to nobody else."""

import time

import jax
import pytest

from jbeamshell.common import progress


def wait() -> None:
    """Compile something, and wait for signs of life."""
    with progress.patience("solving"), progress.patience("within it"):
        jax.jit(lambda x: x + time.monotonic())(1.0)
        time.sleep(0.2)


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seconds in {"DELAY": 0.0, "TICK": 0.02, "WORTH_TELLING": 0.0}.items():
        monkeypatch.setattr(progress, name, seconds)


def test_it_says_what_takes_so_long(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(progress, "watched", lambda: True)
    wait()
    said = capsys.readouterr().err
    assert "solving, 0 s of it to compile, once for calls of this kind ... 00:00" in said
    assert "within it" not in said


def test_it_is_quiet_in_a_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    wait()
    assert capsys.readouterr().err == ""
