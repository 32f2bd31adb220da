"""Load paths in load steps: bar limit, drift, smoothing, order in the grid, failed steps."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import HELD, STEPPED, STEPS, held_at
from toy import STRIP

import jbeamshell as jb
from jbeamshell.mechanics import bar
from jbeamshell.scene.plan import STEPS as LOAD_STEPS
from jbeamshell.solving import solve as solving


@pytest.mark.parametrize(
    ("settings", "error"),
    [  # measured: 2.3 %, and .64 % on the planned grid, which aims at 1 %
        ({}, 0.03),
        pytest.param(
            {"model.nodes": "auto", "load.steps_per_half_cycle": "auto"},
            1e-2,
            marks=pytest.mark.slow,
        ),
    ],
    ids=["41 nodes", "planned"],
)
def test_bar_limit_gives_backbone_and_cubic_law(settings, error):
    history = jb.solve(STEPPED.replace({"strip.height_ratio": 0.001} | settings), throw=False)
    start = history.cycles[0][0]
    loading = history.force[1 : start + 1]
    backbone = bar.bar_backbone(loading, 3.4e4, 1.0)
    assert float(history.dissipation_ratio) == pytest.approx(1.0, abs=error)
    close = error * float(backbone[-1])
    np.testing.assert_allclose(history.displacement[1 : start + 1], backbone, atol=close)


def test_a_bar_loses_as_much_where_little_presses():
    """Slip stays where a thirtieth of the largest pressure acts, on .8 of 1.1."""
    pressed = [[0.0, 30.0], [0.9, 30.0], [0.9, 1.0], [2.0, 1.0]]
    thin = {"strip.height_ratio": 0.001, "contact.pressure": pressed, "load.amplitude": 0.08}
    history = jb.solve(STEPPED.replace(thin), throw=False)
    lost = float(bar.cubic_law(0.08, 3.4e4, 0.1))
    assert float(history.dissipation) == pytest.approx(lost, rel=0.04)


SMOOTHED = pytest.param(16.0, 1e-4, marks=pytest.mark.slow)


def cycled(smoothing, ends, **values):
    """Strip between two loads for nine cycles."""
    scene = HELD.replace({"contact.smoothing": smoothing} | values)
    return jb.solve(scene, np.append(ends[::-1] * 9, np.full(2, ends[-1])), throw=False)


@pytest.mark.parametrize(("smoothing", "drift"), [("sharp", 1e-12), SMOOTHED])
def test_cycles_inside_the_cone_neither_drift_nor_dissipate(smoothing, drift):
    history = cycled(smoothing, [-0.1, 0.1], **{"strip.height_ratio": 0.4})
    cap = history.scene.contact.friction * history.reaction
    assert 0.5 < float(jnp.max(jnp.abs(history.traction / cap))) < 0.8
    peaks = np.asarray(history.displacement[1:19:2])
    assert np.ptp(peaks) < drift * peaks[0]
    assert float(jnp.sum(jnp.abs(history.slip_work))) / 9 < drift * 0.1 * peaks[0]


# It creeps ever slower: by 1.2e-4 a cycle over the first eight, by 6.6e-5 over a hundred.
CREEPS = pytest.param(16.0, 1.5e-4, marks=pytest.mark.slow)


@pytest.mark.parametrize(("smoothing", "drift"), [("sharp", 1e-13), CREEPS])
def test_one_sided_cycling_at_the_cap_creeps_only_if_smoothed(smoothing, drift):
    history = cycled(smoothing, [0.6, 0.7])
    peaks = np.asarray(history.displacement[1:19:2])
    creep = abs(peaks[-1] - peaks[0]) / peaks[0] / 8
    assert creep < drift
    assert (creep > 1e-6) == (smoothing != "sharp")
    work = float(jnp.sum(jnp.abs(history.slip_work[2:]))) / 8
    assert work < drift * 0.7 * peaks[0]


@pytest.mark.slow
@pytest.mark.parametrize("smoothing", ["sharp", 8.0, 32.0])
def test_smoothing_does_not_change_the_dissipation(smoothing):
    values = {"contact.smoothing": smoothing, "load.steps_per_half_cycle": 20}
    history = jb.solve(STEPPED.replace(values), throw=False)
    assert float(history.dissipation_ratio) == pytest.approx(0.7695, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("grid", "order"), [("finite-difference", 2.0), ("collocation", 4.0)])
def test_order_of_convergence_in_the_grid(grid, order):
    """A stuck strip on its elastic foundation is smooth: no slip front spoils the order."""

    def end(nodes):
        scene = STRIP.replace(
            {
                "model.grid": grid,
                "model.nodes": nodes,
                "model.kinematics": "linear",
                "contact.friction": 100.0,
                "contact.stick_stiffness": 3.0,
            }
        )
        return float(jb.solve(scene, np.array([1.0])).displacement[-1])

    values = np.array([end(nodes) for nodes in (41, 81, 161)])
    rate = np.log2(np.abs(np.diff(values)[:-1] / np.diff(values)[1:]))
    assert rate[-1] == pytest.approx(order, abs=0.3)


# --- failure --------------------------------------------------------------------------------------

BAR = STEPPED.replace({"model.section": "bar"})  # compiles soonest
LAME = jb.Newton(max_iterations=1, tolerance=1e-12)


def test_an_unconverged_step_is_never_silent(monkeypatch):
    # As many pieces as the path has steps: one shape to compile.
    monkeypatch.setattr("jbeamshell.load_steps.recovery.PIECES", (STEPS,))
    path = held_at([0.1, 0.2, 0.9])
    with pytest.raises(jb.UnconvergedError, match=r"load step \d+ of 20 .* found no equilibrium"):
        jb.solve(BAR, path, solver=LAME)
    history = jb.solve(BAR, path, solver=LAME, throw=False)
    first = int(np.argmax(np.asarray(history.status) > 0))
    assert not history.converged
    assert history.status[first] == jb.Status.MAX_ITERATIONS
    assert set(np.asarray(history.status[first + 1 :]).tolist()) == {jb.Status.NOT_REACHED}
    assert bool(jnp.all(jnp.isnan(history.force[first:])))
    assert bool(jnp.all(jnp.isfinite(history.force[:first])))
    assert np.isnan(jb.solve(BAR, solver=LAME, throw=False).dissipation)


def test_inside_a_transformation_the_failure_is_loud_too():
    run = jax.jit(lambda mu: jb.solve(BAR.replace({"contact.friction": mu})).dissipation)
    known = float(jb.solve(BAR, throw=False).dissipation)
    assert float(run(0.1)) == pytest.approx(known, rel=1e-12)
    with pytest.raises(Exception, match="a load step found no equilibrium"):
        jax.block_until_ready(run(0.03))  # gross slip is at .6


@pytest.mark.slow
def test_a_failed_step_is_walked_in_pieces():
    """The recovered path ends where a path with small steps ends."""
    # So smooth that large steps take more iterations than small ones.
    scene = STEPPED.replace({"contact.smoothing": 4.0})
    path = np.array([0.9, -0.9, *[0.9] * 22])  # held at its end, to be as long as the fine one
    eager = jb.Newton(max_iterations=100)
    fine = jb.solve(
        scene,
        np.concatenate([np.linspace(a, b, 9)[1:] for a, b in ((0, 0.9), (0.9, -0.9), (-0.9, 0.9))]),
        solver=eager,
    )
    needed = int(jnp.max(fine.iterations))
    history = jb.solve(scene, path, solver=jb.Newton(max_iterations=needed))
    plain = jb.solve(scene, path, solver=eager)
    assert int(jnp.max(plain.iterations)) > needed  # the whole step takes more than is allowed
    np.testing.assert_allclose(history.force[1:], path)
    assert float(history.displacement[-1]) == pytest.approx(float(fine.displacement[-1]), rel=1e-6)
    assert float(jnp.sum(history.slip_work)) == pytest.approx(
        float(jnp.sum(fine.slip_work)), rel=1e-6
    )


def test_single_precision_says_what_it_cannot_do():
    with pytest.raises(jb.InputError, match="single precision"):
        jb.Newton(tolerance=1e-9).tolerance_for(jnp.dtype("float32"))


@pytest.mark.parametrize(
    ("path", "told"),
    [
        ([], "path"),
        ([[0.1]], "path"),
        ([0.1, np.nan], "path"),
        ([0.1, np.inf], "path"),
        ([1.0, 2.0], "gross slip"),
        (None, r"load.amplitude = 2.5.*'displacement'"),
    ],
)
def test_paths_that_are_none(path, told):
    with pytest.raises(jb.InputError, match=told):
        jb.solve(BAR.replace({"load.amplitude": 2.5}) if path is None else BAR, path)


def test_every_run_has_the_same_digits_and_the_first_one_alone_compiles():
    first = jb.solve(BAR, throw=False)
    size = solving._stepped._quick._cache_size()
    rest = [jb.solve(BAR, throw=False) for _ in range(9)]
    assert solving._stepped._quick._cache_size() == size
    assert_equal_digits(first, rest)


def assert_equal_digits(first, rest):
    for name in ("force", "displacement", "traction", "slip_work"):
        values = np.asarray(getattr(first, name))
        assert all(np.array_equal(values, getattr(history, name)) for history in rest)


def test_plain_numbers_inside_a_callers_jit():
    def inside(path=None):
        return jax.eval_shape(lambda: jb.solve(BAR, path).dissipation)

    assert inside().shape == ()
    with pytest.raises(jb.InputError, match="gross slip"):
        inside([1.0, 2.0])


@pytest.fixture
def optimised():
    jax.config.update("jax_disable_most_optimizations", False)
    yield
    jax.config.update("jax_disable_most_optimizations", True)


@pytest.mark.slow
def test_the_first_run_has_the_digits_of_the_hundredth(optimised):
    few = {"model.nodes": 5, "model.section": "bar", "model.kinematics": "exact"}
    few |= {"load.cycles": 1, "load.steps_per_half_cycle": 2}
    scene = jb.Scene().replace(few)
    first, *rest = (jb.solve(scene, throw=False) for _ in range(100))
    assert first.scene.plan.engine == LOAD_STEPS
    assert first.converged
    assert_equal_digits(first, rest)
