"""`jbeamshell bodies`: the contact of bodies from any finite-element program."""

from __future__ import annotations

import argparse
import warnings
from typing import Any

from jbeamshell.cli.arguments import add_folder, add_json
from jbeamshell.cli.terminal import put, say_written, warn
from jbeamshell.common.errors import DoubtfulWarning

OF_CURVE = (
    "softness",
    "roughness",
    "assembly",
    "cycles",
    "steps_per_half_cycle",
)  # keys that a mode takes too


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser(
        "bodies",
        help="solve the contact of bodies from your own finite elements",
        description="Press bodies from your own finite elements together, load them to and fro, "
        "and report the hysteresis loop. Unless the file says assembly, bodies on a line are "
        "pressed without friction and those on a face with friction. They are loaded until the "
        "loop is steady unless it says cycles.",
        epilog="The file says friction, amplitude, cycles, bolts, gap, ... and, in [upper] and "
        "[lower], the file of each stiffness matrix (.sti of CalculiX, .mtx, .mat, .npz) "
        "with the tables contact (node, X), pull and press (node, direction, force).  With face in "
        "place of contact the bodies touch on a face; deck = FILE.inp then names a deck of "
        "CalculiX, whose surfaces are the face and bear the loads.",
    )
    parser.add_argument("file", metavar="JOINT.toml", help="the bodies and their loads")
    parser.add_argument("--amplitude", type=float, metavar="A", help="in place of the file's")
    parser.add_argument("--friction", type=float, metavar="MU", help="in place of the file's")
    text = "frequency and damping of this mode over its amplitude (0 is the first), for a face"
    parser.add_argument("--mode", type=int, metavar="N", help=text)
    add_folder(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Solve a contact, report and write; returns the exit code."""
    from jbeamshell.common import files
    from jbeamshell.plotting.folder import check_folder

    folder = None if options.out is None else check_folder(options.out)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DoubtfulWarning)  # printed below, one line each
        result = _result(options)
    for doubt in result.doubts:
        warn(doubt)
    put(files.as_json(result.figures()) if options.json else f"{result}\n")
    if folder is not None:
        say_written(result.write(folder))
    return 0


def _result(options: argparse.Namespace) -> Any:
    """History of the bodies, or the curve of a mode."""
    from jbeamshell.bodies.contact import solve_contact
    from jbeamshell.bodies.contact_file import read_contact, read_parts, touches_on_face
    from jbeamshell.bodies.modes import face_curve, modal_bodies
    from jbeamshell.common.checks import require
    from jbeamshell.common.files import read_toml

    if options.mode is None:
        return solve_contact(**_changed(options, read_contact(options.file)))
    fix = "needs bodies that touch on a face: write face = in [upper]"
    require("--mode", options.mode, touches_on_face(read_toml(options.file)), fix)
    above, below, given = read_parts(options.file)
    given = _changed(options, given)
    fix = "a mode takes amplitudes of its own: leave it out"
    require("--amplitude", options.amplitude, options.amplitude is None, fix)
    pressing = {name: given[name] for name in ("friction", "bolts", "gap") if name in given}
    bodies = modal_bodies(above, below, mode=options.mode, **pressing)
    more = {name: given[name] for name in OF_CURVE if name in given}
    return face_curve(bodies, **more)


def _changed(options: argparse.Namespace, given: dict[str, Any]) -> dict[str, Any]:
    """Arguments of a file, with those of the command line in place of its own."""
    from jbeamshell.common.checks import require

    follows = options.amplitude is not None and "path" in given
    require("--amplitude", options.amplitude, not follows, "the file gives a path: change that")
    named = {name: getattr(options, name) for name in ("amplitude", "friction")}
    return given | {name: value for name, value in named.items() if value is not None}
