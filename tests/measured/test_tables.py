"""Tables of text: whatever dialect a lab writes is read, and what is wrong is told in one line.

The loops here are ellipses of a few points, told apart by their ranges.
"""

import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jbeamshell.common.errors import InputError
from jbeamshell.measured.loop_files import read_loops

PHASE = np.linspace(0.0, 2.0 * np.pi, 13)
FORCE, DISPLACEMENT = 3.0 * np.cos(PHASE), 0.25 * np.cos(PHASE - 0.3)
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


# --- dialects -----------------------------------------------------------------------------------

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


def test_a_measured_style_header(read):
    rows = [["0.5", u, f, "-800"] for f, u in ROWS]
    header = ["time_s", "displacement_m", "tangential_force_N", "normal_force_N"]
    np.testing.assert_array_equal(columns(read(text(header, rows))), [FORCE, DISPLACEMENT])


@pytest.mark.parametrize(
    "titles",
    [
        ("Load cell A", "LVDT displacement", "load step"),
        ("Load (N)", "Stroke (mm)", "Preload (N)"),
        ("Ft", "ux", "FN"),
        ("Tangential force [N]", "Slip [mm]", "Clamping force [N]"),
        ("Force", "Extension", "Load rate"),
    ],
)
def test_titles_by_other_words_and_columns_that_are_no_loads(read, titles):
    unit = 1.0 if "mm" not in titles[1] else 1e-3
    got = columns(read(text(titles, [[*row, "7"] for row in ROWS])))
    np.testing.assert_allclose(got, [FORCE, unit * DISPLACEMENT], rtol=1e-15)


@pytest.mark.parametrize(
    ("cells", "value"),
    [(["1,234", "0,5"], 1.234), (["12,5", "1,234"], 12.5), (["-1,5E+02", "1"], -150.0)],
)
def test_commas_that_another_number_proves_decimal(read, cells, value):
    rows = [cells] + [[f.replace(".", ","), u.replace(".", ",")] for f, u in ROWS]
    assert columns(read(text(rows=rows, delimiter=";")))[0][0] == value


def test_commas_that_may_be_thousands_are_asked_about(read):
    table = text(rows=[[f"{i},500", f"{i * i}"] for i in range(1, 14)], delimiter=";")
    with pytest.raises(
        InputError,
        match="'1,500' may have a decimal comma or a thousands separator: give --decimal ,",
    ):
        read(table)
    assert columns(read(table, decimal=","))[0][0] == 1.5


# --- units --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("force", "displacement", "newtons", "metres"),
    [
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
    ],
)
def test_units_in_the_header(read, force, displacement, newtons, metres):
    got = columns(read(text([force, displacement])))
    np.testing.assert_allclose(got[0], newtons * FORCE, rtol=1e-14)
    np.testing.assert_allclose(got[1], metres * DISPLACEMENT, rtol=1e-14)


def test_units_and_columns_by_argument(read):
    rows = [[f, "9", u] for f, u in ROWS]
    table = text(["force left [N]", "force right [N]", "gauge [m]"], rows)
    chosen = {"force": "force left", "displacement": "gauge [m]"}
    np.testing.assert_array_equal(columns(read(table, columns=chosen)), [FORCE, DISPLACEMENT])
    got = columns(read(table, columns=chosen, units={"force": "kN", "displacement": "mm"}))
    np.testing.assert_allclose(got, [1e3 * FORCE, 1e-3 * DISPLACEMENT], rtol=1e-14)


FACTORS = {
    "0.05mm": ("displacement", 5e-5),
    ".05 mm": ("displacement", 5e-5),
    "5e-2*mm": ("displacement", 5e-5),
    "0.05mm/V": ("displacement [V]", 5e-5),
    "0.05 mm/V": ("displacement [mV]", 5e-8),
    "mm/V": ("displacement", 1e-3),
    "mil": ("displacement", 2.54e-5),
}


@pytest.mark.parametrize("unit", FACTORS)
def test_a_sensors_factor_goes_before_its_unit(read, unit):
    title, factor = FACTORS[unit]
    got = columns(read(text(["force [kN]", title]), units={"displacement": unit}))
    np.testing.assert_allclose(got, [1e3 * FORCE, factor * DISPLACEMENT], rtol=1e-14)


