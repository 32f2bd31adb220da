r"""Series-series Iwan model: springs in a row, with a slider to ground at every node.

The loaded end slips first.  The force F less the friction T_j of all nodes up to spring j stretches
it, so that on first loading

    u = sum over j of max(F - T_j, 0)/k_j,   D = 4 sum over j of T_j max(A - T_j, 0)/k_j,
    T_j = f_1 + ... + f_j.

Static condensation of the nodes between leaves just these thresholds and compliances: the bar of
Quinn and Segalman by elements, and the reduced interface of Guthrie and Kammer.

References
----------
Guthrie, M. A. & Kammer, D. C. (2008). A general reduced representation of one-dimensional
    frictional interfaces. J. Appl. Mech. 75, 011008.
Iwan, W. D. (1966). A distributed-element model for hysteresis and its steady-state dynamic
    response. J. Appl. Mech. 33, 893-900.
Quinn, D. D. & Segalman, D. J. (2005). Using series-series Iwan-type models for understanding joint
    dynamics. J. Appl. Mech. 72, 666-673.
"""

from __future__ import annotations

from typing import Any, ClassVar, Self

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.checks import is_traced, require, require_count
from jbeamshell.laws.masing import MasingLaw
from jbeamshell.scene.rows import number


class SeriesIwan(MasingLaw):
    """Row of springs and sliders, from the loaded end on.

    Attributes
    ----------
    springs : (n,) stiffness k_j of each spring
    limits : (n,) or (n + 1,) slip force f_j of the node before each spring, and of the last node,
        which is held without one
    """

    heading: ClassVar[str] = "series-iwan"

    springs: Array = number(
        1.0, "Stiffnesses k_j.", symbol="k_j", unit="(force/width)/length", table=True
    )
    limits: Array = number(1.0, "Slip forces f_j.", symbol="f_j", unit="force/width", table=True)

    def __check_init__(self) -> None:
        for name in ("springs", "limits"):
            value, key = getattr(self, name), self.table()[f"{self.heading}.{name}"]
            if not is_traced(value):
                require(key.name, value, bool(np.all(key.holds(np.asarray(value)))), key.words)
        nodes = jnp.size(self.limits) - jnp.size(self.springs)
        fix = "give one per spring, or one more for the last node"
        require("series-iwan.limits", jnp.shape(self.limits), nodes in (0, 1), fix)

    @classmethod
    def of_bar(
        cls, axial_stiffness: Any, friction_per_length: Any, length: Any, count: int
    ) -> Self:
        """Bar of stiffness EA and length L on friction q per length, in a number of elements.

        Friction acts at the nodes, half as much at the two ends; u has an error of order 2.
        """
        require_count("count", count, 1)
        part = np.ones(count + 1)
        part[[0, -1]] = 0.5
        one = friction_per_length * length / count
        return cls(jnp.full(count, axial_stiffness * count / length), one * part)

    @property
    def stiffness(self) -> Array:
        """Stiffness without slip: infinite, as the first slider holds the loaded end."""
        return jnp.asarray(jnp.inf)

    @property
    def capacity(self) -> Array:
        """Force of gross slip, of all sliders; infinite if the last node is held."""
        ends = jnp.size(self.limits) > jnp.size(self.springs)
        return jnp.sum(self.limits) if ends else jnp.asarray(jnp.inf)

    def displacement(self, force: ArrayLike) -> Array:
        """Displacement amplitude of a force amplitude; see `Law.displacement`."""
        over = self._below_capacity(force)[..., None] - self._thresholds
        return jnp.sum(jnp.maximum(over, 0.0) / self.springs, axis=-1)

    def dissipation_at_force(self, force: ArrayLike) -> Array:
        """Energy lost per steady cycle at a force amplitude; see `Law.displacement`."""
        held = self._thresholds
        over = jnp.maximum(self._below_capacity(force)[..., None] - held, 0.0)
        return 4.0 * jnp.sum(held * over / self.springs, axis=-1)

    def backbone(self, u: ArrayLike) -> Array:
        """Force on first loading, an odd function of the displacement; any shape."""
        u = jnp.asarray(u)
        at, force, last = self._corners
        size = jnp.abs(u)
        beyond = jnp.maximum(size - at[-1], 0.0) * last
        return jnp.sign(u) * (jnp.interp(size, at, force) + beyond)

    def work(self, u: ArrayLike) -> Array:
        """Work on first loading, the integral of the backbone from 0 to u; any shape."""
        size = jnp.abs(jnp.asarray(u))
        at, force, _ = self._corners
        done = jnp.append(0.0, jnp.cumsum(0.5 * (force[1:] + force[:-1]) * jnp.diff(at)))
        place = jnp.clip(jnp.searchsorted(at, size, side="right") - 1, 0, at.size - 1)
        now = jnp.where(size > 0.0, self.backbone(size), force[0])
        return done[place] + 0.5 * (force[place] + now) * (size - at[place])

    @property
    def _thresholds(self) -> Array:
        """Forces T_j (n,) beyond which each spring is stretched."""
        return jnp.cumsum(jnp.atleast_1d(self.limits))[: jnp.size(self.springs)]

    @property
    def _corners(self) -> tuple[Array, Array, Array]:
        """Displacements and forces of the backbone's corners, and its slope after the last."""
        force = self._thresholds
        if jnp.size(self.limits) > jnp.size(self.springs):
            force = jnp.append(force, jnp.sum(self.limits))
        over = jnp.maximum(force[:, None] - self._thresholds, 0.0)
        sliding = jnp.size(self.limits) > jnp.size(self.springs)
        last = jnp.zeros(()) if sliding else 1.0 / jnp.sum(1.0 / self.springs)
        return jnp.sum(over / self.springs, axis=-1), force, last
