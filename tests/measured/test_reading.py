"""Files of recordings: what a lab writes is read, and what is wrong is told in one line.

The loops here are ellipses of a few points, told apart by their ranges.
"""

import io
import os
import pickle
import sys
import zipfile

import hostile
import hypothesis
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat

from jbeamshell.common.errors import InputError
from jbeamshell.measured import array_tables, laboratory
from jbeamshell.measured.loop_files import read_loops
from jbeamshell.measured.loops import make_loop
from tests import rig

PHASE = np.linspace(0.0, 2.0 * np.pi, 13)
FORCE, DISPLACEMENT = 3.0 * np.cos(PHASE), 0.25 * np.cos(PHASE - 0.3)
TIME = np.arange(13.0)
BOTH = {"force": FORCE, "displacement": DISPLACEMENT}
PAIRS = np.column_stack([FORCE, DISPLACEMENT])
ROWS = [[repr(float(f)), repr(float(u))] for f, u in zip(FORCE, DISPLACEMENT, strict=True)]
HEADER = ["force", "displacement"]


def text(header=HEADER, rows=ROWS, delimiter=","):
    return "\n".join(delimiter.join(row) for row in [header, *rows]) + "\n"


@pytest.fixture
def read(tmp_path):
    def read(content, **options):
        path = tmp_path / "data.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_loops(path, **options)

    return read


def columns(loops):
    (loop,) = loops
    return loop.force, loop.displacement


def told_of(ask):
    """The one line of a refusal."""
    with pytest.raises(InputError) as caught:
        ask()
    assert len(str(caught.value).splitlines()) == 1
    assert len(str(caught.value)) < 500
    return str(caught.value)


# --- tables: dialects ---------------------------------------------------------------------------

TABLES = {
    "encoding": st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]),
    "end": st.sampled_from(["\n", "\r\n", "\r"]),
    "delimiter": st.sampled_from([",", ";", "\t"]),
    "decimal": st.sampled_from([".", ","]),
    "preamble": st.lists(
        st.sampled_from(["Größe µ, rig 3; a, b", "", "# 7; 8", "% x", "Date;12.05.2024"])
    ),
    "units": st.sampled_from(["none", "header", "row", "underscore"]),
    "further": st.sampled_from([(), ("time",), ("channel 3", "remarks"), ("normal force", "time")]),
    "order": st.randoms(use_true_random=False),
    "commented": st.booleans(),
    "ending": st.booleans(),
    "missing": st.sets(st.integers(0, 23), max_size=10),
    "seed": st.integers(0, 2**31),
}


@given(**TABLES)
def test_every_dialect_reads_back_to_the_last_bit(
    tmp_path_factory,
    encoding,
    end,
    delimiter,
    decimal,
    preamble,
    units,
    further,
    order,
    commented,
    ending,
    missing,
    seed,
):
    random = np.random.default_rng(seed)
    scale = 10.0 ** random.integers(-6, 6)
    values = dict(zip(HEADER, scale * random.standard_normal((2, 24)), strict=True))
    values |= {name: np.arange(24.0) + 0.25 for name in further}
    names = list(values)
    order.shuffle(names)

    def cell(name, row):
        if name == "force" and row in missing:
            return ["", "NaN", " - "][row % 3]
        number = "remark" if name == "remarks" else repr(float(values[name][row]))
        number = number.replace(".", decimal)
        return f'"{number}"' if decimal == delimiter or row % 7 == 0 else f" {number} "

    unit = {"force": "kN", "displacement": "µm", "time": "s", "normal force": "N"}
    style = {"header": "{} [{}]", "underscore": "{}_{}"}.get(units, "{}")
    titles = [style.format(name, unit[name]) if name in unit else name for name in names]
    lines = [delimiter.join(titles)]
    if units == "row":
        lines.append(delimiter.join(f"[{unit[name]}]" if name in unit else "" for name in names))
    for row in range(24):
        lines.append(delimiter.join(cell(name, row) for name in names))
        lines += ["", "# pause"] * (row % 11 == 0)
    lines = [line + delimiter * ending * bool(line.strip(" #pause")) for line in lines]
    if commented:  # as NumPy's savetxt does it
        preamble = [f"# {line}" for line in preamble]
        lines[0] = "# " + lines[0]
    path = tmp_path_factory.getbasetemp() / "dialect.txt"
    path.write_bytes(end.join([*preamble, *lines, ""]).encode(encoding))
    (got,) = read_loops(path, decimal=decimal if random.random() < 0.5 else None)
    kept = np.array([row not in missing for row in range(24)])
    newtons, metres = (1.0, 1.0) if units == "none" else (1e3, 1e-6)
    np.testing.assert_allclose(got.force, newtons * values["force"][kept], rtol=1e-15)
    np.testing.assert_allclose(got.displacement, metres * values["displacement"][kept], rtol=1e-15)
    assert got.dropped == len(missing)
    assert (got.time is not None) == ("time" in further)
    if got.time is not None:
        np.testing.assert_allclose(got.time, values["time"][kept], rtol=1e-15)


