"""Reliability: a run that converged but is wrong says so; failed steps and requests raise."""

import json
import subprocess
import sys
import warnings
from pathlib import Path

import jax
import numpy as np
import pytest
from scenes import FEW, STEPPED, two_cycles
from toy import STRIP

import jbeamshell as jb
from jbeamshell.history import error_estimates, reliability
from jbeamshell.history.reliability import TOLERANCE
from verification.outcomes import outcome

RECORD = json.loads(
    (Path(__file__).parents[2] / "verification" / "failure_map.json").read_text(encoding="utf-8")
)
# Numbers of the random scenes; the draws are those of verification/failure_map.py.
LOW = np.array([0.005, 0.02, 0.02, 0.0, 0.05, 2.0])
HIGH = np.array([0.5, 1.0, 0.98, 0.49, 3.0, 1e4])
EVEN = np.array([False, False, True, True, False, False])
KEYS = (
    "strip.height_ratio",
    "contact.friction",
    "load.amplitude",
    "strip.poisson_ratio",
    "strip.kappa_s",
    "contact.stick_stiffness",
)
SQUEEZE = jb.Scene().replace({"model.section": "squeeze", "model.tolerance": 0.005})
LITTLE = {"strip.height_ratio": 0.2, "load.amplitude": 0.3}  # only the corner slips


def coarse(values=None, **how):
    """Run on few nodes in few load steps."""
    scene = STEPPED.replace(values or {})
    return jb.solve(scene, two_cycles(float(scene.load.amplitude)), **how)


OVERHANG = {  # slender, and pressed over a third of its length
    "strip.height_ratio": 0.01,
    "contact.friction": 0.3,
    "contact.pressure": [[0, 30], [0.6, 30], [0.6, 0], [2, 0]],
    "model.section": "squeeze",
    "load.amplitude": 2.0,
}


def random_values(count):
    """Values of `KEYS`, (count, 6)."""
    part = np.random.default_rng(7).uniform(size=(2000, len(KEYS)))[:count]
    ratio = np.where(EVEN, 1.0, HIGH / np.where(EVEN, 1.0, LOW))
    values = np.where(EVEN, LOW + part * (HIGH - LOW), LOW * ratio**part)
    values[:, 2] *= values[:, 1] * 20.0  # from a part of gross slip to a force
    return values


def check_random_scenes(count, run, in_vain):
    """Check that no scene is off by 2 % without a doubt, and few fail or are doubted in vain."""
    ends = []
    for values, recorded in zip(random_values(count), RECORD["scenes"][:count], strict=True):
        history = run(dict(zip(KEYS, values, strict=True)))
        found = (
            history.dissipation_ratio,
            *error_estimates.dissipation_errors(history.slip_cycle),
            history.closure,
            np.max(history.iterations),
            np.max(history.status),
        )
        found = [float(v) if np.isfinite(v) else None for v in found]
        ends.append(outcome([*found, *recorded[6:8]]))
    assert "wrong, silently" not in ends
    assert ends.count("fails, and says so") <= 0.005 * count
    assert ends.count("right, but doubted") < in_vain * count
    assert ends.count("wrong, and says so") > 0.05 * count


def test_no_random_scene_is_wrong_silently():
    # On 41 nodes few nodes do the slipping more often than on 81, where a third is in vain.
    check_random_scenes(60, lambda values: coarse(values, throw=False), 0.55)


@pytest.mark.slow(minutes=40)
def test_no_scene_of_two_thousand_is_wrong_silently():
    check_random_scenes(2000, lambda values: jb.solve(STRIP.replace(values), throw=False), 0.2)


@pytest.mark.parametrize(("name", "least"), [("scenes", 2000), ("fresh scenes", 200)])
def test_the_recorded_scenes_hold_no_silent_failure(name, least):
    ends = [outcome(cell) for cell in RECORD[name]]
    assert len(ends) >= least
    assert "wrong, silently" not in ends
    mended = sum(cell[8] is True for cell in RECORD[name])
    assert ends.count("fails, and says so") - mended <= 0.005 * len(ends)


# --- doubts -------------------------------------------------------------------------------------


