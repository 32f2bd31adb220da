"""The command line: a thin skin over the library."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence

import jax

from jbeamshell import __version__, fit_command, runtime, sweep_command
from jbeamshell.errors import InputError, UnconvergedError
from jbeamshell.scene import Scene, overridden, scene_from_values
from jbeamshell.terminal import assignments, put, say, say_written, warn

BAD_INPUT, UNCONVERGED, INTERRUPTED = 2, 3, 130
CLOSES = 1e-3  # of its width: a loop that ends further off is not steady yet
ROUNDING = 1e-9  # of the pressure: less tension than this is none


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
    for command in (run, advice, fit, sweep):
        command.add_argument(
            "--set", action="append", default=[], metavar="KEY=VALUE", help="override a key"
        )
    for command in (run, fit):
        command.add_argument("--out", metavar="DIR", help="write tables and pictures there")
    for command in (run, listing, advice, fit, sweep):
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

    given = scenes.values_from(options.scene) if options.scene else {}
    return scene_from_values(overridden(given, assignments(options.set)))


def _scenes(options: argparse.Namespace) -> int:
    from jbeamshell import output, scenes

    summaries = {name: scenes.summary(name) for name in scenes.NAMES}
    lines = [f"{name:15s} {text}\n" for name, text in summaries.items()]
    put(output.as_json(summaries) if options.json else "".join(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
