"""Damaged files of all formats: the process survives, soon says so, and makes up no numbers."""

import json
import os
import subprocess
import sys
from pathlib import Path

import damaged
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.bodies.matrix_files import read_matrix

FILES = 1_000  # more by hand: python tests/damaged.py SEED COUNT


@pytest.mark.slow
def test_a_thousand_damaged_files():
    done = subprocess.run(
        [sys.executable, damaged.__file__, "23", str(FILES)],
        env=os.environ | {"PYTHONPATH": str(Path(jb.__file__).parents[1]), "JAX_ENABLE_X64": "1"},
        capture_output=True,
        text=True,
    )
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0, (done.returncode, len(rows), done.stderr[-2000:])
    assert len(rows) == FILES
    assert [(row, damaged.judged(row)) for row in rows if damaged.judged(row)] == []


# --- faults that it found -------------------------------------------------------------------------

HEAD = "%%MatrixMarket matrix coordinate real symmetric\n"
MATRICES = [
    "3 3 4\n1 1 2.0\n2 2 2.0\n3 3 2.0\n900000000 1 1.0\n",  # ended the process
    "3 3 3\n1 1 2.0\n2 2 2.0\n",
    "3 3 4\n1 1 2.0\n2 2 2.0\n3 3 2.0\n3 3 2.0\n",
    "3 3 3\n1 1 2.0\n2 2 2.0\n3 2 2.0\n",
    "3 3 3\n1 1 2.0\n2 2 2.0\n3 3.5 2.0\n",
    "900000000 900000000 1\n1 1 2.0\n",
    "3 3\n1 1 2.0\n",
]


def test_a_matrix_that_lost_entries_or_points_beyond_itself_is_told(tmp_path):
    path = tmp_path / "matrix.mtx"
    for rows in MATRICES:
        path.write_text(HEAD + rows)
        with pytest.raises(jb.InputError, match=r"matrix\.mtx: "):
            read_matrix(path)
    sparse = {"indptr": [0, 1, 2], "indices": [0, 10**6], "data": [1.0, 2.0], "shape": [2, 2]}
    np.savez(tmp_path / "matrix.npz", format=b"csc", **sparse)
    with pytest.raises(jb.InputError, match=r"is no \.npz file of a matrix"):
        read_matrix(tmp_path / "matrix.npz")
    whole = damaged.TESTS / "bodies" / "calculix" / "strip"
    (tmp_path / "strip.dof").write_bytes(whole.with_suffix(".dof").read_bytes())
    for cut in (-1, -40, 20_000):
        (tmp_path / "strip.sti").write_bytes(whole.with_suffix(".sti").read_bytes()[:cut])
        with pytest.raises(jb.InputError, match="copy the whole file again"):
            read_matrix(tmp_path / "strip.sti")


def test_a_joint_with_a_number_lost_is_told(tmp_path):
    path = tmp_path / "joint.csv"
    path.write_text("displacement,force,stiffness,limit\n0,0,1,1\n,1,1,1\n2,2,1,\n")
    with pytest.raises(jb.InputError, match="a number is missing"):
        damaged.table.read(path)
