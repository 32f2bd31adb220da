"""`jbeamshell sweep`: figures of many scenes over ranges of their numbers."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import time
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from jbeamshell.cli.arguments import add_json, add_scene, add_settings, scene_of
from jbeamshell.cli.dimensions import add_dimensions
from jbeamshell.cli.terminal import UNCONVERGED, put, say, say_written, warn
from jbeamshell.common.errors import DoubtfulWarning, InputError
from jbeamshell.common.files import as_path
from jbeamshell.common.summary import Summary

MOST = 2_000_000  # numbers in one JSON text
WAIT = 10.0  # seconds in which a scheduler must answer
RANGE = "write KEY=START:STOP:COUNT, KEY=START:STOP:COUNT:log or KEY=a,b,c"


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser(
        "sweep",
        help="run many scenes over ranges of their numbers",
        description="Compute the dissipation and other figures of the last cycle over ranges of "
        "any of a scene's numbers, on all cores or on many machines.  Each "
        "combination of values is one lane: one strip of the sweep.",
    )
    add_scene(parser)
    add_dimensions(parser, lap=True)
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
        "--dask",
        metavar="ADDRESS",
        help="share the lanes among the workers of the dask scheduler at this address, such as "
        "tcp://10.0.0.1:8786",
    )
    parser.add_argument("--processes", help=argparse.SUPPRESS)
    add_settings(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Sweep, report and write; returns the exit code."""
    from jbeamshell.sweeping.run import FIGURES, sweep

    if options.processes is not None:
        raise InputError("--processes: is no option any more: a sweep takes all cores by itself")
    over = ranges(options.over)
    figures = FIGURES if options.figures is None else _names(options.figures)
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
    begun = time.perf_counter()
    with _workers(options.dask) as executor, warnings.catch_warnings():
        warnings.simplefilter("ignore", DoubtfulWarning)  # printed below
        result = sweep(
            scene,
            over,
            figures,
            paired=options.paired,
            out=options.out,
            executor=executor,
        )
    return _report(options, result, time.perf_counter() - begun)


def _report(options: argparse.Namespace, result: Any, wall_s: float) -> int:
    """Print and draw the sweep; returns the exit code."""
    from jbeamshell.common import files
    from jbeamshell.sweeping.lanes import Outcome

    about, counts = (
        result.attrs,
        np.bincount(result["status"].values.ravel(), minlength=len(Outcome)),
    )
    failed = int(np.sum(counts[Outcome.MAX_ITERATIONS : Outcome.OUTSIDE]))
    if options.json:
        found = {"lanes": int(np.sum(counts)), "failed": failed, "wall_s": wall_s}
        put(files.as_json(found | _plain(result)))
    else:
        figures = ((str(name), result[name].values) for name in list(result)[:-2])
        spans = [(name.replace("_", " "), _span(values)) for name, values in figures]
        notes = [about["mounting"]] if about["mounting"] else []
        put(Summary(f"{about['summary']}; {wall_s:.1f} s", spans, notes).as_text() + "\n")
    for words in filter(None, (about["doubts"], about["notes"])):
        warn(words)
    written = [options.out] if options.out else []
    if options.plot:
        from jbeamshell import plotting

        sheet = plotting.sweep_sheet(result)
        plotting.save(sheet, options.plot)
        plotting.close(sheet)
        written.append(options.plot)
    if written:
        say_written(written)
    return UNCONVERGED if failed else 0


def _plain(result: Any) -> dict[str, Any]:
    """Sweep as plain numbers, words and lists, for JSON; None where there is no number."""
    words = np.array(result["status"].attrs["flag_meanings"].split())
    axes = {key: axis.values.tolist() for key, axis in result.coords.items() if "." in key}
    figures = {name: result[name].values for name in list(result)[:-2]}
    return {
        "shape": list(result["status"].shape),
        "axes": axes,
        "values": {
            name: np.where(np.isfinite(values), values, np.array(None)).tolist()
            for name, values in figures.items()
        },
        "status": words[result["status"].values].tolist(),
        "doubtful": result["doubtful"].values.tolist(),
    } | {name: result.attrs[name] for name in ("summary", "doubts", "notes", "plan", "mounting")}


def _span(values: np.ndarray) -> str:
    """Smallest and largest number, in words."""
    known = values[np.isfinite(values)]
    return f"{known.min():.6g} to {known.max():.6g}" if known.size else "none"


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
def _workers(address: str | None) -> Iterator[Executor | None]:
    """Executor of the dask scheduler at an address; None without one."""
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--dask: needs dask: pip install 'jbeamshell[dask]'") from None
    try:
        client = Client(address, timeout=WAIT)
    except (OSError, ValueError, TypeError) as error:  # no scheduler there; no address
        raise InputError(f"--dask {address}: finds no dask scheduler there ({error})") from None
    with client:
        yield client.get_executor()
