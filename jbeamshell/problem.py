"""The least-squares problem of a fit, every model run remembered and, on request, saved.

An optimiser that is started again asks for the same points again, so an interrupted fit goes on
where it was by walking the same way through what is remembered.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
from jax.typing import ArrayLike
from numpy.typing import NDArray

from jbeamshell.errors import InputError
from jbeamshell.experiment import Answer, Experiment
from jbeamshell.files import write_text
from jbeamshell.newton import Newton
from jbeamshell.parameters import Space

FORMAT = "jbeamshell fit 1"


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
        self._known: dict[bytes, Answer] = {}
        self._path = None if save is None else Path(save)
        if self._path is not None:
            self._mark = _fingerprint(experiment, space.keys, solver)
            if self._path.exists():
                self._restore()
            else:
                self._save()

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
        values, slopes = space.values(point), space.slopes(point)
        key = values.tobytes()
        if key not in self._known:
            self._known[key] = self.experiment(space.keys, values[space.table], self.solver)
            if self._path is not None:
                self._save()
        answer, experiment = self._known[key], self.experiment
        jacobian = np.zeros((answer.residual.size + len(self.priors), values.size))
        for rows, owner in zip(experiment.slices, experiment.owners, strict=True):
            jacobian[rows, space.table[owner]] = answer.jacobian[rows]
        jacobian[: answer.residual.size] *= experiment.emphasis[:, None]
        beliefs = []
        for row, (entry, mean, deviation) in enumerate(self.priors, answer.residual.size):
            beliefs.append((values[entry] - mean) / deviation)
            jacobian[row, entry] = 1.0 / deviation
        residual = np.append(answer.residual * experiment.emphasis, beliefs)
        return Point(residual, jacobian * slopes, answer.prediction, answer.sound)

    def _save(self) -> None:
        runs = [
            {"values": _packed(np.frombuffer(key)), "sound": answer.sound}
            | {name: _packed(getattr(answer, name)) for name in Answer._fields[:3]}
            for key, answer in self._known.items()
        ]
        state = {"format": FORMAT, "fingerprint": self._mark, "runs": runs}
        write_text(str(self._path), json.dumps(state) + "\n")

    def _restore(self) -> None:
        fix = "delete it, or save elsewhere"
        try:
            state = json.loads(Path(str(self._path)).read_text(encoding="utf-8"))
            if state["format"] != FORMAT:
                raise ValueError
            runs = [(_unpacked(run["values"]), run) for run in state["runs"]]
            known = {
                values.tobytes(): Answer(
                    _unpacked(run["residual"]),
                    _unpacked(run["jacobian"]).reshape(-1, _columns(self.experiment, run)),
                    _unpacked(run["prediction"]),
                    bool(run["sound"]),
                )
                for values, run in runs
            }
        except OSError as error:
            raise InputError(f"save {self._path}: cannot be read ({error.strerror})") from None
        except (ValueError, KeyError, TypeError):
            raise InputError(f"save {self._path}: is no state of a fit: {fix}") from None
        if state["fingerprint"] != self._mark:
            raise InputError(f"save {self._path}: is the state of another fit: {fix}")
        self._known = known


def _columns(experiment: Experiment, run: dict[str, str]) -> int:
    """Columns of a saved Jacobian."""
    return _unpacked(run["jacobian"]).size // experiment.weight.size


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
            array = isinstance(leaf, jax.Array | np.ndarray)
            digest.update(np.asarray(leaf).tobytes() if array else type(leaf).__name__.encode())
    return digest.hexdigest()
