"""Runs of the models that reproduce observations, with their derivatives.

Runs of one kind and length on models of one structure are compiled once and run in parallel, one on
each core.  Each run knows only the few numbers of its specimen, so a fit of many specimens costs no
more per run than a fit of one.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from jbeamshell.common.small import Small
from jbeamshell.contact_line.shared import Layout, Shared
from jbeamshell.identify.models import FINER, Model
from jbeamshell.identify.observations import Observation
from jbeamshell.identify.parameters import RIG
from jbeamshell.identify.rig import with_rig
from jbeamshell.numerics.newton import Newton

GRIDS = float(np.hypot(1.0, 1.0 / FINER))  # errors of both grids over that of the finer one

Response = tuple[Array, Array, Array, Array]  # residual, derivatives, prediction and convergence


class Evaluation(NamedTuple):
    """Model's response to all measurements, their compared points one after the other.

    Attributes
    ----------
    residual : (rows,) weighted differences
    jacobian : (rows, k) derivatives with respect to the values of the measurement's own specimen;
        of a problem (rows + priors, n) with respect to the point of the search space
    prediction : (rows,) response on the scale that is compared
    converged : True if every load step found equilibrium
    """

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    prediction: NDArray[np.float64]
    converged: bool

    @property
    def cost(self) -> float:
        """Sum of the squared residuals."""
        return float(self.residual @ self.residual)


class Runs:
    """Runs of models, one for each observation.

    Attributes
    ----------
    pairs : observation, filled up to its length step, and model of each run
    """

    def __init__(
        self,
        observations: Sequence[Observation],
        models: Sequence[Model],
        owners: Sequence[int],
        keys: tuple[str, ...],
        solver: Newton,
    ) -> None:
        """Set up the run of each observation on the model of its specimen, by number in ``owners``.

        ``keys`` are the dotted keys (k,) of the numbers that change.
        """
        served = [model.serving(keys) for model in models]
        self.pairs = [(_filled(o), served[i]) for o, i in zip(observations, owners, strict=True)]
        self._owners, self._keys, self._solver = owners, keys, solver
        shapes = [_shape(pair) for pair in self.pairs]
        # One run of each shape first: threads that miss the same compiled code all compile it.
        self._firsts = [shapes.index(shape) for shape in dict.fromkeys(shapes)]

    def __call__(self, table: NDArray[np.float64]) -> list[tuple[NDArray[Any], ...]]:
        """Response of every run to the values (specimens, k) of its specimen."""

        def one(place: int) -> tuple[NDArray[Any], ...]:
            own, (observation, model) = table[self._owners[place]], self.pairs[place]
            strip = self._strips[place]
            held = strip is not None and strip.holds(model.own, self._keys, own)
            shared = strip if held else None
            run = self._respond(jnp.asarray(own), observation, model, shared)
            return tuple(map(np.asarray, run))

        done = {place: one(place) for place in self._firsts}
        self._firsts = []
        rest = [place for place in range(len(self.pairs)) if place not in done]
        pool = ThreadPoolExecutor(os.cpu_count())
        run_all = pool.map if len(rest) > 1 else map
        try:
            done |= dict(zip(rest, run_all(one, rest), strict=True))
        finally:
            pool.shutdown(cancel_futures=True)
        return [done[place] for place in range(len(self.pairs))]

    def traced(self, table: Array) -> Iterator[Response]:
        """Response of every run to values (specimens, k) that may be traced."""
        for owner, pair, strip in zip(self._owners, self.pairs, self._strips, strict=True):
            yield self._respond(table[owner], *pair, strip)

    @cached_property
    def _strips(self) -> list[Shared | None]:
        """Strip of each run that its values share; None where each must be condensed."""
        vary = [key for key in self._keys if key not in RIG]
        return [model.shared(vary, observation.figures) for observation, model in self.pairs]

    def _respond(
        self, values: Array, observation: Observation, model: Model, strip: Shared | None
    ) -> Response:
        """Compiled response; that of a strip on its contact line is a small program."""
        numbers, layout = (None, None) if strip is None else (strip.numbers, strip.layout)
        given = values, observation, model, numbers, self._solver
        found: Response = (_small if model.small else _whole)(given, self._keys, layout)
        return found


def _response(given: tuple[Any, ...], keys: tuple[str, ...], layout: Layout | None) -> Response:
    """Residual (n,), its derivatives (n, k), prediction (n,) and convergence of a run."""
    values, observation, model, numbers, solver = given

    def residual(own: Array, off: Array) -> tuple[Array, tuple[Array, Array, Array]]:
        named = dict(zip(keys, own, strict=True))
        at = model.replace({key: value for key, value in named.items() if key not in RIG})
        of_rig = {key: value for key, value in named.items() if key in RIG}
        through = with_rig(observation, of_rig) if of_rig else observation
        if observation.shares:
            through = through.moved(off)
        if layout is not None:
            at = at.prepared(layout.strip(numbers, at.own))
        rows, prediction, converged = through.residual(at, solver)
        return rows, (rows, prediction, converged)

    by = (0, 1) if observation.shares else (0,)
    slopes, (rows, prediction, converged) = jax.jacfwd(residual, by, has_aux=True)(
        values, jnp.zeros(2)
    )
    jacobian = slopes[0]
    if observation.shares:
        rows, jacobian = _whitened(slopes[1] / observation.excess(rows), rows, jacobian)
    return rows, jacobian, prediction, converged


_small = Small(_response)
_whole = eqx.filter_jit(_response)


def _whitened(common: Array, rows: Array, jacobian: Array) -> tuple[Array, Array]:
    """Residual (n,) and its derivatives (n, k) without what some common errors do to them.

    Common errors of unit variance, with the derivatives B (n, 2), leave the covariance I + B B' of
    residuals; these are multiplied by its inverse root, I - B V w V' B' with the eigenvectors V and
    eigenvalues s of B' B and w = (1 - (1 + s)^(-1/2))/s.
    """
    values, vectors = jnp.linalg.eigh(common.T @ common)
    root = jnp.sqrt(1.0 + jnp.maximum(values, 0.0))
    part = common @ (vectors / jnp.sqrt(root * (root + 1.0)))
    part = jnp.where(jnp.all(jnp.isfinite(common)), part, 0.0)  # else no equilibrium was found
    return rows - part @ (part.T @ rows), jacobian - part @ (part.T @ jacobian)


def _shape(run: tuple[Observation, Model]) -> Any:
    """Key that runs have in common if they share one compiled program."""
    arrays, rest = eqx.partition(run, eqx.is_array)
    shapes = tuple((leaf.shape, str(leaf.dtype)) for leaf in jax.tree.leaves(arrays))
    return jax.tree.structure(run), tuple(jax.tree.leaves(rest)), shapes


def _filled(observation: Observation) -> Observation:
    """Observation filled up to its length step with points that are not compared.

    Loops are thinned to about as many points; equal lengths let them share one compiled program.
    """
    points = observation.weight.size
    more = (0, -points % observation.length_step)
    longer = jax.tree.map(
        lambda leaf: jnp.pad(leaf, more, mode="edge") if leaf.shape == (points,) else leaf,
        observation,
    )
    return eqx.tree_at(lambda o: o.weight, longer, jnp.pad(observation.weight, more))
