"""Documentation: it builds without warnings, its code runs, and it describes every public name."""

import contextlib
import doctest
import functools
import importlib
import io
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
from sphinx.search.en import SearchEnglish

import jbeamshell as jb
from jbeamshell.cli.main import _parser

ROOT = Path(__file__).parent.parent
SITE = ROOT / "notebooks"
PAGES = [ROOT / "README.md", SITE / "index.md", *sorted((SITE / "pages").glob("*.md"))]
BLOCK = re.compile(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", re.DOTALL)
SHELL = re.compile(r"```sh\n(.*?)```", re.DOTALL)
COMMAND = re.compile(r"(?:^|&& )(?:\.venv/bin/)?jbeamshell (.+)$", re.MULTILINE)


def blocks(page):
    """Blocks of Python on a page, each with what it prints, or None if the page does not say."""
    return [match.groups() for match in BLOCK.finditer(page.read_text("utf-8"))]


WITH_CODE = [page for page in PAGES if blocks(page)]


def alike(said, shown):
    """True if two texts hold the same words, and numbers that differ by round-off alone."""

    def number(word):
        try:
            return float(word.strip(",()[]%"))
        except ValueError:
            return None

    pairs = list(zip(said.split(), shown.split(), strict=False))
    same = len(said.split()) == len(shown.split())
    for one, other in pairs:
        values = number(one), number(other)
        if None in values:
            same &= one == other
        else:
            same &= math.isclose(*values, rel_tol=2e-3, abs_tol=1e-10)
    return same


PREPARED = """
import warnings
warnings.simplefilter("error")
warnings.filterwarnings("ignore", "JAXopt is no longer maintained")
warnings.filterwarnings("ignore", category=ResourceWarning)
import contextlib, io, json, sys
page, said = {"__name__": "page"}, []
for code in json.load(sys.stdin):
    stream = io.StringIO()
    with contextlib.redirect_stdout(stream):
        exec(code, page)
    said.append(stream.getvalue())
print(json.dumps(said))
"""


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: page.stem)
def test_code_of_a_page_runs_and_prints_what_the_page_says(page, tmp_path):
    codes, texts = zip(*blocks(page), strict=True)
    done = subprocess.run(
        [sys.executable, "-c", PREPARED],
        input=json.dumps(codes), cwd=tmp_path, capture_output=True, text=True, timeout=300,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    for said, shown in zip(json.loads(done.stdout.splitlines()[-1]), texts, strict=True):
        assert shown is None or alike(said, shown), said


QUESTIONS = """
compute the energy dissipated per cycle from the area of a hysteresis loop
equivalent viscous damping ratio from a hysteresis loop
loss factor of a bolted joint
fit Bouc-Wen parameters to measured hysteresis data
fit a four-parameter Iwan model to energy dissipation by a power law
hysteresis loop of a joint in CalculiX: energy dissipated by friction
how does bolt preload change natural frequency and damping
preload of a bolt from its tightening torque
is my parameter identifiable from the loop
gradient of a contact simulation with friction by automatic differentiation
pinching and stiffness degradation in a hysteresis model
backlash or clearance in a measured loop
Rayleigh damping and friction damping in one structure
friction coefficient from a measured force displacement loop
amplitude dependent frequency and damping of a jointed structure
why does the hysteresis loop not close
harmonic balance with friction contact elements
export a joint to Abaqus as a connector
mesh size for micro-slip in finite elements
vmap many parameters in parallel on GPU or cores
"""
SITE_SEARCH = SearchEnglish({})


def stems(text):
    """Stems of a text's words, as the site's search has them."""
    words = [word.lower() for word in SITE_SEARCH.split(text)]
    return {SITE_SEARCH.stem(word) for word in words if word not in SITE_SEARCH.stopwords}


@pytest.mark.parametrize("question", QUESTIONS.strip().splitlines())
def test_questions_that_people_ask_find_a_page(question):
    # The site's search finds pages that hold every word of a question.
    assert any(stems(question) <= stems(page.read_text("utf-8")) for page in PAGES)


def test_command_lines_of_pages_are_understood():
    parser = _parser()
    blocks = [block for page in PAGES for block in SHELL.findall(page.read_text("utf-8"))]
    for line in (line for block in blocks for line in COMMAND.findall(block)):
        with contextlib.redirect_stderr(io.StringIO()) as said:
            try:
                parser.parse_args(line.replace("'", "").split())
            except SystemExit:
                pytest.fail(f"{line}: {said.getvalue()}")


SOURCES = [
    path
    for path in sorted((ROOT / "jbeamshell").rglob("*.py"))
    if ">>> " in path.read_text("utf-8") and path.name != "__main__.py"
]


class Lenient(doctest.OutputChecker):
    """Checker that asks nothing of a line whose value the docstring does not show."""

    def check_output(self, want, got, optionflags):
        return not want or super().check_output(want, got, optionflags)


OF_A_USER = ("joint.toml", "upper, lower")  # what examples name and only a user has


def names_of_examples():
    """Names that examples use without saying where they come from."""
    joint = jb.dynamics.Joint(displacements=[1.0, 3.0], forces=[1.0, 2.0])
    springs = [jb.dynamics.Attachment(joint, 0)]
    structure = jb.dynamics.Structure(np.eye(2), [[2.0, -2.0], [-2.0, 2.0]], springs)
    own = {name: getattr(jb.dynamics, name) for name in jb.dynamics.__all__}
    libraries = {"jax": jax, "jnp": jnp, "np": np, "plt": plt, "jb": jb}
    parts = {"plotting": jb.plotting, "identify": jb.identify}
    return own | libraries | parts | {"scene": jb.Scene(), "structure": structure}


@functools.cache
def a_history():
    return jb.solve(jb.Scene())


@pytest.mark.slow
@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.stem)
def test_examples_of_docstrings_run(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    module = importlib.import_module(name)
    runner = doctest.DocTestRunner(Lenient(), optionflags=doctest.ELLIPSIS)
    said = io.StringIO()
    for test in doctest.DocTestFinder(exclude_empty=True).find(module, name):
        source = "".join(example.source for example in test.examples)
        if not any(words in source for words in OF_A_USER):
            test.globs = names_of_examples() | test.globs
            if "history" in source and "history =" not in source:
                test.globs["history"] = a_history()
            runner.run(test, out=said.write)
    plt.close("all")
    assert not runner.failures, said.getvalue()


def faces():
    """Module that knows the public names of each face of the package."""
    sys.path.insert(0, str(SITE))
    try:
        return importlib.import_module("generate.names")
    finally:
        sys.path.remove(str(SITE))


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Folder of the built site."""
    folder = tmp_path_factory.mktemp("site")
    line = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", str(SITE), str(folder)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(line, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-3000:]
    return folder


@pytest.mark.slow
class TestSite:
    def test_it_builds_without_warnings(self, site):
        assert (site / "index.html").exists()
        assert (site / "pages" / "start.html").exists()

    def test_every_public_name_is_described(self, site):
        from sphinx.util.inventory import InventoryFile

        known = InventoryFile.loads((site / "objects.inv").read_bytes(), uri="")
        names = faces()
        described = {name for kind in known.data for name in known.data[kind] if kind[:3] == "py:"}
        expected = {
            f"{names.home(face, name)}.{name}"
            for face in names.FACES
            for name in names.public(face)
        }
        assert expected <= described, sorted(expected - described)
        # Independent of the list that wrote the pages: what a user sees.
        parts = {name for name in jb.__all__ if f"jbeamshell.{name}" in sys.modules}
        assert {f"jbeamshell.{name}" for name in set(jb.__all__) - parts - {"library"}} <= described

    def test_no_equation_is_left_as_text(self, site):
        theory = (site / "pages" / "theory.html").read_text("utf-8")
        assert theory.count('class="math') > 40
        assert "$$" not in re.sub(r"<script.*?</script>", "", theory, flags=re.DOTALL)
