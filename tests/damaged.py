"""Damaged files of all formats, read one after the other; run as a program that must survive.

    python tests/damaged.py SEED COUNT

makes a good file of each format and damages them in turn, in ways drawn at random.  It prints a
line of JSON for each: file, damage, outcome and seconds of the processor, children's included.
"""

import json
import os
import shutil
import sys
import tempfile
import warnings
from pathlib import Path

import jax
import numpy as np
import scipy.io
import scipy.sparse

import jbeamshell as jb
from jbeamshell.bodies.matrix_files import read_matrix
from jbeamshell.dynamics.export import table
from jbeamshell.identify.plan_file import read_plan
from jbeamshell.identify.runs import Evaluation
from jbeamshell.identify.saved_runs import SavedRuns
from jbeamshell.measured.curve_files import read_curves
from jbeamshell.measured.loop_files import read_loops
from jbeamshell.numerics.newton import Newton
from jbeamshell.sweeping.runner import Block
from jbeamshell.sweeping.store import Store

TESTS = Path(__file__).parent
OURS = ("history.npz", "body.npz", "block-000000.npz", "fit.state")  # check sums
CHECKED = (*OURS, "loop.npz", "loop.squeezed.mat")  # sums of the archive too
SCARCE = 6  # a MATLAB file, which is read in a process of its own, for so many of each other
TINY = {"model.nodes": 9, "load.steps_per_half_cycle": 2, "load.cycles": 1}
BLOCK = Block(np.linspace(0.0, 1.0, 21).reshape(3, 7), np.zeros(7, np.int8))
PLAN = """noise = 0.01
[free."contact.friction"]
low = 0.01
high = 0.5
[[specimen]]
data = ["loop.csv"]
set = { "strip.length" = 12.0 }
"""
JOINT = """friction = 0.1
amplitude = 0.5
[upper]
file = "matrix.sti"
contact = "contact.csv"
held = [[3, 2]]
pull = [[9, 1, 1.0]]
[lower]
file = "body.npz"
"""


# --- good files -----------------------------------------------------------------------------------


def good_files(folder):
    """A file of each format."""
    from measured.test_reading import COLUMNS, WRITERS

    columns = {name: np.asarray(column) for name, column in COLUMNS.items()}
    rows = np.column_stack(list(columns.values()))
    np.savetxt(folder / "loop.csv", rows, "%.9g", ",", header="force,displacement", comments="")
    german = "Kraft [kN];Weg [mm]\n" + "\n".join(f"{f:.9g};{u:.9g}" for f, u in rows)
    (folder / "german.csv").write_text(german.replace(".", ","))
    np.savetxt(
        folder / "curve.csv",
        np.column_stack([np.arange(1.0, 20.0), np.arange(1.0, 20.0) ** 3]),
        delimiter=",",
        header="amplitude,dissipation",
        comments="",
    )
    np.savez(folder / "loop.npz", **columns)
    both = np.rec.fromarrays(list(columns.values()), names=list(columns))
    np.save(folder / "loop.npy", np.asarray(both))
    for name, squeezed in (("loop.mat", False), ("loop.squeezed.mat", True)):
        scipy.io.savemat(folder / name, columns, do_compression=squeezed)
    for name, write in WRITERS.items():
        write(folder / name)
    scene = jb.Scene().replace(TINY)
    jb.write_scene(scene, folder / "scene.toml")
    jb.solve(scene).save(folder / "history.npz")
    jb.dynamics.Joint.of(scene).export("table", folder / "table.csv")
    _stores(folder)
    _bodies(folder)
    (folder / "plan.toml").write_text(PLAN)
    (folder / "joint.toml").write_text(JOINT)


def _stores(folder):
    """Block of a sweep, and the state of a fit."""
    Store(folder, "a sweep").save(0, BLOCK)
    random = np.random.default_rng(0)
    runs = saved_runs(folder / "fit.state")
    runs.read()
    for _ in range(4):
        numbers = random.random(4), random.random((4, 2)), random.random(4)
        runs.append([(random.random(2), Evaluation(*numbers, True))])


def saved_runs(path, **settings):
    """State of a fit of two numbers."""
    return SavedRuns(path, (("a", "b"), Newton(**settings)), ())


def _bodies(folder):
    """Matrices of stiffness in all formats, a substructure, and the nodes of a contact."""
    calculix = TESTS / "bodies" / "calculix"
    shutil.copy(calculix / "strip.sti", folder / "matrix.sti")
    shutil.copy(calculix / "strip.dof", folder / "matrix.dof")
    random = np.random.default_rng(1)
    half = random.random((14, 14))
    stiffness = half @ half.T + np.eye(14)
    jb.Substructure(np.arange(7.0), stiffness, random.random((14, 2))).save(folder / "body.npz")
    kept = (stiffness > 4.0) | np.eye(14, dtype=bool)
    sparse = scipy.sparse.csc_array(np.where(kept, stiffness, 0.0))
    scipy.sparse.save_npz(folder / "matrix.npz", sparse)
    scipy.io.savemat(folder / "matrix.mat", {"K": sparse})
    scipy.io.mmwrite(folder / "matrix.mtx", sparse)
    np.savetxt(folder / "contact.csv", [[4, 0.0], [5, 0.1], [6, 0.2]], delimiter=",")


# --- damage ---------------------------------------------------------------------------------------


