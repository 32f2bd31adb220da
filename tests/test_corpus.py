"""The corpus: every file ends in good parameters, an honest "not this model", or a refusal."""

import re

import pytest

from jbeamshell.cli.main import main
from tests import corpus

CASES = corpus.corpus()


def test_the_corpus_has_many_files_with_names_of_their_own():
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names) >= 25


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_no_file_ends_in_silence(case, tmp_path, capsys):
    code = main(corpus.words(case, tmp_path))
    out, err = capsys.readouterr()
    ending = corpus.ended(code, out, err, case, tmp_path)
    with capsys.disabled():
        print(f"\n{case.name:28s} {ending.kind:16s} {ending.told}")
    assert ending.kind in case.kinds, ending
    assert re.search(case.told, ending.told), ending
