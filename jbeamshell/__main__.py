"""The command line: a thin skin over the library."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence

import jax

from jbeamshell import __version__, fit_command
from jbeamshell.errors import InputError, UnconvergedError
from jbeamshell.terminal import assignments, put, say, say_written, warn

BAD_INPUT, UNCONVERGED, INTERRUPTED = 2, 3, 130
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
    except KeyboardInterrupt as error:
        return _complain(str(error) or "interrupted; no file is left half-written", INTERRUPTED)


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

    fit = fit_command.add_to(commands)
    for command in (run, fit):
        command.add_argument(
            "--set", action="append", default=[], metavar="KEY=VALUE", help="override a key"
        )
        command.add_argument("--out", metavar="DIR", help="write tables and pictures there")
    for command in (run, listing, fit):
        command.add_argument("--json", action="store_true", help="print the result as JSON")
    return parser


def _run(options: argparse.Namespace) -> int:
    from jbeamshell import output, quasistatic, scenes
    from jbeamshell.scene import overridden, scene_from_values

    given = scenes.values_from(options.scene) if options.scene else {}
    scene = scene_from_values(overridden(given, assignments(options.set)))
    quasistatic.check(scene)
    folder = output.check_folder(options.out) if options.out else None
    say("compiling ...")
    begin = time.perf_counter()
    quasistatic.compile_for(scene)
    compiled = time.perf_counter()
    say(f"compiled in {compiled - begin:.1f} s, solving ...")
    history = jax.block_until_ready(quasistatic.solve(scene))
    finished = time.perf_counter()
    timing = {"wall_s": finished - compiled, "compile_s": compiled - begin}
    figures = history.figures() | timing
    if abs(figures.get("closure", 0.0)) > CLOSES:
        warn("the last loop does not close: give more load.cycles for a steady one")
    reaction = float(history.reaction_min)
    glued = "w" not in scene.model.fields
    if glued and reaction < -ROUNDING * float(scene.contact.largest_pressure):
        warn(
            f"tension at the contact (reaction_min = {reaction:.4g}): the lift is frozen; add w to "
            "model.fields for unilateral contact, or take fewer model.nodes"
        )
    put(output.as_json(figures) if options.json else f"{history}\n")
    if folder is not None:
        say_written(output.write_run(folder, history, figures))
    return 0


def _scenes(options: argparse.Namespace) -> int:
    from jbeamshell import output, scenes

    summaries = {name: scenes.summary(name) for name in scenes.NAMES}
    lines = [f"{name:15s} {text}\n" for name, text in summaries.items()]
    put(output.as_json(summaries) if options.json else "".join(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
