"""The command line: a thin skin over the library."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib.metadata import version

import jax

from jbeamshell.cli import fit, ringdown, run, sweep
from jbeamshell.common import jax_options
from jbeamshell.common.errors import InputError, UnconvergedError

BAD_INPUT, UNCONVERGED, INTERRUPTED = 2, 3, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    jax.config.update("jax_enable_x64", True)
    jax_options.start_of_a_command()
    try:
        return options.run(options)
    except InputError as error:
        return _complain(error, BAD_INPUT)
    except UnconvergedError as error:
        return _complain(error, UNCONVERGED)
    except MemoryError as error:
        fix = "take fewer model.nodes or load steps, or sweep fewer values at a time"
        return _complain(f"not enough memory ({error}): {fix}", BAD_INPUT)
    except KeyboardInterrupt as error:
        return _complain(str(error) or "interrupted; no file is left half-written", INTERRUPTED)


def _complain(error: object, code: int) -> int:
    print(f"jbeamshell: {' '.join(str(error).split())}", file=sys.stderr)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="jbeamshell",
        description="Beamshells on a rough foundation: hysteresis by micro-slip, and fits to it.",
        epilog="exit codes: 0 done, 2 bad input, 3 a load step or a fit did not converge",
    )
    parser.add_argument(
        "--version", action="version", version=f"jbeamshell {version('jbeamshell')}"
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    running, listing, advising = run.add_to(commands)
    fitting, sweeping = fit.add_to(commands), sweep.add_to(commands)
    ringing = ringdown.add_to(commands)
    for command in (running, advising, fitting, sweeping, ringing):
        command.add_argument(
            "--set", action="append", default=[], metavar="KEY=VALUE", help="override a key"
        )
    for command in (running, fitting, ringing):
        command.add_argument("--out", metavar="DIR", help="write tables and pictures there")
    for command in (running, listing, advising, fitting, sweeping, ringing):
        command.add_argument("--json", action="store_true", help="print the result as JSON")
    return parser


if __name__ == "__main__":
    sys.exit(main())
