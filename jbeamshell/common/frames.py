"""Tables of results as data frames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def frame(columns: Mapping[str, Any], rows: Any = None, name: str = "row") -> Any:
    """`pandas.DataFrame` of some columns, each a sequence of numbers or words.

    Parameters
    ----------
    columns : sequences of one length, by name
    rows : names of the rows; None numbers them
    name : of the index
    """
    import xarray

    known = {} if rows is None else {name: list(rows)}
    data = {key: (name, list(column)) for key, column in columns.items()}
    return xarray.Dataset(data, known).to_dataframe()
