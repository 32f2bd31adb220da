"""cli.run."""

from __future__ import annotations

import argparse
import time
import warnings
from typing import Any

import jax

from jbeamshell.cli.terminal import assignments, put, say, say_written, warn
from jbeamshell.common.errors import DoubtfulWarning
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.toml import overridden, scene_from_values


def add_to(commands: Any) -> tuple[argparse.ArgumentParser, ...]:
    """Add the commands' options to a parser; returns the parsers of run, scenes and advise."""
    running = commands.add_parser("run", help="press a strip down, load it to and fro, and report")
    running.add_argument(
        "scene",
        nargs="?",
        metavar="NAME|SCENE.toml",
        help="a scene that ships or one's own; default: the standard strip",
    )
    running.add_argument(
        "--tol", type=float, metavar="PART", help="take the model that `advise` names"
    )
    running.set_defaults(run=run)

    listing = commands.add_parser("scenes", help="list the scenes that ship")
    listing.set_defaults(run=scenes)

    advising = commands.add_parser("advise", help="name the cheapest model that is accurate enough")
    advising.add_argument("scene", nargs="?", metavar="NAME|SCENE.toml", help="as of run")
    advising.add_argument(
        "--tol", type=float, default=0.05, metavar="PART", help="relative error (default .05)"
    )
    advising.add_argument(
        "--quantity", default="dissipation", metavar="FIGURE", help="of which (dissipation)"
    )
    advising.set_defaults(run=advise)
    return running, listing, advising


def run(options: argparse.Namespace) -> int:
    """Run a scene, report and write; returns the exit code."""
    from jbeamshell.common import files
    from jbeamshell.history import report
    from jbeamshell.ladder import advice
    from jbeamshell.plotting.folder import check_folder
    from jbeamshell.quasistatic import load_path, solver

    scene = _scene(options)
    load_path.check(scene)
    if options.tol is not None:
        advised = advice.advise(scene, options.tol, tell=_tell)
        say(str(advised))
        scene = advised.applied(scene)
    folder = None if options.out is None else check_folder(options.out)
    say("compiling ...")
    begin = time.perf_counter()
    solver.compile_for(scene)
    compiled = time.perf_counter()
    say(f"compiled in {compiled - begin:.1f} s, solving ...")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DoubtfulWarning)  # told below
        history = jax.block_until_ready(solver.solve(scene))
    finished = time.perf_counter()
    timing = {"wall_s": finished - compiled, "compile_s": compiled - begin}
    figures = history.figures() | timing
    for doubt in history.doubts:
        warn(doubt)
    put(files.as_json(figures) if options.json else f"{history}\n")
    if folder is not None:
        say_written(report.write_run(folder, history, figures))
    return 0


def advise(options: argparse.Namespace) -> int:
    """Name the cheapest model that is accurate enough; returns the exit code."""
    from jbeamshell.common import files
    from jbeamshell.ladder import advice

    advised = advice.advise(_scene(options), options.tol, quantity=options.quantity, tell=_tell)
    put(files.as_json(advised.figures()) if options.json else f"{advised}\n")
    return 0


def _tell(text: str) -> None:
    say(f"solving on {text} ...")


def _scene(options: argparse.Namespace) -> Scene:
    """The scene of a name or a file, and what is set on top."""
    from jbeamshell.scene import library

    given = {} if options.scene is None else library.values_from(options.scene)
    return scene_from_values(overridden(given, assignments(options.set)))


def scenes(options: argparse.Namespace) -> int:
    """List the scenes that ship; returns the exit code."""
    from jbeamshell.common import files
    from jbeamshell.scene import library

    summaries = {name: library.summary(name) for name in library.NAMES}
    lines = [f"{name:15s} {text}\n" for name, text in summaries.items()]
    put(files.as_json(summaries) if options.json else "".join(lines))
    return 0
