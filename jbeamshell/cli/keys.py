"""`jbeamshell keys`: every key of a scene with its default, unit and meaning."""

from __future__ import annotations

import argparse
from typing import Any

from jbeamshell.cli.terminal import put


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser(
        "keys",
        help="list the keys of a scene with default, unit and meaning",
        description="List the keys of a scene, as --set, --over, --free and TOML files take them.",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the list; returns the exit code."""
    from jbeamshell.scene.keys import key_table

    put(f"{key_table()}\n")
    return 0
