"""Lap joints: two members on their contact line, beside elements, closed forms and limits."""

import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import FEW
from toy import rows_of

import jbeamshell as jb
from calibration.finite_elements import lap
from jbeamshell.contact_line import strip
from jbeamshell.contact_line.pair import Pair
from jbeamshell.contact_line.section import section_form
from jbeamshell.contact_line.stations import stations
from jbeamshell.contact_line.strip import Members, over_gap
from jbeamshell.dynamics import Joint
from jbeamshell.mechanics.bar import lap_backbone, lap_cubic_law
from jbeamshell.scene import library

BOLTED = Path(lap.__file__).with_name("lap.json")
JOINT = {"strip.far_end": "free", "member.support": "rolling", "load.amplitude": 1.0}
SQUEEZE = jb.Scene().replace(FEW | JOINT | {"model.section": "squeeze"})
pytestmark = pytest.mark.doubtful("the section squeeze")  # which these joints name
BOLT = [[0.75, 0.0], [0.75, 40.0], [1.25, 40.0], [1.25, 0.0]]
BOLTED_SHELL = SQUEEZE.replace(
    {"model.section": "shell", "member.support": "clamped", "load.amplitude": 0.5}
    | {"contact.pressure": BOLT, "contact.bottom_pressure": BOLT}
    | {"load.steps_per_half_cycle": 40}
)


def elements(problem):
    return [row for of, row in rows_of("lap_joints.csv", "problem") if of == problem]


def of_row(row):
    """Values of the scene of a row of the finite elements."""
    return {
        "strip.height_ratio": row["H1"],
        "member.height_ratio": row["H2"],
        "member.axial_stiffness": 3.4e4 * row["E2_over_E1"] * row["H2"] / row["H1"],
        "load.amplitude": row["A"],
    }


class TestElements:
    @pytest.mark.slow
    @pytest.mark.parametrize("row", elements("double-shear"), ids=str)
    def test_double_shear(self, row):
        history = jb.solve(library.double_shear().replace(of_row(row)))
        assert float(history.dissipation) == pytest.approx(row["D"], rel=0.01)
        assert float(history.secant_stiffness) == pytest.approx(row["K_sec"], rel=0.001)

    @pytest.mark.slow
    def test_single_lap(self):
        (row,) = elements("single-lap")
        history = jb.solve(library.single_lap())
        assert float(history.dissipation) == pytest.approx(row["D"], rel=0.01)
        assert float(history.secant_stiffness) == pytest.approx(row["K_sec"], rel=0.001)
        _, turn, stop = history.cycles[-1]
        ends = []
        for step in (stop, turn):
            touching = history.x[history.touching[step]]
            ends += [float(touching[0]), float(touching[-1])]
        assert ends == pytest.approx([0.6702, 1.3248, 0.6502, 1.3548], rel=0.02)
        assert float(jnp.max(history.gap)) == pytest.approx(2.419e-4, rel=0.01)

    @pytest.mark.slow
    def test_two_bolts(self):
        record = json.loads(BOLTED.read_text("utf-8"))["joint"]
        elements = record["CalculiX, refinement 2"]
        found = lap.on_contact_line(lap.joint()).figures()
        assert found["dissipation"] == pytest.approx(elements["dissipation"], rel=0.01)
        assert found["secant_stiffness"] == pytest.approx(elements["secant_stiffness"], rel=0.001)
        for name in ("open_at_pull", "open_at_push"):
            assert found[name] == pytest.approx(elements[name], rel=0.03)


