"""`jbeamshell bodies`: the contact of bodies from any finite-element program."""

from __future__ import annotations

import argparse
import warnings
from typing import Any

from jbeamshell.cli.arguments import add_folder, add_json
from jbeamshell.cli.terminal import put, say_written, warn
from jbeamshell.common.errors import DoubtfulWarning


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser(
        "bodies",
        help="solve the contact of bodies from your own finite elements",
        description="Press bodies from your own finite elements together, load them to and fro, "
        "and report the hysteresis loop. They are pressed without friction unless the file says "
        "assembly, and loaded until the loop is steady unless it says cycles.",
        epilog="The file says friction, amplitude, cycles, bolts, gap, ... and, in [upper] and "
        "[lower], the file of each stiffness matrix (.sti of CalculiX, .mtx, .mat, .npz, .op4) "
        "with the tables contact (node, X), pull and press (node, direction, force).",
    )
    parser.add_argument("file", metavar="JOINT.toml", help="the bodies and their loads")
    parser.add_argument("--amplitude", type=float, metavar="A", help="in place of the file's")
    parser.add_argument("--friction", type=float, metavar="MU", help="in place of the file's")
    add_folder(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Solve a contact, report and write; returns the exit code."""
    from jbeamshell.common import files
    from jbeamshell.common.checks import require
    from jbeamshell.contact_line.contact import solve_contact
    from jbeamshell.contact_line.contact_file import read_contact
    from jbeamshell.plotting.folder import check_folder

    given = read_contact(options.file)
    follows = options.amplitude is not None and "path" in given
    require("--amplitude", options.amplitude, not follows, "the file gives a path: change that")
    for name in ("amplitude", "friction"):
        if getattr(options, name) is not None:
            given[name] = getattr(options, name)
    folder = None if options.out is None else check_folder(options.out)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DoubtfulWarning)  # printed below, one line each
        history = solve_contact(**given)
    for doubt in history.doubts:
        warn(doubt)
    put(files.as_json(history.figures()) if options.json else f"{history}\n")
    if folder is not None:
        say_written(history.write(folder))
    return 0
