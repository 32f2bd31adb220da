"""Recordings from arrays, MATLAB and NumPy files, and several files at once."""

import io
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat

from jbeamshell.common.errors import InputError
from jbeamshell.measured.form import FEWEST_POINTS
from jbeamshell.measured.loop_files import read_loops
from jbeamshell.measured.loops import make_loop

PHASE = np.linspace(0.0, 2.0 * np.pi, 13)
FORCE, DISPLACEMENT = 3.0 * np.cos(PHASE), 0.25 * np.cos(PHASE - 0.3)
TIME = np.arange(13.0)
BOTH = {"force": FORCE, "displacement": DISPLACEMENT}
PAIRS = np.column_stack([FORCE, DISPLACEMENT])


def written(path, variables):
    """The file, with variables by name, or one array in an .npy."""
    if path.suffix == ".mat":
        savemat(path, variables)
    elif path.suffix == ".npz":
        np.savez_compressed(path, **variables)
    else:
        np.save(path, variables)
    return path


def of_structs(*names):
    return np.array(
        list(zip(*(np.asarray(BOTH[name]) for name in names), strict=True)),
        dtype=[(name, float) for name in names],
    )


# --- files of numbers ---------------------------------------------------------------------------

WITH_UNITS = {"force_kN": 1e-3 * FORCE, "displacement_mm": 1e3 * DISPLACEMENT}
FILES = {
    "vectors.mat": BOTH | {"note": "rig 3", "rate": 50.0},
    "rows and columns.mat": {"force": FORCE[None], "displacement": DISPLACEMENT[:, None]},
    "units.mat": WITH_UNITS,
    "struct.mat": {"test": BOTH | {"name": "rig"}},
    "structs in structs.mat": {"test": {"run": {"data": BOTH}, "date": "today"}},
    "vectors.npz": BOTH | {"remarks": np.array(["rig"])},
    "units.npz": WITH_UNITS,
    "remarks of objects.npz": BOTH | {"remark": np.array([None, {}], dtype=object)},
    "integers.npz": {"force": np.round(FORCE * 8).astype("i2"), "displacement": DISPLACEMENT},
    "single.npz": {"force": FORCE.astype("f4"), "displacement": DISPLACEMENT.astype(">f4")},
    "named.npy": of_structs("displacement", "force"),
}
TWO = np.array(
    [(0.5 * FORCE, DISPLACEMENT), (FORCE, 2.0 * DISPLACEMENT)],
    dtype=[("force", object), ("displacement", object)],
)
CHOSEN = {
    "matrix.mat": ({"data": PAIRS}, "data column 1", "data column 2"),
    "lying matrix.npz": ({"data": PAIRS.T}, "data row 1", "data row 2"),
    "matrix.npy": (PAIRS, "column 1", "column 2"),
    "two tests.mat": ({"tests": TWO}, "tests(2).force", "tests(1).displacement"),
}


@pytest.mark.parametrize("name", FILES)
def test_files_of_named_vectors(tmp_path, name):
    (got,) = read_loops(written(tmp_path / name, FILES[name]))
    scale = 8.0 if "integers" in name else 1.0
    close = 1e-6 if "single" in name else 0.5 if "integers" in name else 1e-14
    np.testing.assert_allclose(got.force, scale * FORCE, rtol=close, atol=close)
    np.testing.assert_allclose(got.displacement, DISPLACEMENT, rtol=1e-6, atol=1e-8)
    assert got.label == name


@pytest.mark.parametrize("name", CHOSEN)
def test_columns_of_matrices_are_chosen(tmp_path, name):
    variables, force, displacement = CHOSEN[name]
    path = written(tmp_path / name, variables)
    with pytest.raises(InputError, match=r"needs one column named '\w+' in its variables"):
        read_loops(path)
    chosen = {"force": force, "displacement": displacement}
    units = {"force": "kN", "displacement": "mm"}
    (got,) = read_loops(path, columns=chosen, units=units)
    np.testing.assert_allclose(got.force, 1e3 * FORCE, rtol=1e-14)
    np.testing.assert_allclose(got.displacement, 1e-3 * DISPLACEMENT, rtol=1e-14)