TITLES = [
    ("time_s", "tangential_force_N", "displacement_m", "normal_force_N"),
    ("t", "Load cell A", "LVDT displacement", "load step"),
    ("t", "Load (N)", "Stroke (mm)", "Preload (N)"),
    ("t", "Ft", "ux", "FN"),
    ("t", "Tangential force [N]", "Slip [mm]", "Clamping force [N]"),
    ("t", "Force", "Extension", "Load rate"),
    ("Zeit [s]", "Prüfkraft [kN]", "Kolbenweg [mm]", "Vorspannkraft [kN]"),
    ("Zeit [s]", "Kraft [kN]", "Verschiebung [mm]", "Normalkraft [kN]"),
    ("Temps [s]", "Effort [kN]", "Déplacement [mm]", "Effort de serrage [kN]"),
    ("temps [s]", "charge [kN]", "Course [mm]", "Charge normale [kN]"),
    ("Tempo [s]", "Forza [kN]", "Spostamento [mm]", "Forza di serraggio [kN]"),
]
ABOVE = "Prüfstand 3, 12.05.2024\n\nProbe: A-17; Bediener: N. N.\nAnzahl\t3\n"


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_titles_in_four_languages_and_columns_that_are_no_loads(read, delimiter):
    rows = [[repr(0.01 * i), *row, "7"] for i, row in enumerate(ROWS)]
    for titles in TITLES:
        got = columns(read(ABOVE + text(titles, rows, delimiter)))
        sizes = 1e3 if "kN" in titles[1] else 1.0, 1e-3 if "mm" in titles[2] else 1.0
        np.testing.assert_allclose(got, [sizes[0] * FORCE, sizes[1] * DISPLACEMENT], rtol=1e-15)
    (got,) = read(ABOVE + text(titles, rows, delimiter))
    assert got.rate == pytest.approx(100.0)
    assert got.mean_normal_force() == pytest.approx(7e3)
    blanks = text(("t", "Load (kN)", "Stroke (mm)", "Fn (kN)"), rows, "   ")
    np.testing.assert_allclose(columns(read(ABOVE + blanks))[0], 1e3 * FORCE)
    cycles = "Lastwechsel;Zyklus Last;Kraft [kN];Weg [mm]\n" + "1;2;3;4\n" * 9
    assert "force is constant" in told_of(lambda: read(cycles))  # counts and rates are no columns


def test_commas_that_another_number_proves_decimal_or_that_are_asked_about(read):
    proven = [(["1,234", "0,5"], 1.234), (["12,5", "1,234"], 12.5), (["-1,5E+02", "1"], -150.0)]
    for cells, value in proven:
        rows = [cells] + [[f.replace(".", ","), u.replace(".", ",")] for f, u in ROWS]
        assert columns(read(text(rows=rows, delimiter=";")))[0][0] == value
    table = text(rows=[[f"{i},500", f"{i * i}"] for i in range(1, 14)], delimiter=";")
    said = "'1,500' may have a decimal comma or a thousands separator: give --decimal ,"
    assert said in told_of(lambda: read(table))
    assert columns(read(table, decimal=","))[0][0] == 1.5