class TestLimits:
    @pytest.mark.slow
    def test_a_stiff_member_is_a_rigid_base(self, monkeypatch):
        alone = jb.Scene().replace(
            {
                "strip.far_end": "free",
                "load.amplitude": 1.0,
                "model.section": "squeeze",
                "model.kinematics": "linear",
            }
        )
        scene = SQUEEZE.replace({"member.axial_stiffness": 3.4e10})
        x = stations(scene, scene.plan.nodes)  # one grid for both
        monkeypatch.setattr(strip, "stations", lambda *_: x)
        base = jb.solve(alone.replace({"load.steps_per_half_cycle": 22}), throw=False)
        joint = jb.solve(scene.replace({"load.steps_per_half_cycle": 22}), throw=False)
        for name in ("dissipation", "secant_stiffness", "peak_displacement"):
            assert float(getattr(joint, name)) == pytest.approx(
                float(getattr(base, name)), rel=1e-4
            )

    def test_thin_members_are_bars_that_lap(self):
        ratio = 3.0
        thin = {"strip.height_ratio": 0.001, "member.height_ratio": 0.001}
        thin |= {"member.axial_stiffness": 3.4e4 * ratio}
        history = jb.solve(SQUEEZE.replace(thin), throw=False)
        bars = 3.4e4, 3.4e4 * ratio
        u = float(lap_backbone(1.0, *bars, 2.0, 1.0))
        assert float(history.dissipation) == pytest.approx(
            float(lap_cubic_law(1.0, *bars, 1.0)), rel=0.01
        )
        assert 1.0 / float(history.secant_stiffness) == pytest.approx(u, rel=0.002)
        assert float(history.dissipation_ratio) == pytest.approx(1.0, rel=0.01)

    def test_overhangs_are_springs_in_series(self):
        joint = jb.solve(SQUEEZE)
        longer = jb.solve(SQUEEZE.replace({"strip.overhang": 0.6, "member.overhang": 0.4}))
        added = 1.0 / longer.secant_stiffness - 1.0 / joint.secant_stiffness
        assert float(added) == pytest.approx(1.0 / 3.4e4, rel=0.01)
        tips = []
        for step in (0, -1):
            axes = longer.plot_deformed(step, scale=100.0)
            upper, lower = (patch.get_xy()[:-1] for patch in axes.patches[:2])
            np.testing.assert_allclose(lower[[0, -1], 0], -0.4, atol=1e-12)  # where it is held
            middle = len(upper) // 2  # the outline turns at the loaded end
            tips.append(np.mean(upper[middle - 1 : middle + 1, 0]))
        moved = tips[1] - tips[0]
        assert moved == pytest.approx(100.0 * float(longer.displacement[-1]), rel=0.03)


class TestBalance:
    def test_the_loop_holds_the_work_of_friction(self):
        history = jb.solve(SQUEEZE.replace({"load.steps_per_half_cycle": 400}))
        loop, work = float(history.dissipation_loop), float(history.dissipation)
        assert loop == pytest.approx(work, rel=1e-6)

    def test_members_move_apart_by_gap_and_slip(self):
        history = jb.solve(BOLTED_SHELL, throw=False)
        scale = float(np.max(np.abs(history.v)))
        np.testing.assert_allclose(
            history.w - history.member[..., 1], history.gap, atol=1e-9 * scale
        )
        assert float(jnp.max(history.gap)) > 0.0
        assert not np.any(np.asarray(history.slipping) & ~np.asarray(history.touching))
        stuck = ~np.any(np.asarray(history.slipping), axis=0)
        stuck &= np.all(np.asarray(history.touching), axis=0)
        assert stuck.any()
        # A node that begins to slip, by a part, counts as stuck.
        np.testing.assert_allclose(history.slip[:, stuck], 0.0, atol=5e-4 * scale)
        axes = history.plot_deformed()
        upper, lower = (patch.get_xy()[:-1] for patch in axes.patches[:2])
        n = history.x.size
        rise = float(axes.get_title().rpartition(" ")[2]) * np.asarray(history.w[-1])
        np.testing.assert_allclose(upper[:n, 1], rise, atol=1e-12)
        assert len(history.animate([0, -1]).still(1).axes[0].patches) == len(axes.patches)
        assert np.all(upper[:n, 1] - lower[:n, 1] >= -1e-12)
        assert np.all(upper[:n, 1] <= upper[n:, 1][::-1])
        # The clamped face, and equilibrium of the upper member along X.
        np.testing.assert_allclose(history.member[:, 0, :3], 0.0, atol=1e-9 * scale)
        carried = history.traction @ history.tributary
        np.testing.assert_allclose(carried, history.force, atol=1e-9)

    def test_assembly_with_friction_locks_shear_in(self):
        values = {"member.axial_stiffness": 1e5}
        smooth = jb.solve(SQUEEZE.replace(values))
        rough = jb.solve(SQUEEZE.replace(values | {"member.assembly": "frictional"}))
        held = np.abs(np.asarray(rough.traction[0]))
        assert held.max() > 0.01
        assert np.all(held <= 0.1 * np.asarray(rough.reaction[0]) * (1.0 + 1e-9))
        np.testing.assert_allclose(smooth.traction[0], 0.0, atol=1e-12)
        carried = rough.traction @ rough.tributary
        np.testing.assert_allclose(carried, rough.force, atol=1e-8)


