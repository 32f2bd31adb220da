"""Frequencies of results: cycles per time under `frequency`, radians per time under `omega`."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from jbeamshell.common.checks import is_traced
from jbeamshell.common.pytrees import Tree
from jbeamshell.common.summary import Summary, ranged

SHOWN = 10  # modes that are printed


class OverFrequency(Tree):
    """Result with a `frequency`, in cycles per time (hertz, if the time is in seconds)."""

    frequency: Any

    @property
    def omega(self) -> Any:
        """Angular frequency, 2 pi `frequency`, in radians per time."""
        return 2.0 * np.pi * self.frequency


class OverAmplitude(OverFrequency):
    """Frequency and damping of a mode of a structure over its amplitude; see `ModalCurve`."""

    title: ClassVar[str]
    label: ClassVar[str]  # of a picture

    amplitude: Any
    damping: Any
    dissipation: Any
    joints: Any

    @property
    def doubts(self) -> tuple[str, ...]:
        """Sentences that say what may be wrong, and the fix."""
        return ()

    def __str__(self) -> str:
        if is_traced(self):
            return f"{self.title}, traced"
        columns = {
            "modal displacement": self.amplitude,
            "frequency": self.frequency,
            "damping ratio": self.damping,
            "lost per cycle": self.dissipation,
            "joints move by": np.max(np.asarray(self.joints), axis=-1, initial=0.0),
        }
        rows = [(name, ranged(np.asarray(column))) for name, column in columns.items()]
        notes = [f"doubtful: {doubt}" for doubt in self.doubts]
        title = f"{self.title}, {np.size(self.amplitude)} points"
        return Summary(title, rows, notes).as_text()

    def __repr__(self) -> str:
        return str(self)

    def plot(self, axes: Any = None) -> Any:
        """Draw frequency and damping over amplitude; see `jbeamshell.plotting.modal_curve`."""
        from jbeamshell import plotting

        return plotting.modal_curve(self, axes=axes, label=self.label)


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

    def __str__(self) -> str:
        if is_traced(self):
            return "natural modes, traced"
        known = np.asarray(self.frequency)
        rows = [(f"mode {number}", f"{each:.6g}") for number, each in enumerate(known[:SHOWN])]
        notes = [f"and {known.size - SHOWN} more"] if known.size > SHOWN else []
        return Summary("natural modes, cycles per time", rows, notes).as_text()

    def __repr__(self) -> str:
        return str(self)
