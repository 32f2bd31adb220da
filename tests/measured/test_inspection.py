"""Faults of measured data are told by their names, and sound data are never refused."""

import json

import matplotlib.pyplot as plt
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.cli.main import main
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import csv_text
from jbeamshell.common.summary import ranged, with_unit
from jbeamshell.measured.clipping import clipped
from jbeamshell.measured.example import HEIGHT_RATIOS, example_loops
from jbeamshell.measured.inspection import inspect
from jbeamshell.measured.loop_shape import CONVEX
from jbeamshell.plotting import inspection
from tests import rig

QUIET = [0.0, 0.01]


def names(seen, grave=True):
    return {finding.name for finding in seen.findings if finding.grave == grave}


def kind(seen):
    return seen.views[0].levels[-1].shape.kind


def with_seed(seed, points=(40, 200), cycles=(2, 6)):
    """Random numbers, and a path of some cycles."""
    random = np.random.default_rng(seed)
    return random, rig.path(int(random.integers(*cycles)), int(random.choice(points)))


# --- what is wrong is told ----------------------------------------------------------------------

WRONG = {
    "force turned": ("wrong sign", lambda u, r: (-rig.iwan(u, r.uniform(1.2, 4.0)), u)),
    "force of gross slip turned": (
        "wrong sign",
        lambda u, r: (-rig.jenkins(u, r.uniform(0.1, 0.8)), u),
    ),
    "columns swapped": ("negative work", lambda u, r: (u, rig.iwan(u, r.uniform(1.2, 3.0)))),
    "columns of gross slip swapped": (
        "negative work",
        lambda u, r: (u, rig.jenkins(u, r.uniform(0.1, 0.8))),
    ),
    "columns under force swapped": (
        "negative work",
        lambda u, r: (rig.iwan_by_force(u, r.uniform(1.02, 2.0)), u),
    ),
    "pinched": ("clearance", lambda u, r: (rig.pinched(u, r.uniform(0.3, 0.6)), u)),
    "bearing": ("clearance", lambda u, r: (rig.bearing(u, r.uniform(0.3, 0.7)), u)),
}


@pytest.mark.parametrize("fault", WRONG)
@pytest.mark.parametrize("noise", QUIET)
@pytest.mark.parametrize("noisy", rig.NOISES)
def test_what_cannot_be_right_is_refused_by_its_name(fault, noise, noisy):
    name, made = WRONG[fault]
    for seed in range(3):
        random, u = with_seed(seed)
        seen = inspect(rig.recorded(*made(u, random), noise, noisy, seed, "displacement"))
        assert names(seen) == {name}, (seed, seen)
        with pytest.raises(InputError, match=r"rig: .*--unchecked"):
            seen.check()


@pytest.mark.parametrize("noisy", rig.NOISES)
@pytest.mark.parametrize("name", ["force", "displacement"])
def test_a_clipped_column_is_refused(noisy, name):
    for seed in range(3):
        random, u = with_seed(seed, points=(200,))
        recording = rig.recorded(rig.iwan(u, 2.0), u, 0.01, noisy, seed, "displacement")
        column = getattr(recording, name)
        limit = random.uniform(0.6, 0.8) * np.max(column)
        turned = random.choice([-1.0, 1.0])  # at the top, or at the bottom
        cut = {name: turned * np.minimum(turned * column, limit)}
        seen = inspect(recording.but(**cut))
        assert names(seen) == {"clipped"}
        (told,) = (f.text for f in seen.findings if f.name == "clipped")
        assert told.startswith(f"the {name} is clipped at {turned * limit:.4g}")


def test_a_plateau_and_a_stick_are_not_clipped():
    u = rig.path(points=200)
    assert clipped(rig.jenkins(u, 0.1), u) is None  # force constant up to the turn
    assert clipped(rig.plays(u, [0.2], np.ones(1)), u) is None  # displacement constant from there
    assert clipped(np.round(8.0 * rig.iwan(u)) / 8.0, u) is None  # few levels
    flat = np.clip(rig.jenkins(u, 0.1), -0.05, 0.05)
    assert clipped(flat, u) is None  # a lower plateau is a plateau
    assert clipped(np.clip(u, -0.5, 0.5), rig.iwan(u)) == 0.5


# --- what is doubtful is told, and fitted -------------------------------------------------------


