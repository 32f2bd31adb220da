"""Sensitivity of a joint's dissipation to its friction and its bolts, and what their scatter makes.

Slopes are logarithmic, d ln D/d ln x: D changes by so many per cent where x changes by one.  They
are central differences of whole runs, which are smooth in these numbers: they agree with automatic
derivatives to 1e-6, which take a minute to compile where this takes a second.  Next to gross slip,
where less friction has no equilibrium, they are one-sided.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import is_traced, require
from jbeamshell.common.errors import InputError
from jbeamshell.common.summary import Summary, ranged, with_unit
from jbeamshell.history.history import History
from jbeamshell.scene.scene import Scene
from jbeamshell.solving.solve import run

STEP = 1e-4  # relative, of the differences
BOTTOM = "contact.bottom_pressure"


class Sensitivity(NamedTuple):
    """Sensitivity of the dissipation, and its interval by the scatter of the preloads.

    Attributes
    ----------
    friction : d ln D/d ln mu
    bolts : (k,) d ln D/d ln F of each bolt
    places : (k,) their positions X, length
    dissipation, gross_slip : of the scene
    amplitude : of the end force; zero where a displacement is controlled
    scatter : half the range of the preloads over their mean
    """

    friction: float
    bolts: NDArray[np.float64]
    places: NDArray[np.float64]
    dissipation: float
    gross_slip: float
    amplitude: float
    scatter: float = 0.0

    @property
    def dissipation_interval(self) -> tuple[float, float]:
        """Least and largest D, where all bolts have their largest or smallest preload together.

        To first order of the logarithms: D goes as F to the power of the sum of the slopes.
        """
        power, factors = self.bolts.sum(), (1.0 + self.scatter, 1.0 - self.scatter)
        low, high = sorted(float(self.dissipation * factor**power) for factor in factors)
        return low, high

    @property
    def gross_slip_interval(self) -> tuple[float, float]:
        """Least and largest force of gross slip, which goes as the preloads."""
        return self.gross_slip * (1.0 - self.scatter), self.gross_slip * (1.0 + self.scatter)

    @property
    def may_slide(self) -> bool:
        """True if the joint slides as a whole where all preloads are the smallest."""
        return self.amplitude >= self.gross_slip_interval[0]

    def figures(self) -> dict[str, Any]:
        """Plain numbers and lists by name."""
        found: dict[str, Any] = {
            "gross_slip": self.gross_slip,
            "slope_by_friction": self.friction,
            "slopes_by_bolts": self.bolts.tolist(),
        }
        if self.scatter > 0.0:
            found["dissipation_interval"] = list(self.dissipation_interval)
            found["gross_slip_interval"] = list(self.gross_slip_interval)
        return found

    def summary(self, force: str = "", work: str = "", length: str = "") -> Summary:
        """Lines of it.

        Parameters
        ----------
        force, work, length : names of the scene's units; empty prints numbers alone
        """
        rows = [("gross slip", with_unit(self.gross_slip, force))]
        if self.scatter > 0.0:
            low, high = self.gross_slip_interval
            rows.append(("by the preloads", ranged(np.array([low, high]), force)))
            low, high = self.dissipation_interval
            rows.append(("dissipation by them", ranged(np.array([low, high]), work)))
        percent = "% for each % of"
        rows.append(("dissipation changes", f"{self.friction:+.2f} {percent} friction"))
        for place, slope in zip(self.places, self.bolts, strict=True):
            at = f"the bolt at X = {with_unit(float(place), length)}"
            rows.append(("", f"{slope:+.2f} {percent} {at}"))
        notes = []
        if self.scatter > 0.0:
            notes.append(
                f"preloads scatter by {100.0 * self.scatter:.0f} % of their mean, all bolts "
                "together; first order"
            )
        if self.scatter > 0.0 and self.may_slide:
            notes.append("doubtful: the joint slides as a whole under the smallest preloads")
        return Summary("", rows, notes)

    def __str__(self) -> str:
        return self.summary().as_text()


def is_bolted(scene: Scene) -> bool:
    """True if a joint has a sensitivity: bolts, friction and a cycle of a force."""
    if is_traced(scene) or scene.contact.bolts is None or not scene.load.cycles:
        return False
    return float(scene.contact.friction) > 0.0 and scene.load.kind == "force"


def slips(history: History) -> bool:
    """True if a run loses energy in its last cycle, so that its logarithm has slopes."""
    return float(history.dissipation) > 0.0 and bool(np.isfinite(history.dissipation_error))


def sensitivity(scene: Scene | History, scatter: float = 0.0) -> Sensitivity:
    """Sensitivity of a bolted joint's dissipation to its friction and to each of its bolts.

    Parameters
    ----------
    scene : scene with ``contact.bolts``, or the history of its run, which saves one
    scatter : half the range of the preloads over their mean, such as `jbeamshell.Bolt.scatter`

    Raises
    ------
    InputError
        for a scene without bolts, friction or a cycle of a force, and for one in which nothing
        slips, or whose neighbours have no equilibrium

    Examples
    --------
    >>> bolted = {"contact.bolts": [[1.0, 20.0, 0.4]], "load.amplitude": 1.0}
    >>> scene = jb.Scene().replace(bolted)
    >>> found = jb.sensitivity(scene, jb.Bolt("M8", torque="25 N m").scatter)
    >>> print(found)
    """
    history = scene if isinstance(scene, History) else None
    given = scene.scene if isinstance(scene, History) else scene
    require("scene", given, isinstance(given, Scene), "give a jbeamshell.Scene or its History")
    fix = "has none: a sensitivity needs contact.bolts, friction and a cycle of a force"
    require("scene", "bolts", is_bolted(given), fix)
    history = run(given) if history is None else history
    fix = "has no slopes, because nothing slips: take a larger load.amplitude"
    require("dissipation", float(history.dissipation), slips(history), fix)
    pinned, own = history.scene.pinned(), float(history.dissipation)
    rows, mu = np.asarray(given.get("contact.bolts"), float), float(given.contact.friction)

    def lost(changed: dict[str, Any]) -> float | None:
        """Dissipation of a neighbour; None if it slides as a whole or a step fails."""
        try:
            found = run(pinned.replace(changed), throw=False)
        except InputError:
            return None
        return float(found.dissipation) if found.converged and slips(found) else None

    def slope(key: str, changed: Any) -> float:
        factors = [1.0 + way * STEP for way in (1.0, -1.0)]
        pairs = [(factor, lost(changed(factor))) for factor in factors]
        known = [(factor, work) for factor, work in (*pairs, (1.0, own)) if work is not None]
        fix = "has no slope: neither a little more nor a little less of it has an equilibrium"
        require(key, "of the joint", len(known) > 1, fix)
        (high, above), (low, below) = known[:2]
        return float(np.log(above / below) / np.log(high / low))

    def tightened(place: int, factor: float) -> dict[str, Any]:
        new = rows.copy()
        new[place, 1] *= factor
        # The lower face follows the bolts where it did before.
        follows = {} if given.contact.bolted else {"contact.bottom_pressure": given.get(BOTTOM)}
        return {"contact.bolts": new} | follows

    bolts = [
        slope(f"contact.bolts[{at}]", lambda factor, at=at: tightened(at, factor))
        for at in range(len(rows))
    ]
    control = given.load.control == "force"
    return Sensitivity(
        slope("contact.friction", lambda factor: {"contact.friction": mu * factor}),
        np.array(bolts),
        rows[:, 0],
        own,
        float(given.gross_slip),
        float(given.get("load.amplitude")) if control else 0.0,
        scatter,
    )
