"""Run pages and notebooks, and store what they print and show today.

    python notebooks/renew.py [NAME ...]

takes the README, the pages and the notebooks whose file names hold one of the words, or all.  The
text block below a block of Python is replaced by what it prints; a notebook gets new outputs.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

SITE = Path(__file__).parent
ROOT = SITE.parent
BLOCK = re.compile(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", re.DOTALL)
PROGRAM = """
import contextlib, io, json, sys
page, said = {"__name__": "page"}, []
for code in json.load(sys.stdin):
    stream = io.StringIO()
    with contextlib.redirect_stdout(stream):
        exec(code, page)
    said.append(stream.getvalue())
print(json.dumps(said))
"""


def renew_page(path: Path) -> None:
    """Run the blocks of a page from top to bottom in one process."""
    text = path.read_text(encoding="utf-8")
    codes = [match[1] for match in BLOCK.finditer(text)]
    if not codes:
        return
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", PROGRAM],
            input=json.dumps(codes), cwd=folder, capture_output=True, text=True, check=True,
            env=os.environ | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg"},
        )  # fmt: skip
    said = iter(json.loads(done.stdout.splitlines()[-1]))

    def shown(match: re.Match[str]) -> str:
        printed = next(said)
        if match[2] is None:
            return match[0]
        return f"```python\n{match[1]}```\n\n```text\n{printed.rstrip()}\n```"

    path.write_text(BLOCK.sub(shown, text), encoding="utf-8")


def renew_notebook(path: Path) -> None:
    """Run a notebook from top to bottom, without progress bars."""
    notebook = nbformat.read(path, as_version=4)
    about = notebook.metadata.copy()
    resources = {"metadata": {"path": str(SITE)}}
    NotebookClient(notebook, timeout=600, kernel_name="python3", resources=resources).execute()
    for cell in notebook.cells:
        cell.metadata = {}
    notebook.metadata = about
    nbformat.write(notebook, path)


def main(words: list[str]) -> None:
    """Renew the files whose names hold one of the words."""
    os.environ |= {"TQDM_DISABLE": "1", "PYTHONPATH": str(ROOT)}
    pages = [ROOT / "README.md", SITE / "index.md", *sorted((SITE / "pages").glob("*.md"))]
    for path in [*pages, *sorted(SITE.glob("*.ipynb"))]:
        if not words or any(word in path.name for word in words):
            (renew_notebook if path.suffix == ".ipynb" else renew_page)(path)
            print(path.name, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
