"""Strips by CalculiX: meshes, decks, what is read back, what goes wrong, and one real run."""

import re
import shutil
import stat

import jax
import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from calibration.finite_elements import __main__ as command
from calibration.finite_elements import deck, histories, mesh, program, results, solve
from jbeamshell.scene import library, load_path

COARSE = {"load.cycles": 1, "load.steps_per_half_cycle": 4}
STEPPED = [[0.0, 10.0], [1.5, 10.0], [1.5, 0.0], [2.0, 0.0]]


def path_of(scene):
    """The scene's own cycles, without the compiled check of gross slip."""
    target = scene.load.unit_path() * float(scene.load.amplitude)
    before = np.arange(1, scene.load.pressure_steps + 1) / scene.load.pressure_steps
    return load_path.LoadPath(
        np.append(0.0 * before, target),
        np.append(before, np.ones_like(target)),
        np.append(0.0 * before, np.ones_like(target)),
    )


def deck_of(scene, elements="quadratic"):
    made = mesh.make_mesh(scene, elements, 0.4)
    return made, deck.write_deck(scene, path_of(scene), made)


def cards(text):
    """Keyword lines with their data lines."""
    for block in re.split(r"^\*", text, flags=re.MULTILINE)[1:]:
        keyword, *rows = block.strip().split("\n")
        yield keyword, [row.split(", ") for row in rows]


# --- meshes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("elements", ["linear", "quadratic"])
def test_elements_fill_the_strip_and_run_anticlockwise(elements):
    made = mesh.make_mesh(STRIP, elements)
    points = np.zeros((made.number.max() + 1, 2))
    i, j = np.nonzero(made.number)
    points[made.number[i, j]] = np.column_stack([made.x[i], made.y[j]])
    x, y = np.moveaxis(points[made.elements[:, :4]], -1, 0)
    ahead_x, ahead_y = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
    areas = 0.5 * np.sum(x * ahead_y - ahead_x * y, axis=1)
    assert np.all(areas > 0.0)
    assert np.sum(areas) == pytest.approx(2.0 * 2.0 * 0.1126)
    assert np.unique(made.number[made.number > 0]).size == made.number.max()
    if elements == "quadratic":
        corners, middles = points[made.elements[:, :4]], points[made.elements[:, 4:]]
        halfway = 0.5 * (corners + np.roll(corners, -1, axis=1))
        np.testing.assert_allclose(middles, halfway, atol=1e-12)


def test_elements_are_small_at_the_loaded_end_and_at_steps_of_the_pressure():
    half_height = 0.1126
    even = np.diff(mesh.make_mesh(STRIP).columns)
    assert even[-1] < half_height / 7.0
    assert np.all(even[1:] < even[:-1] * 1.001)
    stepped = mesh.make_mesh(STRIP.replace({"contact.pressure": STEPPED}))
    at = np.searchsorted(stepped.columns, 1.5)
    sizes = np.diff(stepped.columns)
    assert max(sizes[at - 2 : at + 1]) < half_height / 5.0
    assert max(sizes) > half_height / 2.0
    finer = mesh.make_mesh(STRIP, refinement=2.0)
    assert finer.columns.size == pytest.approx(2 * even.size, abs=2)


def test_the_base_has_a_node_under_every_node_and_one_beyond_each_end():
    made = mesh.make_mesh(STRIP)
    np.testing.assert_array_equal(made.base_x[1:-1], made.x)
    assert made.base_x[0] < 0.0
    assert made.base_x[-1] > 2.0
    assert made.base.min() == made.number.max() + 1
    assert np.sum(made.tributary) == pytest.approx(2.0)


# --- decks ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("elements", "pressure", "total"), [("linear", 10.0, 20.0), ("quadratic", STEPPED, 15.0)]
)
def test_nodal_forces_add_up_to_the_loads(elements, pressure, total):
    scene = STRIP.replace(COARSE | {"contact.pressure": pressure})
    made, text = deck_of(scene, elements)
    forces = [rows for keyword, rows in cards(text) if keyword == "CLOAD"]
    pressing, end = forces[-2:]
    assert sum(float(row[2]) for row in pressing) == pytest.approx(-total)
    assert {row[1] for row in pressing} == {"2"}
    assert sum(float(row[2]) for row in end) == pytest.approx(0.7855)
    assert [int(row[0]) for row in end] == made.number[-1].tolist()
    if elements == "quadratic":
        assert made.shares[1] / made.shares[0] == pytest.approx(4.0)


