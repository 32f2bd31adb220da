"""Folders of results: tables as text, and pictures, each file written whole."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_path, write_text


def check_folder(path: str | os.PathLike[str]) -> Path:
    """The folder, if it is there or can be made; nothing is made yet."""
    folder = as_path(path)
    if not os.fspath(path):
        raise InputError("--out '': is empty: name a folder")
    try:  # a link to nothing is there, too
        ground = next(p for p in (folder, *folder.parents) if p.is_symlink() or p.exists())
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"--out {path}: cannot be made ({reason})") from None
    if not ground.is_dir():
        raise InputError(f"--out {path}: {ground} is a file: name a folder")
    if not os.access(ground, os.W_OK | os.X_OK):
        raise InputError(f"--out {path}: {ground} cannot be written to: name another folder")
    return folder


def write_folder(folder: Path, texts: Mapping[str, str], pictures: Mapping[str, Any]) -> list[Path]:
    """Write what is complete by now; so what cannot be put into words leaves no file behind."""
    from jbeamshell import plotting

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
    for name, text in texts.items():
        write_text(folder / name, text)
    for name, figure in pictures.items():
        plotting.save(figure, folder / name)
        plotting.close(figure)
    return [folder / name for name in (*texts, *pictures)]
