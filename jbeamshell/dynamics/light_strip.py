"""Mass on a strip without inertia, let go: free vibration on the sliders of its joint.

The sliders of a joint may lie side by side or, as here, one behind the other: a slider with the
limit F_i has a spring of compliance c_i beside it, and adds c_i (F - F_i) to the displacement.
From one turn to the next the displacement has moved by xi(q) on the piecewise line of their branch,
with q the change of the force since the turn, a the force there, and S_j the compliance between the
corners j and j + 1:

    m xi'' = a - q,      q = a - R_j cos(theta),    theta' = 1/sqrt(m S_j),
    m xi'^2/2 = E = E_j + S_j ((a - q_j)^2 - (a - q)^2)/2,    R_j^2 = (a - q_j)^2 + 2 E_j/S_j.

The corners' energies are a sum, the mass turns where E = 0, and the times are arcs: there are no
time steps, and no error in time.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.dynamics.strip.motion import EndMotion
from jbeamshell.dynamics.structure.joint import Joint
from jbeamshell.scene.scene import Scene

SOFTENS = 1e-9  # compliance over the first one, below which a slider adds none


class Series(NamedTuple):
    """Sliders in series under a force, each beside a spring of its own, and a spring.

    Attributes
    ----------
    compliance : of the spring, 1/k_0
    added : (k,) compliance c_i of the spring beside each slider
    limits : (k,) forces F_i at which the sliders slip, rising
    """

    compliance: Array
    added: Array
    limits: Array

    @classmethod
    def of(cls, joint: Joint) -> Series:
        """Sliders of a joint's backbone; a joint along which nothing slips has none."""
        u, f = (np.asarray(points) for points in joint.below_gross_slip)
        slopes = np.diff(u, prepend=0.0) / np.diff(f, prepend=0.0)
        added = np.diff(slopes)
        softer = added > SOFTENS * slopes[0]
        return cls(*map(jnp.asarray, (slopes[0], added[softer], f[:-1][softer])))


class State(NamedTuple):
    """State of sliders in series: the force, and what each slider has slipped, (k,)."""

    force: Array
    slips: Array


class Branch(NamedTuple):
    """Branch of a force that changes one way, with k + 1 corners.

    Attributes
    ----------
    force : (k + 1,) changes of force at the corners, from 0
    compliance : (k + 1,) slopes of the displacement after each corner
    """

    force: Array
    compliance: Array


def branch_of(series: Series, start: State, sense: Array) -> Branch:
    """Branch of a sense (1 or -1) that starts with a state."""
    held = start.force - start.slips / series.added  # by each slider
    force = jnp.append(0.0, lax.cummax(series.limits - sense * held))
    return Branch(force, series.compliance + jnp.append(0.0, jnp.cumsum(series.added)))


def after(
    series: Series, start: State, branch: Branch, sense: Array, change: Array
) -> tuple[State, Array]:
    """State after a change of force, positive, along a branch; work of friction until then."""
    slipped = series.added * jnp.maximum(change - branch.force[1:], 0.0)
    end = State(start.force + sense * change, start.slips + sense * slipped)
    return end, jnp.sum(series.limits * slipped)


class Swing(NamedTuple):
    """Motion from one turn to the next, k + 1 corners; those beyond its end have its values.

    Attributes
    ----------
    start : sliders at its start
    sense : 1 where the displacement grows, -1 where it falls
    work : work of friction until its start
    branch : branch of the sliders that it follows
    begin : time of its start
    times : (k + 1,) times of the corners since its start
    angles : (k + 1,) theta at the corners
    radii : (k + 1,) R after the corners
    last : number of the last corner that it passes
    duration : time until its end
    reach : change of the force until then
    """

    start: State
    sense: Array
    work: Array
    branch: Branch
    begin: Array
    times: Array
    angles: Array
    radii: Array
    last: Array
    duration: Array
    reach: Array


def swings(series: Series, mass: Array, pull: Array, count: int) -> Swing:
    """Swings of a mass that is pulled with a force and let go, stacked along the first axis."""
    rest = State(jnp.zeros_like(pull), jnp.zeros_like(series.added))
    way = jnp.sign(pull)
    pulled, _ = after(series, rest, branch_of(series, rest, way), way, jnp.abs(pull))

    def go(carry: tuple[State, Array, Array], _: None) -> tuple[tuple[State, Array, Array], Swing]:
        start, begin, lost = carry
        sense = -jnp.sign(start.force)
        branch = branch_of(series, start, sense)
        swing = _swing(branch, start, sense, mass)._replace(begin=begin, work=lost)
        end, work = after(series, start, branch, sense, swing.reach)
        return (end, begin + swing.duration, lost + work), swing

    zero = jnp.zeros_like(pull)
    return lax.scan(go, (pulled, zero, zero), None, length=count)[1]


