"""Tables of loops: whatever a lab writes is read in N and m, and what is wrong is told in one line.

The loops here are half ellipses of a few points, told apart by their ranges.
"""

import numpy as np
import pytest

from jbeamshell.errors import InputError
from jbeamshell.example import EXAMPLE_AMPLITUDES, HEIGHT_RATIOS, example_loops
from jbeamshell.identify import driver_of
from jbeamshell.loops import FEWEST_POINTS, Loop, make_loop, read_loops

PHASE = np.linspace(0.0, 2.0 * np.pi, 13)
FORCE, DISPLACEMENT = 3.0 * np.cos(PHASE), 0.25 * np.cos(PHASE - 0.3)
ROWS = [[repr(float(f)), repr(float(u))] for f, u in zip(FORCE, DISPLACEMENT, strict=True)]


def text(header, rows=ROWS, delimiter=","):
    return "\n".join(delimiter.join(row) for row in [header, *rows]) + "\n"


@pytest.fixture
def read(tmp_path):
    def read(content):
        path = tmp_path / "data.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_loops(path)

    return read


def columns(loops):
    assert len(loops) == 1
    return loops[0].force, loops[0].displacement


# --- dialects -----------------------------------------------------------------------------------


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_delimiters_line_ends_and_byte_order_marks(read, delimiter, end, mark):
    content = text(["force", "displacement"], delimiter=delimiter).replace("\n", end)
    force, displacement = columns(read(mark + content.encode()))
    np.testing.assert_array_equal(force, FORCE)
    np.testing.assert_array_equal(displacement, DISPLACEMENT)


def test_comments_blank_lines_quotes_and_further_columns(read):
    rows = [["7", f'"{u}"', f" {f} ", "", "remark"] for f, u in ROWS]
    body = text(["time", '"Displacement"', " FORCE ", "", "remarks"], rows).splitlines()
    lines = ["# rig 3; a, b", "", *body[:4], "   ", "# pause", " # again", *body[4:], "", ""]
    loops = read("\n".join(lines))
    np.testing.assert_array_equal(columns(loops), [FORCE, DISPLACEMENT])
    assert loops[0].label == "data.csv"


def test_a_measured_style_header(read):
    rows = [["0.5", u, f, "-800"] for f, u in ROWS]
    header = ["time_s", "displacement_m", "tangential_force_N", "normal_force_N"]
    np.testing.assert_array_equal(columns(read(text(header, rows))), [FORCE, DISPLACEMENT])


def test_a_force_driven_table_without_a_turn_in_it(read):
    loop = read(text(["force", "displacement"], ROWS[:8]))[0]
    assert not loop.closed
    assert loop.force.size == 8


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
        ("force [lbf]", "displacement [in]", 4.4482216152605, 0.0254),
        ("force []", "displacement", 1.0, 1.0),
        ("force", "displacement of the loaded end", 1.0, 1.0),
    ],
)
def test_units_in_the_header(read, force, displacement, newtons, metres):
    got = columns(read(text([force, displacement])))
    np.testing.assert_allclose(got[0], newtons * FORCE, rtol=1e-14)
    np.testing.assert_allclose(got[1], metres * DISPLACEMENT, rtol=1e-14)


# --- several loops ------------------------------------------------------------------------------


@pytest.mark.parametrize("title", ["A", "loop", "Amplitude", "amplitude [kN]"])
def test_several_loops_in_one_table(read, title):
    # Rows of the loops alternate: they need not lie together.
    rows = [
        [mark, repr(scale * float(f)), u]
        for f, u in ROWS
        for mark, scale in (("2.5", 1.0), ("0.5", 0.2))
    ]
    loops = read(text([title, "force", "displacement"], rows))
    assert [loop.label for loop in loops] == [f"{title} = 2.5", f"{title} = 0.5"]
    for loop, scale in zip(loops, (1.0, 0.2), strict=True):
        np.testing.assert_allclose(loop.force, scale * FORCE, rtol=1e-14)
        np.testing.assert_array_equal(loop.displacement, DISPLACEMENT)


def test_a_byte_order_mark_belongs_to_no_name(read):
    rows = [[mark, f, u] for mark in ("1", "2") for f, u in ROWS]
    loops = read(b"\xef\xbb\xbf" + text(["A", "force", "displacement"], rows).encode())
    assert [loop.label for loop in loops] == ["A = 1", "A = 2"]


@pytest.mark.parametrize("ratio", HEIGHT_RATIOS)
def test_the_finite_element_loops_that_ship(ratio):
    loops = example_loops(ratio)
    assert [loop.label for loop in loops] == [f"A = {a:g}" for a in EXAMPLE_AMPLITUDES]
    for loop, amplitude in zip(loops, EXAMPLE_AMPLITUDES, strict=True):
        assert loop.closed
        np.testing.assert_allclose(np.max(np.abs(loop.force)), amplitude, rtol=1e-6)
    assert len(example_loops(ratio, None)) > len(loops)