def even_cycle(nodes, slip=1.0):
    """Cycle in which rigid sliders of equal length under even pressure all slip by the same."""
    there = np.outer([0.0, 1.0, 0.0], np.ones(nodes))
    return error_estimates.SlipCycle(
        x=np.arange(nodes) + 1.0,
        tributary=np.ones(nodes),
        v=slip * there,
        traction=2.0 * there - 1.0,
        reaction=np.full_like(there, 2.0),
        friction=np.asarray(0.5),
        slip_stiffness=np.asarray([np.inf]),
        half_height=np.asarray(1.0),
    )


@pytest.mark.parametrize("nodes", [4, 64])
def test_the_error_of_the_grid_counts_the_nodes_that_share_the_work(nodes):
    even = even_cycle(nodes)
    slip = even.v
    grid, corner = error_estimates.dissipation_errors(even)
    assert grid == pytest.approx(nodes**-1.5)
    assert corner == 0.0
    # A reaction that gathers in the corner matters so far as slip falls within H of the end.
    gathered = even._replace(reaction=even.reaction + 2.0 * (even.x == nodes))
    assert error_estimates.dissipation_errors(gathered)[1] == 0.0
    falling = gathered._replace(v=slip * np.where(even.x < nodes, 0.5, 1.0))
    found = error_estimates.dissipation_errors(falling)[1]
    work = 0.5 * (nodes - 1.0) + 2.0  # of caps 1 and 2, in each half of the cycle
    assert found == pytest.approx(error_estimates.SAFETY * 0.5 * 1.0 / work)


def test_slip_that_does_no_work_leaves_few_nodes_that_share_it():
    """Nodes that open before they move, and round-off where nothing slips."""
    even = even_cycle(64)
    whole = 2.0 * 64.0  # of slip by 1 in both halves of the cycle, against a cap of 1
    for dissipation in (whole, 2.0 * whole):
        known = even._replace(dissipation=np.asarray(dissipation))
        assert error_estimates.dissipation_errors(known)[0] == pytest.approx(64**-1.5)
    half = even._replace(dissipation=np.asarray(0.5 * whole))
    assert error_estimates.dissipation_errors(half)[0] == pytest.approx(16**-1.5)
    for nothing in (0.0, -1e-30, 1e-12):
        stuck = even._replace(dissipation=np.asarray(nothing))
        assert error_estimates.dissipation_errors(stuck)[0] > 1.0


def test_long_load_steps_are_doubted_for_a_reaction_that_changes_within_them():
    even = even_cycle(64)
    changing = even._replace(reaction=even.reaction * np.array([[0.5], [1.5], [0.5]]))
    assert error_estimates.step_error(even) == 0.0
    assert error_estimates.step_error(changing) == pytest.approx(error_estimates.WITHIN_STEPS)
    assert error_estimates.step_error(even_cycle(64, slip=0.0)) == 0.0
    line, steps = jb.Scene(), jb.Scene().by_load_steps()
    assert error_estimates.estimates(line, changing)[3] == 0.0
    assert error_estimates.estimates(steps, changing)[3] == error_estimates.step_error(changing)


@pytest.mark.parametrize("section", ["squeeze", "shell"])
def test_where_nothing_slips_the_estimate_is_infinite(section):
    scene = jb.Scene().replace({"model.section": section})
    errors = error_estimates.estimates(scene, even_cycle(4, slip=0.0))
    assert np.max(errors) == np.inf
    assert np.max(error_estimates.estimates(scene, even_cycle(64))) == pytest.approx(64**-1.5)


def test_a_corner_that_may_open_counts_where_friction_is_elastic():
    even = even_cycle(4)
    rigid = even._replace(
        reaction=even.reaction + 2.0 * (even.x == 4),
        v=even.v * np.where(even.x < 4, 0.5, 1.0),
    )
    elastic = rigid._replace(slip_stiffness=np.asarray([1e6]))
    line, lifting = SQUEEZE, jb.Scene().by_load_steps()
    steps = lifting.replace({"contact.normal": "held"})
    soft, soft_lifting = (s.replace({"contact.stick_stiffness": 999.0}) for s in (line, lifting))
    open_ends = [error_estimates.estimates(scene, rigid)[1] for scene in (line, lifting)]
    held = [error_estimates.estimates(scene, elastic)[1] for scene in (soft, soft_lifting, steps)]
    assert open_ends == [0.0, 0.0]
    assert held[0] == held[1] == held[2] > 0.0
    refined = error_estimates.estimates(soft, elastic, np.asarray(0.01))
    grid = error_estimates.dissipation_errors(elastic)[0]
    assert refined[:2] == (max(0.01, error_estimates.REFINED * grid), 0.0)


