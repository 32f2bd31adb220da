"""A plan says which files, of what kind, on which specimens, and what is free."""

import numpy as np
import pytest

from jbeamshell.common.errors import InputError
from jbeamshell.identify import Specimen
from jbeamshell.identify.plan_file import plan_from_values, read_plan
from jbeamshell.measured.curve_files import read_curves
from jbeamshell.measured.curves import Backbone, DissipationCurve, SqueezeCurve, StiffnessCurve
from jbeamshell.measured.loop_files import read_loops
from jbeamshell.measured.loops import Loop
from tests import rig

PHASE = np.linspace(0.0, 2.0 * np.pi, 101)


def write(path, header, *columns):
    lines = [header, *(",".join(f"{v:.9g}" for v in row) for row in zip(*columns, strict=True))]
    path.write_text("\n".join(lines) + "\n")
    return path.name


@pytest.fixture
def folder(tmp_path):
    force, displacement = np.cos(PHASE), 1e-5 * np.cos(PHASE - 0.2)
    write(tmp_path / "loop.csv", "force,displacement", force, displacement)
    random = np.random.default_rng(0)
    cycles = np.concatenate([PHASE[:-1] + 2.0 * np.pi * i for i in range(6)])
    driven = 1e-5 * np.cos(cycles)
    write(
        tmp_path / "cycles.csv",
        "force [kN],displacement [mm]",
        1e-3 * (np.cos(cycles + 0.2) + 0.02 * random.standard_normal(cycles.size)),
        1e3 * driven,
    )
    rise = np.linspace(0.1, 1.0, 12)
    write(tmp_path / "pull.csv", "force,displacement", rise, 1e-5 * rise**2)
    write(tmp_path / "work.csv", "amplitude,dissipation,noise", rise, 1e-5 * rise**3, 1e-7 * rise)
    write(
        tmp_path / "stiff.csv", "Amplitude [kN/m];Stiffness [N/m^2]".replace(";", ","), rise, rise
    )
    write(tmp_path / "squeeze.csv", "x,stress", rise, -rise)
    return tmp_path


FREE = {"contact.friction": {}}


def test_specimens_share_what_the_plan_says_and_keep_their_own(folder):
    (folder / "plan.toml").write_text(
        """
        noise = 0.01
        starts = 2
        [set]
        "strip.length" = 3.0
        [free."contact.friction"]
        start = 0.2
        prior = [0.2, 0.05]
        [free."strip.height_ratio"]
        each = true
        low = 0.01
        high = 0.5
        [[specimen]]
        label = "thin"
        data = ["loop.csv", "pull.csv"]
        set = { "strip.height_ratio" = 0.05 }
        [[specimen]]
        data = ["cycles.csv"]
        set = { "strip.width" = 2.0 }
        """
    )
    plan = read_plan(folder / "plan.toml")
    thin, other = plan.cases
    assert (thin.label, other.label) == ("thin", "2")
    assert [case.model.get("strip.length") for case in plan.cases] == [3.0, 3.0]
    assert thin.model.get("strip.height_ratio") == 0.05
    assert [p.key for p in plan.free] == ["contact.friction", "strip.height_ratio"]
    assert plan.free[0].prior == (0.2, 0.05)
    assert plan.free[1].each
    assert (plan.options.noise, plan.options.starts) == (0.01, 2)
    assert [loop.label for loop in thin.measurements] == ["loop.csv", "pull.csv"]
    (loop,) = other.measurements  # six cycles are one, in N and m
    assert loop.cycles == 6
    assert np.max(loop.force) == pytest.approx(1.0, rel=0.03)
    assert other.model.control == "displacement"
    assert other.model.get("load.amplitude") == pytest.approx(1e-5, rel=0.01)
    assert any("mean of 6 of 6" in note for note in plan.notes)
    assert any("2: the displacement drives" in note for note in plan.notes)


@pytest.mark.parametrize(
    ("cycles", "points"), [("recorded", 600), ("steady", None), ("auto", None)]
)
def test_cycles_are_averaged_unless_told_otherwise(folder, cycles, points):
    ((loop, _),) = Specimen(data=["cycles.csv"], cycles=cycles).read(folder)
    assert loop.force.size == points if points else loop.cycles == 6


def test_recordings_at_hand_are_read_as_files_are(folder):
    (recording,) = read_loops(folder / "cycles.csv")
    ((loop, notes),) = Specimen(data=recording).read(folder)
    ((other, others),) = Specimen(data="cycles.csv").read(folder)
    np.testing.assert_array_equal(loop.force, other.force)
    assert notes == others
    with pytest.raises(InputError, match="files do not mix with other data"):
        Specimen(data=["cycles.csv", recording]).read(folder)


def test_a_clean_cycle_and_a_pull_stay_as_they_are(folder):
    for name, points in (("loop.csv", 101), ("pull.csv", 12)):
        ((loop, _),) = Specimen(data=[name]).read(folder)
        assert loop.force.size == points
    with pytest.raises(InputError, match=r"pull\.csv.*never turns back"):
        Specimen(data=["pull.csv"], cycles="steady").read(folder)


@pytest.mark.parametrize(
    ("kind", "name", "made"),
    [
        ("loop", "loop", Loop),
        ("backbone", "pull", Backbone),
        ("dissipation", "work", DissipationCurve),
        ("stiffness", "stiff", StiffnessCurve),
        ("squeeze", "squeeze", SqueezeCurve),
    ],
)
def test_every_kind_is_read(folder, kind, name, made):
    ((item, _),) = Specimen(data=[f"{name}.csv"], kind=kind).read(folder)
    assert type(item) is made


