"""File of a fit's model runs, from which an interrupted fit continues.

Its first line is JSON that names the fit; every further line holds one run.
"""

from __future__ import annotations

import base64
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
from jbeamshell.identify.experiment import Experiment, Prediction
from jbeamshell.identify.search_space import SearchSpace
from jbeamshell.numerics.newton import Newton

FORMAT = "jbeamshell fit 2"
LONGEST_HEADER = 1000  # characters
FIX = "delete it, or save to another file"

Run = tuple[NDArray[np.float64], Prediction]


class SavedRuns:
    """Model runs of one fit in a file.

    Attributes
    ----------
    path : the file
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        experiment: Experiment,
        space: SearchSpace,
        solver: Newton,
    ) -> None:
        """Name the file of the runs of an experiment over a search space, by a solver."""
        self.path = as_path(path)
        self._sizes = experiment.weight.size, len(space.keys), len(space.names)
        mark = _fingerprint(experiment, space.keys, solver)
        self._header = json.dumps({"format": FORMAT, "fingerprint": mark})

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
        runs: list[Run] = []
        try:
            with self.path.open(encoding="utf-8") as file:
                # The file may be gigabytes of anything: read no more than a header first.
                header = file.readline(LONGEST_HEADER).rstrip("\n")
                valid = json.loads(header)["format"] == FORMAT
                # The last line has no newline if the power went while it was written.
                lines = file.read().split("\n")[:-1] if header == self._header else []
            runs = [_from_line(line, *self._sizes) for line in lines]
        except OSError as error:
            raise InputError(f"save {self.path}: cannot be read ({error.strerror})") from None
        except (ValueError, KeyError, TypeError, RecursionError):
            valid = False
        if not valid:
            raise InputError(f"save {self.path}: is no state of a fit: {FIX}")
        if header != self._header:
            raise InputError(f"save {self.path}: is the state of another fit: {FIX}")
        write_text(self.path, "\n".join([header, *lines, ""]))
        return runs

    def append(self, runs: Sequence[Run]) -> None:
        """Add runs to the file; raises `InputError` if it cannot be written."""
        lines = "".join(_as_line(*run) for run in runs)
        try:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(lines)
        except OSError as error:
            reason = error.strerror or error
            raise InputError(f"save {self.path}: cannot be written ({reason})") from None


def _as_line(values: NDArray[np.float64], run: Prediction) -> str:
    arrays = {"values": values} | {name: getattr(run, name) for name in Prediction._fields[:3]}
    packed: dict[str, Any] = {name: _packed(array) for name, array in arrays.items()}
    return json.dumps(packed | {"converged": run.converged}) + "\n"


def _from_line(line: str, rows: int, keys: int, axes: int) -> Run:
    run = json.loads(line)
    residual, prediction = (
        _unpacked(run[name]).reshape(rows) for name in ("residual", "prediction")
    )
    jacobian = _unpacked(run["jacobian"]).reshape(rows, keys)
    return _unpacked(run["values"]).reshape(axes), Prediction(
        residual, jacobian, prediction, bool(run["converged"])
    )


def _packed(array: NDArray[np.float64]) -> str:
    return base64.b64encode(np.ascontiguousarray(array, "<f8").tobytes()).decode("ascii")


def _unpacked(text: str) -> NDArray[np.float64]:
    return np.frombuffer(base64.b64decode(text, validate=True), "<f8")


def _fingerprint(experiment: Experiment, keys: tuple[str, ...], solver: Newton) -> str:
    """Hash of everything that determines the predictions, except the parameters' values."""
    digest = hashlib.sha256(repr((keys, solver, experiment.owners)).encode())
    for part in (experiment.scenes, experiment.observations):
        digest.update(re.sub(r"0x[0-9a-f]+", "", str(jax.tree.structure(part))).encode())
        for leaf in jax.tree.leaves(part):
            if isinstance(leaf, jax.Array | np.ndarray):
                digest.update(f"{leaf.dtype}{leaf.shape}".encode() + np.asarray(leaf).tobytes())
            else:
                name = getattr(leaf, "__qualname__", type(leaf).__name__)
                digest.update(name.encode())
    return digest.hexdigest()