def _swing(branch: Branch, start: State, sense: Array, mass: Array) -> Swing:
    """Swing from a turn to the next."""
    compliance = branch.compliance
    left = jnp.abs(start.force) - branch.force
    gained = 0.5 * compliance[:-1] * (left[:-1] ** 2 - left[1:] ** 2)
    energy = jnp.append(0.0, jnp.cumsum(gained))
    passed = jnp.cumprod(jnp.append(True, (energy > 0.0)[1:] | (left[1:] >= 0.0))).astype(bool)
    last = jnp.sum(passed) - 1
    kinetic = jnp.where(passed & (energy > 0.0), energy, 0.0)
    speed, arrival = _root(2.0 * kinetic / compliance), _root(2.0 * kinetic[1:] / compliance[:-1])
    radii = _root(left**2 + 2.0 * kinetic / compliance)
    angles, ends = jnp.arctan2(speed, left), jnp.arctan2(arrival, left[1:])
    ends = jnp.where(jnp.arange(left.size) == last, jnp.pi, jnp.append(ends, jnp.pi))
    durations = jnp.where(passed, (ends - angles) * jnp.sqrt(mass * compliance), 0.0)
    times = jnp.cumsum(durations)
    zero = jnp.zeros_like(start.force)
    return Swing(
        start=start,
        sense=sense,
        work=zero,
        branch=branch,
        begin=zero,
        times=times - durations,
        angles=angles,
        radii=radii,
        last=last,
        duration=times[-1],
        reach=jnp.abs(start.force) + radii[last],
    )


def _root(values: Array) -> Array:
    """Square roots of values that may be 0, with slopes of 0 there."""
    positive = values > 0.0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, values, 1.0)), 0.0)


def _moment(series: Series, mass: Array, passed: Swing, time: Array) -> tuple[Array, ...]:
    """Displacement, velocity, stored energy and work of friction at a time."""
    which = jnp.searchsorted(passed.begin, time, side="right") - 1
    swing = jax.tree.map(lambda a: a[which], passed)
    since = time - swing.begin
    corner = jnp.searchsorted(swing.times, since, side="right") - 1
    corner = jnp.minimum(corner, swing.last)
    compliance, radius = swing.branch.compliance[corner], swing.radii[corner]
    rate = 1.0 / jnp.sqrt(mass * compliance)
    angle = swing.angles[corner] + (since - swing.times[corner]) * rate
    reach = jnp.abs(swing.start.force) - radius * jnp.cos(angle)
    end, work = after(series, swing.start, swing.branch, swing.sense, reach)
    velocity = swing.sense * compliance * radius * rate * jnp.sin(angle)
    displacement = series.compliance * end.force + jnp.sum(end.slips)
    stored = 0.5 * (series.compliance * end.force**2 + jnp.sum(end.slips**2 / series.added))
    return displacement, velocity, stored, swing.work + work


class LightMotion(EndMotion):
    """Motion of a mass on a strip without inertia.

    Attributes
    ----------
    swings : number of swings that were begun
    """

    swings: int

    def figures(self) -> dict[str, Any]:
        """Summary by name, in numbers and words that JSON takes."""
        return super().figures() | {"swings": int(self.swings)}


def ring(
    scene: Scene, joint: Joint, payload: float, pull: float, cycles: float, samples: int
) -> LightMotion:
    """Motion of a mass that is pulled with a force and let go.

    Parameters
    ----------
    scene, joint : strip, and the joint in its place
    payload, pull : mass and force per width
    cycles : span, in periods of the stuck strip
    samples : number of times
    """
    numbers = np.array([payload, pull, cycles])
    count = math.ceil(2.0 * cycles) + 1  # a swing lasts no less than that of the stuck strip
    columns, swung = jax.device_get(_run(Series.of(joint), numbers, samples, count))
    time, displacement, velocity, kinetic, stored, friction_work = columns
    none: Any = np.zeros(samples)
    return LightMotion(
        time=time,
        displacement=displacement,
        velocity=velocity,
        force=none,
        kinetic=kinetic,
        stored=stored,
        external_work=none,
        friction_work=friction_work,
        damping_work=none,
        scene=scene,
        payload=payload,
        swings=swung,
    )


@functools.partial(jax.jit, static_argnums=(2, 3))
def _run(
    series: Series, numbers: ArrayLike, samples: int, count: int
) -> tuple[tuple[Array, ...], Array]:
    """Columns (T,) of the motion, and number of swings begun."""
    mass, pull, cycles = jnp.asarray(numbers)
    period = 2.0 * jnp.pi * jnp.sqrt(mass * series.compliance)
    times = jnp.linspace(0.0, 1.0, samples) * (cycles * period)
    passed = swings(series, mass, pull, count)
    u, rate, stored, work = lax.map(lambda t: _moment(series, mass, passed, t), times)
    return (times, u, rate, 0.5 * mass * rate**2, stored, work), jnp.sum(passed.begin < times[-1])
