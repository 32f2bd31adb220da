"""Matrices of stiffness and mass in files: NumPy, MATLAB, Matrix Market and CalculiX.

| suffix | content |
|---|---|
| ``.npz`` | of `scipy.sparse.save_npz`, or `numpy.savez` with ``stiffness``, ``mass``, ``dofs`` |
| ``.mat`` | square matrices, dense or sparse: ``stiffness`` or ``K``, ``mass`` or ``M`` |
| ``.mtx`` | Matrix Market, or what CalculiX and Abaqus write for ``*SUBSTRUCTURE GENERATE`` |
| ``.sti``, ``.mas`` | CalculiX's ``*FREQUENCY, SOLVER=MATRIXSTORAGE``, with the ``.dof`` beside |

One file may hold both matrices, but for those of CalculiX and Matrix Market.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from jbeamshell.common.checks import whole_numbers
from jbeamshell.common.errors import InputError
from jbeamshell.measured import matlab
from jbeamshell.measured.tables import LARGEST, read_bytes

# Names of a matrix, where a file holds several.
NAMES = {"stiffness": ("stiffness", "K", "k"), "mass": ("mass", "M", "m")}
ANEW = "write the matrix anew, by scipy.io.mmwrite (.mtx) or scipy.sparse.save_npz (.npz)"
ARRAYS = "give an archive of scipy.sparse.save_npz, or of numpy.savez with stiffness= and dofs="


class Rows(NamedTuple):
    """Matrix of a file, and the node and direction of each row where the file says them.

    Attributes
    ----------
    matrix : (N, N) sparse
    dofs : (N, 2) node and direction of each row, or None
    """

    matrix: scipy.sparse.csc_array
    dofs: NDArray[np.int64] | None = None


def read_matrix(path: str | os.PathLike[str], what: str = "stiffness") -> Rows:
    """Matrix of a file, by its suffix.

    Parameters
    ----------
    path : file
    what : "stiffness" or "mass", where it may hold both

    Raises
    ------
    InputError
        for a file that cannot be read, another suffix, or one that holds no such matrix
    """
    name, suffix = Path(path).name, Path(path).suffix.lower()
    if suffix not in READERS:
        fix = f"it must end in {', '.join(READERS)}; {ANEW}"
        raise InputError(f"{name}: is no file of a matrix: {fix}")
    data = read_bytes(path)
    try:
        rows = READERS[suffix](data, Path(path), what)
        if not np.all(np.isfinite(rows.matrix.data)):
            raise InputError("holds numbers that are not finite: write it again")
        return rows
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    except Exception as error:  # a parser may raise anything for a broken file
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
        raise InputError(f"{name}: is no {suffix} file of a matrix ({reason})") from None


def _archive(data: bytes, _: Path, what: str) -> Rows:
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        if "indptr" in archive.files:
            matrix = scipy.sparse.load_npz(io.BytesIO(data))
            matrix.check_format(full_check=True)  # places beyond the matrix would end the process
            return Rows(scipy.sparse.csc_array(matrix))
        arrays = {name: archive[name] for name in archive.files}
    dofs = arrays.pop("dofs", None)
    return Rows(
        _the_matrix(arrays, what, ARRAYS), None if dofs is None else whole_numbers("dofs", dofs)
    )


def _matlab(data: bytes, _: Path, what: str) -> Rows:
    variables: dict[str, Any] = {}
    for name, value in matlab.variables(data, LARGEST, sparse=True):
        base, mark, part = name.rpartition(matlab.SPARSE)
        if mark:
            variables.setdefault(base, {})[part] = value
        else:
            variables[name] = value
    dofs = variables.pop("dofs", None)
    for name, value in variables.items():
        if isinstance(value, dict):
            places = value["row"].ravel(), value["column"].ravel()
            variables[name] = scipy.sparse.csc_array(
                (value["value"].ravel(), places), shape=tuple(value["shape"].ravel())
            )
    matrix = _the_matrix(variables, what, f"give one square matrix, or name it {what}")
    return Rows(matrix, None if dofs is None else whole_numbers("dofs", dofs))


def _the_matrix(variables: dict[str, Any], what: str, fix: str) -> scipy.sparse.csc_array:
    """Matrix among variables by name: the one of a known name, or the only square one."""
    square = {
        name: value
        for name, value in variables.items()
        if value.ndim == 2 and value.shape[0] == value.shape[1] > 1
    }
    matrices = [square[name] for name in NAMES[what] if name in square]
    others = {name for key, names in NAMES.items() if key != what for name in names}
    matrices += [value for name, value in square.items() if name not in others and len(square) == 1]
    if not matrices:
        held = ", ".join(square) or "none"
        raise InputError(f"holds no {what} among its square matrices ({held}): {fix}")
    return scipy.sparse.csc_array(matrices[0])


def _text(data: bytes, _: Path, what: str) -> Rows:
    if data.lstrip()[:2] == b"%%":
        return Rows(_market(data.decode("ascii").lower()))
    return _substructure(data.decode("ascii"), what)


def _market(text: str) -> scipy.sparse.csc_array:
    """Real matrix of a Matrix Market file; SciPy's reader may end the process at a damaged one."""
    head, *lines = text.splitlines()
    _, what, form, kind, symmetry = head.split()
    words = {"matrix", "coordinate", "array", "real", "double", "integer", "general", "symmetric"}
    if not {what, form, kind, symmetry} <= words:
        raise InputError(f"{head}: give a matrix of real numbers, general or symmetric")
    sizes, *rows = (line for line in lines if line.strip() and line[0] != "%")
    size, *others = (int(word) for word in sizes.split())
    values = np.array(" ".join(rows).split(), float)
    half = symmetry == "symmetric"
    if form == "coordinate":
        row, column, value = values.reshape(others[-1], 3).T
        return _placed(row - 1, column - 1, value, size, half)
    if values.size != (size * (size + 1) // 2 if half else size**2):
        raise InputError(f"holds {values.size} numbers for {size} rows: write it again")
    column, row = np.indices((size, size))
    part = row >= column if half else row >= 0
    return _placed(row[part], column[part], values, size, half)


def _placed(
    row: NDArray[Any], column: NDArray[Any], value: NDArray[Any], size: int, half: bool
) -> scipy.sparse.csc_array:
    """Matrix of entries by row and column from 0; of one half, the other is mirrored."""
    places = np.stack([row, column]).astype(np.int64)
    twice = np.unique(places, axis=1).shape[1] < value.size
    lost = size > value.size or np.setdiff1d(np.arange(size), places[0, row == column]).size
    if twice or lost or np.any(places != [row, column]):
        raise InputError("lacks entries, or has some twice: copy the whole file again")
    matrix = scipy.sparse.coo_array((value, tuple(places)), shape=(size, size))
    if half:
        matrix = matrix + scipy.sparse.coo_array(
            (np.where(row == column, 0.0, value), tuple(places[::-1])), shape=(size, size)
        )
    return scipy.sparse.csc_array(matrix)


def _substructure(text: str, what: str) -> Rows:
    """Rows of ``*SUBSTRUCTURE MATRIX OUTPUT``: nodes in comments, degrees of freedom, lower half.

    Element node k is the k-th in the comments, and its directions are given from line "k, ..." on.
    """
    head, _, _ = text.partition("*MATRIX")
    _, marker, rest = text.partition(f"*MATRIX,TYPE={what.upper()}")
    if not marker:
        kind = what.upper()
        raise InputError(f"holds no *MATRIX,TYPE={kind}: add {kind}=YES to the output")
    _, _, comments = head.partition("ELEMENT NODES")
    nodes: list[int] = []
    directions: list[tuple[int, list[int]]] = []
    for line in comments.splitlines()[1:]:
        numbers = [int(word) for word in re.findall(r"\d+", line)]
        if line.startswith("**"):
            nodes += numbers
        elif len(numbers) == 1 and not directions:  # direction of the first node
            directions.append((1, numbers))
        elif numbers:
            directions.append((numbers[0], numbers[1:]))
    if any(not 1 <= place <= len(nodes) for place, _ in directions):
        raise InputError(f"names an element node beyond the {len(nodes)} that it lists")
    rows = [(nodes[place - 1], direction) for place, ways in directions for direction in ways]
    body, _, _ = rest.partition("*")
    values = np.array(body.replace(",", " ").split(), float)
    size = len(rows)
    if values.size != size * (size + 1) // 2:
        raise InputError(f"holds {values.size} numbers for {size} rows: write it again")
    full = np.zeros((size, size))
    full[np.tril_indices(size)] = values
    full = full + np.tril(full, -1).T
    return Rows(scipy.sparse.csc_array(full), np.array(rows))


def _stored(data: bytes, path: Path, _: str) -> Rows:
    """Rows of CalculiX's matrix storage: triplets of the upper half, and node.direction."""
    listing = path.with_suffix(".dof")
    words = read_bytes(listing).decode("ascii").split()
    dofs = np.array([[int(part) for part in word.split(".")] for word in words])
    table = np.array(data.split(), float).reshape(-1, 3)
    if not data.endswith(b"\n"):
        raise InputError("ends within a line: copy the whole file again")
    row, column, value = table.T
    return Rows(_placed(row - 1, column - 1, value, len(dofs), True), dofs)


READERS: dict[str, Callable[[bytes, Path, str], Rows]] = {
    ".npz": _archive,
    ".mat": _matlab,
    ".mtx": _text,
    ".sti": _stored,
    ".mas": _stored,
}
