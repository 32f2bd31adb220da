"""Strips and joints by CalculiX: meshes, decks, what is read back, what goes wrong, real runs."""

import json
import re
import shutil
from collections import Counter
from pathlib import Path

import jax
import numpy as np
import pytest
import toy

import jbeamshell as jb
from calibration.finite_elements import deck, lap, mesh, solve
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


@pytest.mark.slow
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


# --- what goes wrong ------------------------------------------------------------------------------


OUT_OF_REACH = [
    (lambda: library.bimaterial(), "strip.layers"),
    (lambda: library.advancing(), "strip.curvature"),
    (lambda: STRIP.replace({"contact.normal": "compliant"}), "contact.normal"),
    (lambda: jb.Scene(energy=lambda e, g, k, psi, dpsi: e**2), "energy"),
    (library.double_shear, "member.support"),
    (lambda: jb.Scene().replace(DRIVEN | {"load.control": "arc-length"}), "load.control"),
    (lambda: jb.Scene().replace(DRIVEN), "load.entry"),
    (lambda: jb.Scene().replace({"strip.overhang": 0.3}), "strip.overhang"),
]


def test_what_is_out_of_reach_is_refused(monkeypatch):
    for change, field in OUT_OF_REACH:
        with pytest.raises(jb.InputError, match=f"^{field} = .*finite elements here"):
            solve(change(), program="no-such-ccx")
    with pytest.raises(jb.InputError, match="elements = 'cubic': choose 'linear' or 'quadratic'"):
        mesh.make_mesh(STRIP, "cubic")
    with pytest.raises(jb.InputError, match="refinement = 0: must be a positive number"):
        mesh.make_mesh(STRIP, refinement=0)
    with pytest.raises(jb.InputError, match="refinement = 1000: makes more than"):
        mesh.make_mesh(STRIP, refinement=1000)
    monkeypatch.setenv("CCX", "nor-this")
    with pytest.raises(jb.InputError, match=r"nor-this.*apt-get install calculix-ccx"):
        solve(STRIP)


# --- real runs ------------------------------------------------------------------------------------

CALCULIX = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")


@CALCULIX
@pytest.mark.slow
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


def test_entries_on_record_agree():
    rows = recorded("check.json")["entries"]
    assert Counter(row["entry"] for row in rows) == dict.fromkeys(ENTRIES, 4)
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