def test_the_corner_of_plane_elasticity_counts_its_element_over_the_slip_zone():
    even, plane = even_cycle(400), jb.Scene().replace({"model.section": "plane"})
    last = even.x == 400
    gathered = even._replace(
        reaction=even.reaction + 1000.0 * last, v=even.v * np.where(last, 1.0, 0.5)
    )
    assert error_estimates.dissipation_errors(gathered)[1] > 0.1
    even_pull = plane.replace({"load.entry": "traction"})
    for scene, part in ((plane, error_estimates.BEYOND), (even_pull, error_estimates.SINGULAR)):
        found = error_estimates.singular_corner_error(scene, gathered)
        assert found == pytest.approx(part / 400)
    stuck = even_cycle(400, slip=0.0)
    assert error_estimates.singular_corner_error(plane, stuck) == np.inf
    grid, corner, *_ = error_estimates.estimates(plane, gathered)
    assert corner == error_estimates.singular_corner_error(plane, gathered)
    assert grid == pytest.approx(
        error_estimates.SPREAD * error_estimates.dissipation_errors(gathered)[0]
    )
    assert error_estimates.estimates(plane, even)[1] == 0.0  # no reaction gathers


@pytest.mark.parametrize(("steps", "doubted"), [(40, True), (80, False), ("auto", False)])
def test_few_steps_along_an_arc_are_doubted(steps, doubted):
    arc = {"load.control": "arc-length", "load.amplitude": 1e-4}
    scene = jb.Scene().replace(arc | {"load.steps_per_half_cycle": steps})
    assert ("arc length" in str(reliability.doubts_of_scene(scene))) == doubted


SOFT = {"strip.poisson_ratio": 0.4999, "strip.height_ratio": 0.1, "load.amplitude": 1.2}
ON_513_NODES = 2.976486854e-5  # its dissipation


@pytest.mark.parametrize("section", ["auto", "squeeze"])
def test_a_nearly_incompressible_strip_does_not_lock(section):
    found = jb.solve(jb.Scene().replace(SOFT | {"model.section": section}))
    error = abs(float(found.dissipation) / ON_513_NODES - 1.0)
    assert error < float(found.dissipation_error) < found.scene.model.tolerance


# Where elements let nodes slip to and fro for nothing, these two chatter: nodes slip and stick by
# turns, responses of the first are 3 % off, and grids of the second are 2.5 % apart.
PINNED = {"load.entry": "guided", "strip.far_end": "pinned", "load.amplitude": 2.655134829}
PINNED |= {"strip.height_ratio": 0.0519514579, "strip.poisson_ratio": 0.4336321978}
PINNED |= {"contact.friction": 0.1416343096}
LIFTED = {"load.entry": "member", "load.amplitude": 0.8033347331, "contact.friction": 0.08781114857}
LIFTED |= {"strip.height_ratio": 0.03470367537, "strip.poisson_ratio": 0.1609738187}
LIFTED["contact.bottom_pressure"] = [[0.717, 0.0], [0.717, 5.6245], [1.955, 5.6245], [1.955, 0.0]]


@pytest.mark.parametrize(("values", "fine"), [(PINNED, 2.5642e-4), (LIFTED, 2.19327e-5)])
def test_nodes_do_not_chatter_near_gross_slip(values, fine):
    """Dissipation beside that on 257 nodes; also read by a response, whose loops close too."""
    scene = jb.Scene().replace(values)
    found, ask = jb.solve(scene), jb.response(scene, ["load.amplitude"])
    assert float(found.dissipation) == pytest.approx(fine, rel=1e-3)
    assert abs(float(found.closure)) < error_estimates.CLOSES
    read = float(ask(values["load.amplitude"])["dissipation"])
    assert read == pytest.approx(float(found.dissipation), rel=1e-3)


