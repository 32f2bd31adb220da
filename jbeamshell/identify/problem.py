"""The least-squares problem of a fit, every model run remembered and, on request, saved.

An optimiser that is started again asks for the same points again, so an interrupted fit goes on
where it was by walking the same way through what is remembered.  The file of the state is one line
of JSON that says whose state it is, and one more for every run.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.typing import ArrayLike
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_path, write_text
from jbeamshell.identify.experiment import Experiment, Prediction
from jbeamshell.identify.parameters import Space
from jbeamshell.numerics.newton import Newton

FORMAT = "jbeamshell fit 1"
LONGEST_HEADER = 1000  # characters


class Point(NamedTuple):
    """The problem at a point of the search space.

    Attributes
    ----------
    residual : (rows + priors,) what is squared and summed
    jacobian : (rows + priors, n) with respect to the search space
    prediction : (rows,) the model's answer on the scale that is compared
    sound : whether every load step found equilibrium
    """

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    prediction: NDArray[np.float64]
    sound: bool

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return float(self.residual @ self.residual)


class Problem:
    """Residuals of an experiment over a search space, with the priors as further rows.

    Attributes
    ----------
    experiment : what is answered
    priors : (entry, mean, standard deviation) of every prior
    solver : settings of Newton's method
    """

    def __init__(
        self,
        experiment: Experiment,
        space: Space,
        solver: Newton,
        save: str | os.PathLike[str] | None = None,
    ) -> None:
        """Set the problem up; raises `InputError` for a state that belongs to another one."""
        self.experiment, self.solver = experiment, solver
        self.priors = [(i, *p.prior) for i, p in enumerate(space.parameters) if p.prior is not None]
        if self.priors and not experiment.noisy:
            name, (_, mean, deviation) = space.names[self.priors[0][0]], self.priors[0]
            raise InputError(
                f"free {name!r}: prior = {(mean, deviation)}: is worth nothing beside data of "
                "unknown noise; give noise, such as 0.01 of the range"
            )
        self._known: dict[bytes, Prediction] = {}
        self._path = None if save is None else as_path(save)
        if self._path is not None:
            mark = _fingerprint(experiment, space.keys, solver)
            self._header = json.dumps({"format": FORMAT, "fingerprint": mark})
            if os.path.exists(self._path):  # or false, where there can be no such name
                self._restore(space)
            else:
                write_text(self._path, self._header + "\n")

    @property
    def runs(self) -> int:
        """Points at which the model was run."""
        return len(self._known)

    @property
    def saved_in(self) -> str | None:
        """File of the state."""
        return None if self._path is None else str(self._path)

    def __call__(self, space: Space, point: ArrayLike) -> Point:
        """Residual and Jacobian together, remembered: optimisers ask for them apart."""
        values = space.values(point)
        if values.tobytes() not in self._known:
            answer = self.experiment(space.keys, values[space.table], self.solver)
            self._learn([(values, answer)])
        return self._point(space, point, values)

    def together(self, space: Space, points: Sequence[ArrayLike]) -> list[Point]:
        """The same at several points, whose models run side by side."""
        several = [space.values(point) for point in points]
        if any(values.tobytes() not in self._known for values in several):
            tables = np.stack([values[space.table] for values in several])
            answers = self.experiment.together(space.keys, tables, self.solver)
            self._learn(list(zip(several, answers, strict=True)))
        pairs = zip(points, several, strict=True)
        return [self._point(space, point, values) for point, values in pairs]

    def _point(self, space: Space, point: ArrayLike, values: NDArray[np.float64]) -> Point:
        answer, experiment = self._known[values.tobytes()], self.experiment
        jacobian = np.zeros((answer.residual.size + len(self.priors), values.size))
        for rows, owner in zip(experiment.slices, experiment.owners, strict=True):
            jacobian[rows, space.table[owner]] = answer.jacobian[rows]
        jacobian[: answer.residual.size] *= experiment.emphasis[:, None]
        beliefs = []
        for row, (entry, mean, deviation) in enumerate(self.priors, answer.residual.size):
            beliefs.append((values[entry] - mean) / deviation)
            jacobian[row, entry] = 1.0 / deviation
        residual = np.append(answer.residual * experiment.emphasis, beliefs)
        return Point(residual, jacobian * space.slopes(point), answer.prediction, answer.sound)

    def _learn(self, runs: Sequence[tuple[NDArray[np.float64], Prediction]]) -> None:
        self._known |= {values.tobytes(): answer for values, answer in runs}
        if self._path is None:
            return
        lines = "".join(_line(values, answer) for values, answer in runs)
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(lines)
        except OSError as error:
            reason = error.strerror or error
            raise InputError(f"save {self._path}: cannot be written ({reason})") from None

    def _restore(self, space: Space) -> None:
        path, fix = Path(str(self._path)), "delete it, or save elsewhere"
        sizes = self.experiment.weight.size, len(space.keys), len(space.names)
        try:
            with path.open(encoding="utf-8") as file:
                # No more than a header of what may be gigabytes of anything.
                header = file.readline(LONGEST_HEADER).rstrip("\n")
                fit = json.loads(header)["format"] == FORMAT
                # What follows the last newline was being written when the power went.
                lines = file.read().split("\n")[:-1] if header == self._header else []
            runs = [_run(line, *sizes) for line in lines]
        except OSError as error:
            raise InputError(f"save {path}: cannot be read ({error.strerror})") from None
        except (ValueError, KeyError, TypeError, RecursionError):
            fit = False
        if not fit:
            raise InputError(f"save {path}: is no state of a fit: {fix}")
        if header != self._header:
            raise InputError(f"save {path}: is the state of another fit: {fix}")
        self._known = {values.tobytes(): answer for values, answer in runs}
        write_text(path, "\n".join([header, *lines, ""]))


def _line(values: NDArray[np.float64], answer: Prediction) -> str:
    arrays = {"values": values} | {name: getattr(answer, name) for name in Prediction._fields[:3]}
    packed: dict[str, Any] = {name: _packed(array) for name, array in arrays.items()}
    return json.dumps(packed | {"sound": answer.sound}) + "\n"


def _run(line: str, rows: int, keys: int, entries: int) -> tuple[NDArray[np.float64], Prediction]:
    run = json.loads(line)
    residual, prediction = (
        _unpacked(run[name]).reshape(rows) for name in ("residual", "prediction")
    )
    jacobian = _unpacked(run["jacobian"]).reshape(rows, keys)
    return _unpacked(run["values"]).reshape(entries), Prediction(
        residual, jacobian, prediction, bool(run["sound"])
    )


def _packed(array: NDArray[np.float64]) -> str:
    return base64.b64encode(np.ascontiguousarray(array, "<f8").tobytes()).decode("ascii")


def _unpacked(text: str) -> NDArray[np.float64]:
    return np.frombuffer(base64.b64decode(text, validate=True), "<f8")


def _fingerprint(experiment: Experiment, keys: tuple[str, ...], solver: Newton) -> str:
    """Of everything that the model's answers hang on but the parameters' values."""
    digest = hashlib.sha256(repr((keys, solver, experiment.owners)).encode())
    for part in (experiment.scenes, experiment.observations):
        digest.update(re.sub(r"0x[0-9a-f]+", "", str(jax.tree.structure(part))).encode())
        for leaf in jax.tree.leaves(part):
            if isinstance(leaf, jax.Array | np.ndarray):
                digest.update(f"{leaf.dtype}{leaf.shape}".encode() + np.asarray(leaf).tobytes())
            else:
                digest.update(type(leaf).__name__.encode())
    return digest.hexdigest()
