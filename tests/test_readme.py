"""README, CONTRIBUTING and the pages agree with the code: lines, links, paths, keys, figures."""

import re
from pathlib import Path

import pytest

from jbeamshell.scene.keys import TABLE

ROOT = Path(__file__).parent.parent
SITE = ROOT / "notebooks" / "pages"
PAGES = (
    "README.md",
    "CONTRIBUTING.md",
    "calibration/README.md",
    "verification/README.md",
    "notebooks/index.md",
    *sorted(path.relative_to(ROOT).as_posix() for path in SITE.glob("*.md")),
)
FOLDERS = {path.name for path in (ROOT / "jbeamshell").iterdir() if path.is_dir()}


@pytest.mark.parametrize("page", PAGES)
def test_what_a_page_points_to_is_there(page):
    text = (ROOT / page).read_text("utf-8")
    folder = Path(page).parent
    links = {
        (folder / link.partition("#")[0]).as_posix()
        for link in re.findall(r"\]\(([^)]+)\)", text)
        if not link.startswith(("#", "https:")) and "generated/" not in link
    }
    paths = set(
        re.findall(
            r"`(?:python )?((?:calibration|verification|tests|notebooks|jbeamshell)/[\w./]+)", text
        )
    )
    inner = {
        path for path in re.findall(r"`([a-z_]+/[\w./]+)`", text) if path.split("/")[0] in FOLDERS
    }
    for path in links | paths | {f"jbeamshell/{path}" for path in inner}:
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize("page", PAGES)
def test_keys_that_a_page_names_exist(page):
    text = (ROOT / page).read_text("utf-8")
    named = set(re.findall(r"\b(?:strip|contact|load|model|member)\.[a-z_]+\b", text))
    files = {"model.py", "model.condensed", "contact.csv", "strip.svg"}
    others = files | {
        "member.shape",
        "contact.frictoin",
        "contact.png",
    }  # an array; a key with a slip
    assert named - others <= set(TABLE)
