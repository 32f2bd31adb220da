"""Least-squares problem of a fit, which remembers every model run and saves it on request.

A search that is started again asks for the same points again, so an interrupted fit continues where
it stopped by reading its first steps from the runs that were saved.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.identify.observations import Observation
from jbeamshell.identify.parameters import RIG
from jbeamshell.identify.rig import observed
from jbeamshell.identify.runs import GRIDS, Evaluation, Runs
from jbeamshell.identify.saved_runs import SavedRuns
from jbeamshell.identify.search_space import SearchSpace
from jbeamshell.identify.specimens import Case
from jbeamshell.measured.loops import Loop
from jbeamshell.numerics.newton import Newton


class Problem:
    """Residuals of measurements over a search space, with the priors as further rows.

    Attributes
    ----------
    space : search space, n axes
    priors : (axis, mean, standard deviation) of every prior
    models : model of each specimen at the start
    measurements : all measurements, specimen by specimen
    labels : labels of the measurements, no two alike
    owners : specimen of each measurement
    observations : run of the model of each measurement
    noisy : True if residuals are in units of measured noise; False if relative to the range
    weight : (rows,) factors from differences to residuals
    emphasis : (rows,) factors that the user gave, not contained in the residuals
    slices : rows of each measurement
    relative : (rows,) factors from residuals to parts of the measurement's range
    """

    def __init__(
        self,
        cases: Sequence[Case],
        space: SearchSpace,
        *,
        points: int,
        noise: float | None = None,
        solver: Newton | None = None,
        save: str | os.PathLike[str] | None = None,
    ) -> None:
        """Set the problem up.

        Parameters
        ----------
        cases : models of the specimens at the start, with their measurements
        space : search space, n axes
        points : number of points to which each loop is thinned, approximately
        noise : standard deviation of measurements without noise, over their range
        solver : settings of Newton's method; None takes the defaults
        save : file of the model runs, which is read if it exists

        Raises
        ------
        InputError
            if a model cannot reproduce a measurement, if only some measurements carry noise, if
            there are priors but no known noise, or if the file belongs to another problem
        """
        self.space, solver = space, solver or Newton()
        self.models = [case.model for case in cases]
        self.owners = [owner for owner, case in enumerate(cases) for _ in case.measurements]
        given: list[Any] = [
            item.thinned(points, case.model.control) if isinstance(item, Loop) else item
            for case in cases
            for item in case.measurements
        ]
        if any(getattr(item, "deviations", None) is not None for item in given):
            # Beside others that know theirs, a guess is better than none.
            given = [item.but(guessed=False) if isinstance(item, Loop) else item for item in given]
        free = [key for key in space.keys if key in RIG]
        observations = [
            observed(item, self.models[owner], cases[owner].rig, free)
            for item, owner in zip(given, self.owners, strict=True)
        ]
        self.measurements = [i.without_turns if isinstance(i, Loop) else i for i in given]
        prefixes = [f"{case.label}: " if len(cases) > 1 else "" for case in cases]
        pairs = zip(self.owners, self.measurements, strict=True)
        self.labels = _distinct([prefixes[owner] + item.label for owner, item in pairs])
        self.observations = self._with_noise(observations, noise)
        self._set_rows(np.concatenate([case.weights for case in cases]), noise)
        self.priors = [(i, *p.prior) for i, p in enumerate(space.parameters) if p.prior is not None]
        if self.priors and not self.noisy:
            name, (_, mean, deviation) = space.names[self.priors[0][0]], self.priors[0]
            raise InputError(
                f"free {name!r}: prior = {(mean, deviation)}: cannot be weighed against data of "
                "unknown noise; give noise (--noise on the command line), such as 0.01"
            )
        self.runs = Runs(self.observations, self.models, self.owners, space.keys, solver)
        self._known: dict[bytes, Evaluation] = {}
        self._saved = None
        if save is not None:
            known = (space.keys, solver, self.owners), (self.models, self.observations)
            self._saved = SavedRuns(save, *known)
            self._known = {values.tobytes(): run for values, run in self._saved.read()}

    def _with_noise(
        self, observations: Sequence[Observation], noise: float | None
    ) -> list[Observation]:
        """Observations whose weights are all relative to noise, or all relative to the range."""
        known = [measurement.deviations is not None for measurement in self.measurements]
        self.noisy = noise is not None or all(known)
        if any(known) and not self.noisy:
            without = self.labels[known.index(False)]
            raise InputError(
                f"{without}: carries no noise but {self.labels[known.index(True)]} does: give "
                "noise (--noise on the command line), such as 0.01 of the range, for the others"
            )
        if noise is None:
            return list(observations)
        return [
            one if has else eqx.tree_at(lambda o: o.weight, one, one.weight / noise)
            for one, has in zip(observations, known, strict=True)
        ]

    def _set_rows(self, weights: NDArray[np.float64], noise: float | None) -> None:
        """Set the rows of each measurement, and their factors."""
        self._compared = [np.flatnonzero(np.asarray(o.weight)) for o in self.observations]
        sizes = [compared.size for compared in self._compared]
        ends = np.cumsum(sizes).tolist()
        self.slices = [slice(end - size, end) for end, size in zip(ends, sizes, strict=True)]
        own = [measurement.weight for measurement in self.measurements]
        self.emphasis = np.repeat(np.multiply(own, weights), sizes)
        pairs = zip(self.observations, self._compared, strict=True)
        self.weight = np.concatenate([np.asarray(o.weight)[compared] for o, compared in pairs])
        spans = np.repeat([o.span for o in self.observations], sizes)
        known = np.repeat([m.deviations is not None for m in self.measurements], sizes)
        self.relative = np.where(known, 1.0 / (self.weight * spans), noise or 1.0)

    @property
    def count(self) -> int:
        """Number of points at which the model was run."""
        return len(self._known)

    @property
    def saved_in(self) -> str | None:
        """File of the model runs; None if they are not saved."""
        return None if self._saved is None else str(self._saved.path)

    @property
    def model_error(self) -> float:
        """Size of what a grid of plane elasticity may leave in a residual; 0 for other models.

        It counts that of data computed at the scene's own tolerance, which is coarser, as well.
        """
        left = np.zeros(self.weight.size)
        for rows, (observation, model) in zip(self.slices, self.runs.pairs, strict=True):
            left[rows] = observation.own_error * GRIDS * model.tolerance
        return float(np.sqrt(np.mean((left / self.relative) ** 2)))

    def __call__(self, point: ArrayLike) -> Evaluation:
        """Residual and Jacobian at a point (n,) of the search space."""
        values, slopes = self.space.at(np.asarray(point, dtype=float))
        run = self._known.get(values.tobytes()) or self._run(values)
        rows = run.residual.size
        jacobian = np.zeros((rows + len(self.priors), values.size))
        for own, owner in zip(self.slices, self.owners, strict=True):
            jacobian[own, self.space.table[owner]] = run.jacobian[own]
        jacobian[:rows] *= self.emphasis[:, None]
        deviations = []
        for row, (axis, mean, deviation) in enumerate(self.priors, rows):
            deviations.append((values[axis] - mean) / deviation)
            jacobian[row, axis] = 1.0 / deviation
        residual = np.append(run.residual * self.emphasis, deviations)
        return Evaluation(residual, jacobian * slopes, run.prediction, run.converged)

    def _run(self, values: NDArray[np.float64]) -> Evaluation:
        """Evaluation of all measurements at values (n,), without priors and the user's factors."""
        responses = self.runs(values[self.space.table])
        columns = [
            [array[compared] for array in response[:-1]]
            for response, compared in zip(responses, self._compared, strict=True)
        ]
        residual, jacobian, prediction = map(np.concatenate, zip(*columns, strict=True))
        converged = all(bool(response[-1]) for response in responses)
        found = Evaluation(residual, jacobian, prediction, converged)
        self._known[values.tobytes()] = found
        if self._saved is not None:
            self._saved.append([(values, found)])
        return found

    def traced_cost(self, values: Array) -> tuple[Array, Array]:
        """Sum of the squared residuals of the data at values (n,), and its derivatives (n,)."""
        cost, slopes, table = jnp.zeros(()), jnp.zeros_like(values), self.space.table
        responses = self.runs.traced(values[table])
        for owner, rows, (residual, jacobian, *_) in zip(
            self.owners, self.slices, responses, strict=True
        ):
            emphasis = self.emphasis[rows][0] ** 2
            cost = cost + emphasis * jnp.sum(residual**2)
            slopes = slopes.at[table[owner]].add(2.0 * emphasis * residual @ jacobian)
        return cost, slopes

    def of(self, owner: int) -> list[Any]:
        """Measurements of a specimen, by its number."""
        return [m for m, own in zip(self.measurements, self.owners, strict=True) if own == owner]

    def controls(self) -> list[str]:
        """Column that drives the model, for every measurement."""
        return [self.models[owner].control for owner in self.owners]

    def as_measurements(self, prediction: NDArray[np.float64]) -> list[Any]:
        """Measurements as the model predicts them, from compared points (rows,)."""
        predicted = []
        for measurement, observation, control, rows in zip(
            self.measurements, self.observations, self.controls(), self.slices, strict=True
        ):
            column = measurement.form.response(control)
            values = observation.response_from(prediction[rows])
            predicted.append(measurement.but(**{column: values}))
        return predicted


def _distinct(names: Sequence[str]) -> list[str]:
    """Names with a number appended to those that came before."""
    distinct: list[str] = []
    for name in names:
        fresh, number = name, 1
        while fresh in distinct:
            number += 1
            fresh = f"{name} ({number})"
        distinct.append(fresh)
    return distinct
