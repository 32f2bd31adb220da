"""The README's test line is the one that continuous integration runs."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent


def test_integration_runs_the_line_of_the_readme():
    line = next(
        line for line in (ROOT / "README.md").read_text().splitlines() if "-m pytest" in line
    )
    assert line in (ROOT / ".ci" / "run").read_text().splitlines()


def test_what_the_readme_points_to_is_there():
    links = re.findall(r"\]\(([^)]+)\)", (ROOT / "README.md").read_text())
    assert "calibration/finite_elements.png" in links
    for link in links:
        assert (ROOT / link).exists(), link
