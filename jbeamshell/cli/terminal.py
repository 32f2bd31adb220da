"""Exit codes, and what a command prints: results to standard output, the rest to standard error."""

from __future__ import annotations

import contextlib
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

from jbeamshell.common.errors import InputError
from jbeamshell.common.progress import watched

BAD_INPUT, UNCONVERGED, NOT_DESCRIBED, INTERRUPTED = 2, 3, 3, 130


def put(text: str) -> None:
    """Print a result."""
    try:
        print(text, end="", flush=True)
    except UnicodeEncodeError as error:  # letters that the terminal cannot show
        print(text.encode(error.encoding, "backslashreplace").decode(error.encoding), end="")
    except BrokenPipeError:  # the reader, such as head, has seen enough
        _silence(sys.stdout)
    except OSError as error:
        _silence(sys.stdout)
        raise InputError(f"standard output: cannot be written ({error.strerror})") from None


def _silence(stream: Any) -> None:
    """Discard a stream's buffer, about which Python would complain when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def say(text: str) -> None:
    """Report progress, if a person watches."""
    if watched():
        print(text, file=sys.stderr)


def warn(text: str) -> None:
    """Print a warning, whether a person or a script reads it."""
    print(f"jbeamshell: warning: {text}", file=sys.stderr)


@contextlib.contextmanager
def doubts_in_lines() -> Iterator[None]:
    """Context that prints the warnings met in it at its end, each once and on one line."""
    with warnings.catch_warnings(record=True) as met:
        warnings.simplefilter("always")
        yield
    for text in dict.fromkeys(" ".join(str(each.message).split()) for each in met):
        warn(text)


def complain(error: object, code: int) -> int:
    """Print an error on one line; returns the exit code."""
    print(f"jbeamshell: {' '.join(str(error).split())}", file=sys.stderr)
    return code


def say_written(paths: Sequence[Any]) -> None:
    """Name the files written."""
    print("wrote " + ", ".join(map(str, paths)), file=sys.stderr)