def test_a_loop_that_does_not_close_is_off_by_what_it_leaves_open():
    found = jb.solve(jb.Scene())
    u = np.array(found.displacement)
    u[-1] += 0.1 * np.ptp(u)
    opened = found.but(displacement=u)
    assert float(found.dissipation_error) < 0.01
    assert float(opened.dissipation_error) == pytest.approx(abs(float(opened.closure)))
    assert any("does not close" in doubt for doubt in opened.doubts)


@pytest.mark.slow
def test_the_dissipation_of_a_nearly_incompressible_strip_is_as_recorded():
    linear = {"model.section": "squeeze", "model.kinematics": "linear"}
    found = jb.solve(jb.Scene().replace(SOFT | linear).on_grid(513, 1.0 / 384.0))
    assert float(found.dissipation) == pytest.approx(ON_513_NODES, rel=1e-6)


def test_the_error_of_the_grid_is_larger_where_the_pressure_has_steps():
    even, part = even_cycle(64), [[0.0, 0.0], [0.5, 0.0], [0.5, 9.0], [2.0, 9.0]]
    scene, steps = jb.Scene(), {"contact.pressure": part}
    for section, smooth, stepped in (
        ("squeeze", 1.0, error_estimates.STEPS),
        ("plane", error_estimates.SPREAD, error_estimates.JOINT),
    ):
        its = scene.replace({"model.section": section})
        for values, factor in (({}, smooth), (steps, stepped)):
            grid = error_estimates.estimates(its.replace(values), even)[0]
            assert grid == pytest.approx(factor * 64**-1.5)


@pytest.mark.doubtful("in the corner", "the section squeeze", "single nodes", "within a load step")
def test_a_doubtful_run_warns_with_the_fix():
    with pytest.warns(jb.DoubtfulWarning, match=r"off by about \d+ %: few nodes do .*model.nodes"):
        history = coarse(LITTLE)
    assert history.figures()["doubts"] == list(history.doubts)
    assert f"doubtful: {history.doubts[0]}" in str(history)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = coarse(LITTLE, throw=False)
    assert again.doubts == history.doubts


@pytest.mark.slow
def test_the_standard_strip_is_beyond_doubt():
    with warnings.catch_warnings():
        warnings.simplefilter("error", jb.DoubtfulWarning)
        history = jb.solve(STRIP.replace({"model.kinematics": "linear"}))
    assert history.doubts == ()
    assert 1e-3 < float(history.dissipation_error) < TOLERANCE


def relative_error(run, times=6):
    """Relative error of a run's dissipation, to the same model on elements of 1/times the size."""
    coarse = SQUEEZE.plan
    mesh = times * (coarse.nodes - 1) + 1, coarse.end_size / times
    fine = jb.solve(run.scene.pinned().on_grid(*mesh), throw=False)
    return abs(float(run.dissipation / fine.dissipation) - 1.0)


@pytest.mark.parametrize(
    ("load", "nodes"),
    [
        *(pytest.param(*each, marks=pytest.mark.slow) for each in ((1.0, 65), (0.1, 129))),
        (0.02, 257),
    ],
)
def test_elements_are_halved_until_the_tolerance_is_kept(load, nodes):
    run = jb.solve(SQUEEZE.replace({"load.amplitude": load}), throw=False)
    assert not any("elements" in doubt for doubt in run.doubts)
    assert run.x.size == run.scene.plan.nodes == nodes
    assert relative_error(run) <= float(run.dissipation_error) < run.scene.model.tolerance
    assert ("halving the elements" in str(run)) == (nodes > 65)
    # Only this run is on the finer grid: any change of its scene goes back to the chosen one.
    assert run.scene.replace({"load.amplitude": 1.0}).plan == SQUEEZE.plan
    assert run.scene.pinned().plan.nodes == nodes


@pytest.mark.parametrize(
    "values",
    [
        {"load.amplitude": 0.1, "model.nodes": 65, "model.tolerance": 0.1},
        {"contact.friction": 0.0},
    ],
)
def test_a_given_grid_and_a_strip_without_friction_are_never_refined(values):
    assert jb.solve(jb.Scene().replace(values), throw=False).change is None


