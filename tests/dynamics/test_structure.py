"""Structures with joints: Iwan's network, modes over amplitude, transients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.sparse
from toy import STRIP

import jbeamshell as jb
from jbeamshell import dynamics
from jbeamshell.dynamics.structure.joint import Joint
from jbeamshell.dynamics.structure.matrices import Attachment, Structure
from jbeamshell.dynamics.structure.modal import modal_curve

U = np.geomspace(0.02, 4.0, 40)
JOINT = Joint(U, np.tanh(U), capacity=1.0)
# The cubic law: F = sqrt(2 u), D = (2/3) F^3 for unit stiffness and friction.
FINE = np.linspace(0.0, 1.0, 401)[1:] ** 2 / 2.0
BAR = Joint(FINE, np.sqrt(2.0 * FINE))

PLANE = jb.Scene().replace({"model.section": "plane", "model.nodes": 33, "load.entry": "traction"})
LOADS = [0.5, 1.0, 0.6, -0.2, -0.6, -0.2, 0.2, -0.3, -0.6, -1.0, -0.5, 0.0, 0.5, 1.0, 1.1]


def chain(count=2, joint=JOINT, sparse=False):
    """Structure of equal masses on equal springs, of which the joint holds the first."""
    stiffness = 3.0 * (2.0 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1))
    stiffness[0, 0] = stiffness[-1, -1] = 3.0
    mass = np.eye(count)
    if sparse:
        stiffness, mass = map(scipy.sparse.csr_array, (stiffness, mass))
    return Structure(mass, stiffness, [Attachment(joint, 0)])


class TestJoint:
    def test_the_network_has_the_backbone_and_masings_loop(self):
        up, down = np.linspace(0.0, 1.7, 120), np.linspace(1.7, -1.7, 240)
        forces = JOINT.path_forces(np.concatenate([up, down, -down]))
        assert np.allclose(forces[:120], JOINT.backbone(up), rtol=0.0, atol=1e-14)
        branch = float(JOINT.backbone(1.7)) - 2.0 * np.asarray(JOINT.backbone(0.5 * (1.7 - down)))
        assert np.allclose(forces[120:360], branch, rtol=0.0, atol=1e-13)
        loop, path = forces[119:], np.concatenate([up[-1:], down, -down])
        area = np.trapezoid(loop, path)
        assert area == pytest.approx(float(JOINT.dissipation(1.7)), rel=1e-3)
        work = np.trapezoid(JOINT.backbone(fine := np.linspace(0.0, 1.7, 20001)), fine)
        assert float(JOINT.work(-1.7)) == pytest.approx(work, rel=1e-6)
        masing = 8.0 * work - 4.0 * 1.7 * float(JOINT.backbone(1.7))
        assert float(JOINT.dissipation(1.7)) == pytest.approx(masing, rel=1e-6)

    def test_a_bars_energy_per_cycle_is_goodmans(self):
        u = jnp.array([0.05, 0.2, 0.45])
        assert np.allclose(BAR.dissipation(u), 2.0 / 3.0 * (2.0 * u) ** 1.5, rtol=1e-3)
        first = BAR.first_harmonic(u)
        assert np.allclose(np.pi * first.imag * u**2, BAR.dissipation(u), rtol=1e-12)
        assert np.all(np.diff(first.real) < 0.0)
        stuck = complex(JOINT.first_harmonic(jnp.asarray(0.01)))
        assert stuck == pytest.approx(float(JOINT.stiffness), rel=1e-6)

    def test_a_strips_loops_are_its_own(self):
        """The path of the displacement gives back any path of nested reversals of the force."""
        joint = Joint.of(PLANE, 1.2).times(3.0)
        history = jb.solve(PLANE, LOADS)
        u = np.asarray(history.displacement - history.displacement[history.pressed])[-len(LOADS) :]
        # A loop within a loop closes where its load comes back; driven by u, where its u does.
        np.testing.assert_allclose(joint.path_forces(u), 3.0 * np.array(LOADS), atol=0.01)

    @pytest.mark.filterwarnings("ignore::jbeamshell.DoubtfulWarning")  # the grid of tests is coarse
    @pytest.mark.parametrize("entry", ["traction", "member"])
    def test_a_strips_cycles_are_its_own(self, entry):
        """Short slip, a tall strip: the nodes' own thresholds would be off by factors."""
        tall = {"strip.height_ratio": 0.34, "contact.friction": 0.2, "strip.poisson_ratio": 0.16}
        scene = PLANE.replace(tall | {"load.entry": entry, "load.amplitude": 1.05})
        joint = Joint.of(scene).times(3.0)
        assert float(joint.forces[-1]) == pytest.approx(3.15)
        own = jb.response(scene, ["load.amplitude"], ["dissipation", "secant_stiffness"])
        for part in (1.0, 0.6, 0.1):
            found = own(part * 1.05)
            u = joint.displacement(3.0 * part * 1.05)
            loss, stiffness = float(found["dissipation"]), float(found["secant_stiffness"])
            assert float(joint.dissipation(u)) == pytest.approx(3.0 * loss, rel=0.015)
            assert 3.0 * part * 1.05 / float(u) == pytest.approx(3.0 * stiffness, rel=5e-3)

    def test_a_spring_in_series_adds_its_displacement(self):
        springy = JOINT.in_series(2.0)
        force = jnp.array([0.1, 0.5, 0.9])
        u = jnp.interp(force, JOINT.forces, JOINT.displacements)
        np.testing.assert_allclose(springy.backbone(u + force / 2.0), force, rtol=1e-9)
        loss = JOINT.dissipation(u)
        np.testing.assert_allclose(springy.dissipation(u + force / 2.0), loss, rtol=1e-9)
        assert float(springy.stiffness) == pytest.approx(1.0 / (1.0 / float(JOINT.stiffness) + 0.5))

    @pytest.mark.slow
    @pytest.mark.parametrize("name", ["lap", "bar"])
    def test_steady_cycles_have_derivatives_to_the_scene(self, name):
        scene = jb.library.double_shear() if name == "lap" else jb.Scene()
        section = "squeeze" if name == "lap" else name
        scene = scene.replace({"model.section": section, "model.nodes": 41})
        plain = Joint.of(scene, 0.8)
        u = 0.93 * plain.displacements[-1]

        @jax.jit
        @jax.value_and_grad
        def loss(mu):
            force = 0.8 * mu / scene.contact.friction
            joint = Joint.of(scene.replace({"contact.friction": mu}), force)
            return joint.dissipation(u) / plain.dissipation(u)

        mu = float(scene.contact.friction)
        value, slope = loss(mu)
        # Rounding may choose another slider next to zero, which changes the energy by 2e-7.
        assert float(value) == pytest.approx(1.0, rel=1e-6)
        h = 1e-3 * mu
        assert float(slope) == pytest.approx(
            float(loss(mu + h)[0] - loss(mu - h)[0]) / (2.0 * h), rel=2e-4
        )

    @pytest.mark.slow
    def test_a_strip_of_load_steps_has_its_own_steady_cycles(self):
        coarse = {"model.kinematics": "linear", "model.nodes": 21, "contact.normal": "held"}
        strip = STRIP.replace(coarse)
        joint = Joint.of(strip, 1.0).times(2.0)
        loop = jb.solve(strip.replace({"load.amplitude": 1.0}))
        u = 0.5 * float(jnp.max(loop.displacement) - jnp.min(loop.displacement))
        assert float(joint.forces[-1]) == 2.0
        assert float(joint.displacements[-1]) == pytest.approx(u, rel=0.003)
        energy = float(joint.dissipation(joint.displacements[-1]))
        assert energy == pytest.approx(2.0 * float(loop.dissipation), rel=1e-3)


