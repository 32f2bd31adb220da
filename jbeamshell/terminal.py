"""What the command line's parts share: reading KEY=VALUE, and saying things."""

from __future__ import annotations

import ast
import os
import sys
import tomllib
from collections.abc import Sequence
from typing import Any

from jbeamshell.errors import InputError


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
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        pass
    try:
        return ast.literal_eval(text) if text.startswith("[") else float(text)
    except (ValueError, SyntaxError):
        return [word.strip() for word in text.split(",")] if "," in text else text


def put(text: str) -> None:
    """Print a result."""
    try:
        print(text, end="", flush=True)
    except BrokenPipeError:  # a reader such as head has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


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
