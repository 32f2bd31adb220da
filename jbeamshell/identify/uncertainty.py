"""Uncertainty of a fit: covariance, intervals, and directions that the data do not fix.

All follow from the Gauss-Newton Hessian J'J of the weighted residuals in the search space, where
most parameters are logarithms.  Their ends are mapped to values.  Where the residuals
are correlated, or more than measured noise, the model is wrong in some way: their variance is then
that of the few independent points they are worth: what a wrong model leaves is smooth along a
curve.  What the model's own grid may leave adds to it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from jbeamshell.common.errors import InputError
from jbeamshell.identify.parameters import FARTHEST
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.search_space import SearchSpace

LEVELS = (0.68, 0.95)
LEAST = 1e-14  # eigenvalue of J'J over the largest one, below which it is rounding
HARDLY, NOT = 0.1, 0.5  # relative standard errors above which a parameter is hardly or not known
ALARM = 0.99  # part of fits whose residuals measured noise explains, if the model is right
FEWEST = 3.0  # degrees of freedom: with fewer, Student's distribution has no variance
WORTH_SAYING = 5e-3  # relative interval below which a parameter is known, whatever it goes with
TOGETHER = 0.12  # interval of a product over that of one factor, below which only it is known
SIMPLE = 0.1  # difference of a power from 1 up to which it is named a product or a ratio
TAKES_PART = 0.3  # component of a direction over its largest one, above which it is named
STEP = 0.1  # relative change by which a direction is described
SURE = 1.65  # standard errors beyond which a correlation is no chance; white noise is in 5 of 100
LAGS = 1.3  # lags over the root of the points, over which slow correlation shows

Vector = NDArray[np.float64]


class Uncertainty(NamedTuple):
    """Gaussian uncertainty of a fit's parameters.

    Attributes
    ----------
    space : search space, n axes
    point : (n,) minimum
    inverse : (n, n) covariance in the search space for residuals of unit noise
    at_bound : (n,) True where the value ended at a bound; it then counts as fixed without error
    sigma : noise of independent residuals that leaves parameters as uncertain as they are: 1 if the
        noise was measured and explains the residuals, else estimated from them
    scatter : size of a residual; less than sigma where neighbours are correlated
    freedom : degrees of freedom, independent points less parameters but at least `FEWEST`, of an
        estimated sigma; None if the noise was measured and explains the residuals
    noise : scatter over the range of the responses, in the mean
    independent : number of independent points that the residuals are worth
    """

    space: SearchSpace
    point: Vector
    inverse: Vector
    at_bound: NDArray[np.bool_]
    sigma: float
    scatter: float
    freedom: float | None
    noise: float
    independent: float

    @property
    def covariance(self) -> Vector:
        """Covariance (n, n) in the search space."""
        return self.sigma**2 * self.inverse

    @property
    def errors(self) -> Vector:
        """Standard errors (n,) of the parameters; NaN for values at a bound."""
        errors = np.abs(self.space.slopes(self.point)) * self._spread
        return np.where(self.at_bound, np.nan, errors)

    @property
    def correlation(self) -> Vector:
        """Correlation (n, n) of the parameters in the search space."""
        spread = np.where(self.at_bound, 1.0, np.sqrt(np.diag(self.inverse)))
        return np.where(np.eye(spread.size) > 0.0, 1.0, self.inverse / np.outer(spread, spread))

    def intervals(self, level: float = 0.95) -> Vector:
        """Confidence intervals (n, 2) of the parameters, within their bounds.

        They use Student's distribution if the noise was estimated, else the normal distribution.
        """
        width = self.quantile(level) * self._spread
        ends = [self.space.values(self.point + side * width) for side in (-1.0, 1.0)]
        return np.where(self.at_bound[:, None], np.nan, np.sort(np.transpose(ends), axis=1))

    def quantile(self, level: float) -> float:
        """Half width of the interval of a confidence level, in standard errors."""
        check_level(level)
        upper = 0.5 * (1.0 + level)
        if self.freedom is None:
            return float(stats.norm.ppf(upper))
        return float(stats.t.ppf(upper, self.freedom))

    def at_noise(self, noise: float) -> Uncertainty:
        """Uncertainty under noise of another size, given over the range of the responses."""
        if not (np.isfinite(noise) and noise > 0.0):
            raise InputError(f"noise = {noise}: give a positive part of the range, such as 0.01")
        size = noise * self.scatter / self.noise
        return self._replace(sigma=size, scatter=size, noise=noise, freedom=None)

    def directions(self) -> list[tuple[float, Vector]]:
        """Eigenvalues and vectors (n,) of the Fisher information inside the bounds, worst first.

        An eigenvalue is 1 over the variance along its vector, which has unit length in the search
        space.
        """
        free = np.flatnonzero(~self.at_bound)
        variances, vectors = np.linalg.eigh(self.covariance[np.ix_(free, free)])
        whole = np.zeros((free.size, self.at_bound.size))
        whole[:, free] = vectors.T
        pairs = zip(variances[::-1], whole[::-1], strict=True)
        return [(1.0 / max(v, np.finfo(float).tiny), vector) for v, vector in pairs]

    def limitations(self, level: float = 0.95) -> list[str]:
        """Sentences on what the data do not determine; none if they determine all parameters."""
        low_high = self.intervals(level)
        values, noise = self.space.values(self.point), f"{100.0 * self.noise:.2g} % noise"
        relative = self.errors / self._sizes(values)
        sentences = []
        for name, share, (low, high) in zip(self.space.names, relative, low_high, strict=True):
            where = f"anywhere between {low:.2g} and {high:.2g} ({100.0 * level:g} %)"
            if share >= HARDLY:
                how = "not" if share >= NOT else "hardly"
                begin = f"{name} is {how} identifiable from these data"
                sentences.append(f"{begin}: {noise} leaves it {where}")
        pairs = self._pairs(values, level)
        return sentences + list(pairs.values()) + self._trades(values, set(pairs))

    def _pairs(self, values: Vector, level: float) -> dict[tuple[int, ...], str]:
        """Sentences on pairs of positive parameters of which one product is known far better."""
        scale = self.space.slopes(self.point) / self._sizes(values)
        relative = self.quantile(level) ** 2 * self.covariance * np.outer(scale, scale)
        free = [i for i in np.flatnonzero(~self.at_bound).tolist() if self.space.coordinates[i].log]
        sentences: dict[tuple[int, ...], str] = {}
        for i, j in itertools.combinations(free, 2):
            power = -relative[i, j] / relative[j, j]
            alone = np.sqrt(np.array([relative[i, i], relative[j, j]]))
            both = float(np.sqrt(max(relative[i, i] + power * relative[i, j], 0.0)))
            if np.min(alone) < WORTH_SAYING or both > TOGETHER * alone[0]:
                continue
            one, other = self.space.names[i], self.space.names[j]
            which = f"the ratio of {one} and {other}"
            if power > 0.0:
                which = f"the product of {one} and {other}"
            if abs(abs(power) - 1.0) > SIMPLE:
                which = f"{one} times {other} to the power {power:.2g}"
            sentences[i, j] = (
                f"only {which} is known well: to {_percent(both)}, each alone to "
                f"{' and '.join(map(_percent, alone.tolist()))} ({100.0 * level:g} %)"
            )
        return sentences

    def _trades(self, values: Vector, named: set[tuple[int, ...]]) -> list[str]:
        """Sentences on combinations of parameters that change the response less than the noise."""
        sizes, slopes = self._sizes(values), self.space.slopes(self.point)
        sentences = []
        for eigenvalue, vector in self.directions():
            change = vector * slopes / sizes  # relative, for a unit step
            largest = np.max(np.abs(change))
            if largest < HARDLY * np.sqrt(eigenvalue):
                continue
            change = STEP * change / change[np.argmax(np.abs(change))]
            part = np.flatnonzero(np.abs(change) >= TAKES_PART * STEP)
            # The least known direction speaks for all that mix the same parameters.
            if part.size > 1 and tuple(part.tolist()) not in named:
                named.add(tuple(part.tolist()))
                names = " and ".join(self.space.names[i] for i in part)
                steps = " with ".join(
                    f"{100.0 * abs(change[i]):.2g} % {'more' if change[i] > 0 else 'less'} "
                    f"{self.space.names[i]}"
                    for i in part
                )
                sentences.append(
                    f"{names} trade off: {steps} changes the response by less than the noise, so "
                    "only another combination of them is known"
                )
        return sentences

    @property
    def _spread(self) -> Vector:
        return np.sqrt(np.diag(self.covariance))

    def _sizes(self, values: Vector) -> Vector:
        """Sizes (n,) for relative errors: the values, or their starts if these are larger."""
        starts = np.array([one.start for one in self.space.coordinates])
        logs = np.array([one.log for one in self.space.coordinates])
        sizes = np.where(logs, np.abs(values), np.maximum(np.abs(values), np.abs(starts)))
        return np.where(sizes > 0.0, sizes, 1.0)


def uncertainty_at(problem: Problem, point: Vector) -> Uncertainty:
    """Uncertainty at the minimum of a problem.

    What the model's own grid may leave in a residual is smooth and alike in all curves, so that all
    together are worth `FEWEST` independent points of it.
    """
    end, emphasis, relative = problem(point), problem.emphasis, problem.relative
    residual, jacobian = end.residual, end.jacobian  # priors are the last rows
    at_bound = np.array([bound is not None for bound in problem.space.bounds_at(point)])
    free = np.ix_(~at_bound, ~at_bound)
    eigenvalues, vectors = np.linalg.eigh((jacobian.T @ jacobian)[free])
    priors = np.ones(residual.size - emphasis.size)
    factors = np.append(emphasis, priors)
    left = (residual / factors)[: relative.size]
    independent = independent_points([left[own] for own in problem.slices])
    total = float(np.sum((residual / factors) ** 2))
    rows = max(residual.size - point.size, 1)
    scatter = float(np.sqrt(total / rows))
    freedom: float | None = max(rows - (left.size - independent), min(rows, FEWEST))
    sigma = scatter * float(np.sqrt(left.size / independent))
    if problem.noisy:
        explained = scatter**2 <= stats.chi2.ppf(ALARM, rows) / rows
        scatter = 1.0 if explained else scatter
        sigma = max(sigma, 1.0)
        if explained and independent == left.size:
            sigma, freedom = 1.0, None
    sigma = float(np.hypot(sigma, problem.model_error * np.sqrt(left.size / FEWEST)))
    # A model fitted to its own data leaves no noise to divide by.
    sigma, scatter = (max(size, np.finfo(float).tiny ** 0.25) for size in (sigma, scatter))
    # A pseudo-inverse would give directions without influence no variance; theirs is that of the
    # whole search space, however small the noise.
    least = max(LEAST * np.max(eigenvalues, initial=0.0), np.finfo(float).tiny ** 0.5)
    safe = np.where(eigenvalues > least, eigenvalues, min(least, (sigma / FARTHEST) ** 2))
    inverse = np.zeros((point.size, point.size))
    inverse[free] = (vectors / safe) @ vectors.T
    factors = np.append(emphasis, priors / sigma)
    if np.any(factors != 1.0):
        # Sandwich estimator: the factors change the minimum, not the noise; priors keep theirs.
        inner = jacobian.T @ (factors[:, None] ** 2 * jacobian)
        inverse = inverse @ inner @ inverse
    noise = max(scatter * float(np.sqrt(np.mean(relative**2))), np.finfo(float).tiny ** 0.25)
    return Uncertainty(
        problem.space, point, inverse, at_bound, sigma, scatter, freedom, noise, independent
    )


def _percent(part: float) -> str:
    """Half of a relative interval in percent; beyond 100 % it is a factor, which says nothing."""
    return f"{100.0 * part:.2g} %" if part < 1.0 else "a factor of 2 and more"


def check_level(level: float) -> None:
    """Raise `InputError` unless a confidence level lies between 0 and 1."""
    if not 0.0 < level < 1.0:
        raise InputError(f"level = {level}: give a number between 0 and 1, such as 0.95")


def independent_points(residuals: Sequence[Vector]) -> float:
    """Number of independent points that residuals along several curves are worth.

    n points of autocorrelation rho_k estimate a mean as well as n/(1 + 2 sum rho_k) independent
    ones (Bayley and Hammersley, J. R. Stat. Soc. Suppl. 8, 1946).  The sum takes the sizes of
    rho_k: the second branch of a loop repeats the first with the other sign, and so do the
    derivatives of the model.  What white noise adds to their squares is taken off.  Of slow noise,
    this counts rather too few points than too many.

    All points count where nothing tells the residuals from white noise: neither rho_1 nor
    Bartlett's sum over a few lags (Newey and West, Econometrica 55, 1987; for their number Lazarus
    et al., J. Bus. Econ. Stat. 36, 2018).
    """
    points = sum(own.size for own in residuals)
    products = np.zeros(max(own.size for own in residuals))
    pairs = np.zeros(products.size)
    for own in residuals:
        products[: own.size] += np.correlate(own, own, "full")[own.size - 1 :]
        pairs[: own.size] += np.arange(own.size, 0, -1)
    if products[0] == 0.0 or products.size < 2:
        return float(points)
    correlation, chance = products[1:] / products[0], np.sqrt(pairs[1:]) / points
    few = min(int(np.ceil(LAGS * np.sqrt(points))), correlation.size)
    bartlett = 1.0 - np.arange(1, few + 1) / (few + 1)
    slow, by_chance = bartlett @ correlation[:few], np.linalg.norm(bartlett * chance[:few])
    if correlation[0] < SURE * chance[0] and slow < SURE * by_chance:
        return float(points)
    size = np.sqrt(np.maximum(correlation**2 - chance**2, 0.0))
    return points / (1.0 + 2.0 * float(np.sum(size)))


def model_misfit(residual: Vector) -> float:
    """Root mean square of the part of a residual along a curve that is no white noise."""
    return float(np.sqrt(max(float(np.mean(residual**2)) - white_noise(residual) ** 2, 0.0)))


def white_noise(residual: Vector) -> float:
    """Size of the white noise of a residual along a curve, from the differences of neighbours.

    See von Neumann, Ann. Math. Stat. 12, 1941.
    """
    if residual.size < 2:
        return 0.0
    return float(np.sqrt(np.mean(np.diff(residual) ** 2) / 2.0))
