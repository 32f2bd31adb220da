"""README, CONTRIBUTING and the pages agree with the code: lines, links, paths, keys, figures."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from jbeamshell.scene.keys import TABLE

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text("utf-8")
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


def test_integration_runs_the_line_of_the_readme():
    line = next(line for line in README.splitlines() if "-m pytest -n" in line)
    assert line in (ROOT / ".ci" / "run").read_text("utf-8").splitlines()


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


class TestFiguresOfTheReadme:
    """The table beside the alternatives holds what the records hold."""

    def record(self, path):
        return json.loads((ROOT / path).read_text("utf-8"))

    def test_cycles_and_errors(self):
        rows = {
            row["what"]: row
            for row in self.record("verification/benchmarks/speed.json")["one"]["rows"]
        }
        calculix, iwan = rows["CalculiX, 4 steps"], rows["Iwan's network, 20 steps"]
        own = rows["patterns in NumPy, 1 step"]
        peer = self.record("verification/benchmarks/condensed.json")["peer"]
        (ours,) = (row for row in peer["ours"] if row["nodes"] == 49)
        for words in (
            f"{ours['built_us'] / 1e3:.3g} ms; {ours['kept_us']:.3g} µs if only",
            f"{calculix['median_us'] / 1e6:.3g} s, CalculiX",
            f"{iwan['median_us']:.3g} µs, once fitted",
            f"{own['median_us']:.3g} µs, guessed slip patterns in NumPy",
            f"{100 * ours['error']:.2g} %, plane elasticity on 49 nodes",
            f"| {100 * calculix['error_to_elements']:.2g} % |",
            f"| {calculix['median_us'] * 1e-6 * 1e4 / 3600:.0f} hours |",
            f"| {own['median_us'] * 1e-6 * 1e4:.0f} s |",
        ):
            assert words in README, words

    def test_laws_batches_and_derivatives(self):
        heights = self.record("calibration/studies/laws_of_a_strip.json")["heights"].values()
        shares = {
            law: [100 * np.median(np.abs(height["models"][law]["error"])) for height in heights]
            for law in ("iwan4", "sliders8")
        }
        low, high = (min(shares["sliders8"]), max(shares["sliders8"]))
        iwan = f"{min(shares['iwan4']):.0f} to {max(shares['iwan4']):.0f} %"
        assert f"{iwan}, eight sliders {low:.1f} to {high:.0f} %" in README
        speed = self.record("verification/benchmarks/speed.json")
        runs = [row["median_runs"] for row in speed["gradient"]["rows"]]
        assert f"{runs[1]:.1f} to {runs[2]:.1f} runs" in README
        swept = self.record("verification/benchmarks/sweeps.json")["member"]["grid"]["lanes_per_s"]
        assert f"| {1e4 / swept:.0f} s of plane elasticity, after compiling" in README
        friction = self.record("verification/methods.json")["laws"]["rows"]
        (sharp, _, _, tanh) = (row for row in friction if row["scene"] == "standard")
        excess = tanh["dissipation"][-1] / sharp["dissipation"][-1] - 1.0
        assert f"{100 * excess:.0f} % too much after {tanh['steps'][-1]} steps" in README
