"""`jbeamshell fit`: parameters with uncertainty from files of measured or computed curves."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from jbeamshell.cli.arguments import (
    add_columns,
    add_folder,
    add_json,
    add_settings,
    assignments,
    pairs,
)
from jbeamshell.cli.dimensions import add_dimensions, dimensions
from jbeamshell.cli.terminal import NOT_DESCRIBED, put, say, say_written
from jbeamshell.common.errors import InputError

EXAMPLE_ENTRY = {"load.entry": "traction"}
EXAMPLE_START = {"contact.friction": 0.15, "strip.height_ratio": 0.2}
EXAMPLE_FREE = "contact.friction,strip.height_ratio"

# Options by name: (placeholder of the value, help).
REPEATED = {
    "start": ("KEY=VALUE", "start of the search for a free parameter"),
    "bounds": ("KEY=LOW:HIGH", "bounds of a free parameter; leave one side empty for none"),
    "prior": ("KEY=MEAN:DEVIATION", "prior knowledge of a free parameter: a normal distribution"),
    "profile": ("KEY", "also compute the profile likelihood of a free parameter"),
}
WORDS = {
    "kind": "kind of data: loop (default), backbone, or a curve by its name, such as dissipation",
    "cycles": "cycles of a recording to fit: steady (the mean of those that repeat), recorded "
    "(all, as they stand) or auto (default: what suits the recording)",
    "drift": "drift of a recording: keep (default), linear (remove a straight line) or cycle "
    "(remove the mean of each cycle)",
    "reverse": "column whose sign is turned: force or displacement",
}
NUMBERS = {
    "noise": (float, "standard deviation of the data, as a fraction of their range"),
    "starts": (int, "number of searches from different starts"),
}


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser(
        "fit",
        help="fit parameters of a strip to measured or computed curves",
        description="Fit parameters of a strip to measured or computed curves by least squares.  "
        "Reports their uncertainty, and which of them the data cannot determine.",
    )
    parser.add_argument(
        "data",
        nargs="*",
        metavar="DATA|PLAN.toml",
        help="files of one specimen (.csv, .txt, .mat, .npz, .h5, .tdms, .uff), or a plan of "
        "several specimens; default: the finite-element loops that ship",
    )
    parser.add_argument(
        "--scene",
        metavar="NAME|SCENE.toml",
        help="scene whose other keys stay fixed (default: the standard strip)",
    )
    parser.add_argument(
        "--model",
        metavar="NAME",
        help="law of a joint in place of a strip: iwan4, jenkins, bouc-wen, sliders4, ...",
    )
    parser.add_argument(
        "--free",
        metavar="KEY,KEY,...",
        help="parameters to fit (default: those that the data tell, with reasons)",
    )
    for name, (metavar, text) in REPEATED.items():
        parser.add_argument(f"--{name}", action="append", default=[], metavar=metavar, help=text)
    for name, text in WORDS.items():
        parser.add_argument(f"--{name}", metavar="WORD", help=text)
    for name, (kind, text) in NUMBERS.items():
        parser.add_argument(f"--{name}", type=kind, metavar="NUMBER", help=text)
    parser.add_argument(
        "--centre",
        action=argparse.BooleanOptionalAction,
        help="shift loops so that their centres, or their unloaded starts, lie at the origin: "
        "removes the sensors' offsets (default: only where no joint answers so)",
    )
    add_columns(parser)
    add_dimensions(parser)
    parser.add_argument(
        "--unchecked",
        action="store_true",
        default=None,
        help="fit data that `jbeamshell inspect` refuses too",
    )
    parser.add_argument(
        "--save",
        metavar="FILE",
        help="keep every run of the model in this file, and go on from what it holds",
    )
    add_settings(parser)
    add_folder(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Fit, report and write; returns the exit code, `NOT_DESCRIBED` if the model is not theirs."""
    from jbeamshell.common import files
    from jbeamshell.plotting.folder import check_folder

    plan = _plan(options)
    for key in options.profile:
        if key not in [p.key for p in plan.free]:
            free = ", ".join(p.key for p in plan.free)
            raise InputError(f"--profile {key}: is not among the free keys {free}")
    for note in plan.notes:
        say(note)
    folder = None if options.out is None else check_folder(options.out)
    begin = time.perf_counter()
    result = plan.run(save=options.save)
    names = [name for name in result.values if name.partition("[")[0] in options.profile]
    profiles = [result.profile(name) for name in names]
    wall = time.perf_counter() - begin
    figures = result.figures() | {"wall_s": wall}
    if profiles:
        figures["profiles"] = {profile.name: profile.figures() for profile in profiles}
    lines = "".join(f"{part}\n" for part in (result, *profiles))
    put(files.as_json(figures) if options.json else lines)
    if folder is not None:
        say_written(result.save(folder, profiles, figures))
    return 0 if result.describes else NOT_DESCRIBED


