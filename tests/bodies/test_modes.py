"""Modes of bodies on a face: closed forms, and the frequency and damping of a bolted lap."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize

import jbeamshell as jb
from calibration.finite_elements.boxes import box

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
COARSE = {"steps_per_half_cycle": 8, "cycles": 1, "throw": False}


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
        assert str(bodies).startswith(
            f"bodies pulled into a mode, {bodies.touching.size} contact points"
        )
        assert len(str(bodies)) < 300

    def test_all_pairs_tied_are_one_body(self):
        whole, _ = box(
            (6, 2, 2), (LENGTH, 20.0, 2 * HEIGHT), held=lambda places: places[:, 0] == 0.0
        )
        upper, lower, _ = leaves()
        pressed = [
            part._replace(press=[np.column_stack([rows[:, 0], np.full(len(rows), 3), force])])
            for part, rows, force in (
                (upper, upper.contact, np.full(len(upper.contact), -1.0)),
                (lower, lower.contact, np.full(len(lower.contact), 1.0)),
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

    def test_default_amplitudes_slip(self):
        """From the first pair on; below it nothing is lost, nothing negative and no error of it."""
        *_, bodies = leaves()
        curve = jb.face_curve(bodies, **COARSE)
        assert np.all(np.asarray(curve.dissipation) > 0.0)
        assert bodies.begins < curve.amplitude[0] < 0.5 * bodies.slides == 0.5 * curve.amplitude[-1]
        for part in (0.9, 0.3, 0.1, 0.03):
            stuck = jb.solve_contact(
                bodies.upper,
                bodies.lower,
                control="displacement",
                amplitude=part * bodies.begins,
                **OPTIONS,
            )
            assert float(stuck.dissipation) == float(stuck.loss_factor) == 0.0
            assert float(stuck.dissipation_error) == 0.0
            assert not [doubt for doubt in stuck.doubts if "dissipation" in doubt]

    def test_a_model_without_mass_is_refused(self):
        upper, lower, _ = leaves()
        model = jb.StiffnessModel(upper.model.matrix, upper.model.dofs)
        with pytest.raises(jb.InputError, match="mass="):
            jb.modal_bodies(upper._replace(model=model), lower)

    def test_derivatives_of_a_curve_are_those_of_differences(self):
        *_, bodies = leaves()
        amplitudes = bodies.slides * np.array([0.2, 0.5])

        def figures(numbers):
            curve = jb.face_curve(
                bodies,
                amplitudes,
                friction=numbers[0],
                bolts=numbers[1],
                **COARSE,
            )
            return jnp.concatenate([curve.frequency, curve.damping])

        start = np.array([0.2, 2e3])
        slopes = jax.jit(jax.jacfwd(figures))(start)
        for k, value in enumerate(start):
            step = 1e-4 * value * np.eye(2)[k]
            differences = (figures(start + step) - figures(start - step)) / (2e-4 * value)
            np.testing.assert_allclose(slopes[:, k], differences, rtol=2e-3)

    def test_without_a_gap_a_preload_scales_the_amplitudes_alone(self):
        # Rigid contact without a gap is homogeneous: only friction and amplitude / preload count.
        *_, bodies = leaves()
        amplitudes = bodies.slides * np.array([0.2, 0.5])
        one, three = (
            jb.face_curve(bodies, k * amplitudes, bolts=k * 2e3, **COARSE) for k in (1.0, 3.0)
        )
        np.testing.assert_allclose(three.frequency, one.frequency, rtol=1e-8)
        np.testing.assert_allclose(three.damping, one.damping, rtol=1e-6)

    def test_a_fit_finds_friction_and_preload_again(self):
        # A crowned face closes further with the preload, which tells it from friction.
        upper, lower, _ = leaves()
        gap = 2e-7 * (upper.contact[:, 1] - 0.5 * LENGTH) ** 2
        bodies = jb.modal_bodies(upper, lower, friction=0.2, bolts=2e3, gap=gap)
        amplitudes = bodies.slides * np.geomspace(0.05, 1.5, 6)

        @jax.jit
        def logarithms(numbers):
            friction, bolts = jnp.exp(numbers)
            curve = jb.face_curve(bodies, amplitudes, friction=friction, bolts=bolts, **COARSE)
            return jnp.concatenate([3e2 * jnp.log(curve.frequency), jnp.log(curve.damping)])

        planted = np.log([0.23, 2.4e3])
        measured = logarithms(planted)
        fit = scipy.optimize.least_squares(
            lambda numbers: logarithms(numbers) - measured,
            np.log([0.17, 1.7e3]),
            jac=jax.jit(jax.jacfwd(logarithms)),
        )
        np.testing.assert_allclose(fit.x, planted, atol=1e-4)


class TestReduced:
    def test_a_tied_pair_has_the_frequency_of_the_full_one(self):
        upper, lower, full = leaves()
        found = []
        for modes in (0, 5, 20):
            parts = [
                part._replace(model=part.model.reduced(loaded(part), modes))
                for part in (upper, lower)
            ]
            found.append(jb.modal_bodies(*parts, friction=0.2, bolts=2e3).omega / full.omega - 1.0)
        assert found[0] > found[1] > found[2] > -1e-9  # a reduced body is stiffer
        assert found[2] < 1e-4

    def test_loads_on_what_is_kept_have_exact_displacements(self):
        part, _, _ = leaves()
        small = part._replace(model=part.model.reduced(loaded(part), 3))
        pull = part.press[0]
        one, other = (each._replace(pull=pull).body() for each in (part, small))
        for name in ("stiffness", "forces", "flexibility"):
            there = np.asarray(getattr(one, name))
            ours = np.asarray(getattr(other, name))
            np.testing.assert_allclose(ours, there, atol=1e-9 * np.max(np.abs(there)))

    def test_all_modes_have_all_frequencies(self):
        model, places = box((2, 1, 1), (4.0, 3.0, 2.0), held=lambda places: places[:, 0] == 0.0)
        nodes = np.flatnonzero(places[:, 0] == 4.0) + 1
        small = model.reduced(nodes, 11)  # of 12 inside
        k, m = (np.asarray(each.todense()) for each in (small.matrix, small.mass))
        whole = scipy.linalg.eigvalsh(model.matrix.toarray(), model.mass.toarray())
        np.testing.assert_allclose(scipy.linalg.eigvalsh(k, m)[:6], whole[:6], rtol=1e-3)

    @pytest.mark.parametrize(
        ("change", "words"),
        [
            (lambda model: model.reduced([10**6]), "nodes = node 1000000"),
            (lambda model: model.reduced(model.dofs[:3, 0], 10**4), "modes = 10000"),
            (lambda model: jb.StiffnessModel(model.matrix, model.dofs).reduced([1]), "mass = None"),
        ],
    )
    def test_bad_input_names_its_key(self, change, words):
        with pytest.raises(jb.InputError, match=words):
            change(leaves()[0].model)


def loaded(part):
    """Nodes of the face and those that the bolt presses."""
    return np.concatenate([part.contact[:, 0], part.press[0][:, 0]]).astype(int)