def test_example_loops_that_do_not_exist():
    with pytest.raises(InputError, match=r"height_ratio = 0\.2: choose one of \(0\.0305"):
        example_loops(0.2)
    with pytest.raises(InputError, match=r"amplitudes: there is no A = 0\.33; there are A = 0\.1,"):
        example_loops(amplitudes=(1.0, 0.33))


# --- bad tables ---------------------------------------------------------------------------------


def with_cell(line, cell, column=0, header=("force", "displacement")):
    """The table with one cell replaced; the header is line 1."""
    rows = [list(row) for row in ROWS]
    rows[line - 2][column] = cell
    return text(list(header), rows)


GROUPED = [["1", f, u] for f, u in ROWS]
BAD = {
    "empty": ("", "data.csv: is empty: give a header and rows"),
    "blank": ("\n  \n# nothing\n", "data.csv: is empty: give a header and rows"),
    "header only": (text(["force", "displacement"], []), "data.csv: holds a header only: give"),
    "header of several": (text(["A", "force", "displacement"], []), "holds a header only: give"),
    "no displacement": (
        text(["force", "travel"]),
        "data.csv: needs one column named 'displacement' in its first row, "
        "which holds 'force', 'travel': name it there",
    ),
    "no header": (
        text(ROWS[0], ROWS[1:]),
        "data.csv: needs one column named 'force' in its first row, which holds '3.0', '0.2388",
    ),
    "two forces": (
        text(["force left", "force right", "displacement"], [[f, f, u] for f, u in ROWS]),
        "which holds 'force left', 'force right', 'displacement': rename the others",
    ),
    "normal force only": (text(["normal_force", "displacement"]), "one column named 'force'"),
    "spaces between columns": (
        text(["force", "displacement"], delimiter=" "),
        "data.csv: its first row is one column: separate columns by commas, semicolons or tabs",
    ),
    "nan": (with_cell(4, "NaN"), "data.csv: line 4, column 'force' holds 'NaN': give a finite"),
    "infinite": (with_cell(4, "1e999", 1), "line 4, column 'displacement' holds '1e999': give a"),
    "text": (with_cell(5, "off"), "data.csv: line 5, column 'force' holds 'off': give a finite"),
    "empty cell": (with_cell(2, ""), "line 2, column 'force' holds '': give a finite"),
    "short row": (
        text(["force", "displacement"], [*ROWS, ["1.0"]]),
        "data.csv: line 15, column 'displacement' holds '': give a finite number",
    ),
    "after comments": (
        "# made by hand\n\n" + with_cell(3, "x"),
        "data.csv: line 5, column 'force' holds 'x'",
    ),
    "decimal commas": (
        text(["force", "displacement"], delimiter=";").replace(".", ","),
        "data.csv: line 2, column 'force' holds '3,0': give a finite number, with a decimal point",
    ),
    "row of units": (
        with_cell(2, "kN"),
        "line 2, column 'force' holds 'kN': if it is a row of units, put them into the header: "
        "'force [kN]'",
    ),
    "row of units in brackets": (with_cell(2, "[mm]", 1), "the header: 'displacement [mm]'"),
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
    "angle for a length": (
        text(["force [N]", "displacement [rad]"]),
        "column 'displacement [rad]': 'rad' is no unit of displacement",
    ),
    "strain for a length": (text(["force_N", "displacement_%"]), "'%' is no unit of displacement"),
    "unknown unit": (text(["force [zonk]", "displacement [m]"]), "'zonk' is no unit of force"),
    "no word for a unit": (text(["force [N*]", "displacement [m]"]), "'N*' is no unit of force"),
    "constant force": (
        text(["force", "displacement"], [["2.5", u] for _, u in ROWS]),
        "data.csv: force is constant (2.5): no loop to fit",
    ),
    "constant displacement": (
        text(["force", "displacement"], [[f, "0"] for f, _ in ROWS]),
        "data.csv: displacement is constant (0): no loop to fit",
    ),
    "few points": (
        text(["force", "displacement"], ROWS[:7]),
        "data.csv: force has shape (7,): give 8 points or more",
    ),
    "few points of one loop": (
        text(["A", "force", "displacement"], [*GROUPED, ["0.5", "1", "2"]]),
        "data.csv: A = 0.5: force has shape (1,): give 8 points or more",
    ),
    "no number for a loop": (
        text(["loop", "force", "displacement"], [["first", *row] for row in ROWS]),
        "data.csv: line 2, column 'loop' holds 'first': give a finite number",
    ),
    "nan for a loop": (
        text(["A", "force", "displacement"], [*GROUPED, ["nan", "1", "2"]]),
        "data.csv: line 15, column 'A' holds 'nan': give a finite number",
    ),
    "binary": (bytes(range(256)), "is not text in UTF-8: save it as a CSV table"),
    "another encoding": (
        text(["force [N]", "displacement [µm]"]).encode("latin-1"),
        "is not text in UTF-8: save it",
    ),
    "spreadsheet's own text": (text(["force", "displacement"]).encode("utf-16"), "is not text in"),
    "zeros": (b"\0" * 100, "data.csv: needs one column named 'force' in its first row"),
    "endless line": (b"force,displacement\n" + b"1" * 200_000, "data.csv: line 2 is no row of a"),
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
    ("name", "reason"), [("missing.csv", "No such file"), (".", "Is a directory")]
)
def test_files_that_cannot_be_read(tmp_path, name, reason):
    with pytest.raises(InputError, match=rf"{tmp_path}.*: cannot be read \({reason}"):
        read_loops(tmp_path / name)


