"""Pressures that change along a path, event by event: by hand, by balances and by pressing."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import MOVED, SQUEEZE, STEPS

import jbeamshell as jb
from jbeamshell.contact_line import contact_state, drives, strip, walk
from jbeamshell.contact_line.assembly import press_roughly
from jbeamshell.contact_line.body import Body
from jbeamshell.contact_line.pressures import Press, walk_with_pressures
from jbeamshell.scene.load_path import whole_path
from jbeamshell.scene.plan import LINE
from jbeamshell.scene.plan import STEPS as LOAD_STEPS
from jbeamshell.solving.solve import _able

MU, NODES = 0.3, 21
SCENE = jb.Scene().replace(
    {
        "model.section": "squeeze",
        "model.kinematics": "linear",
        "strip.height_ratio": 0.3,
        "contact.friction": MU,
        "contact.pressure": [[0.0, 14.0], [0.7, 12.0], [2.0, 3.0]],
        "model.nodes": NODES,
    }
)
PATH = np.array([[4.5, 1.0], [2.8, 0.6], [-2.8, 0.7], [-5.5, 1.4], [-5.5, 1.4], [4.5, 1.0]])
WALK = jax.jit(walk_with_pressures)


@pytest.fixture(scope="module")
def pressed():
    """Body that was pressed with friction, share of its pressures, and how it was pressed."""

    @jax.jit
    def made(scene):
        line = strip.condensed(scene, NODES)
        body, press = line.body, Press.of(line.loaded.hessian, line.body.f_t.size, 0)
        rough = press_roughly(body.K_tt, body.K_tn, body.K_nn, -press.g_t, -press.g_n, MU)
        body = dataclasses.replace(body, r_0=rough.reaction, t_0=rough.traction)
        return (body, press, MU, contact_state.pressed(body)), rough

    return made(SCENE)


def finer(path, parts):
    """Path whose straight steps are taken in several."""
    steps = np.diff(path, axis=0, prepend=[[0.0, 1.0]])
    shares = np.arange(1, parts + 1)[:, None] / parts
    return np.concatenate(
        [end - (1.0 - shares) * step for end, step in zip(path, steps, strict=True)]
    )


def bar(nodes, pressure):
    """Bar of unit length and stiffness that is pulled at its first node, on equal lengths."""
    length = np.append(0.5, np.ones(nodes - 1)) / (nodes - 0.5)
    chain = 2.0 * np.eye(nodes) - np.eye(nodes, k=1) - np.eye(nodes, k=-1)
    chain[0, 0] = 1.0
    none = jnp.zeros(nodes)
    body = Body(
        x=none,
        tributary=jnp.asarray(length),
        K_tt=jnp.asarray(chain * (nodes - 0.5)),
        K_tn=jnp.zeros((nodes, nodes)),
        K_nn=jnp.eye(nodes),
        f_t=none.at[0].set(1.0),
        f_n=none,
        r_0=jnp.asarray(pressure * length),
        t_0=none,
        c=jnp.zeros(()),
    )
    return body, Press(none, -body.r_0, jnp.zeros(()))


def test_a_bar_slips_where_less_pressure_no_longer_holds_it():
    # In a bar pulled by F, the traction mu p holds a length F/(mu p), and u = F^2/(2 EA mu p).  At
    # half the pressure both double.  Friction takes F^3/(6 EA mu p) in the pull, and twice as much
    # while the pressure falls.
    force, friction, pressure = 0.2, 0.5, 1.0
    body, press = bar(120, pressure)
    found = WALK(
        body,
        press,
        friction,
        contact_state.pressed(body),
        jnp.asarray([force, force]),
        jnp.asarray([1.0, 0.5]),
    )
    by_hand = force**2 / (2.0 * friction * pressure)
    np.testing.assert_allclose(found.state.displacement, [by_hand, 2.0 * by_hand], rtol=2e-3)
    work = force**3 / (6.0 * friction * pressure)
    np.testing.assert_allclose(found.slip_work, [work, 2.0 * work], rtol=5e-3)
    slipping = np.sum(np.where(found.slipping, body.tributary, 0.0), axis=1)
    np.testing.assert_allclose(slipping, [0.4, 0.8], atol=0.01)
    # Nothing turned: the end is that of a pull under half the pressure.
    half, _ = bar(120, 0.5 * pressure)
    one = jnp.ones(1, bool)
    pull = walk.walk(
        half, friction, contact_state.pressed(half), jnp.asarray([force]), one, rounded=False
    )
    np.testing.assert_allclose(found.state.v[1], pull.state.v[0], atol=1e-12 * by_hand)


def test_twice_the_pressures_are_the_assembly_twice(pressed):
    given, rough = pressed
    assert np.max(np.abs(rough.traction)) > 0.01 * np.max(rough.reaction)
    found = WALK(*given, jnp.zeros(1), jnp.asarray([2.0]), rough.lift)
    state, slip = found.state, np.max(np.abs(rough.settled))
    size = float(np.max(rough.reaction))
    np.testing.assert_allclose(state.r_n[0], 2.0 * rough.reaction, atol=1e-5 * size)
    np.testing.assert_allclose(state.r_t[0], 2.0 * rough.traction, atol=1e-5 * size)
    np.testing.assert_allclose(state.v[0], rough.settled, atol=1e-5 * slip)
    np.testing.assert_allclose(found.lift[0], 2.0 * rough.lift, atol=1e-5 * slip)


@pytest.fixture(scope="module")
def found(pressed):
    """Levels of the path, and of the same path in finer steps."""
    given, rough = pressed
    return [WALK(*given, *path.T, rough.lift) for path in (PATH, finer(PATH, 8))]


class TestPath:
    def test_levels_only_say_where_a_step_is_looked_at(self, found):
        few, many = found
        assert np.all(few.settled)
        np.testing.assert_allclose(
            few.slip_work,
            np.sum(np.reshape(many.slip_work, (-1, 8)), axis=1),
            rtol=1e-9,
            atol=1e-16,
        )
        np.testing.assert_allclose(few.state.displacement, many.state.displacement[7::8], rtol=1e-9)

    def test_the_contact_keeps_its_conditions(self, found):
        state, lift = found[1].state, np.asarray(found[1].lift)
        most = float(np.max(state.r_n))
        cap = MU * np.asarray(state.r_n)[:, : state.r_t.shape[1]]
        assert np.all(np.abs(state.r_t) <= cap + 1e-10 * most)
        assert np.min(state.r_n) >= -1e-10 * most
        np.testing.assert_allclose(lift * state.r_n, 0.0, atol=1e-12 * most)

    def test_displacement_control_walks_the_path_of_the_force(self, found, pressed):
        # Between two levels the displacement goes evenly, which the load then does not.
        many, ((body, press, friction, start), rough) = found[1], pressed
        driven = drives.driven_by_displacement(body)
        given = press.driven_by_displacement(driven), friction, start, many.state.displacement
        back = WALK(driven, *given, finer(PATH, 8)[:, 1], rough.lift)
        state = jax.vmap(drives.exchanged)(back.state)
        assert np.all(back.settled)
        np.testing.assert_allclose(state.force, many.state.force, atol=2e-3)
        total = float(np.sum(many.slip_work))
        np.testing.assert_allclose(back.slip_work, many.slip_work, atol=5e-3 * total)

    @pytest.fixture
    def figures(self, pressed):
        """Works and displacements over friction, stiffness, load and part of the pressures."""
        (body, press, _, _), _ = pressed

        def found(friction, stiffer, load, part):
            # The contact that was pressed is at its limit of friction, wherever that is.
            share = -press.g_t, -press.g_n
            rough = press_roughly(body.K_tt, body.K_tn, body.K_nn, *share, friction)
            start = contact_state.pressed(
                dataclasses.replace(body, r_0=rough.reaction, t_0=rough.traction)
            )
            own = dataclasses.replace(body, K_nn=stiffer * body.K_nn, K_tt=stiffer * body.K_tt)
            path = jnp.asarray([load, load, -load]), jnp.stack([1.0 + 0.0 * part, part, 1.2 * part])
            levels = walk_with_pressures(own, press, friction, start, *path, rough.lift)
            return jnp.append(1e3 * levels.slip_work, levels.state.displacement)

        return found

    AT, WAY = (MU, 1.0, 2.0, 0.6), (0.02, 0.03, 0.1, -0.04)

    def test_taylor_slope_is_two(self, figures):
        forward = jax.jit(lambda at: jax.jvp(figures, at, self.WAY))
        value, slope = forward(self.AT)

        def left(h):
            moved, _ = forward(tuple(a + h * b for a, b in zip(self.AT, self.WAY, strict=True)))
            return np.linalg.norm(moved - value - h * slope)

        assert np.log2(left(2e-3) / left(1e-3)) == pytest.approx(2.0, abs=0.15)
        jax.eval_shape(jax.grad(lambda *at: figures(*at)[2]), *self.AT)  # also in reverse

    @pytest.mark.slow
    def test_reverse_derivatives_are_those_of_the_forward_ones(self, figures):
        _, slope = jax.jit(lambda at: jax.jvp(figures, at, self.WAY))(self.AT)
        back = jax.jit(jax.grad(lambda *at: figures(*at)[2], argnums=(0, 1, 2, 3)))(*self.AT)
        assert float(np.dot(back, self.WAY)) == pytest.approx(float(slope[2]), rel=1e-9)


@pytest.mark.parametrize(
    ("scene", "load"),
    [
        pytest.param(SCENE.replace({"contact.friction": 0.1}), 0.2, marks=pytest.mark.slow),
        (jb.library.single_lap().replace({"model.nodes": 33}), 0.1),
    ],
    ids=["strip", "lap joint"],
)
def test_works_of_the_load_and_of_the_pressures_are_kept_or_taken_by_friction(scene, load):
    path = PATH * [load, 1.0]
    few, many = (jb.solve(scene, finer(path, parts), throw=False) for parts in (4, 16))
    assert many.converged
    np.testing.assert_array_equal(few.pressure[few.pressed + 1 :], finer(path, 4)[:, 1])
    left = [float(np.abs(run.energy_imbalance).max()) for run in (few, many)]
    assert left[1] < 0.1 * left[0]  # trapezoids of the works are of second order
    assert left[1] < 0.01 * float(np.sum(many.slip_work))


def test_a_cycle_of_the_load_is_none_where_the_pressures_do_not_close():
    loads = [[1.0, 1.0], [-1.0, 0.9], [1.0, 1.0]]
    assert len(whole_path(SCENE, loads)[1]) == 1
    loads[2][1] = 0.9
    assert whole_path(SCENE, loads)[1] == ()


TIME = np.linspace(0.0, 2.0 * np.pi, STEPS + 1)[1:]


def moved_while_pressed(least):
    """Displacements of a cycle, and pressures that fall to a least part of themselves."""
    path = np.stack([1.5e-5 * np.sin(TIME), np.maximum(1.0 + np.sin(TIME), least)], axis=1)
    path[14, 1] = least
    return path


def test_pressures_that_nearly_vanish_are_walked():
    scene = SQUEEZE.replace({"load.control": "displacement", "load.amplitude": 1.5e-5})
    history = jb.solve(scene, moved_while_pressed(1e-3), throw=False)
    assert history.converged
    assert history.scene.plan.engine == LINE


def test_pressures_that_vanish_or_change_beside_elastic_sliders_take_load_steps():
    soft = MOVED.replace({"model.by": "auto"})
    assert soft.plan.engine == LINE
    history = jb.solve(soft, moved_while_pressed(0.0), throw=False)
    assert history.converged
    assert history.scene.plan.engine == LOAD_STEPS
    ideal = SQUEEZE.replace({"load.control": "displacement", "load.amplitude": 1.5e-5})
    for scene, least, engine in ((soft, 0.5, LOAD_STEPS), (ideal, 0.0, LOAD_STEPS)):
        assert _able(scene, moved_while_pressed(least), None).plan.engine == engine
    with pytest.raises(jb.InputError, match="must act wholly beside elastic sliders"):
        jb.solve(soft.replace({"model.section": "plane"}), moved_while_pressed(0.5))


@pytest.mark.slow
def test_load_steps_come_near():
    scene = jb.Scene().replace(
        {"model.section": "squeeze", "model.kinematics": "linear", "model.nodes": 41}
    )
    path = np.array([[0.8, 1.0], [0.8, 0.6], [-0.5, 1.4], [0.9, 0.8]])
    exact = jb.solve(scene, path)
    near = jb.solve(scene, finer(path, 40), by="steps")
    works = np.add.reduceat(np.asarray(near.slip_work)[near.pressed + 1 :], np.arange(0, 160, 40))
    own = np.asarray(exact.slip_work)[exact.pressed + 1 :]
    np.testing.assert_allclose(works, own, atol=0.01 * np.sum(own))
    ends = np.asarray(near.displacement)[near.pressed + 40 :: 40] - near.displacement[near.pressed]
    np.testing.assert_allclose(ends, exact.displacement[exact.pressed + 1 :], rtol=0.01)
