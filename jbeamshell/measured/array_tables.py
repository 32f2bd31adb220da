"""Tables in binary files: MATLAB, NumPy, HDF5, TDMS, UFF; nothing in a file is ever executed."""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.measured import laboratory, matlab
from jbeamshell.measured.tables import LARGEST, Table, read_bytes

HDF5 = b"\x89HDF\r\n\x1a\n"
FEW = 8  # a matrix of more columns than rows, and at most so many rows, holds rows of numbers


class ArrayTable(Table):
    """Table in a binary file.

    Parameters
    ----------
    path : file whose name ends in one of `READERS`
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.name = Path(path).name
        self.place = "in its variables"
        data, suffix = read_bytes(path), Path(path).suffix.lower()
        new = suffix == ".mat" and HDF5 in data[:1024]  # MATLAB 7.3
        read = READERS[".h5" if new else suffix]
        try:
            columns = [column for item in read(data) for column in _columns(*item)]
        except InputError as error:  # a library is missing
            raise InputError(f"{self.name}: {error}") from None
        except Exception as error:  # a parser may raise anything for a broken file
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
            raise InputError(
                f"{self.name}: is no {suffix} file of numbers ({reason}): save it again"
            ) from None
        if not columns:
            raise InputError(f"{self.name}: holds no columns of numbers: give named vectors")
        self.titles = [title for title, _ in columns]
        self._columns = [column for _, column in columns]

    def units(self, wanted: Sequence[int]) -> list[str | None]:
        return [None] * len(wanted)

    def numbers(self, wanted: Sequence[int], optional: Sequence[int] = ()) -> NDArray[np.float64]:
        first = wanted[0]
        size = self._columns[first].size
        found = []
        for i in [*wanted, *optional]:
            column = self._columns[i]
            if column.size != size and i in wanted:
                raise InputError(
                    f"{self.name}: {self.titles[first]!r} has {size} values, {self.titles[i]!r} "
                    f"{column.size}: give columns of one length"
                )
            bad = np.flatnonzero(np.isinf(column))
            if bad.size and i in wanted:
                raise InputError(
                    f"{self.name}: {self.titles[i]!r} is infinite at {self.where(bad[0])}: give a "
                    "finite number, or NaN for a missing one"
                )
            whole = column.size == size and not bad.size
            found.append(column if whole else np.full(size, np.nan))
        return np.column_stack(found)

    def where(self, row: int) -> str:
        return f"element {row + 1}"


def _matlab(data: bytes) -> Iterator[tuple[str, Any]]:
    return matlab.variables(data, LARGEST)


def _archive(data: bytes) -> Iterator[tuple[str, Any]]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        if sum(member.file_size for member in archive.infolist()) > LARGEST:
            raise ValueError(f"more than {LARGEST // 10**6} MB when unpacked")
        for member in archive.infolist():
            with archive.open(member) as file:
                try:
                    array = np.lib.format.read_array(file, allow_pickle=False)
                except ValueError as error:
                    if "allow_pickle" in str(error):  # objects beside the numbers are not unpacked
                        continue
                    raise
            yield member.filename.removesuffix(".npy"), array


def _array(data: bytes) -> Iterator[tuple[str, Any]]:
    array = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    if array.dtype.names:
        yield from ((name, array[name]) for name in array.dtype.names)
    else:
        yield "", array


def _columns(name: str, value: Any) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Vectors in a variable; none for text, single numbers and arrays of three dimensions."""
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or array.ndim > 2 or array.size < 2:
        return
    if 1 in array.shape or array.ndim == 1:
        yield name or "column 1", array.ravel().astype(float)
        return
    kind = "column"
    if array.shape[0] <= FEW < array.shape[1]:
        kind, array = "row", array.T
    for j, column in enumerate(array.T, 1):
        yield f"{name} {kind} {j}".strip(), column.astype(float)


# Reader of titles and arrays from the content of a file, by the end of its name.
READERS: dict[str, Callable[[bytes], Iterator[tuple[str, Any]]]] = {
    ".mat": _matlab,
    ".npz": _archive,
    ".npy": _array,
    ".h5": laboratory.hdf5,
    ".hdf5": laboratory.hdf5,
    ".tdms": laboratory.tdms,
    ".uff": laboratory.universal,
    ".unv": laboratory.universal,
}
