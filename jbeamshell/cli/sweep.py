"""`jbeamshell sweep`: figures of many scenes over ranges of their numbers."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jbeamshell.cli.arguments import add_json, add_scene, add_settings, scene_of
from jbeamshell.cli.terminal import UNCONVERGED, put, say, say_written, warn
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_path

MOST = 2_000_000  # numbers in one JSON text
RANGE = "write KEY=START:STOP:COUNT, KEY=START:STOP:COUNT:log or KEY=a,b,c"


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser(
        "sweep",
        help="run many scenes over ranges of their numbers",
        description="Compute the dissipation and other figures of the last cycle over ranges of "
        "any of a scene's numbers, on all local devices or in several processes.  Each "
        "combination of values is one lane: one strip of the sweep.",
    )
    add_scene(parser)
    parser.add_argument(
        "--over",
        action="append",
        default=[],
        metavar="KEY=VALUES",
        help="key to vary and its values: START:STOP:COUNT (evenly spaced), START:STOP:COUNT:log "
        "(evenly spaced in the logarithm) or a,b,c; repeat it for several keys",
    )
    parser.add_argument(
        "--paired",
        action="store_true",
        help="pair the first values of all keys, the second ones and so on, instead of combining "
        "each with each",
    )
    parser.add_argument(
        "--figures", metavar="NAME,NAME,...", help="figures of the last cycle to compute"
    )
    parser.add_argument(
        "--out",
        metavar="FILE.csv",
        help="write the table to this file; a sweep that was interrupted goes on from it",
    )
    parser.add_argument("--plot", metavar="FILE.png", help="draw the sweep to this file")
    parser.add_argument(
        "--processes",
        type=int,
        default=1,
        metavar="N",
        help="number of processes on this machine (default 1)",
    )
    parser.add_argument(
        "--coordinator",
        metavar="HOST:PORT",
        help="address of the first process, for a sweep on several machines",
    )
    parser.add_argument(
        "--process", type=int, metavar="I", help="number of this process on them, from 0"
    )
    parser.add_argument("--of", type=int, metavar="N", help="number of processes on all machines")
    add_settings(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Sweep, report and write; returns the exit code."""
    from tqdm import tqdm

    from jbeamshell.sweeping.run import FIGURES, LOST, sweep

    over = ranges(options.over)
    figures = FIGURES if options.figures is None else _names(options.figures)
    first = _join(options)  # before anything else asks JAX for its devices
    scene = scene_of(options)
    count = (max if options.paired else math.prod)([v.size for v in over.values()]) * len(figures)
    if options.json and count > MOST:
        raise InputError(
            f"--json: {count:,} numbers are more than the {MOST:,} that one JSON text may hold: "
            "leave it out and give --out FILE.csv"
        )
    if options.plot is not None:
        _check_picture(options.plot)
    say("compiling ...")
    with tqdm(disable=None if first else True, file=sys.stderr, unit="lane") as bar:

        def progress(done: int, total: int) -> None:
            if bar.total is None:
                bar.total, bar.initial, bar.n = total, done, done
            bar.update(done - bar.n)

        with _clean_output(options.coordinator is not None):
            result = sweep(
                scene,
                over,
                figures,
                paired=options.paired,
                out=options.out,
                processes=options.processes,
                progress=progress,
            )
    code = _report(options, result, first)
    if LOST in result.notes:  # JAX would wait for the lost process at exit, and abort
        sys.stdout.flush()
        os._exit(code)
    return code


def _report(options: argparse.Namespace, result: Any, first: bool) -> int:
    """Print and draw the sweep, in the first of the processes; returns the exit code."""
    from jbeamshell import plotting
    from jbeamshell.common import files

    if not first:
        return UNCONVERGED if result.failed else 0
    put(files.as_json(result.figures()) if options.json else f"{result}\n")
    if result.outside:
        warn(f"{result.outside:,} lanes lie outside the model's domain: {result.why_outside}")
    if result.undefined:
        warn(f"{result.undefined:,} lanes have a figure that is not defined there (0/0)")
    if result.failed:
        warn(
            f"{result.failed:,} lanes found no equilibrium, neither in the batch nor alone: see "
            "their status"
        )
    written = [options.out] if options.out else []
    if options.plot:
        sheet = plotting.sweep_sheet(result)
        plotting.save(sheet, options.plot)
        plotting.close(sheet)
        written.append(options.plot)
    if written:
        say_written(written)
    return UNCONVERGED if result.failed else 0


