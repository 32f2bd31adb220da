"""Result of a fit: values with their uncertainty, misfits, and warnings."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.common.summary import Summary
from jbeamshell.identify.contradictions import contradiction
from jbeamshell.identify.model_error import model_misfit
from jbeamshell.identify.posterior import Posterior, posterior
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.profile_likelihood import MAX_ITERATIONS, TOLERANCE, Profile, profile
from jbeamshell.identify.settling import Settled
from jbeamshell.identify.statics import doubt_of_statics
from jbeamshell.identify.uncertainty import LEVELS, Uncertainty, band_widths, uncertainty_at
from jbeamshell.identify.verdict import undescribed
from jbeamshell.identify.wrong_units import doubt_of_units
from jbeamshell.laws import Law

WRONG_MODEL = 2.0  # misfit over noise above which the model must be wrong
WORTH_SAYING = 1e-3  # of the range, left by the model


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """Result of a fit; print it, or draw it by `plot`.

    Attributes
    ----------
    scene : scene with the fitted values, ready to run, or the law, or the `Assembly`; of several
        specimens the first
    values, errors : fitted value and standard error (one sigma) by key, or by "key[specimen]" where
        every specimen has its own.  They count what the model leaves as so many independent points
        as its correlation along the curves allows
    correlation : (n, n) correlation of the fitted values, in the order of ``values``
    misfit : root mean square of the residual over the range of the response
    misfits : the same for every measurement
    left : the same without the part that is white noise: what the model does not describe
    data, model : fitted measurements, loops thinned, and the model's at the same points
    status : "converged" or "max_iterations"
    model_runs : number of model runs through all measurements, derivatives included
    labels : labels of the measurements, no two alike
    scenes : scene of every specimen by its label, with the fitted values
    intervals : 95 % confidence interval by key
    doubts : sentences on what to know before using the values
    controls : column that drives the model, for every measurement
    notes : sentences on what was done to the data, and what was estimated and chosen by default
    describes : False if the model leaves too much of a measurement, or misses the energy per cycle
        or the secant stiffness of a loop, see `jbeamshell.identify.verdict`; its values then mean
        little
    minima : values and cost at the end of each search, the best first
    uncertainty : what the data do not determine, for other levels and noise
    problem : least-squares problem
    """

    scene: Any
    values: dict[str, float]
    errors: dict[str, float]
    correlation: NDArray[np.float64]
    misfit: float
    misfits: list[float]
    data: list[Any]
    model: list[Any]
    status: str
    model_runs: int
    labels: Sequence[str] = ()
    scenes: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    intervals: Mapping[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    doubts: Sequence[str] = ()
    left: Sequence[float] = ()
    describes: bool = True
    minima: Sequence[tuple[dict[str, float], float]] = ()
    uncertainty: Uncertainty | None = None
    problem: Problem | None = None
    notes: Sequence[str] = ()
    controls: Sequence[str] = ()

    @property
    def law(self) -> Law:
        """Fitted law of a joint, of several specimens the first; raises for others."""
        require("law", "none", isinstance(self.scene, Law), "read scene instead")
        law: Law = self.scene
        return law

    @property
    def _summary(self) -> Summary:
        rows = [(k, f"{value:.6g} +- {self.errors[k]:.2g}") for k, value in self.values.items()]
        misfit = f"misfit {100 * self.misfit:.3g} % of the range"
        end = f"{self.status} after {self.model_runs} model runs"
        return Summary("", rows, [misfit, end, *self.doubts, *self.notes])

    def __repr__(self) -> str:
        return self._summary.as_text(28)

    def _repr_html_(self) -> str:
        from jbeamshell import plotting

        return self._summary.as_html(plotting.thumbnail(self.plot()))

    def figures(self) -> dict[str, Any]:
        """Result as plain numbers for JSON; an infinite end is None."""
        labels = self.labels or [d.label for d in self.data]
        values: dict[str, dict[str, Any]] = {
            key: {"value": value, "error": _finite(self.errors[key])}
            for key, value in self.values.items()
        }
        for level in LEVELS if self.uncertainty is not None else ():
            for key, ends in self.intervals_at(level).items():
                values[key][f"interval_{100 * level:.0f}"] = [_finite(end) for end in ends]
        figures = {
            "values": values,
            "correlation": self.correlation.tolist(),
            "misfit": self.misfit,
            "misfits": dict(zip(labels, self.misfits, strict=True)),
            "describes": self.describes,
            "status": self.status,
            "model_runs": self.model_runs,
            "doubts": list(self.doubts),
            "notes": list(self.notes),
        }
        if self.uncertainty is not None:
            u = self.uncertainty
            figures["noise"] = {"of_the_range": u.noise, "measured": u.freedom is None}
            figures["independent_points"] = u.independent
            figures["left_by_the_model"] = dict(zip(labels, self.left, strict=True))
            figures["fisher"] = [
                {
                    "eigenvalue": direction.eigenvalue,
                    "direction": dict(zip(self.values, direction.vector.tolist(), strict=True)),
                }
                for direction in u.directions()
            ]
            figures["minima"] = [{"values": values, "cost": cost} for values, cost in self.minima]
        return figures

    def intervals_at(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Confidence interval of every value at a level between 0 and 1."""
        ends = self._uncertainty.intervals(level).tolist()
        return {key: (low, high) for key, (low, high) in zip(self.values, ends, strict=True)}

    def bands(self, level: float = 0.95, *, noise: bool = False) -> list[tuple[Any, Any]]:
        """Confidence band of the model's response to every measurement.

        Parameters
        ----------
        level : confidence level, point by point
        noise : True to cover a single measurement with its noise; False for the model alone

        Returns
        -------
        Lower and upper end for every measurement, each a measurement of the same kind
        """
        problem, uncertainty = self._problem, self._uncertainty
        best, experiment = problem(uncertainty.point), problem.experiment
        per_noise = 1.0 / experiment.weight
        rows = experiment.weight.size
        plain = best.jacobian[:rows] * (per_noise / experiment.emphasis)[:, None]
        own = uncertainty.scatter * per_noise if noise else None
        width = band_widths(uncertainty, plain, level, own)
        sides = (best.prediction + side * width for side in (-1.0, 1.0))
        return list(zip(*map(experiment.as_measurements, sides), strict=True))

    def profile(
        self,
        name: str,
        *,
        level: float = 0.95,
        max_iterations: int = MAX_ITERATIONS,
        tolerance: float = TOLERANCE,
    ) -> Profile:
        """Profile likelihood of a fitted parameter, and its confidence interval.

        ``intervals`` linearise the model, which is right for little noise only.  This function runs
        the model: it holds the parameter at other values and fits all others again (Raue et al.,
        Bioinformatics 25, 2009).  It costs up to 16 fits.

        Parameters
        ----------
        name : one of ``values``
        level : confidence level, between 0 and 1
        max_iterations, tolerance : settings of the fits of the other parameters

        Returns
        -------
        Profile
            ``interval``, the ``values`` of the parameter with the ``rises`` of the cost over the
            squared noise, and ``settled``, which is False if other fits did not converge

        Raises
        ------
        InputError
            if the name was not fitted, or if its value ended at a bound

        Examples
        --------
        ::

            low, high = jb.fit(loops, scene, free).profile("contact.friction").interval
        """
        fix = f"was not fitted; names are {', '.join(self.values)}"
        require("profile", name, name in self.values, fix)
        return profile(self._problem, self._uncertainty, name, level, max_iterations, tolerance)

    def posterior(self) -> Posterior:
        """Posterior density of the parameters, for samplers of other libraries.

        Returns
        -------
        Posterior
            ``logdensity`` of points of the search space, ``start`` and ``covariance`` there,
            ``constrain`` and ``unconstrain``, ``loglikelihood`` of values, ``prior_transform``

        Raises
        ------
        InputError
            if a value ended at its bound

        Examples
        --------
        ::

            problem = jb.fit(loops, scene, ["contact.friction"]).posterior()
            sampler = blackjax.nuts(problem.logdensity, 0.5, problem.covariance)
            state = sampler.init(problem.start)
        """
        return posterior(self._problem, self._uncertainty)

    @property
    def columns(self) -> list[str]:
        """Name of the responding column of every measurement."""
        return [d.form.response(by) for d, by in zip(self.data, self.controls, strict=True)]

    @property
    def residuals(self) -> list[NDArray[np.float64]]:
        """Model less data over the range, (points,) each; of logarithms for amplitude curves."""
        left = []
        for data, model, column in zip(self.data, self.model, self.columns, strict=True):
            given, found = getattr(data, column), getattr(model, column)
            relative = data.form.scale == "log"
            left.append(np.log(found / given) if relative else (found - given) / np.ptp(given))
        return left

    def plot(self, axes: Any = None) -> Any:
        """Draw model over data; returns the axes, a list where there are several kinds of data."""
        from jbeamshell import plotting

        drawn = plotting.overlay(self, axes)
        return drawn[0] if len(drawn) == 1 else drawn

    def plot_residuals(self, axes: Any = None) -> Any:
        """Draw model less data; returns the axes as `plot` does."""
        from jbeamshell import plotting

        drawn = plotting.residuals(self, axes)
        return drawn[0] if len(drawn) == 1 else drawn

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write tables, pictures, scenes and figures into a folder; returns the files' paths."""
        from jbeamshell.identify import report

        return report.write_fit(Path(folder), self, self.figures())

    @property
    def _uncertainty(self) -> Uncertainty:
        if self.uncertainty is None:
            raise InputError("uncertainty: this result was not made by fit and has none")
        return self.uncertainty

    @property
    def _problem(self) -> Problem:
        if self.problem is None:
            raise InputError("problem: this result was not made by fit and has none")
        return self.problem


