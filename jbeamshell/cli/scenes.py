"""`jbeamshell scenes`: names of the scenes that ship, with a sentence about each."""

from __future__ import annotations

import argparse
from typing import Any

from jbeamshell.cli.arguments import add_json
from jbeamshell.cli.terminal import put


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser("scenes", help="list the scenes that ship")
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the list; returns the exit code."""
    from jbeamshell.common import files
    from jbeamshell.scene import library

    summaries = {name: library.summary(name) for name in library.NAMES}
    lines = [f"{name:15s} {text}\n" for name, text in summaries.items()]
    put(files.as_json(summaries) if options.json else "".join(lines))
    return 0