SHORT = Joint(U, np.tanh(U))  # which nobody followed up to gross slip
BEYOND = {
    "backbone": lambda: SHORT.backbone(4.5),
    "work": lambda: SHORT.work([1.0, -4.5]),
    "dissipation": lambda: SHORT.dissipation([1.0, 4.5]),
    "first harmonic": lambda: SHORT.first_harmonic(4.5),
    "path": lambda: SHORT.path_forces([1.0, -4.5]),
    "curve": lambda: modal_curve(chain(joint=SHORT), [0.1, 9.0]),
    "series": lambda: SHORT.in_series(1.0).backbone(5.5),
}


class TestReach:
    """A joint is known up to its last point; at gross slip the force stays."""

    def test_beyond_the_last_point_nothing_is_known(self):
        for ask in BEYOND.values():
            with pytest.raises(jb.InputError, match=r"beyond its backbone, which ends at.*take le"):
                ask()
        inside, beyond = jax.jit(lambda u: SHORT.dissipation(u))(jnp.array([1.0, 5.0]))
        assert np.isfinite(inside)
        assert np.isnan(beyond)

    def test_a_motion_ends_where_the_joint_is_not_known(self):
        with pytest.raises(dynamics.InterruptedMotionError, match=r"attachments\[0\]") as cut:
            dynamics.shake(chain(joint=SHORT), 20.0, velocity=[9.0, 9.0])
        known = np.isfinite(cut.value.motion.kinetic)
        assert 0.0 < cut.value.motion.reached < 20.0
        assert np.max(np.abs(cut.value.motion.displacement[known, 0])) <= 4.0

    def test_a_joint_that_was_followed_to_gross_slip_slides(self):
        joint = Joint.of(PLANE, 1.99).times(3.0)
        end = float(joint.displacements[-2])
        np.testing.assert_allclose(joint.backbone(jnp.array([9.0, 50.0]) * end), 5.97, rtol=1e-9)
        slid = float(joint.dissipation(9.0 * end) - joint.dissipation(end))
        assert slid == pytest.approx(4.0 * 3.0 * 1.99 * 8.0 * end, rel=1e-9)
        both = joint.backbone(jnp.array([9.0, -9.0]) * end, mean=False)
        np.testing.assert_allclose(both, [5.97, -5.97], rtol=1e-9)


