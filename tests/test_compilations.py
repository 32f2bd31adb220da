"""Programs that are compiled: numbers are no reason to compile again."""

import logging

import jax
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.contact_line import native
from jbeamshell.scene.keys import NUMBERS


@pytest.fixture
def compiled(caplog):
    """Function that names the programs which were compiled since it was called last."""
    loggers = [logging.getLogger(f"jax._src.{name}") for name in ("interpreters.pxla", "dispatch")]
    before = [logger.propagate for logger in loggers]

    def names():
        told = [r.getMessage() for r in caplog.records if r.getMessage().startswith("Compiling")]
        caplog.clear()
        return [text.split()[1] for text in told]

    with jax.log_compiles(), caplog.at_level(logging.WARNING):
        yield names
    for logger, kept in zip(loggers, before, strict=True):
        logger.propagate = kept


@pytest.mark.doubtful("kinematics are linear", "may buckle", "few nodes", "in the corner")
def test_solve_compiles_once_for_all_numbers_of_a_scene(compiled):
    scene = jb.Scene()
    jb.solve(scene).figures()
    compiled()
    varied = {key: np.asarray(scene.get(key)) for key in NUMBERS if scene.get(key) is not None}
    varied = {key: float(value) for key, value in varied.items() if value.ndim == 0 and value > 0.0}
    del varied["strip.kappa_s"]  # which only the beamshell has
    assert len(varied) >= 10
    for key, value in varied.items():
        history = jb.solve(scene.replace({key: 1.03 * value}))
        assert history.figures()["dissipation"] > 0.0
    # Single operations, such as the products that make E' of E, are compiled at their first use.
    assert [name for name in compiled() if name.startswith("jit(_")] == []


@pytest.mark.skipif(native.library() is None, reason="a walk in JAX is compiled")
def test_a_plain_call_of_plane_elasticity_compiles_no_program(compiled):
    scene = jb.Scene()
    jb.solve(scene).figures()
    own = {"strip.overhang": 0.7, "contact.bolts": [[0.4, 10.0, 0.3], [1.6, 20.0, 0.3]]}
    compiled()
    assert jb.solve(scene.replace(own), throw=False).figures()["dissipation"] > 0.0
    assert [name for name in compiled() if name.startswith("jit(_")] == []


def test_a_plain_contact_of_bodies_on_a_face_compiles_no_program(compiled):
    """In one process after another, the walk of it took eight seconds to compile."""
    side = np.linspace(0.0, 1.0, 4)
    places = np.array([(x, y, 0.0) for x in side for y in side])
    random = np.random.default_rng(1)
    root = random.normal(size=(48, 48))
    forces = np.zeros((48, 2))
    forces[0::3, 0], forces[2::3, 1] = 1.0 / 16, -1.0 / 16
    body = jb.Substructure(places, root @ root.T / 48 + np.eye(48), forces)
    jb.solve_contact(body, friction=0.3, amplitude=0.4, throw=False)
    compiled()
    history = jb.solve_contact(body, friction=0.1, amplitude=0.5, throw=False)
    assert history.converged
    assert float(history.dissipation) > 0.0
    assert compiled() == []


def test_sweeps_share_a_program_whatever_the_scene_s_other_numbers(compiled):
    over = {"load.amplitude": [0.4, 0.8]}
    scenes = [
        jb.Scene().replace({"contact.friction": mu, "strip.height_ratio": eta})
        for mu, eta in [(0.1, 0.11), (0.12, 0.13)]
    ]
    first = jb.sweep(scenes[0], over)["dissipation"].values
    compiled()
    found = jb.sweep(scenes[1], over)["dissipation"].values
    assert compiled() == []
    alone = [
        float(jb.solve(scenes[1].pinned().replace({"load.amplitude": load})).dissipation)
        for load in over["load.amplitude"]
    ]
    assert found == pytest.approx(alone, rel=1e-10)
    assert np.all(found != first)


@pytest.mark.slow
def test_a_response_is_compiled_as_a_whole(compiled):
    """Not operation by operation, also of constants, which took 180 programs."""
    own = {"model.section": "bar", "load.steps_per_half_cycle": 14}  # of no other test
    ask = jb.response(jb.Scene().replace(own).by_load_steps(), ["load.amplitude"])
    compiled()
    first = float(ask(0.5)["dissipation"])
    assert "jit(figures_of)" in (names := compiled())
    assert len(names) <= 10, names  # with single operations that no earlier test has asked for
    # D grows as the cube of the load, but for the grid.
    assert float(ask(0.6)["dissipation"]) == pytest.approx(first * 1.2**3, rel=2e-3)
    assert compiled() == []


def test_responses_share_programs_and_derivatives_whatever_the_scene_s_other_numbers(compiled):
    def slope(stiffness):
        own = {"model.section": "bar", "strip.axial_stiffness": stiffness}
        scene = jb.Scene().replace(own)
        ask = jb.response(scene, ["load.amplitude"])
        return float(ask(0.5)["dissipation"]), float(jax.grad(lambda a: ask(a)["dissipation"])(0.5))

    first = np.array(slope(3.4e4))
    compiled()
    # On any grid a strip moves the less, the stiffer it is.
    np.testing.assert_allclose(slope(1.25 * 3.4e4), first / 1.25, rtol=1e-12)
    assert compiled() == []


@pytest.mark.slow
def test_a_response_is_made_of_traced_numbers_and_tables():
    table = np.array([[0.0, 8.0], [1.0, 8.0], [1.0, 0.0], [2.0, 0.0]])
    few = {"model.nodes": 17, "load.amplitude": 0.3}

    def dissipation(friction, table):
        scene = jb.Scene().replace(few | {"contact.friction": friction, "contact.pressure": table})
        return jb.response(scene, ["load.amplitude"])(0.2)["dissipation"]

    found = jax.jit(dissipation)(0.12, table)
    assert float(found) == pytest.approx(float(dissipation(0.12, table)), rel=1e-9)


def test_interpolated_bodies_are_built_by_one_program(compiled):
    """Not operation by operation, and those that check them not by another."""
    ask = jb.response(jb.Scene().replace({"model.nodes": 23}), ["strip.height_ratio"])
    assert ask(0.1)["dissipation"] > 0.0
    names = compiled()
    assert names.count("jit(_built)") == 1
    assert len(names) < 10
