"""Damaged files of all formats, read one after the other; run as a program that must survive.

    python tests/damaged.py FOLDER SEED COUNT

damages good files of ``FOLDER`` at random: bytes set, cut, doubled, swapped or appended.  It prints
a line of JSON for each, in the order of their numbers: file, damage, outcome and seconds of the
processor.
"""

import json
import sys
import time
import warnings
from pathlib import Path

import numpy as np

import jbeamshell as jb
from jbeamshell.measured.recordings import read_recordings

CHECKED = (".npz", ".squeezed.mat")  # files whose numbers carry check sums


def damage(good: bytes, random: np.random.Generator) -> tuple[str, bytes]:
    """Name of a damage, and the damaged content."""
    content, size = bytearray(good), len(good)
    at, to = np.sort(random.integers(0, size, 2))
    kind = str(random.choice(["byte", "bytes", "cut", "lost", "doubled", "swapped", "longer"]))
    if kind == "byte":
        content[at] = random.integers(0, 256)
    elif kind == "bytes":
        for place in random.integers(0, size, random.integers(2, 30)):
            content[place] = random.integers(0, 256)
    elif kind == "cut":
        del content[at:]
    elif kind == "lost":
        del content[at : at + 1 + random.integers(0, 64)]
    elif kind == "doubled":
        content[at:at] = content[at : at + 1 + random.integers(0, 64)]
    elif kind == "swapped":
        half = min(int(to - at) // 2, 64)
        content[at : at + half], content[to - half : to] = (
            content[to - half : to],
            content[at : at + half],
        )
    else:
        content += random.bytes(int(random.integers(1, 200)))
    return kind, bytes(content)


def numbers_of(path: Path) -> list[np.ndarray]:
    """Numbers that a reader takes from a file."""
    if path.suffix == ".toml":
        scene = jb.read_scene(path)
        return [np.asarray(scene.get("load.amplitude"))]
    if path.name.startswith("history"):
        history = jb.read_history(path)
        return [np.asarray(history.force), np.asarray(history.displacement)]
    found = read_recordings(path)
    return [column for one in found for column in (one.force, one.displacement)]


def same(one: list[np.ndarray], other: list[np.ndarray]) -> bool:
    """True if all numbers are the same."""
    return len(one) == len(other) and all(map(np.array_equal, one, other))


def outcome(path: Path, good: list[np.ndarray]) -> str:
    """Outcome of reading a file: refused in a line, the same, changed, or what it raised."""
    try:
        found = numbers_of(path)
    except (jb.InputError, jb.UnconvergedError) as error:
        return "refused" if len(str(error).splitlines()) == 1 else "refused at length"
    except Exception as error:
        return f"raised {type(error).__name__}: {error}"[:200]
    if not all(np.all(np.isfinite(column)) for column in found):
        return "accepted, not finite"
    return "same" if same(found, good) else "changed"


def main(folder: Path, seed: int, count: int) -> None:
    """Damage and read files."""
    warnings.simplefilter("ignore")
    names = sorted(path.name for path in folder.iterdir() if path.is_file())
    content = {name: (folder / name).read_bytes() for name in names}
    good = {name: numbers_of(folder / name) for name in names}
    work = folder / "damaged"
    work.mkdir(exist_ok=True)
    random = np.random.default_rng(seed)
    for number in range(count):
        name = names[number % len(names)]
        kind, damaged = damage(content[name], random)
        path = work / name
        path.write_bytes(damaged)
        begin = time.process_time()
        row = {"file": name, "damage": kind, "outcome": outcome(path, good[name])}
        row["seconds"] = round(time.process_time() - begin, 4)
        print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