def test_a_refined_run_that_misses_its_tolerance_is_doubted(tmp_path):
    run = jb.solve(SQUEEZE.replace({"load.amplitude": 0.006}), throw=False)
    assert run.scene.model.tolerance < float(run.change) <= float(run.dissipation_error)
    assert relative_error(run) < float(run.change)
    run.save(tmp_path / "run.npz")
    again = jb.read_history(tmp_path / "run.npz")
    assert again.dissipation_error == run.dissipation_error
    assert len(again.doubts) == len(run.doubts) == 2  # of the grid, and of the section
    assert "few nodes do the slipping, and halving the elements changed the loop" in run.doubts[0]


@pytest.mark.slow
def test_the_estimate_falls_with_the_elements():
    scene = STEPPED.replace({"load.amplitude": 0.3})
    # Smaller elements at the end alone would leave the slip zone's other elements as they are.
    grids = (41, 1.0 / 6.0), (81, 1.0 / 12.0), (161, 1.0 / 24.0)
    runs = [jb.solve(scene.on_grid(*grid)) for grid in grids]
    grid = [float(error_estimates.dissipation_errors(run.slip_cycle)[0]) for run in runs]
    assert grid[0] > 2.0 * grid[1] > 4.0 * grid[2]


def test_where_nothing_slips_the_dissipation_is_doubted():
    tiny = {"load.amplitude": 1e-4, "contact.stick_stiffness": 2.0}
    history = coarse(tiny, throw=False)
    assert np.isinf(history.dissipation_error)
    assert "nothing slips" in history.doubts[0]
    assert coarse({"contact.friction": 0.0}).doubts == ()


@pytest.mark.doubtful("nothing slips")
def test_where_nothing_slips_on_any_grid_no_change_is_told():
    run = jb.solve(SQUEEZE.replace({"load.amplitude": 1e-6}))
    assert np.isinf(run.change)
    assert "halving the elements" not in str(run)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"strip.axial_stiffness": 10.0}, "take model.kinematics = exact"),
        (OVERHANG, "its Euler load is 1.43"),
        (OVERHANG | {"load.amplitude": 0.5}, None),
        (OVERHANG | {"contact.pressure": 30.0}, None),
        ({}, None),
    ],
)
def test_what_a_scene_alone_makes_doubtful(changes, told):
    doubts = reliability.doubts_of_scene(
        STRIP.replace({"model.nodes": 41, "model.kinematics": "linear"} | changes)
    )
    assert len(doubts) == (told is not None)
    assert all(told in doubt for doubt in doubts)


def one_resting_node(k_t):
    """A cycle of a strip whose last node carries all of its end: v goes to and fro by 1."""
    v = np.outer([1.0, 0.0, -1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.1, 1.0])
    tributary = np.array([1.0, 1.0, 0.5, 0.1, 0.05])
    reaction = np.tile([10.0, 10.0, 0.0, 0.0, 60.0], (5, 1))
    traction = np.zeros((5, 5))
    traction[:, 0] = 2.0 * v[:, -1]
    traction[:, -1] = np.clip(min(k_t, 1e3) * v[:, -1], -6.0, 6.0)
    x = np.array([0.0, 1.0, 2.0, 2.3, 2.4])
    return error_estimates.SlipCycle(x, tributary, v, traction, reaction, 0.1, k_t, 0.3)


def test_an_elastic_slider_of_a_single_node_is_doubted():
    found = [error_estimates.slider_error(one_resting_node(k)) for k in (3.0, 6e2, np.inf)]
    soft, stiff, rigid = found
    for found, held in ((soft, 3.0 * 0.05), (stiff, 6.0 * 0.05)):  # it sticks, and it slides
        assert found == pytest.approx(error_estimates.RESTING * held / (2.0 + held))
    assert rigid == 0.0
    even = one_resting_node(3.0)._replace(reaction=np.full((5, 5), 10.0))
    assert error_estimates.slider_error(even) == 0.0
    traced = jax.jit(error_estimates.slider_error)(one_resting_node(3.0))
    assert float(traced) == pytest.approx(float(soft))


