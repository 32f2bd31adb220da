"""Reader of tables: chooses the kind of table by the name of the file."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from jbeamshell.measured.array_tables import READERS, ArrayTable
from jbeamshell.measured.tables import Table
from jbeamshell.measured.text_tables import TextTable


def read_table(
    path: str | os.PathLike[str],
    recognised: Callable[[Sequence[str]], bool],
    decimal: str | None = None,
) -> Table:
    """Read the table in a file; one whose suffix is none of `READERS` is read as text.

    Parameters
    ----------
    path : file with one table
    recognised : function that is True for the titles of a header, for tables of text
    decimal : decimal mark of numbers in text, "." or ","; None infers it from the numbers

    Raises
    ------
    InputError
        if the file cannot be read or holds no table
    """
    if Path(path).suffix.lower() in READERS:
        return ArrayTable(path)
    return TextTable(path, recognised, decimal)