def test_shanks_hold_a_joint_beyond_gross_slip():
    rigid = {"strip.axial_stiffness": 3.4e9, "member.bolt_stiffness": 5e3, "model.nodes": 25}
    rigid |= {
        "load.amplitude": 3.0,
        "load.steps_per_half_cycle": 12,
    }  # of .5, so that it turns at one
    history = jb.solve(SQUEEZE.replace(rigid), throw=False)
    assert history.converged
    # Two blocks and a spring: F = mu F_N L + k_b u, turned at 3.
    assert float(history.dissipation) == pytest.approx(4.0 * 2.0 * (3.0 - 2.0) / 5e3, rel=1e-3)
    assert float(history.peak_displacement) == pytest.approx(1.0 / 5e3, rel=1e-4)
    held = float(history.traction[-1] @ history.tributary)
    spring = 5e3 * float(history.slip[-1] @ history.tributary) / 2.0
    assert held + spring == pytest.approx(3.0, rel=1e-6)  # of a stiffness 7e5 times the spring's
    # Trapezoids of the work cut the corner where the blocks begin to slide: 6e-3 by 12 steps,
    # 9e-4 by 48, 5e-5 by 192.
    assert float(jnp.max(jnp.abs(history.energy_imbalance))) < 1e-2 * float(history.dissipation)


class TestBearings:
    def test_rigid_blocks_bear_after_the_clearance(self):
        bears = {"member.bearing_stiffness": 5e3, "member.clearance": 2e-4}
        rigid = {"strip.axial_stiffness": 3.4e9, "model.nodes": 25, "load.amplitude": 6e-4}
        rigid |= {"load.control": "displacement", "load.steps_per_half_cycle": 12}
        history = jb.solve(SQUEEZE.replace(rigid | bears), throw=False)
        assert history.converged
        assert float(history.force.max()) == pytest.approx(2.0 + 5e3 * (6e-4 - 2e-4), rel=1e-5)
        assert float(history.dissipation) == pytest.approx(4.0 * 2.0 * 6e-4, rel=1e-5)
        held = np.asarray(history.traction @ history.tributary)
        beyond = np.clip(np.abs(np.asarray(history.displacement)) - 2e-4, 0.0, None)
        carried = held + 5e3 * beyond * np.sign(history.displacement)
        np.testing.assert_allclose(history.force, carried, atol=1e-4)

    @pytest.mark.slow
    def test_a_bearing_stores_what_friction_does_not_lose(self):
        bears = {"member.bearing_stiffness": 2e5, "member.clearance": 2e-6}
        bears |= {"load.amplitude": 1.9, "load.steps_per_half_cycle": 400}
        history = jb.solve(library.single_lap().replace(bears))
        free = jb.solve(library.single_lap().replace({"load.amplitude": 1.9}))
        assert float(history.peak_displacement) < 0.99 * float(free.peak_displacement)
        work = float(history.dissipation)
        # In 800 steps 1.1e-5 are left as well: the loop closes within 3e-6 of its width.
        assert float(history.dissipation_loop) == pytest.approx(work, rel=2e-5)
        assert float(jnp.max(jnp.abs(history.energy_imbalance))) < 1e-4 * work


