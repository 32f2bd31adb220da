"""Modes of bodies on a face: closed forms, and the frequency and damping of a bolted lap."""

import functools

import numpy as np
import pytest
import scipy.linalg

import jbeamshell as jb
from tests.contact_face.bricks import box

LENGTH, HEIGHT = 60.0, 5.0


def at_bottom(places):
    return places[:, 2] == 0.0


def face_of(places, height):
    on_face = np.flatnonzero(np.isclose(places[:, 2], height))
    return np.column_stack([on_face + 1, places[on_face]])


def bolt(places, height, sign):
    """Unit force on the nodes at a height around the middle."""
    near = np.isclose(places[:, 2], height) & (np.abs(places[:, 0] - 0.5 * LENGTH) < 11.0)
    nodes = np.flatnonzero(near) + 1
    return np.column_stack([nodes, np.full(nodes.size, 3), np.full(nodes.size, sign / nodes.size)])


@functools.cache
def leaves():
    """Two leaves on each other, held at X = 0 and bolted in the middle, and their bodies."""
    clamped = {"held": lambda places: places[:, 0] == 0.0}
    (above, p), (below, q) = (
        box((6, 2, 1), (LENGTH, 20.0, HEIGHT), at=(0.0, 0.0, z), **clamped) for z in (HEIGHT, 0.0)
    )
    upper = jb.FacePart(above, face_of(p, HEIGHT)[3:], [bolt(p, 2.0 * HEIGHT, -1.0)])
    lower = jb.FacePart(below, face_of(q, HEIGHT)[3:], [bolt(q, 0.0, 1.0)])
    return upper, lower, jb.modal_bodies(upper, lower, friction=0.2, bolts=2e3)


OPTIONS = {"friction": 0.2, "bolts": 2e3, "steps_per_half_cycle": 16}


class TestBricks:
    def test_rigid_motions_cost_nothing_and_weigh_what_the_box_weighs(self):
        model, places = box((2, 2, 1), (4.0, 3.0, 2.0))
        along = np.tile([1.0, 0.0, 0.0], len(places))
        turn = np.cross([0.0, 0.0, 1.0], places).ravel()
        for motion in (along, turn):
            assert motion @ (model.matrix @ motion) == pytest.approx(0.0, abs=1e-6)
        assert along @ (model.mass @ along) == pytest.approx(7.85e-9 * 24.0, rel=1e-12)


class TestModes:
    def test_bodies_without_slip_have_the_frequency_of_their_mode(self):
        *_, bodies = leaves()
        curve = jb.face_curve(bodies, [1e-9], **OPTIONS, throw=False)
        assert float(curve.frequency[0]) == pytest.approx(bodies.omega / (2 * np.pi), rel=1e-3)

    def test_all_pairs_tied_are_one_body(self):
        whole, _ = box(
            (6, 2, 2), (LENGTH, 20.0, 2 * HEIGHT), held=lambda places: places[:, 0] == 0.0
        )
        upper, lower, _ = leaves()
        pressed = [
            part._replace(press=[np.column_stack([rows[:, 0], np.full(len(rows), 3), force])])
            for part, rows, force in (
                (upper, upper.nodes, np.full(len(upper.nodes), -1.0)),
                (lower, lower.nodes, np.full(len(lower.nodes), 1.0)),
            )
        ]
        bodies = jb.modal_bodies(*pressed, friction=0.2)
        assert bodies.touching.all()
        k, m = whole.matrix.toarray(), whole.mass.toarray()
        assert bodies.omega**2 == pytest.approx(scipy.linalg.eigvalsh(k, m)[0], rel=1e-8)

    def test_slip_makes_a_mode_softer_and_its_damping_has_a_peak(self):
        *_, bodies = leaves()
        curve = jb.face_curve(bodies, [2e-5, 1e-4, 3e-4], **OPTIONS, throw=False)
        assert np.all(np.diff(curve.frequency) < 0.0)
        low, peak, high = map(float, curve.damping)
        assert 0.0 < low < 0.2 * peak
        assert high < peak  # once all of it slides, only the elastic energy grows
        assert "modal displacement" in str(curve)

    def test_a_model_without_mass_is_refused(self):
        upper, lower, _ = leaves()
        model = jb.StiffnessModel(upper.model.matrix, upper.model.dofs)
        with pytest.raises(jb.InputError, match="mass="):
            jb.modal_bodies(upper._replace(model=model), lower)
