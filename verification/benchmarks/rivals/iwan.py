r"""Iwan's parallel-series network: Jenkins elements side by side, fitted to a backbone.

Element i is a spring k_i in series with a slider that lets it stretch by no more than u_i.  On
first loading its force is k_i min(u, u_i), so a backbone that is straight between the points
(u_i, F_i) is met exactly by k_i = F'_i - F'_{i+1}, the loss of slope at u_i.  Its loops are that
backbone doubled (Masing's rule), and cost no more than clipping the stretch of every spring.

Iwan, W. D. (1966). A distributed-element model for hysteresis and its steady-state dynamic
response. J. Appl. Mech. 33, 893-900.
"""

from typing import NamedTuple

import numpy as np


class Iwan(NamedTuple):
    """A network of n elements, (n,) each.

    Attributes
    ----------
    stiffness : k_i, force per length
    limit : u_i, the largest stretch of each spring
    force : of the whole network on first loading, when element i begins to slip
    """

    stiffness: np.ndarray
    limit: np.ndarray
    force: np.ndarray


def network(displacement: np.ndarray, force: np.ndarray) -> Iwan:
    """The network of a backbone (n + 1,) that rises from zero to gross slip at its end."""
    slopes = np.diff(force) / np.diff(displacement)
    return Iwan(slopes - np.append(slopes[1:], 0.0), displacement[1:], force[1:])


def cycle(iwan: Iwan, amplitude: float, steps: int) -> dict[str, np.ndarray | float]:
    """The steady loop from force A to -A and back, short of gross slip.

    Parameters
    ----------
    iwan : the network
    amplitude : A
    steps : per half cycle, equal in displacement

    Returns
    -------
    displacement, force : (2 steps + 1,) the loop
    dissipation : work of the sliders in it
    """
    turn = np.interp(amplitude, np.append(0.0, iwan.force), np.append(0.0, iwan.limit))
    stretch = np.minimum(turn, iwan.limit)[None]
    displacement, force, work = [turn], [amplitude], 0.0
    for way in (-1.0, 1.0):
        gone = 2.0 * turn * np.arange(1, steps + 1) / steps
        start = stretch[-1]
        stretch = np.clip(start + way * gone[:, None], -iwan.limit, iwan.limit)
        slip = gone[-1] - np.abs(stretch[-1] - start)
        work += (iwan.stiffness * iwan.limit) @ slip
        displacement.extend(way * (gone - turn))
        force.extend(stretch @ iwan.stiffness)
    return {
        "displacement": np.array(displacement),
        "force": np.array(force),
        "dissipation": float(work),
    }
