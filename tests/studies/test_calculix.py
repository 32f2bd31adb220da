"""Strips and joints by CalculiX: meshes, decks, what is read back, what goes wrong, real runs."""

import json
import re
import shutil
import stat
from pathlib import Path

import jax
import numpy as np
import pytest
import toy

import jbeamshell as jb
from calibration.finite_elements import __main__ as command
from calibration.finite_elements import deck, histories, lap, mesh, program, results, solve
from jbeamshell.scene import library, load_path
from jbeamshell.scene.keys import ENTRIES
from jbeamshell.scene.parts import unit_path

STRIP = toy.STRIP.replace({"load.entry": "traction"})
RECORDS = Path(deck.__file__).parent
COARSE = {"load.cycles": 1, "load.steps_per_half_cycle": 4}
DRIVEN = {"load.control": "displacement", "load.amplitude": 1e-5}
STEPPED = [[0.0, 10.0], [1.5, 10.0], [1.5, 0.0], [2.0, 0.0]]


def path_of(scene):
    """The scene's own cycles, without the compiled check of gross slip."""
    target = unit_path(scene.load.cycles, scene.plan.steps) * float(scene.load.amplitude)
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


@pytest.mark.parametrize("elements", ["linear", "quadratic"])
def test_a_member_goes_on_from_a_twin_of_its_last_column(elements):
    made = mesh.make_mesh(STRIP.replace({"load.entry": "member"}), elements)
    beyond, half_height = made.beyond, 0.1126
    assert [made.x[-1], beyond.x[0]] == [2.0, 2.0]
    assert np.ptp(beyond.x) == pytest.approx(mesh.REACH * half_height)
    np.testing.assert_array_equal(beyond.y, made.y)
    numbers = [*deck.nodes_of(made), *deck.nodes_of(beyond), *made.base.ravel()]
    np.testing.assert_array_equal(numbers, np.arange(1, len(numbers) + 1))
    assert beyond.first == len(made.elements) + 1
    for sizes in (np.diff(made.columns)[::-1], np.diff(beyond.columns)):
        assert sizes[0] < half_height / 24.0 * made.order
        assert np.all(sizes[1:] > 0.999 * sizes[:-1])


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
    other = {"strip.far_end": "free", "strip.plane": "stress"}
    text = deck_of(STRIP.replace(COARSE | DRIVEN | other))[1]
    assert "TYPE=CPS8R" in text
    assert "*EQUATION" in text
    assert "*BOUNDARY, FIXED" in text
    assert "NLGEOM" in text
    plain = deck_of(STRIP.replace({"model.kinematics": "linear"}), "linear")[1]
    assert "TYPE=CPE4, ELSET=STRIP" in plain
    assert "NLGEOM" not in plain
    assert "*EQUATION" not in plain
    assert "*CONTACT PAIR" not in deck_of(STRIP.replace({"contact.normal": "none"}))[1]


def equations(text):
    """Terms (k, 3) of each equation: node, direction and factor."""
    for keyword, rows in cards(text):
        if keyword == "EQUATION":
            yield np.array(rows[1:], float)


def left_over(made, text, along):
    """Rest of each equation of a deck under displacements u_x of the section X = L."""
    u = dict(zip(made.number[-1].tolist(), along, strict=True))
    for terms in equations(text):
        assert set(terms[:, 1]) == {1.0}
        yield sum(u[int(node)] * factor for node, _, factor in terms)


@pytest.mark.parametrize(("entry", "turns"), [("face", True), ("guided", False)])
def test_a_rigid_face_moves_as_one(entry, turns):
    made, text = deck_of(STRIP.replace(COARSE | {"load.entry": entry}))
    assert sum(1 for _ in equations(text)) == made.y.size - (2 if turns else 1)
    np.testing.assert_allclose([*left_over(made, text, np.ones(made.y.size))], 0.0, atol=1e-11)
    turned = np.abs([*left_over(made, text, made.y)])
    assert (np.max(turned) < 1e-11) == turns
    assert np.min(np.abs([*left_over(made, text, made.y**2)])) > 1e-5


def test_a_member_is_tied_after_the_pressing_to_what_lies_beyond():
    made, text = deck_of(STRIP.replace(COARSE | {"load.entry": "member"}))
    pairs = {tuple(terms[:2, 0].astype(int)) for terms in equations(text)}
    assert pairs == set(zip(made.number[-1], made.beyond.number[0], strict=True))
    found = [*cards(text)]
    begins = [k for k, (keyword, _) in enumerate(found) if keyword == "BOUNDARY, OP=NEW"]
    *pressed, loaded = (found[k][1] for k in begins)
    assert all(["BEYOND", "1", "2"] in held for held in pressed)
    assert ["BEYOND", "1", "2"] not in loaded
    assert found[begins[-1] + 1] == ("BOUNDARY, FIXED", [["DISTANCES", "1", "2"]])
    ends = [rows for keyword, rows in found if keyword == "CLOAD"][-1]
    assert [int(row[0]) for row in ends] == made.beyond.number[-1].tolist()
    surface = next(rows for keyword, rows in found if keyword == "SURFACE, NAME=BOTTOM")
    assert max(int(row[0]) for row in surface) <= len(made.elements)


