"""Input of a contact of bodies: what `jbeamshell.solve_contact` refuses before it solves."""

from __future__ import annotations

from typing import Protocol

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import as_leaf, is_traced, require, require_finite
from jbeamshell.contact_line.substructure import Substructure, loose_mode

MATCH = 1e-6  # of the contact's length, within which nodes match


def check_bodies(upper: Substructure, lower: Substructure | None) -> None:
    """Refuse what is no body, bodies that do not match, and those that nothing holds or pulls."""
    for key, body in (("upper", upper), ("lower", lower)):
        fits = isinstance(body, Substructure) or (body is None and key == "lower")
        require(key, type(body).__name__, fits, "give a jbeamshell.Substructure")
    if lower is not None:
        _check_match(upper, lower)
        _check_held(upper, lower)
    bodies = [body for body in (upper, lower) if body is not None]
    pulls = [body.forces[:, 0] for body in bodies] + [body.flexibility[0] for body in bodies]
    pulled = is_traced(pulls) or any(bool(np.any(np.asarray(pull))) for pull in pulls)
    require("pull", 0, pulled, "nothing pulls the bodies: condense one with pull=")


def checked_gap(upper: Substructure, gap: ArrayLike) -> Array:
    """Gap of the nodes, () or (n,)."""
    distance = as_leaf(gap, "gap")
    fix = f"give a number, or one for each of {upper.x.size} nodes"
    require("gap", gap, distance.shape in ((), upper.x.shape), fix)
    require_finite("gap", distance)
    fix = "must not be negative: bodies cannot overlap before anything presses"
    require("gap", gap, is_traced(distance) or bool(np.all(np.asarray(distance) >= 0.0)), fix)
    return distance


class Pressed(Protocol):
    """Condensed body, on a line or on a face."""

    @property
    def bolts(self) -> int:
        """Number of loads that press."""


def checked_bolts(upper: Pressed, lower: Pressed | None, bolts: ArrayLike) -> Array:
    """Size of each pressing load, (m - 1,)."""
    count = upper.bolts if lower is None else max(upper.bolts, lower.bolts)
    require("bolts", 0, count > 0, "nothing presses the bodies together: condense one with press=")
    for key, body in (("upper.press", upper), ("lower.press", lower)):
        if body is not None:
            fix = f"give {count} in both bodies, or none in one of them"
            require(key, body.bolts, body.bolts in (0, count), fix)
    sizes = as_leaf(bolts, "bolts")
    fix = f"give a number, or one for each of {count} presses"
    require("bolts", bolts, sizes.shape in ((), (count,)), fix)
    require_finite("bolts", sizes)
    fix = "must not be negative: turn the forces of its table of press instead"
    require("bolts", bolts, is_traced(sizes) or bool(np.all(np.asarray(sizes) >= 0.0)), fix)
    return jnp.broadcast_to(sizes, (count,))


def _check_match(upper: Substructure, lower: Substructure) -> None:
    """Refuse contact lines that do not match, and a place that both bodies hold."""
    same = upper.x.size == lower.x.size
    fix = f"does not match the {upper.x.size} nodes of the upper body: mesh both lines alike"
    require("lower.x", f"{lower.x.size} nodes", same, fix)
    if is_traced(upper.x, lower.x):
        return
    x, other = np.asarray(upper.x), np.asarray(lower.x)
    worst = int(np.argmax(np.abs(x - other)))
    fix = f"does not match node {worst} of the upper body at X = {x[worst]:.6g}: mesh both alike"
    close = abs(x[worst] - other[worst]) <= MATCH * float(np.ptp(x))
    require(f"lower.x[{worst}]", float(other[worst]), close, fix)


def held_nodes(upper: Substructure, lower: Substructure | None) -> tuple[bool, ...]:
    """True for contact nodes (n,) that cannot slip, because supports hold both sides."""
    fixed = np.array(upper.fixed).reshape(-1, 2)
    if lower is not None:
        fixed = fixed & np.array(lower.fixed).reshape(-1, 2)
    first = int(np.argmax(fixed[:, 1]))
    fix = "holds the normal direction of both sides: leave this node out of the contact"
    require(f"contact[{first}]", "a support", not fixed[:, 1].any(), fix)
    fix = "hold the tangential direction of both sides everywhere: leave one of them free"
    require("contact", "supports", not fixed[:, 0].all(), fix)
    return tuple(fixed[:, 0].tolist())


def _check_held(upper: Substructure, lower: Substructure) -> None:
    """Refuse two bodies that move together without energy."""
    if is_traced(upper, lower):
        return
    fixed = np.array(upper.fixed) | np.array(lower.fixed)  # the bodies stuck to each other
    k = np.asarray(upper.stiffness + lower.stiffness)
    k = np.where(fixed | fixed[:, None], 0.0, k) + np.diag(fixed * np.max(k))
    mode = loose_mode(k, np.asarray(upper.x))
    fix = f"{mode} with the other one: hold one of them by a support"
    require("lower", "loose body", not mode, fix)
