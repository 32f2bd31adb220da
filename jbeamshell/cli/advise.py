"""`jbeamshell advise`: the model that a plain call takes for a scene, and why."""

from __future__ import annotations

import argparse
from typing import Any

from jbeamshell.cli.arguments import add_json, add_scene, add_settings, add_tolerance, scene_of
from jbeamshell.cli.dimensions import add_dimensions
from jbeamshell.cli.terminal import put


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser(
        "advise",
        help="say which model a scene takes, and why",
        description="Say which section and grid a scene takes to be within its tolerance of plane "
        "elasticity, and why, without solving it.",
    )
    add_scene(parser)
    add_dimensions(parser, lap=True)
    add_tolerance(parser)
    add_settings(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the advice; returns the exit code."""
    from jbeamshell.common import files
    from jbeamshell.solving import advice

    advised = advice.advise(scene_of(options), options.tol)
    put(files.as_json(advised.figures()) if options.json else f"{advised}\n")
    return 0