# --- loops in memory ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("force", "displacement", "told"),
    [
        (FORCE[:-1], DISPLACEMENT, "rig: force and displacement differ in length: give pairs"),
        (FORCE, DISPLACEMENT[:, None], r"rig: displacement has shape \(13, 1\): give 8 points"),
        (FORCE[:7], DISPLACEMENT[:7], r"rig: force has shape \(7,\): give 8 points"),
        (1.0, 2.0, r"rig: force has shape \(\): give 8 points"),
        (np.zeros(13), DISPLACEMENT, r"rig: force is constant \(0\): no loop to fit"),
        (
            np.where(np.isin(np.arange(13), (4, 6)), np.nan, FORCE),
            DISPLACEMENT,
            r"rig: force is not finite at 2 of 13 points \(first at point 5\): remove or repair",
        ),
    ],
)
def test_bad_arrays_are_refused(force, displacement, told):
    with pytest.raises(InputError, match=told):
        make_loop(force, displacement, "rig")


def test_arrays_make_a_loop():
    assert FEWEST_POINTS == 8
    loop = make_loop(list(FORCE[:8]), tuple(DISPLACEMENT[:8]), "rig")
    np.testing.assert_array_equal(loop.force, FORCE[:8])
    assert loop.label == "rig"


def test_closed_loops_and_pulls():
    assert Loop(FORCE, DISPLACEMENT, "").closed
    assert not Loop(FORCE[:-1], DISPLACEMENT[:-1], "").closed
    drift = np.linspace(0.0, 1.0, FORCE.size)
    width = np.ptp(DISPLACEMENT)
    assert Loop(FORCE, DISPLACEMENT + 0.04 * width * drift, "").closed
    assert not Loop(FORCE, DISPLACEMENT + 0.07 * width * drift, "").closed


@pytest.mark.parametrize("driver", ["force", "displacement"])
def test_thinned_loops_keep_their_turns_and_ends(driver):
    # Turns between the points that an even spacing would take.
    phase = np.linspace(0.4, 0.4 + 2.0 * np.pi, 1001)
    loop = Loop(3.0 * np.cos(phase), 0.25 * np.cos(phase - 0.3), "rig")
    thin = loop.thinned(40, driver)
    assert 40 <= thin.force.size <= 44
    for whole, kept in zip(loop[:2], thin[:2], strict=True):
        assert (kept[0], kept[-1]) == (whole[0], whole[-1])
    whole, kept = getattr(loop, driver), getattr(thin, driver)
    assert (kept.max(), kept.min()) == (whole.max(), whole.min())
    # Pairs stay pairs, in their order, evenly along the driving column.
    where = [int(np.flatnonzero(loop.force == f)[0]) for f in thin.force]
    assert np.all(np.diff(where) > 0)
    np.testing.assert_array_equal(thin.displacement, loop.displacement[where])
    travel = np.sum(np.abs(np.diff(whole)))
    assert np.max(np.abs(np.diff(kept))) < 1.2 * travel / 39
    assert thin.label == "rig"


def test_short_loops_are_not_thinned():
    loop = Loop(FORCE, DISPLACEMENT, "rig")
    assert loop.thinned(FORCE.size, "force") is loop


def test_the_driver_is_the_smoother_column():
    random = np.random.default_rng(1)
    phase = np.linspace(0.0, 2.0 * np.pi, 200)
    force, displacement = 3.0 * np.cos(phase), 0.25 * np.cos(phase - 0.3)
    noise = 0.01 * random.standard_normal(phase.size)
    assert driver_of([Loop(force, displacement, "")]) == "force"
    assert driver_of([Loop(force, displacement + 0.5 * noise, "")]) == "force"
    assert driver_of([Loop(force + 6.0 * noise, displacement, "")]) == "displacement"
    assert driver_of(example_loops()) == "force"
