"""Bodies from scikit-fem, by the code of the page on own bodies, beside our own bricks."""

import re
from pathlib import Path

import numpy as np
import pytest

import jbeamshell as jb
from calibration.finite_elements.boxes import two_blocks

PAGE = Path(__file__).parents[2] / "notebooks" / "pages" / "own_bodies.md"


def test_blocks_of_scikit_fem_are_those_of_our_bricks(capsys):
    pytest.importorskip("skfem")
    code = re.search(r"## From scikit-fem.*?```python\n(.*?)```", PAGE.read_text("utf-8"), re.S)
    names = {"np": np, "jb": jb}
    exec(code[1], names)
    load = {"friction": 0.25, "bolts": 12e3, "amplitude": 2300.0, "throw": False}
    known = jb.solve_contact(*two_blocks((6, 3, 2)), **load)
    found = names["history"]
    for figure in ("dissipation", "stuck_stiffness", "mesh_error"):
        assert float(getattr(found, figure)) == pytest.approx(float(getattr(known, figure)), 1e-9)
    assert f"D {known.dissipation:.4f} N mm" in capsys.readouterr().out
