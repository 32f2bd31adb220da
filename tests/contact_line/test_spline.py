"""Branches read on the spline of their events: a bar's closed form, and figures without steps."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.contact_line import strip
from jbeamshell.contact_line.body import Body
from jbeamshell.contact_line.contact_state import pressed
from jbeamshell.contact_line.walk import walk

LENGTHS = {
    "even": np.full(20, 0.05),
    "graded": np.diff(np.expm1(np.linspace(0.0, 2.0, 21)) / np.expm1(2.0)),
}
STEPS = 29  # of a branch


def bar(lengths):
    """Bar of unit length and stiffness under a friction of one, loaded at its first node."""
    n = lengths.size + 1
    stiffness = np.zeros((n, n))
    for i, length in enumerate(lengths):
        stiffness[i : i + 2, i : i + 2] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / length
    none = jnp.zeros(n)
    tributary = jnp.asarray(0.5 * (np.append(lengths, 0.0) + np.append(0.0, lengths)))
    return Body(
        x=jnp.asarray(1.0 - np.append(0.0, np.cumsum(lengths))),
        tributary=tributary,
        K_tt=jnp.asarray(stiffness),
        K_tn=jnp.zeros((n, n)),
        K_nn=1e3 * jnp.eye(n),
        f_t=none.at[0].set(1.0),
        f_n=none,
        r_0=tributary,
        t_0=none,
        c=jnp.asarray(0.0),
    )


@jax.jit
def cycle(body, amplitude):
    ways = amplitude * jnp.arange(1, STEPS + 1) / STEPS
    forces = jnp.concatenate([ways, amplitude - 2.0 * ways, 2.0 * ways - amplitude])
    turns = tuple(np.arange(forces.size) % STEPS == 0)
    return walk(body, 1.0, pressed(body), forces, turns)


@pytest.mark.parametrize("mesh", LENGTHS)
def test_the_first_loading_of_a_bar_is_its_closed_form(mesh):
    """u = F^2/2 of a bar, on elements that are even or grow threefold and more."""
    for amplitude in (0.1, 0.31, 0.67):
        found = cycle(bar(LENGTHS[mesh]), amplitude)
        force, u = (np.asarray(values)[:STEPS] for values in found.state[3:5])
        np.testing.assert_allclose(u, 0.5 * force**2, atol=1e-14)


@pytest.mark.parametrize(("mesh", "error"), [("even", 1e-3), ("graded", 5e-3)])
def test_a_cycle_of_a_bar_loses_the_cube_of_its_load(mesh, error):
    """D = 2 A^3/3 beyond the first loading, of which a partly slipped node misses a little.

    The bounds are two to four times what was measured: the return is not exact.
    """
    lost = [float(jnp.sum(cycle(bar(LENGTHS[mesh]), a).slip_work[STEPS:])) for a in (0.31, 0.67)]
    np.testing.assert_allclose(lost, [2.0 * a**3 / 3.0 for a in (0.31, 0.67)], rtol=error)


TURNS = jnp.array([1.0, -1.0, 1.0, -1.0, 1.0])
SCENE = jb.Scene().replace(
    {"model.section": "plane", "strip.height_ratio": 0.154, "strip.poisson_ratio": 0.417}
)


@jax.jit
def lost(friction):
    """Logarithm of the dissipation of a strip whose corner opens and closes."""
    body = strip.condensed(SCENE, 49).body
    levels = walk(body, friction, pressed(body), 6.8 * TURNS, (True,) * 5)
    return jnp.log(jnp.sum(levels.slip_work[-2:]))


def test_dissipation_has_no_steps_and_its_derivative_is_its_slope():
    frictions = 0.755 * np.linspace(0.99, 1.01, 41)
    slopes = jax.jit(jax.value_and_grad(lost))
    work, slope = np.array([slopes(mu) for mu in frictions]).T
    rise = np.diff(work) / np.diff(frictions)
    np.testing.assert_allclose(rise, 0.5 * (slope[1:] + slope[:-1]), rtol=5e-3)
    assert np.max(np.abs(np.diff(rise))) < 0.02 * np.mean(np.abs(rise))


FACE = jb.Scene().replace(
    {"model.section": "plane", "load.entry": "face", "strip.height_ratio": 0.11}
)
ON_257_NODES = (  # load, dissipation, and its exponent dlnD/dlnA
    (1.2, 3.85811e-06, 4.8908),
    (2.0, 3.64212e-05, 3.8028),
    (2.8, 1.204678e-04, 3.3673),
    (3.6, 2.747808e-04, 3.2106),
)


def test_few_nodes_have_the_slopes_of_many():
    """Push reaches further than pull: nodes that stuck in one slip in the other."""
    body, friction = jax.jit(lambda: strip.condensed(FACE, 33).body)(), jnp.asarray(0.3)

    @jax.jit
    @jax.value_and_grad
    def lost(amplitude):
        turns = jnp.exp(amplitude) * TURNS
        levels = walk(body, friction, pressed(body), turns, (True,) * 5)
        return jnp.log(jnp.sum(levels.slip_work[-2:]))

    amplitudes, fine, exponents = np.array(ON_257_NODES).T
    work, slopes = np.array([lost(a) for a in np.log(amplitudes)]).T
    np.testing.assert_allclose(np.exp(work), fine, rtol=4e-3)
    np.testing.assert_allclose(slopes, exponents, rtol=1e-2)


MINOR_LOOPS = (1.0, 0.2, 0.8, 0.5, 0.7, 0.2, 1.0, -1.0, -0.4, -0.8, 0.3, -0.8, -1.0, 1.0, -1.0, 1.0)
ONCE_CLOSED = 6  # load of that path at which its first loop closes
TWO_PATCHES = [
    [x, p]
    for a, b in ((0.2, 0.7), (1.1, 1.7))
    for x, p in ((a, 0.0), (a, 16.0), (b, 16.0), (b, 0.0))
]


class Corner(NamedTuple):
    """Path whose corners are of many kinds, and what 257 nodes give for its last cycle.

    Attributes
    ----------
    values : values of the scene
    loads : loads of the path
    lost : dissipation
    slopes : dlnD by the logarithms of friction and of all loads
    """

    values: dict[str, object]
    loads: np.ndarray
    lost: float
    slopes: tuple[float, float]

    @property
    def scene(self):
        return jb.Scene().replace({"model.section": "plane"} | self.values)


CORNERS = {
    "nodes open and close": Corner(
        {"load.entry": "member", "strip.height_ratio": 0.154, "strip.poisson_ratio": 0.417}
        | {"contact.friction": 0.755},
        6.8 * np.asarray(TURNS),
        5.21299e-4,
        (-2.0764, 4.1478),
    ),
    "nodes stick again": Corner(
        {"load.entry": "face", "strip.height_ratio": 0.25, "contact.friction": 0.6},
        5.0 * np.asarray(TURNS),
        1.040195e-4,
        (-3.76911, 5.38747),
    ),
    "two zones meet": Corner(
        {"strip.height_ratio": 0.11, "contact.friction": 0.2, "contact.pressure": TWO_PATCHES},
        2.2 * np.asarray(TURNS),
        6.657019e-5,
        (-4.55373, 6.56744),
    ),
    "nearly all slips": Corner(
        {"strip.height_ratio": 0.11, "contact.friction": 0.1},
        1.95 * np.asarray(TURNS),
        1.378073e-4,
        (-0.92585, 2.92619),
    ),
    "loops within loops": Corner(
        {"strip.height_ratio": 0.11, "contact.friction": 0.1},
        1.3 * np.asarray(MINOR_LOOPS),
        3.92798e-5,
        (-1.1849, 3.1856),
    ),
}


def last_cycle(numbers, body, loads, turns):
    """Logarithm of the dissipation of the last cycle, and displacements, over friction and load."""
    friction, size = jnp.exp(numbers)
    levels = walk(body, friction, pressed(body), size * loads, turns)
    return jnp.log(jnp.sum(levels.slip_work[-2:])), levels.state.displacement


slopes_of = jax.jit(jax.value_and_grad(last_cycle, has_aux=True), static_argnums=3)


@pytest.mark.parametrize("name", CORNERS)
def test_corners_are_those_of_a_fine_grid(name):
    """On 49 nodes dissipation and its slopes are within .3 and 1.2 %; measured .2 and .9 %."""
    corner = CORNERS[name]
    body = jax.jit(lambda: strip.condensed(corner.scene, 49).body)()
    ways = np.sign(np.diff(corner.loads, prepend=0.0))
    turns = tuple(np.append(True, ways[1:] != ways[:-1]).tolist())
    at = jnp.log(jnp.array([float(corner.scene.contact.friction), 1.0]))
    (work, moved), slopes = slopes_of(at, body, jnp.asarray(corner.loads), turns)
    assert float(jnp.exp(work)) == pytest.approx(corner.lost, rel=3e-3)
    np.testing.assert_allclose(slopes, corner.slopes, rtol=1.2e-2)
    if name == "loops within loops":
        # What was within them is forgotten: by 1e-5 to 6e-3, from one number of nodes to the next.
        # .0005 before, which the grid of then met by chance.
        assert float(moved[ONCE_CLOSED] / moved[0]) == pytest.approx(1.0, abs=7e-3)


def test_no_rounding_holds_an_open_node_on_tiny_elements():
    """Elements of 1e-9 are so stiff that rounding outweighs the friction that they may have."""
    layers = [
        [0.008843692744165172, 18929.023811156632, 0.22822190687946475],
        [0.009833669784082727, 209376.2096260786, 0.1443383618823308],
        [0.012643791908010462, 390803.14173045184, 0.029434832991553368],
    ]
    scene = jb.Scene().replace(
        {
            "strip.height_ratio": 0.01566057721812918,
            "strip.kappa_s": 0.9731842659357712,
            "strip.layers": layers,
            "contact.friction": 0.29929430543647734,
            "contact.stick_stiffness": 28.790999832402193,
            "load.amplitude": 2.3813836887702666,
            "model.tolerance": 0.005,
            "model.section": "squeeze",
        }
    )
    coarse = jb.solve(scene, throw=False)
    assert coarse.scene.plan.nodes == 97
    fine = jb.solve(scene.on_grid(193, 0.5 * coarse.scene.plan.end_size), throw=False)
    assert float(coarse.dissipation) == pytest.approx(float(fine.dissipation), rel=2e-3)