def test_where_no_pressure_acts_the_members_carry_next_to_nothing():
    ring = [[0.75, 0.0], [0.75, 40.0], [0.9, 40.0], [0.9, 0.0]]  # of a bolt, around its hole
    ring += [[1.1, 0.0], [1.1, 40.0], [1.25, 40.0], [1.25, 0.0]]
    values = {"contact.pressure": ring, "contact.bottom_pressure": ring}
    values |= {"model.section": "shell", "model.nodes": 65}
    history = jb.solve(library.single_lap().replace(values), throw=False)
    assert history.converged
    away = np.abs(np.asarray(history.x) - 1.0)
    reaction = np.asarray(history.reaction)
    assert np.sum(away < 0.09) >= 5
    assert np.all(reaction[:, away < 0.09] < 0.02 * 40.0)
    np.testing.assert_allclose(reaction[:, np.abs(away - 0.175) < 0.06], 40.0, rtol=0.05)
    pressed = reaction @ np.asarray(history.tributary)
    np.testing.assert_allclose(pressed, 12.0, rtol=0.01)  # the ends' supports carry some


def moments(amplitude, **values):
    """Single lap under a moment on its end."""
    values = {"load.kind": "moment", "load.amplitude": amplitude} | values
    return library.single_lap().replace(values)


class TestMoments:
    @pytest.mark.parametrize(
        "section",
        ["squeeze", *(pytest.param(n, marks=pytest.mark.slow) for n in ("shell", "plane"))],
    )
    def test_an_arm_adds_the_rotation_of_the_end(self, section):
        scene = library.single_lap().replace({"model.section": section, "model.nodes": 25})
        of_body = jax.jit(lambda scene: strip.condensed(scene, 25).body.c)

        def compliance(values):
            return float(of_body(scene.replace(values)))

        middle, above, below = (compliance({"load.arm": arm}) for arm in (0.0, 0.1, -0.1))
        turning = compliance({"load.kind": "moment", "load.amplitude": 1.0})
        assert above - 2.0 * middle + below == pytest.approx(2.0 * 0.1**2 * turning, rel=1e-9)
        assert above > below  # away from the contact it tilts the section more

    def test_a_moment_turns_and_a_force_pulls(self):
        @jax.jit
        def ends(scene):  # work of both loads on a unit stretch and a unit rotation
            form = section_form(scene)
            return jnp.stack([form.pull, form.turn]) @ form.modes[jnp.array([0, 2]), 1].T

        np.testing.assert_allclose(ends(SQUEEZE.pinned()), np.eye(2), atol=1e-12)

    @pytest.mark.slow
    def test_stuck_thin_members_bend_as_one_beam(self):
        errors = []
        for eta in (0.01, 0.005, 0.0025):
            values = {
                "strip.height_ratio": eta,
                "contact.friction": 5.0,
                "model.section": "squeeze",
            }
            values |= {"contact.pressure": 10.0, "contact.bottom_pressure": 10.0}
            scene = moments(1e-4, **values, **{"member.loaded_end": "free"})
            history = jb.solve(scene, throw=False)
            stiffness = 3.4e4 / (2.0 * eta) * (4.0 * eta) ** 3 / 12.0
            turned = float(history.peak_displacement) * stiffness / (1e-4 * 2.0)
            errors.append(turned - 1.0)
        ratios = np.array(errors[:-1]) / errors[1:]
        np.testing.assert_allclose(ratios, 2.0, rtol=0.05)  # the end is softer by some heights

    @pytest.mark.slow
    def test_a_moment_opens_the_joint_and_dissipates(self):
        history = jb.solve(moments(1.0, **{"load.steps_per_half_cycle": 400}))
        loop, work = float(history.dissipation_loop), float(history.dissipation)
        assert loop == pytest.approx(work, rel=1e-3)
        assert work > 0.0
        turn, stop = history.cycles[-1][1:]
        open_ends = [float(history.x[history.touching[at]][-1]) for at in (turn, stop)]
        assert open_ends[1] < open_ends[0]  # a positive moment opens
        assert history.plot().get_xlabel() == "rotation of the end  [rad]"
        assert "dissipation_ratio" not in history.figures()
        assert f"{float(history.peak_displacement):.6g}  [rad]" in str(history)
        joint = Joint.of(moments(0.3))
        assert np.isinf(joint.capacity)
        assert float(joint.dissipation(joint.displacements[-1])) == pytest.approx(
            float(jb.solve(moments(0.3)).dissipation), rel=0.02
        )


BEND = [[0.0, 0.0], [1.0, 2e-5], [2.0, 8e-5]]  # of a member that is curved


