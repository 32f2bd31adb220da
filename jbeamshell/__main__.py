"""``python -m jbeamshell``, the command line."""

from jbeamshell.cli.main import program

program()
