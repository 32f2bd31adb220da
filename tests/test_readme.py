"""The README's test line is the one that continuous integration runs."""

from pathlib import Path

ROOT = Path(__file__).parent.parent


def test_integration_runs_the_line_of_the_readme():
    line = next(
        line for line in (ROOT / "README.md").read_text().splitlines() if "-m pytest" in line
    )
    assert line in (ROOT / ".ci" / "run").read_text().splitlines()


def test_pictures_of_the_readme_are_there():
    assert (ROOT / "calibration" / "finite_elements.png").stat().st_size > 10_000
