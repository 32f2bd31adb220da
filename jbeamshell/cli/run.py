"""`jbeamshell run`: one scene from its load path to figures, tables and pictures."""

from __future__ import annotations

import argparse
import time
import warnings
from typing import Any

import jax

from jbeamshell.cli.arguments import (
    add_folder,
    add_json,
    add_scene,
    add_settings,
    add_tolerance,
    scene_of,
)
from jbeamshell.cli.dimensions import SI, add_dimensions
from jbeamshell.cli.terminal import put, say, say_written, warn
from jbeamshell.common.errors import DoubtfulWarning


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser(
        "run",
        help="solve one scene: press the strip down, load it to and fro",
        description="Press a strip down, load it to and fro, and report its hysteresis loop: "
        "dissipation, stiffness, slip and contact.",
        epilog="`jbeamshell keys` lists every KEY of --set with its default, unit and meaning. "
        "VALUE may have a unit, which is converted to SI: --set load.amplitude=4kN --width 50mm.  "
        "Ctrl+C stops a run.",
    )
    add_scene(parser)
    add_tolerance(parser)
    add_dimensions(parser, lap=True)
    add_settings(parser)
    add_folder(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run a scene, report and write; returns the exit code."""
    from jbeamshell.common import files
    from jbeamshell.common.progress import seconds_of_compiling
    from jbeamshell.scene import load_path
    from jbeamshell.solving import solve as solving
    from jbeamshell.solving.advice import within
    from jbeamshell.solving.sensitivity import is_bolted, sensitivity, slips

    scene = within(scene_of(options), options.tol)
    load_path.check(scene)
    folder = None
    if options.out is not None:  # pictures take long to import
        from jbeamshell.history import report
        from jbeamshell.plotting.folder import check_folder

        folder = check_folder(options.out)
    say("solving ... (Ctrl+C stops it)")
    begin, before = time.perf_counter(), seconds_of_compiling()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DoubtfulWarning)  # printed below, one line each
        history = jax.block_until_ready(solving.run(scene))
    compiled = seconds_of_compiling() - before
    timing = {"wall_s": time.perf_counter() - begin, "compile_s": compiled}
    figures = history.figures() | timing
    units = SI if options.specimen_in_si else {}
    lines = [*options.bolted, history.summary(units).as_text()]
    if is_bolted(scene) and scene.member.support != "none" and slips(history):
        found = sensitivity(history, options.scatter)
        figures |= found.figures()
        lines.append(found.summary(*("N", "J", "m") * options.specimen_in_si).as_text())
    for doubt in history.doubts:
        warn(doubt)
    put(files.as_json(figures) if options.json else "\n".join(lines) + "\n")
    if folder is not None:
        say_written(report.write_run(folder, history, figures, units))
    return 0
