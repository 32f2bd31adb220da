"""What the command line's parts share: reading KEY=VALUE, and saying things."""

from __future__ import annotations

import ast
import contextlib
import math
import os
import sys
from collections.abc import Sequence
from typing import Any

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import parsed_toml


def assignments(texts: Sequence[str]) -> dict[str, Any]:
    """Values by key from texts KEY=VALUE."""
    values = {key: _value(text) for key, text in pairs(texts, "contact.friction=0.2").items()}
    if isinstance(values.get("model.fields"), str):  # a single one, without a comma
        values["model.fields"] = [values["model.fields"]]
    return values


def pairs(texts: Sequence[str], example: str) -> dict[str, str]:
    """Texts by key from texts KEY=TEXT."""
    found = {}
    for text in texts:
        key, separator, value = text.partition("=")
        if not separator:
            raise InputError(f"{text!r}: write KEY=VALUE, such as {example}")
        found[key.strip()] = value.strip()
    return found


def _value(text: str) -> Any:
    """A TOML value; else a number such as .5, a list of them, a word, or words between commas."""
    with contextlib.suppress(ValueError):
        tables = parsed_toml(f"value = {text}")
        if len(tables) == 1:  # else further lines of it
            return tables["value"]
    try:
        if text.startswith("["):
            return ast.literal_eval(text)
        number = float(text)
        return text if math.isinf(number) and "inf" not in text.lower() else number
    except (ValueError, SyntaxError, RecursionError, MemoryError):  # brackets by the thousand
        return [word.strip() for word in text.split(",")] if "," in text else text


def put(text: str) -> None:
    """Print a result."""
    try:
        print(text, end="", flush=True)
    except UnicodeEncodeError as error:  # a label in letters that the terminal has not
        print(text.encode(error.encoding, "backslashreplace").decode(error.encoding), end="")
    except BrokenPipeError:  # a reader such as head has seen enough
        _silence(sys.stdout)
    except OSError as error:
        _silence(sys.stdout)
        raise InputError(f"standard output: cannot be written ({error.strerror})") from None


def _silence(stream: Any) -> None:
    """Send what is still in its buffer nowhere, or Python would complain at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def say(text: str) -> None:
    """Tell a person who watches."""
    if sys.stderr.isatty():
        print(text, file=sys.stderr)


def warn(text: str) -> None:
    """Warn, whoever reads."""
    print(f"jbeamshell: warning: {text}", file=sys.stderr)


def say_written(paths: Sequence[Any]) -> None:
    """Name the files written."""
    print("wrote " + ", ".join(map(str, paths)), file=sys.stderr)