# --- tables: units and columns ------------------------------------------------------------------

TITLED = [
    ("force [kN]", "displacement [mm]", 1e3, 1e-3),
    ("force (kN)", "displacement (um)", 1e3, 1e-6),
    ("force_kN", "displacement_mm", 1e3, 1e-3),
    ("tangential force kN", "displacement um", 1e3, 1e-6),
    ("force [N]", "displacement [µm]", 1.0, 1e-6),
    ("force [N]", "displacement [μm]", 1.0, 1e-6),
    ("force [N/m]", "displacement [m]", 1.0, 1.0),
    ("force_N/mm", "displacement_mm", 1e3, 1e-3),
    ("force [N mm^-1]", "displacement [mm]", 1e3, 1e-3),
    ("force [lbf]", "displacement [in]", 4.4482216152605, 0.0254),
    ("force []", "displacement", 1.0, 1.0),
    ("force", "displacement of the loaded end", 1.0, 1.0),
]
FACTORS = {
    "0.05mm": ("displacement", 5e-5),
    ".05 mm": ("displacement", 5e-5),
    "5e-2*mm": ("displacement", 5e-5),
    "0.05mm/V": ("displacement [V]", 5e-5),
    "0.05 mm/V": ("displacement [mV]", 5e-8),
    "mm/V": ("displacement", 1e-3),
    "mil": ("displacement", 2.54e-5),
}


def test_units_and_factors(read):
    for force, displacement, newtons, metres in TITLED:
        got = columns(read(text([force, displacement])))
        np.testing.assert_allclose(got, [newtons * FORCE, metres * DISPLACEMENT], rtol=1e-14)
    for unit, (title, factor) in FACTORS.items():
        got = columns(read(text(["force [kN]", title]), units={"displacement": unit}))
        np.testing.assert_allclose(got, [1e3 * FORCE, factor * DISPLACEMENT], rtol=1e-14)
    for unit in ("-0.05mm", "0mm", "1e999mm", "2 3 m", "0.05kg", "0.05"):
        table = text(["force [kN]", "displacement"])
        said = told_of(lambda unit=unit, table=table: read(table, units={"displacement": unit}))
        assert "is no unit of displacement: " in said
        assert "a sensor's factor goes" in said


def test_units_and_columns_by_argument(read):
    rows = [[f, "9", u] for f, u in ROWS]
    table = text(["force left [N]", "force right [N]", "gauge [m]"], rows)
    chosen = {"force": "force left", "displacement": "gauge [m]"}
    np.testing.assert_array_equal(columns(read(table, columns=chosen)), [FORCE, DISPLACEMENT])
    got = columns(read(table, columns=chosen, units={"force": "kN", "displacement": "mm"}))
    np.testing.assert_allclose(got, [1e3 * FORCE, 1e-3 * DISPLACEMENT], rtol=1e-14)


@pytest.mark.parametrize(("delimiter", "decimal"), [(",", "."), (";", ","), (" ", ".")])
def test_columns_of_a_table_without_a_header_have_numbers(read, delimiter, decimal):
    rows = [["7", *(cell.replace(".", decimal) for cell in row)] for row in ROWS]
    for above in ("", "Rig 3\n12.05.2024; A. B.\n\n", "# by hand\n"):
        content = above + text(rows[0], rows[1:], delimiter)
        got = columns(read(content, columns={"force": "2", "displacement": "3"}))
        np.testing.assert_array_equal(got, [FORCE, DISPLACEMENT])
        with pytest.raises(InputError, match=r"data.csv: has no header: .* --column force=1"):
            read(content)
        with pytest.raises(InputError, match="'column 1', 'column 2', 'column 3': choose one"):
            read(content, columns={"force": "2", "displacement": "4"})