def _plan(options: argparse.Namespace) -> Any:
    """Plan of a file, or of the options."""
    from jbeamshell.identify import plan_file

    changed = {name: getattr(options, name) for name in plan_file.OPTIONS if _given(options, name)}
    if any(name.endswith(".toml") for name in options.data):
        return _plan_of_file(options, changed)
    values = changed | {"set": assignments(options.set), "free": _free(options)}
    for name in ("scene", "model"):
        if _given(options, name):
            values[name] = getattr(options, name)
    if not options.data:
        return _example(values)
    specimen: dict[str, Any] = {"data": options.data}
    specimen |= dimensions(options)
    for name in ("kind", "cycles", "drift", "centre", "reverse", "decimal"):
        if _given(options, name):
            specimen[name] = getattr(options, name)
    specimen["columns"] = pairs(options.column, "force=FT")
    specimen["units"] = pairs(options.unit, "force=kN")
    return plan_file.plan_from_values(values | {"specimen": [specimen]}, Path())


def _plan_of_file(options: argparse.Namespace, changed: dict[str, Any]) -> Any:
    """Plan of a file; options may change the search, not the data or the parameters."""
    from jbeamshell.identify import plan_file

    if len(options.data) > 1:
        raise InputError(f"{' '.join(options.data)}: give one plan, or files of data alone")
    ours = ("data", "json", "out", "save", "profile", "run", *plan_file.OPTIONS)
    for name in sorted(set(vars(options)) - set(ours)):
        if _given(options, name):
            raise InputError(f"--{name}: {options.data[0]} is a plan; write this into the plan")
    return plan_file.read_plan(options.data[0], **changed)


def _example(values: dict[str, Any]) -> Any:
    """Plan of the finite-element loops that ship."""
    from jbeamshell.identify.plan_file import plan_from_values
    from jbeamshell.measured.example import example_loops
    from jbeamshell.scene import library
    from jbeamshell.scene.toml import overridden

    if "model" not in values:
        start = {key: value for key, value in EXAMPLE_START.items() if key in values["free"]}
        scene = values.pop("scene", None)
        below = EXAMPLE_ENTRY | start
        below = overridden(below, {} if scene is None else library.values_from(scene))
        values["set"] = overridden(below, values["set"])
    return plan_from_values(values, Path(), example_loops())


def _given(options: argparse.Namespace, name: str) -> bool:
    """True if an option was given."""
    return getattr(options, name, None) not in (None, [])


def _free(options: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """Table of each free parameter, as a plan has it."""
    about = (*options.start, *options.bounds, *options.prior)
    chosen = options.data or options.model is not None
    if options.free is None and chosen and not about:
        return {}  # the data choose
    words = EXAMPLE_FREE if options.free is None else options.free
    keys = [key.strip() for key in words.split(",") if key.strip()]
    if not keys:
        raise InputError("free: name at least one key, such as contact.friction")
    if len(set(keys)) < len(keys):
        raise InputError(f"--free {words}: names a key twice; name it once")
    free: dict[str, dict[str, Any]] = {key: {} for key in keys}

    def table(option: str, key: str) -> dict[str, Any]:
        if key not in free:
            raise InputError(f"--{option} {key}: is not among the free keys {', '.join(free)}")
        return free[key]

    for key, value in assignments(options.start).items():
        table("start", key)["start"] = value
    for key, text in pairs(options.bounds, "contact.friction=0.05:0.5").items():
        low, high = _two(f"--bounds {key}={text}", text)
        table("bounds", key).update({"low": low, "high": high})
    for key, text in pairs(options.prior, "contact.friction=0.1:0.02").items():
        table("prior", key)["prior"] = _two(f"--prior {key}={text}", text)
    return free


def _two(option: str, text: str) -> tuple[float | None, float | None]:
    """The numbers left and right of a colon; None where there is none."""
    parts = text.split(":")
    try:
        first, second = (float(part) if part.strip() else None for part in parts)
    except ValueError:
        raise InputError(
            f"{option}: write two numbers with a colon between them, such as 0.05:0.5"
        ) from None
    return first, second
