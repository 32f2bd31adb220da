"""Comparison of laws of a joint on one target: what each loses, and what it costs."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError, UnconvergedError
from jbeamshell.identify.models import LawModel, Model, as_model
from jbeamshell.identify.observations import Observation, observe
from jbeamshell.identify.plan import Datum, Options, planned
from jbeamshell.identify.results import Fit
from jbeamshell.identify.specimens import Specimen
from jbeamshell.laws import Law, law_named
from jbeamshell.measured.curves import AmplitudeCurve, DissipationCurve, StiffnessCurve
from jbeamshell.measured.form import Measurement
from jbeamshell.measured.loops import Loop
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.solve import run

MODELS = ("iwan4", "bouc-wen", "jenkins", "sliders4")
LEVELS = np.geomspace(0.1, 1.0, 12)  # amplitudes of a strip's cycles, over its own
REPEATS = 5  # runs of which the fastest counts

Floats = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Compared:
    """One model of a comparison.

    Attributes
    ----------
    name : name of the model
    fit : its fit; None for the strip itself, or where there is none
    energy : (n,) energy per cycle at the target's amplitudes
    misfit : root mean square of the residual over the range, or of the logarithm
    seconds : one response to all data, compiled
    told : why there is no fit, or what to doubt in it; empty if nothing
    """

    name: str
    fit: Fit | None
    energy: Floats
    misfit: float
    seconds: float
    told: str = ""

    @property
    def numbers(self) -> int:
        """Count of fitted numbers."""
        return 0 if self.fit is None else len(self.fit.values)

    @property
    def points(self) -> int:
        """Count of fitted points; 0 without a fit."""
        return sum(rows.size for rows in self.fit.residuals) if self.fit is not None else 0


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Models fitted to one target; print it, or draw it by `plot`.

    Attributes
    ----------
    amplitude : (n,) amplitudes of the target's steady cycles
    energy : (n,) their energies per cycle; a model's are those of the same cycles, of a strip at
        the displacements that it reaches
    drive : column of the amplitudes, "force" or "displacement"
    rows : the models, in the order given; first the strip itself, if it is the target
    """

    amplitude: Floats
    energy: Floats
    drive: str
    rows: tuple[Compared, ...]

    @property
    def chosen(self) -> Compared | None:
        """Model that the data speak for; None if no fitted one describes them.

        It has the least Bayesian information criterion, n log(cost/n) + k log n of k numbers and n
        points (Schwarz, Ann. Stat. 6, 1978), of the models that answer the most points.
        """
        rows = [row for row in self.rows if row.fit is not None and row.fit.describes]
        most = max((row.points for row in rows), default=0)
        return min((row for row in rows if row.points == most), key=_criterion, default=None)

    def error(self, row: Compared) -> Floats:
        """Relative error (n,) of a model's energies."""
        return np.asarray(row.energy / self.energy - 1.0)

    def __repr__(self) -> str:
        head = f"  {'model':12s} numbers  misfit  error of D: median  worst     time"
        lines = [head]
        for row in self.rows:
            error = np.abs(self.error(row))
            known = np.isfinite(error)
            without = f"no energy at {np.sum(~known)} of {known.size} amplitudes"
            told = "; ".join(filter(None, (row.told, "" if np.all(known) else without)))
            if not np.any(known):
                lines.append(f"  {row.name:12s} {row.told or without}")
                continue
            error = error[known]
            figures = f"{100 * row.misfit:5.2g} %  {100 * np.median(error):16.2g} %"
            worst = f"{100 * np.max(error):5.3g} %  {1e6 * row.seconds:6.0f} us"
            note = f"  ({told})" if told else ""
            lines.append(f"  {row.name:12s} {row.numbers:7d}  {figures}  {worst}{note}")
        if (chosen := self.chosen) is not None:
            lines.append(f"  the data speak for {chosen.name} (Bayesian information criterion)")
        elif any(isinstance(row.fit, Fit) for row in self.rows):
            lines.append("  no model describes these data")
        return "\n".join(lines)

    def figures(self) -> dict[str, Any]:
        """Comparison as plain numbers for JSON; a model without a fit has None."""
        return {
            "drive": self.drive,
            "amplitude": self.amplitude.tolist(),
            "energy": self.energy.tolist(),
            "chosen": None if self.chosen is None else self.chosen.name,
            "models": {
                row.name: {
                    "values": {} if row.fit is None else row.fit.values,
                    "energy": [float(e) if np.isfinite(e) else None for e in row.energy],
                    "misfit": row.misfit if np.isfinite(row.misfit) else None,
                    "seconds": row.seconds if np.isfinite(row.seconds) else None,
                    "told": row.told,
                }
                for row in self.rows
            },
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw energy over amplitude, and its error; returns the two axes."""
        from jbeamshell import plotting

        return plotting.comparison(self, axes)


def compare(
    target: Datum | Sequence[Datum] | Scene,
    models: Sequence[str | Law] = MODELS,
    *,
    amplitudes: ArrayLike | None = None,
    **options: Any,
) -> Comparison:
    """Fit several laws of a joint to one target, and tell what each loses.

    Parameters
    ----------
    target : measured loops or the names of their files, or curves with a dissipation among them;
        or a strip, whose steady cycles under forces give its dissipation and secant stiffness over
        the displacement
    models : names of laws, see `jbeamshell.laws.law_named`, or laws as starts
    amplitudes : (n,) force amplitudes of a strip's cycles, below gross slip; None spreads twelve up
        to that of the scene
    options : further arguments of `fit`, such as ``noise``

    Returns
    -------
    Comparison
        misfit, dissipation over amplitude and time of each model.  A model that cannot be fitted
        stays in the table with the reason.

    Raises
    ------
    InputError
        for no model, or a target without steady cycles

    Examples
    --------
    >>> print(jb.identify.compare(jb.Scene(), ["iwan4", "jenkins"]))
    """
    several = isinstance(models, list | tuple) and len(models) > 0
    require("models", models, several, "give a list of names or laws, such as ['iwan4']")
    if isinstance(target, Scene):
        return _with_strip(target, models, amplitudes, options)
    require("amplitudes", amplitudes, amplitudes is None, "are the target's own: leave them out")
    specimen = Specimen(None, target)
    # Any law has a force for a displacement, so that all answer with the same column.
    over = any(isinstance(item, DissipationCurve) for item in specimen.measurements)
    drive = "force" if over else "displacement"
    data = [item for item, _ in specimen.read(Path(), drive)]
    amplitude, energy = _energies(data)
    rows = [_fitted(model, data, amplitude, drive, options) for model in models]
    return Comparison(amplitude, energy, drive, tuple(rows))


def _with_strip(
    scene: Scene,
    models: Sequence[str | Law],
    amplitudes: ArrayLike | None,
    options: dict[str, Any],
) -> Comparison:
    """Comparison on a strip, with the strip itself in the first row."""
    require("load.control", scene.load.control, scene.load.control == "force", "must be 'force'")
    given = LEVELS * float(scene.get("load.amplitude")) if amplitudes is None else amplitudes
    amplitude = np.atleast_1d(np.asarray(given, dtype=float))
    cycles = [
        run(scene.replace({"load.amplitude": size, "load.cycles": max(scene.load.cycles, 1)}))
        for size in amplitude.tolist()
    ]
    energy = np.array([float(history.dissipation) for history in cycles])
    stiffness = np.array([float(history.secant_stiffness) for history in cycles])
    own = Compared(
        "strip", None, energy, 0.0, _seconds([DissipationCurve(amplitude, energy)], scene)
    )
    reached = amplitude / stiffness
    data = [DissipationCurve(reached, energy), StiffnessCurve(reached, stiffness)]
    rows = [_fitted(model, data, reached, "displacement", options) for model in models]
    return Comparison(amplitude, energy, "force", (own, *rows))


def _criterion(row: Compared) -> float:
    """Bayesian information criterion of a fitted model, whose noise is estimated."""
    assert row.fit is not None
    size = sum(float(own @ own) for own in row.fit.residuals) / row.points
    least = np.finfo(float).eps ** 2  # a model fitted to its own data leaves rounding alone
    return float(row.points * np.log(max(size, least)) + row.numbers * np.log(row.points))


def _energies(data: Sequence[Measurement]) -> tuple[Floats, Floats]:
    """Amplitudes and energies of a target's steady cycles."""
    curves = [item for item in data if isinstance(item, DissipationCurve)]
    loops = [item for item in data if isinstance(item, Loop) and item.closed]
    if curves:
        columns = ([getattr(c, name) for c in curves] for name in ("amplitude", "dissipation"))
        amplitude, energy = map(np.concatenate, columns)
        return amplitude, energy
    if not loops:
        raise InputError("target: give closed loops, or a curve of dissipation over amplitude")
    sizes = np.array([0.5 * np.ptp(loop.displacement) for loop in loops])
    order = np.argsort(sizes)
    return sizes[order], np.array([loop.work for loop in loops])[order]


def _fitted(
    model: str | Law,
    data: Sequence[Measurement],
    amplitude: Floats,
    drive: str,
    options: dict[str, Any],
) -> Compared:
    """One model, fitted to the data that it can answer."""
    name = model if isinstance(model, str) else model.heading
    nothing = np.full(amplitude.shape, np.nan)
    try:
        if isinstance(model, str):
            law_named(model)  # raises for the name of anything else
        over = any(isinstance(item, AmplitudeCurve) for item in data)  # of a column they do not say
        specimen = Specimen(model, data, set={"load.control": drive} if over else {})
        found = planned(specimen, options=Options(**{"throw": False, **options})).run()
    except (InputError, UnconvergedError) as error:
        return Compared(name, None, nothing, np.nan, np.nan, str(error))
    law = found.law
    by_force = law.dissipation_at_force if drive == "force" else law.dissipation
    energy = np.asarray(eqx.filter_jit(by_force)(amplitude))
    told = "" if found.converged else "the search has not converged"
    if not found.describes:
        told = "; ".join(filter(None, (told, "does not describe these data")))
    seconds = _seconds(found.data, LawModel(law, found.controls[0]))
    return Compared(name, found, energy, found.misfit, seconds, told)


def _seconds(data: Sequence[Measurement], model: Any) -> float:
    """Time of one response of a model to all data, compiled, the fastest of some."""
    model = as_model(model)
    observations = [observe(item, model) for item in data]
    jax.block_until_ready(_respond(observations, model))
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        jax.block_until_ready(_respond(observations, model))
        times.append(time.perf_counter() - begin)
    return min(times)


@eqx.filter_jit
def _respond(observations: Sequence[Observation], model: Model) -> list[Any]:
    """Responses of a model to all observations."""
    return [observation.predict(model, Newton())[0] for observation in observations]
