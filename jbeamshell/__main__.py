"""The command line: a thin skin over the library."""

from __future__ import annotations

import argparse
import ast
import os
import sys
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax

from jbeamshell import __version__
from jbeamshell.errors import InputError, UnconvergedError

BAD_INPUT, UNCONVERGED, INTERRUPTED = 2, 3, 130
EXAMPLE_START = {"contact.friction": 0.15, "strip.height_ratio": 0.2}
EXAMPLE_FREE = "contact.friction,strip.height_ratio"
CLOSES = 1e-3  # of its width: a loop that ends further off is not steady yet
ROUNDING = 1e-9  # of the pressure: less tension than this is none


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    jax.config.update("jax_enable_x64", True)
    try:
        return options.run(options)
    except InputError as error:
        return _complain(error, BAD_INPUT)
    except UnconvergedError as error:
        return _complain(error, UNCONVERGED)
    except KeyboardInterrupt:
        return _complain("interrupted; no file is left half-written", INTERRUPTED)


def _complain(error: object, code: int) -> int:
    print(f"jbeamshell: {' '.join(str(error).split())}", file=sys.stderr)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="jbeamshell",
        description="Beamshells on a rough foundation: hysteresis by micro-slip, and fits to it.",
        epilog="exit codes: 0 done, 2 bad input, 3 a load step or a fit did not converge",
    )
    parser.add_argument("--version", action="version", version=f"jbeamshell {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="press a strip down, load it to and fro, and report")
    run.add_argument(
        "scene",
        nargs="?",
        metavar="NAME|SCENE.toml",
        help="a scene that ships or one's own; default: the standard strip",
    )
    run.set_defaults(run=_run)

    listing = commands.add_parser("scenes", help="list the scenes that ship")
    listing.set_defaults(run=_scenes)

    fit = commands.add_parser("fit", help="fit a strip's parameters to a loop")
    fit.add_argument(
        "data", nargs="?", metavar="DATA.csv", help="default: the finite-element loops that ship"
    )
    fit.add_argument(
        "--scene", metavar="NAME|SCENE.toml", help="what stays fixed; default standard"
    )
    fit.add_argument(
        "--free", metavar="KEY,KEY,...", default=EXAMPLE_FREE, help=f"default {EXAMPLE_FREE}"
    )
    fit.add_argument(
        "--start",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="where a free parameter starts",
    )
    fit.set_defaults(run=_fit)
    for command in (run, fit):
        command.add_argument(
            "--set", action="append", default=[], metavar="KEY=VALUE", help="override a key"
        )
        command.add_argument("--out", metavar="DIR", help="write tables and pictures there")
    for command in (run, listing, fit):
        command.add_argument("--json", action="store_true", help="print the result as JSON")
    return parser


def _run(options: argparse.Namespace) -> int:
    from jbeamshell import output, quasistatic
    from jbeamshell.scene import overridden, scene_from_values

    scene = scene_from_values(overridden(_values_of(options.scene), _assignments(options.set)))
    quasistatic.check(scene)
    folder = output.check_folder(options.out) if options.out else None
    _say("compiling ...")
    begin = time.perf_counter()
    quasistatic.compile_for(scene)
    compiled = time.perf_counter()
    _say(f"compiled in {compiled - begin:.1f} s, solving ...")
    history = jax.block_until_ready(quasistatic.solve(scene))
    finished = time.perf_counter()
    timing = {"wall_s": finished - compiled, "compile_s": compiled - begin}
    figures = history.figures() | timing
    if abs(figures.get("closure", 0.0)) > CLOSES:
        _warn("the last loop does not close: give more load.cycles for a steady one")
    reaction = float(history.reaction_min)
    glued = "w" not in scene.model.fields
    if glued and reaction < -ROUNDING * float(scene.contact.largest_pressure):
        _warn(
            f"tension at the contact (reaction_min = {reaction:.4g}): the lift is frozen; add w to "
            "model.fields for unilateral contact, or take fewer model.nodes"
        )
    _print(output.as_json(figures) if options.json else f"{history}\n")
    if folder is not None:
        _say_written(output.write_run(folder, history, figures))
    return 0


def _scenes(options: argparse.Namespace) -> int:
    from jbeamshell import output, scenes

    summaries = {name: scenes.summary(name) for name in scenes.NAMES}
    lines = [f"{name:15s} {text}\n" for name, text in summaries.items()]
    _print(output.as_json(summaries) if options.json else "".join(lines))
    return 0


def _fit(options: argparse.Namespace) -> int:
    from tqdm import tqdm

    from jbeamshell import identify, loops, output
    from jbeamshell.example import example_loops
    from jbeamshell.parts import CONTROLS
    from jbeamshell.scene import overridden, scene_from_values

    free = [key.strip() for key in options.free.split(",") if key.strip()]
    start = _assignments(options.start)
    for key in start:
        if key not in free:
            raise InputError(f"--start {key}: is not among the free keys {', '.join(free)}")
    values: dict[str, Any] = {}
    if not options.data:
        values |= {key: value for key, value in EXAMPLE_START.items() if key in free}
    values = overridden(values, _values_of(options.scene))
    values = overridden(overridden(values, _assignments(options.set)), start)
    data = loops.read_loops(options.data) if options.data else example_loops()
    if "load.control" not in values:
        driver = values["load.control"] = identify.driver_of(data)
        _say(f"the {driver} drives these loops (set load.control to override)")
        if driver != "force":
            values.pop("load.amplitude", None)
    if "load.amplitude" not in values and values["load.control"] in CONTROLS:
        drives = [getattr(loop, values["load.control"]) for loop in data]
        values["load.amplitude"] = max(float(abs(drive).max()) for drive in drives)
    scene = scene_from_values(values)
    folder = output.check_folder(options.out) if options.out else None

    begin = time.perf_counter()
    with tqdm(total=identify.MAX_ITERATIONS, disable=None, file=sys.stderr, unit="step") as bar:

        def progress(line: str) -> None:
            bar.set_postfix_str(line)
            bar.update()

        result = identify.fit(data, scene, free, progress=progress)
    wall = time.perf_counter() - begin
    figures = result.figures() | {"wall_s": wall}
    _print(output.as_json(figures) if options.json else f"{result}\n")
    if folder is not None:
        _say_written(output.write_fit(folder, result, figures))
    return 0


def _values_of(scene: str | None) -> dict[str, Any]:
    """Dotted values of a file, or of a scene that ships by its name."""
    from jbeamshell import scenes
    from jbeamshell.scene import read_values

    if not scene:
        return {}
    path = Path(scene)
    is_file = path.suffix == ".toml" or path.name != scene or os.path.isfile(scene)
    return read_values(path) if is_file else scenes.values_of(scene)


def _assignments(texts: Sequence[str]) -> dict[str, Any]:
    values = {}
    for text in texts:
        key, separator, value = text.partition("=")
        if not separator:
            raise InputError(f"{text!r}: write KEY=VALUE, such as contact.friction=0.2")
        values[key.strip()] = _value(value.strip())
    if isinstance(values.get("model.fields"), str):  # a single one, without a comma
        values["model.fields"] = [values["model.fields"]]
    return values


def _value(text: str) -> Any:
    """A TOML value; else a number such as .5, a list of them, a word, or words between commas."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        pass
    try:
        return ast.literal_eval(text) if text.startswith("[") else float(text)
    except (ValueError, SyntaxError):
        return [word.strip() for word in text.split(",")] if "," in text else text


def _print(text: str) -> None:
    try:
        print(text, end="", flush=True)
    except BrokenPipeError:  # a reader such as head has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _say(text: str) -> None:
    if sys.stderr.isatty():
        print(text, file=sys.stderr)


def _warn(text: str) -> None:
    print(f"jbeamshell: warning: {text}", file=sys.stderr)


def _say_written(paths: Sequence[Any]) -> None:
    print("wrote " + ", ".join(map(str, paths)), file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