@pytest.mark.parametrize("entry", ["traction", "member"])
@pytest.mark.parametrize("joint", [lap.joint, lap.double_shear])
def test_forces_on_a_joint_are_in_balance(joint, entry):
    scene = joint(entry)
    upper, lower = members = lap.make_members(scene, 0.4)
    found = [*cards(lap.write_deck(scene, members))]
    pressing, *_, pulling = (rows for keyword, rows in found if keyword == "CLOAD")
    forces = {(int(n), int(d)): float(force) for n, d, force in pulling}
    above, below = (
        sum(forces.get((int(n), 2), 0.0) for n in member.mesh.number[:, row])
        for member, row in ((upper, -1), (lower, 0))
    )
    assert above == pytest.approx(-20.0)
    assert below == pytest.approx(0.0 if scene.member.support == "rolling" else 20.0)
    pulled = sum(forces[int(n), 1] for n in upper.outer)
    assert pulled == pytest.approx(float(scene.load.amplitude))
    assert len(pulling) == len(pressing) + upper.outer.size
    goes_on = any(keyword == "BOUNDARY, FIXED" for keyword, _ in found)
    assert goes_on == (entry == "member")
    assert (upper.softness > 0.0) == (lower.softness > 0.0) == goes_on


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
        (lambda: STRIP.replace({"contact.normal": "compliant"}), "contact.normal"),
        (lambda: jb.Scene(energy=lambda e, g, k, psi, dpsi: e**2), "energy"),
        (library.double_shear, "member.support"),
        (lambda: jb.Scene().replace(DRIVEN | {"load.control": "arc-length"}), "load.control"),
        (lambda: jb.Scene().replace(DRIVEN), "load.entry"),
        (lambda: jb.Scene().replace({"strip.overhang": 0.3}), "strip.overhang"),
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


# --- real runs ------------------------------------------------------------------------------------

CALCULIX = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")


@CALCULIX
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


@CALCULIX
@pytest.mark.slow
@pytest.mark.parametrize("entry", ["face", "guided", "member"])
def test_an_entry_dissipates_what_plane_elasticity_says(entry):
    """The four entries' D are 2.47, 2.81, 7.19 and 2.66 here, in millionths."""
    change = {"load.entry": entry, "strip.height_ratio": 0.2358, "load.cycles": 1}
    history = solve(jb.Scene().replace(change | {"load.steps_per_half_cycle": 10}))
    plane = jb.solve(jb.Scene().replace(change | {"model.section": "plane", "model.nodes": 129}))
    assert float(history.dissipation) == pytest.approx(float(plane.dissipation), rel=0.02)
    assert float(history.secant_stiffness) == pytest.approx(float(plane.secant_stiffness), rel=2e-3)
    assert float(history.dissipation_loop) == pytest.approx(float(history.dissipation), rel=0.02)
    pressed = history.reaction[history.pressed, :-1]  # the last node takes what slid beyond it
    np.testing.assert_allclose(pressed, 10.0, rtol=1e-3)
    assert float(np.max(history.error)) < 1e-4


@CALCULIX
@pytest.mark.slow
@pytest.mark.parametrize("control", ["force", "displacement"])
@pytest.mark.parametrize("entry", ["face", "guided"])
def test_a_rigid_face_may_be_driven(entry, control):
    amplitude = {"force": 0.7855, "displacement": 1e-5}[control]
    values = {"load.entry": entry, "load.control": control, "load.amplitude": amplitude}
    history = solve(STRIP.replace(COARSE | values), elements="linear", refinement=0.5)
    plane = jb.solve(jb.Scene().replace(COARSE | values | {"model.section": "plane"}))
    assert float(np.max(history.force)) == pytest.approx(float(np.max(plane.force)), rel=0.01)
    assert float(history.secant_stiffness) == pytest.approx(float(plane.secant_stiffness), rel=0.01)


@CALCULIX
@pytest.mark.slow
def test_an_inner_member_that_goes_on():
    scene = lap.double_shear("member")
    found = lap.by_elements(scene, 0.5).figures()
    plane = lap.on_contact_line(scene.replace({"model.nodes": lap.NODES})).figures()
    assert found["dissipation"] == pytest.approx(plane["dissipation"], rel=0.015)
    assert found["secant_stiffness"] == pytest.approx(plane["secant_stiffness"], rel=0.003)


# --- records --------------------------------------------------------------------------------------


def recorded(name):
    return json.loads((RECORDS / name).read_text("utf-8"))


@pytest.mark.parametrize("entry", ENTRIES)
def test_entries_on_record_agree(entry):
    rows = [row for row in recorded("check.json")["entries"] if row["entry"] == entry]
    assert len(rows) == 4
    for row in rows:
        coarse, fine = row["refinement 1"], row["refinement 2"]
        assert fine["D_over_plane"] == pytest.approx(1.0, abs=0.01)
        assert fine["K_over_plane"] == pytest.approx(1.0, abs=0.002)
        assert fine["D_over_reference"] == pytest.approx(1.0, abs=0.01)
        assert abs(fine["D_over_plane"] - 1.0) < abs(coarse["D_over_plane"] - 1.0) + 0.001
        assert fine["K_over_reference"] == pytest.approx(1.0, abs=0.002)


@pytest.mark.parametrize("name", lap.scenes())
def test_joints_on_record_agree(name):
    rows = recorded("lap.json")[name]
    plane = rows["plane"]
    for refinement in (1, 2):
        found, off = rows[f"CalculiX, refinement {refinement}"], 0.01 / refinement
        assert found["dissipation"] == pytest.approx(plane["dissipation"], rel=off)
        assert found["secant_stiffness"] == pytest.approx(plane["secant_stiffness"], rel=1e-3)
