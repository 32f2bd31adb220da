"""Input of a contact of bodies: what `jbeamshell.solve_contact` refuses before it solves."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.bodies.contact_points import ContactPoints, check_match
from jbeamshell.bodies.substructure import Substructure, loose_mode
from jbeamshell.common.checks import (
    as_leaf,
    is_traced,
    require,
    require_count,
    require_finite,
)
from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.scene.parts import unit_path

LEAST_STEPS = 8  # per half cycle on a face
PRESS = "turn the forces of its table of press instead"


class Problem(NamedTuple):
    """Contact of bodies, checked.

    Attributes
    ----------
    upper, lower : bodies; lower is None on a rigid base
    face : contact points of a face; None on a line
    friction : mu, () or, on a face, (q,) of the contact points
    gap : (n,) of the nodes, on a face (q,), before anything presses
    softness, roughness : (q, 2) of the surfaces of a face, tangential and normal displacement per
        force, and h and F_0
    loads : (levels + 1, m) load to and fro, then the pressing ones; the pressing alone comes first
    unit : (levels,) loads of the problem's cycles over their amplitude; None for a path of its own
    control, assembly, points : as `jbeamshell.solve_contact` takes them
    half : load steps per half cycle of a path that goes on until it is steady, else None
    """

    upper: Substructure
    lower: Substructure | None
    face: ContactPoints | None
    friction: Array
    gap: Array
    softness: Array
    roughness: Array
    loads: Array
    unit: np.ndarray | None
    control: str
    assembly: str
    points: bool
    half: int | None


def check_bodies(upper: Substructure, lower: Substructure | None) -> None:
    """Refuse what is no body, bodies that do not match, and those that nothing holds or pulls."""
    for key, body in (("upper", upper), ("lower", lower)):
        fits = isinstance(body, Substructure) or (body is None and key == "lower")
        require(key, type(body).__name__, fits, "give a jbeamshell.Substructure")
    if lower is not None:
        said = "another kind of contact"
        fix = "the upper body touches on a line, or this one does: give both a line, or a face"
        require("lower.places", said, upper.on_face == lower.on_face, fix)
        if not upper.on_face:
            check_match(upper, lower)
            _check_held(upper, lower)
    bodies = [body for body in (upper, lower) if body is not None]
    pulls = [body.forces[:, 0] for body in bodies] + [body.flexibility[0] for body in bodies]
    pulled = is_traced(pulls) or any(bool(np.any(np.asarray(pull))) for pull in pulls)
    require("pull", 0, pulled, "nothing pulls the bodies: condense one with pull=")


def _check_held(upper: Substructure, lower: Substructure) -> None:
    """Refuse two bodies on a line that move together without energy."""
    if is_traced(upper, lower):
        return
    fixed = np.array(upper.fixed) | np.array(lower.fixed)  # the bodies stuck to each other
    k = np.asarray(upper.stiffness + lower.stiffness)
    k = np.where(fixed | fixed[:, None], 0.0, k) + np.diag(fixed * np.max(k))
    mode = loose_mode(upper, k)
    fix = f"{mode} with the other one: hold one of them by a support"
    require("lower", "loose body", not mode, fix)


def held_nodes(upper: Substructure, lower: Substructure | None) -> tuple[bool, ...]:
    """True for nodes (n,) of a line that cannot slip, because supports hold both sides."""
    fixed = np.array(upper.fixed).reshape(-1, 2)
    if lower is not None:
        fixed = fixed & np.array(lower.fixed).reshape(-1, 2)
    first = int(np.argmax(fixed[:, 1]))
    fix = "holds the normal direction of both sides: leave this node out of the contact"
    require(f"contact[{first}]", "a support", not fixed[:, 1].any(), fix)
    fix = "hold the tangential direction of both sides everywhere: leave one of them free"
    require("contact", "supports", not fixed[:, 0].all(), fix)
    return tuple(fixed[:, 0].tolist())


def as_number(value: ArrayLike, key: str) -> Any:
    """Floating-point array of NumPy, or of JAX if it is traced; see `as_leaf`."""
    leaf = as_leaf(value, key)
    return leaf if is_traced(leaf) else np.asarray(leaf)


def checked_bolts(upper: Substructure, lower: Substructure | None, bolts: ArrayLike) -> Array:
    """Size of each pressing load, (m - 1,)."""
    count = upper.bolts if lower is None else max(upper.bolts, lower.bolts)
    require("bolts", 0, count > 0, "nothing presses the bodies together: condense one with press=")
    for key, body in (("upper.press", upper), ("lower.press", lower)):
        if body is not None:
            fix = f"give {count} in both bodies, or none in one of them"
            require(key, body.bolts, body.bolts in (0, count), fix)
    sizes = as_number(bolts, "bolts")
    fix = f"give a number, or one for each of {count} presses"
    require("bolts", bolts, sizes.shape in ((), (count,)), fix)
    _require_not_negative("bolts", bolts, sizes, PRESS)
    found: Array = numbers_of(sizes).broadcast_to(sizes, (count,))
    return found


def checked_gap(upper: Substructure, face: ContactPoints | None, gap: ArrayLike) -> Array:
    """Gap (n,) of the nodes of a line, or (q,) of the contact points of a face."""
    n = upper.places.shape[0]
    distance = as_number(gap, "gap")
    fix = f"give a number, or one for each of {n} nodes"
    require("gap", gap, distance.shape in ((), (n,)), fix)
    _require_not_negative("gap", gap, distance, "bodies cannot overlap before anything presses")
    distance = numbers_of(distance).broadcast_to(distance, (n,))
    found: Array = distance if face is None else face.upper.of(distance)
    return found


def checked_friction(upper: Substructure, face: ContactPoints | None, friction: ArrayLike) -> Array:
    """Coulomb's coefficient, () or, on a face, (q,)."""
    value, n = as_number(friction, "friction"), upper.places.shape[0]
    shapes = ((), (n,)) if upper.on_face else ((),)
    fix = f"give a number, or one for each of {n} nodes" if upper.on_face else "give one number"
    require("friction", friction, value.shape in shapes, fix)
    _require_not_negative("friction", friction, value)
    found: Array = face.upper.of(value) if face is not None and value.ndim else value
    return found


