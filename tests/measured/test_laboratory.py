"""Files of laboratory software give the columns and units that were written into them."""

import io
import sys

import numpy as np
import pytest

from jbeamshell.common.errors import InputError
from jbeamshell.measured import laboratory
from jbeamshell.measured.loop_files import read_loops
from tests import rig

U = rig.path(2, 40)
COLUMNS = {"force": rig.iwan(U), "displacement": 0.02 * U}  # kN and mm
UNITS = {"force": "kN", "displacement": "mm"}
STEP = 0.01


def hdf5(path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name, column in COLUMNS.items():
            own = file.create_dataset(f"rig/{name}", data=column)
            own.attrs["unit"] = UNITS[name]
        file["rig/time [s]"] = STEP * np.arange(U.size)
        file["operator"] = "somebody"


def matlab(path):
    """File as MATLAB writes its version 7.3: a struct is a group, columns are rows."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, column in COLUMNS.items():
            own = file.create_dataset(f"rig/{name}_{UNITS[name]}", data=column[None, :])
            own.attrs["MATLAB_class"] = np.bytes_(b"double")
        note = file.create_dataset("rig/note", data=np.zeros((9, 1), np.uint16))
        note.attrs["MATLAB_class"] = np.bytes_(b"char")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")


def tdms(path):
    nptdms = pytest.importorskip("nptdms")
    timing = {"wf_increment": STEP, "wf_start_offset": 0.0}
    channels = [
        nptdms.ChannelObject("rig", name, column, {"unit_string": UNITS[name], **timing})
        for name, column in COLUMNS.items()
    ]
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(channels)


def universal(path, binary=0):
    pyuff = pytest.importorskip("pyuff")
    sizes = {"force": 1e3, "displacement": 1e-3}
    for place, (name, column) in enumerate(COLUMNS.items()):
        made = {
            **dict.fromkeys(
                ("ver_num", "load_case_id", "orddenom_spec_data_type", "z_axis_spec_data_type"), 0
            ),
            **dict.fromkeys(("rsp_node", "rsp_dir", "ref_node", "ref_dir", "func_type"), 1),
            **dict.fromkeys(("abscissa_min", "z_axis_value"), 0.0),
            "type": 58,
            "binary": binary,
            "id1": f"channel {place}",
            "abscissa_spacing": 1,
            "abscissa_inc": STEP,
            "abscissa_spec_data_type": 17,
            "abscissa_axis_units_lab": "s",
            "ordinate_spec_data_type": {"force": 13, "displacement": 8}[name],
            "ordinate_axis_units_lab": {"force": "N", "displacement": "m"}[name],
            "data": sizes[name] * column,
            "x": STEP * np.arange(U.size),
        }
        pyuff.UFF(str(path)).write_sets([made], "add")


WRITERS = {
    "rig.h5": hdf5,
    "rig.mat": matlab,
    "rig.tdms": tdms,
    "rig.uff": universal,
    "rig.unv": lambda path: universal(path, binary=1),
}


@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")  # pyuff, where it writes
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("name", WRITERS)
def test_columns_units_and_time_are_read(tmp_path, name):
    path = tmp_path / name
    WRITERS[name](path)
    (got,) = read_loops(path)
    assert got.units is not None
    np.testing.assert_allclose(got.force, 1e3 * COLUMNS["force"], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(got.displacement, 1e-3 * COLUMNS["displacement"], 1e-6, 1e-12)
    if name != "rig.mat":
        assert got.rate == pytest.approx(1.0 / STEP)


@pytest.mark.parametrize(
    ("name", "module", "package"),
    [("a.h5", "h5py", "h5py"), ("a.tdms", "nptdms", "npTDMS"), ("a.uff", "pyuff", "pyuff")],
)
def test_a_library_that_is_missing_is_named(tmp_path, monkeypatch, name, module, package):
    (tmp_path / name).write_bytes(b"\x89HDF\r\n\x1a\n")
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError) as caught:
        read_loops(tmp_path / name)
    assert str(caught.value) == (
        f"{name}: needs {package}, which is not installed: pip install {package}, or "
        "'jbeamshell[formats]'"
    )


@pytest.mark.parametrize("name", ["a.h5", "a.tdms", "a.uff"])
@pytest.mark.parametrize("content", [b"", b"nothing of that kind\n" * 99, bytes(range(256)) * 4])
def test_broken_files_are_refused_in_one_line(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=rf"^{name}: [^\n]+$"):
        read_loops(tmp_path / name)


LANGUAGES = {
    "English": ("Time (s)", "Load (kN)", "Stroke (mm)", "Clamp force (kN)"),
    "German": ("Zeit [s]", "Prüfkraft [kN]", "Kolbenweg [mm]", "Vorspannkraft [kN]"),
    "German, short": ("Zeit [s]", "Kraft [kN]", "Verschiebung [mm]", "Normalkraft [kN]"),
    "French": ("Temps [s]", "Effort [kN]", "Déplacement [mm]", "Effort de serrage [kN]"),
    "French, in short": ("temps [s]", "charge [kN]", "Course [mm]", "Charge normale [kN]"),
    "Italian": ("Tempo [s]", "Forza [kN]", "Spostamento [mm]", "Forza di serraggio [kN]"),
}


def table_of(titles, delimiter):
    """Table below some lines of a test rig."""
    normal = np.full(U.size, 8.0)
    table = np.column_stack([STEP * np.arange(U.size), *COLUMNS.values(), normal])
    above = ["Prüfstand 3, 12.05.2024", "", "Probe: A-17; Bediener: N. N.", "Anzahl\t3"]
    rows = (delimiter.join(map(repr, row)) for row in table.tolist())
    return "\n".join([*above, delimiter.join(titles), *rows])


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_titles_in_four_languages_below_lines_of_a_test_rig(tmp_path, language, delimiter):
    path = tmp_path / "rig.txt"
    path.write_text(table_of(LANGUAGES[language], delimiter), "utf-8")
    (got,) = read_loops(path)
    np.testing.assert_allclose(got.force, 1e3 * COLUMNS["force"])
    np.testing.assert_allclose(got.displacement, 1e-3 * COLUMNS["displacement"])
    assert got.rate == pytest.approx(1.0 / STEP)
    assert got.mean_normal_force() == pytest.approx(8e3)


def test_columns_between_blanks(tmp_path):
    path = tmp_path / "rig.txt"
    path.write_text(table_of(("t", "Load (kN)", "Stroke (mm)", "Fn (kN)"), "   "), "utf-8")
    (got,) = read_loops(path)
    np.testing.assert_allclose(got.force, 1e3 * COLUMNS["force"])
    np.testing.assert_allclose(got.displacement, 1e-3 * COLUMNS["displacement"])


def test_a_rate_or_a_count_in_any_language_is_no_column(tmp_path):
    path = tmp_path / "rig.csv"
    path.write_text("Lastwechsel;Zyklus Last;Kraft [kN];Weg [mm]\n" + "1;2;3;4\n" * 9, "utf-8")
    with pytest.raises(InputError, match="force is constant"):
        read_loops(path)


def test_a_matrix_of_matlab_has_its_own_rows_and_columns():
    h5py, file = pytest.importorskip("h5py"), io.BytesIO()
    with h5py.File(file, "w") as written:  # MATLAB writes column by column
        written["rig"] = np.arange(6.0).reshape(2, 3)
        written["rig"].attrs["MATLAB_class"] = np.bytes_("double")
    ((name, array),) = laboratory.hdf5(file.getvalue())
    assert name == "rig"
    assert array.tolist() == [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]]
