"""Law of a face's points and one Newton step, by NumPy and by JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jbeamshell.bodies import face_part, substructure
from jbeamshell.bodies.face import Drive, Face, Sticking
from jbeamshell.bodies.face_law import Points, slip_at, slip_slopes
from jbeamshell.bodies.face_part import part_of_step
from jbeamshell.bodies.face_step import take_step

POINTS, NODES = 40, 30


def points_of(random, rough):
    heights = np.where(random.random(POINTS) < 0.5, 0.0, 0.3) * rough
    return Points(
        friction=random.uniform(0.0, 1.0, POINTS),
        gap=random.uniform(-0.2, 0.2, POINTS),
        roughness=np.column_stack([heights, random.uniform(0.1, 2.0, POINTS)]),
        springs=random.uniform(1.0, 3.0, (POINTS, 2)),
    )


def face_of(random):
    """A face whose points hang on four nodes each, two points to a group."""
    root = random.normal(size=(3 * NODES, 3 * NODES))
    nodes = np.array([random.permutation(NODES)[:4] for _ in range(POINTS // 2)])
    return Face(
        stiffness=root @ root.T / NODES + np.eye(3 * NODES),
        loads=random.normal(size=(3 * NODES, 2)),
        flexibility=np.diag([0.5, 0.5]),
        places=(3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 12),
        shares=random.normal(size=(POINTS // 2, 6, 12)),
        points=points_of(random, 0.0),
    )


@pytest.mark.parametrize("rough", [0.0, 1.0])
def test_slopes_of_the_law_are_its_derivative(rough):
    random = np.random.default_rng(3)
    points = points_of(random, rough)
    move, slip = random.normal(size=(2, POINTS, 3)) * 0.3

    def one(move, slip, point):
        return slip_at(move[None], slip[None], jax.tree.map(lambda a: a[None], point))[0]

    known = jax.vmap(jax.jacfwd(one))(*jax.tree.map(jnp.asarray, (move, slip, points)))
    found = slip_slopes(move, slip, points)
    np.testing.assert_allclose(found, known, rtol=1e-9, atol=1e-12)
    assert 0 < np.sum(np.any(found[:, :2, :2] != 0.0, axis=(1, 2))) < POINTS  # some stick


def test_forces_of_the_law_are_within_the_cone_of_friction():
    random = np.random.default_rng(4)
    points = points_of(random, 1.0)
    move, slip = random.normal(size=(2, 100, POINTS, 3)) * 0.3
    force = points.stiffness * (slip_at(move, slip, points) - move)
    size = np.linalg.norm(force[..., :2], axis=-1)
    bound = points.friction * force[..., 2]
    assert np.all(force[..., 2] >= -1e-14)
    assert np.all(size <= bound * (1.0 + 1e-12) + 1e-14)
    stick = np.all(slip_at(move, slip, points)[..., :2] == slip[..., :2], axis=-1)
    np.testing.assert_allclose(size[~stick], bound[~stick], atol=1e-12)


@pytest.mark.parametrize("driven", [False, True])
def test_a_newton_step_solves_its_equation_by_factors_iterations_and_programs(driven, monkeypatch):
    random = np.random.default_rng(5)
    face = face_of(random)
    sticking = Sticking.of(face)
    slopes = np.where(random.random(POINTS) < 0.5, 0.3, 0.0)[:, None, None]
    slopes = slopes * random.normal(size=(POINTS, 3, 3))
    k = face.points.stiffness
    right = face.on_nodes(k * np.where(slopes[:, 0] != 0.0, random.normal(size=(POINTS, 3)), 0.0))
    softer = np.zeros((3 * NODES, 3 * NODES))
    for rows, block in zip(face.places, face.blocks(k[:, :, None] * slopes), strict=True):
        softer[np.ix_(rows, rows)] += block
    flexible = sticking.inverse
    if driven:
        flexible = flexible - np.outer(sticking.pulled, sticking.pulled) / sticking.soft
    known = np.linalg.solve(np.eye(len(right)) - softer @ flexible, right)
    traced = jax.tree.map(jnp.asarray, face), jnp.asarray(slopes), jnp.asarray(right)
    monkeypatch.setattr(face_part, "FINEST", 0.0)
    for many in (1, 1000):
        monkeypatch.setattr(face_part, "MANY", many)
        found = part_of_step(face, slopes, right, sticking, np.asarray(driven), 1e-13)
        np.testing.assert_allclose(found, known, rtol=1e-9, atol=1e-9 * np.max(np.abs(known)))
    program = part_of_step(*traced, Sticking.of(traced[0]), jnp.asarray(driven), 0.0)
    np.testing.assert_allclose(program, known, rtol=1e-9, atol=1e-9 * np.max(np.abs(known)))


def test_iterations_that_do_not_end_are_left_to_factors(monkeypatch):
    random = np.random.default_rng(6)
    face = face_of(random)
    sticking = Sticking.of(face)
    right = face.on_nodes(random.normal(size=(POINTS, 3)))
    slopes = np.broadcast_to(0.2 * np.eye(3), (POINTS, 3, 3))
    given = face, slopes, right, sticking, np.asarray(False), 1e-12
    known = part_of_step(*given)
    monkeypatch.setattr(face_part, "MANY", 1)
    monkeypatch.setattr(face_part, "MOST", 2)
    np.testing.assert_allclose(part_of_step(*given), known, rtol=1e-10)


@pytest.mark.parametrize("free", [0, 1, 6])
def test_loose_motions_of_large_bodies_are_those_of_all_eigenvectors(free, monkeypatch):
    random = np.random.default_rng(7)
    size = 60
    turned = np.linalg.qr(random.normal(size=(size, size)))[0]
    values = np.append(np.zeros(free), np.geomspace(1e-5, 1.0, size - free))
    matrix = turned * values @ turned.T
    known = substructure.loose_motions(matrix, 1e-9)
    monkeypatch.setattr(substructure, "LARGE", 1)
    assert substructure._few_loose(matrix, 1e-9) is not None
    found = substructure.loose_motions(matrix, 1e-9)
    assert found.shape == known.shape == (size, free)
    np.testing.assert_allclose(found @ found.T, known @ known.T, atol=1e-9)


def test_many_or_unclear_loose_motions_take_all_eigenvectors():
    values = np.append(np.full(20, 1e-12), np.geomspace(1e-5, 1.0, 40))
    assert substructure._few_loose(np.diag(values), 1e-9) is None
    values = np.append(np.full(3, 1.5e-9), np.geomspace(1e-5, 1.0, 57))
    assert substructure._few_loose(np.diag(values), 1e-9) is None


def test_a_step_takes_out_what_rounding_has_left_in_the_flexibility():
    face = face_of(np.random.default_rng(8))
    sticking = Sticking.of(face)
    rounded = sticking._replace(inverse=sticking.inverse * (1.0 + 1e-7))
    drive = Drive(np.array([0.3, 1.0]), np.asarray(False), np.zeros(()))
    none = np.zeros((POINTS, 3))
    found, known = (take_step(face, each, none, drive, none) for each in (rounded, sticking))
    assert found.error < 1e-12
    np.testing.assert_allclose(found.u, known.u, atol=1e-12 * np.max(np.abs(known.u)))