def test_forces_per_width_are_totals_of_a_width(tmp_path):
    (tmp_path / "data.csv").write_text(text(["force [N/mm]", "displacement [mm]"]))
    (recording,) = read_loops(tmp_path / "data.csv")
    whole = recording.of_width(0.05)
    np.testing.assert_array_equal(whole.force, 0.05 * recording.force)
    assert "the force is per width, and is taken times the width of 0.05 m" in whole.notes


def test_several_loops_in_one_table(read):
    # Rows of the loops alternate: they need not lie together.
    rows = [
        [group, repr(scale * float(f)), u]
        for f, u in ROWS
        for group, scale in (("2.5", 1.0), ("0.5", 0.2))
    ]
    for title, mark in (("A", ""), ("loop", "\ufeff"), ("Amplitude", ""), ("amplitude [kN]", "")):
        loops = read(mark + text([title, *HEADER], [*rows, ["0.5", "", "1"]]))
        assert [loop.label for loop in loops] == [f"{title} = 2.5", f"{title} = 0.5"]
        for loop, scale in zip(loops, (1.0, 0.2), strict=True):
            np.testing.assert_allclose(loop.force, scale * FORCE, rtol=1e-14)
            np.testing.assert_array_equal(loop.displacement, DISPLACEMENT)
        assert [loop.dropped for loop in loops] == [0, 1]


# --- tables: bad ones ---------------------------------------------------------------------------


def with_cell(line, cell, column=0, header=HEADER):
    """The table with one cell replaced; the header is line 1."""
    rows = [list(row) for row in ROWS]
    rows[line - 2][column] = cell
    return text(list(header), rows)


