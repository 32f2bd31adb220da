"""Sample of the slow tests, drawn anew for each commit, so that none of them rots unseen."""

import random
import subprocess
from datetime import date
from pathlib import Path

SHARE = 0.1  # of the slow tests
LONG = 2.0  # minutes from which on a test is left to the whole slow suite


def drawn(test: str, minutes: float, seed: str) -> bool:
    """True if a slow test of some minutes belongs to the sample of a seed.

    Each test draws for itself: the others may come and go.
    """
    return minutes < LONG and random.Random(f"{seed} {test}").random() < SHARE


def seed_of(given: str) -> str:
    """Seed itself; for HEAD, the commit that is checked out, or the date where there is no git."""
    return (commit() or date.today().isoformat()) if given == "HEAD" else given


def commit() -> str:
    """Short name of the commit that is checked out; empty where there is none."""
    command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "--short=12", "HEAD"]
    try:
        return subprocess.run(command, capture_output=True, text=True).stdout.strip()
    except OSError:
        return ""
