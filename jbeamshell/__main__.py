"""The command line: a thin skin over the library."""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Sequence

import jax

from jbeamshell import __version__, fit_command, ringdown_command, runtime, sweep_command
from jbeamshell.errors import DoubtfulWarning, InputError, UnconvergedError
from jbeamshell.scene import Scene, overridden, scene_from_values
from jbeamshell.terminal import assignments, put, say, say_written, warn

BAD_INPUT, UNCONVERGED, INTERRUPTED = 2, 3, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    jax.config.update("jax_enable_x64", True)
    runtime.start_of_a_command()
    try:
        return options.run(options)
    except InputError as error:
        return _complain(error, BAD_INPUT)
    except UnconvergedError as error:
        return _complain(error, UNCONVERGED)
    except MemoryError as error:
        fix = "take fewer model.nodes or load steps, or sweep fewer values at a time"
        return _complain(f"not enough memory ({error}): {fix}", BAD_INPUT)
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

    run.add_argument("--tol", type=float, metavar="PART", help="take the model that `advise` names")

    advice = commands.add_parser("advise", help="name the cheapest model that is accurate enough")
    advice.add_argument("scene", nargs="?", metavar="NAME|SCENE.toml", help="as of run")
    advice.add_argument(
        "--tol", type=float, default=0.05, metavar="PART", help="relative error (default .05)"
    )
    advice.add_argument(
        "--quantity", default="dissipation", metavar="FIGURE", help="of which (dissipation)"
    )
    advice.set_defaults(run=_advise)

    fit = fit_command.add_to(commands)
    sweep = sweep_command.add_to(commands)
    ringing = ringdown_command.add_to(commands)
    for command in (run, advice, fit, sweep, ringing):
        command.add_argument(
            "--set", action="append", default=[], metavar="KEY=VALUE", help="override a key"
        )
    for command in (run, fit, ringing):
        command.add_argument("--out", metavar="DIR", help="write tables and pictures there")
    for command in (run, listing, advice, fit, sweep, ringing):
        command.add_argument("--json", action="store_true", help="print the result as JSON")
    return parser


def _run(options: argparse.Namespace) -> int:
    from jbeamshell import advice, output, quasistatic

    scene = _scene(options)
    quasistatic.check(scene)
    if options.tol is not None:
        advised = advice.advise(scene, options.tol, tell=_tell)
        say(str(advised))
        scene = advised.applied(scene)
    folder = None if options.out is None else output.check_folder(options.out)
    say("compiling ...")
    begin = time.perf_counter()
    quasistatic.compile_for(scene)
    compiled = time.perf_counter()
    say(f"compiled in {compiled - begin:.1f} s, solving ...")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DoubtfulWarning)  # told below
        history = jax.block_until_ready(quasistatic.solve(scene))
    finished = time.perf_counter()
    timing = {"wall_s": finished - compiled, "compile_s": compiled - begin}
    figures = history.figures() | timing
    for doubt in history.doubts:
        warn(doubt)
    put(output.as_json(figures) if options.json else f"{history}\n")
    if folder is not None:
        say_written(output.write_run(folder, history, figures))
    return 0


def _advise(options: argparse.Namespace) -> int:
    from jbeamshell import advice, output

    advised = advice.advise(_scene(options), options.tol, quantity=options.quantity, tell=_tell)
    put(output.as_json(advised.figures()) if options.json else f"{advised}\n")
    return 0


def _tell(text: str) -> None:
    say(f"solving on {text} ...")


def _scene(options: argparse.Namespace) -> Scene:
    """The scene of a name or a file, and what is set on top."""
    from jbeamshell import scenes

    given = {} if options.scene is None else scenes.values_from(options.scene)
    return scene_from_values(overridden(given, assignments(options.set)))


def _scenes(options: argparse.Namespace) -> int:
    from jbeamshell import output, scenes

    summaries = {name: scenes.summary(name) for name in scenes.NAMES}
    lines = [f"{name:15s} {text}\n" for name, text in summaries.items()]
    put(output.as_json(summaries) if options.json else "".join(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