def damage(good, others, random):
    """Name of a damage, and the damaged content.

    Parameters
    ----------
    good : content of a file
    others : contents of files of other formats
    """
    content, size = bytearray(good), len(good)
    at, few = int(random.integers(size)), int(random.integers(1, 65))
    other = others[random.integers(len(others))]
    kind = str(random.choice(KINDS))
    if kind == "bit":
        content[at] ^= 1 << random.integers(8)
    elif kind == "bytes":
        for place in random.integers(0, size, random.integers(1, 30)):
            content[place] = random.integers(0, 256)
    elif kind == "cut":
        del content[at:]
    elif kind == "lost":
        del content[at : at + few]
    elif kind == "doubled":
        content[at:at] = content[at : at + few]
    elif kind == "longer":
        content += random.bytes(few)
    elif kind == "zeros":  # as a crash leaves them in a block of a disk
        content[at : at + 8 * few] = bytes(len(content[at : at + 8 * few]))
    elif kind == "large":  # a count or a size without end
        content[at : at + 4] = b"\xff\xff\xff\x7f"[: size - at]
    elif kind == "digits":
        places = [i for i, byte in enumerate(content) if byte in b"0123456789"] or [at]
        for place in random.choice(places, 3):
            content[place] = random.choice(list(b"0123456789-.eE"))
    elif kind == "lines":
        random.shuffle(lines := good.split(b"\n"))
        content = bytearray(b"\n".join(lines))
    elif kind == "encoded anew":
        content = bytearray(good.decode("latin-1").encode(random.choice(["utf-16", "utf-8"])))
    elif kind == "spliced":
        content = content[:at] + other[min(at, len(other) // 2) :]
    else:  # another format under this name
        content = bytearray(other)
    return kind, bytes(content)


KINDS = (
    *("bit", "bytes", "cut", "lost", "doubled", "longer", "zeros", "large", "digits", "lines"),
    *("encoded anew", "spliced", "of another format"),
)


# --- reading --------------------------------------------------------------------------------------


def _state(path):
    runs = saved_runs(path).read()
    if len(runs) < 4:
        raise jb.InputError("a run is left out")
    runs = sorted(runs, key=lambda run: run[0].tolist())  # in any order they are the same runs
    return [array for values, run in runs for array in (values, *run)]


def _block(path):
    block = Store(path.parent, "a sweep").load(0, *BLOCK.values.shape)
    if block is None:
        raise jb.InputError("a block is left out")
    return list(block)


def _history(path):
    history = jb.read_history(path)
    return [history.force, history.displacement, history.fields, history.traction]


def _plan(path):
    loops = [loop for case in read_plan(path).cases for loop in case.measurements]
    return [column for loop in loops for column in (loop.force, loop.displacement)]


def _contact(path):
    leaves = jax.tree.leaves(jb.read_contact(path))
    return [np.asarray(leaf) for leaf in leaves if not isinstance(leaf, str)]


def _curve(path):
    ((curve, _),) = read_curves(path, "dissipation")
    return [column for column in vars(curve).values() if isinstance(column, np.ndarray)]


def _matrix(path):
    return [read_matrix(path.with_suffix(".sti") if path.suffix == ".dof" else path).matrix.data]


def _recording(path):
    return [column for one in read_loops(path) for column in (one.force, one.displacement)]


READERS = {
    "scene": lambda path: jax.tree.leaves(jb.read_scene(path)),
    "plan": _plan,
    "joint": _contact,
    "contact": lambda path: _contact(path.with_name("joint.toml")),
    "history": _history,
    "body": lambda path: jax.tree.leaves(jb.Substructure.read(path)),
    "matrix": _matrix,
    "block-000000": _block,
    "fit": _state,
    "table": lambda path: jax.tree.leaves(table.read(path)),
    "curve": _curve,
}


def numbers_of(path):
    """Numbers that a reader takes from a file."""
    read = READERS.get(path.name.partition(".")[0], _recording)
    return [np.asarray(array) for array in read(path)]


def same(one, other):
    """True if all numbers are the same."""
    return len(one) == len(other) and all(map(np.array_equal, one, other))


def outcome(path, good):
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


def judged(row):
    """Fault of a row of the program's output; empty if there is none."""
    if row["outcome"] not in ("refused", "same", "changed"):
        return row["outcome"]
    if row["seconds"] >= SLOWEST:
        return f"takes {row['seconds']} s"
    foreign = row["damage"] in ("of another format", "spliced")
    checked = row["file"] in (OURS if foreign else CHECKED)
    return "changed numbers are accepted" if checked and row["outcome"] == "changed" else ""


SLOWEST = 10.0  # seconds for a file


def processor():
    """Seconds of the processor that this process and its ended children took."""
    return sum(os.times()[:4])


def main(folder, seed, count):
    """Damage and read files; yields the rows."""
    warnings.simplefilter("ignore")
    good_files(folder)
    names = sorted(path.name for path in folder.iterdir())
    quick = [name for name in names if not name.endswith(".mat")]
    turns = quick * (SCARCE - 1) + names
    content = {name: (folder / name).read_bytes() for name in names}
    good = {name: numbers_of(folder / name) for name in names}
    random = np.random.default_rng(seed)
    for number in range(count):
        name = turns[number % len(turns)]
        others = [content[other] for other in names if other != name]
        kind, damaged = damage(content[name], others, random)
        (folder / name).write_bytes(damaged)
        begin = processor()
        row = {"file": name, "damage": kind, "outcome": outcome(folder / name, good[name])}
        row["seconds"] = round(processor() - begin, 4)
        (folder / name).write_bytes(content[name])
        yield row


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        for row in main(Path(place), int(sys.argv[1]), int(sys.argv[2])):
            print(json.dumps(row), flush=True)