def test_curves_bring_their_noise_and_units(folder):
    ((work, notes),) = read_curves(folder / "work.csv", "dissipation")
    assert work.noise == pytest.approx(1e-7 * work.amplitude)
    assert not notes
    ((stiff, _),) = read_curves(folder / "stiff.csv", "stiffness")
    assert np.max(stiff.amplitude) == pytest.approx(1e3)
    assert np.max(stiff.stiffness) == pytest.approx(1.0)


def test_rows_without_a_number_are_dropped_and_counted(folder):
    with (folder / "work.csv").open("a") as file:
        file.write("1.5,,1e-7\n")
    ((work, notes),) = read_curves(folder / "work.csv", "dissipation")
    assert work.amplitude.size == 12
    assert notes == ("1 of 13 rows lack a number: left out",)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("amplitude,work\n1,2\n", "needs a column 'dissipation'"),
        ("amplitude [N/m],dissipation\n1,2\n", "'dissipation' names no unit but the other one"),
        ("amplitude [N/m],dissipation [K]\n1,2\n", "'K' is no unit of dissipation"),
        ("amplitude,dissipation\n1,two\n", "two"),
        ("amplitude,dissipation\n1,-2\n2,3\n3,4\n", "-2"),
    ],
)
def test_curves_that_cannot_be_read_say_why(tmp_path, text, message):
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        read_curves(tmp_path / "bad.csv", "dissipation")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"specimens": []}, "'specimens' is unknown"),
        ({"specimen": []}, r"write a table \[\[specimen\]\]"),
        ({"specimen": [{"label": "thin"}]}, "'thin': data = None: list its files"),
        ({"specimen": [{"data": "loop.csv"}]}, "data = 'loop.csv': list its files"),
        ({"specimen": [{"data": ["loop.csv"], "kind": "lop"}]}, "kind = 'lop': choose among"),
        ({"specimen": [{"data": ["loop.csv"], "set": {"strip.width": 0}}]}, "strip.width = 0"),
        ({"specimen": [{"data": ["loop.csv"], "with": 1}]}, "'with' is unknown"),
        ({"specimen": [{"data": ["none.csv"]}]}, r"none\.csv: cannot be read"),
        ({"free": {"contact.friction": {"lo": 1}}}, "'lo' is unknown"),
        ({"free": {"contact.friction": 0.1}}, "must be a table"),
        ({"free": {"contact.friction": {"each": 3}}}, "each = 3: give true or false"),
        ({"specimen": [{"data": [3]}]}, r"data = \[3\]: list its files"),
        (
            {"specimen": [{"data": ["loop.csv"], "units": {"force": 3}}]},
            r"units\.force = 3: give a word",
        ),
        ({"set": 3}, "set = 3: must be a table"),
        ({"set": {"strip.lenght": 1.0}}, r"strip\.lenght"),
        ({"scene": "standrad"}, "did you mean 'standard'"),
        ({"scene": 3}, "scene = 3: give the name"),
    ],
)
def test_a_plan_that_makes_no_sense_is_refused(folder, change, message):
    values = {"free": FREE, "specimen": [{"data": ["loop.csv"]}]} | change
    with pytest.raises(InputError, match=message):
        plan_from_values(values, folder)


@pytest.mark.parametrize("text", ["free = [", b"\xff\xfe", None])
def test_a_file_that_is_no_plan_is_refused(tmp_path, text):
    path = tmp_path / "plan.toml"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=r"plan\.toml"):
        read_plan(path)


@pytest.mark.parametrize("cycles", [1, 4])
@pytest.mark.parametrize(("driver", "off"), [("force", 0.4), ("displacement", -0.3)])
def test_an_offset_of_the_responding_sensor_is_removed_and_said(tmp_path, cycles, driver, off):
    u = rig.path(cycles, 80)
    force, along = (u, rig.iwan_by_force(u)) if driver == "force" else (rig.bouc_wen(u), u)
    columns = {"force": force, "displacement": along}
    answer = next(name for name in columns if name != driver)
    whole = {**columns, answer: columns[answer] + off * np.ptp(columns[answer])}
    for name, table in (("right", columns), ("off", whole)):
        rows = np.column_stack(list(table.values()))
        head = "force,displacement"
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header=head, comments="")
    read = {name: Specimen(data=f"{name}.csv").read(tmp_path) for name in ("right", "off")}
    for (loop, _), (moved, notes) in zip(read["right"], read["off"], strict=True):
        assert any("zeros of the sensors" in note for note in notes)
        assert moved.free_zero
        assert not loop.free_zero
        shift = getattr(moved, answer) - getattr(loop, answer)
        assert np.ptp(shift) < 1e-9 * np.ptp(columns[answer])
        assert np.max(np.abs(shift)) < 0.05 * np.ptp(columns[answer])
    (kept, _), *_ = Specimen(data="off.csv", centre=False).read(tmp_path)
    assert not kept.free_zero


def test_a_drive_that_the_data_contradict_is_said(tmp_path):
    u = rig.path(3, 80)
    rows = np.column_stack([rig.bouc_wen(u), u])
    head = "force,displacement"
    np.savetxt(tmp_path / "rig.csv", rows, delimiter=",", header=head, comments="")
    for driver, said in ((None, False), ("displacement", False), ("force", True)):
        for _, notes in Specimen(data="rig.csv", driver=driver).read(tmp_path):
            assert any("load.control=displacement" in note for note in notes) == said