def test_numpy_files_tell_missing_and_infinite_points(tmp_path):
    force = np.where(TIME == 4, np.nan, FORCE)
    path = written(tmp_path / "a.npz", {"force": force, "displacement": DISPLACEMENT})
    (got,) = read_loops(path)
    assert (got.dropped, got.force.size) == (1, 12)
    written(path, {"force": np.where(TIME == 4, np.inf, FORCE), "displacement": DISPLACEMENT})
    with pytest.raises(
        InputError, match=r"a\.npz: 'force' is infinite at element 5: give a finite"
    ):
        read_loops(path)


def zip_of(content):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("force.npy", content)
    return file.getvalue()


def pickled():
    file = io.BytesIO()
    np.save(file, np.array([{}, {}], dtype=object), allow_pickle=True)
    return file.getvalue()


BAD = {
    "empty.mat": (b"", "is no .mat file of numbers"),
    "text.mat": (b"force,displacement\n1,2\n", "is no .mat file of numbers"),
    "new.mat": (
        b"MATLAB 7.3".ljust(512) + b"\x89HDF\r\n\x1a\n",
        "is no .mat file of numbers (OSError: ",
    ),
    "text.npy": (b"force,displacement\n", "is no .npy file of numbers (ValueError: "),
    "pickled.npy": (pickled(), "is no .npy file of numbers (ValueError: Object arrays cannot be"),
    "text.npz": (b"force,displacement\n", "is no .npz file of numbers (BadZipFile: "),
    "other.npz": (zip_of(b"force,displacement\n"), "is no .npz file of numbers (ValueError: "),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_are_refused(tmp_path, name):
    content, told = BAD[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_loops(tmp_path / name)
    assert str(caught.value).startswith(name)
    assert told in str(caught.value)


def test_a_byte_that_kills_scipys_reader_does_not_kill_the_process(tmp_path):
    path = tmp_path / "damaged.mat"
    savemat(path, BOTH)
    content = bytearray(path.read_bytes())
    content[184] = 0xD4  # a type that is none
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"damaged\.mat: .*it is damaged"):
        read_loops(path)


@pytest.mark.parametrize(
    ("variables", "told"),
    [
        ({"note": "rig"}, "a.mat: holds no columns of numbers: give named vectors"),
        (BOTH | {"force": FORCE[:-1]}, "'force' has 12 values, 'displacement' 13: give columns of"),
        (WITH_UNITS | {"force_kN": 0 * FORCE}, "a.mat: force is constant (0): no loop to fit"),
        ({"force_mm": FORCE, "displacement_mm": FORCE}, "'mm' is no unit of force"),
    ],
)
def test_variables_that_make_no_recording(tmp_path, variables, told):
    with pytest.raises(InputError) as caught:
        read_loops(written(tmp_path / "a.mat", variables))
    assert told in str(caught.value)


GOOD = {}


@pytest.fixture(scope="module", autouse=True)
def _good_files(tmp_path_factory):
    for name in ("good.mat", "good.npz", "good.npy"):
        variables = of_structs("force", "displacement") if name.endswith("npy") else BOTH
        path = written(tmp_path_factory.getbasetemp() / name, variables)
        GOOD[path.suffix] = path.read_bytes()


@given(
    suffix=st.sampled_from([".npz", ".npy", ".npz", ".npy", ".mat"]),
    at=st.integers(0, 600),
    length=st.integers(0, 20),
    new=st.binary(max_size=20),
    cut=st.none() | st.integers(0, 600),
)
@pytest.mark.filterwarnings("ignore")
def test_broken_files_give_recordings_or_one_clear_line(
    tmp_path_factory, suffix, at, length, new, cut
):
    good = GOOD[suffix]
    path = tmp_path_factory.getbasetemp() / f"broken{suffix}"
    path.write_bytes((good[:at] + new + good[at + length :])[:cut])
    try:
        found, refused = read_loops(path), path.name
    except InputError as error:
        found, refused = [], str(error)
    assert path.name in refused
    assert len(refused.splitlines()) == 1
    assert np.all(np.isfinite([[r.force, r.displacement] for r in found]))


# --- several files ------------------------------------------------------------------------------


def test_several_files_keep_their_order_and_tell_their_folders_where_names_are_alike(tmp_path):
    paths = []
    for i, name in enumerate(("b/run.npz", "a/run.npz", "a/slow.npz")):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        paths.append(written(tmp_path / name, BOTH | {"force": (i + 1) * FORCE}))
    found = read_loops(paths)
    assert [r.label for r in found] == ["b/run.npz", "a/run.npz", "a/slow.npz"]
    assert [r.label for r in read_loops(paths[1:])] == ["run.npz", "slow.npz"]
    for i, recording in enumerate(found):
        np.testing.assert_array_equal(recording.force, (i + 1) * FORCE)
    with pytest.raises(InputError, match=r"a/run\.npz: is given twice: it would count double"):
        read_loops([*paths, str(paths[1])])
    with pytest.raises(InputError, match="no file given: name at least one"):
        read_loops([])


def test_groups_of_several_files_are_labelled_by_both(tmp_path):
    marks = np.repeat([1.0, 2.0], 13)
    twice = {name: np.tile(column, 2) for name, column in BOTH.items()}
    paths = [written(tmp_path / name, twice | {"A": marks}) for name in ("x.npz", "y.npz")]
    labels = [recording.label for recording in read_loops(paths)]
    assert labels == ["x.npz: A = 1", "x.npz: A = 2", "y.npz: A = 1", "y.npz: A = 2"]


# --- arrays -------------------------------------------------------------------------------------


def test_points_without_a_number_are_dropped_and_counted():
    force = np.where(np.isin(TIME, (4, 6)), np.nan, FORCE)
    displacement = np.where(np.isin(TIME, (6, 12)), np.nan, DISPLACEMENT)
    got = make_loop(force, displacement, "rig", time=TIME, normal_force=TIME * np.nan)
    kept = ~np.isin(TIME, (4, 6, 12))
    np.testing.assert_array_equal(got.force, FORCE[kept])
    np.testing.assert_array_equal(got.displacement, DISPLACEMENT[kept])
    np.testing.assert_array_equal(got.time, TIME[kept])
    assert got.dropped == 3
    assert got.notes == ("3 of 13 rows lack a number: left out",)


def test_arrays_of_any_kind():
    assert FEWEST_POINTS == 8
    got = make_loop(list(FORCE[:8]), tuple(DISPLACEMENT[:8]), "rig")
    np.testing.assert_array_equal(got.force, FORCE[:8])
    assert (got.label, got.time, got.dropped, got.notes) == ("rig", None, 0, ())
    assert (got.cycles, got.noise, got.standard_error) == (1, None, None)


NAN = np.where(TIME < 7, np.nan, FORCE)


@pytest.mark.parametrize(
    ("force", "displacement", "told"),
    [
        (FORCE[:-1], DISPLACEMENT, "rig: force and displacement differ in length: give pairs"),
        (FORCE, DISPLACEMENT[:, None], r"rig: displacement has shape \(13, 1\): give 8 points"),
        (FORCE[:7], DISPLACEMENT[:7], r"rig: force has shape \(7,\): give 8 points"),
        (1.0, 2.0, r"rig: force has shape \(\): give 8 points"),
        (["a"] * 9, DISPLACEMENT, "rig: force is no array of numbers: give a list"),
        (None, DISPLACEMENT, r"rig: force has shape \(\): give 8 points"),
        ([[1.0], [1.0, 2.0]], DISPLACEMENT, "rig: force is no array of numbers: give a list"),
        (np.zeros(13), DISPLACEMENT, r"rig: force is constant \(0\): no loop to fit"),
        (FORCE, np.full(13, 0.3), r"rig: displacement is constant \(0.3\): no loop to fit"),
        (
            np.where(np.isin(TIME, (4, 6)), -np.inf, FORCE),
            DISPLACEMENT,
            r"rig: force is infinite or above 1e\+100 at 2 of 13 points \(first at point 5\)",
        ),
        (FORCE, np.where(TIME == 2, 1e150, DISPLACEMENT), "rig: displacement is infinite or above"),
        (NAN, DISPLACEMENT, "rig: 7 of 13 rows lack a number for force or displacement: record"),
        (NAN[1:], DISPLACEMENT[1:], "rig: 6 rows are left without the 6 that lack a number: give"),
    ],
)
def test_bad_arrays_are_refused(force, displacement, told):
    with pytest.raises(InputError, match=told):
        make_loop(force, displacement, "rig")
