r"""Harmonic balance: its equations, their solution by Newton's method, and tangents of curves.

The displacement x(t) = Re sum_h x_h exp(i h omega t) of a structure with joints satisfies

    (K + i h omega (C - xi M) - h^2 omega^2 M) x_h + B r_h(B^T x) = lambda f delta_h1,

where K has the joints stuck and r is the force that they lose by slip, sampled in time (Cameron &
Griffin 1989).  xi is a negative damping that sustains a free vibration (Krack 2015).  Three linear
conditions on x, omega, lambda and xi close the system: they fix a frequency or an amplitude, or
hold the distance along a curve.

The unknowns of the linear solves are the displacements of the joints alone.  With Z the matrix in
front of x_h, plus a complex spring i s at every joint that is subtracted again from r, Z never
becomes singular at a resonance, and the joints' displacements u = B^T x satisfy
du + (B^T Z^-1 B) (dr - i s du) = ... for every joint and harmonic.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.dynamics.vibration.periodic import Wave, lost_forces
from jbeamshell.dynamics.vibration.reduction import Reduced

SPLIT = 2.0  # s over the stiffness of a stuck joint, more than any joint can damp
MOST_ITERATIONS = 16
FAR = 0.3  # change of the frequency within a step, over it
LEAST_PART = 1.0 / 256.0  # of a step of a march
EXACT = 0.6  # power of the rounding unit to which Newton's steps are small


class Point(NamedTuple):
    """Point of a curve: x (H, r), complex; and (3,) numbers omega, lambda, xi."""

    x: Array
    p: Array


class Rows(NamedTuple):
    """Three conditions Re sum conj(x_i) x + p_i p = target_i: (3, H, r), (3, 3), (3,)."""

    x: Array
    p: Array
    target: Array


class Found(NamedTuple):
    """Solution of a balance.

    Attributes
    ----------
    point : where Newton's method ended
    converged : True if its last step is small
    lost : (H + 1, J) harmonics of the force that the elements lose by slip; the last one is beyond
        those of the balance
    """

    point: Point
    converged: Array
    lost: Array


class Balance(NamedTuple):
    """Harmonics of a balance, odd, and samples of a cycle."""

    harmonics: tuple[int, ...]
    samples: int

    @property
    def wave(self) -> Wave:
        """Table of the harmonics at the samples, with the first one that is left out."""
        return Wave(np.array([*self.harmonics, self.harmonics[-1] + 2]), self.samples)


def dynamic_stiffness(model: Reduced, omega: Any, xi: Any, harmonics: Any) -> Array:
    """Matrices (H, r, r) in front of x_h."""
    rate = (1j * jnp.asarray(harmonics) * omega)[:, None, None]
    return model.stiffness + rate * (model.damping - xi * model.mass) + rate**2 * model.mass


def lost_harmonics(model: Reduced, wave: Wave, u: Array) -> Array:
    """Harmonics (H + 1, J) of the force that elements lose in a motion u (H, J)."""
    return wave.coefficients(lost_forces(model.elements, wave, *wave.samples(u)))


def unbalanced(model: Reduced, balance: Balance, at: Point, lost: Array) -> Array:
    """Forces (H, r) that are not in balance."""
    omega, level, xi = at.p
    matrices = dynamic_stiffness(model, omega, xi, balance.harmonics)
    left = jnp.einsum("hij,hj->hi", matrices, at.x) + lost[:-1] @ model.directions.T
    return left.at[0].add(-level * model.drive)


def conditions(rows: Rows, at: Point) -> Array:
    """Left sides (3,) of the three conditions."""
    return jnp.real(jnp.einsum("qhr,hr->q", rows.x.conj(), at.x)) + rows.p @ at.p


def corrections(
    model: Reduced,
    balance: Balance,
    at: Point,
    rows: Rows,
    slopes: Array,
    sides: tuple[Array, Array],
) -> tuple[Point, Point]:
    """Newton's step, and the direction of the curve in which the third target grows.

    Parameters
    ----------
    slopes : (2H, H, J) derivatives of the lost forces, less the complex springs
    sides : forces (H, r) out of balance, and what the conditions (3,) lack
    """
    (omega, _, xi), (forces, short) = at.p, sides
    number = jnp.asarray(balance.harmonics)[:, None]
    count, joints = len(balance.harmonics), model.directions.shape[1]
    shift = (model.directions * (SPLIT * model.elements.stiffness)) @ model.directions.T
    matrices = dynamic_stiffness(model, omega, xi, balance.harmonics) + 1j * shift
    moved = at.x @ model.mass.T
    by_omega = 1j * number * (at.x @ model.damping.T - xi * moved) - 2.0 * number**2 * omega * moved
    by_level = jnp.zeros_like(at.x).at[0].set(-model.drive)
    by_xi = -1j * number * omega * moved
    loads = jnp.stack([forces, by_omega, by_level, by_xi], axis=-1)
    spread = jnp.broadcast_to(model.directions, (count, *model.directions.shape))
    solved = jnp.linalg.solve(matrices, jnp.concatenate([spread + 0j, loads], axis=-1))
    at_joints = jnp.einsum("rj,hrk->hjk", model.directions, solved)
    in_rows = jnp.einsum("qhr,hrk->qhk", rows.x.conj(), solved)
    parts = (joints, joints + 1)
    response, still, by_p = jnp.split(solved, parts, axis=-1)
    compliance, u_still, u_by_p = jnp.split(at_joints, parts, axis=-1)
    row_response, row_still, row_by_p = jnp.split(in_rows, parts, axis=-1)
    # Unknowns: real and imaginary parts of du for every harmonic and joint, then those of p.
    size = 2 * count * joints
    upper = _real(jnp.einsum("hjk,bhk->hjbk", compliance, slopes)).reshape(size, size)
    lower = -jnp.real(jnp.einsum("qhk,bhk->qbk", row_response, slopes)).reshape(3, size)
    corner = rows.p - jnp.real(jnp.sum(row_by_p, axis=1))
    right = _real(u_by_p).reshape(size, 3)
    matrix = jnp.block([[jnp.eye(size) + upper, right], [lower, corner]])
    step = jnp.append(-_real(u_still).ravel(), short + jnp.real(jnp.sum(row_still, axis=(1, 2))))
    growth = jnp.zeros_like(step).at[-1].set(1.0)
    found = _solve(matrix, jnp.stack([step, growth], axis=1), _sizes(model, at, size))
    change, p = found[:size].reshape(2 * count, joints, 2), found[size:]
    inner = jnp.einsum("bhk,bkc->hkc", slopes, change)
    x = -jnp.einsum("hrk,hkc->chr", response, inner) - jnp.einsum("hrp,pc->chr", by_p, p)
    return Point(x[0] - still[..., 0], p[:, 0]), Point(x[1], p[:, 1])


def slopes_of(model: Reduced, balance: Balance, at: Point) -> tuple[Array, Array]:
    """Lost forces (H + 1, J), and their derivatives (2H, H, J) less the complex springs.

    The derivatives are those to real and imaginary parts of the joints' displacements.
    """
    wave, u = balance.wave, at.x @ model.directions
    count = len(balance.harmonics)
    basis = jnp.concatenate([jnp.eye(count) + 0j, 1j * jnp.eye(count)])[..., None]

    def along(way: Array) -> tuple[Array, Array]:
        full = jnp.broadcast_to(way, u.shape).astype(u.dtype)
        lost, slope = jax.jvp(lambda part: lost_harmonics(model, wave, part), (u,), (full,))
        return lost, slope[:-1] - 1j * SPLIT * model.elements.stiffness * full

    lost, slopes = jax.vmap(along, out_axes=(None, 0))(basis)
    return lost, slopes


def _sizes(model: Reduced, at: Point, size: int) -> Array:
    """Sizes of the unknowns of a linear solve."""
    u = jnp.max(jnp.abs(at.x @ model.directions), initial=0.0)
    u = jnp.where(u > 0.0, u, 1.0)
    level = jnp.where(at.p[1] != 0.0, jnp.abs(at.p[1]), 1.0)
    return jnp.concatenate([jnp.full(size, u), jnp.stack([at.p[0], level, at.p[0]])])


def _solve(matrix: Array, sides: Array, sizes: Array) -> Array:
    """Solutions (m, c) of a linear system whose unknowns have the given sizes."""
    scaled = matrix * sizes
    most = jnp.max(jnp.abs(scaled), axis=1, keepdims=True)
    most = jnp.where(most > 0.0, most, 1.0)
    return sizes[:, None] * jnp.linalg.solve(scaled / most, sides / most)


def _real(values: Array) -> Array:
    """Real and imaginary parts (2, ...)."""
    return jnp.stack([jnp.real(values), jnp.imag(values)])


def newton(model: Reduced, balance: Balance, guess: Point, rows: Rows) -> tuple[Found, Point]:
    """Solution near a guess, and the direction of its curve in which the third target grows."""
    tolerance = jnp.finfo(guess.p.dtype).eps ** EXACT

    def goes_on(state: Any) -> Array:
        _, _, count, error = state
        return (error > tolerance) & (count < MOST_ITERATIONS) & jnp.isfinite(error)

    def improved(state: Any) -> Any:
        found, _, count, _ = state
        at = found.point
        lost, slopes = slopes_of(model, balance, at)
        sides = unbalanced(model, balance, at, lost), rows.target - conditions(rows, at)
        step, tangent = corrections(model, balance, at, rows, slopes, sides)
        new = Point(at.x + step.x, at.p + step.p)
        error = _relative(step, new)
        return Found(new, error <= tolerance, lost), tangent, count + 1, error

    count, joints = len(balance.harmonics), model.directions.shape[1]
    none = jnp.zeros((count + 1, joints), guess.x.dtype)
    begin = Found(guess, jnp.zeros((), bool), none)
    state = (begin, guess, jnp.zeros((), int), jnp.ones((), guess.p.dtype))
    found, tangent, _, _ = lax.while_loop(goes_on, improved, state)
    return found, tangent


solved = jax.jit(newton, static_argnums=1)


def _relative(step: Point, at: Point) -> Array:
    """Size of a step over that of a point; infinite if undefined."""
    size = jnp.linalg.norm(at.x)
    x = jnp.linalg.norm(step.x) / jnp.where(size > 0.0, size, 1.0)
    level = jnp.where(at.p[1] != 0.0, jnp.abs(at.p[1]), 1.0)
    scale = jnp.stack([jnp.abs(at.p[0]), level, jnp.abs(at.p[0])])
    error = jnp.maximum(x, jnp.max(jnp.abs(step.p) / scale))
    return jnp.where(jnp.isfinite(error) & (at.p[0] > 0.0), error, jnp.inf)


@partial(jax.jit, static_argnums=1)
def marched(
    model: Reduced, balance: Balance, start: Point, rows: Rows, targets: Array, before: ArrayLike
) -> Found:
    """Solutions (k, ...) at third targets (k,), each from the one before.

    The guess ``start`` is nearly a solution at the target ``before``.  Steps without convergence
    or with a far frequency are halved.
    """

    def reach(state: tuple[Found, Array], target: Array) -> Any:
        begin, before = state

        def goes_on(inner: Any) -> Array:
            _, part, step = inner
            return (part < 1.0) & (step >= LEAST_PART)

        def tried(inner: Any) -> Any:
            now, part, step = inner
            aim = jnp.minimum(part + step, 1.0)
            value = before + aim * (target - before)
            growth = value / (before + part * (target - before))
            guess = Point(growth * now.point.x, now.point.p.at[1].multiply(growth))
            wanted = rows._replace(target=rows.target.at[2].set(value))
            new, _ = newton(model, balance, guess, wanted)
            # A far solution lies on another branch, such as that of another mode.
            moved = jnp.abs(new.point.p[0] - now.point.p[0])
            good = new.converged & (moved <= FAR * jnp.abs(now.point.p[0]))
            kept = jax.tree.map(lambda a, b: jnp.where(good, a, b), new, now)
            return kept, jnp.where(good, aim, part), jnp.where(good, 2.0 * step, 0.5 * step)

        one = jnp.ones((), targets.dtype)
        found, part, _ = lax.while_loop(goes_on, tried, (begin, 0.0 * one, one))
        done = part >= 1.0
        return (found, jnp.where(done, target, before)), found._replace(converged=done)

    none = jnp.zeros((len(balance.harmonics) + 1, model.directions.shape[1]), start.x.dtype)
    first = Found(start, jnp.zeros((), bool), none), jnp.asarray(before, targets.dtype)
    _, found = lax.scan(reach, first, targets)
    return found


@partial(jax.jit, static_argnums=1)
def polished(model: Reduced, balance: Balance, found: Found, rows: Rows, targets: Array) -> Found:
    """Solutions (k, ...) with their derivatives, by the theorem of implicit functions.

    A last step of Newton's method, whose matrix is held fixed, leaves the values as they are and
    brings the derivatives to the model, the conditions and their third targets (k,).
    """
    fixed, held, points = lax.stop_gradient((model, rows, found.point))

    def one(at: Point, target: Array) -> tuple[Point, Array]:
        _, slopes = slopes_of(fixed, balance, at)
        lost = lost_harmonics(model, balance.wave, at.x @ model.directions)
        wanted = rows.target.at[2].set(target)
        sides = unbalanced(model, balance, at, lost), wanted - conditions(rows, at)
        step, _ = corrections(fixed, balance, at, held, slopes, sides)
        exact = Point(at.x + step.x, at.p + step.p)
        return exact, lost_harmonics(model, balance.wave, exact.x @ model.directions)

    points, lost = jax.vmap(one)(points, targets)
    return Found(points, found.converged, lost)


def left_out(model: Reduced, balance: Balance, omega: Any, u: Any, lost: Any) -> Any:
    """Displacements (k,) of the elements in the next harmonic, over those in the first.

    Parameters
    ----------
    omega, u, lost : (k,) frequencies, (k, H, J) displacements, (k, H + 1, J) lost forces
    """
    shift = 1j * (model.directions * (SPLIT * model.elements.stiffness)) @ model.directions.T
    after = jnp.asarray(balance.wave.harmonics[-1])
    rate = (1j * after * omega)[:, None, None]
    matrices = model.stiffness + shift + rate * model.damping + rate**2 * model.mass
    loads = lost[:, -1] @ model.directions.T
    moved = jnp.linalg.solve(matrices, loads[..., None])[..., 0] @ model.directions
    largest = jnp.max(jnp.abs(u[:, 0]), axis=1, initial=0.0)
    return jnp.max(jnp.abs(moved), axis=1, initial=0.0) / jnp.where(largest > 0.0, largest, 1.0)
