"""`jbeamshell export`: a strip or lap joint as an element for another program."""

from __future__ import annotations

import argparse
from typing import Any

from jbeamshell.cli.arguments import add_scene, add_settings, scene_of
from jbeamshell.cli.dimensions import add_dimensions
from jbeamshell.cli.terminal import doubts_in_lines, say_written

FILES = {
    "opensees": "joint.py",
    "fmu": "joint.fmu",
    "tmdsimpy": "joint.py",
    "calculix": "joint.inp",
    "table": "joint.csv",
}


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser(
        "export",
        help="write a strip as a joint for OpenSees, FMI, tmdsimpy, CalculiX or tables",
        description="Condense a strip or lap joint to sliders in parallel, the mean of its pull "
        "and push, and write them for another program.  Each file says its units, sign and limits.",
    )
    add_scene(parser)
    parser.add_argument(
        "--to", required=True, choices=tuple(FILES), help="program, or kind of file"
    )
    add_dimensions(parser, lap=True)
    parser.add_argument(
        "--units",
        default="length,force",
        metavar="MM,N",
        help="names of the scene's units of length and force, for the file",
    )
    add_settings(parser)
    names = ", ".join(f"{name} for {to}" for to, name in FILES.items())
    parser.add_argument("--out", metavar="FILE", help=f"file to write (default: {names})")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Condense and write; returns the exit code."""
    from jbeamshell.dynamics.structure.joint import Joint

    with doubts_in_lines():
        joint = Joint.of(scene_of(options))
        path = FILES[options.to] if options.out is None else options.out
        units = tuple(word.strip() for word in options.units.split(","))
        written = joint.export(options.to, path, units=units)
    say_written([written])
    return 0