class TestModes:
    def test_they_are_those_of_a_row_of_masses_and_print_short(self):
        """Springs of unit stiffness in a row of masses of 1: omega = 2 sin(pi j/2 (n + 1))."""
        n = 12
        modes = Structure(np.eye(n), 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)).modes(n)
        first, second, *_, last = str(modes).splitlines()
        assert first == "natural modes, cycles per time"
        expected = np.sin(0.5 * np.pi / (n + 1)) / np.pi
        assert float(second.split()[2]) == pytest.approx(expected, rel=1e-5)
        assert last.strip() == "and 2 more"
        assert str(JOINT).startswith("joint of 40 sliders")
        assert str(JOINT).count("\n") < 8

    @pytest.mark.doubtful("damping may be off")
    def test_one_mass_is_the_joint_itself(self):
        structure = Structure([[2.0]], [[0.5]], [Attachment(BAR, 0)])
        amplitude = np.array([0.05, 0.2, 0.4])
        curve = modal_curve(structure, amplitude * np.sqrt(2.0))
        force = 0.5 * amplitude + np.asarray(BAR.backbone(amplitude))
        hertz = np.sqrt(force / amplitude / 2.0) / (2.0 * np.pi)
        assert np.allclose(curve.frequency, hertz, rtol=1e-9)
        assert np.allclose(curve.omega, 2.0 * np.pi * hertz, rtol=1e-9)
        loss = np.asarray(BAR.dissipation(amplitude))
        assert np.allclose(curve.damping, loss / (2.0 * np.pi * force * amplitude), rtol=1e-9)
        slope = np.diff(np.log(curve.dissipation)) / np.diff(np.log(np.sqrt(2.0 * amplitude)))
        assert np.allclose(slope, 3.0, atol=0.01)  # Goodman's cubic law in the force

    def test_sparse_and_dense_are_one_structure(self):
        amplitude = np.geomspace(0.1, 2.0, 4)
        one, other = (modal_curve(chain(500, sparse=s), amplitude) for s in (False, True))
        assert np.allclose(one.frequency, other.frequency, rtol=1e-9)
        assert np.allclose(one.damping, other.damping, rtol=1e-6)

    def test_small_motion_has_the_damping_of_the_structure(self):
        small, plain = [1e-4, 1e-3], chain()
        curve = modal_curve(plain, small)
        assert np.allclose(curve.frequency, plain.modes().frequency[0], rtol=1e-9)
        assert np.all(curve.damping < 1e-9)
        for ratio in (0.02, [0.01, 0.03]):
            damped = Structure(plain.mass, plain.stiffness, plain.attachments, damping_ratio=ratio)
            as_matrix = Structure(plain.mass, plain.stiffness, plain.attachments, damped.damping)
            for mode, zeta in enumerate(np.broadcast_to(ratio, 2)):
                for structure in (damped, as_matrix):
                    found = modal_curve(structure, small, mode).damping
                    assert np.allclose(found, zeta, rtol=1e-9)
        far = [1.0, 1.5]  # as many amplitudes, which share the program
        more = modal_curve(damped, far).damping - modal_curve(plain, far).damping
        slower = curve.frequency[0] / modal_curve(plain, far).frequency
        assert np.allclose(more, 0.01 * slower)

    @pytest.mark.slow
    def test_they_have_derivatives_to_every_number(self):
        """Numbers of scene and joint, mass, stiffness and damping, in a jit of its own."""
        strip = PLANE.replace({"model.nodes": 17})

        @jax.jit
        @jax.value_and_grad
        def curve(values):
            mu, eta, width, series, mass, spring, ratio = values
            scene = strip.replace({"contact.friction": mu, "strip.height_ratio": eta})
            joint = Joint.of(scene, 1.2).times(width).in_series(1e5 * series)
            masses = mass * jnp.array([[1.0, 0.0], [0.0, 0.3]])
            springs = 1e5 * spring * jnp.array([[1.0, -1.0], [-1.0, 1.5]])
            attached = [Attachment(joint, 0)]
            structure = Structure(masses, springs, attached, damping_ratio=ratio)
            found = modal_curve(structure, [1e-5, 2.3e-5])
            return jnp.sum(100.0 * found.damping + found.omega / 500.0)

        at = jnp.array([0.1, 0.1126, 1.0, 2.0, 1.0, 1.0, 0.01])
        way = at * jnp.array([0.1, -0.05, 0.07, 0.1, 0.03, -0.1, 0.1])
        value, slope = curve(at)
        # At .01 an amplitude passes a corner of the sliders, of which 120 lie close together.
        steps = 0.005 * 0.5 ** np.arange(4)
        left = [abs(float(curve(at + h * way)[0] - value - h * slope @ way)) for h in steps]
        assert np.allclose(np.diff(np.log2(left)), -2.0, atol=0.1)