GROUPED = [["1", f, u] for f, u in ROWS]
BAD = {
    "empty": ("", "data.csv: is empty: give a header and rows"),
    "blank": ("\n  \n# nothing\n", "data.csv: is empty: give a header and rows"),
    "header only": (text(rows=[]), "data.csv: holds a header only: give"),
    "header of several": (text(["A", *HEADER], []), "holds a header only: give"),
    "header and units": (text(rows=[["N", "m"]]), "holds a header only: give"),
    "no displacement": (
        text(["force", "travel"]),
        "data.csv: needs one column named 'displacement' in line 1, "
        "which holds 'force', 'travel': name it there",
    ),
    "no header": (
        text(ROWS[0], ROWS[1:]),
        "data.csv: has no header: say which columns hold what, by their numbers, such as "
        "--column force=1 --column displacement=2 --unit force=N --unit displacement=m ",
    ),
    "two forces": (
        text(["force left", "force right", "displacement"], [[f, f, u] for f, u in ROWS]),
        "which holds 'force left', 'force right', 'displacement': choose among 'force left', "
        "'force right' by --column force='force left' (in Python columns={'force': 'force left'})",
    ),
    "two forces in line 5": (
        "rig 7\n\n# by hand\n\n"
        + text(["force left", "force right", "displacement"], [[f, f, u] for f, u in ROWS]),
        "data.csv: needs one column named 'force' in line 5, which holds 'force left', ",
    ),
    "normal force only": (text(["normal_force", "displacement"]), "one column named 'force'"),
    "one column": (text(["force"], [[f] for f, _ in ROWS]), "one column named 'displacement'"),
    "bars between columns": (
        text(delimiter="|"),
        "data.csv: has one column only in line 1: separate columns by commas, semicolons, tabs ",
    ),
    "infinite": (with_cell(4, "1e999", 1), "line 4, column 'displacement' holds '1e999': give a"),
    "text": (with_cell(5, "off"), "data.csv: line 5, column 'force' holds 'off': give a finite"),
    "underscores": (with_cell(5, "1_0"), "line 5, column 'force' holds '1_0': give a finite"),
    "a date": (with_cell(5, "12.05.24"), "line 5, column 'force' holds '12.05.24': write all num"),
    "thousands": (
        with_cell(5, '"1,234.5"'),
        "line 5, column 'force' holds '1,234.5': write all numbers with one decimal mark and with",
    ),
    "two decimal marks": (
        with_cell(5, "1,5").replace(",", ";").replace("1;5", "1,5"),
        "line 5, column 'force' holds '1,5': write all numbers with one decimal mark",
    ),
    "decimal commas between commas": (
        text().replace(".", ","),
        "line 2 has 4 cells, the header 2: if its commas are decimal, separate columns by semicol",
    ),
    "long row": (
        text(rows=[*ROWS, ["1", "2", "3"]], delimiter=";"),
        "data.csv: line 15 has 3 cells, the header 2: give every row as many cells as there are",
    ),
    "quotes": (
        with_cell(3, '"1.0'),
        "data.csv: line 3 is no row of a table: close the quotes in it",
    ),
    "after comments": (
        "# made by hand\n\n" + with_cell(3, "x"),
        "data.csv: line 5, column 'force' holds 'x'",
    ),
    "mostly missing": (
        text(rows=[[f, ""] for f, _ in ROWS[:8]] + ROWS[:7]),
        "data.csv: 8 of 15 rows lack a number for force or displacement: record or export them",
    ),
    "row of one unit": (
        text(rows=[["kN", ""], *ROWS]),
        "line 2, column 'force' holds 'kN': if it is a row of units, put them into the header: "
        "'force [kN]'",
    ),
    "units twice": (
        text(["force [N]", "displacement [m]"], [["kN", "m"], *ROWS]),
        "column 'force [N]' has the unit 'kN' in the row below the header: keep one of",
    ),
    "one unit": (
        text(["force [kN]", "displacement"]),
        "data.csv: column 'displacement' names no unit but the other one does: "
        "write 'displacement [m]'",
    ),
    "other unit": (
        text(["force", "displacement_mm"]),
        "data.csv: column 'force' names no unit but the other one does: write 'force [N]'",
    ),
    "length for a force": (
        text(["force [mm]", "displacement [mm]"]),
        "data.csv: column 'force [mm]': 'mm' is no unit of force: write one in brackets, such as "
        "'force [N]'",
    ),
    "row of wrong units": (text(rows=[["kg", "mm"], *ROWS]), "'force': 'kg' is no unit of force"),
    "angle for a length": (
        text(["force [N]", "displacement [rad]"]),
        "column 'displacement [rad]': 'rad' is no unit of displacement",
    ),
    "strain for a length": (text(["force_N", "displacement_%"]), "'%' is no unit of displacement"),
    "unknown unit": (text(["force [zonk]", "displacement [m]"]), "'zonk' is no unit of force"),
    "no word for a unit": (text(["force [N*]", "displacement [m]"]), "'N*' is no unit of force"),
    "code for a unit": (text(["force [N**9**9]", "displacement [m]"]), "is no unit of force"),
    "overflow by units": (
        with_cell(4, "1e307", header=["force [kN]", "displacement [m]"]),
        "data.csv: force is infinite or above 1e+100 at 1 of 13 points (first at point 3)",
    ),
    "constant force": (
        text(rows=[["2.5", u] for _, u in ROWS]),
        "data.csv: force is constant (2.5): no loop to fit",
    ),
    "constant displacement": (
        text(rows=[[f, "0"] for f, _ in ROWS]),
        "data.csv: displacement is constant (0): no loop to fit",
    ),
    "few points": (text(rows=ROWS[:7]), "data.csv: force has shape (7,): give 8 points or more"),
    "few points of one loop": (
        text(["A", *HEADER], [*GROUPED, ["0.5", "1", "2"]]),
        "data.csv: A = 0.5: force has shape (1,): give 8 points or more",
    ),
    "no number for a loop": (
        text(["loop", *HEADER], [["first", *row] for row in ROWS]),
        "data.csv: line 2, column 'loop' holds 'first': give a finite number",
    ),
    "nan for a loop": (
        text(["A", *HEADER], [*GROUPED, ["nan", "1", "2"]]),
        "data.csv: line 15, column 'A' holds no number: every row needs one",
    ),
    "binary": (bytes(range(256)), "data.csv: is not text in UTF-8 or Latin-1: save it as a CSV"),
    "picture": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\2\x80", "is not text in UTF-8 or Latin-1"),
    "spreadsheet": (b"PK\x03\x04\x14\0\x06\0\x08\0\0\0!\0", "is not text in UTF-8 or Latin-1"),
    "zeros": (b"\0" * 100, "data.csv: is not text in UTF-8 or Latin-1"),
    "prose": (
        "The force moved the slip. It was good.\nSo it was.\n" * 9,
        "which holds 'The force moved the",
    ),
    "endless line": (b"force,displacement\n" + b"1" * 200_000, "line 2, column 'force' holds '11"),
    "endless cell": (b'force,displacement\n"' + b"1" * 200_000 + b'"', "line 2 is no row of a"),
}