def checked_softness(face: ContactPoints, softness: ArrayLike) -> Array:
    """Displacement per force (q, 2) of a face's surfaces at each point, tangential and normal."""
    soft = as_number(softness, "softness")
    fix = "give a number, or a tangential and a normal one"
    require("softness", softness, soft.shape in ((), (2,)), fix)
    _require_not_negative("softness", softness, soft)
    found: Array = numbers_of(soft).broadcast_to(soft, (2,)) / face.areas[:, None]
    return found


def checked_roughness(face: ContactPoints, roughness: ArrayLike) -> Array:
    """Height h and force F_0 (q, 2) of a face's surfaces at each point."""
    rough = as_number(roughness, "roughness")
    if rough.ndim == 0 and not is_traced(rough) and float(rough) == 0.0:
        rough = np.array([0.0, 1.0])
    require("roughness", roughness, rough.shape == (2,), "give 0, or a height and a pressure")
    _require_not_negative("roughness", roughness, rough)
    fix = "needs a pressure above 0: that at which surfaces are twice as stiff as at first touch"
    require("roughness", roughness, is_traced(rough) or bool(rough[1] > 0.0), fix)
    areas = face.areas[:, None]
    found: Array = rough * np.concatenate([areas**0, areas], axis=1)
    return found


def check_smooth(softness: ArrayLike, roughness: ArrayLike) -> None:
    """Refuse surfaces that give way on a line, where the walk knows rigid contact alone."""
    for key, value in (("softness", softness), ("roughness", roughness)):
        none = not is_traced(value) and not np.any(np.asarray(value))
        require(key, value, none, "is that of bodies on a face: leave it out on a line")


def unit_cycles(cycles: int, steps: int, on_face: bool) -> np.ndarray:
    """Loads (levels,) of cycles of amplitude 1, each of whose halves has so many load steps."""
    require_count("cycles", cycles, 1)
    require_count("steps_per_half_cycle", steps, LEAST_STEPS if on_face else 1)
    fix = "take a multiple of 4: every second step estimates the error"
    require("steps_per_half_cycle", steps, not on_face or steps % 4 == 0, fix)
    return unit_path(cycles, steps)


def all_loads(targets: ArrayLike, sizes: Array, on_face: bool) -> Array:
    """Loads (levels + 1, m), the pressing first.

    Parameters
    ----------
    targets : (levels,) loads to and fro, or (levels, m) of all loads
    sizes : (m - 1,) of the pressing loads
    on_face : True for bodies on a face, whose pressing may change
    """
    path = as_number(targets, "path")
    xp = numbers_of(path, sizes)
    pressing = xp.append(0.0, sizes)
    require_finite("path", path)
    fix = "give (levels,) loads to and fro"
    fix += f", or (levels, {pressing.size}) of all loads" if on_face else ""
    shaped = path.ndim in ((1, 2) if on_face else (1,)) and path.size > 0
    require("path", path.shape, shaped, fix)
    if path.ndim == 1:
        path = path[:, None] * np.eye(1, pressing.size) + pressing
    require("path", path.shape, path.shape[1] == pressing.size, fix)
    found: Array = xp.concatenate([pressing[None], path])
    return found


def _require_not_negative(
    key: str, given: ArrayLike, value: Array, fix: str = "give 0 or more"
) -> None:
    require_finite(key, value)
    fine = is_traced(value) or bool(np.all(np.asarray(value) >= 0.0))
    require(key, given, fine, f"must not be negative: {fix}")