def fit_at(
    problem: Problem,
    end: Settled,
    labels: Sequence[str],
    status: str,
    minima: Sequence[tuple[NDArray[np.float64], float]],
) -> Fit:
    """Result at the point where the search ended.

    Parameters
    ----------
    problem : least-squares problem
    end : end of the best search
    labels : labels of the specimens
    status : status of the best search
    minima : values and cost at the end of each search
    """
    space, experiment, point = problem.space, problem.experiment, end.point
    best, values = problem(point), space.values(point)
    uncertainty = uncertainty_at(problem, point, end.jacobian)
    plain = best.residual[: experiment.weight.size] / experiment.emphasis
    relative = plain * experiment.relative
    left = [model_misfit(relative[own]) for own in experiment.slices]
    unlike = undescribed(experiment, left, best.prediction)
    models = {
        label: model.replace(space.of(values, specimen))
        for specimen, (label, model) in enumerate(zip(labels, experiment.models, strict=True))
    }
    scenes = {label: model.own for label, model in models.items()}
    ends = uncertainty.intervals().tolist()
    statics: list[str] = []
    if best.converged:
        statics = doubt_of_statics(experiment, list(models.values()), uncertainty, end.jacobian)
    return Fit(
        scene=next(iter(scenes.values())),
        values=space.named(values),
        errors=space.named(uncertainty.errors),
        correlation=uncertainty.correlation,
        misfit=float(np.sqrt(np.mean(relative**2))),
        misfits=[float(np.sqrt(np.mean(relative[own] ** 2))) for own in experiment.slices],
        data=experiment.measurements,
        model=experiment.as_measurements(best.prediction),
        status=status,
        model_runs=problem.runs,
        labels=experiment.labels,
        scenes=scenes,
        intervals={k: (low, high) for k, (low, high) in zip(space.names, ends, strict=True)},
        doubts=[
            *unlike,
            *_contradiction(problem, point),
            *doubt_of_units(space, values.tolist()),
            *statics,
            *_doubts(problem, uncertainty, values, left, minima),
        ],
        left=left,
        describes=not unlike,
        minima=[(space.named(own), cost) for own, cost in minima],
        uncertainty=uncertainty,
        problem=problem,
        controls=[experiment.models[owner].control for owner in experiment.owners],
    )


