"""Finished blocks on disk, from which a sweep that was interrupted goes on."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.common.files import written_whole
from jbeamshell.sweeping.runner import Block

if TYPE_CHECKING:
    from jbeamshell.sweeping.results import Sweep

DESCRIPTION = "sweep.npz"
FINISHED = re.compile(r"block-(\d+)\.npz$")
OURS = re.compile(r"(sweep|block-\d+)\.npz$|table\.csv$|\.")  # with their drafts


class Store:
    """Folder with a sweep's description and one file for every finished block.

    Only the process that sweeps writes to it, and files whole: a block is there or it is not.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)

    def open(self, description: str, axes: Mapping[str, np.ndarray]) -> None:
        """Make the folder, or continue with the one that is there.

        Parameters
        ----------
        description : text that identifies the sweep
        axes : values by key

        Raises
        ------
        InputError
            if the folder cannot be made, or holds anything but this sweep
        """
        place = self.folder / DESCRIPTION
        try:
            self.folder.mkdir(exist_ok=True)
            strange = [path for path in self.folder.iterdir() if not OURS.match(path.name)]
        except OSError as error:
            raise InputError(f"{self.folder}: cannot be made ({error.strerror})") from None
        if strange:
            raise InputError(
                f"{self.folder}: is no unfinished sweep: rename the folder, or give another name"
            )
        if not place.exists() and not self.done():
            with written_whole(place) as draft:
                numbers: dict[str, Any] = {f"axis_{i}": v for i, v in enumerate(axes.values())}
                np.savez(draft, description=np.array(description), **numbers)
        held, values = self.read()
        ours = list(axes.values())
        same = held == description and len(values) == len(ours)
        if not same or not all(map(np.array_equal, values, ours)):
            raise InputError(
                f"{self.folder}: holds another sweep that is not finished: "
                "give another name, or delete the folder"
            )

    def read(self) -> tuple[str, list[np.ndarray]]:
        """Description and values of the axes."""
        try:
            held = _arrays(self.folder / DESCRIPTION)
            axes = [held[f"axis_{i}"] for i in range(len(held) - 1)]
            return str(held["description"]), axes
        except Exception:  # a damaged file can raise anything
            raise InputError(
                f"{self.folder}: holds no sweep that can be read: delete the folder"
            ) from None

    def done(self) -> set[int]:
        """Numbers of the finished blocks."""
        with contextlib.suppress(OSError):
            found = [FINISHED.match(name) for name in os.listdir(self.folder)]
            return {int(match[1]) for match in found if match}
        return set()

    def save(self, number: int, block: Block) -> None:
        """Write a finished block."""
        with written_whole(self._place(number)) as draft:
            np.savez(draft, values=block.values, status=block.status)

    def load(self, number: int, figures: int, lanes: int) -> Block | None:
        """Block with these numbers of figures and lanes; None if damaged, and its file removed."""
        with contextlib.suppress(Exception):  # a damaged file can raise anything
            block = Block(**_arrays(self._place(number)))
            sizes = block.values.shape, block.status.shape
            kinds = block.values.dtype.kind, block.status.dtype
            if sizes == ((figures, lanes), (lanes,)) and kinds == ("f", np.int8):
                return block
        self._place(number).unlink(missing_ok=True)
        return None

    def publish(self, result: Sweep, table: Path) -> None:
        """Write the table: first into the folder, so that a kill leaves no draft beside it."""
        draft = self.folder / "table.csv"
        result.to_csv(draft)
        try:
            draft.replace(table)
        except OSError as error:
            raise InputError(f"{table}: cannot be written ({error.strerror})") from None

    def remove(self) -> None:
        """Remove the sweep's files, and the folder if nothing else is in it."""
        with contextlib.suppress(OSError):
            ours = [p for p in self.folder.iterdir() if OURS.match(p.name) and p.is_file()]
            # The description goes last: without it, the rest could not be read after a kill.
            for path in sorted(ours, key=lambda path: path.name == DESCRIPTION):
                path.unlink(missing_ok=True)
            self.folder.rmdir()

    def _place(self, number: int) -> Path:
        return self.folder / f"block-{number:06d}.npz"


def _arrays(path: Path) -> dict[str, np.ndarray]:
    # NumPy leaves a handle of its own open if the file is damaged.
    with path.open("rb") as handle, np.load(handle, allow_pickle=False) as file:
        return dict(file)
