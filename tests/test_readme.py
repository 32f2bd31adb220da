"""README and CONTRIBUTING agree with the code: test line, links, paths, table of keys."""

import re
from pathlib import Path

import pytest

from jbeamshell.scene.keys import TABLE

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text("utf-8")
PAGES = ("README.md", "CONTRIBUTING.md")
FOLDERS = {path.name for path in (ROOT / "jbeamshell").iterdir() if path.is_dir()}


def key_rows():
    """Table of keys in Markdown, as the scene has it."""
    for key in TABLE.values():
        yield f"| `{key.name}` | {key.shown_default} | {key.shown_unit} | {key.sentence} |"


def test_integration_runs_the_line_of_the_readme():
    line = next(line for line in README.splitlines() if "-m pytest -n" in line)
    assert line in (ROOT / ".ci" / "run").read_text("utf-8").splitlines()


def test_the_readme_has_the_keys_of_the_scene():
    heads = "| key | default | unit | meaning |\n|---|---|---|---|\n"
    table = README.partition(heads)[2].partition("\n\n")[0]
    assert table.splitlines() == [*key_rows()], "\n".join(["the table must be:", *key_rows()])


@pytest.mark.parametrize("page", PAGES)
def test_what_a_page_points_to_is_there(page):
    text = (ROOT / page).read_text("utf-8")
    links = set(re.findall(r"\]\(([^)]+)\)", text))
    paths = set(
        re.findall(r"`(?:python )?((?:calibration|tests|notebooks|jbeamshell)/[\w./]+)", text)
    )
    inner = {
        path for path in re.findall(r"`([a-z_]+/[\w./]+)`", text) if path.split("/")[0] in FOLDERS
    }
    assert links | paths
    for path in links | paths | {f"jbeamshell/{path}" for path in inner}:
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize("page", PAGES)
def test_keys_that_a_page_names_exist(page):
    text = (ROOT / page).read_text("utf-8")
    named = set(re.findall(r"\b(?:strip|contact|load|model)\.[a-z_]+\b", text))
    files = {"model.py", "scene.toml"}
    assert named - files <= set(TABLE)
