"""The corpus: every file ends in good parameters, an honest "not this model", or a refusal."""

import re

import jax
import pytest

import jbeamshell as jb
from jbeamshell.cli.main import main
from jbeamshell.common.errors import InputError
from tests import corpus

CASES = corpus.corpus()


SEEN = {  # findings of `jb.inspect` on files that no run of the model is needed for
    "pinched.csv": "clearance",
    "bearing.csv": "clearance",
    "viscous.csv": "viscous",
    "elastic.csv": "elastic",
    "asymmetric.csv": "asymmetric",
    "jenkins.csv": "",
    "iwan.csv": "",
    "bouc-wen.csv": "",
    "finite elements.csv": "",
}


@pytest.mark.parametrize("name", SEEN)
def test_an_inspection_names_what_is_in_a_file(name, tmp_path):
    (case,) = (case for case in CASES if case.name == name)
    case.write(tmp_path / name)
    seen = jb.inspect(tmp_path / name)
    assert {finding.name for finding in seen.findings} == {SEEN[name]} - {""}
    assert seen.sound == ("refused" not in case.kinds)
    if not seen.sound:
        with pytest.raises(InputError, match=case.told):
            seen.check()


@pytest.fixture
def optimised():
    """Compile as a user's command does; the other tests compile more than they run."""
    jax.config.update("jax_disable_most_optimizations", False)
    yield
    jax.config.update("jax_disable_most_optimizations", True)


@pytest.mark.slow
@pytest.mark.usefixtures("optimised")
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_no_file_ends_in_silence(case, tmp_path, capsys):
    """Right at once, or by the options that the text names."""

    def end(then=()):
        code = main(corpus.words(case, tmp_path, then))
        out, err = capsys.readouterr()
        ending = corpus.ended(code, out, err, case, tmp_path)
        with capsys.disabled():
            print(f"\n{case.name:36s} {ending.kind:16s} {ending.told}")
        return ending

    ending = end()
    assert ending.kind in case.kinds, ending
    assert re.search(case.told, ending.told), ending
    if case.then:
        for option in corpus.named(case.then):
            assert option in ending.told, ending
        assert end(case.then).kind == "parameters"
