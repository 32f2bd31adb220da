"""Docstrings of this project, turned into what napoleon reads.

Numpy style has ``name : type`` and a description below.  Here most entries say ``name :
description``, which may go on in the next line, because types are annotations.
"""

import re
from typing import Any

HEADS = {"Attributes", "Parameters", "Other Parameters"}
ENTRY = re.compile(r"^(\*{0,2}[\w*., ]+?) : (.+)$")
TYPE_WORDS = 45  # characters of a type, at most


def descriptions_on_lines(_: Any, __: str, ___: str, ____: Any, _____: Any, lines: list) -> None:
    """Move descriptions that stand in the place of a type to lines of their own."""
    lines[:] = formulas_as_text(keys_as_text(listed(rewritten(lines))))


def rewritten(lines: list[str]) -> list[str]:
    """Lines of a docstring with every description below its name."""
    answer: list[str] = []
    inside = False
    for number, line in enumerate(lines):
        if set(line.strip()) == {"-"} and number and not line.startswith(" "):
            inside = lines[number - 1].strip() in HEADS
        entry = ENTRY.match(line) if inside else None
        if entry is None or _is_type(entry[2], lines[number + 1 : number + 2]):
            answer.append(line)
        else:
            answer += [entry[1], f"    {entry[2]}"]
    return answer


def listed(lines: list[str]) -> list[str]:
    """Lines of a docstring with a list of its references."""
    inside, answer = False, []
    for number, line in enumerate(lines):
        head = number + 1 < len(lines) and set(lines[number + 1].strip()) == {"-"}
        inside = not head and (inside or (number > 0 and lines[number - 1].strip() == "References"))
        entry = inside and line[:1].strip() and set(line) != {"-"} and not line.startswith("..")
        answer.append(f"* {line}" if entry else line)
        if line.startswith("    ") and inside:
            answer[-1] = line[2:]
    return answer


def formulas_as_text(lines: list[str]) -> list[str]:
    """Lines of a docstring in which indented blocks, such as formulas, stand letter by letter."""
    answer: list[str] = []
    before = ""  # last line that is not blank
    for number, line in enumerate(lines):
        starts = line.startswith("    ") and number and not lines[number - 1].strip()
        if starts and before and not before.startswith(" ") and not before.endswith("::"):
            answer += ["::", ""] if not before.startswith("..") else []
        answer.append(line)
        before = line.rstrip() or before
    return answer


def keys_as_text(lines: list[str]) -> list[str]:
    """Lines of a docstring in which a table of keys stands as it is, letter by letter."""
    for number, line in enumerate(lines):
        if re.match(r"key +default +unit +meaning", line):
            table = [f"    {row}".rstrip() for row in lines[number:]]
            return [*lines[:number], "", "", ".. rubric:: Keys", "", "::", "", *table, ""]
    return lines


def _is_type(text: str, below: list[str]) -> bool:
    """True if a description starts below: the text beside the name is a type."""
    return bool(
        len(text) < TYPE_WORDS and below and re.match(r"\s+[A-Z`(]", below[0]) and text[0] != "("
    )


def skipped(_: Any, __: str, name: str, item: Any, skip: bool, ___: Any) -> bool | None:
    """Leave out fields that the docstring of their class describes already."""
    text = getattr(item, "__doc__", None) or ""
    return True if text.startswith("Alias for field number") else None
