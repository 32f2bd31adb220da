"""Options of the process: each in a process of its own, because they come before JAX starts."""

import os
import subprocess
import sys

import pytest

import jbeamshell as jb
from jbeamshell.common import jax_options
from jbeamshell.common.errors import InputError

CACHE = "JAX_COMPILATION_CACHE_DIR"
THREADS = "OPENBLAS_NUM_THREADS"
FAST = f"{jax_options.EXTRA}{jax_options.FAST_LOOPS}"


def flags_after(flags, call="jbeamshell.configure()", without=()):
    """Output of a call and then XLA_FLAGS, in a process that was started with some variables."""
    code = f"import os, jbeamshell; {call}; print(os.environ.get('XLA_FLAGS', ''))"
    kept = {k: v for k, v in os.environ.items() if k not in ("XLA_FLAGS", *without)}
    given = kept | flags
    done = subprocess.run([sys.executable, "-c", code], env=given, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_flags_are_added_to_what_is_there():
    flags = {
        "": FAST,
        "--xla_dump_to=there": f"--xla_dump_to=there {FAST}",
        f"{jax_options.EXTRA}a=b": f"{FAST},a=b",
        FAST: FAST,
    }
    call = (
        f"for os.environ['XLA_FLAGS'] in {list(flags)}: "
        "jbeamshell.configure(); print(os.environ['XLA_FLAGS'])"
    )
    assert flags_after({}, f"exec({call!r})").splitlines()[:-1] == list(flags.values())


def test_nothing_is_chosen_by_import():
    look = "import jax; print(jax.config.jax_enable_x64)"
    assert flags_after({}, look) == "False"
    single = "jbeamshell.configure(double=False, fast_loops=False)"
    assert flags_after({}, f"{single}; {look}") == "False"
    assert flags_after({}, f"jbeamshell.configure(fast_loops=False); {look}") == "True"


def test_lapack_of_numpy_and_of_scipy_has_the_threads_that_are_asked_for():
    told = "[print(one['num_threads']) for one in threadpoolctl.threadpool_info()]"
    look = "import numpy, threadpoolctl; jbeamshell.configure(); import scipy.linalg; " + told
    for said in ("1", "2"):
        assert set(flags_after({THREADS: said}, look).split()[:-1]) == {said}
    assert set(flags_after({}, look, without=(THREADS,)).split()[:-1]) == {"1"}


def test_the_walk_is_in_jax_where_it_is_asked_for_and_says_the_same():
    """A process has one walk: that in C if it was built, or that in JAX."""
    words = "from jbeamshell.contact_line import native; print(native.in_words())"
    values = {"model.section": "bar", "model.nodes": 9}
    code = (
        "import jax; jax.config.update('jax_enable_x64', True); import jbeamshell as jb; "
        f"print(float(jb.solve(jb.Scene().replace({values}), throw=False).dissipation)); {words}"
    )
    by_choice = flags_after({}, f"jbeamshell.configure(walk='jax'); exec({code!r})").splitlines()
    by_variable = flags_after({jax_options.WALK: "jax"}, f"jbeamshell.configure(); exec({words!r})")
    for said in (by_choice[1], by_variable.splitlines()[0]):
        assert said.endswith("in JAX, more slowly (JBEAMSHELL_WALK = jax)")
    usual = float(jb.solve(jb.Scene().replace(values), throw=False).dissipation)
    assert float(by_choice[0]) == pytest.approx(usual, rel=1e-9)


def test_a_walk_that_is_none():
    with pytest.raises(InputError, match="walk = 'rust': choose 'c' or 'jax'"):
        jax_options.configure(walk="rust")


def test_calls_wait_unless_told_otherwise():
    look = f"print(jax.config.values[{jax_options.ASYNCHRONOUS!r}])"
    assert flags_after({}, f"import jax; {look}") == "True"
    assert flags_after({}, f"import jax; jbeamshell.configure(fast_loops=False); {look}") == "False"


FOLDER = "print(jax.config.jax_compilation_cache_dir)"


@pytest.mark.parametrize(
    ("jax_has", "asked", "folder"),
    [
        ("", "", "{home}/jbeamshell"),
        ("{home}/own", "", "{home}/own"),
        ("{home}/own", "cache='{home}/other'", "{home}/other"),
        ("", "cache=False", "None"),
    ],
)
def test_compiled_programs_are_kept(tmp_path, jax_has, asked, folder):
    jax_has, asked, folder = (text.format(home=tmp_path) for text in (jax_has, asked, folder))
    given = {CACHE: jax_has} if jax_has else {}
    call = f"jbeamshell.configure({asked}); import jax; {FOLDER}"
    found = flags_after(given | {"XDG_CACHE_HOME": str(tmp_path)}, call, without=(CACHE,))
    assert found.splitlines()[0] == folder


def test_without_a_folder_to_write_to_nothing_is_kept(tmp_path):
    (tmp_path / "file").write_text("no folder")
    nowhere = {"XDG_CACHE_HOME": str(tmp_path / "file")}
    call = f"jbeamshell.configure(); import jax; {FOLDER}"
    assert flags_after(nowhere, call, without=(CACHE,)).splitlines()[0] == "None"


def test_too_late_is_said(monkeypatch):
    monkeypatch.setattr(jax_options, "is_asynchronous", lambda: False)
    monkeypatch.setenv("XLA_FLAGS", "")
    monkeypatch.setattr(jax_options, "started", lambda: True)
    with pytest.raises(InputError, match=r"fast_loops = True.*already started.*before anything"):
        jax_options.configure()
    monkeypatch.setenv("XLA_FLAGS", FAST)
    jax_options.configure()  # already so
    monkeypatch.setattr(jax_options, "is_asynchronous", lambda: True)
    with pytest.raises(InputError, match=r"asynchronous = False.*already started"):
        jax_options.configure()
