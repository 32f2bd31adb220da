"""Finished blocks on disk, one file each, from which a sweep that was interrupted goes on."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from jbeamshell.common.arrays import read_arrays, write_arrays
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import locked
from jbeamshell.sweeping.runner import Block


class Store:
    """Folder with one file for every finished block of a sweep.

    Only the process that sweeps writes to it, and files whole: a block is there or it is not.
    Blocks carry the mark of their sweep, and a check sum of their numbers and their own number: one
    that was changed, or belongs elsewhere, is computed again.

    Attributes
    ----------
    folder : the folder
    mark : text that identifies the sweep
    """

    def __init__(self, folder: str | os.PathLike[str], mark: str) -> None:
        self.folder, self.mark = Path(folder), mark

    @contextlib.contextmanager
    def opened(self) -> Iterator[None]:
        """Context in which no other sweep uses the folder, which is made if there is none.

        Raises
        ------
        InputError
            if the folder cannot be made, or if another process or thread is at it
        """
        with contextlib.ExitStack() as stack:
            try:
                self.folder.mkdir(exist_ok=True)
                alone = stack.enter_context(locked(self.folder))
            except OSError as error:
                raise InputError(f"{self.folder}: cannot be made ({error.strerror})") from None
            if not alone:
                raise InputError(
                    f"{self.folder}: another sweep writes to it now: wait for it, or give another "
                    "name"
                )
            yield

    def save(self, number: int, block: Block) -> None:
        """Write a finished block."""
        held = block._asdict() | {"mark": np.array(self.mark)}
        write_arrays(self._place(number), held, f"block {number}")

    def load(self, number: int, figures: int, lanes: int) -> Block | None:
        """Block with these numbers of figures and lanes; None if there is no whole one.

        Raises
        ------
        InputError
            if it is a block of another sweep
        """
        try:
            held = read_arrays(self._place(number), f"block {number}")
            mark, block = str(held.pop("mark")), Block(**held)
        except Exception:  # a damaged file can raise anything
            return None
        if mark != self.mark:
            raise InputError(
                f"{self.folder}: holds another sweep that is not finished: "
                "give another name, or delete the folder"
            )
        return block if block.fits(figures, lanes) else None

    def remove(self) -> None:
        """Remove the sweep's files, and the folder if nothing else is in it."""
        with contextlib.suppress(OSError):
            for path in self.folder.iterdir():
                # A name with a dot in front is a draft.
                if path.match("block-*.npz") or path.name.startswith("."):
                    path.unlink(missing_ok=True)
            self.folder.rmdir()

    def _place(self, number: int) -> Path:
        return self.folder / f"block-{number:06d}.npz"
