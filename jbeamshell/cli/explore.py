"""`jbeamshell explore`: a page of sliders and pictures of one scene, on this machine."""

from __future__ import annotations

import argparse
from typing import Any

from jbeamshell.cli.arguments import add_scene, add_settings, scene_of
from jbeamshell.cli.dimensions import add_dimensions, specimen_of
from jbeamshell.cli.terminal import put, say

MOST = 65535  # largest number of a port


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser(
        "explore",
        help="move a scene's numbers by sliders in a browser",
        description="Serve a page on this machine only, with sliders for height ratio, friction, "
        "load, pressure, Poisson's ratio and bolts.  The loop, the contact, the dissipation and "
        "the deformed strip follow.  Ctrl+C ends it.",
        epilog="Needs Panel: pip install 'jbeamshell[explore]'.",
    )
    add_scene(parser)
    add_dimensions(parser, lap=True)
    parser.add_argument(
        "--data", action="append", default=[], metavar="CSV", help="measured loops to draw over"
    )
    parser.add_argument(
        "--port", type=int, default=0, metavar="N", help="port of 127.0.0.1 (default: any free one)"
    )
    parser.add_argument("--no-browser", action="store_true", help="open no browser")
    add_settings(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Serve the page until it is interrupted; returns the exit code."""
    from jbeamshell.common.checks import require
    from jbeamshell.explorer import check_installed
    from jbeamshell.measured.loop_files import read_loops
    from jbeamshell.scene import library

    port = options.port
    require("--port", port, 0 <= port <= MOST, f"must be a number from 0 to {MOST}")
    check_installed()
    from jbeamshell.explorer.serve import serve

    given = options.scene is not None or options.set or specimen_of(options).values
    scene = scene_of(options) if given else None
    loops = read_loops(options.data) if options.data else []
    say("compiling ...")
    name = options.scene if options.scene in library.NAMES and not options.set else "own scene"

    def tell(address: str) -> None:
        put(f"{address}\n")
        say("Ctrl+C stops it")

    serve(
        scene,
        loops,
        name,
        port=port,
        browser=not options.no_browser,
        tell=tell,
    )
    return 0
