"""The notebooks run from top to bottom, and are committed with what they show."""

import os
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

import jbeamshell

FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path, monkeypatch):
    places = [str(Path(jbeamshell.__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, places)))
    monkeypatch.delenv("MPLBACKEND", raising=False)  # the notebook's own, as users see it
    notebook = nbformat.read(path, as_version=4)
    for cell in code_cells(notebook):
        cell.outputs, cell.execution_count = [], None
    NotebookClient(
        notebook,
        timeout=300,
        kernel_name="python3",
        resources={"metadata": {"path": str(FOLDER)}},
    ).execute()
    assert pictures(notebook) == pictures(nbformat.read(path, as_version=4)) > 0


def test_notebooks_are_small_and_committed_with_their_outputs():
    for path in NOTEBOOKS:
        notebook = nbformat.read(path, as_version=4)
        cells = code_cells(notebook)
        counts = [cell.execution_count for cell in cells]
        assert counts == list(range(1, len(cells) + 1)), "run it from top to bottom and save it"
        kinds = {out.get("name", out.output_type) for cell in cells for out in cell.outputs}
        assert not kinds & {"error", "stderr"}
        assert path.stat().st_size < 1_000_000
        assert notebook.metadata.kernelspec.name == "python3"
        assert not any(cell.metadata for cell in notebook.cells)


def pictures(notebook):
    """Number of pictures in a notebook."""
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    return sum("image/png" in output.get("data", {}) for output in outputs)
