"""Dynamics of a chain of attached masses, at an instant and in a time step."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from jbeamshell.dynamics.strip.attached_masses import AttachedMasses
from jbeamshell.dynamics.strip.time_step import TimeStep


class ChainResponse(NamedTuple):
    """Response of a chain at an instant.

    Attributes
    ----------
    force : force on the loaded end
    accelerations : (k,) accelerations of the masses over a foundation that does not move
    damping_power : power lost in the dashpots
    """

    force: Array
    accelerations: Array
    damping_power: Array


class ChainStep(NamedTuple):
    """Response of a chain in a time step, linear in the increment of u(L).

    Attributes
    ----------
    force, force_slope : force on the loaded end without an increment, and its slope
    change, change_slope : (k,) increments of the masses' displacements, and their slopes
    """

    force: Array
    force_slope: Array
    change: Array
    change_slope: Array


def stretches(end: Array, chain: Array) -> Array:
    """Stretches (k,) of the springs, from u(L) and the displacements (k,) of the masses."""
    return jnp.diff(jnp.append(end, chain))


def spring_forces(attached: AttachedMasses, stretch: Array, rate: Array) -> Array:
    """Forces (k,) in springs and dashpots from their stretch and its rate; tension is positive."""
    return attached.springs * stretch + attached.dampers * rate


def net_forces(springs: Array) -> Array:
    """Forces (k,) on the masses, each between its spring and the next one."""
    return jnp.append(springs[1:], jnp.zeros(min(springs.size, 1))) - springs


def chain_response(
    attached: AttachedMasses, end: tuple[Array, Array], chain: tuple[Array, Array]
) -> ChainResponse:
    """Response from the displacement and rate of the loaded end and (k,) of the masses."""
    rate = stretches(end[1], chain[1])
    springs = spring_forces(attached, stretches(end[0], chain[0]), rate)
    return ChainResponse(
        force=jnp.sum(springs[:1]),
        accelerations=net_forces(springs) / attached.masses,
        damping_power=jnp.sum(attached.dampers * rate**2),
    )


def chain_step(
    attached: AttachedMasses,
    step: TimeStep,
    end: Array,
    chain: tuple[Array, Array],
    last: tuple[Array, Array],
    ground: Array,
) -> ChainStep:
    """Response in a time step.

    Parameters
    ----------
    attached : masses and springs
    step : time step
    end : u(L) at z*, if the loaded end does not move in the step
    chain : (k,) displacements and rates at the start of the step
    last : (k,) their increments in the last step
    ground : mean acceleration of the foundation along X
    """
    (z, rate), (last_change, last_rate_change) = chain, last
    zero, no_change = jnp.zeros_like(end), jnp.zeros_like(z)
    if not attached.count:
        return ChainStep(zero, zero, z, z)

    def springs(change: Array, end_change: Array) -> Array:
        stretch = stretches(end + step.weight * end_change, step.evaluated(z, change, last_change))
        return spring_forces(attached, stretch, stretches(end_change, change) / step.h)

    def residual(change: Array, end_change: Array) -> Array:
        rate_change = step.increment(change / step.h, rate, last_rate_change)
        inertia = attached.masses * (rate_change / step.h + ground)
        return inertia - net_forces(springs(change, end_change))

    matrix = jax.jacfwd(residual)(no_change, zero)
    constant = residual(no_change, zero)
    change = -jnp.linalg.solve(matrix, constant)
    change_slope = -jnp.linalg.solve(matrix, residual(no_change, zero + 1.0) - constant)
    force = springs(change, zero)[0]
    slope = springs(change + change_slope, zero + 1.0)[0] - force
    return ChainStep(force, slope, change, change_slope)


def chain_energies(
    attached: AttachedMasses, end: Array, chain: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Kinetic energy of the masses and energy of the springs, per width; see `chain_response`."""
    kinetic = 0.5 * jnp.sum(attached.masses * chain[1] ** 2)
    return kinetic, 0.5 * jnp.sum(attached.springs * stretches(end, chain[0]) ** 2)