class TestGap:
    def test_what_is_open_is_lifted_and_the_gap_besides(self):
        random, gap = np.random.default_rng(0), np.array([0.1, 0.0, 0.3])
        hessian, upper, lower = random.standard_normal((3, 8, 8))
        members = Members(None, hessian, Pair(None, None, upper, lower))
        _, found, moved = over_gap(members, jnp.asarray(gap))
        opening = np.append(random.standard_normal(7), 1.0)  # v, w + gap, load, pressure
        lift = opening.copy()
        lift[1:6:2] -= gap
        assert float(opening @ found @ opening) == pytest.approx(lift @ hessian @ lift, rel=1e-12)
        np.testing.assert_allclose(moved.upper @ opening, upper @ lift, rtol=1e-12)
        np.testing.assert_allclose(moved.lower @ opening, lower @ lift, rtol=1e-12)

    @pytest.mark.slow
    def test_a_member_that_is_free_settles_over_an_even_gap(self):
        flat, above = (jb.solve(SQUEEZE.replace({"member.gap": g})) for g in (None, 1e-3))
        assert float(above.dissipation) == pytest.approx(float(flat.dissipation), rel=1e-7)
        lowered = above.w - above.member[..., 1]
        np.testing.assert_allclose(lowered + 1e-3, above.gap, atol=1e-12)

    @pytest.mark.slow
    @pytest.mark.parametrize("assembly", ["frictional", "frictionless"])
    def test_derivatives_in_gap_and_bolt_forces_have_slope_two(self, assembly):
        values = {"member.assembly": assembly, "member.gap": BEND}
        bolts = jnp.array([[0.7, 12.0, 0.4], [1.3, 12.0, 0.4]])
        values |= {"model.nodes": 65, "load.steps_per_half_cycle": 2, "load.cycles": 1}
        scene = library.single_lap().replace({"model.section": "squeeze"} | values)
        scene = scene.replace({"contact.bolts": bolts}).pinned()

        def work(numbers):
            size, one, other = numbers
            forces = bolts.at[:, 1].set(jnp.stack([one, other]))
            new = {
                "member.gap": jnp.asarray(BEND) * jnp.stack([jnp.ones(()), size]),
                "contact.bolts": forces,
            }
            return jb.solve(scene.replace(new), throw=False).dissipation

        at, way = jnp.array([1.0, 12.0, 11.0]), jnp.array([0.5, 1.0, -2.0])
        along = jax.jit(lambda x: jax.jvp(work, (x,), (way,)))
        value, slope = along(at)
        errors = [abs(along(at + h * way)[0] - value - h * slope) for h in (4e-3, 2e-3)]
        assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.4)

    def test_bolts_are_patches_of_pressure_on_both_faces(self):
        rows = [[0.5, 8.0, 0.4], [1.5, 6.0, 0.3]]
        lap = SQUEEZE.replace({"member.support": "clamped", "contact.bolts": rows})
        np.testing.assert_allclose(lap.contact.bolts, rows)
        np.testing.assert_array_equal(lap.contact.bottom_pressure, lap.contact.pressure)
        assert float(SQUEEZE.replace({"contact.bolts": rows}).contact.bottom_pressure) == 0.0


def test_a_single_lap_beyond_its_gross_slip_is_told():
    with pytest.raises(jb.UnconvergedError, match="all of the contact slides"):
        jb.solve(BOLTED_SHELL.replace({"member.loaded_end": "level", "load.amplitude": 1.99} | FEW))


def test_a_saved_joint_is_read_again(tmp_path):
    history = jb.solve(SQUEEZE)
    history.save(tmp_path / "joint.npz")
    again = jb.read_history(tmp_path / "joint.npz")
    np.testing.assert_array_equal(again.member, history.member)
    assert again.figures() == history.figures()


def test_plane_members_are_computed_in_double_precision():
    expected = float(jb.solve(library.double_shear().replace(FEW)).dissipation)
    with jax.enable_x64(False):
        found = jb.solve(library.double_shear().replace(FEW))
    assert found.force.dtype == np.float32
    assert float(found.dissipation) == pytest.approx(expected, rel=1e-6)
