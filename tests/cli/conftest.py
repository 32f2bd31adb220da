"""Runners of the command line for its tests."""

import re

import pytest

from jbeamshell.cli import main


@pytest.fixture
def cli(capsys):
    def cli(*words):
        code = main.main([*map(str, words)])
        out, err = capsys.readouterr()
        # Coarse grids are doubted, and rightly.
        lines = (line for line in err.splitlines(True) if "the dissipation may be off" not in line)
        return code, out, "".join(lines)

    return cli


@pytest.fixture
def refused(cli, tmp_path):
    """Runs a command that must fail with one line on stderr and leave nothing; returns the line."""

    def refused(*words, code=2):
        def held():
            return {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}

        before = held()
        if "--out" not in words and words[0] not in ("advise", "sweep"):
            words = [*words, "--out", tmp_path / "new" / "out"]
        got, out, err = cli(*words)
        assert (got, out) == (code, "")
        assert re.fullmatch(r"jbeamshell: [^\n]+\n", err), err
        assert "Traceback" not in err
        assert held() == before
        assert not (tmp_path / "new").exists()
        return err.removeprefix("jbeamshell: ").rstrip()

    return refused
