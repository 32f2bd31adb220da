"""Comparisons of methods: the figure of each, and each trap seen to close."""

import functools
from pathlib import Path

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from calibration.running import read
from jbeamshell.load_steps.system import System
from verification import methods
from verification.compared import events, grids, laws, shooting, solvers
from verification.compared.strips import scene_of

CYCLE = 8  # load steps per half cycle at most; fewer are held, so that all paths compile once


@functools.cache
def cycled(law, steps):
    """The standard strip along two cycles in so many steps per half cycle, then holds."""
    scene = scene_of("standard", 41).replace(laws.LAWS[law])
    back = 1.0 - 2.0 * np.arange(1, steps + 1) / steps
    levels = np.concatenate([[1.0], *[back, -back] * 2])
    path = np.append(levels, np.full(4 * (CYCLE - steps) + 4, 1.0))
    history = jb.solve(scene, float(scene.load.amplitude) * path)
    cycle = slice(2 * steps + 2, 4 * steps + 2)
    return float(jnp.sum(history.slip_work[cycle])), np.asarray(history.displacement)[1:]


# --- friction laws --------------------------------------------------------------------------------


@pytest.mark.slow
def test_only_the_trap_moves_while_the_load_rests():
    moved, off = {}, {}
    for law in ("sharp", "elastic slip, m = 16", "smooth cap, m = 16"):
        dissipation, displacement = cycled(law, 2)
        moved[law] = np.ptp(displacement[CYCLE:]) / np.ptp(displacement)
        off[law] = abs(dissipation / cycled(law, CYCLE)[0] - 1.0)
    assert moved["sharp"] < 1e-14
    assert moved["elastic slip, m = 16"] < 1e-12
    assert moved["smooth cap, m = 16"] > 3e-4
    assert max(off["sharp"], off["elastic slip, m = 16"]) < 3e-3 < off["smooth cap, m = 16"]


# --- load steps against events --------------------------------------------------------------------


@pytest.mark.doubtful("few nodes")
def test_load_steps_come_to_the_path_from_event_to_event():
    exact, stiffness, changes = events.dissipation(scene_of("standard", 41))
    off = [abs(cycled("sharp", steps)[0] / exact - 1.0) for steps in (1, 2, 4, CYCLE)]
    assert off[0] < 1e-3
    assert off[-1] < 1e-4
    assert np.log2(off[0] / off[-1]) / 3.0 > 1.0
    _, displacement = cycled("sharp", CYCLE)
    width = displacement[4 * CYCLE] - displacement[3 * CYCLE]
    assert 2.0 * 0.7855 / width == pytest.approx(stiffness, rel=1e-9)
    assert changes > 41


def test_events_balance_their_energy():
    """Input work is what is stored and rubbed away, exactly; the path is straight in between."""
    scene = scene_of("thick", 21)
    strip = events.matrices(scene)
    march = events.March(strip)
    branch = march.to(float(scene.load.amplitude))
    force, displacement = branch.force, branch.displacement
    supplied = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(displacement))
    system = System(scene)
    fields = jnp.zeros((21, 4)).at[:, events.FIELDS].set(march.q.reshape(-1, 3))
    sliders = np.sum(strip.tributary * march.traction**2 / (2.0 * strip.slip_stiffness))
    stored = float(system.strain_energy(fields)) + sliders
    assert branch.work > 0.05 * supplied
    assert supplied == pytest.approx(stored + branch.work, rel=1e-10)
    assert np.all(np.abs(march.traction) <= march.cap * (1.0 + 1e-9))


# --- shooting -------------------------------------------------------------------------------------


def test_shooting_loses_the_digits_by_which_its_solutions_grow():
    for length in (3.0, 5.0, 7.0):
        shot = shooting.shoot_squeeze(length)
        assert 1e-3 < shot.error / (np.finfo(float).eps * 10.0**shot.growth) < 10.0
    assert shooting.shoot_squeeze(9.5).error > 1.0
    # The dissertation's strip: 200 x 2 mm, half of it.
    hopeless = shooting.shoot_squeeze(100.0)
    assert hopeless.growth * np.log(10.0) == pytest.approx(440.0, abs=2.0)
    assert hopeless.error > 1e90


