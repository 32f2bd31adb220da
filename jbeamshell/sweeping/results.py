"""Result of a sweep: a set of arrays with named dimensions, and its table."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import written_whole
from jbeamshell.history.figures import units_of
from jbeamshell.history.reliability import doubted_from, finer_grid
from jbeamshell.scene.keys import unit_of
from jbeamshell.scene.load_path import check
from jbeamshell.scene.mounting import in_words
from jbeamshell.scene.toml import scene_to_toml
from jbeamshell.sweeping.lanes import Lanes, Outcome

if TYPE_CHECKING:
    import xarray

PURE = dict.fromkeys(("dissipation_ratio", "dissipation_error", "loss_factor"), "1")
NEGLIGIBLE = 1e-4  # dissipation over the bar's below which errors are over this share of the bar's
SCALED = "amplitude_over_height"
WORDS = [outcome.name.lower() for outcome in Outcome]


def dataset(
    lanes: Lanes, values: Mapping[str, np.ndarray], status: np.ndarray, notes: Iterable[str] = ()
) -> xarray.Dataset:
    """Sweep as a set of arrays; `jbeamshell.sweep` says what is in it.

    Parameters
    ----------
    lanes : lanes of the sweep
    values : figures by name, arrays of the lanes' shape; NaN where there is none
    status : codes of `Outcome`, an array of that shape
    notes : remarks for the reader
    """
    import xarray

    scene, load = lanes.scene, lanes.scene.load
    dims = ["lane"] if lanes.paired else list(lanes.axes)
    units, whole = units_of(scene) | PURE, scene.strip.width is not None
    errors = _errors(values, lanes.shape)
    solved = np.isin(status, (Outcome.CONVERGED, Outcome.UNDEFINED))
    doubtful = ~solved | (errors > doubted_from(scene.model.tolerance))
    flags = {"flag_values": np.array(Outcome, np.int8), "flag_meanings": " ".join(WORDS)}
    variables: dict[str, Any] = {
        name: (dims, figure, {"units": units[name]} if name in units else {})
        for name, figure in values.items()
    }
    variables |= {"status": (dims, status, flags), "doubtful": (dims, doubtful, {})}
    axes: dict[str, Any] = {
        key: ("lane" if lanes.paired else key, numbers, {"units": unit_of(key, load, whole)})
        for key, numbers in lanes.axes.items()
    }
    if np.any(np.isfinite(scaled := lanes.amplitude_over_height)):
        axes[SCALED] = (dims, scaled, {"units": "1"})
    try:
        text = scene_to_toml(scene)
    except InputError:  # a function of the user's own
        text = repr(scene)
    about = {
        "summary": _summary(lanes, status),
        "doubts": "; ".join(_doubts(lanes, status, errors)),
        "notes": "; ".join([*notes, *_notes(lanes, status)]),
        "plan": str(scene.plan),
        "mounting": in_words(scene, lanes.axes),
        "scene": text,
        "version": version("jbeamshell"),
    }
    return xarray.Dataset(variables, axes, about)


def write_csv(result: xarray.Dataset, path: str | os.PathLike[str]) -> None:
    """Write a sweep as a table, whole or not at all: a row for every lane, its status in words.

    Cells without a number stay empty.
    """
    keys = [key for key in result.coords if key != SCALED]
    frame = result.to_dataframe().reset_index()[[*keys, *result.data_vars]]
    frame["status"] = np.array(WORDS)[frame["status"]]
    with written_whole(path) as draft:
        frame.replace([np.inf, -np.inf], np.nan).to_csv(draft, index=False, lineterminator="\n")


def publish(result: xarray.Dataset, folder: Path, table: Path) -> None:
    """Write the table, first into a folder, so that a kill leaves no draft beside it."""
    draft = folder / ".table.csv"
    write_csv(result, draft)
    try:
        draft.replace(table)
    except OSError as error:
        raise InputError(f"{table}: cannot be written ({error.strerror})") from None


def _errors(values: Mapping[str, np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """Estimated errors of the dissipation, an array of the lanes' shape; 0 if unknown."""
    errors = values.get("dissipation_error", np.zeros(shape))
    ratio = values.get("dissipation_ratio", np.ones(shape))
    known = np.isfinite(ratio) & np.isfinite(errors)  # infinite where nothing slips
    share = np.where(known, np.minimum(ratio / NEGLIGIBLE, 1.0), 1.0)
    return errors * share


def _summary(lanes: Lanes, status: np.ndarray) -> str:
    over = ", ".join(f"{key} ({values.size})" for key, values in lanes.axes.items())
    paired = ", paired" if lanes.paired else ""
    good, failed, outside = _counts(status)
    return (
        f"{status.size:,} lanes over {over}{paired}: "
        f"{good:,} converged, {failed:,} failed, {outside:,} outside the domain"
    )


def _counts(status: np.ndarray) -> tuple[int, int, int]:
    """Numbers of lanes that were solved, that failed, and that lie outside the domain."""
    good = np.isin(status, (Outcome.CONVERGED, Outcome.UNDEFINED))
    failed = (status > Outcome.CONVERGED) & (status <= Outcome.NOT_REACHED)
    return int(np.sum(good)), int(np.sum(failed)), int(np.sum(status == Outcome.OUTSIDE))


def _doubts(lanes: Lanes, status: np.ndarray, errors: np.ndarray) -> list[str]:
    """Doubts about lanes that failed or may be off: how many, by how much, and the fix."""
    found = []
    if failed := _counts(status)[1]:
        found.append(
            f"{failed:,} of {status.size:,} lanes found no equilibrium, neither in their block nor "
            "alone: `status` marks them"
        )
    allowed = doubted_from(lanes.scene.model.tolerance)
    beyond = errors[errors > allowed]
    if beyond.size:
        worst = float(beyond.max())
        by = f"{100.0 * worst:.2g} %" if worst < 0.99 else "100 % or more"
        found.append(
            f"the dissipation of {beyond.size:,} of {status.size:,} lanes may be off by more than "
            f"{100.0 * allowed:.2g} %, at most by {by}: `doubtful` marks them; "
            f"{finer_grid(lanes.scene)}"
        )
    return found


def _notes(lanes: Lanes, status: np.ndarray) -> list[str]:
    """Remarks about lanes without numbers that are no failures."""
    found = []
    if outside := _counts(status)[2]:
        found.append(f"{outside:,} lanes lie outside the model's domain: {_why(lanes, status)}")
    if undefined := int(np.sum(status == Outcome.UNDEFINED)):
        found.append(f"{undefined:,} lanes have a figure that is not defined there (0/0)")
    return found


def _why(lanes: Lanes, status: np.ndarray) -> str:
    """Reason why the first lane outside the domain is there."""
    first = np.flatnonzero(status == Outcome.OUTSIDE)[:1]
    values = lanes.columns(first)[:, 0].tolist()
    try:
        check(lanes.scene.replace(dict(zip(lanes.axes, values, strict=True))))
    except InputError as error:
        return str(error)
    return "on the edge of the domain"  # the scene alone is inside by round-off
