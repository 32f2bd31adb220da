"""Errors and warnings, one line each, and the status of a load step."""

from __future__ import annotations

import contextlib
import enum
import sys
import warnings
from collections.abc import Iterable
from pathlib import Path

LONGEST = 800  # characters of a message
INSIDE = str(Path(__file__).parents[1]), contextlib.__file__  # files between a user and a warning


class InputError(ValueError):
    """Input that makes no model; the message names the key, the value and the fix.

    The message is one line; the middle of a very long one is left out.
    """

    def __init__(self, message: object = "") -> None:
        line = " ".join(str(message).splitlines())
        if len(line) > LONGEST:
            line = f"{line[: LONGEST // 2]} ... {line[-LONGEST // 2 :]}"
        super().__init__(line)


class UnconvergedError(RuntimeError):
    """Load step without equilibrium; the message names the step and what to try."""


class DoubtfulWarning(UserWarning):
    """Result that converged and may still be wrong; see `jbeamshell.History.doubts`."""


def warn_of_doubts(doubts: Iterable[str]) -> None:
    """Warn of everything doubtful about a result, where the user called the library."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(INSIDE):
        level, frame = level + 1, frame.f_back
    for doubt in doubts:
        warnings.warn(f"doubtful: {doubt}", DoubtfulWarning, stacklevel=level)


class Status(enum.IntEnum):
    """End of the search for a load step's equilibrium."""

    CONVERGED = 0
    MAX_ITERATIONS = 1
    NOT_FINITE = 2
    NOT_REACHED = 3
