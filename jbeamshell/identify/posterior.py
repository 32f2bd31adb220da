"""Posterior density of a fit's parameters, for samplers of other libraries.

Samplers that move freely, such as those of blackjax, numpyro or emcee, take `Posterior.logdensity`
of points in the unbounded search space.  `Posterior.loglikelihood` is the likelihood of values.

The likelihood is that of the fit: normal where measured noise explains the residuals, else with
Student's distribution of the estimated noise, whose few independent points include what the model
leaves.  The prior of a parameter is its own normal one, or flat on its scale: in log x for most.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from jbeamshell.common.errors import InputError
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.search_space import SearchSpace
from jbeamshell.identify.uncertainty import Uncertainty


@dataclasses.dataclass(frozen=True, eq=False)
class Posterior:
    """Posterior density of n parameters; made by `Fit.posterior`.

    Attributes
    ----------
    problem : least-squares problem of the fit
    uncertainty : uncertainty of the fit, with its search space
    least : sum of the squared residuals of the data at the fit
    """

    problem: Problem
    uncertainty: Uncertainty
    least: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self._space.names

    @property
    def start(self) -> NDArray[np.float64]:
        """Point (n,) of the fit, from which a sampler may start."""
        return self.uncertainty.point

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance (n, n) of the points by the fit, the inverse mass matrix of a sampler."""
        return self.uncertainty.covariance

    def constrain(self, theta: ArrayLike) -> Array:
        """Parameters (n,) within their bounds at a point (n,), traced or not."""
        return jnp.asarray(self._space.at(jnp.asarray(theta))[0])

    def unconstrain(self, values: ArrayLike) -> NDArray[np.float64]:
        """Point (n,) at parameters (n,) within their bounds."""
        return self._space.point(values)

    def loglikelihood(self, values: ArrayLike) -> Array:
        """Logarithm of the likelihood of parameters (n,) over that of the fit.

        It can be traced, mapped and differentiated once.
        """
        u, at = self.uncertainty, jnp.asarray(values)
        rise = (_cost(self.problem)(at) - self.least) / u.sigma**2
        if u.freedom is None:
            return -0.5 * rise
        # The density whose marginals are the fit's intervals, where the model is linear.
        return -0.5 * (u.freedom + at.size) * jnp.log1p(rise / u.freedom)

    def logdensity(self, theta: ArrayLike) -> Array:
        """Logarithm of the posterior density at a point (n,) of the search space.

        The point is no value of a parameter, see `constrain`; the density is that of points, with
        the factor of the change of variables. It can be traced, mapped and differentiated once.
        """
        point = jnp.asarray(theta)
        values, slopes = self._space.at(point)
        logs = np.array([one.log for one in self._space.coordinates])
        scales = jnp.where(logs, slopes / values, slopes)
        # A flat density on the scale t is dt/dtheta here; a normal one of x has dx/dt too.
        total = self.loglikelihood(values) + jnp.sum(jnp.log(scales))
        for axis, mean, deviation in self.problem.priors:
            value = values[axis]
            total = total - 0.5 * ((value - mean) / deviation) ** 2
            if logs[axis]:
                total = total + jnp.log(value)
        return total

    @property
    def _space(self) -> SearchSpace:
        return self.uncertainty.space


def posterior(problem: Problem, uncertainty: Uncertainty) -> Posterior:
    """Posterior density at the minimum of a problem; see `Fit.posterior`."""
    for name, at_bound in zip(uncertainty.space.names, uncertainty.at_bound, strict=True):
        if at_bound:
            raise InputError(
                f"posterior: {name} ended at its bound; widen its bounds, or leave it out"
            )
    rows = problem.weight.size
    best = problem(uncertainty.point).residual[:rows]
    return Posterior(problem, uncertainty, float(best @ best))


def _cost(problem: Problem) -> jax.custom_jvp:
    """Function of the parameters (n,): sum of the squared residuals of the data.

    The model is differentiated forward, with the residuals; gradients need no second run.
    """

    @jax.custom_jvp
    def cost(values: Array) -> Array:
        return problem.traced_cost(values)[0]

    @cost.defjvp
    def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
        found, gradient = problem.traced_cost(primals[0])
        return found, gradient @ tangents[0]

    return cost
