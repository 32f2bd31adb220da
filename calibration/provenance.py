"""Provenance of recorded figures: machine and versions."""

import platform

import jax
import jaxlib


def provenance() -> dict[str, str]:
    """Machine and versions, for a record in double precision."""
    return {
        "jax": jax.__version__,
        "jaxlib": jaxlib.__version__,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "dtype": "float64",
    }
