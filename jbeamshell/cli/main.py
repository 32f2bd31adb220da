"""Command line: one parser for all commands, and the exit codes of their errors."""

from __future__ import annotations

import argparse
import contextlib
import gc
import os
import signal
import sys
import threading
from collections.abc import Sequence
from importlib.metadata import version
from types import FrameType
from typing import Any

import jax

from jbeamshell.cli import (
    advise,
    bodies,
    explore,
    export,
    fit,
    inspect,
    keys,
    ringdown,
    run,
    scenes,
    sweep,
)
from jbeamshell.cli.terminal import BAD_INPUT, INTERRUPTED, UNCONVERGED, complain, put, warn
from jbeamshell.common import jax_options
from jbeamshell.common.errors import InputError, UnconvergedError

# Each module is one command and adds itself to the parser.
COMMANDS = (run, explore, scenes, keys, advise, inspect, fit, sweep, ringdown, export, bodies)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    jax.config.update("jax_enable_x64", True)
    if not jax_options.started():
        jax_options.configure()
    try:
        code: int = options.run(options)
        unsaid = getattr(options, "unsaid", "")
        if unsaid:
            warn(unsaid)
        return code
    except InputError as error:
        return complain(error, BAD_INPUT)
    except UnconvergedError as error:
        return complain(error, UNCONVERGED)
    except MemoryError as error:
        fix = "take fewer model.nodes or load steps, or sweep fewer values at a time"
        return complain(f"not enough memory ({error}): {fix}", BAD_INPUT)
    except KeyboardInterrupt as error:
        return complain(str(error) or "interrupted; no file is left half-written", INTERRUPTED)


def program() -> None:
    """Run the command line as a program: ends this process with the exit code."""
    gc.set_threshold(100_000, 20, 20)  # tracing makes millions of objects that live on
    jax.config.update("jax_traceback_in_locations_limit", 0)  # lines of Python that nobody reads
    signal.signal(signal.SIGINT, _interrupt)
    code = main()
    # Threads of JAX may be at work still; Python must not be taken down beneath them, which takes
    # a fifth of a second, too.
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):
            stream.flush()
    os._exit(code)


def _interrupt(_: int, frame: FrameType | None) -> None:
    """Interrupt the program; later where Python would ignore it, in a hook of JAX."""
    if frame is not None and frame.f_code.co_name == "_xla_gc_callback":
        threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGINT)).start()
        return
    raise KeyboardInterrupt


class _Version(argparse.Action):
    """Prints the version, and where load paths are walked."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from jbeamshell.contact_line import native

        put(f"jbeamshell {version('jbeamshell')}: {native.in_words()}\n")
        parser.exit()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="jbeamshell",
        description="Micro-slip in bolted joints by a beamshell on a rough foundation: hysteresis "
        "loops, dissipation, fits to measured data, sweeps and ring-down.",
        epilog="Exit codes: 0 done; 2 bad input; 3 a load step, a fit or a lane of a sweep did not "
        "converge, or the model does not describe the data of a fit; 130 interrupted.  Without a "
        "scene, a command takes the standard strip.",
    )
    parser.add_argument(
        "--version", action=_Version, nargs=0, help="say the version, and where paths are walked"
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add_to(commands)
    return parser


if __name__ == "__main__":
    program()