@pytest.mark.slow
def test_a_laminate_that_rests_on_its_corner_is_doubted_as_much_as_it_is_off():
    layers = [[0.1871051, 4.135e6, 0.0547], [0.1073678, 6.195e5, 0.2985]]
    strip = jb.Scene().replace(
        {
            "strip.height_ratio": 0.2655840800334541,
            "strip.layers": [*layers, [0.2655840800334541 * 2 - 0.2944729, 5107.0, 0.2244]],
            "strip.kappa_s": 1.6326,
            "contact.friction": 0.1998,
            "contact.stick_stiffness": 92.86,
            "load.amplitude": 1.5992,
        }
    )
    chosen = jb.solve(strip, tolerance=0.005)
    assert chosen.doubts == ()
    linear = strip.replace({"model.section": "squeeze", "model.kinematics": "linear"})
    steps = linear.replace({"model.nodes": 161}).by_load_steps()
    for coarse in (linear.on_grid(65, 1.0 / 48.0), linear.on_grid(129, 1.0 / 48.0), steps):
        run = jb.solve(coarse)
        assert any("rests on single nodes" in doubt for doubt in run.doubts)
        off = 1.0 - float(run.dissipation / chosen.dissipation)
        assert 0.7 < float(run.dissipation_error) / off < 1.5
    ideal = linear.replace({"contact.stick_stiffness": None})
    assert not any("single nodes" in doubt for doubt in jb.solve(ideal).doubts)


@pytest.mark.parametrize("unit", [1e-30, 1e30])
def test_the_estimate_knows_no_units(unit):
    history = coarse(throw=False)
    cycle = history.slip_cycle._replace(dissipation=history.dissipation)
    scaled = cycle._replace(
        **{name: unit * getattr(cycle, name) for name in ("x", "tributary", "v", "half_height")},
        slip_stiffness=cycle.slip_stiffness / unit,
        dissipation=cycle.dissipation * unit**2,
    )
    own, other = (
        [*error_estimates.dissipation_errors(c), error_estimates.slider_error(c)]
        for c in (cycle, scaled)
    )
    np.testing.assert_allclose(other, own, rtol=1e-12)


def test_an_open_loop_and_a_failed_run_are_doubted():
    history = jax.tree.map(np.array, coarse(throw=False))
    shifted = history.displacement.copy()
    shifted[-1] += 0.01 * np.ptp(shifted)
    opened = history.but(displacement=shifted)
    assert any("does not close" in doubt for doubt in opened.doubts)
    failed = history.but(status=np.append(history.status[:-1], 1))
    assert [doubt[:33] for doubt in failed.doubts] == ["a load step found no equilibrium:"]


# --- many cycles, few digits ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cycles", "steps"), [(9, 1), pytest.param(1000, 4, marks=pytest.mark.slow)]
)
def test_cycles_neither_drift_nor_lose_energy(cycles, steps):
    branch = 0.7855 * (1.0 - 2.0 * np.arange(1, steps + 1) / steps)
    path = np.append([0.7855] * (1 if steps > 1 else 2), [*branch, *-branch] * cycles)
    history = jb.solve(STEPPED, path, throw=False)
    ends = np.array([stop for _, _, stop in history.cycles])
    closed = np.asarray(history.displacement)[ends[1:]]
    assert np.max(np.abs(np.diff(closed))) < 1e-8 * np.ptp(np.asarray(history.displacement))
    lost = np.diff(np.cumsum(np.asarray(history.slip_work))[ends[1:]])
    assert np.ptp(lost) < 1e-8 * lost[0]
    # The trapezoid of few steps misses the same part of the work in every cycle.
    missed = np.diff(np.asarray(history.energy_imbalance)[ends[1:]])
    assert np.ptp(missed) < 1e-8 * lost[0]
    if steps > 1:
        lost = float(history.dissipation)
        assert float(history.dissipation_loop) == pytest.approx(lost, rel=0.02)