def test_bad_tables_are_refused(read):
    for content, told in BAD.values():
        message = told_of(lambda content=content: read(content))
        assert told in message
        assert "data.csv" in message


OPTIONS = [
    ({"decimal": ";"}, "decimal = ';': give ',' or '.'"),
    ({"columns": {"load": "force"}}, "columns: 'load' is no quantity: choose among"),
    (
        {"columns": {"force": "kraft"}},
        "data.csv: columns has 'force': 'kraft', but the table holds 'force', 'displacement': "
        "choose one of these",
    ),
    ({"columns": {"force": "displacement"}}, "'displacement' cannot be both force and displ"),
    ({"units": {"weight": "N"}}, "units: 'weight' is no quantity: choose among"),
    ({"units": {"force": "N"}}, "'displacement' names no unit but the other one does"),
    ({"units": {"force": "m", "displacement": "m"}}, "'m' is no unit of force"),
]


def test_bad_options_and_files_that_cannot_be_read_are_refused(read, tmp_path):
    for options, told in OPTIONS:
        assert told in told_of(lambda options=options: read(text(), **options))
    for name, reason in (
        ("no.csv", "No such file"),
        (".", "Is a directory"),
        ("no.mat", "No such"),
    ):
        with pytest.raises(InputError, match=rf"{tmp_path}.*: cannot be read \({reason}"):
            read_loops(tmp_path / name)
    os.mkfifo(tmp_path / "pipe.csv")  # and does not block
    with pytest.raises(InputError, match="is no regular file"):
        read_loops(tmp_path / "pipe.csv")
    for header in ("force" + "[" * 20_000 + ",displacement", ",".join(["force"] * 10**6)):
        (tmp_path / "endless.csv").write_text(f"{header}\n1,2\n2,1\n1,2\n")
        with pytest.raises(InputError, match=r"endless\.csv: "):
            read_loops(tmp_path / "endless.csv")


TOKENS = [*",;\t\n\n\r\"'.#%[]()_-+ 0159", "1.5", "1,5", "1e9", "nan", "inf", "force", "load"]
TOKENS += ["displacement", "slip", "A", "loop", "time", "mm", "kN", "[N]", "µ", "\ufeff", "N/mm"]
ANYTHING = st.one_of(
    st.binary(max_size=300),
    st.text(max_size=200).map(str.encode),
    st.lists(st.sampled_from(TOKENS), max_size=60).map("".join).map(str.encode),
    # A good table with some of it replaced.
    st.tuples(st.integers(0, 500), st.integers(0, 9), st.sampled_from([*TOKENS, "\0"])).map(
        lambda cut: (text()[: cut[0]] + cut[2] + text()[cut[0] + cut[1] :]).encode()
    ),
)


@hypothesis.settings(max_examples=30)
@given(content=ANYTHING, decimal=st.sampled_from([None, ".", ","]))
def test_anything_gives_finite_recordings_or_one_clear_line(tmp_path_factory, content, decimal):
    path = tmp_path_factory.getbasetemp() / "anything.csv"
    path.write_bytes(content)
    try:
        found, refused = read_loops(path, decimal=decimal), "anything.csv"
    except InputError as error:
        found, refused = [], str(error)
    assert "anything.csv" in refused
    assert len(refused.splitlines()) == 1
    assert len(refused) < 500
    for recording in found:
        assert recording.force.shape == recording.displacement.shape
        assert np.all(np.isfinite([recording.force, recording.displacement]))
        assert recording.force.size + recording.dropped <= len(content)


