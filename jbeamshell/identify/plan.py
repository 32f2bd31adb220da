"""Plan of a fit: what is known, what the data tell of the rest, and what is fitted.

Every fit is a plan first, whether it was asked with arrays, files, a study or the command line, so
that all have the same defaults.  What is not given follows from the data: the column that drives,
starts of unknown numbers, and the numbers to fit.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.common.threads import on_one_core
from jbeamshell.identify.assembly import Assembly
from jbeamshell.identify.choose_free import chosen_free
from jbeamshell.identify.data_checks import counted_once, inspected
from jbeamshell.identify.driving import driven
from jbeamshell.identify.experiment import Experiment
from jbeamshell.identify.models import LawModel, Model, StripModel
from jbeamshell.identify.multistart import DEFAULTS, POINTS, FitProgress, Options, found_by
from jbeamshell.identify.parameters import RIG, Parameter, as_parameters
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.results import Fit
from jbeamshell.identify.rig import with_starts
from jbeamshell.identify.search_space import search_space
from jbeamshell.identify.specimens import Specimen
from jbeamshell.identify.starts import Estimate, check_starts, doubt_of_strain, estimate, started
from jbeamshell.laws import LAWS, Law, law_named
from jbeamshell.measured.curves import AmplitudeCurve, Backbone
from jbeamshell.measured.form import Measurement
from jbeamshell.measured.loops import Loop, driver_of
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene import library
from jbeamshell.scene.keys import CONTROLS
from jbeamshell.scene.mounting import in_words
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.toml import overridden, scene_from_values

Datum = Measurement | Specimen | str | os.PathLike[str]

KINDS = (
    "give a jbeamshell.Scene, values by dotted key, the name of a scene, a law such as "
    "jbeamshell.laws.Iwan4(), or its name, such as 'iwan4', or a jbeamshell.identify.Assembly"
)


@dataclasses.dataclass(frozen=True)
class Plan:
    """Fit that is ready to run: all models are whole, and all data as they are compared.

    Attributes
    ----------
    specimens : models with their measurements
    free : parameters to fit
    notes : sentences on what was done to the data, and what was chosen by default
    options : settings of the fit
    doubts : sentences on data that may be wrong
    """

    specimens: Sequence[Specimen]
    free: Sequence[Parameter]
    notes: Sequence[str] = ()
    options: Options = DEFAULTS
    doubts: Sequence[str] = ()

    @on_one_core
    def run(
        self,
        *,
        save: str | os.PathLike[str] | None = None,
        progress: Callable[[FitProgress], None] | None = None,
    ) -> Fit:
        """Run the fit; arguments, result and errors as for `jbeamshell.identify.fit`."""
        return self.found(save, progress)

    def found(
        self,
        save: str | os.PathLike[str] | None = None,
        progress: Callable[[FitProgress], None] | None = None,
    ) -> Fit:
        """Run the fit in a thread of its own."""
        specimens, doubts = counted_once(self.specimens)
        keys = [parameter.key for parameter in self.free]
        doubts = [*self.doubts, *doubts, *inspected(specimens, keys, self.options.unchecked)]
        parameters = with_starts(self.free, specimens)
        space, models = search_space(parameters, {one.label: one.model for one in specimens})
        specimens = [dataclasses.replace(one, scene=models[one.label]) for one in specimens]
        check_starts(specimens, parameters)
        given = self.options
        experiment = Experiment(specimens, points=given.points, noise=given.noise, free=space.keys)
        problem = Problem(experiment, space, given.solver or Newton(), save)
        return found_by(problem, given, list(models), doubts, self.notes, progress)


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
    points: int = POINTS,
    max_iterations: int | None = None,
    tolerance: float = 1e-7,
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
    max_iterations : largest number of iterations of each search; None is 40, for laws 200, after
        which many starts are tried together
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
    whole: list[Specimen] = []
    notes: list[str] = []
    doubts: list[str] = []
    for one in _specimens(data, scene, weights):
        done, parameters, said, doubted = _completed(one, parameters, folder, options.unchecked)
        whole.append(done)
        notes += said
        doubts += doubted
    return Plan(whole, parameters, notes, options, doubts)


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


Free = tuple[Parameter, ...]


def _completed(
    one: Specimen, free: Free, folder: Path, unchecked: bool
) -> tuple[Specimen, Free, list[str], list[str]]:
    """Specimen with a whole model and data as they are compared, what to fit, notes and doubts."""
    meant, of_model = _meant(one.scene, folder), one.of_model
    known = one.known(folder)
    if isinstance(meant, Mapping):
        meant = overridden(overridden(meant, known.values), of_model)
        control = meant.get("load.control")
    elif isinstance(meant, Model):
        of_strip = known.values if isinstance(meant, StripModel) else {}
        meant = meant.replace(overridden(of_strip, of_model))
        control = meant.control
    else:
        control = of_model.pop("load.control", None)
    driver = None if getattr(meant, "by_force", True) else "displacement"
    driver = control if control in CONTROLS else driver
    read = one.read(folder, driver, [parameter.key for parameter in free], unchecked)
    data = [item for item, _ in read]
    notes = [f"{item.label}: {note}" for item, said in read for note in said]
    notes += known.notes
    model: Model
    said: list[str]
    doubts: list[str] = []
    if isinstance(meant, Mapping):
        model, free, said = _strip(meant, data, free)
        doubts = doubt_of_strain(meant, model.own, estimate(data))
    elif isinstance(meant, Model):
        model, said = meant, []
        if isinstance(meant, StripModel) and not free:
            free, note = _chosen(meant.scene, {}, data, estimate(data))
            said = [note]
        if not free:
            raise InputError("free: name what to fit of the structure, by its keys")
    else:
        model, free, said = _law(meant, of_model, control, data, free)
    require(
        "load.control",
        model.control,
        model.control in CONTROLS,
        "does not drive a measurement: take " + " or ".join(map(repr, CONTROLS)),
    )
    notes += [f"{one.label}: {note}" if one.label else note for note in said]
    whole = model.own if isinstance(model, StripModel) else model
    return dataclasses.replace(one, scene=whole, data=data, set=one.rig), free, notes, doubts


def _meant(scene: Any, folder: Path) -> Any:
    """Model, law or its class, or known values of a strip, that a user means."""
    if scene is None:
        return {}
    if isinstance(scene, str):
        if scene in LAWS or scene.startswith("sliders"):
            return law_named(scene)
        of_file = scene.endswith(".toml") or os.path.isfile(folder / scene)
        fix = f"choose a law ({', '.join(LAWS)}), a scene ({', '.join(library.NAMES)}), or a file"
        require("scene", scene, of_file or scene in library.NAMES, fix)
        return library.values_from(scene, folder)
    require("scene", scene, isinstance(scene, Scene | Model | Law | Mapping), KINDS)
    return StripModel(scene) if isinstance(scene, Scene) else scene


def _strip(
    known: Mapping[str, Any], data: Sequence[Measurement], free: Free
) -> tuple[StripModel, Free, list[str]]:
    """Strip of known values, of which the data tell the rest; see `chosen_free` and `started`."""
    own, notes = dict(known), []
    loops = [item for item in data if isinstance(item, Loop)]
    if "load.control" not in own and loops:
        driver = own["load.control"] = driver_of(loops)
        notes.append(f"the {driver} drives these loops (set load.control to change it)")
        if driver != "force":
            own.pop("load.amplitude", None)
    control = own.get("load.control", "force")
    found = estimate(data) if control in CONTROLS else None
    if not free:
        free, note = _chosen(None, own, data, found)
        notes.append(note)
    if "load.entry" not in own:
        notes.append("the force enters a member that goes on (set load.entry to change it)")
    if found is not None:
        given = {p.key: p.start for p in free if p.start is not None and p.key not in RIG}
        own, fresh = started(overridden(own, given), found)
        notes += fresh
    if "load.amplitude" not in own and control in CONTROLS:
        drives = [
            item.amplitude if isinstance(item, AmplitudeCurve) else getattr(item, control, None)
            for item in data
        ]
        largest = [float(np.max(np.abs(drive))) for drive in drives if drive is not None]
        if largest:
            own["load.amplitude"] = max(largest)
    scene = scene_from_values(own)
    mounting = in_words(scene, [parameter.key for parameter in free])
    return StripModel(scene), free, [*notes, *filter(None, [mounting])]


def _chosen(
    scene: Scene | None,
    known: Mapping[str, Any],
    data: Sequence[Measurement],
    found: Estimate | None,
) -> tuple[Free, str]:
    """Parameters that the data tell of a whole scene or of known values, and why."""
    reasons = chosen_free(scene, known, data, found)
    told = "; ".join(f"{key} ({reason})" for key, reason in reasons.items())
    note = f"Fitted: {told}; choose with free= (--free on the command line)"
    return as_parameters(list(reasons)), note


def _law(
    meant: Any,
    known: Mapping[str, Any],
    control: str | None,
    data: Sequence[Measurement],
    free: Free,
) -> tuple[LawModel, Free, list[str]]:
    """Law of a joint with known numbers, which starts from the data where it was only named."""
    model = driven(meant, data, control)
    given = {p.key: p.start for p in free if p.start is not None and p.key not in RIG}
    model = model.replace({**known, **given})
    notes = [f"{model.law.heading} in place of a strip, driven by the {model.control}"]
    if not free:
        left = [key for key in model.law.free() if key not in known]
        told = _told(model.law, data, left)
        free = as_parameters(told)
        notes += [
            f"{key} stays as it is: a first loading tells nothing of it"
            for key in left
            if key not in told
        ]
    return model, free, notes


def _told(law: Law, data: Sequence[Measurement], keys: Sequence[str]) -> list[str]:
    """Those of a law's keys that the data tell: first loadings tell nothing of unloading."""
    if not all(isinstance(item, Backbone) for item in data):
        return list(keys)
    way = np.concatenate([item.displacement for item in data if isinstance(item, Backbone)])
    numbers = {key: law.get(key) for key in keys}
    slopes = jax.jacfwd(lambda values: law.replace(values).backbone(way))(numbers)
    return [key for key in keys if np.any(np.asarray(slopes[key]) != 0.0)]
