"""Tables: titled columns of numbers in a file of any kind."""

from __future__ import annotations

import abc
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import check_regular

LARGEST = 200_000_000  # bytes


class Table(abc.ABC):
    """Titled columns of numbers.

    Attributes
    ----------
    name : name of the file, for messages
    titles : titles of the columns
    place : place of the titles in the file, for messages; empty if it names no columns, which are
        "column 1" and so on then
    """

    name: str
    titles: list[str]
    place: str

    @abc.abstractmethod
    def units(self, wanted: Sequence[int]) -> list[str | None]:
        """Units of the wanted columns in a row below the header; None if there is no such row.

        Call it before `numbers`, which start below that row.
        """

    @abc.abstractmethod
    def numbers(self, wanted: Sequence[int], optional: Sequence[int] = ()) -> NDArray[np.float64]:
        """Wanted and optional columns, (rows, columns); missing numbers are NaN.

        Raises
        ------
        InputError
            if a cell of a wanted column is neither a finite number nor missing
        """

    @abc.abstractmethod
    def where(self, row: int) -> str:
        """Place of a row of `numbers` in the file, for messages."""


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """Content of a file; raises `InputError` if it cannot be read or has more than 200 MB."""
    check_regular(path)
    try:
        with Path(path).open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            data = b"" if size > LARGEST else file.read(LARGEST + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:  # a NUL in the name
        raise InputError(f"{path!r}: is not a file name ({error})") from None
    if max(size, len(data)) > LARGEST:
        raise InputError(
            f"{path}: holds more than {LARGEST // 10**6} MB: keep fewer points or columns of it"
        )
    return data