@pytest.fixture(scope="module")
def shaken():
    structure = chain()
    modes = structure.modes()
    span, speed = 25.0 / modes.frequency[0], 0.25 * modes.shapes[:, 0]
    return structure, dynamics.shake(structure, span, velocity=speed, samples=2001)


class TestTransient:
    def test_energy_balances(self, shaken):
        _, motion = shaken
        assert float(jnp.max(jnp.abs(motion.imbalance))) < 1e-4 * float(motion.kinetic[0])
        assert float(motion.friction_work[-1]) > 0.1 * float(motion.kinetic[0])

    def test_it_rings_down_as_statics_predict(self, shaken):
        structure, motion = shaken
        shape = structure.modes().shapes[:, 0]
        modal = np.asarray(motion.displacement) @ structure.mass @ shape
        found = dynamics.ring_down(motion.time, modal)
        curve = modal_curve(structure, np.geomspace(0.05, 1.0, 40))
        predicted = np.interp(found.amplitude, curve.amplitude, curve.damping)
        assert np.median(np.abs(found.damping / predicted - 1.0)) < 0.05
        frequency = np.interp(found.amplitude, curve.amplitude, curve.frequency)
        assert np.allclose(found.frequency, frequency, rtol=0.01)

    @pytest.mark.doubtful("energy balance is open")  # as nothing is lost
    def test_it_begins_with_stretched_sliders(self, shaken):
        structure, _ = shaken
        x = 1e-2 * structure.modes().shapes[:, 0]  # nothing slips
        begun = dynamics.shake(structure, 1.0, displacement=x)
        stored = 0.5 * x @ structure.stuck_stiffness @ x
        assert float(begun.stored[0]) == pytest.approx(float(stored), rel=1e-9)

    @pytest.mark.doubtful("energy balance is open")
    def test_a_spring_beside_the_sliders_takes_its_part(self):
        joint = Joint([1.0, 3.0], [1.0, 2.0])  # of half the stiffness; nothing slips below 1
        mass = Structure([[1.0]], [[0.0]], [Attachment(joint, 0)])
        motion = dynamics.shake(mass, 2.0 * np.pi, displacement=[0.5])
        swing = 0.5 * np.cos(np.asarray(motion.time))
        np.testing.assert_allclose(motion.displacement[:, 0], swing, atol=1e-3)

    def test_an_interrupted_motion_keeps_the_part_computed(self):
        with pytest.raises(dynamics.InterruptedMotionError, match="ends at t") as cut:
            dynamics.shake(chain(), 50.0, velocity=[1.0, 0.0], samples=2001, most_steps=200)
        assert 0.0 < cut.value.motion.reached < 50.0

    def test_energies_that_do_not_add_up_are_doubted(self, shaken):
        structure, motion = shaken
        assert motion.doubts == ()
        start = {"velocity": motion.velocity[0], "samples": 201, "most_steps": 3000}
        with pytest.warns(
            jb.DoubtfulWarning, match=r"may be off by .*% of the largest.*most_steps"
        ):
            rough = dynamics.shake(structure, float(motion.time[-1]), **start, tolerance=1e-6)
        off = np.max(np.abs(rough.displacement - motion.displacement[::10]))
        assert off < rough.error * np.max(np.abs(motion.displacement))


