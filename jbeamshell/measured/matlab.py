"""Variables of a MATLAB file, read in a process of its own.

SciPy's reader may end the whole process at a damaged file.  This module also is the script of that
process: it takes the file from its input and writes a NumPy archive to its output.
"""

from __future__ import annotations

import io
import json
import math
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

LONGEST_TIME = 60.0  # seconds to read a file
SPARSE = ":"  # before row, column, value and shape, the parts of a sparse matrix


def variables(
    data: bytes, largest: int, *, sparse: bool = False
) -> Iterator[tuple[str, np.ndarray]]:
    """Numbers in a MATLAB file of version 7 or before, with their names.

    Parameters
    ----------
    data : content of the file
    largest : bytes that its variables may take
    sparse : True to give sparse matrices too, in parts: "K:row", "K:column", "K:value", "K:shape"

    Raises
    ------
    ValueError
        if it is no such file, with the reason
    """
    command = [sys.executable, "-P", __file__, str(largest), *["sparse"][: int(sparse)]]
    try:
        ended = subprocess.run(command, input=data, capture_output=True, timeout=LONGEST_TIME)
    except subprocess.TimeoutExpired:
        raise ValueError(f"not read within {LONGEST_TIME:.0f} s") from None
    if ended.returncode:
        lines = ended.stderr.decode(errors="replace").splitlines()
        raise ValueError(lines[-1] if ended.returncode == 1 and lines else "it is damaged")
    with np.load(io.BytesIO(ended.stdout), allow_pickle=False) as archive:
        for place, name in enumerate(json.loads(str(archive["names"]))):
            yield name, archive[str(place)]


def _unpacked(data: bytes, largest: int, sparse: bool) -> Iterator[tuple[str, np.ndarray]]:
    from scipy.io import loadmat, whosmat  # slow to import
    from scipy.sparse import coo_array, issparse

    found = whosmat(io.BytesIO(data))
    full = (math.prod(shape) for _, shape, kind in found if not (sparse and kind == "sparse"))
    if 8 * sum(full) > largest:
        raise ValueError(f"more than {largest // 10**6} MB when unpacked")
    for name, value in loadmat(io.BytesIO(data)).items():
        if sparse and issparse(value):
            parts = coo_array(value)
            yield f"{name}{SPARSE}row", parts.row
            yield f"{name}{SPARSE}column", parts.col
            yield f"{name}{SPARSE}value", parts.data
            yield f"{name}{SPARSE}shape", np.array(parts.shape)
        elif not name.startswith("__"):
            yield from _fields(name, value)


def _fields(name: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Variable with its name, or all fields of a struct, of a row of structs, of nested structs."""
    if not isinstance(value, np.ndarray):
        return
    if not value.dtype.names:
        if value.dtype.kind in "iuf":
            yield name, value
        return
    elements = value.ravel()
    for i, element in enumerate(elements, 1):
        own = name if elements.size == 1 else f"{name}({i})"
        for field in value.dtype.names:
            yield from _fields(f"{own}.{field}", element[field])


def _main() -> None:
    data, largest, sparse = sys.stdin.buffer.read(), int(sys.argv[1]), "sparse" in sys.argv[2:]
    found = list(_unpacked(data, largest, sparse))
    arrays: dict[str, Any] = {str(place): array for place, (_, array) in enumerate(found)}
    archive = io.BytesIO()
    np.savez(archive, names=json.dumps([name for name, _ in found]), **arrays)
    sys.stdout.buffer.write(archive.getvalue())


if __name__ == "__main__":
    _main()