def _contradiction(problem: Problem, point: NDArray[np.float64]) -> list[str]:
    """Sentence on two measurements that contradict each other; none if they agree."""
    experiment, best = problem.experiment, problem(point)
    found = contradiction(best.residual, best.jacobian, experiment.slices)
    if found is None:
        return []
    axis, *places = found[:3]
    said = []
    for place, step in zip(places, found[3:], strict=True):
        moved = np.where(np.arange(point.size) == axis, point + step, point)
        said.append(f"{experiment.labels[place]} about {problem.space.values(moved)[axis]:.3g}")
    return [
        f"the measurements contradict each other: alone, {' and '.join(said)} would have for "
        f"{problem.space.names[axis]}, and each would be described at least twice as well: the "
        "values lie between them and describe none; fit them apart"
    ]


def _doubts(
    problem: Problem,
    uncertainty: Uncertainty,
    values: NDArray[np.float64],
    left: Sequence[float],
    minima: Sequence[tuple[NDArray[np.float64], float]],
) -> list[str]:
    space, doubts = uncertainty.space, []
    for name, bijection, value in zip(space.names, space.bijections, values, strict=True):
        bound = bijection.bound_at(float(value))
        if bound is not None:
            doubts.append(
                f"{name} = {value:.6g} ends at its bound {bound:g}: it has no error, and the "
                "errors of the others take it as fixed"
            )
    rows = problem.experiment.weight.size
    if problem.experiment.noisy and uncertainty.scatter > WRONG_MODEL:
        doubts.append(
            f"the model leaves {uncertainty.scatter:.2g} times the measured noise "
            "unexplained: it is wrong in some way, and the errors include what it leaves"
        )
    if uncertainty.independent < rows and max(left) > WORTH_SAYING:
        doubts.append(
            f"what the model leaves is correlated along the curve: the errors count {rows} points "
            f"as {uncertainty.independent:.2g} independent ones"
        )
    costs = [cost for _, cost in minima]
    others = [cost for cost in costs if cost > 1.01 * costs[0]]
    if others:
        doubts.append(
            f"{len(others)} of {len(costs)} starts ended in worse minima (cost {others[0]:.4g} or "
            f"more, against {costs[0]:.4g}): the problem has several minima"
        )
    return doubts + uncertainty.limitations()


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
