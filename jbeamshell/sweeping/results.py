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
from jbeamshell.common.extras import table_library
from jbeamshell.common.files import written_whole
from jbeamshell.common.summary import Summary
from jbeamshell.history.figures import TURNED_UNITS, UNITS
from jbeamshell.history.reliability import doubted_from, finer_grid
from jbeamshell.scene.keys import unit_of
from jbeamshell.scene.load_path import check
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.toml import scene_to_toml
from jbeamshell.sweeping.lanes import Lanes, Outcome

PURE = dict.fromkeys(("dissipation_ratio", "dissipation_error", "loss_factor"), "1")
NEGLIGIBLE = 1e-4  # dissipation over the bar's below which errors are over this share of the bar's
ROWS = 4096  # rows of a table that are turned into text at a time


@dataclasses.dataclass(frozen=True, eq=False)
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

    def __eq__(self, other: object) -> bool:
        """True for the same lanes with the same numbers to the last bit; times do not count."""
        if not isinstance(other, Sweep):
            return NotImplemented
        ours, theirs = self._numbers, other._numbers
        return (
            bool(self.scene == other.scene)
            and list(ours) == list(theirs)
            and all(np.array_equal(ours[name], theirs[name], equal_nan=True) for name in ours)
        )

    @property
    def _numbers(self) -> dict[str, np.ndarray]:
        """Axes, figures and status by name."""
        axes = {f"axis {key}": values for key, values in self.axes.items()}
        return axes | self.values | {"status": self.status, "paired": np.asarray(self.paired)}

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
        """Columns (lanes,) by name: keys, figures, the outcome in words, and ``doubtful``."""
        keys = dict(zip(self.axes, self.lanes.columns(np.arange(self.status.size)), strict=True))
        words = np.array([outcome.name.lower() for outcome in Outcome])
        figures = {name: values.ravel() for name, values in self.values.items()}
        outcome = {"status": words[self.status.ravel()], "doubtful": self.doubtful.ravel()}
        return keys | figures | outcome

    @property
    def doubtful(self) -> np.ndarray:
        """True for lanes not to rely on, an array of the lanes' shape.

        They have no equilibrium, or were not run; or the dissipation's estimated error is above
        2 % and ``model.tolerance``, which is known if ``"dissipation_error"`` is among the figures.
        Where a lane loses less than 1e-4 of what a bar does, the error is over that 1e-4, if
        ``"dissipation_ratio"`` is among the figures too.
        """
        solved = np.isin(self.status, (Outcome.CONVERGED, Outcome.UNDEFINED))
        return ~solved | (self._errors > doubted_from(self.scene.model.tolerance))

    @property
    def _errors(self) -> np.ndarray:
        """Estimated errors of the dissipation, an array of the lanes' shape; 0 if unknown."""
        errors = self.values.get("dissipation_error", np.zeros(self.shape))
        ratio = self.values.get("dissipation_ratio", np.ones(self.shape))
        known = np.isfinite(ratio) & np.isfinite(errors)  # infinite where nothing slips
        share = np.where(known, np.minimum(ratio / NEGLIGIBLE, 1.0), 1.0)
        return errors * share

    @property
    def doubts(self) -> tuple[str, ...]:
        """Doubt about lanes that were solved: how many, by how much they are off, and the fix."""
        allowed = doubted_from(self.scene.model.tolerance)
        beyond = self._errors[self._errors > allowed]
        if not beyond.size:
            return ()
        worst = float(beyond.max())
        by = f"{100.0 * worst:.2g} %" if worst < 0.99 else "100 % or more"
        return (
            f"the dissipation of {beyond.size:,} of {self.status.size:,} lanes may be off by more "
            f"than {100.0 * allowed:.2g} %, at most by {by}: `doubtful` marks them; "
            f"{finer_grid(self.scene)}",
        )

    def to_dataframe(self) -> Any:
        """Table as a `pandas.DataFrame`: a row for every lane, with the column ``doubtful``."""
        return table_library("pandas").DataFrame(self.table())

    def to_xarray(self) -> Any:
        """Sweep as an `xarray.Dataset`.

        Its dimensions are the keys, or ``lane`` if they are paired.  Its variables are the figures,
        ``status`` with its meanings in the attributes, and ``doubtful``.  Units are attributes of
        the variables, and the scene in TOML one of the set.

        Raises
        ------
        InputError
            if xarray is not installed

        Examples
        --------
        ::

            result.to_xarray()["dissipation"].sel({"load.amplitude": 0.8}, method="nearest").plot()
        """
        xarray, load = table_library("xarray"), self.scene.load
        dims = ["lane"] if self.paired else list(self.axes)
        units = UNITS | PURE | (TURNED_UNITS if load.kind == "moment" else {})
        variables: dict[str, Any] = {
            name: (dims, values, {"units": units[name]} if name in units else {})
            for name, values in self.values.items()
        }
        words = " ".join(outcome.name.lower() for outcome in Outcome)
        flags = {"flag_values": np.array(Outcome, np.int8), "flag_meanings": words}
        variables |= {"status": (dims, self.status, flags), "doubtful": (dims, self.doubtful)}
        kept = {
            key: ("lane" if self.paired else key, values, {"units": unit_of(key, load)})
            for key, values in self.axes.items()
        }
        try:
            scene = scene_to_toml(self.scene)
        except InputError:  # a function of the user's own
            scene = repr(self.scene)
        return xarray.Dataset(variables, kept, {"scene": scene, "notes": list(self.notes)})

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write the table as CSV, whole or not at all; cells without a number stay empty."""
        with written_whole(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([*self.axes, *self.values, "status", "doubtful"])
            for rows in self._rows():
                writer.writerows(rows)

    def _rows(self) -> Iterator[Iterator[tuple[Any, ...]]]:
        lanes, status, doubtful = self.lanes, self.status.ravel(), self.doubtful.ravel()
        columns = [values.ravel() for values in self.values.values()]
        words = [outcome.name.lower() for outcome in Outcome]
        for begin in range(0, status.size, ROWS):
            some = slice(begin, min(begin + ROWS, status.size))
            keys = lanes.columns(np.arange(some.start, some.stop)).tolist()
            figures = [_known(column[some]) for column in columns]
            outcome = [words[code] for code in status[some]], doubtful[some].tolist()
            yield zip(*keys, *figures, *outcome, strict=True)

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
            "doubts": list(self.doubts),
            "computed": self.computed,
            "lanes_per_s": self.lanes_per_s,
            "wall_s": self.wall_s,
            "compile_s": self.compile_s,
        }

    # --- for people -----------------------------------------------------------------------------

    @property
    def _summary(self) -> Summary:
        over = ", ".join(f"{key} ({values.size})" for key, values in self.axes.items())
        good = int(np.sum(self.status == Outcome.CONVERGED))
        title = (
            f"{self.status.size:,} lanes over {over}{', paired' if self.paired else ''}: "
            f"{good:,} converged, {self.failed:,} failed, {self.outside:,} outside the domain"
        )
        if self.undefined:
            title += f", {self.undefined:,} with a figure undefined"
        rate = f", {self.lanes_per_s:,.0f} lanes/s" if self.computed else ""
        title += f"\n  {self.wall_s:.1f} s, of which {self.compile_s:.1f} s to compile{rate}"
        spans = [(name.replace("_", " "), _span(values)) for name, values in self.values.items()]
        doubts = [f"doubtful: {doubt}" for doubt in self.doubts]
        return Summary(title, spans, [*self.notes, *doubts])

    def __str__(self) -> str:
        return self._summary.as_text()

    def _repr_html_(self) -> str:
        from jbeamshell import plotting

        return self._summary.as_html(plotting.thumbnail(self.plot(figure=next(iter(self.values)))))

    def plot(self, axes: Any = None, **options: Any) -> Any:
        """Draw a figure over one key, a curve for each value of another; see `plotting.sweep`."""
        from jbeamshell import plotting

        return plotting.sweep(self, axes, **options)

    def plot_contour(self, axes: Any = None, **options: Any) -> Any:
        """Draw a figure as a map over two keys; see `plotting.sweep_contour`."""
        from jbeamshell import plotting

        return plotting.sweep_contour(self, axes, **options)

    def plot_master(self, axes: Any = None, **options: Any) -> Any:
        """Draw the dissipation ratio over A/eta; see `plotting.master_curve`."""
        from jbeamshell import plotting

        return plotting.master_curve(self, axes, **options)


def _span(values: np.ndarray) -> str:
    """Smallest and largest number, in words."""
    known = values[np.isfinite(values)]
    return f"{known.min():.6g} to {known.max():.6g}" if known.size else "none"


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