@pytest.mark.slow
def test_load_steps_are_solved_in_double_precision():
    shell = {"model.nodes": 41, "model.kinematics": "linear", "load.steps_per_half_cycle": 4}
    shell |= {"model.section": "shell", "contact.normal": "held"}
    code = f"""
import json, warnings
import jbeamshell as jb
warnings.simplefilter("ignore", jb.DoubtfulWarning)
history = jb.solve(jb.Scene().replace({shell!r}), solver=jb.Newton(1e-9))
print(json.dumps([str(history.force.dtype), float(history.dissipation)]))
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    exact = float(jb.solve(STRIP.replace(shell)).dissipation)
    assert json.loads(run.stdout) == ["float32", pytest.approx(exact, rel=2e-6)]


# --- mounting of a single lap -------------------------------------------------------------------

OPEN = jb.library.single_lap().replace(FEW | {"load.entry": "member"})
KEYS_OF_OVERHANGS = ("member.overhang", "strip.overhang")


def with_overhangs(scene, length):
    return scene.replace(dict.fromkeys(KEYS_OF_OVERHANGS, length))


def mounted(history):
    return [doubt for doubt in history.doubts if "bends by the lengths" in doubt]


@pytest.mark.parametrize("section", ["plane", pytest.param("squeeze", marks=pytest.mark.slow)])
def test_a_single_lap_without_overhangs_is_doubted_by_what_they_make(section):
    scene = OPEN.replace({"model.section": section})
    history = jb.solve(scene, throw=False)
    (doubt,) = mounted(history)
    longer = jb.solve(with_overhangs(scene, 2.0), throw=False)
    ratio = float(longer.dissipation / history.dissipation)
    assert ratio > 1.2
    assert float(history.overhung) == pytest.approx(ratio, rel=1e-9)
    assert "with member.overhang = strip.overhang = 2, as long as the overlap" in doubt
    assert f"it loses {ratio:.3g} times as much" in doubt
    assert longer.overhung is None
    assert not mounted(longer)


@pytest.mark.doubtful("few nodes", "gathers in the corner")
def test_the_doubt_of_a_mounting_is_a_warning_and_is_saved(tmp_path):
    with pytest.warns(jb.DoubtfulWarning, match="a single lap bends by the lengths"):
        history = jb.solve(OPEN)
    history.save(tmp_path / "run.npz")
    assert jb.read_history(tmp_path / "run.npz").doubts == history.doubts


def test_one_overhang_leaves_the_other_open():
    scene = OPEN.replace({"strip.overhang": 1.0})
    history = jb.solve(scene, throw=False)
    longer = jb.solve(scene.replace({"member.overhang": 2.0}), throw=False)
    assert float(history.overhung) == pytest.approx(
        float(longer.dissipation / history.dissipation), rel=1e-9
    )


def test_a_joint_that_is_driven_by_its_displacement_is_told_under_the_same_forces():
    by_force = jb.solve(OPEN, throw=False)
    driven = {"load.control": "displacement", "load.amplitude": by_force.peak_displacement}
    history = jb.solve(OPEN.replace(driven), throw=False)
    assert float(history.overhung) == pytest.approx(float(by_force.overhung), rel=0.01)
    slides = jb.solve(OPEN.replace(driven | {"load.amplitude": 1e-3}), throw=False)
    assert slides.overhung is None  # its force is that of gross slip with any overhangs


@pytest.mark.slow
def test_overhangs_change_nothing_where_the_loaded_end_may_deflect():
    """The joint is statically determinate then."""
    scene = OPEN.replace({"member.loaded_end": "free"})
    history = jb.solve(scene, throw=False)
    assert history.overhung is None
    longer = jb.solve(with_overhangs(scene, 1.0), throw=False)
    assert float(longer.dissipation) == pytest.approx(float(history.dissipation), rel=1e-3)


def test_a_joint_that_nothing_loses_has_no_ratio():
    run = jb.solve(with_overhangs(OPEN, 1.0), throw=False)
    still = run.but(slip_work=0.0 * run.slip_work)
    assert np.isinf(reliability.ratio_of_losses(run, still))
    assert float(reliability.ratio_of_losses(still, still)) == 1.0
    failed = run.but(status=run.status + 1)
    assert np.isnan(reliability.ratio_of_losses(failed, run))
    for ratio, words in ((np.inf, "and here it loses none"), (np.nan, "finds no equilibrium")):
        doubted = jb.solve(OPEN, throw=False).but(overhung=np.asarray(ratio))
        assert words in mounted(doubted)[0]


def test_a_slender_lap_says_how_far_linear_kinematics_are_off_and_what_to_do():
    slender = with_overhangs(OPEN.replace({"strip.height_ratio": 0.05}), 2.0)
    (doubt,) = reliability.doubts_of_scene(slender)
    assert doubt.endswith(
        "a lap joint knows no others: allow for that error, or hold the joint nearer to its "
        "overlap, by a smaller member.overhang and strip.overhang"
    )
    assert "load is 3.2 % of what buckles the joint" in doubt
