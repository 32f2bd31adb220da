"""Damaged files of all formats: the process survives, soon says so, and makes up no numbers."""

import collections
import json
import os
import subprocess
import sys
import warnings
from pathlib import Path

import damaged
import numpy as np
import pytest
from measured.test_laboratory import COLUMNS, WRITERS
from scipy.io import savemat

import jbeamshell as jb

FILES = 1_000  # more by hand: python tests/damaged.py FOLDER SEED COUNT
SLOWEST = 10.0  # seconds for a file
TINY = {"model.nodes": 9, "load.steps_per_half_cycle": 2, "load.cycles": 1}


def good_files(folder):
    """A file of each format."""
    columns = {name: np.asarray(column) for name, column in COLUMNS.items()}
    rows = np.column_stack(list(columns.values()))
    np.savetxt(folder / "loop.csv", rows, "%.9g", ",", header="force,displacement", comments="")
    german = "Kraft [kN];Weg [mm]\n" + "\n".join(f"{f:.9g};{u:.9g}" for f, u in rows)
    (folder / "german.csv").write_text(german.replace(".", ","))
    np.savez(folder / "loop.npz", **columns)
    both = np.rec.fromarrays(list(columns.values()), names=list(columns))
    np.save(folder / "loop.npy", np.asarray(both))
    for name, squeezed in (("loop.mat", False), ("loop.squeezed.mat", True)):
        savemat(folder / name, columns, do_compression=squeezed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, write in WRITERS.items():
            write(folder / name)
    scene = jb.Scene().replace(TINY)
    jb.write_scene(scene, folder / "scene.toml")
    jb.solve(scene).save(folder / "history.npz")


@pytest.mark.slow
def test_a_thousand_damaged_files(tmp_path):
    good_files(tmp_path)
    done = subprocess.run(
        [sys.executable, damaged.__file__, str(tmp_path), "22", str(FILES)],
        env=os.environ | {"PYTHONPATH": str(Path(jb.__file__).parents[1]), "JAX_ENABLE_X64": "1"},
        capture_output=True,
        text=True,
    )
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0, (done.returncode, len(rows), done.stderr[-2000:])
    assert len(rows) == FILES
    for row in rows:
        assert row["outcome"] in ("refused", "same", "changed"), row
        assert row["seconds"] < SLOWEST, row
        checked = row["file"].endswith(damaged.CHECKED)
        assert not (checked and row["outcome"] == "changed"), row
    counts = collections.Counter((row["file"], row["outcome"]) for row in rows)
    print(*sorted(counts.items()), max(row["seconds"] for row in rows), sep="\n")
