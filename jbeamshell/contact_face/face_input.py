"""Input of a contact of bodies on a face: what `jbeamshell.solve_faces` refuses, and its path."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import (
    as_leaf,
    is_traced,
    require,
    require_count,
    require_finite,
    require_number,
)
from jbeamshell.contact_face.body import FaceBody
from jbeamshell.contact_face.surface import MATCH
from jbeamshell.scene.parts import unit_path

MOST_CYCLES = 16  # until the loop is steady


def check_bodies(upper: FaceBody, lower: FaceBody | None) -> None:
    """Refuse what is no body, faces that do not match, and bodies that nothing pulls."""
    for key, body in (("upper", upper), ("lower", lower)):
        fits = isinstance(body, FaceBody) or (body is None and key == "lower")
        require(key, type(body).__name__, fits, "give a jbeamshell.FaceBody")
    if lower is not None and not is_traced(upper, lower):
        places, below = np.asarray(upper.places), np.asarray(lower.places)
        same = places.shape == below.shape
        fix = "must have the nodes of the upper face, in the same order"
        require("lower.places", below.shape, same, fix)
        apart = np.linalg.norm(places - below, axis=1)
        worst = int(np.argmax(apart))
        near = apart[worst] <= MATCH * np.max(np.ptp(places, axis=0))
        require("lower.places", f"node {worst}, {apart[worst]:.3g} away", bool(near), fix)
        turned = np.max(np.abs(np.asarray(upper.normals) - np.asarray(lower.normals)))
        fix = "must be those of the upper face, from the body below to the one above"
        require("lower.normals", f"{turned:.3g} off", bool(turned < MATCH), fix)
    bodies = [body for body in (upper, lower) if body is not None]
    pulls = [body.forces[:, 0] for body in bodies] + [body.flexibility[0] for body in bodies]
    pulled = is_traced(pulls) or any(bool(np.any(np.asarray(pull))) for pull in pulls)
    require("pull", 0, pulled, "nothing pulls the bodies: condense one with pull=")


def load_path(
    amplitude: ArrayLike,
    cycles: int | None,
    steps_per_half_cycle: int,
    path: ArrayLike | None,
    sizes: Array,
) -> Array:
    """Loads (levels + 1, m): the pressing first."""
    pressing = jnp.append(0.0, sizes)
    if path is None:
        require_number("amplitude", amplitude)
        if cycles is not None:
            require_count("cycles", cycles, 1)
        require_count("steps_per_half_cycle", steps_per_half_cycle, 8)
        fix = "take a multiple of 4: every second step estimates the error"
        require("steps_per_half_cycle", steps_per_half_cycle, steps_per_half_cycle % 4 == 0, fix)
        targets = as_leaf(amplitude) * jnp.asarray(
            unit_path(cycles or MOST_CYCLES, steps_per_half_cycle)
        )
    else:
        targets = as_leaf(path, "path")
        require_finite("path", targets)
    fix = f"give (levels,) loads to and fro, or (levels, {pressing.size}) of all loads"
    both = targets.ndim in (1, 2) and targets.size > 0
    require("path", targets.shape, both, fix)
    if targets.ndim == 1:
        targets = targets[:, None] * jnp.eye(1, pressing.size) + pressing
    require("path", targets.shape, targets.shape[1] == pressing.size, fix)
    return jnp.concatenate([pressing[None], targets])


def checked_distance(upper: FaceBody, gap: ArrayLike) -> Array:
    """Gap (n,) of the pairs."""
    n = upper.areas.size
    distance = as_leaf(gap, "gap")
    fix = f"give a number, or one for each of {n} nodes"
    require("gap", gap, distance.shape in ((), (n,)), fix)
    _require_not_negative("gap", distance)
    return jnp.broadcast_to(distance, (n,))


def checked_softness(upper: FaceBody, softness: ArrayLike) -> Array:
    """Displacement per force (n, 3) of the surfaces at each pair, along tangents and normal."""
    soft = as_leaf(softness, "softness")
    fix = "give a number, or a tangential and a normal one"
    require("softness", softness, soft.shape in ((), (2,)), fix)
    _require_not_negative("softness", soft)
    return jnp.broadcast_to(soft, (2,))[np.array([0, 0, 1])] / upper.areas[:, None]


def checked_roughness(upper: FaceBody, roughness: ArrayLike) -> Array:
    """Height h and force F_0 (n, 2) of the surfaces at each pair."""
    rough = as_leaf(roughness, "roughness")
    if rough.ndim == 0 and not is_traced(rough) and float(rough) == 0.0:
        rough = jnp.array([0.0, 1.0])
    require("roughness", roughness, rough.shape == (2,), "give 0, or a height and a pressure")
    _require_not_negative("roughness", rough)
    fix = "needs a pressure above 0: that at which surfaces are twice as stiff as at first touch"
    require("roughness", roughness, is_traced(rough) or bool(rough[1] > 0.0), fix)
    areas = upper.areas[:, None]
    return jnp.broadcast_to(rough, (areas.size, 2)) * jnp.concatenate([areas**0, areas], axis=1)


def _require_not_negative(key: str, value: Array) -> None:
    require_finite(key, value)
    fine = is_traced(value) or bool(np.all(np.asarray(value) >= 0.0))
    require(key, value, fine, "must not be negative")