@pytest.mark.parametrize("noise", QUIET)
@pytest.mark.parametrize("noisy", rig.NOISES)
def test_an_ellipse_is_viscous_and_other_loops_are_not(noise, noisy):
    for seed in range(3):
        random, u = with_seed(seed)
        force = rig.viscous(u, random.uniform(0.2, 1.0))
        seen = inspect(rig.recorded(force, u, noise, noisy, seed, "displacement"))
        assert kind(seen) == "viscous"
        assert names(seen, grave=False) == {"viscous"}
        assert seen.sound
    for name, driver in rig.SOUND.items():
        columns = rig.sound(name, np.random.default_rng(3))
        assert kind(inspect(rig.recorded(*columns, noise, noisy, 1, driver))) != "viscous"


@pytest.mark.parametrize("noise", [0.001, 0.01])
def test_gross_slip_and_micro_slip_are_told_apart(noise):
    u = rig.path()
    gross = rig.recorded(rig.jenkins(u), u, noise, driver="displacement")
    micro = rig.recorded(rig.iwan(u), u, noise, driver="displacement")
    forced = rig.recorded(u, rig.iwan_by_force(u), noise, driver="force")
    assert [kind(inspect(r)) for r in (gross, micro, forced)] == [
        "gross slip",
        "micro-slip",
        "micro-slip",
    ]


def test_a_line_determines_no_friction():
    u = rig.path()
    seen = inspect(rig.recorded(2.0 * u, u, 0.01, driver="displacement"))
    assert kind(seen) == "elastic"
    assert names(seen, grave=False) == {"elastic"}
    assert seen.sound


def test_drift_offset_and_asymmetry_are_doubts():
    u = rig.path(6)
    force = rig.iwan(u)
    drifting = force + 0.4 * np.linspace(0.0, 1.0, u.size)
    uneven = rig.stops(u, [0.3], [1.0]) + 0.6 * np.maximum(u, 0.0) ** 2
    cases = ((drifting, u, "drift"), (force, u + 3.0, "off centre"), (force + 0.2, u, "off centre"))
    for column, along, name in cases:
        seen = inspect(rig.recorded(column, along, 0.005, driver="displacement"))
        assert names(seen, grave=False) == {name}
        assert seen.sound
    assert "asymmetric" in names(inspect(rig.recorded(uneven, u, 0.005, driver="displacement")), 0)


@pytest.mark.parametrize("driver", ["force", "displacement"])
@pytest.mark.parametrize("drifting", ["force", "displacement"])
def test_either_column_may_drift(driver, drifting):
    u = rig.path(4, 80)
    columns = {"force": rig.iwan(u), "displacement": u.copy()}
    columns[drifting] += 0.5 * np.linspace(0.0, 1.0, u.size)
    seen = inspect(rig.recorded(*columns.values(), 0.002, driver=driver))
    assert "drift" in names(seen, grave=False)


@pytest.mark.parametrize("cycles", [3, 6])
def test_a_mean_loop_is_as_asymmetric_as_its_cycles(cycles):
    u = rig.path(cycles + 1)
    force = rig.stops(u, [0.3], [1.0]) + 0.6 * np.maximum(u, 0.0) ** 2
    (loop,) = jb.measured.steady_loops(rig.recorded(force, u, 0.005, driver="displacement"))
    assert loop.cycles >= 3
    assert names(inspect(loop), grave=False) == {"asymmetric"}
    assert names(inspect(loop.but(cycles=1)), grave=False) != {"asymmetric"}  # may be noise


def test_millimetres_taken_for_metres_are_told_from_the_specimens_stiffness():
    u = rig.path()
    recording = rig.recorded(1e6 * rig.iwan(u), u, 0.005, driver="displacement")
    (level,) = inspect(recording).views[0].levels
    band = (level.stiffness / 3.0, 30.0 * level.stiffness)
    assert not inspect(recording, stiffness=band).findings
    for factor, words in ((1e3, "millimetres for metres"), (1e-3, "metres for millimetres")):
        wrong = recording.but(displacement=factor * recording.displacement)
        seen = inspect(wrong, stiffness=band)
        assert names(seen) == {"stiffness"}
        assert words in seen.findings[0].text
    rig_too = recording.but(displacement=6.0 * recording.displacement)  # a soft rig is a doubt
    assert names(inspect(rig_too, stiffness=band), grave=False) == {"stiffness"}


