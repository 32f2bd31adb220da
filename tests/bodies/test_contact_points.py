"""Contact points on elements: even pressures over meshes that do not match, and what is refused."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from calibration.finite_elements.boxes import box, side, two_blocks
from jbeamshell.bodies.coarser_mesh import coarser_of_body
from jbeamshell.bodies.contact_points import contact_points

COARSE, OTHER = (4, 2, 1), (5, 3, 1)
LOAD = {"friction": 0.25, "bolts": 12e3, "amplitude": 2300.0}
SHORT = {"cycles": 2, "steps_per_half_cycle": 8, "throw": False}


@functools.cache
def blocks(upper=COARSE, lower=None, quadratic=False):
    return two_blocks(upper, lower, quadratic)


@functools.cache
def loop(upper=COARSE, lower=None, quadratic=False):
    return jb.solve_contact(*blocks(upper, lower, quadratic), **LOAD, **SHORT)


def triangles(elements):
    """Two triangles for each quadrilateral of a face."""
    return [(row[k], row[(k + 1) % 4], row[(k + 2) % 4]) for row in elements for k in (0, 2)]


def changed(body, **changes):
    """Body of other places or elements."""
    given = {
        name: getattr(body, name)
        for name in ("places", "stiffness", "forces", "flexibility", "normals", "elements")
    }
    return jb.Substructure(**given | changes)


class TestPressure:
    @pytest.mark.parametrize("quadratic", [False, True])
    @pytest.mark.parametrize("cut", [False, True])
    def test_an_even_pressure_gives_both_meshes_their_nodal_forces(self, quadratic, cut):
        upper, lower = blocks(COARSE, OTHER if cut else None, quadratic)
        if not quadratic and cut:
            lower = changed(lower, elements=triangles(lower.elements))
        made = contact_points(upper, lower, False)
        assert np.sum(made.areas) == pytest.approx(1800.0, rel=1e-12)
        for body, shares in ((upper, made.upper), (lower, made.lower)):
            found = np.zeros(len(body.places))
            np.add.at(found, shares.nodes, shares.values * made.areas[:, None])
            nodes = np.column_stack([np.arange(len(found)), body.places])
            expected = jb.face_surface(nodes, body.elements).areas
            np.testing.assert_allclose(found, expected, atol=1e-9 * np.max(expected))
            there = np.einsum("qk,qkx->qx", shares.values, np.asarray(body.places)[shares.nodes])
            np.testing.assert_allclose(there, made.places, atol=1e-9)

    @pytest.mark.parametrize(("lower", "quadratic"), [(OTHER, False), (None, True)])
    def test_it_passes_from_mesh_to_mesh(self, lower, quadratic):
        # Without Poisson's ratio nothing but the pressure acts.
        bodies = []
        for counts, height in ((COARSE, 0.0), (lower or COARSE, -15.0)):
            sizes = (60.0, 30.0, 15.0)
            model, places = box(
                counts,
                sizes,
                at=(0.0, 0.0, height),
                poisson=0.0,
                quadratic=quadratic,
                held=lambda places: places[:, 2] == -15.0,
            )
            face, elements = side(places, 2, 0.0, quadratic)
            outer, tops = side(places, 2, 15.0 + 2.0 * height, quadratic)
            rows = [[int(face[0, 0]), 3, 0.0]]
            if height == 0.0:
                areas = jb.face_surface(outer, tops).areas
                rows = np.column_stack([outer[:, 0], np.full(len(areas), 3), -areas])
            pull = [[int(face[0, 0]), 1, 1.0]] if height == 0.0 else None
            bodies.append(model.condensed(face, elements=elements, press=[rows], pull=pull))
        history = jb.solve_contact(*bodies, friction=0.3, bolts=7.0, path=np.zeros(1))
        np.testing.assert_allclose(history.reaction, 7.0, rtol=1e-7)
        np.testing.assert_allclose(history.traction, 0.0, atol=1e-7)
        np.testing.assert_allclose(history.gap, 0.0, atol=1e-4 * 7.0 / 210e3)


class TestCoarser:
    @pytest.mark.parametrize("shape", [(6, 3, 2), (5, 4, 1)])
    def test_displacements_that_are_linear_are_those_of_the_nodes_that_stay(self, shape):
        upper, _ = blocks(shape)
        mesh = coarser_of_body(upper, np.zeros(len(upper.places), bool))
        slopes = np.random.default_rng(1).normal(size=(3, 3))
        moved = (np.asarray(upper.places) @ slopes).reshape(-1, 3)
        found = mesh.moves @ moved[mesh.kept].ravel()
        np.testing.assert_allclose(found, moved.ravel(), atol=1e-9 * np.max(np.abs(moved)))
        assert len(mesh.kept) <= 0.6 * len(moved)

    def test_nodes_that_supports_hold_stay(self):
        upper, _ = blocks((6, 3, 2))
        held = np.random.default_rng(2).random(len(upper.places)) < 0.3
        kept = coarser_of_body(upper, held).kept
        assert set(np.flatnonzero(held)) <= set(kept.tolist())


class TestMeshes:
    def test_meshes_that_do_not_match_find_what_those_do_that_match(self):
        one, other = loop(), loop(COARSE, OTHER)
        assert other.gap.shape[1] > one.gap.shape[1]
        stiffness = float(one.stuck_stiffness), float(other.stuck_stiffness)
        assert stiffness[1] == pytest.approx(stiffness[0], rel=0.02)
        assert float(one.gross_slip) == pytest.approx(3000.0, rel=1e-9)
        assert float(other.gross_slip) == pytest.approx(3000.0, rel=1e-9)
        lost = float(one.dissipation), float(other.dissipation)
        assert abs(lost[1] - lost[0]) < float(one.mesh_error) * lost[0]

    def test_quadratic_elements_come_nearer_to_the_truth(self):
        # The truth is from 12 x 6 x 3 quadratic bricks, 648 points.
        truth = 0.1825
        linear, quadratic = loop(), loop(quadratic=True)
        errors = [abs(float(each.dissipation) / truth - 1.0) for each in (linear, quadratic)]
        assert errors[1] < 0.4 * errors[0]
        assert errors[1] < 0.4

    def test_the_error_of_the_mesh_holds_the_truth_and_is_said(self):
        history = loop(quadratic=True)
        lost = float(history.dissipation)
        off = abs(lost - 0.1825) / lost
        assert off < float(history.mesh_error) < 5.0 * off
        assert any("the mesh may put the dissipation off by" in said for said in history.doubts)
        assert "mesh error" in str(history)
        grading = history.grading
        assert 6 in grading.elements[:2] or 7 in grading.elements[:2]  # next to the pulled end
        assert grading.share > 0.8
        assert grading.left < float(history.mesh_error)


class TestLoads:
    def test_a_prescribed_displacement_leaves_the_load_free_while_pressing(self):
        made = blocks()
        whole = loop()
        reach = float(jnp.max(jnp.abs(whole.displacement)))
        options = {"friction": 0.25, "bolts": 12e3, "control": "displacement"}
        history = jb.solve_contact(*made, amplitude=4.0 * reach, **options, **SHORT)
        assert float(history.force[0]) == 0.0
        start, turn, _ = history.cycles[-1]
        forces = np.asarray(history.force)
        assert forces[start] == pytest.approx(3000.0, rel=1e-3)  # all of it slides
        assert forces[turn] == pytest.approx(-3000.0, rel=1e-3)

    def test_cycles_go_on_until_the_slip_of_one_ends_where_it_began(self):
        history = jb.solve_contact(*blocks(), **LOAD, steps_per_half_cycle=8, throw=False)
        slip, left = history.slip, []
        for begin, _, end in history.cycles:
            apart = np.max(np.abs(slip[end] - slip[begin]))
            left.append(apart / np.max(np.ptp(slip[begin : end + 1], axis=0)))
        assert len(left) == 3
        assert left[-1] < 3e-3 < left[-2]

    def test_a_traced_call_takes_the_cycles_of_a_plain_one(self):
        made = blocks()

        def lost(friction):
            load = LOAD | {"friction": friction}
            history = jb.solve_contact(*made, **load, steps_per_half_cycle=8, throw=False)
            return history.dissipation

        assert float(jax.jit(lost)(0.25)) == pytest.approx(float(lost(0.25)), rel=1e-9)

    @pytest.mark.slow
    def test_derivatives_are_those_of_differences(self):
        upper, lower = blocks()

        @jax.jit
        def lost(numbers):
            body = eqx.tree_at(lambda b: b.stiffness, upper, upper.stiffness * numbers[1])
            load = LOAD | {"friction": 0.25 * numbers[0], "amplitude": 2300.0 * numbers[2]}
            return jb.solve_contact(body, lower, **load, **SHORT).dissipation

        slopes = jax.jit(jax.grad(lost))(jnp.ones(3))
        for k, step in enumerate(1e-5 * np.eye(3)):
            there, back = float(lost(1.0 + step)), float(lost(1.0 - step))
            assert float(slopes[k]) == pytest.approx((there - back) / 2e-5, rel=1e-6)


class TestRefusals:
    @pytest.mark.parametrize(
        ("change", "words"),
        [
            ({"places": [0.0, 0.0, 2.5]}, r"upper.elements\[0\] at 7.5, 7.5, 0: lies .* off lower"),
            ({"places": [30.0, 0.0, 0.0]}, r"upper.elements\[\d+\] at .*% of its area|0 %"),
            ({"normals": [0.0, 0.0, -1.0]}, "faces away"),
            ({"elements": slice(0, -2)}, r"upper.elements\[\d+\] at .*of its area"),
        ],
    )
    def test_faces_that_do_not_meet_are_refused(self, change, words):
        upper, lower = blocks(COARSE, OTHER)
        if "places" in change:
            given = {"places": lower.places + np.array(change["places"])}
        elif "normals" in change:
            rows = [row[::-1] for row in lower.elements]
            given = {"normals": change["normals"], "elements": rows}
        else:
            given = {"elements": lower.elements[change["elements"]]}
        with pytest.raises(jb.InputError, match=words):
            contact_points(upper, changed(lower, **given), False)

    def test_elements_name_nodes_that_are_there(self):
        upper, _ = blocks()
        with pytest.raises(jb.InputError, match=r"elements\[0\] = "):
            changed(upper, elements=[(0, 1, 2, 99)])

    def test_a_file_keeps_the_elements(self, tmp_path):
        upper, _ = blocks()
        upper.save(tmp_path / "upper.npz")
        assert jb.Substructure.read(tmp_path / "upper.npz").elements == upper.elements


def test_doubts_are_told_where_the_library_was_called():
    with pytest.warns(jb.DoubtfulWarning) as told:
        jb.solve_contact(*blocks(), **LOAD, cycles=2, steps_per_half_cycle=8)
    assert {warning.filename for warning in told} == {__file__}