@pytest.mark.parametrize("unit", ["-0.05mm", "0mm", "1e999mm", "2 3 m", "0.05kg", "0.05"])
def test_what_is_no_factor_is_refused(read, unit):
    with pytest.raises(InputError, match=r"is no unit of displacement: .* a sensor's factor goes"):
        read(text(["force [kN]", "displacement"]), units={"displacement": unit})


@pytest.mark.parametrize(
    ("delimiter", "decimal"), [(",", "."), (";", ","), ("\t", ","), (" ", ".")]
)
@pytest.mark.parametrize("above", ["", "Rig 3\n12.05.2024; A. B.\n\n", "# by hand\n"])
def test_columns_of_a_table_without_a_header_have_numbers(read, delimiter, decimal, above):
    rows = [["7", *(cell.replace(".", decimal) for cell in row)] for row in ROWS]
    content = above + text(rows[0], rows[1:], delimiter)
    got = columns(read(content, columns={"force": "2", "displacement": "3"}))
    np.testing.assert_array_equal(got, [FORCE, DISPLACEMENT])
    with pytest.raises(InputError, match=r"data.csv: has no header: .* --column force=1"):
        read(content)
    with pytest.raises(InputError, match="'column 1', 'column 2', 'column 3': choose one"):
        read(content, columns={"force": "2", "displacement": "4"})


def test_forces_per_width_are_not_divided_again(tmp_path):
    (tmp_path / "data.csv").write_text(text(["force [N/mm]", "displacement [mm]"]))
    (recording,) = read_loops(tmp_path / "data.csv")
    again = recording.per_width(0.05)
    np.testing.assert_array_equal(again.force, recording.force)
    assert "the force is per width already, so the width does not divide it" in again.notes


# --- several loops ------------------------------------------------------------------------------


@pytest.mark.parametrize("title", ["A", "loop", "Amplitude", "amplitude [kN]"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_several_loops_in_one_table(read, title, mark):
    # Rows of the loops alternate: they need not lie together.
    rows = [
        [group, repr(scale * float(f)), u]
        for f, u in ROWS
        for group, scale in (("2.5", 1.0), ("0.5", 0.2))
    ]
    loops = read(mark + text([title, *HEADER], [*rows, ["0.5", "", "1"]]))
    assert [loop.label for loop in loops] == [f"{title} = 2.5", f"{title} = 0.5"]
    for loop, scale in zip(loops, (1.0, 0.2), strict=True):
        np.testing.assert_allclose(loop.force, scale * FORCE, rtol=1e-14)
        np.testing.assert_array_equal(loop.displacement, DISPLACEMENT)
    assert [loop.dropped for loop in loops] == [0, 1]


# --- bad tables ---------------------------------------------------------------------------------


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


@pytest.mark.parametrize("case", BAD)
def test_bad_tables_are_refused(read, case):
    content, told = BAD[case]
    with pytest.raises(InputError) as caught:
        read(content)
    message = str(caught.value)
    assert told in message
    assert "data.csv" in message
    assert "\n" not in message
    assert len(message) < 400


@pytest.mark.parametrize(
    ("options", "told"),
    [
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
    ],
)
def test_bad_options_are_refused(read, options, told):
    with pytest.raises(InputError) as caught:
        read(text(), **options)
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("name", "reason"),
    [("missing.csv", "No such file"), (".", "Is a directory"), ("missing.mat", "No such file")],
)
def test_files_that_cannot_be_read(tmp_path, name, reason):
    with pytest.raises(InputError, match=rf"{tmp_path}.*: cannot be read \({reason}"):
        read_loops(tmp_path / name)


def test_a_pipe_is_refused_and_does_not_block(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(InputError, match="is no regular file"):
        read_loops(tmp_path / "pipe.csv")


@pytest.mark.parametrize(
    "header", ["force" + "[" * 20_000 + ",displacement", ",".join(["force"] * 10**6)]
)
def test_endless_headers_are_refused_in_no_time(tmp_path, header):
    (tmp_path / "endless.csv").write_text(f"{header}\n1,2\n2,1\n1,2\n")
    with pytest.raises(InputError, match=r"endless\.csv: "):
        read_loops(tmp_path / "endless.csv")


# --- anything -----------------------------------------------------------------------------------

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
