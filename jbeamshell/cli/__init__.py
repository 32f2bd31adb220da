"""Command line of jbeamshell."""
