"""`jbeamshell inspect`: what files of measured data hold, and whether a fit can be right."""

from __future__ import annotations

import argparse
from typing import Any

from jbeamshell.cli.arguments import add_columns, add_folder, add_json, pairs
from jbeamshell.cli.terminal import BAD_INPUT, put, say_written


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser(
        "inspect",
        help="look at measured data before a fit",
        description="Tell what files of force and displacement hold: columns, units, cycles, "
        "amplitudes, work; and what speaks against a fit.  The exit code is 2 if a fit refuses "
        "them.",
    )
    parser.add_argument(
        "data", nargs="+", metavar="DATA", help="files (.csv, .txt, .mat, .npz, .h5, .tdms, .uff)"
    )
    add_columns(parser)
    add_folder(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Inspect, report and draw; returns the exit code."""
    from jbeamshell import plotting
    from jbeamshell.common.files import as_json
    from jbeamshell.measured.inspection import inspect
    from jbeamshell.plotting.folder import check_folder, write_folder

    folder = None if options.out is None else check_folder(options.out)
    seen = inspect(
        options.data,
        columns=pairs(options.column, "force=FT"),
        units=pairs(options.unit, "force=kN"),
        decimal=options.decimal,
    )
    figures = seen.figures()
    put(as_json(figures) if options.json else f"{seen}\n")
    if folder is not None:
        pictures = {"inspection.png": plotting.inspection(seen)[0].figure}
        texts = {"inspection.json": as_json(figures), "inspection.txt": f"{seen}\n"}
        say_written(write_folder(folder, texts, pictures))
    return 0 if seen.sound else BAD_INPUT