# --- sound data are never refused ---------------------------------------------------------------


@pytest.mark.parametrize("noisy", rig.NOISES)
@pytest.mark.parametrize("name", rig.SOUND)
def test_sound_loops_are_never_refused(name, noisy):
    for seed in range(4):
        random = np.random.default_rng(seed)
        columns, noise = rig.sound(name, random), random.choice([0.0, 0.01, 0.02, 0.05])
        seen = inspect(rig.recorded(*columns, noise, noisy, seed, rig.SOUND[name]))
        assert seen.sound, (seed, noise, seen)


@pytest.mark.parametrize("ratio", HEIGHT_RATIOS)
def test_loops_of_finite_elements_are_never_refused(ratio):
    for seed, loop in enumerate(example_loops(ratio, None)):
        seen = inspect(loop)
        assert seen.sound
        shape = seen.views[0].levels[0].shape
        assert shape.convexity < 0.2 * CONVEX
        noisy = list(rig.NOISES)[seed % 4]
        noise = rig.recorded(loop.force, loop.displacement, 0.05, noisy, seed, "force")
        assert inspect(noise).sound


def test_the_work_is_that_of_the_loop():
    u = rig.path(4, 400)
    recording = rig.recorded(rig.jenkins(u, 0.25), u, 1e-4, driver="displacement")
    (level,) = inspect(recording).views[0].levels
    assert level.work == pytest.approx(4.0 * 0.25 * 0.75, rel=0.01)  # 4 F_slip (A - F_slip/k)
    assert level.stiffness == pytest.approx(0.25, rel=0.01)
    assert level.loop.work == pytest.approx(level.work, rel=0.01)


# --- files, texts, pictures, command ------------------------------------------------------------


@pytest.fixture
def csv(tmp_path):
    def written(name, force, displacement, heads=("time [s]", "Load [kN]", "slip [mm]")):
        rows = zip(0.01 * np.arange(force.size), force, displacement, strict=True)
        (tmp_path / name).write_text(csv_text(heads, rows), "utf-8")
        return tmp_path / name

    return written


def test_a_recording_and_a_loop_are_printed_short_with_units(csv):
    u = rig.path()
    (recording,) = jb.measured.read_loops(csv("rig.csv", 12.0 * rig.iwan(u), 0.02 * u))
    assert str(recording).splitlines() == [
        "rig.csv: 851 points",
        "  force                -13.16 to 13.16 kN, column 'Load [kN]'",
        "  displacement         -20 to 20 um, column 'slip [mm]'",
        "  time                 0 to 8.5 s, 100 Hz, column 'time [s]'",
    ]
    (loop,) = jb.measured.steady_loops(recording)
    told = str(loop)
    assert "work of a cycle" in told
    assert "mJ" in told
    assert len(told) < 600
    assert recording.of_width(0.05).unit("force") == "N"
    bare = rig.recorded(rig.iwan(u), u)
    assert "without units" in str(bare)


def test_numbers_have_prefixes_with_units_alone():
    assert with_unit(2.3e-5, "m") == "23 um"
    assert with_unit(-4.2e3, "N") == "-4.2 kN"
    assert with_unit(2.3e-5) == "2.3e-05"
    assert with_unit(0.0, "N") == "0 N"
    assert ranged(np.array([-1e-9, 2e-3]), "m") == "-1e-06 to 2 mm"


def test_the_command_tells_what_is_in_a_file_and_refuses_by_its_exit_code(csv, capsys, tmp_path):
    u = rig.path()
    good = csv("good.csv", 12.0 * rig.iwan(u), 0.02 * u)
    assert main(["inspect", str(good), "--out", str(tmp_path / "seen")]) == 0
    told = capsys.readouterr().out
    assert "column 'Load [kN]'" in told
    assert "4 of amplitude 20 um" in told
    assert "nothing speaks against a fit" in told
    assert {path.name for path in (tmp_path / "seen").iterdir()} == {
        "inspection.png",
        "inspection.json",
        "inspection.txt",
    }
    wrong = csv("wrong.csv", -12.0 * rig.iwan(u), 0.02 * u)
    assert main(["inspect", str(wrong), "--json"]) == 2
    figures = json.loads(capsys.readouterr().out)
    assert not figures["sound"]
    assert figures["recordings"][0]["findings"][0]["name"] == "wrong sign"
    swapped = csv("swapped.csv", u, rig.iwan(u))
    assert main(["inspect", str(swapped)]) == 2
    assert "--column force='slip [mm]'" in capsys.readouterr().out