def test_friction_comes_after_the_pressing():
    text = deck_of(STRIP.replace(COARSE | {"load.pressure_steps": 2}))[1]
    found = list(cards(text))
    keywords = [keyword for keyword, _ in found]
    steps = [k for k, keyword in enumerate(keywords) if keyword.startswith("STEP")]
    assert len(steps) == len(deck.SOFTER) + 2 + 10
    changed = keywords.index("CHANGE FRICTION, INTERACTION=CONTACT")
    assert steps[len(deck.SOFTER) + 1] < changed < steps[len(deck.SOFTER) + 3]
    assert keywords.count("CHANGE FRICTION, INTERACTION=CONTACT") == 1
    frictions = [float(rows[0][0]) for keyword, rows in found if keyword == "FRICTION"]
    assert frictions == pytest.approx([1e-7, 0.1])
    assert not any(keyword.startswith("DLOAD") for keyword in keywords)


def test_what_a_scene_is_made_of_shows_in_its_deck():
    driven = {"load.control": "displacement", "load.amplitude": 1e-5, "strip.far_end": "free"}
    text = deck_of(STRIP.replace(COARSE | driven | {"strip.plane": "stress"}))[1]
    assert "TYPE=CPS8R" in text
    assert "*EQUATION" in text
    assert "*BOUNDARY, FIXED" in text
    assert "NLGEOM" in text
    plain = deck_of(STRIP.replace({"model.kinematics": "linear"}), "linear")[1]
    assert "TYPE=CPE4, ELSET=STRIP" in plain
    assert "NLGEOM" not in plain
    assert "*EQUATION" not in plain
    lifted = {"contact.normal": "none", "model.fields": ["v", "w", "beta", "psi"]}
    assert "*CONTACT PAIR" not in deck_of(STRIP.replace(lifted))[1]


def test_contact_stiffness_does_not_depend_on_the_units():
    metres, millimetres = (
        STRIP,
        {
            "strip.length": 2e3,
            "strip.axial_stiffness": 3.4e1,  # N/m to N/mm
            "contact.pressure": 10e-6,
            "load.amplitude": 0.7855e-3,
        },
    )
    one, other = (deck.penalty(s, path_of(s)) for s in (metres, metres.replace(millimetres)))
    assert other.normal / one.normal == pytest.approx(1e-9)
    assert other.stick / one.stick == pytest.approx(1e-9)


# --- results --------------------------------------------------------------------------------------

PRINTED = """
 displacements (vx,vy,vz) for set STRIP and time  0.1000000E+01

         1  1.000000E-03  2.000000E-03  0.000000E+00
         2  3.000000E-03 -4.000000-101  0.000000E+00

 forces (fx,fy,fz) for set GROUND and time  0.1000000E+01

         7 -1.000000E+00  5.000000E+00  0.000000E+00

 total internal energy for set STRIP and time  0.1000000E+01

        1.250000E-01

 displacements (vx,vy,vz) for set STRIP and time  0.2000000E+01

         1  2.000000E-03  2.000000E-03  0.000000E+00
         2  3.000000E-03  1.000000E-03  0.000000E+00

 forces (fx,fy,fz) for set GROUND and time  0.2000000E+01

         7 -2.000000E+00  5.000000E+00  0.000000E+00

 total internal energy for set STRIP and time  0.2000000E+01

        2.500000E-01
"""


def test_printed_results_are_read_back():
    found = results.read(PRINTED)
    moved = found["U", "STRIP"]
    assert moved.nodes.tolist() == [1, 2]
    np.testing.assert_allclose(moved.values[:, 0, 0], [1e-3, 2e-3])
    assert moved.values[0, 1, 1] == -4e-101  # Fortran leaves out the E
    assert found["RF", "GROUND"].values[:, 0, 0].tolist() == [-1.0, -2.0]
    assert found["ELSE", "STRIP"].values.tolist() == [0.125, 0.25]


@pytest.mark.parametrize(("last", "levels"), [("forces", 1), ("total", 1), ("displ", 1), ("", 2)])
def test_only_complete_levels_count(last, levels):
    found = results.read(PRINTED[: PRINTED.rindex(last)])
    assert all(printed.values.shape[0] == levels for printed in found.values())


def test_levels_begin_after_the_steps_before_them():
    found = results.read(PRINTED, before=1)
    assert found["ELSE", "STRIP"].values.tolist() == [0.25]


def test_a_contact_that_pulls_is_no_equilibrium():
    scene = STRIP.replace(COARSE)
    made = mesh.make_mesh(scene, refinement=0.3)
    count, force = made.number.max(), np.ones((11, made.base_x.size, 3))
    force[4:, 3, 1] = -0.1
    printed = {
        ("U", "STRIP"): results.Printed(np.arange(1, count + 1), np.zeros((11, count, 3))),
        ("RF", "FAR"): results.Printed(made.number[0], np.zeros((11, made.y.size, 3))),
        ("RF", "GROUND"): results.Printed(made.base[:, 1], force),
        ("ELSE", "STRIP"): results.Printed(np.zeros(0, int), np.zeros(11)),
    }
    nothing = np.zeros((0, 2))
    history = histories.make_history(scene, path_of(scene), (), made, printed, nothing)
    assert history.status.tolist() == [0] * 4 + [1] + [3] * 6
    assert np.all(np.isfinite(history.reaction[:4]))
    assert np.all(np.isnan(history.reaction[4:]))


