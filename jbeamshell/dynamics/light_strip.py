"""Mass on a strip without inertia, let go: free vibration on the strip's network of sliders.

From one turn to the next the displacement has moved by xi(q) on the piecewise line of the network's
branch, with q the change of the force since the turn, a the force there, and S_j the compliance
between the corners j and j + 1:

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

from jbeamshell.contact_line.branches import ContactState
from jbeamshell.contact_line.network import Network, Sliders
from jbeamshell.dynamics.strip.motion import EndMotion
from jbeamshell.scene.scene import Scene


class Swing(NamedTuple):
    """Motion from one turn to the next, k + 1 corners; those beyond its end have its values.

    Attributes
    ----------
    start : contact at its start
    sense : 1 where the displacement grows, -1 where it falls
    work : work of friction until its start
    sliders : network of its branch
    begin : time of its start
    times : (k + 1,) times of the corners since its start
    angles : (k + 1,) theta at the corners
    radii : (k + 1,) R after the corners
    last : number of the last corner that it passes
    duration : time until its end
    reach : change of the force until then
    valid : True if all slip zones until its end were nested
    """

    start: ContactState
    sense: Array
    work: Array
    sliders: Sliders
    begin: Array
    times: Array
    angles: Array
    radii: Array
    last: Array
    duration: Array
    reach: Array
    valid: Array


def swings(network: Network, mass: Array, pull: Array, count: int) -> Swing:
    """Swings of a mass that is pulled with a force and let go, stacked along the first axis."""

    def go(
        carry: tuple[ContactState, Array, Array, Array], pulled: Array
    ) -> tuple[tuple[ContactState, Array, Array, Array], Swing]:
        start, begin, lost, known = carry
        sense = jnp.where(pulled, jnp.sign(pull), -jnp.sign(start.force))
        swing = _swing(network.sliders(start, sense), start, sense, mass)
        turn = jnp.where(pulled, pull, start.force + sense * swing.reach)
        end, work, valid = network.branch(start, turn)
        swing = swing._replace(begin=begin, work=lost, valid=known & valid)
        after = begin + swing.duration, lost + work
        begin, lost = (jnp.where(pulled, 0.0, value) for value in after)
        return (end, begin, lost, swing.valid), swing

    zero, pulled = jnp.zeros_like(pull), jnp.arange(count + 1) == 0
    found = lax.scan(go, (network.rest, zero, zero, jnp.asarray(True)), pulled)[1]
    return jax.tree.map(lambda each: each[1:], found)


def _swing(sliders: Sliders, start: ContactState, sense: Array, mass: Array) -> Swing:
    """Swing from a turn to the next."""
    compliance = sliders.compliance
    left = jnp.abs(start.force) - sliders.force
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
        sliders=sliders,
        begin=zero,
        work=zero,
        times=times - durations,
        angles=angles,
        radii=radii,
        last=last,
        duration=times[-1],
        reach=jnp.abs(start.force) + radii[last],
        valid=jnp.asarray(True),
    )


def _root(values: Array) -> Array:
    """Square roots of values that may be 0, with slopes of 0 there."""
    positive = values > 0.0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, values, 1.0)), 0.0)


def _moment(network: Network, mass: Array, passed: Swing, time: Array) -> tuple[Array, ...]:
    """Displacement, velocity, stored energy, work of friction and validity at a time."""
    which = jnp.searchsorted(passed.begin, time, side="right") - 1
    swing = jax.tree.map(lambda a: a[which], passed)
    since = time - swing.begin
    corner = jnp.searchsorted(swing.times, since, side="right") - 1
    corner = jnp.minimum(corner, swing.last)
    compliance, radius = swing.sliders.compliance[corner], swing.radii[corner]
    rate = 1.0 / jnp.sqrt(mass * compliance)
    angle = swing.angles[corner] + (since - swing.times[corner]) * rate
    reach = jnp.abs(swing.start.force) - radius * jnp.cos(angle)
    end, work, _ = network.branch(swing.start, swing.start.force + swing.sense * reach)
    velocity = swing.sense * compliance * radius * rate * jnp.sin(angle)
    return end.displacement, velocity, network.stored(end), swing.work + work, swing.valid


class LightMotion(EndMotion):
    """Motion of a mass on a strip without inertia.

    Attributes
    ----------
    swings : number of swings that were begun
    nested : True if the strip's slip zones were nested all the time; otherwise the motion is wrong
    """

    swings: int
    nested: bool

    def figures(self) -> dict[str, Any]:
        """Summary by name, in numbers and words that JSON takes."""
        return super().figures() | {"swings": int(self.swings)}


def ring(
    scene: Scene, network: Network, payload: float, pull: float, cycles: float, samples: int
) -> LightMotion:
    """Motion of a mass that is pulled with a force and let go.

    Parameters
    ----------
    scene, network : strip and its sliders
    payload, pull : mass and force per width
    cycles : span, in periods of the stuck strip
    samples : number of times
    """
    numbers = np.array([payload, pull, cycles])
    count = math.ceil(2.0 * cycles) + 1  # a swing lasts no less than that of the stuck strip
    columns, swung, nested = jax.device_get(_run(network, numbers, samples, count))
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
        nested=nested,
    )


@functools.partial(jax.jit, static_argnums=(2, 3))
def _run(
    network: Network, numbers: ArrayLike, samples: int, count: int
) -> tuple[tuple[Array, ...], Array, Array]:
    """Columns (T,) of the motion, number of swings begun, and True if all zones were nested."""
    mass, pull, cycles = jnp.asarray(numbers)
    period = 2.0 * jnp.pi * jnp.sqrt(mass * network.body.c)
    times = jnp.linspace(0.0, 1.0, samples) * (cycles * period)
    passed = swings(network, mass, pull, count)
    u, rate, stored, work, valid = lax.map(lambda t: _moment(network, mass, passed, t), times)
    columns = times, u, rate, 0.5 * mass * rate**2, stored, work
    return columns, jnp.sum(passed.begin < times[-1]), jnp.all(valid)