def test_a_first_loading_has_no_cycles():
    u = np.linspace(0.0, 1.0, 50)
    seen = inspect(rig.recorded(rig.iwan(u), u))
    assert seen.sound
    assert "never turns back" in str(seen)
    assert names(inspect(rig.recorded(-rig.iwan(u), u))) == {"wrong sign"}
    loops, *_ = inspection(seen)
    with pytest.raises(InputError, match="need 3, not"):
        inspection(seen, [loops])
    plt.close(loops.figure)


def test_what_all_amplitudes_show_is_said_once():
    u = rig.path(3, amplitudes=(0.4, 1.0))
    seen = inspect(rig.recorded(-rig.iwan(u), u, 0.005, driver="displacement"))
    (finding,) = seen.findings
    told = finding.text.removeprefix("cycles to displacement = ").split(":")[0]
    assert float(told) == pytest.approx(1.0, rel=1e-3)  # its drive has noise of that size


# --- the fit looks first ------------------------------------------------------------------------


def test_a_fit_refuses_what_the_inspection_refuses(csv, capsys):
    u = rig.path(1, 80)
    loop = jb.measured.make_loop(-rig.jenkins(u), u, "wrong")
    with pytest.raises(InputError, match=r"wrong: .* wrong sign.*--reverse force"):
        jb.identify.fit(loop, jb.Scene(), ["contact.friction"])
    wrong = csv("wrong.csv", -12.0 * rig.iwan(u), 0.02 * u)
    assert main(["fit", str(wrong)]) == 2
    assert "--reverse force" in capsys.readouterr().err


def test_plans_turn_signs_and_take_data_unchecked(csv, tmp_path):
    u = rig.path()
    csv("wrong.csv", -12.0 * rig.iwan(u), 0.02 * u)
    text = "[free.'contact.friction']\n[[specimen]]\ndata = ['wrong.csv']\n"
    (tmp_path / "plan.toml").write_text(text, "utf-8")
    with pytest.raises(InputError, match=r"wrong sign.*reverse = 'force'"):
        jb.identify.read_plan(tmp_path / "plan.toml")
    (tmp_path / "plan.toml").write_text(f"{text}reverse = 'force'\n", "utf-8")
    turned = jb.identify.read_plan(tmp_path / "plan.toml")
    assert "wrong.csv: the sign of the force is turned" in turned.notes
    (tmp_path / "plan.toml").write_text(f"unchecked = true\n{text}", "utf-8")
    plan = jb.identify.read_plan(tmp_path / "plan.toml")
    assert plan.options.unchecked
    (one,), (other,) = turned.cases[0].measurements, plan.cases[0].measurements
    assert one.work == pytest.approx(-other.work)


def test_a_fit_tells_a_drift_that_its_mean_loops_hide(csv, tmp_path):
    u = rig.path(5)
    csv("rig.csv", 12.0 * rig.iwan(u) + 2.0 * np.linspace(0.0, 1.0, u.size), 0.02 * u)
    text = "[free.'contact.friction']\n[[specimen]]\ndata = ['rig.csv']\n"
    (tmp_path / "plan.toml").write_text(text, "utf-8")
    notes = jb.identify.read_plan(tmp_path / "plan.toml").notes
    assert any("drifts by" in note and "--drift linear" in note for note in notes)
    (tmp_path / "plan.toml").write_text(f"{text}drift = 'linear'\n", "utf-8")
    notes = jb.identify.read_plan(tmp_path / "plan.toml").notes
    assert not any("drifts by" in note for note in notes)


def test_copies_of_one_cycle_tell_no_noise(csv):
    u = rig.path(3, 80)
    columns = [np.tile(column[-161:-81], 4) for column in (rig.iwan(u), 0.02 * u)]
    whole = csv("rig.csv", *columns)
    loops = jb.measured.steady_loops(jb.measured.read_loops(whole)[0])
    assert loops[0].deviations is None
    assert loops[0].but(scatter=None, noise=0.1).deviations is not None
