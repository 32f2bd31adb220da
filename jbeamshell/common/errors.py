"""Errors and warnings, one line each, and the status of a load step."""

from __future__ import annotations

import enum
import warnings
from collections.abc import Iterable

LONGEST = 800  # characters of a message


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


def warn_of_doubts(doubts: Iterable[str], stacklevel: int = 2) -> None:
    """Warn of everything doubtful about a result, by default where the caller was called."""
    for doubt in doubts:
        warnings.warn(f"doubtful: {doubt}", DoubtfulWarning, stacklevel=stacklevel + 1)


class Status(enum.IntEnum):
    """End of the search for a load step's equilibrium."""

    CONVERGED = 0
    MAX_ITERATIONS = 1
    NOT_FINITE = 2
    NOT_REACHED = 3
