"""Libraries of an extra, which may be missing."""

from __future__ import annotations

import importlib
from typing import Any

from jbeamshell.common.errors import InputError


def table_library(name: str) -> Any:
    """Library of the extra ``tables``.

    Raises
    ------
    InputError
        if it is not installed
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise InputError(f"{name}: is not installed: pip install 'jbeamshell[tables]'") from None
