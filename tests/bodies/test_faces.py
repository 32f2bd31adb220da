"""Contact on a face: closed forms, the strip as a slice, CalculiX in three dimensions, slopes."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from calibration.finite_elements import body as calculix
from calibration.finite_elements.block import LOAD
from calibration.finite_elements.bricks import SOFTNESS, area
from jbeamshell.bodies.face_step import ROUND
from jbeamshell.bodies.substructure import frames_of
from jbeamshell.measured.example import data_folder

DATA = Path(__file__).parent
STRIP = DATA / "calculix" / "strip.sti"  # by CalculiX 2.20
SPRING, LIMIT = 2.0, 0.3


def point(normal=0.0):
    """A node on springs over a rigid base, pulled along X and Y, and pressed."""
    stiffness = np.diag([SPRING, SPRING, 1.0])
    forces = np.array([[1.0, 0.0, normal], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
    return jb.Substructure([[0.0, 0.0, 0.0]], stiffness, forces)


def block():
    """Block of 6 x 4 x 2 bricks of CalculiX on its 35 nodes."""
    return jb.Substructure.read(data_folder() / "calculix_block.npz")


START = {"friction": 0.3, "bolts": 10.0, "gap": 1.0, "softness": 1e-6, "roughness": 1e-5}


def work_of_friction(values):
    """Work along a loop of the block, of numbers in the order of `START`."""
    inputs = dict(zip(START, values, strict=True))
    inputs["gap"] = inputs["gap"] * 1e-7 * (block().places[:, 0] - 20.0) ** 2  # a wedge
    inputs["roughness"] = inputs["roughness"] * jnp.array([1.0, 1e6])
    options = {"amplitude": 700.0, "cycles": 1, "steps_per_half_cycle": 8, "throw": False}
    return jnp.sum(jb.solve_contact(block(), **inputs, **options).slip_work)


# One program each for all numbers.
WORK, SLOPES = jax.jit(work_of_friction), jax.jit(jax.grad(work_of_friction))
FORWARD = jax.jit(lambda at, way: jax.jvp(work_of_friction, (at,), (way,))[1])


class TestPoint:
    def test_a_dragged_slider_loses_what_the_closed_form_says(self):
        # A spring of force mu N drags it on a circle, along its own direction.
        reach, turn = 0.4, 2.0 * np.pi / 200
        angle = turn * np.arange(801)
        pull = SPRING * reach * np.column_stack([np.cos(angle), np.sin(angle)])
        path = np.column_stack([pull, np.ones(angle.size)])
        history = jb.solve_contact(point(), friction=LIMIT, bolts=[0.0, 1.0], path=path)
        stretch, half = LIMIT / SPRING, np.sin(0.5 * turn)  # chords drag it in steps
        radius = np.sqrt(reach**2 - stretch**2 * (1.0 - half**2)) - stretch * half
        slip = history.slip[-200:, 0]
        np.testing.assert_allclose(np.linalg.norm(slip - slip.mean(0), axis=1), radius, rtol=1e-6)
        work = 200 * 2.0 * radius * half * LIMIT * 0.5 * (1.0 + np.cos(turn))
        assert float(jnp.sum(history.slip_work[-200:])) == pytest.approx(work, rel=1e-6)
        circle = 2.0 * np.pi * np.sqrt(reach**2 - stretch**2) * LIMIT
        assert work == pytest.approx(circle, rel=0.01)  # with the steps

    def test_one_direction_is_a_jenkins_element(self):
        # Its force is mu N however far it slips.
        with pytest.warns(jb.DoubtfulWarning, match="the mesh has an error that is not known"):
            history = jb.solve_contact(point(), friction=LIMIT, bolts=[0.0, 1.0], amplitude=0.8)
        slip = float(jnp.ptp(history.slip[:, 0, 0]))
        assert slip == pytest.approx(2.0 * (0.8 - LIMIT) / SPRING, rel=1e-9)
        assert float(history.dissipation) == pytest.approx(2.0 * LIMIT * slip, rel=0.02)
        assert float(history.dissipation_error) < 0.05

    def test_softness_takes_the_forces_of_springs_and_sliders(self):
        soft = np.array([0.05, 0.02])
        path = np.random.default_rng(0).normal(size=(40, 3)) * [0.5, 0.5, 0.3] + [0.0, 0.0, 1.0]
        history = jb.solve_contact(
            point(0.2), friction=LIMIT, bolts=[0.0, 1.0], softness=soft, path=path
        )
        force = np.concatenate([-history.friction_force[:, 0], history.normal_force], axis=1)
        w = (force + path_forces(path)) / [SPRING, SPRING, 1.0]
        slip = np.zeros(2)
        for each, moved in zip(force, w, strict=True):
            normal = max(-moved[2] / soft[1], 0.0)
            trial = -(moved[:2] - slip) / soft[0]
            size = np.linalg.norm(trial)
            tangential = trial * min(1.0, LIMIT * normal / size) if size else trial
            np.testing.assert_allclose(each, [*tangential, normal], atol=1e-10)
            slip = moved[:2] + soft[0] * tangential

    def test_rough_surfaces_approach_as_exponential_heights_do(self):
        height, pressure = 0.3, 0.2
        loads = np.array([0.5, 1.0, 3.0, 0.7])
        path = np.column_stack([0.0 * loads, 0.0 * loads, loads])
        rough = {"bolts": [0.0, 0.1], "roughness": [height, pressure]}
        history = jb.solve_contact(point(), **rough, path=path)
        found, gap = history.normal_force[1:, 0], -history.gap[1:, 0]
        np.testing.assert_allclose(gap, height * np.log1p(found / pressure), rtol=1e-9)
        np.testing.assert_allclose(found, loads - gap, rtol=1e-9)  # the rest is in the spring of 1


def path_forces(path):
    pressing = np.array([[0.0, 0.0, 1.0]])
    return np.concatenate([pressing, path]) @ np.asarray(point(0.2).forces).T


class TestSlice:
    def test_a_slice_in_plane_strain_is_the_contact_line(self):
        made, model = calculix.strip_slice(jb.Scene(), 6, 3), jb.StiffnessModel.read(STRIP)
        line = model.condensed(made.contact, pull=made.pull, press=[made.press])
        front = len(made.contact) // 2
        nodes = [(n, x, 0.0, float(k >= front)) for k, (n, x) in enumerate(made.contact)]
        face = model.condensed(nodes, pull=made.pull, press=[made.press], normals=(0.0, 1.0, 0.0))
        load = {"friction": 0.1, "amplitude": 0.8, "assembly": "frictionless"}
        exact = jb.solve_contact(line, **load, points=True)  # faces slip node by node
        found = jb.solve_contact(face, **load, steps_per_half_cycle=64, throw=False)
        assert float(found.dissipation) == pytest.approx(float(exact.dissipation), rel=2e-3)
        assert float(found.secant_stiffness) == pytest.approx(
            float(exact.secant_stiffness), rel=1e-4
        )
        np.testing.assert_allclose(found.slip[..., 1], 0.0, atol=1e-15)


class TestBlock:
    def test_the_loop_is_that_of_calculix(self):
        loop = np.loadtxt(DATA / "block_loop.csv", delimiter=",", skiprows=2)
        history = jb.solve_contact(
            block(), **LOAD, steps_per_half_cycle=16, softness=SOFTNESS, throw=False
        )
        np.testing.assert_allclose(history.force, loop[:, 0], atol=1e-9)
        start, _, stop = history.cycles[-1]
        here, there = np.asarray(history.displacement), loop[:, 1]
        np.testing.assert_allclose(here, there, atol=2e-3 * np.ptp(there))
        works = [area(loop[start : stop + 1, 0], u[start : stop + 1]) for u in (here, there)]
        assert works[0] == pytest.approx(works[1], rel=2e-3)
        assert np.ptp(here) == pytest.approx(np.ptp(there), rel=1e-3)
        clear = jnp.abs(history.gap) > 1e-6 * jnp.max(jnp.abs(history.gap))
        closed = (history.gap < 0.0)[clear]  # springs penetrate
        np.testing.assert_array_equal(history.touching[clear], closed)
        assert float(history.contact_extent[-1]) < float(jnp.sum(block().tributary))

    def test_the_estimate_bounds_the_error_of_the_load_steps(self):
        found = [
            jb.solve_contact(block(), **STEADY, steps_per_half_cycle=steps)
            for steps in (8, 16, 32, 128)
        ]
        truth = float(found[-1].dissipation)
        for history in found[:-1]:
            error = abs(float(history.dissipation) / truth - 1.0)
            assert error < 1.5 * float(history.dissipation_error) + 2e-3
        assert error < 0.01

    def test_a_turned_block_answers_alike(self):
        body = block()
        turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        normals = np.asarray(body.normals) @ turn.T
        both = frames_of(normals) @ turn @ np.swapaxes(body.frames, 1, 2)
        n = len(both)
        change = np.zeros((n, 3, n, 3))
        change[np.arange(n), :, np.arange(n), :] = both
        change = change.reshape(3 * n, 3 * n)
        turned = jb.Substructure(
            np.asarray(body.places) @ turn.T,
            change @ np.asarray(body.stiffness) @ change.T,
            change @ np.asarray(body.forces),
            body.flexibility,
            normals=normals,
            tributary=body.tributary,
        )
        load = STEADY | {"steps_per_half_cycle": 8}
        ours, theirs = (jb.solve_contact(b, **load) for b in (body, turned))
        np.testing.assert_allclose(theirs.displacement, ours.displacement, rtol=1e-6)
        np.testing.assert_allclose(theirs.reaction, ours.reaction, atol=1e-6)

    def test_a_stiff_body_below_is_a_rigid_base(self):
        body, stiff = block(), 1e6 * float(jnp.max(block().stiffness))
        size = body.stiffness.shape[0]
        lower = jb.Substructure(body.places, stiff * np.eye(size), np.zeros((size, 1)))
        alone = jb.solve_contact(body, **STEADY, steps_per_half_cycle=8)
        pair = jb.solve_contact(body, lower, **STEADY, steps_per_half_cycle=8)
        assert float(pair.dissipation) == pytest.approx(float(alone.dissipation), rel=1e-4)

    def test_equal_bodies_grow_alike_under_the_bolts(self):
        # No support holds them: the loads are in balance.  Nothing slips, as both widen alike.
        body = block()
        mirror = np.tile([1.0, 1.0, -1.0], body.tributary.size)
        forces = np.asarray(body.forces)[:, [1, 1]]  # pressed and pressed again
        upper = jb.Substructure(body.places, body.stiffness, forces, tributary=body.tributary)
        lower = jb.Substructure(
            body.places,
            mirror[:, None] * np.asarray(body.stiffness) * mirror,
            mirror[:, None] * forces,
            tributary=body.tributary,
        )
        path = np.tile([0.0, 10.0], (2, 1))
        history = jb.solve_contact(upper, lower, friction=0.3, bolts=10.0, path=path)
        limit = 0.3 * np.max(history.reaction)
        np.testing.assert_allclose(history.traction, 0.0, atol=1e-6 * limit)

    def test_loads_that_nothing_balances_are_refused(self):
        with pytest.raises(jb.InputError, match="not in balance"):
            jb.solve_contact(block(), block(), **STEADY)

    def test_displacements_that_forces_caused_cause_them(self):
        forces = jb.solve_contact(block(), **STEADY, steps_per_half_cycle=8)
        found = jb.solve_contact(
            block(),
            control="displacement",
            path=forces.displacement[1:],
            friction=0.3,
            bolts=10.0,
        )
        np.testing.assert_allclose(found.force, forces.force, atol=1e-5)

    @pytest.mark.parametrize("key", START)
    def test_derivatives_have_the_slope_of_taylor(self, key):
        start, way = jnp.asarray(list(START.values())), jnp.zeros(len(START))
        way = way.at[list(START).index(key)].set(START[key])
        slope = SLOPES(start) @ way
        assert float(FORWARD(start, way)) == pytest.approx(float(slope), rel=1e-9)
        left = [abs(float(WORK(start + h * way) - WORK(start) - slope * h)) for h in (1e-3, 5e-4)]
        assert left[1] < 0.3 * left[0]


STEADY = {"friction": 0.3, "amplitude": 700.0, "bolts": 10.0, "cycles": 2, "throw": False}


class TestRefusals:
    @pytest.mark.parametrize(
        ("change", "words"),
        [
            ({"upper": "block"}, "upper = "),
            ({"friction": -0.1}, "friction = -0.1"),
            ({"gap": -1.0}, "gap = -1"),
            ({"gap": [1.0, 2.0]}, "gap = "),
            ({"softness": [1.0, 2.0, 3.0]}, "softness = "),
            ({"roughness": 0.3}, "roughness = 0.3"),
            ({"roughness": [0.3, 0.0]}, "roughness = "),
            ({"path": np.zeros((2, 5))}, "path = "),
            ({"bolts": [1.0, 2.0]}, "bolts = "),
            ({"control": "speed"}, "control = 'speed'"),
            ({"lower": point()}, "lower.places = "),
        ],
    )
    def test_bad_input_names_its_key(self, change, words):
        options = {"upper": block(), "friction": 0.3, "bolts": 10.0} | change
        with pytest.raises(jb.InputError, match=words.replace("(", r"\(")):
            jb.solve_contact(**options)

    def test_beyond_gross_slip_there_is_no_equilibrium(self):
        with pytest.raises(jb.UnconvergedError, match="step"):
            jb.solve_contact(block(), friction=0.3, amplitude=2000.0, bolts=10.0, cycles=1)

    def test_no_damaged_body_is_taken(self):
        whole = {name: np.array(getattr(block(), name)) for name in DAMAGED}
        for seed in range(300):
            draw = np.random.default_rng(seed)
            arrays = {name: array.copy() for name, array in whole.items()}
            DAMAGES[draw.choice(list(DAMAGES))](draw, arrays)
            with pytest.raises(jb.InputError, match=" = "):
                jb.Substructure(**arrays)


def coupled(seed, n):
    """History of pairs that are strongly coupled, normals all round, and mu near 1; and mu."""
    draw = np.random.default_rng(seed)
    places = np.column_stack([np.arange(n) % 3, np.arange(n) // 3, np.zeros(n)]) * 1.0
    root = draw.normal(size=(3 * n, 3 * n))
    normals = draw.normal(size=(n, 3))
    normals[:, 2] = np.abs(normals[:, 2])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    loads = np.zeros((3 * n, 2))
    loads[:, 0] = draw.normal(size=3 * n)
    loads[2::3, 1] = -draw.uniform(0.5, 2.0, n)
    stiffness = root @ root.T / (3.0 * n) + 0.02 * np.eye(3 * n)
    body = jb.Substructure(places, stiffness, loads, normals=normals)
    mu, amplitude = draw.uniform(0.5, 1.0), draw.uniform(0.2, 3.0)
    steps = {"cycles": 1, "steps_per_half_cycle": 8}
    return jb.solve_contact(body, friction=mu, amplitude=amplitude, throw=False, **steps), mu


@pytest.mark.filterwarnings("ignore::jbeamshell.DoubtfulWarning")
def test_strongly_coupled_pairs_have_an_equilibrium():
    longest = 0
    for seed, n in (*zip(range(16), (6, 9) * 8, strict=True), (35, 6)):
        found, mu = coupled(seed, n)
        assert np.all(np.asarray(found.status) == 0)
        normal = np.asarray(found.normal_force)
        assert np.min(found.gap) > -1e-10
        assert np.min(normal) >= 0.0
        rubbed = np.linalg.norm(found.friction_force, axis=-1)
        assert np.all(rubbed <= mu * normal + 1e-9 * np.max(normal))
        longest = max(longest, np.max(found.iterations))
    assert longest > ROUND  # sweeps led on where Newton's method went in circles


DAMAGED = ("places", "normals", "tributary", "stiffness", "forces", "flexibility")


def entry(draw, arrays, value, names=DAMAGED):
    array = arrays[draw.choice(list(names))]
    array[tuple(draw.integers(size) for size in array.shape)] = value


def unsymmetric(draw, arrays):
    arrays["stiffness"][3, 7] *= 1.0 + draw.choice([-1.0, 1.0]) * 10.0 ** draw.uniform(-3.0, 1.0)


def negative(draw, arrays):
    way = draw.normal(size=arrays["stiffness"].shape[0])
    way /= np.linalg.norm(way)
    size = 10.0 ** draw.uniform(-2.0, 1.0) * np.max(np.diag(arrays["stiffness"]))
    arrays["stiffness"] -= size * np.outer(way, way)


def permuted(draw, arrays):
    order = draw.permutation(arrays["stiffness"].shape[0])
    arrays["stiffness"] = arrays["stiffness"][np.ix_(order, order)]


def mixed_units(draw, arrays):
    arrays["places"][:, draw.integers(2)] *= 10.0 ** draw.choice([-3, -1, 1, 3])


def short(draw, arrays):
    name = draw.choice(list(DAMAGED))
    arrays[name] = arrays[name][:-1]


DAMAGES = {
    "not a number": lambda draw, arrays: entry(draw, arrays, draw.choice([np.nan, np.inf])),
    "unsymmetric": unsymmetric,
    "negative": negative,
    "permuted": permuted,
    "mixed units": mixed_units,
    "short": short,
    "area": lambda draw, arrays: entry(draw, arrays, -draw.random(), ["tributary"]),
    "normal": lambda draw, arrays: entry(draw, arrays, draw.uniform(0.1, 0.9), ["normals"]),
    "single": lambda _, arrays: arrays.update(
        stiffness=jnp.asarray(arrays["stiffness"], "float32")
    ),
}