# --- iterations -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_plain_newton_fails_where_the_limit_does_not():
    strips = solvers.random_strips(16)
    runs = {}
    for name in ("plain Newton", "limit, no search"):
        run = solvers.runner(name)
        runs[name] = [jax.tree.map(float, run(values)) for values in strips]
    right = np.array([run.dissipation for run in runs["limit, no search"]])
    nothing = solvers.NEGLIGIBLE * np.array([solvers.bar_dissipation(one) for one in strips])
    plain, limited = (solvers.tally(some, right, nothing) for some in runs.values())
    assert limited.found == 1.0
    assert plain.found < 0.8
    assert plain.wrong_but_found == 0.0
    assert plain.worst > 2.0  # by which its dissipation is off, with nothing to show for it


# --- grids ----------------------------------------------------------------------------------------


def test_full_quadrature_locks_by_the_square_of_the_element_over_the_height():
    for eta in (0.02, 0.005):
        scene = STRIP.replace({"strip.height_ratio": eta})
        kappa = 10.0 * 1.3 / (12.0 + 11.0 * 0.3)
        softening = float(scene.strip.shear_modulus / scene.strip.plane_modulus) * kappa / 4.0
        locked = 1.0 / (1.0 + (0.1 / eta) ** 2 * softening)
        assert grids.cantilever(eta, "full") == pytest.approx(locked, rel=0.01)
        assert grids.cantilever(eta, grids.LIBRARY) == pytest.approx(1.0, rel=0.002)


def test_only_the_squeeze_at_the_nodes_never_oscillates():
    overshoot = {
        name: max(grids.squeezed(size, name) for size in (0.5, 1.0, 2.0)) for name in grids.RULES
    }
    assert overshoot.pop(grids.LIBRARY) < 1e-10
    assert min(overshoot.values()) > 0.05
    assert overshoot["one point"] > 2.0 * overshoot["full"]


def test_the_librarys_element_is_the_one_that_is_compared():
    scene = scene_of("standard", 9)
    system = System(scene)
    ours = grids.stiffness(scene, np.asarray(system.x), grids.RULES[grids.LIBRARY])
    fields = np.random.default_rng(0).standard_normal((system.x.size, 4))
    theirs = np.asarray(system.elastic_forces(jnp.asarray(fields), 0.0)).ravel()
    np.testing.assert_allclose(ours @ fields.ravel(), theirs, atol=1e-12 * np.max(np.abs(theirs)))


# --- charts ---------------------------------------------------------------------------------------


@pytest.fixture
def record():
    yield read(Path(methods.__file__).with_suffix(".json"))
    plt.close("all")


def test_charts_show_what_the_record_holds(record):
    axes = methods.chart(record, "steps")
    (row,) = (row for row in record["steps"]["rows"] if row["scene"] == "standard")
    lines = {line.get_label(): line for line in axes.lines}
    np.testing.assert_allclose(lines["standard"].get_ydata(), np.abs(row["off"]))
    axes = methods.chart(record, "solvers")
    shares = [bar.get_width() for bar in axes.patches[: len(record["solvers"]["rows"])]]
    found = [100.0 * row["found"] for row in record["solvers"]["rows"]]
    np.testing.assert_allclose(shares[::-1], found)
    assert sum(axes.axison for axes in methods.draw(record).axes) == 6


def test_what_the_record_lacks_is_said(record):
    with pytest.raises(jb.InputError, match="no section 'laws'"):
        methods.chart({}, "laws")
    with pytest.raises(jb.InputError, match="name = 'heat': choose one of laws, steps"):
        methods.chart(record, "heat")
    with pytest.raises(jb.InputError, match="nothing to draw"):
        methods.draw({})
