"""Frequencies of results: cycles per time under `frequency`, radians per time under `omega`."""

from __future__ import annotations

from typing import Any

import numpy as np

from jbeamshell.common.pytrees import Tree


class OverFrequency(Tree):
    """Result with a `frequency`, in cycles per time (hertz, if the time is in seconds)."""

    frequency: Any

    @property
    def omega(self) -> Any:
        """Angular frequency, 2 pi `frequency`, in radians per time."""
        return 2.0 * np.pi * self.frequency


class Modes(OverFrequency):
    """Natural vibrations of a strip, or of a structure with all joints stuck.

    Attributes
    ----------
    frequency : (k,) cycles per time, rising
    shapes : (k, n, m) nodal fields of a strip, (n, k) displacements of a structure; of unit modal
        mass
    x : (n,) node positions of a strip; None for a structure
    """

    shapes: Any
    x: Any = None
