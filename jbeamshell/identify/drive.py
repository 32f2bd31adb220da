"""Drive of a law of a joint or a structure, in place of a strip's load."""

from __future__ import annotations

from typing import NamedTuple


class Drive(NamedTuple):
    """Column that drives a law.

    Attributes
    ----------
    control : "force" or "displacement"
    """

    control: str = "displacement"
