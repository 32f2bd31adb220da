"""Areas and normals of faces from their elements: closed forms, moments, and refusals."""

import numpy as np
import pytest

import jbeamshell as jb
from calibration.finite_elements.boxes import box
from jbeamshell.bodies.surface import matched, spread

SQUARE = np.array([[1, 0, 0, 0], [2, 1, 0, 0], [3, 1, 1, 0], [4, 0, 1, 0]], float)


def grid(nx, ny, jitter=0.0, seed=0):
    """Nodes and quadrilaterals of a rectangle 4 x 3, those inside moved at random."""
    x, y = np.meshgrid(np.linspace(0.0, 4.0, nx + 1), np.linspace(0.0, 3.0, ny + 1), indexing="ij")
    moved = np.random.default_rng(seed).uniform(-jitter, jitter, (2, nx + 1, ny + 1))
    moved[:, [0, -1]] = moved[:, :, [0, -1]] = 0.0
    number = 10 + np.arange(x.size).reshape(x.shape)
    flat = [number.ravel(), (x + moved[0]).ravel(), (y + moved[1]).ravel(), np.zeros(x.size)]
    around = (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    return np.column_stack(flat), np.stack([part.ravel() for part in around], axis=1)


def some_triangles(quads, seed):
    """Elements of which a part is cut along a diagonal, some named against the clock."""
    draw = np.random.default_rng(seed)
    cut = [([q[:3], q[[0, 2, 3]]] if draw.random() < 0.5 else [q]) for q in quads]
    return [row[:: draw.choice([-1, 1])] for rows in cut for row in rows]


class TestAreas:
    def test_an_even_grid_has_the_shares_of_its_rectangles(self):
        areas, normals = jb.face_surface(*grid(4, 3))
        edge = np.outer([0.5, 1, 1, 1, 0.5], [0.5, 1, 1, 0.5])
        np.testing.assert_allclose(areas, edge.ravel(), rtol=1e-13)
        np.testing.assert_allclose(normals, np.tile([0.0, 0.0, 1.0], (20, 1)), atol=1e-14)

    @pytest.mark.parametrize("seed", range(5))
    def test_a_distorted_mesh_keeps_area_and_first_moments(self, seed):
        # sum N_i x_i is x, so that the forces of an even pressure have its resultant and moments.
        nodes, quads = grid(5, 4, jitter=0.25, seed=seed)
        areas, normals = jb.face_surface(nodes, some_triangles(quads, seed), (0.1, 0.2, -1.0))
        assert np.sum(areas) == pytest.approx(12.0, rel=1e-12)
        np.testing.assert_allclose(areas @ nodes[:, 1:], [24.0, 18.0, 0.0], rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(normals[:, 2], -1.0, rtol=1e-12)

    def test_a_cylinder_has_its_radii_for_normals(self):
        count, rows, radius = 24, 3, 5.0
        angle = 2.0 * np.pi * np.arange(count) / count
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        nodes = [
            [1 + k * count + i, x[i], y[i], 2.0 * k] for k in range(rows) for i in range(count)
        ]
        nodes = np.array(nodes)
        number = np.arange(1, 1 + count * rows).reshape(rows, count)
        ahead = np.roll(number, -1, axis=1)
        around = (number[:-1], ahead[:-1], ahead[1:], number[1:])
        quads = np.stack([part.ravel() for part in around], axis=1)
        areas, normals = jb.face_surface(nodes, quads)
        radial = nodes[:, 1:] * [1.0, 1.0, 0.0] / radius
        np.testing.assert_allclose(normals, radial, atol=1e-12)
        chord = 2.0 * radius * np.sin(np.pi / count)
        assert np.sum(areas) == pytest.approx(count * chord * 4.0, rel=1e-12)
        inward = jb.face_surface(nodes, quads, -radial).normals
        np.testing.assert_allclose(inward, -radial, atol=1e-12)

    def test_an_even_load_has_the_resultant_one(self):
        nodes, quads = grid(5, 4, jitter=0.25)
        made = jb.face_surface(nodes, quads)
        pressure = spread(made, nodes[:, 0].astype(int))
        assert set(pressure[:, 1]) == {3.0}
        assert np.sum(pressure[:, 2]) == pytest.approx(-1.0)  # against the normals
        pull = spread(made, nodes[:, 0].astype(int), 1)
        np.testing.assert_allclose(pull[:, 2], made.areas / 12.0, rtol=1e-12)


class TestBody:
    def test_elements_give_a_body_its_areas_and_normals(self):
        model, places = box((4, 3, 1), (4.0, 3.0, 1.0), held=lambda places: places[:, 2] == 1.0)
        nodes, quads = grid(4, 3)
        at = [int(np.argmin(np.linalg.norm(places - row[1:], axis=1))) + 1 for row in nodes]
        number = dict(zip(nodes[:, 0].astype(int).tolist(), at, strict=True))
        quads = np.vectorize(number.get)(quads)[:, ::-1]  # as seen from below
        nodes[:, 0] = at
        loads = {"pull": [[at[0], 1, 1.0]], "press": [[[at[0], 3, -1.0]]]}
        body = model.condensed(nodes, elements=quads, **loads)
        assert float(np.sum(body.tributary)) == pytest.approx(12.0)
        np.testing.assert_allclose(body.normals, np.tile([0.0, 0.0, 1.0], (20, 1)), atol=1e-14)
        with pytest.raises(jb.InputError, match="tributary = "):
            model.condensed(nodes, elements=quads, tributary=np.ones(20), **loads)


class TestMatch:
    def test_nodes_in_any_order_are_paired(self):
        upper, _ = grid(4, 3, jitter=0.2)
        lower = np.add(upper, [100.0, 0.0, 0.0, 1e-8])
        order = np.random.default_rng(0).permutation(len(lower))
        found = matched(upper, lower[order])
        np.testing.assert_array_equal(found, lower)

    @pytest.mark.parametrize(
        ("change", "words"),
        [
            (lambda lower: lower[:-1], "upper.face = 'node 29': is 1"),
            (lambda lower: np.append(lower, [[900, 9.0, 9.0, 0.0]], axis=0), "lower.face = '21"),
            (lambda lower: np.add(lower, [0.0, 0.01, 0.0, 0.0]), "mesh both faces alike"),
        ],
    )
    def test_faces_that_do_not_match_are_refused(self, change, words):
        upper, _ = grid(4, 3)
        with pytest.raises(jb.InputError, match=words):
            matched(upper, change(upper.copy()))


class TestRefusals:
    @pytest.mark.parametrize(
        ("elements", "words"),
        [
            ([], "elements = 0"),
            ([[1, 2]], "elements\\[0\\] = \\[1, 2\\]: give rows of the 3, 4, 6"),
            ([[1, 2, 3], [1, 3, 1, 4]], "elements\\[1\\] = "),
            ([[1, 2, 3, 9]], "node 9: is not in nodes"),
            ([[1, 2, 3]], "nodes = \\[4\\]: is in no element"),
            ([[1, 3, 2, 4]], "crosses itself"),
            ([[1, 2, 3], [1, 4, 3]], "node 1': has elements that face to opposite sides"),
            ([[1, 2, 3, 4, 5, 6]], "node 5: is not in nodes"),
            ([[1, 2, 3, 4, 5]], "give rows of the 3, 4, 6"),
            ([[1, 2, 3, 4.5]], "whole numbers"),
            ([[1, 2, 3, 4], [2, 1, 4, 3]], "elements\\[1\\] = .* is elements\\[0\\] again"),
        ],
    )
    def test_elements_that_are_no_mesh_are_refused(self, elements, words):
        with pytest.raises(jb.InputError, match=words):
            jb.face_surface(SQUARE, elements)

    def test_a_side_that_is_not_clear_is_refused(self):
        with pytest.raises(jb.InputError, match="to which side"):
            jb.face_surface(SQUARE, [[1, 2, 3, 4]], (1.0, 0.0, 0.0))
