"""What a sweep found: arrays with named axes, a table, CSV, pictures."""

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
from jbeamshell.quasistatic.load_path import check
from jbeamshell.scene.scene import Scene
from jbeamshell.sweeping.lanes import Lanes, Outcome

ROWS = 4096  # of a table that are put into words at a time


@dataclasses.dataclass(frozen=True)
class Sweep:
    """Figures of all lanes of a sweep.

    Attributes
    ----------
    scene : what was not varied
    axes : (n,) values of every key, in the order of the arrays' axes
    paired : whether the keys went together, so that the arrays have one axis
    values : figures by name, arrays of the lanes' ``shape``; NaN where there is none
    status : codes of `jbeamshell.sweeping.Outcome`, of that shape: why
    wall_s : seconds that it took, of which ``compile_s`` before the first lane
    computed : lanes that were run in that time; the others were on disk, or outside the domain
    notes : what a reader should know
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
        require_choice("figure", figure, tuple(self.values))
        return self.values[figure]

    @property
    def shape(self) -> tuple[int, ...]:
        """A length for every key; paired, one for all."""
        return self.status.shape

    @property
    def lanes(self) -> Lanes:
        """Quantities of the lanes, such as ``amplitude_over_height``."""
        return Lanes(self.scene, self.axes, self.paired)

    @property
    def failed(self) -> int:
        """Lanes that found no equilibrium, batched and alone."""
        return int(np.sum((self.status > Outcome.CONVERGED) & (self.status <= Outcome.NOT_REACHED)))

    @property
    def outside(self) -> int:
        """Lanes outside the model's domain, which were not run."""
        return int(np.sum(self.status == Outcome.OUTSIDE))

    @property
    def undefined(self) -> int:
        """Lanes that were solved, but with a figure that means nothing there."""
        return int(np.sum(self.status == Outcome.UNDEFINED))

    @property
    def lanes_per_s(self) -> float:
        """Lanes computed in a second, compilation aside."""
        return self.computed / max(self.wall_s - self.compile_s, 1e-9)

    @functools.cached_property
    def why_outside(self) -> str:
        """What is wrong with the first lane outside the domain; empty if there is none."""
        lanes = np.flatnonzero(self.status == Outcome.OUTSIDE)
        if not lanes.size:
            return ""
        values = self.lanes.columns(lanes[:1])[:, 0].tolist()
        try:
            check(self.scene.replace(dict(zip(self.axes, values, strict=True))))
        except InputError as error:
            return str(error)
        return "on its edge"  # round-off apart

    # --- tables ---------------------------------------------------------------------------------

    def table(self) -> dict[str, np.ndarray]:
        """Columns (lanes,): the keys, the figures, and how the lanes ended in words."""
        keys = dict(zip(self.axes, self.lanes.columns(np.arange(self.status.size)), strict=True))
        words = np.array([outcome.name.lower() for outcome in Outcome])
        figures = {name: values.ravel() for name, values in self.values.items()}
        return keys | figures | {"status": words[self.status.ravel()]}

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write the table, whole or not at all; what is no number is left empty."""
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
        """Everything as plain numbers, words and lists; None where there is no number."""
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
        """Draw a figure along one key, a curve for each value of another; see `plotting.sweep`."""
        from jbeamshell import plotting

        return plotting.sweep(self, axes, **options)

    def plot_master(self, axes: Any = None, **options: Any) -> Any:
        """Draw the dissipation's ratio over A/eta; see `plotting.master_curve`."""
        from jbeamshell import plotting

        return plotting.master_curve(self, axes, **options)


def _known(values: np.ndarray) -> list[float | None]:
    """Plain numbers, None for what is none."""
    plain, finite = values.tolist(), np.isfinite(values)
    if finite.all():
        return plain
    return [value if good else None for value, good in zip(plain, finite, strict=True)]


def _nested(flat: list[Any], shape: tuple[int, ...]) -> list[Any]:
    """Lists in lists, as many as the shape has lengths."""
    for length in shape[:0:-1]:
        flat = [flat[i : i + length] for i in range(0, len(flat), length)]
    return flat
