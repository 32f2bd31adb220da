"""`jbeamshell advise`: the cheapest model of a scene that is accurate enough."""

from __future__ import annotations

import argparse
from typing import Any

from jbeamshell.cli.arguments import add_json, add_scene, add_settings, scene_of
from jbeamshell.cli.terminal import put, say


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser(
        "advise",
        help="name the cheapest model that is accurate enough",
        description="Name the cheapest model of a scene whose estimated error against plane "
        "elasticity stays within a tolerance.",
    )
    add_scene(parser)
    parser.add_argument(
        "--tol", type=float, default=0.05, metavar="ERROR", help="relative error (default 0.05)"
    )
    parser.add_argument(
        "--quantity",
        default="dissipation",
        metavar="FIGURE",
        help="figure that must be this accurate (default dissipation)",
    )
    add_settings(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the advice; returns the exit code."""
    from jbeamshell.common import files
    from jbeamshell.ladder import advice

    advised = advice.advise(
        scene_of(options), options.tol, quantity=options.quantity, tell=tell_rung
    )
    put(files.as_json(advised.figures()) if options.json else f"{advised}\n")
    return 0


def tell_rung(rung: str) -> None:
    """Report which rung of the ladder of models is being solved."""
    say(f"solving on {rung} ...")
