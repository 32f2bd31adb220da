"""File of a fit's model runs, from which an interrupted fit continues.

Its first line is JSON that names the fit; every further line holds a check sum and one run as JSON.
A run that was changed, or is of another fit, is left out and made again.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_path, write_text
from jbeamshell.identify.runs import Evaluation

FORMAT = "jbeamshell fit 4"
LONGEST_HEADER = 1000  # characters
FIX = "delete it, or save to another file"

Run = tuple[NDArray[np.float64], Evaluation]


class SavedRuns:
    """Model runs of one fit in a file.

    Attributes
    ----------
    path : the file
    """

    def __init__(self, path: str | os.PathLike[str], words: Any, trees: Any) -> None:
        """Name the file of the runs of a fit.

        Parameters
        ----------
        path : the file
        words, trees : all that determines the predictions but the parameters' values, in words and
            as pytrees
        """
        self.path = as_path(path)
        self._header = json.dumps({"format": FORMAT, "fingerprint": _fingerprint(words, trees)})

    def read(self) -> list[Run]:
        """Values and prediction of every run so far; begins the file if there is none.

        Raises
        ------
        InputError
            if the file cannot be read or written, or holds anything but runs of this fit
        """
        if not os.path.exists(self.path):  # false also where there can be no such name
            write_text(self.path, self._header + "\n")
            return []
        try:
            with self.path.open(encoding="utf-8", errors="replace") as file:
                # The file may be gigabytes of anything: read no more than a header first.
                header = file.readline(LONGEST_HEADER).rstrip("\n")
                valid = json.loads(header)["format"] == FORMAT
                # The last line has no newline if the power went while it was written.
                lines = file.read().split("\n")[:-1] if header == self._header else []
        except OSError as error:
            raise InputError(f"save {self.path}: cannot be read ({error.strerror})") from None
        except (ValueError, KeyError, TypeError, RecursionError):
            valid = False
        if not valid:
            raise InputError(f"save {self.path}: is no state of a fit: {FIX}")
        if header != self._header:
            raise InputError(f"save {self.path}: is the state of another fit: {FIX}")
        # Two fits at once may both have made a run.
        found = [(line, self._run(line)) for line in dict.fromkeys(lines)]
        write_text(self.path, "\n".join([header, *(line for line, run in found if run), ""]))
        return [run for _, run in found if run]

    def append(self, runs: Sequence[Run]) -> None:
        """Add runs to the file; raises `InputError` if it cannot be written."""
        lines = "".join(self._line(*run) for run in runs)
        try:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(lines)
        except OSError as error:
            reason = error.strerror or error
            raise InputError(f"save {self.path}: cannot be written ({reason})") from None

    def _line(self, values: NDArray[np.float64], run: Evaluation) -> str:
        *arrays, converged = values, *run
        body = json.dumps([*(array.tolist() for array in arrays), bool(converged)])
        return f"{self._check_sum(body)} {body}\n"

    def _run(self, line: str) -> Run | None:
        """Run in a line; None if the line is not as it was written."""
        mark, _, body = line.partition(" ")
        if mark != self._check_sum(body):
            return None
        *lists, converged = json.loads(body)
        values, residual, jacobian, prediction = map(np.array, lists)
        return values, Evaluation(residual, jacobian, prediction, converged)

    def _check_sum(self, body: str) -> str:
        return hashlib.sha256((self._header + body).encode(errors="replace")).hexdigest()


def _fingerprint(words: Any, trees: Any) -> str:
    """Hash of words, and of the leaves and the structure of pytrees."""
    digest = hashlib.sha256(repr(words).encode())
    for part in trees:
        digest.update(re.sub(r"0x[0-9a-f]+", "", str(jax.tree.structure(part))).encode())
        for leaf in jax.tree.leaves(part):
            if isinstance(leaf, jax.Array | np.ndarray):
                digest.update(f"{leaf.dtype}{leaf.shape}".encode() + np.asarray(leaf).tobytes())
            else:
                name = getattr(leaf, "__qualname__", type(leaf).__name__)
                digest.update(name.encode())
    return digest.hexdigest()
