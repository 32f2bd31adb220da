"""Result of a fit: values with their uncertainty, misfits, and doubts."""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError, Status
from jbeamshell.common.files import as_json, csv_text
from jbeamshell.common.frames import frame
from jbeamshell.common.summary import Summary
from jbeamshell.identify.doubts import undescribed
from jbeamshell.identify.models import as_model
from jbeamshell.identify.posterior import Posterior, posterior
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.profile_likelihood import MAX_ITERATIONS, TOLERANCE, Profile, profile
from jbeamshell.identify.runs import Evaluation
from jbeamshell.identify.uncertainty import LEVELS, Uncertainty, model_misfit
from jbeamshell.laws import Law
from jbeamshell.measured.form import LOOP, by_form

SMALL = 0.1  # standard errors over which a response is differentiated


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """Result of a fit; print it, or draw it by `plot`.

    Attributes
    ----------
    problem : least-squares problem
    uncertainty : what the data do not determine, for other levels and noise
    scenes : scene, law or `Assembly` of every specimen by its label, with the fitted values
    status : `jbeamshell.Status` of the best search
    model_runs : number of model runs through all measurements, derivatives included
    minima : values and cost at the end of each search, the best first
    doubts : sentences on what to know before using the values
    notes : sentences on what was done to the data, and what was estimated and chosen by default
    """

    problem: Problem
    uncertainty: Uncertainty
    scenes: Mapping[str, Any]
    status: Status
    model_runs: int
    minima: Sequence[tuple[dict[str, float], float]]
    doubts: Sequence[str] = ()
    notes: Sequence[str] = ()

    @property
    def scene(self) -> Any:
        """Fitted scene, ready to run, or law, or `Assembly`; of several specimens the first."""
        return next(iter(self.scenes.values()))

    @cached_property
    def values(self) -> dict[str, float]:
        """Fitted value by key, or by "key[specimen]" where every specimen has its own."""
        space = self.problem.space
        return space.named(space.values(self.uncertainty.point))

    @cached_property
    def errors(self) -> dict[str, float]:
        """Standard error (one sigma) of every value.

        It counts what the model leaves as so many independent points as its correlation along the
        curves allows.
        """
        return self.uncertainty.space.named(self.uncertainty.errors)

    @property
    def correlation(self) -> NDArray[np.float64]:
        """Correlation (n, n) of the fitted values, in the order of ``values``."""
        return self.uncertainty.correlation

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % confidence interval of every value."""
        return self.intervals_at()

    @property
    def labels(self) -> Sequence[str]:
        """Labels of the measurements, no two alike."""
        return self.problem.labels

    @property
    def data(self) -> list[Any]:
        """Fitted measurements, loops thinned."""
        return self.problem.measurements

    @cached_property
    def model(self) -> list[Any]:
        """Measurements as the model answers them."""
        return self.problem.as_measurements(self._best.prediction)

    @property
    def controls(self) -> list[str]:
        """Column that drives the model, for every measurement."""
        return self.problem.controls()

    @property
    def misfit(self) -> float:
        """Root mean square of the residual over the range of the response."""
        return float(np.sqrt(np.mean(np.concatenate(self._relative) ** 2)))

    @property
    def misfits(self) -> list[float]:
        """The same for every measurement."""
        return [float(np.sqrt(np.mean(own**2))) for own in self._relative]

    @cached_property
    def left(self) -> list[float]:
        """Misfits without the part that is white noise: what the model does not describe."""
        return [model_misfit(own) for own in self._relative]

    @property
    def describes(self) -> bool:
        """False if values mean little: the model leaves too much of a measurement.

        Or it misses the energy per cycle or the secant stiffness of a loop.
        """
        return not undescribed(self.problem, self.left, self._best.prediction)

    @cached_property
    def _best(self) -> Evaluation:
        return self.problem(self.uncertainty.point)

    @property
    def _relative(self) -> list[NDArray[np.float64]]:
        """Residuals of every measurement over its range."""
        problem = self.problem
        plain = self._best.residual[: problem.weight.size] / problem.emphasis * problem.relative
        return [plain[own] for own in problem.slices]

    @property
    def converged(self) -> bool:
        """True if the best search converged."""
        return self.status == Status.CONVERGED

    @property
    def law(self) -> Law:
        """Fitted law of a joint, of several specimens the first; raises for others."""
        require("law", "none", isinstance(self.scene, Law), "read scene instead")
        law: Law = self.scene
        return law

    @property
    def noises(self) -> dict[str, float]:
        """Noise of a sample of force and displacement over their ranges, by what the data tell.

        It is empty where no driving column is noisy, which then counts as exact.
        """
        loops = [d for d in self.data if getattr(d, "drive_noise", None) is not None]
        parts: dict[str, list[float]] = {name: [] for name in LOOP.answers if loops}
        for loop in loops:
            for name, own in parts.items():
                noise = loop.drive_noise if name == loop.driver else loop.noise
                own.append(noise / float(np.ptp(getattr(loop, name))))
        return {name: float(np.sqrt(np.mean(np.square(own)))) for name, own in parts.items()}

    @property
    def _summary(self) -> Summary:
        rows = [(k, f"{value:.6g} +- {self.errors[k]:.2g}") for k, value in self.values.items()]
        misfit = f"misfit {100 * self.misfit:.3g} % of the range"
        end = f"{_word(self.status)} after {self.model_runs} model runs"
        both = " and ".join(f"{100 * part:.2g} % of the {n}" for n, part in self.noises.items())
        told = [f"noise of a sample, which both count: {both}"] if both else []
        return Summary("", rows, [misfit, *told, end, *self.doubts, *self.notes])

    def __repr__(self) -> str:
        return self._summary.as_text(28)

    def _repr_html_(self) -> str:
        from jbeamshell import plotting

        return self._summary.as_html(plotting.thumbnail(self.plot()))

    def figures(self) -> dict[str, Any]:
        """Result as plain numbers for JSON; an infinite end is None."""
        values: dict[str, dict[str, Any]] = {
            key: {"value": value, "error": _finite(self.errors[key])}
            for key, value in self.values.items()
        }
        for level in LEVELS:
            for key, ends in self.intervals_at(level).items():
                values[key][f"interval_{100 * level:.0f}"] = [_finite(end) for end in ends]
        u = self.uncertainty
        return {
            "values": values,
            "correlation": self.correlation.tolist(),
            "misfit": self.misfit,
            "misfits": dict(zip(self.labels, self.misfits, strict=True)),
            "describes": self.describes,
            "status": _word(self.status),
            "model_runs": self.model_runs,
            "doubts": list(self.doubts),
            "notes": list(self.notes),
            "noise": {"of_the_range": u.noise, "measured": u.freedom is None} | self.noises,
            "independent_points": u.independent,
            "left_by_the_model": dict(zip(self.labels, self.left, strict=True)),
            "fisher": [
                {"eigenvalue": value, "direction": u.space.named(vector)}
                for value, vector in u.directions()
            ],
            "minima": [{"values": values, "cost": cost} for values, cost in self.minima],
        }

    def to_dataframe(self) -> Any:
        """Fitted numbers as a `pandas.DataFrame`: value, standard error and 95 % interval.

        Examples
        --------
        ::

            fit.to_dataframe().loc["contact.friction", "value"]
        """
        low, high = zip(*self.intervals.values(), strict=True)
        columns = {
            "value": self.values.values(),
            "error": self.errors.values(),
            "low": low,
            "high": high,
        }
        return frame(columns, self.values, "parameter")

    def intervals_at(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Confidence interval of every value at a level between 0 and 1."""
        ends = self.uncertainty.intervals(level).tolist()
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
        best, problem, u = self._best, self.problem, self.uncertainty
        per_noise = 1.0 / problem.weight
        jacobian = best.jacobian[: per_noise.size] * (per_noise / problem.emphasis)[:, None]
        if self.noises:  # residuals are distances then, not differences of the response
            steps = SMALL * np.diag(np.sqrt(np.diag(u.covariance)))
            ends = [[problem(u.point + s * d).prediction for s in (-1.0, 1.0)] for d in steps]
            rises = [
                (high - low) / (2.0 * np.sum(d)) if np.any(d) else np.zeros(per_noise.size)
                for (low, high), d in zip(ends, steps, strict=True)
            ]
            jacobian = np.transpose(rises)
        variance = np.maximum(np.einsum("ri,ij,rj->r", jacobian, u.covariance, jacobian), 0.0)
        variance += (u.scatter * per_noise) ** 2 * noise
        width = u.quantile(level) * np.sqrt(variance)
        sides = (best.prediction + side * width for side in (-1.0, 1.0))
        return list(zip(*map(problem.as_measurements, sides), strict=True))

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
        return profile(self.problem, self.uncertainty, name, level, max_iterations, tolerance)

    def posterior(self) -> Posterior:
        """Posterior density of the parameters, for samplers of other libraries.

        Returns
        -------
        Posterior
            ``logdensity`` of points of the search space, ``start`` and ``covariance`` there,
            ``constrain`` and ``unconstrain``, ``loglikelihood`` of values

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
        return posterior(self.problem, self.uncertainty)

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

    def save(
        self,
        folder: str | os.PathLike[str],
        profiles: Sequence[Profile] = (),
        figures: Mapping[str, Any] | None = None,
    ) -> list[Path]:
        """Write tables, fitted scenes, figures and pictures into a folder.

        The files are a table for each form of measurement, such as overlay.csv of loops and
        backbones or dissipation.csv; scene.toml, law.toml for a law, or scene_1.toml and so on for
        several specimens; result.json, overlay.png and residuals.png. With profiles there are
        profiles.csv and profiles.png too.

        Parameters
        ----------
        folder : folder to write to; it is made if it is not there
        profiles : profile likelihoods
        figures : content of result.json; None takes `figures`

        Returns
        -------
        list of Path
            paths of the files

        Raises
        ------
        InputError
            if the folder cannot be made, or a file cannot be written
        """
        from jbeamshell import plotting
        from jbeamshell.plotting.folder import write_folder

        texts = self._tables()
        for number, scene in enumerate(self.scenes.values(), 1):
            kind = "law" if isinstance(scene, Law) else "scene"
            name = f"{kind}.toml" if len(self.scenes) == 1 else f"{kind}_{number}.toml"
            with contextlib.suppress(InputError):
                if text := as_model(scene).as_toml():
                    texts[name] = text
        texts["result.json"] = as_json(self.figures() if figures is None else figures)
        drawn = {"overlay": plotting.overlay(self), "residuals": plotting.residuals(self)}
        if profiles:
            rows = [
                (profile.name, *pair)
                for profile in profiles
                for pair in zip(profile.values.tolist(), profile.rises.tolist(), strict=True)
            ]
            texts["profiles.csv"] = csv_text(("parameter", "value", "rise"), rows)
            drawn["profiles"] = plotting.likelihoods(profiles)
        pictures = {f"{name}.png": axes[0].figure for name, axes in drawn.items()}
        return write_folder(Path(folder), texts, pictures)

    def _tables(self) -> dict[str, str]:
        """CSV texts, one for each form: labels, measured columns, answers of the model."""
        texts = {}
        for form, places in by_form(self.data):
            rows = [
                (self.data[i].label, *values)
                for i in places
                for values in zip(
                    *(column.tolist() for column in self.data[i].columns),
                    *(getattr(self.model[i], name).tolist() for name in form.answers),
                    strict=True,
                )
            ]
            header = (form.heading, *form.columns, *(f"model_{name}" for name in form.answers))
            texts[f"{form.name}.csv"] = csv_text(header, rows)
        return texts


def _word(status: Status) -> str:
    return status.name.lower()


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
