"""Strips and walks by NumPy, which plain calls compile nothing for, beside JAX."""

import equinox as eqx
import jax
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.common.numbers_of import numbers_of, put, scan, while_loop
from jbeamshell.contact_line.strip import condensed
from jbeamshell.numerics.factors import inverse_cholesky

NODES = 17
BOLTS = [[0.4, 10.0, 0.3], [1.6, 20.0, 0.3]]
LAP = {"member.support": "clamped", "strip.far_end": "free", "contact.bottom_pressure": 10.0}
SCENES = {
    "strip": {},
    "bolts, an overhang": {"contact.bolts": BOLTS, "strip.overhang": 0.5},
    "laminate, both faces": {
        "strip.layers": [[0.1, 2.0e4, 0.3], [0.1252, 1.5e5, 0.2]],
        "contact.bottom_pressure": 2.0,
        "load.entry": "face",
    },
    "lap, a gap, pressed with friction": LAP
    | {"member.gap": 1e-6, "member.assembly": "frictional", "member.height_ratio": 0.2},
}
by_jax = eqx.filter_jit(condensed)


def of_numpy(scene):
    """Scene whose numbers are arrays of NumPy."""
    return jax.tree.map(np.asarray, scene.in_one_form())


@pytest.mark.parametrize("name", SCENES)
def test_a_strip_is_condensed_as_by_jax(name):
    scene = of_numpy(jb.Scene().replace({"model.section": "plane"} | SCENES[name]))
    own, known = condensed(scene, NODES), by_jax(scene, NODES)
    assert numbers_of(own) is np
    for part in ("K_tt", "K_tn", "K_nn", "f_t", "f_n", "r_0", "t_0", "c", "x", "tributary"):
        one, other = (np.asarray(getattr(strip.body, part)) for strip in (own, known))
        # Elements of 1e-4 H are 1e4 times as stiff as what they move, and round what they leave.
        scale = np.max(np.abs(known.body.r_0 if part == "t_0" else other), initial=0.0)
        atol = (1e-7 if name.startswith("lap") else 1e-8) * scale
        np.testing.assert_allclose(one, other, atol=atol, err_msg=part)
    np.testing.assert_allclose(
        own.lift, known.lift, atol=1e-9 * max(np.abs(known.lift).max(), 1e-6)
    )


@pytest.mark.parametrize("shape", [(4, 4), (3, 5, 5), (0, 0), (2, 0, 0)])
def test_inverse_factors_are_those_of_jax(shape, capfd):
    root = np.random.default_rng(0).normal(size=shape)
    matrix = root @ root.mT + np.eye(shape[-1])
    inverse = inverse_cholesky(matrix)
    np.testing.assert_allclose(
        inverse @ matrix @ inverse.mT, matrix * 0.0 + np.eye(shape[-1]), atol=1e-12
    )
    assert capfd.readouterr() == ("", "")
    if matrix.size:
        np.testing.assert_allclose(inverse, jax.jit(inverse_cholesky)(matrix), atol=1e-13)
        assert np.all(np.isnan(inverse_cholesky(-matrix)))


@pytest.mark.parametrize("reverse", [False, True])
def test_loops_are_those_of_jax(reverse):
    def step(carry, given):
        return carry + given["a"], (carry * given["b"], given["a"])

    inputs = {"a": np.arange(1.0, 5.0), "b": np.arange(8.0).reshape(4, 2)}
    own = scan(step, np.float64(2.0), inputs, reverse=reverse)
    known = scan(step, jax.numpy.float64(2.0), inputs, reverse=reverse)
    jax.tree.map(np.testing.assert_array_equal, own, known)
    assert numbers_of(own) is np
    for start in (np.float64(1.0), jax.numpy.float64(1.0)):
        assert float(while_loop(lambda x: x < 50.0, lambda x: 3.0 * x, start)) == 81.0


def test_put_leaves_what_it_was_given():
    array = np.zeros((2, 2))
    np.testing.assert_array_equal(put(array, (0, slice(None)), 1.0), [[1.0, 1.0], [0.0, 0.0]])
    assert not array.any()
