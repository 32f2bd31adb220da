r"""Power law of energy over force, D = D_1 (A/A_1)^m; it says nothing of the loop.

Tests of joints below gross slip give m between 2.5 and 3 (Smallwood, Gregory & Coleman 2000);
Goodman's bar gives 3.

References
----------
Smallwood, D. O., Gregory, D. L. & Coleman, R. G. (2000). Damping investigations of a simplified
    frictional shear joint. Proc. 71st Shock and Vibration Symposium.
"""

from __future__ import annotations

from typing import Any, ClassVar, NoReturn

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from jbeamshell.common.errors import InputError
from jbeamshell.laws.law import Law
from jbeamshell.scene.rows import number

NO_LOOP = "power-law: knows the energy per cycle alone, no force: take another law"


class PowerLaw(Law):
    """Energy per cycle as a power of the force amplitude.

    Attributes
    ----------
    level, exponent : energy D_1 at the force A_1, and exponent m
    force : A_1, which is no parameter of its own
    """

    heading: ClassVar[str] = "power-law"
    fitted: ClassVar[tuple[str, ...]] = ("level", "exponent")

    level: Array = number(1.0, "Energy per cycle at the force A_1.", symbol="D_1", unit="force")
    exponent: Array = number(3.0, "Exponent m of the force.", symbol="m", scale="linear")
    force: Array = number(1.0, "Force A_1 of the level.", symbol="A_1", unit="force/width")

    @property
    def stiffness(self) -> Array:
        """Stiffness, which this law does not know."""
        self._refuse()

    @property
    def capacity(self) -> Array:
        """Largest force: the law knows none."""
        return jnp.asarray(jnp.inf)

    def backbone(self, u: ArrayLike) -> Array:
        """Force, which this law does not know; raises `InputError`."""
        self._refuse()

    def path_forces(self, path: ArrayLike) -> Array:
        """Forces, which this law does not know; raises `InputError`."""
        self._refuse()

    def dissipation(self, amplitude: ArrayLike) -> Array:
        """Energy over displacement, which this law does not know; raises `InputError`."""
        self._refuse()

    def displacement(self, force: ArrayLike) -> Array:
        """Displacement, which this law does not know; raises `InputError`."""
        self._refuse()

    def dissipation_at_force(self, force: ArrayLike) -> Array:
        """Energy lost per steady cycle at a force amplitude; any shape."""
        return self.level * (jnp.asarray(force) / self.force) ** self.exponent

    @staticmethod
    def _start(force: float, displacement: float, work: float, stiffness: float) -> dict[str, Any]:
        """Numbers to start a fit from; see `Law.started`."""
        return {"level": work, "exponent": 2.7, "force": force}

    @staticmethod
    def _refuse() -> NoReturn:
        raise InputError(NO_LOOP)
