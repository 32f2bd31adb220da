"""Least-squares problem of a fit, which remembers every model run and saves it on request.

An optimiser that is started again asks for the same points again, so an interrupted fit continues
where it stopped by reading its first steps from the runs that were saved.
"""

from __future__ import annotations

import os

import numpy as np
from jax.typing import ArrayLike
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.identify.experiment import Evaluation, Experiment
from jbeamshell.identify.saved_runs import SavedRuns
from jbeamshell.identify.search_space import SearchSpace
from jbeamshell.numerics.newton import Newton


class Problem:
    """Residuals of an experiment over a search space, with the priors as further rows.

    Attributes
    ----------
    experiment : measurements and the runs that reproduce them
    space : search space, n axes
    priors : (axis, mean, standard deviation) of every prior
    solver : settings of Newton's method
    """

    def __init__(
        self,
        experiment: Experiment,
        space: SearchSpace,
        solver: Newton,
        save: str | os.PathLike[str] | None = None,
    ) -> None:
        """Set the problem up.

        Parameters
        ----------
        experiment : measurements and the runs that reproduce them
        space : search space, n axes
        solver : settings of Newton's method
        save : file of the model runs, which is read if it exists

        Raises
        ------
        InputError
            if the file belongs to another problem, or if there are priors but no known noise
        """
        self.experiment, self.space, self.solver = experiment, space, solver
        self.priors = [(i, *p.prior) for i, p in enumerate(space.parameters) if p.prior is not None]
        if self.priors and not experiment.noisy:
            name, (_, mean, deviation) = space.names[self.priors[0][0]], self.priors[0]
            raise InputError(
                f"free {name!r}: prior = {(mean, deviation)}: cannot be weighed against data of "
                "unknown noise; give noise (--noise on the command line), such as 0.01"
            )
        self._known: dict[bytes, Evaluation] = {}
        self._saved = None
        if save is not None:
            self._saved = SavedRuns(save, experiment, space, solver)
            self._known = {values.tobytes(): run for values, run in self._saved.read()}

    @property
    def runs(self) -> int:
        """Number of points at which the model was run."""
        return len(self._known)

    @property
    def saved_in(self) -> str | None:
        """File of the model runs; None if they are not saved."""
        return None if self._saved is None else str(self._saved.path)

    def __call__(self, point: ArrayLike, space: SearchSpace | None = None) -> Evaluation:
        """Residual and Jacobian at a point (n,) of the search space, or of another one."""
        space = space or self.space
        values = space.values(point)
        if values.tobytes() not in self._known:
            prediction = self.experiment(space.keys, values[space.table], self.solver)
            self._remember(values, prediction)
        run, experiment = self._known[values.tobytes()], self.experiment
        rows = run.residual.size
        jacobian = np.zeros((rows + len(self.priors), values.size))
        for own, owner in zip(experiment.slices, experiment.owners, strict=True):
            jacobian[own, space.table[owner]] = run.jacobian[own]
        jacobian[:rows] *= experiment.emphasis[:, None]
        deviations = []
        for row, (axis, mean, deviation) in enumerate(self.priors, rows):
            deviations.append((values[axis] - mean) / deviation)
            jacobian[row, axis] = 1.0 / deviation
        residual = np.append(run.residual * experiment.emphasis, deviations)
        slopes = space.slopes(point)
        return Evaluation(residual, jacobian * slopes, run.prediction, run.converged)

    def _remember(self, values: NDArray[np.float64], run: Evaluation) -> None:
        self._known[values.tobytes()] = run
        if self._saved is not None:
            self._saved.append([(values, run)])
