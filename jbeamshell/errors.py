"""The two ways a run can fail, each with one clear line."""

from __future__ import annotations


class InputError(ValueError):
    """Input that makes no model; the message names the field, the value and the fix."""


class UnconvergedError(RuntimeError):
    """A load step without equilibrium; the message names the step and what to try."""
