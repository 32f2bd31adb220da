"""CalculiX, run in a folder of its own, watched, and stopped when its caller is."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jbeamshell.common.errors import InputError

JOB = "strip"
INSTALL = "install it (Debian, Ubuntu: apt-get install calculix-ccx), or say where it is: CCX=PATH"
PATIENCE = 0.1  # seconds between two looks at the status file
LAST_WORDS = 6  # lines of CalculiX's output in an error


class Outcome(NamedTuple):
    """Outcome of a run of CalculiX.

    Attributes
    ----------
    finished : whether it says so itself
    data : the printed results, text
    increments : (increments, 2) total time at the end of each, and its iterations
    message : its last words
    seconds : wall time
    folder : where its files are, or were
    """

    finished: bool
    data: str
    increments: np.ndarray
    message: str
    seconds: float
    folder: Path


def find_program(program: str | os.PathLike[str] | None = None) -> str:
    """Path of CalculiX: what is given, else the environment's CCX, else ccx."""
    wanted = os.fspath(program or os.environ.get("CCX") or "ccx")
    found = shutil.which(wanted)
    if found is None:
        raise InputError(f"program = {wanted!r}: CalculiX is not there; {INSTALL}")
    return os.path.abspath(found)


def run(
    deck: str, levels: int, program: str, folder: str | os.PathLike[str] | None = None
) -> Outcome:
    """Run a deck to its end, showing the levels done where a person watches.

    Parameters
    ----------
    deck : input deck, whose total time is the number of levels
    levels : that number
    program : path of CalculiX
    folder : where to run; None is a temporary folder that stays only if CalculiX stops early
    """
    place = Path(tempfile.mkdtemp(prefix="jbeamshell-ccx-")) if folder is None else Path(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
        for old in place.glob(f"{JOB}.*"):
            old.unlink()
        (place / f"{JOB}.inp").write_text(deck, encoding="ascii")
    except OSError as error:
        raise InputError(f"folder = {place}: cannot be written ({error.strerror})") from None
    try:
        outcome = _run(place, levels, program)
    except BaseException:  # interrupted, or not a program: nobody will look at the files
        if folder is None:
            shutil.rmtree(place, ignore_errors=True)
        raise
    if folder is None and outcome.finished:
        shutil.rmtree(place, ignore_errors=True)
    return outcome


def version(program: str) -> str:
    """Name and version that CalculiX prints."""
    answer = subprocess.run([program, "-v"], capture_output=True, text=True, check=False)
    return " ".join(answer.stdout.split()).removeprefix("This is ")


def _run(place: Path, levels: int, program: str) -> Outcome:
    environment = {"OMP_NUM_THREADS": "1"} | dict(os.environ)
    begin = time.perf_counter()
    with (place / f"{JOB}.log").open("wb") as log:
        try:
            process = subprocess.Popen(
                [program, JOB], cwd=place, env=environment, stdout=log, stderr=subprocess.STDOUT
            )
        except OSError as error:
            raise InputError(f"program = {program!r}: cannot be run ({error.strerror})") from None
        try:
            _watch(process, place, levels)
        finally:
            process.kill()
            process.wait()
    said = _read(place / f"{JOB}.log")
    return Outcome(
        finished=process.returncode == 0 and "Job finished" in said,
        data=_read(place / f"{JOB}.dat"),
        increments=_increments(place),
        message=_last_words(said, process.returncode),
        seconds=time.perf_counter() - begin,
        folder=place,
    )


def _watch(process: subprocess.Popen[bytes], folder: Path, levels: int) -> None:
    from tqdm import tqdm

    with tqdm(total=levels, disable=None, file=sys.stderr, unit="level", desc="ccx") as bar:
        while True:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(PATIENCE)
            if not bar.disable:
                times = _increments(folder)[:, 0]
                bar.update(int(times[-1] if times.size else 0) - bar.n)
            if process.returncode is not None:
                return


def _increments(folder: Path) -> np.ndarray:
    """Total time and iterations of the increments that converged, (increments, 2)."""
    rows = []
    for line in _read(folder / f"{JOB}.sta").splitlines():
        words = line.split()
        # STEP INC ATT ITRS TOT-TIME STEP-TIME INC-TIME; an attempt cut short has a U behind ATT.
        if len(words) == 7 and words[0].isdigit() and words[2].isdigit():
            rows.append((float(words[4]), float(words[3])))
    return np.array(rows).reshape(-1, 2)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii", errors="replace")
    except FileNotFoundError:
        return ""


def _last_words(said: str, code: int) -> str:
    """From CalculiX's first complaint on, or what it said last."""
    lines = [" ".join(line.split()) for line in said.splitlines() if line.strip()]
    complaints = [k for k, line in enumerate(lines) if "*ERROR" in line]
    first = complaints[0] if complaints else -LAST_WORDS
    return " / ".join([*lines[first:][:LAST_WORDS], f"exit code {code}"])
