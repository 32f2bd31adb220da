"""Parameters from measurements: least squares on the response, with standard errors."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from jbeamshell.identify.assembly import Assembly
from jbeamshell.identify.multistart import POINTS, FitProgress, Options
from jbeamshell.identify.parameters import Parameter
from jbeamshell.identify.plan import planned
from jbeamshell.identify.results import Fit
from jbeamshell.identify.specimens import Specimen
from jbeamshell.laws import Law
from jbeamshell.measured.form import Measurement
from jbeamshell.measured.recordings import Recording
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.scene import Scene

Datum = Measurement | Recording | Specimen | str | os.PathLike[str]


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
    data : a measurement, a recording or the name of a file, or a list of them, of one kind or
        several; or one `Specimen` or several, which bring their own scenes.  Recordings, and loops
        as they were recorded, are averaged over their cycles and centred where no joint has their
        offset; the result's ``notes`` say so
    scene : scene with start values, and all values that stay fixed; or the values that are known,
        by dotted key, or the name or file of a scene, of which the rest is estimated from the data.
        None is a strip of which nothing is known.  Or a law of a joint in place of the strip: a
        `jbeamshell.laws.Law`, or its name, such as "iwan4", to start it from the data.  Or a
        structure with joints, see `Assembly` and `jointed`, for its frequency and damping over
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
    throw : True to raise if the fit did not converge; if False, read ``status``
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
