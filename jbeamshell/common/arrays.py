"""Named arrays in .npz files with a check sum, so that no changed number passes for a right one."""

from __future__ import annotations

import hashlib
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jbeamshell.common.files import written_whole

CHECK_SUM = "check_sum"
LARGEST = 200_000_000  # bytes to which a squeezed file may unpack; ours are not squeezed


def write_arrays(
    path: str | os.PathLike[str], arrays: Mapping[str, np.ndarray], about: str = ""
) -> None:
    """Write named arrays and their check sum, whole or not at all.

    Parameters
    ----------
    path : file to write
    arrays : arrays by name
    about : text that the reader must know too, such as the sweep that a block belongs to

    Raises
    ------
    InputError
        if the file cannot be written
    """
    named: dict[str, Any] = {CHECK_SUM: np.array(check_sum(arrays, about)), **arrays}
    with written_whole(path) as draft:
        np.savez(draft, **named)


def read_arrays(path: Path, about: str = "", *, signed: bool = True) -> dict[str, np.ndarray]:
    """Arrays by name from a file of `write_arrays`; nothing in it is executed.

    Parameters
    ----------
    path : file to read
    about : text with which it was written
    signed : False to take a file without a check sum too

    Raises
    ------
    OSError
        if the file cannot be opened
    ValueError
        if its numbers are not those that were written; a damaged file can raise anything else
    """
    # NumPy leaves a handle of its own open if the file is damaged.
    with path.open("rb") as handle:
        with zipfile.ZipFile(handle) as archive:
            unpacked = sum(member.file_size for member in archive.infolist())
        if unpacked > max(LARGEST, os.fstat(handle.fileno()).st_size):
            raise ValueError("too large when unpacked")
        handle.seek(0)
        with np.load(handle, allow_pickle=False) as file:
            arrays = dict(file)
    written = arrays.pop(CHECK_SUM, None)
    if written is None:
        if signed:
            raise ValueError("it has no check sum, as if of another format")
        return arrays
    if str(written) != check_sum(arrays, about):
        raise ValueError("its numbers are not those that were written")
    return arrays


def check_sum(arrays: Mapping[str, np.ndarray], about: str = "") -> str:
    """SHA-256 of named arrays and a text, in hexadecimal digits."""
    digest = hashlib.sha256(about.encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"\0{name}\0{array.dtype.str}\0{array.shape}\0".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
