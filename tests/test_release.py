"""Release: one version, and a wheel that works alone in a bare environment."""

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

import jbeamshell

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
CLEAN = {k: v for k, v in os.environ.items() if not k.startswith(("JAX_", "XLA_", "PYTHONPATH"))}


def test_all_files_say_one_version():
    changes = (ROOT / "CHANGELOG.md").read_text("utf-8")
    cited = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.search(r"^## (\S+)", changes, re.M)[1] == PROJECT["version"]
    assert re.search(r"^version: (\S+)$", cited, re.M)[1] == PROJECT["version"]
    assert jbeamshell.__version__ == version("jbeamshell")


def run(*command, folder):
    done = subprocess.run(command, cwd=folder, env=CLEAN, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    probe = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "hatchling"]
    reached = subprocess.run([*probe, "--dest", folder / "probe"], capture_output=True)
    if reached.returncode:
        pytest.skip("no package index can be reached")
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir")
    run(*pip, str(folder), str(ROOT), folder=folder)
    (made,) = folder.glob("jbeamshell-*.whl")
    return made


@pytest.mark.slow
def test_the_wheel_holds_the_package_its_data_and_their_licence(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    package = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "jbeamshell").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert package <= names
    data = {name for name in names if name.startswith("jbeamshell/example_data/")}
    assert "jbeamshell/example_data/loops_eta0.1126.csv" in data
    assert "MIT" in zipfile.ZipFile(wheel).read("jbeamshell/example_data/README.md").decode()
    (about,) = (name for name in names if name.endswith("/METADATA"))
    words = zipfile.ZipFile(wheel).read(about).decode()
    assert "# jbeamshell" in words
    assert not re.findall(r"\]\((?!https?:)", words)  # an index has no files beside the README
    others = {name for name in names - package - data if ".dist-info/" not in name}
    assert not others


@pytest.mark.slow
def test_the_wheel_runs_and_fits_in_a_bare_environment(wheel, tmp_path):
    run(sys.executable, "-m", "venv", "bare", folder=tmp_path)
    tools = tmp_path / "bare" / ("Scripts" if os.name == "nt" else "bin")
    run(str(tools / "python"), "-m", "pip", "install", "--quiet", str(wheel), folder=tmp_path)
    command = str(tools / "jbeamshell")
    assert PROJECT["version"] in run(command, "--version", folder=tmp_path)
    run(command, "run", "--out", "run", folder=tmp_path)
    assert (tmp_path / "run" / "loop.png").stat().st_size > 10_000
    run(command, "fit", "--out", "fit", folder=tmp_path)
    assert (tmp_path / "fit" / "overlay.png").stat().st_size > 10_000
