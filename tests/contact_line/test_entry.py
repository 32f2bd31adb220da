"""How the force enters: beside finite elements, limits, energy, derivatives, refusals."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import FEW, PLANE, SQUEEZE
from toy import rows_of

import jbeamshell as jb
from jbeamshell.contact_line import entry
from jbeamshell.contact_line.ends import beyond, compliance, end_section
from jbeamshell.mechanics.layered import Material, layered_form
from jbeamshell.scene import library
from jbeamshell.scene.keys import ENTRIES

FIGURES = ("dissipation", "secant_stiffness", "slip_length", "peak_displacement")
NUMBERS = ("strip.height_ratio", "contact.friction", "load.amplitude")
QUICK = ["member", "guided"]  # the force of a part that goes on, and of a held end
SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("face", "traction")]
H = 0.1126  # half the height of the default strip


def elements(name):
    """Rows of the finite elements of an entry, of a member that goes on by 4 H."""
    rows = [row for of, row in rows_of("entry.csv", "entry") if of == name]
    return [
        row for row in rows if row["overhang_over_H"] in (0.0, 4.0) and row["D_over_bar"] > 1e-3
    ]


@functools.cache
def response(name, nodes):
    scene = PLANE.replace({"load.entry": name, "model.nodes": nodes})
    return jb.response(scene, NUMBERS, ("dissipation", "secant_stiffness"))


def off(name, row, nodes):
    """Relative errors of dissipation and stiffness beside the finite elements."""
    found = response(name, nodes)(row["eta"], row["mu"], row["A"])
    return (
        float(found["dissipation"]) / row["D"] - 1.0,
        float(found["secant_stiffness"]) / row["K_conjugate"] - 1.0,
    )


class TestElements:
    @pytest.mark.parametrize("name", ENTRIES)
    def test_a_strip_on_few_nodes(self, name):
        rows = [r for r in elements(name) if (r["mu"], r["A"]) in {(0.1, 0.4359), (0.3, 3.0)}]
        assert len(rows) >= 5
        for row in rows:
            numbers = dict(zip(NUMBERS, (row["eta"], row["mu"], row["A"]), strict=True))
            run = jb.solve(PLANE.replace({"load.entry": name} | numbers), throw=False)
            assert float(run.dissipation) == pytest.approx(row["D"], rel=0.02)
            assert float(run.secant_stiffness) == pytest.approx(row["K_conjugate"], rel=0.003)

    @pytest.mark.slow
    @pytest.mark.parametrize("name", ENTRIES)
    def test_every_strip(self, name):
        rows = elements(name)
        errors = np.array([off(name, row, 129) for row in rows])
        assert len(rows) >= 45
        # Where slip is .035 H long, and D .4 % of a bar's, it is .69 % off; the others .43 at most.
        assert np.all(np.abs(errors) < [0.0075, 0.002])

    def test_the_edge_opens_as_far(self):
        (row,) = (r for r in elements("member") if (r["eta"], r["mu"], r["A"]) == (H, 0.1, 0.7855))
        history = jb.solve(PLANE, throw=False)
        opened = np.sum((history.w[history.pressed + 1 :] > 0.0) * history.tributary, axis=1)
        assert float(np.max(opened)) == pytest.approx(row["open_length"], rel=0.1)


@functools.partial(jax.jit, static_argnames="forwards")
def layers_beyond(lengths, forwards=True):
    """End of an unlike pair of layers that goes on; its compliances alone, and its signs."""
    thickness, stiffness = jnp.array([0.3, 0.7]), jnp.array([2.0, 5.0])
    form = layered_form(Material(thickness, stiffness, 0.4 * stiffness, 0.3 * stiffness))
    end = beyond(form, lengths, end_section(form, on_contact=False), forwards)
    own = compliance(form, form.pull, bends=False), compliance(form, form.pull)
    return end, own, jnp.where(jnp.asarray(form.held), -1.0, 1.0)


class TestBeyond:
    def test_two_half_heights_are_enough(self):
        """Dissipation over the length beyond, beside that of the default (see `entry.REACH`)."""
        scene = PLANE.replace({"load.amplitude": 0.2})
        whole = float(jb.solve(scene, throw=False).dissipation)
        parts = [
            float(jb.solve(scene.replace({"strip.overhang": n * H}), throw=False).dissipation)
            / whole
            for n in (0.5, 1.0, 2.0, 16.0)
        ]
        assert np.all(np.diff(parts) > 0.0)
        assert parts[0] < 0.75
        np.testing.assert_allclose(parts[2:], 1.0, rtol=1e-3)

    def test_a_given_length_adds_its_stretch(self):
        scene = PLANE.replace({"load.amplitude": 0.4359})
        longer = jb.solve(scene.replace({"strip.overhang": 2.0}), throw=False)
        added = 1.0 / longer.secant_stiffness - 1.0 / jb.solve(scene, throw=False).secant_stiffness
        assert float(added) == pytest.approx(2.0 / 3.4e4, rel=1e-3)

    def test_a_long_part_of_a_layered_section_stretches_and_bends_as_it_should(self):
        (short, (straight, bent), _), (long, *_) = (
            layers_beyond(np.full(160, length / 160)) for length in (4.0, 6.0)
        )
        added = float(long.softness) - float(short.softness)
        # The end turns, too: what is added is that of the force and of its moment.
        assert added > 2.0 * float(straight)
        np.testing.assert_allclose(added, 2.0 * float(bent), rtol=1e-4)

    def test_both_directions_are_mirror_images(self):
        lengths = np.array([0.01, 0.05, 0.3])
        (one, _, mirror), (other, *_) = (layers_beyond(lengths, f) for f in (True, False))
        mirror, stiffness = np.asarray(mirror), np.asarray(one.stiffness)
        np.testing.assert_allclose(  # u_x turns round, u_y stays
            stiffness, mirror[:, None] * other.stiffness * mirror, atol=1e-6 * stiffness.max()
        )
        np.testing.assert_allclose(one.softness, other.softness, rtol=1e-9)


class TestSections:
    def test_a_straight_section_has_a_rigid_face_by_nature(self):
        runs = [jb.solve(SQUEEZE.replace({"load.entry": name}), throw=False) for name in ENTRIES]
        member, face, guided, traction = (float(run.dissipation) for run in runs)
        assert member == face == traction
        assert guided > 1.02 * face

    @pytest.mark.slow
    @pytest.mark.parametrize("name", ["face", "guided"])
    def test_load_steps_and_the_contact_line_agree(self, name):
        """The end of the beamshell is held alike in both."""
        few = {"load.entry": name, "model.kinematics": "linear", "model.section": "squeeze"}
        few |= {"contact.stick_stiffness": 50.0, "load.steps_per_half_cycle": 20}
        scene = jb.Scene().replace(few).on_grid(17, 1.0 / 6.0)
        line, steps = (jb.solve(scene, throw=False, by=by) for by in (None, "steps"))
        assert line.scene.plan.on_contact_line
        assert not steps.scene.plan.on_contact_line
        assert float(steps.dissipation) == pytest.approx(float(line.dissipation), rel=0.02)
        # Slip spreads evenly on the contact line; in load steps nodes slip whole.
        assert float(steps.secant_stiffness) == pytest.approx(
            float(line.secant_stiffness), rel=1e-2
        )


class TestJoints:
    @pytest.mark.parametrize(
        "scene",
        [library.double_shear(), pytest.param(library.single_lap(), marks=pytest.mark.slow)],
        ids=["double shear", "single lap"],
    )
    def test_members_that_go_on_are_those_with_overhangs(self, scene):
        """The default goes on by 2 H; lengths that are given add their stretch alone."""
        scene = scene.replace(FEW | {"load.entry": "member"})
        short = jb.solve(scene, throw=False)
        given = {"strip.overhang": 2.0 * H, "member.overhang": 2.0 * H}
        longer = jb.solve(scene.replace(given), throw=False)
        assert float(longer.dissipation) == pytest.approx(float(short.dissipation), rel=2e-3)
        added = 1.0 / longer.secant_stiffness - 1.0 / short.secant_stiffness
        assert float(added) == pytest.approx(4.0 * H / 3.4e4, rel=2e-3)

    def test_members_are_pressed_evenly_before_they_are_mounted(self):
        """Else the edge of each member presses into the other one, which goes on there."""
        given = {"strip.overhang": 0.5, "member.overhang": 0.5}
        joint = library.double_shear().replace(FEW | given)
        even, edged = (
            np.asarray(run.reaction[run.pressed])
            for run in (
                jb.solve(joint.replace({"load.entry": name}), throw=False)
                for name in ("member", "traction")
            )
        )
        np.testing.assert_allclose(even, 10.0, rtol=1e-5)
        assert np.max(edged) > 20.0


class TestEnergy:
    @pytest.mark.parametrize("name", QUICK + SLOW)
    def test_the_loop_holds_the_work_of_friction(self, name):
        values = {"load.entry": name, "load.amplitude": 0.4359}
        run = jb.solve(PLANE.replace(values | {"load.steps_per_half_cycle": 400}), throw=False)
        assert float(run.dissipation_loop) == pytest.approx(float(run.dissipation), rel=1e-4)
        work = float(run.secant_stiffness * run.peak_displacement**2)
        assert float(np.max(np.abs(run.energy_imbalance))) < 1e-4 * work


class TestDisplacement:
    @pytest.mark.parametrize("name", QUICK + SLOW)
    def test_what_the_entry_names_is_driven(self, name):
        """A displacement that a force has made takes that force."""
        steps = {"load.steps_per_half_cycle": 40}
        scene = PLANE.replace({"load.entry": name} | steps)
        pulled = jb.solve(scene, throw=False)
        path = np.asarray(pulled.displacement[pulled.pressed + 1 :])
        size = {"load.control": "displacement", "load.amplitude": float(np.max(path))}
        driven = jb.solve(scene.replace(size), path, throw=False)
        # Slip spreads evenly over the load, or over the displacement.
        np.testing.assert_allclose(
            driven.force[-path.size :], pulled.force[-path.size :], atol=3e-4 * 0.7855
        )


def test_one_state_serves_where_the_ends_are_the_same():
    assert entry.states(PLANE) == (False, True)
    assert entry.states(PLANE.replace({"load.entry": "face"})) == (True,)
    assert entry.states(
        jb.Scene().replace({"model.section": "squeeze", "model.kinematics": "linear"})
    ) == (True,)
