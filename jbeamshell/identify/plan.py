"""The way of a fit, from what a user says to its result.

`fit` takes arrays, the names of files and `Specimen`; a study and the command line come by
`jbeamshell.identify.plan_file`.  All of them go this way, and have the defaults of `Options`:

1. `planned` makes a `Case` of each `Specimen`: its data as they are compared, and a whole model, of
   which the data tell what nobody said (`jbeamshell.identify.said`).
2. `Plan.run` checks the data, and makes the `SearchSpace`: one coordinate without bounds for each
   number to be found.
3. `Problem` is residual and Jacobian at a point of that space, and `search` goes to their minimum.
4. `Fit` has values, errors, doubts and notes.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from jbeamshell.common.checks import require, require_choice, require_count
from jbeamshell.common.errors import InputError, Status, UnconvergedError
from jbeamshell.common.progress import bar
from jbeamshell.common.threads import on_one_core
from jbeamshell.identify.assembly import Assembly
from jbeamshell.identify.data_checks import counted_once, inspected
from jbeamshell.identify.doubts import doubts_of
from jbeamshell.identify.models import LawModel
from jbeamshell.identify.parameters import Parameter, as_parameters, is_number
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.results import Fit
from jbeamshell.identify.rig import with_starts
from jbeamshell.identify.said import said
from jbeamshell.identify.search import FitProgress, SearchResult, search
from jbeamshell.identify.search_space import search_space
from jbeamshell.identify.specimens import Case, Specimen
from jbeamshell.identify.starts import check_starts
from jbeamshell.identify.uncertainty import uncertainty_at
from jbeamshell.laws import Law
from jbeamshell.measured.form import FEWEST_POINTS, Measurement
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.keys import CONTROLS
from jbeamshell.scene.scene import Scene

Datum = Measurement | Specimen | str | os.PathLike[str]
Progress = Callable[[FitProgress], None]

MAX_ITERATIONS = 100
LAW_ITERATIONS = 200  # laws cost little, and creep to their limits
STARTS, LAW_STARTS = 3, 6  # searches if all parameters have two bounds, and of laws


@dataclasses.dataclass(frozen=True)
class Options:
    """Settings of a fit and their defaults; see `jbeamshell.identify.fit` for what they mean.

    Raises
    ------
    InputError
        for a value that makes no sense
    """

    starts: int | None = None
    noise: float | None = None
    points: int = 96
    max_iterations: int | None = None
    tolerance: float = 1e-7
    unchecked: bool = False
    throw: bool = True
    solver: Newton | None = None

    def __post_init__(self) -> None:
        require_count("starts", 1 if self.starts is None else self.starts, 1)
        require_count("points", self.points, FEWEST_POINTS)
        most = 1 if self.max_iterations is None else self.max_iterations
        require_count("max_iterations", most, 1)
        noise = 1.0 if self.noise is None else self.noise
        fix = "give a positive part of the range, such as 0.01"
        require("noise", noise, is_number(noise) and noise > 0.0, fix)
        positive = is_number(self.tolerance) and self.tolerance > 0.0
        require("tolerance", self.tolerance, positive, "give a positive number, such as 1e-7")
        valid = self.solver is None or isinstance(self.solver, Newton)
        require("solver", self.solver, valid, "give a jbeamshell.Newton")
        for name in ("unchecked", "throw"):
            require_choice(name, getattr(self, name), (False, True))

    def of(self, problem: Problem) -> tuple[int, int]:
        """Number of searches of a problem, and of iterations of each."""
        of_law = isinstance(problem.models[0], LawModel)
        bounded = all(parameter.bounded for parameter in problem.space.parameters)
        starts = LAW_STARTS if of_law else STARTS if bounded else 1
        most = LAW_ITERATIONS if of_law else MAX_ITERATIONS
        return self.starts or starts, self.max_iterations or most


DEFAULTS = Options()


@dataclasses.dataclass(frozen=True)
class Plan:
    """Fit that is ready to run.

    Attributes
    ----------
    cases : whole models, and measurements as they are compared
    free : parameters to fit
    notes : sentences on what was done to the data, and what was chosen by default
    options : settings of the fit
    doubts : sentences on data that may be wrong
    """

    cases: Sequence[Case]
    free: Sequence[Parameter]
    notes: Sequence[str] = ()
    options: Options = DEFAULTS
    doubts: Sequence[str] = ()

    @on_one_core
    def run(
        self, *, save: str | os.PathLike[str] | None = None, progress: Progress | None = None
    ) -> Fit:
        """Run the fit; arguments, result and errors as for `jbeamshell.identify.fit`."""
        return self.found(save, progress)

    def found(
        self, save: str | os.PathLike[str] | None = None, progress: Progress | None = None
    ) -> Fit:
        """Run the fit in a thread of its own."""
        given, (cases, copies) = self.options, counted_once(self.cases)
        found = inspected(cases, [parameter.key for parameter in self.free], given.unchecked)
        doubts = [*self.doubts, *copies, *found]
        space, cases = search_space(with_starts(self.free, cases), cases)
        check_starts(cases, space.keys)
        problem = Problem(
            cases, space, points=given.points, noise=given.noise, solver=given.solver, save=save
        )
        try:
            ends = self._searched(problem, progress)
        except UnconvergedError as error:
            told = "".join(f"; {sentence}" for sentence in (*doubts, *self.notes))
            raise UnconvergedError(f"{error}{told}") from None
        return _fit_at(problem, ends, [case.label for case in cases], doubts, self.notes)

    def _searched(self, problem: Problem, progress: Progress | None) -> list[SearchResult]:
        """Ends of the searches; progress is shown where a person watches."""
        starts, most = self.options.of(problem)
        try:
            watched: Any = bar("fit") if progress is None else contextlib.nullcontext()
            with watched as shown:

                def show(now: FitProgress) -> None:
                    shown.set_postfix_str(str(now))
                    shown.update()

                ends = search(problem, starts, most, self.options.tolerance, progress or show)
        except KeyboardInterrupt:
            kept = (
                "nothing was saved: give save= (--save on the command line), a file, to continue "
                "later"
            )
            if place := problem.saved_in:
                kept = f"all are in {place}: fit again with the same arguments to continue"
            done = f"interrupted after {problem.count} model runs"
            raise KeyboardInterrupt(f"{done}; {kept}") from None
        if self.options.throw and not ends[0].converged:
            named = problem.space.named(problem.space.values(ends[0].point))
            at = ", ".join(f"{name} = {value:.6g}" for name, value in named.items())
            raise UnconvergedError(
                f"the fit has not converged after {most} iterations, at {at}, cost "
                f"{problem(ends[0].point).cost:.4g}: start closer, free fewer parameters, or raise "
                "max_iterations"
            )
        return ends


def _fit_at(
    problem: Problem,
    ends: Sequence[SearchResult],
    labels: Sequence[str],
    doubts: Sequence[str],
    notes: Sequence[str],
) -> Fit:
    """Fit at the best end of the searches."""
    space, (point, converged) = problem.space, ends[0]
    values, uncertainty = space.values(point), uncertainty_at(problem, point)
    models = [
        model.replace(space.of(values, owner)).fitted(problem.of(owner))
        for owner, model in enumerate(problem.models)
    ]
    minima = [(space.named(space.values(end.point)), problem(end.point).cost) for end in ends]
    fit = Fit(
        problem,
        uncertainty,
        {label: model.own for label, model in zip(labels, models, strict=True)},
        Status.CONVERGED if converged else Status.MAX_ITERATIONS,
        problem.count,
        minima,
        notes=notes,
    )
    own = doubts_of(problem, uncertainty, models, fit.left, [cost for _, cost in minima])
    return dataclasses.replace(fit, doubts=[*own, *doubts])


def fit(
    data: Datum | Sequence[Datum],
    scene: Scene | Mapping[str, Any] | Law | Assembly | str | None = None,
    free: Sequence[str | Parameter] = (),
    *,
    weights: Sequence[float] = (),
    starts: int | None = None,
    noise: float | None = None,
    save: str | os.PathLike[str] | None = None,
    solver: Newton | None = None,
    points: int = DEFAULTS.points,
    max_iterations: int | None = None,
    tolerance: float = DEFAULTS.tolerance,
    progress: Callable[[FitProgress], None] | None = None,
    throw: bool = True,
    unchecked: bool = False,
) -> Fit:
    """Fit parameters of a scene to measured or computed curves by least squares.

    A loop or a backbone drives the model by the column that ``scene.load.control`` names, and is
    compared in the other column.  A squeeze curve is compared under the scene's pressures alone.
    Dissipation and stiffness are compared by their logarithms.  If the measurements carry noise, or
    if ``noise`` is given, residuals are divided by it.  Otherwise every measurement counts relative
    to its own range, and the noise is estimated from the residual.

    Parameters
    ----------
    data : a measurement or the name of a file, or a list of them, of one kind or several; or one
        `Specimen` or several, which bring their own scenes.  Loops as they were recorded are
        averaged over their cycles and centred where no joint has their offset; the result's
        ``notes`` say so
    scene : scene with start values, and all values that stay fixed; or the values that are known,
        by dotted key, or the name or file of a scene, of which the rest is estimated from the data.
        None is a strip of which nothing is known.  Or a law of a joint in place of the strip: a
        `jbeamshell.laws.Law`, or its name, such as "iwan4", to start it from the data.  Or a
        structure with joints, see `Assembly`, for its frequency and damping over
        amplitude and its forced responses
    free : what to fit: keys such as "contact.friction" or "structure.damping_ratio", or `Parameter`
        with bounds, scale, prior, and whether every specimen has a value of its own; if empty,
        the numbers that the data tell, with the reasons in ``notes``
    weights : factors of the measurements' residuals, besides the curves' own; all 1 if empty
    starts : number of searches: from the given start, and from the best of four times as many
        points between the bounds (a factor e to either side of a missing bound).  None is 6 for a
        law; for a strip 3 if all parameters have two bounds, else 1
    noise : standard deviation of measurements without noise, over their range
    save : file that keeps every model run; if it exists, the fit continues from it
    solver : settings of Newton's method; None takes the defaults
    points : number of points to which each loop is thinned, approximately
    max_iterations : largest number of iterations of each search; None is 100, for laws 200
    tolerance : relative change of the parameters at which a search stops; a flat cost stops it too
    progress : called after every step with a `FitProgress`; None shows a bar where a person watches
    throw : True to raise if the fit did not converge; if False, read ``converged``
    unchecked : True to fit loops that an inspection refuses too; its findings are then warnings

    Returns
    -------
    Fit
        the fitted scene, values with standard errors and 95 % intervals, misfits, doubts, and notes
        on what was estimated and chosen

    Raises
    ------
    InputError
        if a parameter cannot be fitted, or the data do not depend on it; if an inspection refuses a
        loop, see `jbeamshell.inspect`; if the scene cannot reproduce a measurement, such as a force
        beyond gross slip at the start values; if ``save`` belongs to another fit
    UnconvergedError
        if the search does not converge, or the model finds no equilibrium at the start
    KeyboardInterrupt
        if interrupted, with a message that says what was saved

    Examples
    --------
    ::

        print(jb.fit("rig.csv"))

        loops = jb.measured.read_loops("rig.csv")
        fit = jb.fit(loops, jb.library.standard(), ["contact.friction"])
        fit.values["contact.friction"], fit.errors["contact.friction"]

        law = jb.fit(loops, "iwan4").law  # four parameters in place of the strip
        law.dissipation_at_force(0.5)
    """
    options = Options(starts, noise, points, max_iterations, tolerance, unchecked, throw, solver)
    return planned(data, scene, free, weights, options).run(save=save, progress=progress)


def planned(
    data: Any,
    scene: Any = None,
    free: Sequence[str | Parameter] = (),
    weights: Sequence[float] = (),
    options: Options = DEFAULTS,
    folder: Path = Path(),
) -> Plan:
    """Plan of a fit.

    Parameters
    ----------
    data, scene, free, weights : see `jbeamshell.identify.fit`
    options : settings of the fit
    folder : folder in which files are looked for

    Raises
    ------
    InputError
        if specimens are mixed with measurements or given a scene or weights besides their own, if
        two have one label, or if a model, a parameter or data are wrong
    """
    chosen = not isinstance(free, list | tuple) or len(free) > 0
    parameters = as_parameters(free) if chosen else ()
    cases: list[Case] = []
    notes: list[str] = []
    doubts: list[str] = []
    for one in _specimens(data, scene, weights):
        dimensions = one.known(folder)
        meant = said(one, dimensions.values, folder)
        keys = [parameter.key for parameter in parameters]
        read = one.read(folder, meant.driver, keys, meant.width, options.unchecked)
        taken = [item for item, _ in read]
        model, parameters, chosen_for_it, doubted = meant.completed(taken, parameters)
        fix = "does not drive a measurement: take " + " or ".join(map(repr, CONTROLS))
        require("load.control", model.control, model.control in CONTROLS, fix)
        cases.append(one.case(model, taken))
        notes += [f"{item.label}: {note}" for item, told in read for note in told]
        notes += dimensions.notes
        notes += [f"{one.label}: {note}" if one.label else note for note in chosen_for_it]
        doubts += doubted
    return Plan(cases, parameters, notes, options, doubts)


def _specimens(data: Any, scene: Any, weights: Sequence[float]) -> list[Specimen]:
    """Specimens from what `fit` was given, with labels if there are several."""
    given = list(data) if isinstance(data, list | tuple) else [data]
    of_specimens = [isinstance(item, Specimen) for item in given]
    if not any(of_specimens):
        return [Specimen(scene, data, weights=weights)]
    if not all(of_specimens):
        raise InputError("data: mixes specimens with measurements: make each a Specimen")
    for name, present in {"scene": scene is not None, "weights": len(weights) > 0}.items():
        if present:
            raise InputError(f"{name}: the specimens bring their own; leave it out")
    if len(given) == 1:
        return given
    labels = [one.label or f"{number}" for number, one in enumerate(given, 1)]
    repeated = [label for label in labels if labels.count(label) > 1]
    if repeated:
        raise InputError(f"specimens: two have the label {repeated[0]!r}: give each its own")
    pairs = zip(given, labels, strict=True)
    return [dataclasses.replace(one, label=label) for one, label in pairs]
