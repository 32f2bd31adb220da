"""Results of a sweep: arrays with named axes, a table, CSV, pictures."""

from __future__ import annotations

import csv
import dataclasses
import functools
import os
from collections.abc import Iterator
from typing import Any

import numpy as np

from jbeamshell.common.checks import require_choice
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import written_whole
from jbeamshell.scene.load_path import check
from jbeamshell.scene.scene import Scene
from jbeamshell.sweeping.lanes import Lanes, Outcome

ROWS = 4096  # rows of a table that are turned into text at a time


@dataclasses.dataclass(frozen=True)
class Sweep:
    """Figures of all lanes of a sweep; a lane is one of its strips.

    Attributes
    ----------
    scene : scene with all that was not varied
    axes : values (n,) of every key, in the order of the arrays' axes
    paired : True if the keys went together, so that the arrays have one axis
    values : figures by name, arrays of the lanes' ``shape``; NaN where there is none
    status : codes of `jbeamshell.sweeping.Outcome`, an array of that shape
    wall_s : seconds that the sweep took
    compile_s : part of them before the first lane
    computed : lanes that were run in that time; the others were on disk, or outside the domain
    notes : remarks for the reader, such as workers that were replaced

    Examples
    --------
    ::

        over = {"load.amplitude": [0.4, 0.8], "contact.friction": [0.1, 0.2]}
        result = jb.sweep(jb.Scene(), over)
        result["dissipation"][0, 1]  # of amplitude 0.4 and friction 0.2
        result.to_csv("sweep.csv")
    """

    scene: Scene
    axes: dict[str, np.ndarray]
    paired: bool
    values: dict[str, np.ndarray]
    status: np.ndarray
    wall_s: float
    compile_s: float
    computed: int
    notes: tuple[str, ...] = ()

    def __getitem__(self, figure: str) -> np.ndarray:
        """Values of a figure, an array of the lanes' shape."""
        require_choice("figure", figure, tuple(self.values))
        return self.values[figure]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the arrays: a length for every key, or one length if the keys are paired."""
        return self.status.shape

    @property
    def lanes(self) -> Lanes:
        """Lanes with their quantities, such as ``amplitude_over_height``."""
        return Lanes(self.scene, self.axes, self.paired)

    @property
    def failed(self) -> int:
        """Number of lanes without equilibrium, neither in their batch nor solved alone."""
        return int(np.sum((self.status > Outcome.CONVERGED) & (self.status <= Outcome.NOT_REACHED)))

    @property
    def outside(self) -> int:
        """Number of lanes outside the model's domain, which were not run."""
        return int(np.sum(self.status == Outcome.OUTSIDE))

    @property
    def undefined(self) -> int:
        """Number of lanes that were solved, but have a figure of 0/0."""
        return int(np.sum(self.status == Outcome.UNDEFINED))

    @property
    def lanes_per_s(self) -> float:
        """Lanes computed in a second, without the time to compile."""
        return self.computed / max(self.wall_s - self.compile_s, 1e-9)

    @functools.cached_property
    def why_outside(self) -> str:
        """Reason why the first lane outside the domain is there; empty if there is none."""
        lanes = np.flatnonzero(self.status == Outcome.OUTSIDE)
        if not lanes.size:
            return ""
        values = self.lanes.columns(lanes[:1])[:, 0].tolist()
        try:
            check(self.scene.replace(dict(zip(self.axes, values, strict=True))))
        except InputError as error:
            return str(error)
        return "on the edge of the domain"  # the scene alone is inside by round-off

    # --- tables ---------------------------------------------------------------------------------

    def table(self) -> dict[str, np.ndarray]:
        """Columns (lanes,) by name: the keys, the figures, and the outcome in words."""
        keys = dict(zip(self.axes, self.lanes.columns(np.arange(self.status.size)), strict=True))
        words = np.array([outcome.name.lower() for outcome in Outcome])
        figures = {name: values.ravel() for name, values in self.values.items()}
        return keys | figures | {"status": words[self.status.ravel()]}

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write the table as CSV, whole or not at all; cells without a number stay empty."""
        with written_whole(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([*self.axes, *self.values, "status"])
            for rows in self._rows():
                writer.writerows(rows)

    def _rows(self) -> Iterator[Iterator[tuple[Any, ...]]]:
        lanes, status = self.lanes, self.status.ravel()
        columns = [values.ravel() for values in self.values.values()]
        words = [outcome.name.lower() for outcome in Outcome]
        for begin in range(0, status.size, ROWS):
            some = slice(begin, min(begin + ROWS, status.size))
            keys = lanes.columns(np.arange(some.start, some.stop)).tolist()
            figures = [_known(column[some]) for column in columns]
            yield zip(*keys, *figures, [words[code] for code in status[some]], strict=True)

    def figures(self) -> dict[str, Any]:
        """Result as plain numbers, words and lists, for JSON; None where there is no number."""
        words = [outcome.name.lower() for outcome in Outcome]
        return {
            "lanes": self.status.size,
            "failed": self.failed,
            "outside": self.outside,
            "undefined": self.undefined,
            "shape": list(self.shape),
            "paired": self.paired,
            "axes": {key: values.tolist() for key, values in self.axes.items()},
            "values": {
                name: _nested(_known(values.ravel()), self.shape)
                for name, values in self.values.items()
            },
            "status": _nested([words[code] for code in self.status.ravel()], self.shape),
            "notes": list(self.notes),
            "computed": self.computed,
            "lanes_per_s": self.lanes_per_s,
            "wall_s": self.wall_s,
            "compile_s": self.compile_s,
        }

    # --- for people -----------------------------------------------------------------------------

    def __str__(self) -> str:
        over = ", ".join(f"{key} ({values.size})" for key, values in self.axes.items())
        good = int(np.sum(self.status == Outcome.CONVERGED))
        lines = [
            f"{self.status.size:,} lanes over {over}{', paired' if self.paired else ''}: "
            f"{good:,} converged, {self.failed:,} failed, {self.outside:,} outside the domain"
        ]
        if self.undefined:
            lines[0] += f", {self.undefined:,} with a figure undefined"
        rate = f", {self.lanes_per_s:,.0f} lanes/s" if self.computed else ""
        lines.append(f"  {self.wall_s:.1f} s, of which {self.compile_s:.1f} s to compile{rate}")
        for name, values in self.values.items():
            known = values[np.isfinite(values)]
            span = f"{known.min():.6g} to {known.max():.6g}" if known.size else "none"
            lines.append(f"  {name.replace('_', ' '):20s} {span}")
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])

    def plot(self, axes: Any = None, **options: Any) -> Any:
        """Draw a figure over one key, a curve for each value of another; see `plotting.sweep`."""
        from jbeamshell import plotting

        return plotting.sweep(self, axes, **options)

    def plot_master(self, axes: Any = None, **options: Any) -> Any:
        """Draw the dissipation ratio over A/eta; see `plotting.master_curve`."""
        from jbeamshell import plotting

        return plotting.master_curve(self, axes, **options)


def _known(values: np.ndarray) -> list[float | None]:
    """Plain numbers; None in place of NaN and infinity."""
    plain, finite = values.tolist(), np.isfinite(values)
    if finite.all():
        return plain
    return [value if good else None for value, good in zip(plain, finite, strict=True)]


def _nested(flat: list[Any], shape: tuple[int, ...]) -> list[Any]:
    """Nested lists of a shape."""
    for length in shape[:0:-1]:
        flat = [flat[i : i + length] for i in range(0, len(flat), length)]
    return flat
