"""Folders of results: tables as text and pictures, every file written whole or not at all.

A command checks its folder before it computes, with `check_folder`; once all texts and figures are
complete, `write_folder` makes the folder and writes them.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_path, write_text


def check_folder(path: str | os.PathLike[str]) -> Path:
    """Path of a folder that is there or can be made; makes nothing, raises `InputError`."""
    folder = as_path(path)
    if not os.fspath(path):
        raise InputError("--out '': is empty: name a folder")
    try:  # a link that points to nothing counts as there
        ground = next(p for p in (folder, *folder.parents) if p.is_symlink() or p.exists())
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"--out {path}: cannot be made ({reason}): name another") from None
    if not ground.is_dir():
        raise InputError(f"--out {path}: {ground} is a file: name a folder")
    if not os.access(ground, os.W_OK | os.X_OK):
        raise InputError(f"--out {path}: {ground} cannot be written to: name another folder")
    return folder


def write_folder(folder: Path, texts: Mapping[str, str], pictures: Mapping[str, Any]) -> list[Path]:
    """Write complete texts and figures into a folder, and close the figures.

    Parameters
    ----------
    folder : folder to write to; it is made if it is not there
    texts : content of text files by name
    pictures : matplotlib figures by name

    Returns
    -------
    list of Path
        paths of the files, texts first

    Raises
    ------
    InputError
        if the folder cannot be made, or a file cannot be written
    """
    from jbeamshell import plotting

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be made ({error.strerror}): name another folder"
        ) from None
    for name, text in texts.items():
        write_text(folder / name, text)
    for name, figure in pictures.items():
        plotting.save(figure, folder / name)
        plotting.close(figure)
    return [folder / name for name in (*texts, *pictures)]
