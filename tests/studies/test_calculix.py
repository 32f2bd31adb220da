"""Strips and joints by CalculiX: meshes, decks, what is read back, what goes wrong, real runs."""

import json
import shutil
from collections import Counter
from pathlib import Path

import jax
import numpy as np
import pytest
import toy

import jbeamshell as jb
from calibration.finite_elements import deck, lap, mesh, solve
from jbeamshell.scene import library
from jbeamshell.scene.keys import ENTRIES

STRIP = toy.STRIP.replace({"load.entry": "traction"})
RECORDS = Path(deck.__file__).parent
COARSE = {"load.cycles": 1, "load.steps_per_half_cycle": 4}
DRIVEN = {"load.control": "displacement", "load.amplitude": 1e-5}
STEPPED = [[0.0, 10.0], [1.5, 10.0], [1.5, 0.0], [2.0, 0.0]]


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