# --- arrays of NumPy and MATLAB -----------------------------------------------------------------


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


WITH_UNITS = {"force_kN": 1e-3 * FORCE, "displacement_mm": 1e3 * DISPLACEMENT}
FILES = {
    "units.mat": WITH_UNITS,
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
    "lying matrix.npz": ({"data": PAIRS.T}, "data row 1", "data row 2"),
    "matrix.npy": (PAIRS, "column 1", "column 2"),
    "two tests.mat": ({"tests": TWO}, "tests(2).force", "tests(1).displacement"),
}


def test_files_of_named_vectors(tmp_path):
    for name, variables in FILES.items():
        (got,) = read_loops(written(tmp_path / name, variables))
        scale = 8.0 if "integers" in name else 1.0
        close = 1e-6 if "single" in name else 0.5 if "integers" in name else 1e-14
        np.testing.assert_allclose(got.force, scale * FORCE, rtol=close, atol=close)
        np.testing.assert_allclose(got.displacement, DISPLACEMENT, rtol=1e-6, atol=1e-8)
        assert got.label == name


def test_columns_of_matrices_are_chosen(tmp_path):
    for name, (variables, force, displacement) in CHOSEN.items():
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


def npy(array):
    file = io.BytesIO()
    np.save(file, array, allow_pickle=True)
    return file.getvalue()


def npz(compression=zipfile.ZIP_STORED, **members):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return file.getvalue()


def mat(**columns):
    file = io.BytesIO()
    savemat(file, columns, do_compression=True)
    return file.getvalue()


MANY = 2_000_000  # numbers in a file that is small until it is unpacked


def files_without_a_loop(evil):
    """Content and words of the refusal, by name; what is pickled in some would make a file."""
    good = {"force": npy(FORCE), "displacement": npy(DISPLACEMENT)}
    objects, other = npy(np.array([hostile.Evil(evil)] * 9, dtype=object)), good["displacement"]
    shape = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
    endless = b"\x93NUMPY\x01\x00v\x00" + shape.ljust(117) + b"\n"
    lost = "is no .npz file of numbers ("
    return {
        "pickle.csv": (pickle.dumps(hostile.Evil(evil), 0), ""),
        "archive.csv": (npz(**good), "is not text in UTF-8 or Latin-1"),
        "text.npy": (b"force,displacement\n", "is no .npy file of numbers (ValueError: "),
        "objects.npy": (objects, "is no .npy file of numbers (ValueError: Object arrays cannot be"),
        "pickle.npy": (pickle.dumps(hostile.Evil(evil)), "is no .npy file of numbers ("),
        "endless.npy": (endless, ""),
        "solid.npy": (npy(np.zeros((9, 9, 9))), ""),
        "text.npz": (b"force,displacement\n", "is no .npz file of numbers (BadZipFile: "),
        "other.npz": (npz(force=b"force,displacement\n"), f"{lost}ValueError: "),
        "cut.npz": (npz(**good)[:300], lost),
        "objects.npz": (npz(force=objects, displacement=objects), ""),
        "half objects.npz": (npz(force=good["force"], displacement=objects), ""),
        "pickle.npz": (pickle.dumps(hostile.Evil(evil)), lost),
        "endless.npz": (npz(force=endless, displacement=endless), ""),
        "bomb.npz": (npz(zipfile.ZIP_DEFLATED, force=npy(np.zeros(MANY)), displacement=other), ""),
        "complex.npz": (npz(force=npy(1j * TIME), displacement=other), ""),
        "truths.npz": (npz(force=npy(TIME > 9.0), displacement=other), ""),
        "words.npz": (npz(force=npy(np.array(["a"] * 13)), displacement=other), ""),
        "text.mat": (b"force,displacement\n1,2\n", "is no .mat file of numbers"),
        "pickle.mat": (pickle.dumps(hostile.Evil(evil)), "is no .mat file of numbers"),
        "new.mat": (
            b"MATLAB 7.3".ljust(512) + b"\x89HDF\r\n\x1a\n",
            "is no .mat file of numbers (OSError: ",
        ),
        "bomb.mat": (mat(force=np.zeros(MANY), displacement=DISPLACEMENT), ""),
        "cut.mat": (mat(**BOTH)[:-30], ""),
    }


