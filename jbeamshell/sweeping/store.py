"""Finished blocks on disk, so that nothing computed is lost: a sweep that was cut off goes on."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jbeamshell.errors import InputError
from jbeamshell.files import written_whole
from jbeamshell.sweeping.runner import Block

DESCRIPTION = "sweep.npz"
FINISHED = re.compile(r"block-(\d+)\.npz$")
OURS = re.compile(r"sweep\.npz$|block-\d+\.npz$|worker-\d+\.|\.")  # and drafts, of any of them
UNREADABLE = (OSError, TypeError, ValueError, KeyError, EOFError, zipfile.BadZipFile)


class Store:
    """A folder with a sweep's description and one file for every finished block.

    Files are written whole, by any number of processes; a block is there or it is not.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)

    @property
    def cache(self) -> Path:
        """Where workers share what they compile."""
        return self.folder / ".compiled"

    def open(self, description: str, axes: Mapping[str, np.ndarray]) -> None:
        """Make the folder, or take up what it holds if it is of this very sweep."""
        place = self.folder / DESCRIPTION
        try:
            self.folder.mkdir(exist_ok=True)
            strange = [path for path in self.folder.iterdir() if not OURS.match(path.name)]
        except OSError as error:
            raise InputError(f"{self.folder}: cannot be made ({error.strerror})") from None
        if strange:
            raise InputError(f"{self.folder}: is no unfinished sweep: rename it, or give another")
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
        """The description and the axes' values."""
        try:
            held = _arrays(self.folder / DESCRIPTION)
            axes = [held[f"axis_{i}"] for i in range(len(held) - 1)]
            return str(held["description"]), axes
        except UNREADABLE:
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
        with written_whole(self._place(number)) as draft:
            np.savez(draft, values=block.values, status=block.status)

    def load(self, number: int, lanes: int) -> Block | None:
        """A block of so many lanes; None, and no file any more, if it is damaged."""
        with contextlib.suppress(*UNREADABLE):
            block = Block(**_arrays(self._place(number)))
            if block.values.shape[-1] == block.status.size == lanes:
                return block
        self._place(number).unlink(missing_ok=True)
        return None

    def remove(self) -> None:
        """Remove what a sweep leaves in the folder, and the folder if nothing else is in there."""
        shutil.rmtree(self.cache, ignore_errors=True)
        with contextlib.suppress(OSError):
            for path in self.folder.iterdir():
                if OURS.match(path.name) and path.is_file():
                    path.unlink(missing_ok=True)
            self.folder.rmdir()

    def _place(self, number: int) -> Path:
        return self.folder / f"block-{number:06d}.npz"


def _arrays(path: Path) -> dict[str, np.ndarray]:
    # A handle of our own: NumPy leaves its own open where the file is damaged.
    with path.open("rb") as handle, np.load(handle, allow_pickle=False) as file:
        return dict(file)