def many(diagonal):
    """Sparse diagonal matrix of 500 degrees of freedom, whose entry 7 is given."""
    return scipy.sparse.diags_array([*[1e5] * 7, diagonal, *[1e5] * 492])


REFUSED = {
    "shape": (lambda: Structure(np.eye(2), np.ones((2, 3))), "stiffness"),
    "sizes": (lambda: Structure(np.eye(2), np.eye(3)), "stiffness"),
    "words": (lambda: Structure("mass", np.eye(2)), "mass"),
    "skew": (lambda: Structure(np.eye(2), [[1.0, 0.5], [0.0, 1.0]]), "stiffness.*symmetric"),
    "not finite": (lambda: Structure(np.eye(1), [[np.nan]]), "finite"),
    "massless": (lambda: Structure(np.diag([1.0, 0.0]), np.eye(2)), "mass.*positive definite"),
    "damping": (lambda: Structure(np.eye(2), np.eye(2), damping=[[1.0]]), "damping"),
    "rigid": (lambda: Structure(np.eye(2), [[1.0, -1.0], [-1.0, 1.0]]), "rigid mode"),
    "unstable": (lambda: Structure(many(1.0), many(-7e5)), "stiffness.*negative mode"),
    "heavy": (lambda: Structure(many(-1.0), many(1.0)), "mass.*positive definite"),
    "complex": (lambda: Structure(many(1.0), many(1.0 + 1.0j)), "stiffness.*real"),
    "complex dense": (lambda: Structure(np.eye(1), [[1.0 + 1.0j]]), "stiffness.*real"),
    "feeding": (lambda: Structure(many(1.0), many(1.0), damping=many(-1.0)), "damping.*negative"),
    "ratio": (lambda: Structure(np.eye(1), np.eye(1), damping_ratio=-0.1), "damping_ratio = -0.1"),
    "ratios": (lambda: Structure(np.eye(1), np.eye(1), damping_ratio=[0.1] * 2), "damping_ratio"),
    "large": (lambda: Structure(many(1.0), many(1.0), damping_ratio=0.1).damping, "give damping="),
    "traced large": (
        lambda: jax.jit(lambda r: Structure(many(1.0), many(1.0), damping_ratio=r).size)(0.1),
        "reduce the structure",
    ),
    "no joints": (lambda: modal_curve(Structure(np.eye(1), np.eye(1)), [1.0]), "give a joint"),
    "series": (lambda: JOINT.in_series(-1.0), "series stiffness = -1.0"),
    "nowhere": (lambda: Structure(np.eye(1), np.eye(1), [Attachment(JOINT, 1)]), "attachments"),
    "no law": (
        lambda: Structure(np.eye(1), np.eye(1), [Attachment(jb.Scene(), 0)]),
        r"attachments\[0\]\.law.*give a Joint",
    ),
    "to itself": (lambda: Structure(np.eye(1), np.eye(1), [Attachment(JOINT, 0, 0)]), "attachm"),
    "stiffening": (lambda: Joint([1.0, 2.0], [1.0, 3.0]), "softening"),
    "falling": (lambda: Joint([2.0, 1.0], [1.0, 3.0]), "rising"),
    "times": (lambda: JOINT.times(0.0), "number of joints = 0.0"),
    "beyond gross slip": (lambda: Joint.of(PLANE, 2.5), "force = 2.5.*gross slip"),
    "no force": (
        lambda: Joint.of(PLANE.replace({"load.control": "displacement", "load.amplitude": 1e-5})),
        "load.amplitude.*force",
    ),
    "amplitudes": (lambda: modal_curve(chain(), [0.2, 0.1]), "amplitudes"),
    "still": (lambda: dynamics.shake(chain(), 1.0), "nothing happens"),
    "start": (lambda: dynamics.shake(chain(), 1.0, velocity=[1.0]), "velocity"),
    "silence": (lambda: dynamics.ring_down(np.arange(9.0), np.zeros(9)), "never changes"),
    "uneven": (lambda: dynamics.ring_down(np.arange(9.0) ** 2, np.ones(9)), "evenly"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_input_is_one_clear_line(name):
    call, message = REFUSED[name]
    with pytest.raises(jb.InputError, match=message) as refusal:
        call()
    assert "\n" not in str(refusal.value)


def test_a_displacement_driven_scene_gives_the_joint_of_its_forces():
    driven = PLANE.replace({"load.control": "displacement", "load.amplitude": 1e-5})
    one, other = Joint.of(PLANE, 1.2), Joint.of(driven, 1.2)
    assert np.allclose(one.displacements, other.displacements, rtol=1e-12)
    assert np.allclose(one.forces, other.forces, rtol=1e-12)


def test_pull_and_push_each_have_their_backbone():
    joint = Joint.of(PLANE, 1.2).times(3.0)
    assert joint.sides is not None
    pull, push = (float(joint.backbone(way * 1e-5, mean=False)) for way in (1.0, -1.0))
    assert pull > float(joint.backbone(1e-5)) > -push > 0.0  # a pull presses the corner down
    mean = np.mean(joint.sides, axis=0)
    apart = np.abs(np.asarray(joint.sides) - mean) / mean
    assert float(joint.asymmetry) == pytest.approx(float(apart.max()), rel=1e-9)
    at_end = joint.backbone(jnp.stack([joint.sides[0, -1], -joint.sides[1, -1]]), mean=False)
    np.testing.assert_allclose(at_end, [3.6, -3.6], rtol=1e-9)


@pytest.mark.slow
def test_a_lap_joint_is_walked_exactly_on_any_path():
    values = {"model.section": "squeeze", "model.nodes": 41, "load.amplitude": 1.2}
    lap = jb.library.double_shear().replace(values)
    joint = Joint.of(lap)
    forces = np.array([0.6, 1.2, 0.3, -0.9, 0.0, 1.0])
    path = np.asarray(jb.solve(lap, forces, throw=False).displacement)[1:]
    # Forces and displacements round corners alike but for the flexibility, which is smooth.
    np.testing.assert_allclose(joint.path_forces(path), forces, atol=1e-6)
    for way, side in zip((1.0, -1.0), joint.sides, strict=True):
        u = jb.solve(lap, [way * 0.7], throw=False).displacement[-1]
        assert float(jnp.interp(0.7, joint.forces, side)) == pytest.approx(way * float(u), rel=2e-3)
        assert float(joint.backbone(u, mean=False)) == pytest.approx(way * 0.7, rel=2e-3)
