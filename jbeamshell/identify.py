"""Parameters from loops: least squares on the response, with standard errors.

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
from jax import Array, lax
from numpy.typing import NDArray

from jbeamshell.errors import InputError, UnconvergedError
from jbeamshell.loops import Loop
from jbeamshell.newton import Newton
from jbeamshell.quasistatic import check, solve
from jbeamshell.scene import NUMBERS, Scene, check_key

POINTS = 96  # of a loop that the model is run through
MAX_ITERATIONS = 40
APPROACH = 8  # load steps from zero to the first point of the data
FLAT = 1e-6  # relative gain in cost at which a fit has settled
HOPELESS = 10.0  # residual, in ranges, of a trial without equilibrium: never accepted


class Fit(NamedTuple):
    """Result of a fit.

    Attributes
    ----------
    scene : the scene with the fitted values
    values, errors : fitted value and standard error (one sigma) by key; the errors take what the
        model leaves unexplained as independent noise, so a model that is wrong makes them too small
    correlation : (p, p) of the fitted values, in the order of ``values``
    misfit : root mean square of the residual over the range of the response
    misfits : the same for every loop
    data, model : the loops fitted, thinned, and the model's at the same points
    status : "converged" or "max_iterations"
    model_runs : how often the model was run through all loops, derivatives included
    """

    scene: Scene
    values: dict[str, float]
    errors: dict[str, float]
    correlation: NDArray[np.float64]
    misfit: float
    misfits: list[float]
    data: list[Loop]
    model: list[Loop]
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
        """Draw data and model; returns the axes."""
        from jbeamshell import plotting

        return plotting.overlay(
            [(d.force, d.displacement, "data") for d in self.data],
            [(m.force, m.displacement, f"model, {m.label}") for m in self.model],
            axes,
        )


class _Task(NamedTuple):
    """Loops as load paths of one length: what is prescribed, compared, and with which weight."""

    path: Array  # (loops, steps)
    response: Array  # (loops, steps)
    weight: Array  # (loops, steps), 1 over the response's range where compared, else 0


def driver_of(loops: Sequence[Loop]) -> str:
    """Which column drove the test: the smoother one; the force where neither is rough."""

    def roughness(column: NDArray[np.float64]) -> float:
        return float(np.sqrt(np.mean(np.diff(column, 3) ** 2)) / np.ptp(column))

    force = np.mean([roughness(loop.force) for loop in loops])
    displacement = np.mean([roughness(loop.displacement) for loop in loops])
    return "displacement" if displacement < 0.5 * force and force > 1e-3 else "force"


def fit(
    loops: Loop | Sequence[Loop],
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
    """Least squares of a scene's parameters on measured or computed loops.

    The model is driven by the column that ``scene.load.control`` names and compared in the other,
    relative to its range.  A closed loop is run twice, so that its second pass is steady; anything
    else is run once, from rest.

    Parameters
    ----------
    loops : the data
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
        for keys that cannot be fitted, or that the loops do not depend on, and for forces beyond
        gross slip at the start values
    UnconvergedError
        if the iteration does not settle, or the model finds no equilibrium at the start
    """
    data = [loops] if isinstance(loops, Loop) else list(loops)
    _check_free(scene, free)
    if not data:
        raise InputError("loops: no loop given; read one with read_loops")
    driver = scene.load.control
    data = [loop.thinned(points, driver) for loop in data]
    task = _task(data, driver)
    for path in task.path:
        check(scene, path)
    evaluate = _Evaluation(scene, tuple(free), task, solver or Newton())

    start = np.array([_unbound(key, float(scene.get(key))) for key in free])
    _, jacobian = evaluate(start)
    if not evaluate.sound(start):
        raise UnconvergedError(
            "the model finds no equilibrium at the start values: start closer, or lower "
            "contact.stick_stiffness"
        )
    for key, column in zip(free, jacobian.T, strict=True):
        if not np.any(np.abs(column) > 1e-9):
            raise InputError(f"free {key!r}: the loops do not depend on it; leave it out")

    method = jaxopt.LevenbergMarquardt(
        residual_fun=lambda p: jnp.asarray(evaluate(np.asarray(p))[0]),
        materialize_jac=True,
        solver="cholesky",
        damping_parameter=1e-3,
        jit=False,
    )
    # Its last release forgets a jac_fun argument when the Jacobian is materialised.
    method._jac_fun = lambda p: jnp.asarray(evaluate(np.asarray(p))[1])
    params = jnp.asarray(start)
    state = method.init_state(params)
    status = "max_iterations"
    for _ in range(max_iterations):
        before = float(state.value)
        params, state = method.update(params, state)
        if progress:
            progress(_line(free, params, state.residual))
        gained = before - float(state.value)  # nothing when the step was refused
        if float(jnp.max(jnp.abs(state.delta))) < tolerance or 0.0 < gained < FLAT * before:
            status = "converged"
            break
    if throw and status != "converged":
        raise UnconvergedError(
            f"the fit has not settled after {max_iterations} iterations, at "
            f"{_line(free, params, state.residual)}: start closer, free fewer parameters, or allow "
            "more iterations"
        )
    return _result(scene, free, np.asarray(params), evaluate, data, task, driver, status)


class _Evaluation:
    """Residual and Jacobian at a point together, remembered: the optimiser asks for them apart."""

    def __init__(self, scene: Scene, free: tuple[str, ...], task: _Task, solver: Newton) -> None:
        self._scene, self._free, self._task, self._solver = scene, free, task, solver
        self._known: dict[bytes, tuple[NDArray, NDArray, NDArray, bool]] = {}

    @property
    def runs(self) -> int:
        """Points at which the model was run."""
        return len(self._known)

    def __call__(self, params: NDArray) -> tuple[NDArray, NDArray]:
        return self._at(params)[:2]

    def prediction(self, params: NDArray) -> NDArray:
        """The response (loops, steps)."""
        return self._at(params)[2]

    def sound(self, params: NDArray) -> bool:
        """Whether every step found equilibrium."""
        return self._at(params)[3]

    def _at(self, params: NDArray) -> tuple[NDArray, NDArray, NDArray, bool]:
        key = params.tobytes()
        if key not in self._known:
            jacobian, (residual, response, sound) = _linearised(
                jnp.asarray(params), self._scene, self._free, self._task, self._solver
            )
            self._known[key] = (
                np.asarray(residual),
                np.asarray(jacobian),
                np.asarray(response),
                bool(sound),
            )
        return self._known[key]


@eqx.filter_jit
def _linearised(
    params: Array, scene: Scene, free: tuple[str, ...], task: _Task, solver: Newton
) -> tuple[Array, tuple[Array, Array, Array]]:
    def residual(params: Array) -> tuple[Array, tuple[Array, Array, Array]]:
        trial = scene_at(scene, free, params)

        def run(path: Array) -> tuple[Array, Array]:
            history = solve(trial, path, solver=solver, throw=False)
            answers = {"force": history.displacement, "displacement": history.force}
            sound = jnp.all(history.status == 0)
            return answers[scene.load.control][1:], sound

        response, sound = lax.map(run, task.path)
        misfit = jnp.where(
            sound[:, None], (response - task.response) * task.weight, HOPELESS * (task.weight > 0)
        ).ravel()
        return misfit, (misfit, response, jnp.all(sound))

    return jax.jacfwd(residual, has_aux=True)(params)


def scene_at(scene: Scene, free: Sequence[str], params: Array) -> Scene:
    """The scene with its free parameters at a point of the unbounded search space."""
    values = {key: _bound(key, p) for key, p in zip(free, params, strict=True)}
    return scene.replace(values)


def _bound(key: str, p: Any) -> Any:
    """From the whole real line to where it lives: positive, m above 1, nu in (-1, 0.5)."""
    if key == "strip.poisson_ratio":
        return -1.0 + 1.5 / (1.0 + jnp.exp(-p))
    if key == "contact.smoothing":
        return 1.0 + jnp.exp(p)
    return jnp.exp(p)


def _unbound(key: str, value: float) -> float:
    if key == "strip.poisson_ratio":
        return float(np.log((value + 1.0) / (0.5 - value)))
    if key == "contact.smoothing":
        return float(np.log(value - 1.0))
    return float(np.log(value))


def _check_free(scene: Scene, free: Sequence[str]) -> None:
    if not free:
        raise InputError("free: name at least one key, such as contact.friction")
    for key in free:
        check_key(key)
        if key not in NUMBERS or key == "load.amplitude":
            raise InputError(f"free {key!r}: is not a parameter of the strip or the contact")
        if np.ndim(scene.get(key)) > 0:
            raise InputError(f"free {key!r}: is a table; only a single number can be fitted")
        if not np.isfinite(scene.get(key)):
            raise InputError(
                f"free {key!r}: is 'sharp'; give it a number to start from, such as 16"
            )
    if len(set(free)) < len(free):
        raise InputError(f"free {list(free)}: names a key twice")


def _task(loops: Sequence[Loop], driver: str) -> _Task:
    answer = "displacement" if driver == "force" else "force"
    paths, responses, weights = [], [], []
    for loop in loops:
        drive, response = getattr(loop, driver), getattr(loop, answer)
        approach = np.linspace(0.0, drive[0], APPROACH + 1)[1:]
        passes = 2 if loop.closed else 1
        paths.append(np.concatenate([approach, *[drive] * passes]))
        skipped = APPROACH + (passes - 1) * drive.size
        responses.append(np.append(np.zeros(skipped), response))
        weights.append(np.append(np.zeros(skipped), np.full(drive.size, 1.0 / np.ptp(response))))
    longest = max(map(len, paths))
    # A path that stands still adds nothing, so shorter ones wait at their end.
    pad = [longest - len(p) for p in paths]
    return _Task(
        jnp.asarray(
            np.stack([np.append(p, np.full(k, p[-1])) for p, k in zip(paths, pad, strict=True)])
        ),
        jnp.asarray(
            np.stack([np.append(r, np.zeros(k)) for r, k in zip(responses, pad, strict=True)])
        ),
        jnp.asarray(
            np.stack([np.append(w, np.zeros(k)) for w, k in zip(weights, pad, strict=True)])
        ),
    )


def _result(
    scene: Scene,
    free: Sequence[str],
    params: NDArray,
    evaluate: _Evaluation,
    data: list[Loop],
    task: _Task,
    driver: str,
    status: str,
) -> Fit:
    residual, jacobian = evaluate(params)
    compared = np.asarray(task.weight) > 0.0
    freedom = max(int(compared.sum()) - params.size, 1)
    noise = float(residual @ residual) / freedom
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    spread = np.sqrt(np.diag(inverse))
    sigma = np.sqrt(noise) * spread
    scale = np.array(
        [
            float(jax.grad(lambda p, k=key: _bound(k, p))(x))
            for key, x in zip(free, params, strict=True)
        ]
    )
    response = evaluate.prediction(params)
    model = [
        Loop(loop.force, answer[mask], loop.label)
        if driver == "force"
        else Loop(answer[mask], loop.displacement, loop.label)
        for loop, answer, mask in zip(data, response, compared, strict=True)
    ]
    per_loop = residual.reshape(compared.shape)
    return Fit(
        scene=scene.replace({k: float(_bound(k, p)) for k, p in zip(free, params, strict=True)}),
        values={k: float(_bound(k, p)) for k, p in zip(free, params, strict=True)},
        errors={k: float(e) for k, e in zip(free, scale * sigma, strict=True)},
        correlation=inverse / np.outer(spread, spread),
        misfit=float(np.sqrt(np.mean(per_loop[compared] ** 2))),
        misfits=[
            float(np.sqrt(np.mean(r[m] ** 2))) for r, m in zip(per_loop, compared, strict=True)
        ],
        data=data,
        model=model,
        status=status,
        model_runs=evaluate.runs,
    )


def _line(free: Sequence[str], params: Array, residual: Array) -> str:
    values = ", ".join(
        f"{k} = {float(_bound(k, p)):.6g}" for k, p in zip(free, params, strict=True)
    )
    return f"{values}, cost {float(jnp.sum(residual**2)):.4g}"
