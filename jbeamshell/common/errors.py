"""The two ways a run can fail, each with one clear line."""

from __future__ import annotations

import enum

LONGEST = 800  # characters of a message


class InputError(ValueError):
    """Input that makes no model; the message names the field, the value and the fix.

    It is one line; of a very long one, the middle is left out.
    """

    def __init__(self, message: object = "") -> None:
        line = " ".join(str(message).splitlines())
        if len(line) > LONGEST:
            line = f"{line[: LONGEST // 2]} ... {line[-LONGEST // 2 :]}"
        super().__init__(line)


class UnconvergedError(RuntimeError):
    """A load step without equilibrium; the message names the step and what to try."""


class DoubtfulWarning(UserWarning):
    """A result that converged and may be wrong all the same; see `jbeamshell.History.doubts`."""


class Status(enum.IntEnum):
    """How a load step ended."""

    CONVERGED = 0
    MAX_ITERATIONS = 1
    NOT_FINITE = 2
    NOT_REACHED = 3
