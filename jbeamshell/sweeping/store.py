"""Finished blocks on disk, from which a sweep that was interrupted goes on."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jbeamshell.common.arrays import check_sum, read_arrays, write_arrays
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import locked
from jbeamshell.sweeping.runner import Block

if TYPE_CHECKING:
    from jbeamshell.sweeping.results import Sweep

DESCRIPTION = "sweep.npz"
LOCK = ".lock"
FINISHED = re.compile(r"block-(\d+)\.npz$")
OURS = re.compile(r"(sweep|block-\d+)\.npz$|table\.csv$|\.")  # with their drafts


class Store:
    """Folder with a sweep's description and one file for every finished block.

    Only the process that sweeps writes to it, and files whole: a block is there or it is not.
    Blocks carry a check sum of their numbers, of their own number and of the sweep: one that was
    changed, or belongs elsewhere, is computed again.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        self._sweep = ""

    @contextlib.contextmanager
    def opened(self, description: str, axes: Mapping[str, np.ndarray]) -> Iterator[None]:
        """Context in which no other sweep uses the folder, which is made or continued with.

        Parameters
        ----------
        description : text that identifies the sweep
        axes : values by key

        Raises
        ------
        InputError
            if the folder cannot be made, or holds anything but this sweep, or if another process
            or thread is at it
        """
        with contextlib.ExitStack() as stack:
            try:
                self.folder.mkdir(exist_ok=True)
                strange = [path for path in self.folder.iterdir() if not OURS.match(path.name)]
                alone = not strange and stack.enter_context(locked(self.folder / LOCK))
            except OSError as error:
                raise InputError(f"{self.folder}: cannot be made ({error.strerror})") from None
            if strange:
                raise InputError(
                    f"{self.folder}: is no unfinished sweep: rename the folder, or give another "
                    "name"
                )
            if not alone:
                raise InputError(
                    f"{self.folder}: another sweep writes to it now: wait for it, or give another "
                    "name"
                )
            self._begin(description, axes)
            yield

    def _begin(self, description: str, axes: Mapping[str, np.ndarray]) -> None:
        """Write the description, or raise `InputError` if the folder has another one."""
        place = self.folder / DESCRIPTION
        named = {"description": np.array(description)}
        named |= {f"axis_{i}": np.asarray(v) for i, v in enumerate(axes.values())}
        self._sweep = check_sum(named)
        if not place.exists() and not self.done():
            write_arrays(place, named)
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
            held = read_arrays(self.folder / DESCRIPTION)
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
        write_arrays(self._place(number), block._asdict(), self._about(number))

    def load(self, number: int, figures: int, lanes: int) -> Block | None:
        """Block with these numbers of figures and lanes; None if damaged, and its file removed."""
        with contextlib.suppress(Exception):  # a damaged file can raise anything
            block = Block(**read_arrays(self._place(number), self._about(number)))
            if block.fits(figures, lanes):
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

    def _about(self, number: int) -> str:
        return f"block {number} of {self._sweep}"