def test_files_that_hold_no_loop_are_refused_and_execute_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(array_tables, "LARGEST", 8 * MANY - 1)
    evil = tmp_path / "evil"
    for name, (content, told) in files_without_a_loop(evil).items():
        (tmp_path / name).write_bytes(content)
        message = told_of(lambda name=name: read_loops(tmp_path / name))
        assert message.startswith(name)
        assert told in message
    assert not evil.exists()


def test_a_byte_that_kills_scipys_reader_does_not_kill_the_process(tmp_path):
    path = tmp_path / "damaged.mat"
    savemat(path, BOTH)
    content = bytearray(path.read_bytes())
    content[184] = 0xD4  # a type that is none
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"damaged\.mat: .*it is damaged"):
        read_loops(path)


VARIABLES = [
    ({"note": "rig"}, "a.npz: holds no columns of numbers: give named vectors"),
    (BOTH | {"force": FORCE[:-1]}, "'force' has 12 values, 'displacement' 13: give columns of"),
    (WITH_UNITS | {"force_kN": 0 * FORCE}, "a.npz: force is constant (0): no loop to fit"),
    ({"force_mm": FORCE, "displacement_mm": FORCE}, "'mm' is no unit of force"),
]


def test_variables_that_make_no_recording(tmp_path):
    for variables, told in VARIABLES:
        path = written(tmp_path / "a.npz", variables)
        assert told in told_of(lambda path=path: read_loops(path))


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


NAN = np.where(TIME < 7, np.nan, FORCE)


NO_PAIRS = [
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
]


def test_arrays_of_any_kind_and_bad_ones():
    got = make_loop(list(FORCE[:8]), tuple(DISPLACEMENT[:8]), "rig")
    np.testing.assert_array_equal(got.force, FORCE[:8])
    assert (got.label, got.time, got.dropped, got.notes) == ("rig", None, 0, ())
    assert (got.cycles, got.noise, got.standard_error) == (1, None, None)
    for force, displacement, told in NO_PAIRS:
        with pytest.raises(InputError, match=told):
            make_loop(force, displacement, "rig")


# --- laboratory software ------------------------------------------------------------------------

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


LIBRARIES = (("a.h5", "h5py", "h5py"), ("a.tdms", "nptdms", "npTDMS"), ("a.uff", "pyuff", "pyuff"))


def test_broken_files_and_libraries_that_are_missing_are_told(tmp_path, monkeypatch):
    for name, module, package in LIBRARIES:
        for content in (b"", b"nothing of that kind\n" * 99, bytes(range(256)) * 4):
            (tmp_path / name).write_bytes(content)
            assert told_of(lambda name=name: read_loops(tmp_path / name)).startswith(f"{name}: ")
        (tmp_path / name).write_bytes(b"\x89HDF\r\n\x1a\n")
        with monkeypatch.context() as patch:
            patch.setitem(sys.modules, module, None)
            assert told_of(lambda name=name: read_loops(tmp_path / name)) == (
                f"{name}: needs {package}, which is not installed: pip install {package}, or "
                "'jbeamshell[formats]'"
            )


def test_a_matrix_of_matlab_has_its_own_rows_and_columns():
    h5py, file = pytest.importorskip("h5py"), io.BytesIO()
    with h5py.File(file, "w") as written:  # MATLAB writes column by column
        written["rig"] = np.arange(6.0).reshape(2, 3)
        written["rig"].attrs["MATLAB_class"] = np.bytes_("double")
    ((name, array),) = laboratory.hdf5(file.getvalue())
    assert name == "rig"
    assert array.tolist() == [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]]
