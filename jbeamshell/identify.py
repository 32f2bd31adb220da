"""Parameters from measurements: least squares on the response, with standard errors.

The only file that imports jaxopt.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jaxopt
import numpy as np
from jax import Array
from numpy.typing import NDArray

from jbeamshell.errors import InputError, UnconvergedError
from jbeamshell.loops import Loop
from jbeamshell.newton import Newton
from jbeamshell.observations import Experiment, Observation, SqueezeCurve, observe
from jbeamshell.scene import NUMBERS, Scene, check_key

Measurement = Loop | SqueezeCurve

POINTS = 96  # of a loop that the model is run through
MAX_ITERATIONS = 40
FLAT = 1e-6  # relative gain in cost at which a fit has settled
SIGNED = ("strip.deviation", "strip.curvature")  # all others keep their sign


class Fit(NamedTuple):
    """Result of a fit.

    Attributes
    ----------
    scene : the scene with the fitted values
    values, errors : fitted value and standard error (one sigma) by key; the errors take what the
        model leaves unexplained as independent noise, so a model that is wrong makes them too small
    correlation : (p, p) of the fitted values, in the order of ``values``
    misfit : root mean square of the residual over the range of the response
    misfits : the same for every measurement
    data, model : the measurements fitted, loops thinned, and the model's at the same points
    status : "converged" or "max_iterations"
    model_runs : how often the model was run through all measurements, derivatives included
    """

    scene: Scene
    values: dict[str, float]
    errors: dict[str, float]
    correlation: NDArray[np.float64]
    misfit: float
    misfits: list[float]
    data: list[Any]
    model: list[Any]
    status: str
    model_runs: int

    def __str__(self) -> str:
        lines = [
            f"  {key:28s} {value:.6g} +- {self.errors[key]:.2g}"
            for key, value in self.values.items()
        ]
        lines.append(f"  misfit {100 * self.misfit:.3g} % of the range")
        lines.append(f"  {self.status} after {self.model_runs} model runs")
        return "\n".join(lines)

    def figures(self) -> dict[str, Any]:
        """The result as plain numbers."""
        return {
            "values": {k: {"value": v, "error": self.errors[k]} for k, v in self.values.items()},
            "correlation": self.correlation.tolist(),
            "misfit": self.misfit,
            "misfits": {d.label: m for d, m in zip(self.data, self.misfits, strict=True)},
            "status": self.status,
            "model_runs": self.model_runs,
        }

    def plot(self, axes: Any = None) -> Any:
        """Draw data and model; returns the axes, which are a pair for a mixture: loops first."""
        from jbeamshell import plotting

        def pairs(kind: type) -> list[tuple[Any, Any]]:
            both = zip(self.data, self.model, strict=True)
            return [(d, m) for d, m in both if isinstance(d, kind)]

        loops, curves = pairs(Loop), pairs(SqueezeCurve)
        mixed = bool(loops and curves)
        left, right = ((None, None) if axes is None else axes) if mixed else (axes, axes)
        drawn = []
        if loops:
            data = [(d.force, d.displacement, "data") for d, _ in loops]
            model = [(m.force, m.displacement, f"model, {m.label}") for _, m in loops]
            drawn.append(plotting.overlay(data, model, left))
        if curves:
            data, model = map(list, zip(*curves, strict=True))
            drawn.append(plotting.squeeze_fit(data, model, right))
        return drawn if mixed else drawn[0]


def driver_of(loops: Sequence[Loop]) -> str:
    """Which column drove the test: the smoother one; the force where neither is rough."""

    def roughness(column: NDArray[np.float64]) -> float:
        return float(np.sqrt(np.mean(np.diff(column, 3) ** 2)) / np.ptp(column))

    force = np.mean([roughness(loop.force) for loop in loops])
    displacement = np.mean([roughness(loop.displacement) for loop in loops])
    return "displacement" if displacement < 0.5 * force and force > 1e-3 else "force"


def fit(
    data: Measurement | Sequence[Measurement],
    scene: Scene,
    free: Sequence[str],
    *,
    solver: Newton | None = None,
    points: int = POINTS,
    max_iterations: int = MAX_ITERATIONS,
    tolerance: float = 1e-7,
    progress: Callable[[str], None] | None = None,
    throw: bool = True,
) -> Fit:
    """Least squares of a scene's parameters on measured or computed curves.

    A loop drives the model by the column that ``scene.load.control`` names and is compared in the
    other; a squeeze curve is compared under the scene's pressures alone.  Every measurement counts
    relative to its own range, with its own number of points, and all are of this one scene: what
    differs between them, such as another pressure or height, needs a fit of its own.

    Parameters
    ----------
    data : a `Loop`, a `SqueezeCurve`, or a list of them, mixed or not
    scene : start values, and everything that stays fixed
    free : keys of the parameters to fit, e.g. ("contact.friction", "strip.height_ratio")
    solver : settings of Newton's method
    points : thin each loop to about so many points
    max_iterations : of the Levenberg-Marquardt method
    tolerance : relative change of the parameters at which it stops (a flat cost stops it too)
    progress : called with one line per iteration
    throw : whether an unfinished fit raises; if not, read ``status``

    Raises
    ------
    InputError
        for keys that cannot be fitted, or that the data do not depend on; for measurements that the
        scene cannot answer, such as forces beyond gross slip at the start values
    UnconvergedError
        if the iteration does not settle, or the model finds no equilibrium at the start
    """
    _check_free(scene, free)
    # A Loop is a tuple itself.
    given = [data] if isinstance(data, Loop) or not isinstance(data, Sequence) else data
    if not given:
        raise InputError("data: no measurement given; read loops with read_loops")
    driver = scene.load.control
    whole = [d.thinned(points, driver) if isinstance(d, Loop) else d for d in given]
    observations = [observe(d, scene) for d in whole]
    evaluate = _Evaluation(scene, tuple(free), Experiment(observations), solver or Newton())

    params = jnp.zeros(len(free))
    jacobian = evaluate(params).jacobian
    if not evaluate(params).sound:
        raise UnconvergedError(
            "the model finds no equilibrium at the start values: start closer, or lower "
            "contact.stick_stiffness"
        )
    for key, column in zip(free, jacobian.T, strict=True):
        if not np.any(np.abs(column) > 1e-9):
            raise InputError(f"free {key!r}: the data do not depend on it; leave it out")

    method = jaxopt.LevenbergMarquardt(
        residual_fun=lambda p: jnp.asarray(evaluate(p).residual),
        materialize_jac=True,
        solver="cholesky",
        damping_parameter=1e-3,
        jit=False,
    )
    # Its last release forgets a jac_fun argument when the Jacobian is materialised.
    method._jac_fun = lambda p: jnp.asarray(evaluate(p).jacobian)
    state = method.init_state(params)
    status = "max_iterations"
    for _ in range(max_iterations):
        before = float(state.value)
        params, state = method.update(params, state)
        if progress:
            progress(_line(scene, free, params, state.residual))
        gained = before - float(state.value)  # nothing when the step was refused
        if float(jnp.max(jnp.abs(state.delta))) < tolerance or 0.0 < gained < FLAT * before:
            status = "converged"
            break
    if throw and status != "converged":
        raise UnconvergedError(
            f"the fit has not settled after {max_iterations} iterations, at "
            f"{_line(scene, free, params, state.residual)}: start closer, free fewer parameters, "
            "or allow more iterations"
        )
    return _result(scene, free, params, evaluate, whole, observations, status)


def fit_kappa_s(curve: Measurement | Sequence[Measurement], scene: Scene, **options: Any) -> Fit:
    """`fit` of the squeeze-shear factor alone, to the squeeze stress over an edge of the pressure.

    The squeeze strain decays from there within lam = H sqrt(kappa_s (1-nu)/6) in plane strain
    (Brink 2015, section 4.7.2).  Elasticity (Filon 1903) does not decay so and turns into a little
    tension, so what is fitted is the width of a layer, and depends on where one looks.

    Parameters
    ----------
    curve : a `SqueezeCurve`, or several
    scene : start value, and everything that stays fixed
    options : of `fit`
    """
    return fit(curve, scene, ("strip.kappa_s",), **options)


class _Point(NamedTuple):
    """The model at a point of the search space.

    Attributes
    ----------
    residual, jacobian : (measurements * n,), (measurements * n, p)
    predictions : (measurements, n)
    sound : whether every load step found equilibrium
    """

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    predictions: NDArray[np.float64]
    sound: bool


class _Evaluation:
    """Residual and Jacobian at a point together, remembered: the optimiser asks for them apart."""

    def __init__(
        self, scene: Scene, free: tuple[str, ...], experiment: Experiment, solver: Newton
    ) -> None:
        self._fixed = (scene, free, experiment, solver)
        self._known: dict[bytes, _Point] = {}

    @property
    def runs(self) -> int:
        """Points at which the model was run."""
        return len(self._known)

    def __call__(self, params: Array) -> _Point:
        key = np.asarray(params).tobytes()
        if key not in self._known:
            rows, jacobian, predictions, sound = _linearised(params, *self._fixed)
            self._known[key] = _Point(
                np.asarray(rows), np.asarray(jacobian), np.asarray(predictions), bool(sound)
            )
        return self._known[key]


@eqx.filter_jit
def _linearised(
    params: Array, scene: Scene, free: tuple[str, ...], experiment: Experiment, solver: Newton
) -> tuple[Array, Array, Array, Array]:
    def residual(params: Array) -> tuple[Array, tuple[Array, Array, Array]]:
        rows, predictions, sound = experiment.residual(scene_at(scene, free, params), solver)
        return rows.ravel(), (rows.ravel(), predictions, sound)

    jacobian, (rows, predictions, sound) = jax.jacfwd(residual, has_aux=True)(params)
    return rows, jacobian, predictions, sound


def scene_at(scene: Scene, free: Sequence[str], params: Array) -> Scene:
    """The scene with its free parameters at a point of the search space, where it is at zero."""
    return scene.replace(_values(scene, free, params))


def _values(scene: Scene, free: Sequence[str], params: Any) -> dict[str, Any]:
    return {key: _bound(key, scene.get(key), p) for key, p in zip(free, params, strict=True)}


def _bound(key: str, start: Any, p: Any) -> Any:
    """From the whole real line, zero being the start, to where a parameter lives.

    The real line for those of either sign, m above 1, nu in (-1, 0.5), positive for all others.
    """
    if key in SIGNED:
        return start * (1.0 + p)
    if key == "strip.poisson_ratio":
        return -1.0 + 1.5 / (1.0 + (0.5 - start) / (1.0 + start) * jnp.exp(-p))
    if key == "contact.smoothing":
        return 1.0 + (start - 1.0) * jnp.exp(p)
    return start * jnp.exp(p)


def _check_free(scene: Scene, free: Sequence[str]) -> None:
    if not free:
        raise InputError("free: name at least one key, such as contact.friction")
    for key in free:
        check_key(key)
        if key not in NUMBERS or key == "load.amplitude":
            raise InputError(f"free {key!r}: is not a parameter of the strip or the contact")
        start = scene.get(key)
        if start is None:
            raise InputError(f"free {key!r}: the scene has none; give it a number to start from")
        if np.ndim(start) > 0:
            raise InputError(f"free {key!r}: is a table; only a single number can be fitted")
        if not np.isfinite(start):
            raise InputError(
                f"free {key!r}: is 'sharp'; give it a number to start from, such as 16"
            )
        if start == 0.0 and key != "strip.poisson_ratio":
            raise InputError(f"free {key!r}: is 0; give it another number to start from")
    if len(set(free)) < len(free):
        raise InputError(f"free {list(free)}: names a key twice")


def _result(
    scene: Scene,
    free: Sequence[str],
    params: Array,
    evaluate: _Evaluation,
    data: list[Any],
    observations: Sequence[Observation],
    status: str,
) -> Fit:
    point = evaluate(params)
    compared = [np.flatnonzero(np.asarray(o.weight)) for o in observations]
    rows = [row[i] for row, i in zip(point.residual.reshape(len(data), -1), compared, strict=True)]
    noise = np.sum(point.residual**2) / max(sum(map(len, rows)) - len(free), 1)
    inverse = np.linalg.pinv(point.jacobian.T @ point.jacobian)
    spread = np.sqrt(np.diag(inverse))
    slopes = jax.jvp(lambda p: _values(scene, free, p), (params,), (jnp.ones(len(free)),))[1]
    values = {key: float(value) for key, value in _values(scene, free, params).items()}
    errors = np.abs([float(slopes[key]) for key in free]) * np.sqrt(noise) * spread

    def answered(measurement: Any, observation: Observation, answer: NDArray) -> Any:
        column = observation.column(scene)
        return eqx.tree_at(lambda m: getattr(m, column), measurement, answer)

    return Fit(
        scene=scene.replace(values),
        values=values,
        errors=dict(zip(free, errors.tolist(), strict=True)),
        correlation=inverse / np.outer(spread, spread),
        misfit=float(np.sqrt(np.mean(np.concatenate(rows) ** 2))),
        misfits=[float(np.sqrt(np.mean(row**2))) for row in rows],
        data=data,
        model=[
            answered(measurement, observation, prediction[i])
            for measurement, observation, prediction, i in zip(
                data, observations, point.predictions, compared, strict=True
            )
        ],
        status=status,
        model_runs=evaluate.runs,
    )


def _line(scene: Scene, free: Sequence[str], params: Array, residual: Array) -> str:
    values = ", ".join(f"{k} = {float(v):.6g}" for k, v in _values(scene, free, params).items())
    return f"{values}, cost {float(jnp.sum(residual**2)):.4g}"
