"""Files: written whole or not at all; TOML, JSON and CSV."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import re
import stat
import tomllib
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from jbeamshell.common.errors import InputError

LARGEST_TOML = 4_000_000  # bytes; a pressure table of 100,000 rows takes a half of it
DEEPEST = 100  # levels of a key
# Beginning of a line of TOML, up to what cannot be a key
KEY = re.compile(r"""\s*\[{0,2}[\w.'" -]*""")


def as_path(path: Any) -> Path:
    """Path of a file's name; raises `InputError` for anything that is no file name."""
    if isinstance(path, str | os.PathLike):
        name = os.fspath(path)
        if isinstance(name, str) and "\0" not in name:
            return Path(name)
    raise InputError(f"{path!r}: is no file name: give text without NUL, or a pathlib.Path")


def check_regular(path: str | os.PathLike[str]) -> None:
    """Raise `InputError` for what is no regular file, such as a pipe, which may block for ever."""
    try:
        mode = as_path(path).stat().st_mode
    except (OSError, UnicodeEncodeError):
        return  # the reader says why
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise InputError(f"{path}: is no regular file: write it to one first")


@contextlib.contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Context with a draft to write to, which is renamed to ``path`` if the block succeeds.

    If the block fails, the draft is removed and ``path`` stays as it was.

    Raises
    ------
    InputError
        if the file cannot be written

    Examples
    --------
    ::

        with written_whole("numbers.txt") as draft:
            draft.write_text("1 2 3")
    """
    target = as_path(path)
    draft = target.parent / f".{uuid.uuid4().hex}{target.suffix}"
    try:
        draft.touch(exist_ok=False)
        yield draft
        draft.replace(target)
    except OSError as error:  # no folder, no permission, a full disk
        raise InputError(f"{target}: cannot be written ({error.strerror or error})") from None
    except UnicodeEncodeError as error:  # a file name with half a character
        raise InputError(f"{target}: cannot be written ({error})") from None
    finally:
        with contextlib.suppress(OSError, UnicodeEncodeError):
            draft.unlink(missing_ok=True)


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[bool]:
    """Context with True if this is the only one, of all processes and threads, with the folder.

    A process that dies lets go of its folders.  Where the system has no such locks, nobody is told.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        yield True
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        alone = True
        with contextlib.suppress(OSError):  # a file system without locks
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                alone = folder.exists()  # the one before may have removed it
            except BlockingIOError:
                alone = False
        yield alone
    finally:
        os.close(handle)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file, whole or not at all."""
    with written_whole(path) as draft:
        draft.write_text(text, encoding="utf-8")


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Tables of a TOML file; raises `InputError` if it is none, or larger than `LARGEST_TOML`."""
    check_regular(path)
    try:
        with as_path(path).open("rb") as file:
            data = file.read(LARGEST_TOML + 1)
    except (OSError, UnicodeEncodeError) as error:  # the latter: a name with half a character
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({reason})") from None
    if len(data) > LARGEST_TOML:
        raise InputError(
            f"{path}: is no scene or plan: it holds more than {LARGEST_TOML:,} bytes; name another"
        )
    try:
        return parsed_toml(data.decode("utf-8"))
    except ValueError as error:
        raise InputError(f"{path}: is not a TOML file ({error})") from None


def parsed_toml(text: str) -> dict[str, Any]:
    """Tables of TOML text; raises `ValueError` for any other text."""
    keys = (KEY.match(line) for line in text.splitlines())
    if any(key is not None and key[0].count(".") > DEEPEST for key in keys):
        raise ValueError("its keys are nested too deeply")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("its lists are nested too deeply") from None


def as_json(figures: Mapping[str, Any]) -> str:
    """JSON text; raises `ValueError` for a number that is not finite, which JSON cannot write."""
    return json.dumps(figures, indent=2, allow_nan=False) + "\n"


def csv_text(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """CSV text of a header and rows."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()
