"""Trilinear bricks of a box: stiffness and mass, by 2 x 2 x 2 points of Gauss."""

import itertools

import numpy as np
import scipy.sparse

import jbeamshell as jb

CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def box(counts, sizes, at=(0.0, 0.0, 0.0), modulus=210e3, poisson=0.3, density=7.85e-9, held=None):
    """Model of a box, and the places (N, 3) of its nodes, numbered from 1.

    ``held`` is True for the places that do not move.
    """
    edges = np.divide(sizes, counts)
    axes = [a + np.linspace(0.0, s, n + 1) for a, s, n in zip(at, sizes, counts, strict=True)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    number = np.arange(places[..., 0].size).reshape(places.shape[:3])
    nx, ny, nz = counts
    bricks = np.stack(
        [
            number[a : a + nx, b : b + ny, c : c + nz].ravel()
            for a, b, c in itertools.product((0, 1), repeat=3)
        ],
        axis=1,
    )
    k, m = brick(edges, modulus, poisson, density)
    dofs = (3 * bricks[:, :, None] + np.arange(3)).reshape(len(bricks), 24)
    where = np.repeat(dofs, 24, axis=1).ravel(), np.tile(dofs, (1, 24)).ravel()
    stiffness, mass = (
        scipy.sparse.csc_array(scipy.sparse.coo_array((np.tile(e.ravel(), len(bricks)), where)))
        for e in (k, m)
    )
    places = places.reshape(-1, 3)
    rows = np.column_stack(
        [np.repeat(np.arange(1, len(places) + 1), 3), np.tile([1, 2, 3], len(places))]
    )
    free = np.ones(len(rows), bool) if held is None else ~np.repeat(held(places), 3)
    stay = np.flatnonzero(free)
    return jb.StiffnessModel(stiffness[stay][:, stay], rows[stay], mass[stay][:, stay]), places


def brick(edges, modulus, poisson, density):
    """Stiffness and mass (24, 24) of a brick."""
    shear = modulus / (2.0 * (1.0 + poisson))
    lame = modulus * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    law = np.diag([2.0 * shear] * 3 + [shear] * 3)
    law[:3, :3] += lame
    stiffness, mass = np.zeros((24, 24)), np.zeros((24, 24))
    volume = np.prod(edges) / 8.0
    for point in CORNERS / np.sqrt(3.0):
        factors = 0.5 * (1.0 + CORNERS * point)
        shape = np.prod(factors, axis=1)
        slopes = np.stack(
            [
                0.5
                * CORNERS[:, d]
                * np.prod(np.delete(factors, d, axis=1), axis=1)
                * 2.0
                / edges[d]
                for d in range(3)
            ],
            axis=1,
        )
        strain = np.zeros((6, 8, 3))
        for d in range(3):
            strain[d, :, d] = slopes[:, d]
        for row, (a, b) in enumerate(((0, 1), (1, 2), (0, 2)), start=3):
            strain[row, :, a], strain[row, :, b] = slopes[:, b], slopes[:, a]
        b_matrix = strain.reshape(6, 24)
        stiffness += volume * b_matrix.T @ law @ b_matrix
        n_matrix = np.kron(shape, np.eye(3))
        mass += density * volume * n_matrix.T @ n_matrix
    return stiffness, mass
