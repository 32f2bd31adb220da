"""Stations of a strip along its contact line: where its nodes lie."""

from __future__ import annotations

from jax import Array

from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.mechanics import elements
from jbeamshell.scene.scene import Scene

PLANE_END_SIZE = 1e-4  # of H, the element at the loaded end
PLANE_GROWTH = 0.2  # of the element size over the distance from there
PLANE_SMALL_GROWTH = 0.5  # the same near the corner, where stresses are singular
PLANE_FAR_SIZE = 0.07  # of L, elements away from it
STEP_SIZE = 0.05  # of H, elements at a step of the pressure


def stations(scene: Scene, nodes: int) -> Array:
    """Stations (nodes,) along X: those of load steps, or of plane elasticity.

    The latter are denser at the singular loaded corner and at steps of the pressure.
    """
    length, half_height = scene.strip.length, scene.strip.half_height
    steps, plan = scene.contact.steps(length), scene.plan
    if scene.member.support != "none":
        return _joint_stations(scene, nodes)
    if not plan.elastic:
        grading = (plan.end_size, steps, elements.GROWTH, plan.far_size, plan.small_growth)
        return elements.vertices(nodes - 1, length, half_height, *grading)
    if steps is None:
        return _plane_vertices(scene, nodes, PLANE_END_SIZE, None, PLANE_GROWTH)
    xp = numbers_of(steps)
    inside = xp.append(steps < length, False)
    sizes = xp.where(inside, STEP_SIZE, PLANE_END_SIZE)
    growths = xp.where(inside, elements.GROWTH, PLANE_GROWTH)
    return _plane_vertices(scene, nodes, sizes, steps, growths)


def _joint_stations(scene: Scene, nodes: int) -> Array:
    """Stations of a lap joint, denser at its ends and at steps of the pressure."""
    length, half_height = scene.strip.length, scene.strip.half_height
    steps, plan, xp = scene.contact.steps(length), scene.plan, numbers_of(length)
    none = xp.zeros(0, length.dtype) if steps is None else steps
    foci = xp.append(0.0 * length, none)
    if not plan.elastic:
        grading = (plan.end_size, foci, elements.GROWTH, plan.far_size, plan.small_growth)
        return elements.vertices(nodes - 1, length, half_height, *grading)
    ends = xp.append(xp.append(True, ~(none < length)), True)
    sizes = xp.where(ends, PLANE_END_SIZE, STEP_SIZE)
    growths = xp.where(ends, PLANE_GROWTH, elements.GROWTH)
    return _plane_vertices(scene, nodes, sizes, foci, growths)


def _plane_vertices(
    scene: Scene, nodes: int, sizes: Array | float, foci: Array | None, growths: Array | float
) -> Array:
    """Stations of plane elasticity, which has small elements in singular corners."""
    grading = (sizes, foci, growths, PLANE_FAR_SIZE, PLANE_SMALL_GROWTH)
    length, half_height = scene.strip.length, scene.strip.half_height
    return elements.vertices(nodes - 1, length, half_height, *grading)
