"""Faults planted in the core, one at a time, and the ordinary tests that find them.

Copies the project, plants a fault of mutations.txt, runs the tests that the list names for its file
until one fails, and writes mutations.json beside this file after every fault: the test that found
it, or nothing.  Faults that were found before are left out, unless again=true is given; word=WORD
takes those that have the word in their names.
"""

import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from calibration.running import read

ROOT = Path(__file__).parents[1]
RECORD = Path(__file__).with_suffix(".json")
LIST = Path(__file__).with_suffix(".txt")
LONGEST = 900.0  # seconds after which a fault is found: its tests never end
OPTIONS = ["-x", "-q", "-p", "no:cacheprovider"]


class Fault(NamedTuple):
    """Fault: in a file of the package, one text replaced by another.

    Attributes
    ----------
    file, right, wrong : file, its text, and what takes its place
    tests : tests that are to find it
    """

    file: str
    right: str
    wrong: str
    tests: tuple[str, ...]

    @property
    def name(self) -> str:
        return f"{self.file}: {self.right} -> {self.wrong}"


def faults() -> Iterator[Fault]:
    """Faults of the list: of each file its tests, then rows of right and wrong."""
    file, tests = "", ()
    for line in LIST.read_text(encoding="utf-8").splitlines():
        if line.startswith("# "):
            file, *tests = line[2:].split()
        elif line:
            right, wrong = line.split(" ==> ")
            yield Fault(file, right, wrong, tuple(f"tests/{one}" for one in tests))


def text_of(fault: Fault, project: Path = ROOT) -> str:
    """Text of the file of a fault."""
    return (project / "jbeamshell" / fault.file).read_text(encoding="utf-8")


def sample(count: int, seed: int) -> list[Fault]:
    """Random faults of the list."""
    return random.Random(seed).sample(list(faults()), count)


def copied(folder: Path) -> Path:
    """Copy of the project in a folder, as far as tests read it."""
    for name in ("jbeamshell", "tests", "calibration", "verification"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "hatch_build.py"):
        shutil.copy(ROOT / name, folder)
    return folder


def killed(fault: Fault, project: Path) -> str:
    """First test that finds a fault planted in a copy of the project; empty if none does."""
    place, text = project / "jbeamshell" / fault.file, text_of(fault, project)
    assert fault.right in text, f"{fault.name}: is not in the file any more"
    place.write_text(text.replace(fault.right, fault.wrong), encoding="utf-8")
    _built(place)
    command = [sys.executable, "-m", "pytest", *OPTIONS, *fault.tests]
    path = {"PYTHONPATH": str(project), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            command,
            cwd=project,
            env=os.environ | path,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=LONGEST,
        )
    except subprocess.TimeoutExpired:
        return "never ends"
    finally:
        place.write_text(text, encoding="utf-8")
        _built(place)
    for line in done.stdout.splitlines():
        if line.startswith(("FAILED ", "ERROR ")):
            return line.split()[1]
    assert done.returncode == 0, done.stdout + done.stderr
    return ""


def _built(place: Path) -> None:
    """Build the library of a source in C anew."""
    if place.suffix == ".c":
        code = "import hatch_build as h, pathlib; h.built(pathlib.Path(h.FOLDER), [])"
        project = place.parents[2]
        subprocess.run([sys.executable, "-c", code], cwd=project, check=True)


def measure(word: str = "", again: bool = False) -> None:
    """Plant the faults, and write the record after each."""
    record = read(RECORD)
    with tempfile.TemporaryDirectory() as folder:
        project, every = copied(Path(folder)), list(faults())
        for fault in every:
            if word not in fault.name or (record.get(fault.name) and not again):
                continue
            record[fault.name] = killed(fault, project)
            print(record[fault.name] or "SURVIVES", "|", fault.name, flush=True)
            known = {one.name: record[one.name] for one in every if one.name in record}
            RECORD.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