# --- what goes wrong ------------------------------------------------------------------------------


def test_without_calculix_one_line_says_how_to_get_it(monkeypatch):
    with pytest.raises(jb.InputError, match=r"no-such-ccx.*apt-get install calculix-ccx"):
        solve(STRIP, program="no-such-ccx")
    monkeypatch.setenv("CCX", "nor-this")
    with pytest.raises(jb.InputError, match="nor-this"):
        solve(STRIP)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda: library.bimaterial(), "strip.layers"),
        (lambda: library.advancing(), "strip.curvature"),
        (
            lambda: STRIP.replace(
                {"contact.normal": "compliant", "model.fields": ["v", "w", "beta", "psi"]}
            ),
            "contact.normal",
        ),
        (lambda: jb.Scene(energy=lambda e, g, k, psi, dpsi: e**2), "energy"),
    ],
)
def test_a_scene_out_of_reach_is_refused(change, field):
    with pytest.raises(jb.InputError, match=f"^{field} = .*finite elements here"):
        solve(change(), program="no-such-ccx")


def test_options_are_checked():
    with pytest.raises(jb.InputError, match="elements = 'cubic': choose 'linear' or 'quadratic'"):
        mesh.make_mesh(STRIP, "cubic")
    with pytest.raises(jb.InputError, match="refinement = 0: must be a positive number"):
        mesh.make_mesh(STRIP, refinement=0)
    with pytest.raises(jb.InputError, match="refinement = 1000: makes more than"):
        mesh.make_mesh(STRIP, refinement=1000)


@pytest.fixture
def giving_up(tmp_path):
    """A program that says what CalculiX says when it gives up."""
    script = tmp_path / "ccx"
    script.write_text("#!/bin/sh\necho ' *ERROR: too many cutbacks'\nexit 201\n")
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    return script


def test_an_early_end_says_where_why_and_keeps_the_files(giving_up, tmp_path):
    folder = tmp_path / "kept"
    scene = STRIP.replace(COARSE)
    with pytest.raises(jb.UnconvergedError, match="too many cutbacks") as caught:
        solve(scene, program=giving_up, folder=folder, refinement=0.3)
    assert "after level 0 of 11" in str(caught.value)
    assert str(folder) in str(caught.value)
    assert (folder / "strip.inp").exists()
    with pytest.warns(RuntimeWarning, match="too many cutbacks"):
        history = solve(scene, program=giving_up, folder=folder, refinement=0.3, throw=False)
    assert history.status.tolist() == [1, *[3] * 10]
    assert np.all(np.isnan(history.displacement))


def test_temporary_files_stay_only_after_a_failure(giving_up, monkeypatch, tmp_path):
    monkeypatch.setattr(program.tempfile, "tempdir", str(tmp_path))
    outcome = program.run("", 1, str(giving_up))
    assert outcome.folder.exists()
    giving_up.write_text("#!/bin/sh\necho ' Job finished'\n")
    outcome = program.run("", 1, str(giving_up))
    assert outcome.finished
    assert not outcome.folder.exists()


def test_an_interrupted_run_stops_calculix(giving_up, monkeypatch, tmp_path):
    giving_up.write_text("#!/bin/sh\nexec sleep 60\n")
    started = []

    def interrupt(process, *_):
        started.append(process)
        raise KeyboardInterrupt

    monkeypatch.setattr(program, "_watch", interrupt)
    with pytest.raises(KeyboardInterrupt):
        program.run("", 1, str(giving_up), tmp_path)
    assert started[0].returncode == -9


def test_the_command_line_says_what_is_wrong(capsys, monkeypatch):
    monkeypatch.setenv("CCX", "no-such-ccx")
    assert command.main(["bimaterial"]) == 2
    assert "strip.layers" in capsys.readouterr().err


# --- a real run -----------------------------------------------------------------------------------


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")
def test_a_coarse_loop_dissipates_what_elasticity_says():
    """The data's D over the cubic law is .7583 (eta .1126, A .7855)."""
    scene = STRIP.replace(COARSE | {"model.kinematics": "linear"})
    history = solve(scene, elements="linear", refinement=0.35)
    assert float(history.dissipation_ratio) == pytest.approx(0.7583, rel=0.04)
    assert float(np.max(history.error)) < 1e-4  # the strip's resultants balance
    np.testing.assert_allclose(history.reaction @ history.tributary, 20.0, rtol=1e-5)
    np.testing.assert_allclose(history.sections.e[1:, -1], history.force[1:], atol=0.02)
    pressed = history.pressed
    psi = -10.0 / float(scene.strip.plane_modulus)
    np.testing.assert_allclose(history.psi[pressed], psi, rtol=0.01)
    assert set(jax.tree.leaves(history.figures())) >= {"converged"}