def ranges(texts: Sequence[str]) -> dict[str, np.ndarray]:
    """Values by key from texts KEY=START:STOP:COUNT and the like, each (count,)."""
    from jbeamshell.scene.keys import check_key

    if not texts:
        raise InputError(f"--over: name at least one key to vary: {RANGE}")
    over: dict[str, np.ndarray] = {}
    for text in texts:
        key, separator, words = (part.strip() for part in text.partition("="))
        if not separator:
            raise InputError(f"--over {text}: {RANGE}")
        check_key(key)
        if key in over:
            raise InputError(f"--over {text}: {key} is given twice; write its values in one list")
        over[key] = _range(text, words) if ":" in words else _list(text, words)
    return over


def _names(text: str) -> tuple[str, ...]:
    """Names between commas."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def _list(text: str, words: str) -> np.ndarray:
    """Values of a,b,c; `text` is the whole option, for messages."""
    if not words:
        raise InputError(f"--over {text}: is empty; {RANGE}")
    return np.array([_number(text, word) for word in words.split(",")])


def _range(text: str, words: str) -> np.ndarray:
    """Values of START:STOP:COUNT or START:STOP:COUNT:log."""
    from jbeamshell.sweeping.lanes import check_size

    parts = [part.strip() for part in words.split(":")]
    if len(parts) not in (3, 4) or parts[3:] not in ([], ["log"]):
        raise InputError(f"--over {text}: {RANGE}")
    start, stop = _number(text, parts[0]), _number(text, parts[1])
    try:
        count = int(parts[2])
    except ValueError:
        raise InputError(f"--over {text}: COUNT must be a whole number; {RANGE}") from None
    if count < 1:
        raise InputError(f"--over {text}: is empty; COUNT must be 1 or more")
    check_size(count, 1)
    if len(parts) == 3:
        return np.linspace(start, stop, count)
    if min(start, stop) <= 0.0:
        raise InputError(f"--over {text}: START and STOP must be positive for a log range")
    return np.geomspace(start, stop, count)


def _number(text: str, word: str) -> float:
    """A finite number."""
    with contextlib.suppress(ValueError):
        number = float(word)
        if math.isfinite(number):
            return number
    raise InputError(f"--over {text}: {word.strip()!r} is not a finite number; {RANGE}")


def _check_picture(path: str) -> None:
    """Raise `InputError` before the work for a picture that could not be written after it."""
    folder = as_path(path).parent
    if not os.path.isdir(folder):
        raise InputError(f"--plot {path}: there is no folder {folder}; make it first")
    if Path(path).suffix.lower() not in (".png", ".pdf", ".svg"):
        raise InputError(f"--plot {path}: end the name in .png, .pdf or .svg")


@contextlib.contextmanager
def _clean_output(joined: bool) -> Iterator[None]:
    """Send what JAX prints among joined processes to standard error, away from the result."""
    if not joined:
        yield
        return
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def _join(options: argparse.Namespace) -> bool:
    """Join the processes of other machines, if asked; True in the first of them."""
    parts = {name: getattr(options, name) for name in ("coordinator", "process", "of")}
    missing = [f"--{name}" for name, value in parts.items() if value is None]
    if len(missing) == len(parts):
        return True
    if missing:
        raise InputError(
            f"{' and '.join(missing)}: is missing; several machines need --coordinator, --process "
            "and --of"
        )
    host, _, port = options.coordinator.rpartition(":")
    if not host or not port.isdigit():
        raise InputError(
            f"--coordinator {options.coordinator}: write HOST:PORT, such as 10.0.0.1:1234"
        )
    if not 0 <= options.process < options.of:
        raise InputError(f"--process {options.process}: count from 0 to {options.of - 1}")
    try:
        jax.distributed.initialize(options.coordinator, options.of, options.process)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"--coordinator {options.coordinator}: {error}") from None
    return options.process == 0
