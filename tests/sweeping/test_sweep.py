"""Sweeps: lane by lane what `solve` says, whatever the block, and nothing lost when cut off."""

import csv
import dataclasses
import itertools
import re

import numpy as np
import pytest
from small import FIGURES, MANY, SCENE, TINY, same

import jbeamshell as jb
from jbeamshell.common.errors import DoubtfulWarning, InputError
from jbeamshell.scene.load_path import check
from jbeamshell.sweeping import job, lanes, runner
from jbeamshell.sweeping.lanes import Outcome, lanes_of

PLANE = {"model.section": "plane", "model.nodes": 17, "load.steps_per_half_cycle": 1}
OPEN = {"model.kinematics": "auto"}
OVER = {"load.amplitude": [0.3, 1.9, 1.1, 2.5, 0.7], "strip.height_ratio": [0.05, 0.4]}
HELD = SCENE.replace({"contact.normal": "held"})
PATCH = [[0.0, 12.0], [1.0, 12.0], [1.0, 5.0], [2.0, 8.0]]


@pytest.fixture(scope="module")
def result():
    return jb.sweep(SCENE, OVER, FIGURES)


def lanes_in(over):
    """Every lane's place in the arrays and its numbers."""
    places = itertools.product(*(range(len(values)) for values in over.values()))
    return zip(places, itertools.product(*over.values()), strict=True)


def summary(good, failed, outside):
    return f"{good} converged, {failed} failed, {outside} outside the domain"


# --- what a lane says -----------------------------------------------------------------------------


@pytest.mark.doubtful("in the corner", "few nodes", "nothing slips", "lock", "the section squeeze")
def test_every_lane_says_what_solve_says(result):
    assert result["dissipation"].shape == (5, 2)
    for at, numbers in lanes_in(OVER):
        scene = SCENE.replace(dict(zip(OVER, numbers, strict=True)))
        if numbers[0] > 2.0:
            assert result.status[at] == Outcome.OUTSIDE
            assert all(np.isnan(result[name][at]) for name in FIGURES)
            continue
        history = jb.solve(scene)
        for name in FIGURES:
            right = float(np.ravel(getattr(history, name))[-1])
            # Where nothing slips the dissipation is round-off.
            zero = {"dissipation": 1e-18, "dissipation_ratio": 1e-13}.get(name, 0.0)
            assert float(result[name][at]) == pytest.approx(right, rel=1e-9, abs=zero), (at, name)
    assert result.attrs["summary"] == (
        f"10 lanes over load.amplitude (5), strip.height_ratio (2): {summary(8, 0, 2)}"
    )
    assert re.match(r"2 lanes lie outside .*: load.amplitude = 2.5: .*gross slip", result.notes)


@pytest.mark.slow
def test_a_lane_that_needs_exact_rotations_leaves_the_others_alone():
    """The part that nothing presses is a column: the thin strip may buckle, the other may not."""
    overhang = {"contact.friction": 0.3, "load.amplitude": 1.0}
    overhang["contact.pressure"] = [[0.0, 30.0], [0.6, 30.0], [0.6, 0.0], [2.0, 0.0]]
    scene, heights = jb.Scene().replace(TINY | overhang | OPEN), [0.01, 0.05]
    found = jb.sweep(scene, {"strip.height_ratio": heights}, ["dissipation"])
    assert "1 lanes need exact rotations" in found.attrs["notes"]
    alone = [jb.solve(scene.replace({"strip.height_ratio": h}), throw=False) for h in heights]
    assert [run.scene.plan.kinematics for run in alone] == ["exact", "linear"]
    known = [float(run.dissipation) for run in alone]
    # Plain calls find the matrices by NumPy, which rounds those of nine nodes otherwise.
    np.testing.assert_allclose(found["dissipation"], known, rtol=1e-6)


def test_pairs_are_the_product_lane_by_lane(result):
    columns = np.array(list(itertools.product(*OVER.values()))).T
    paired = jb.sweep(SCENE, dict(zip(OVER, columns, strict=True)), FIGURES, paired=True)
    assert dict(paired.sizes) == {"lane": 10}
    for name in FIGURES:
        np.testing.assert_array_equal(paired[name], result[name].values.ravel())
    with pytest.raises(InputError, match="equally many"):
        jb.sweep(SCENE, OVER, paired=True)


def test_many_blocks_answer_as_one():
    told = []
    amplitudes = np.append(MANY["load.amplitude"], 2.1)
    many = jb.sweep(
        SCENE,
        MANY | {"load.amplitude": amplitudes},
        FIGURES,
        progress=lambda done, total: told.append((done, total)),
    )
    some = jb.sweep(SCENE, {key: values[::5] for key, values in MANY.items()}, FIGURES)
    found = many["dissipation"][:12:5, ::5]
    np.testing.assert_allclose(found, some["dissipation"], rtol=1e-12)
    assert (told[0], told[-1], len(told)) == ((0, 96), (96, 96), 13)
    assert summary(96, 0, 8) in many.summary


def _eta(heights):
    return {"strip.height_ratio": heights}


@pytest.mark.doubtful("in the corner", "few nodes", "nothing slips", "lock", "plane elasticity")
def test_lanes_that_fail_are_solved_alone_and_leave_the_others_alone(result, monkeypatch):
    batched, alone = runner.Runner._answers, []

    def failing(self, columns):
        """As if the first lane of every block had failed in the batch."""
        values, status = map(np.array, batched(self, columns))
        values[..., 0, 0], status[..., 0, 0] = np.nan, Outcome.MAX_ITERATIONS
        return values, status

    def solve(scene, **settings):
        """Fails again at one height, and finds another lane to be no model."""
        alone.append(float(scene.load.amplitude))
        if scene.load.amplitude == 0.7:
            raise InputError("no such thing")
        history = jb.solve(scene)
        bad = history.status.at[-1].set(Outcome.NOT_REACHED)
        return dataclasses.replace(history, status=bad) if scene.load.amplitude == 1.1 else history

    monkeypatch.setattr(runner.Runner, "_answers", failing)
    monkeypatch.setattr(runner, "run", solve)
    over = {"load.amplitude": [0.3, 1.9, 1.1, 0.7], "strip.height_ratio": [0.05] * 31 + [0.4]}
    with pytest.warns(DoubtfulWarning, match=r"of 128 lanes found no equilibrium.*`status`"):
        hurt = jb.sweep(SCENE, over, FIGURES)
    assert len(alone) == 128 // job.LEAST
    assert set(alone) <= {0.3, 1.9, 1.1, 0.7}
    failed, outside = alone.count(1.1), alone.count(0.7)
    assert summary(128 - failed - outside, failed, outside) in hurt.summary
    known = hurt["status"].values == Outcome.CONVERGED
    for name in FIGURES:
        right, found = result[name].values[[0, 1, 2, 4]][:, [0] * 31 + [1]], hurt[name].values
        np.testing.assert_allclose(found[known], right[known], rtol=1e-9, atol=1e-13)
        assert np.all(np.isnan(found[~known]))


@pytest.mark.doubtful("lanes may be off")
def test_a_lane_that_is_solved_alone_has_the_estimate_of_its_run(monkeypatch):
    failing, scene = runner.Runner._answers, jb.Scene().replace(PLANE)

    def failed(self, columns):
        values, status = map(np.array, failing(self, columns))
        return values, np.full_like(status, jb.Status.MAX_ITERATIONS)

    together = jb.sweep(scene, {"load.amplitude": [0.7]})
    monkeypatch.setattr(runner.Runner, "_answers", failed)
    alone = jb.sweep(scene, {"load.amplitude": [0.7]})
    for name, values in together.data_vars.items():
        np.testing.assert_allclose(alone[name], values, rtol=1e-9, err_msg=name)


@pytest.mark.doubtful("in the corner", "few nodes", "lock", "the section squeeze")
def test_a_figure_of_nought_over_nought_is_told_from_a_failure(result, monkeypatch):
    batched = runner.Runner._answers

    def undefined(self, columns):
        values, status = map(np.array, batched(self, columns))
        values[1] = np.nan
        return values, status

    monkeypatch.setattr(runner.Runner, "_answers", undefined)
    monkeypatch.setattr(runner, "_figures", lambda *given: np.array([1.0, np.inf, 2.0, 3.0]))
    monkeypatch.setattr(runner, "run", lambda scene, **settings: jb.solve(scene))
    odd = jb.sweep(SCENE, {"load.amplitude": [0.3, 1.9], **_eta([0.05])}, FIGURES)
    assert np.all(odd["status"] == Outcome.UNDEFINED)
    assert np.all(np.isnan(odd["dissipation_ratio"]))
    assert np.all(odd["dissipation"] == 1.0)
    assert "2 lanes have a figure that is not defined there (0/0)" in odd.notes


# --- the domain -----------------------------------------------------------------------------------

EDGES = {
    "strip.length": (-1.0, 0.0, 1.0, 3.0),
    "strip.height_ratio": (-0.1, 0.0, 0.1),
    "strip.half_height": (-0.1, 0.0, 0.1),
    "strip.axial_stiffness": (0.0, 1.0),
    "strip.youngs_modulus": (0.0, 1e4),
    "strip.poisson_ratio": (-1.0, -0.9, 0.0, 0.49, 0.5),
    "strip.kappa_s": (0.0, 0.4),
    "strip.curvature": (-0.01, 0.0),
    "contact.friction": (-0.1, 0.0, 0.03, 0.5),
    "contact.pressure": (-1.0, 0.0, 3.0, 30.0),
    "contact.bottom_pressure": (-1.0, 0.0, 5.0, 11.0),
    "contact.stick_stiffness": (0.0, 10.0),
    "contact.smoothing": (1.0, 16.0),
    "contact.normal_stiffness": (0.0, 10.0),
    "load.amplitude": (-1.0, 0.0, 0.5, 1.9999, 2.0, 3.0),
}
LIFTED = {"model.section": "squeeze"}
SCENES = {
    "standard": SCENE,
    "table": SCENE.replace({"contact.pressure": PATCH}),
    "tipping": SCENE.replace(
        LIFTED
        | {"contact.pressure": PATCH, "strip.far_end": "free", "contact.bottom_pressure": 5.0}
    ),
    "unfounded": SCENE.replace(LIFTED | {"contact.normal": "none", "load.amplitude": 0.1}),
    "layers": SCENE.replace({"strip.layers": [[0.1, 3e5, 0.3], [0.1252, 1e5, 0.2]]}),
    "bar": SCENE.replace(
        {"model.section": "bar", "load.control": "displacement", "load.amplitude": 1e-5}
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_outside_is_what_a_scene_or_solve_refuses_one_by_one(name):
    scene, seen = SCENES[name], []
    for key, values in EDGES.items():
        if key == "load.amplitude" and scene.load.control == "displacement":
            values = (0.0, 1e-6, 1e-5, 1e-4)
        for value, outside in zip(values, lanes_of(scene, {key: values}).outside(), strict=True):
            try:
                if key == "strip.curvature" and "w" not in scene.plan.fields:
                    continue  # refused whole
                if name == "layers" and key in ("strip.axial_stiffness", "strip.youngs_modulus"):
                    continue
                if name == "layers" and key == "strip.poisson_ratio":
                    continue
                check(scene.replace({key: value}))
                refused = False
            except InputError:
                refused = True
            assert refused == outside, (key, value)
            seen.append(refused)
    assert {True, False} == set(seen)


def test_the_domain_knows_of_keys_that_go_together():
    over = {"contact.friction": [0.05, 0.1], "load.amplitude": [0.9, 1.5], **_eta([0.1])}
    assert lanes_of(SCENE, over).outside()[..., 0].tolist() == [[False, True], [False, False]]
    assert lanes_of(SCENE, over).amplitude_over_height[1, 1, 0] == pytest.approx(15.0)
    moved = lanes_of(SCENE, {"load.amplitude": [1e-6]})
    assert np.all(np.isfinite(moved.difficulty))


def test_a_sweep_wholly_outside_runs_nothing():
    nothing = jb.sweep(SCENE, {"load.amplitude": [2.0, 3.0], "strip.kappa_s": [0.44]})
    assert nothing["dissipation"].shape == (2, 1)
    assert summary(0, 0, 2) in nothing.summary


# --- bad input ------------------------------------------------------------------------------------


REFUSED = [
    ({"over": {}}, "name at least one"),
    ({"over": {"contact.frction": [0.1]}}, "did you mean 'contact.friction'"),
    ({"over": {"strip.layers": [1.0]}}, "no single number"),
    ({"over": {"model.nodes": [9]}}, "no single number"),
    ({"over": {"load.amplitude": []}}, "is empty"),
    ({"over": {"load.amplitude": [[1.0]]}}, "not an array of shape"),
    ({"over": {"load.amplitude": [0.1, np.nan]}}, "must be finite"),
    ({"over": {"load.amplitude": ["a"]}}, "give numbers"),
    ({"over": {"strip.half_height": [0.1], **_eta([0.1])}}, "say the same thing"),
    ({"over": dict.fromkeys(["load.amplitude", "strip.length"], np.ones(5000))}, "25,000,000"),
    ({"scene": HELD, "over": {"strip.curvature": [0.1]}}, "needs a strip that may lift off"),
    ({"figures": ()}, "name at least one"),
    ({"figures": ("dissipatoin",)}, "choose"),
    ({"figures": ("dissipation", "dissipation")}, "names one twice"),
    ({"figures": ("traction",)}, "choose|no number"),
    ({"figures": ("slip",)}, "is no number"),
    ({"figures": ("loop",)}, "is no number"),
    ({"figures": ("converged",)}, "choose 'force'"),
    ({"out": "sweep.txt"}, r"end the name in \.csv"),
    ({"out": "nowhere/sweep.csv"}, "there is no folder"),
]


def test_what_cannot_be_done_is_refused_before_anything_is(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for given, says in REFUSED:
        with pytest.raises(InputError, match=says) as caught:
            jb.sweep(**{"scene": SCENE, "over": OVER} | given)
        assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_a_sweep_within_the_limit_fits_into_memory():
    with pytest.raises(InputError, match=r"take 1,188 MB .* sweep 3 times"):
        lanes.check_size(12_000_000, 4)
    lanes.check_size(4_000_000, 4)


# --- what is left on disk -------------------------------------------------------------------------


@pytest.mark.doubtful("lanes may be off")
def test_the_table_holds_every_number_to_the_last_bit(result, tmp_path):
    again = jb.sweep(SCENE, OVER, FIGURES, out=tmp_path / "sweep.csv")
    same(result, again)
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.csv"]
    with (tmp_path / "sweep.csv").open(encoding="utf-8") as file:
        header, *rows = list(csv.reader(file))
    assert header == [*OVER, *FIGURES, "status", "doubtful"]
    for name, column in zip(header, zip(*rows, strict=True), strict=True):
        known = result[name].broadcast_like(result["status"]).transpose(*OVER).values.ravel()
        if name == "status":
            assert list(column) == [Outcome(code).name.lower() for code in known]
        elif name == "doubtful":
            assert list(column) == known.astype(str).tolist()
        else:
            read = np.array([float(word) if word else np.nan for word in column])
            np.testing.assert_array_equal(read, known)


def test_a_sweep_that_was_cut_off_goes_on(tmp_path):
    over, out = MANY, tmp_path / "sweep.csv"
    whole = jb.sweep(SCENE, over, FIGURES)
    parts = tmp_path / "sweep.csv.parts"

    def cut(done, total):
        if done >= 40:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="keeps what is done"):
        jb.sweep(SCENE, over, FIGURES, out=out, progress=cut)
    assert not out.exists()
    blocks = sorted(parts.glob("block-*"))
    assert len(blocks) == 40 // job.LEAST
    blocks[0].write_bytes(blocks[0].read_bytes()[:100])  # a disk that ran full
    (parts / ".draft.npz").touch()  # of a block that was being written

    with pytest.raises(InputError, match="holds another sweep"):
        jb.sweep(SCENE, over | _eta([0.1]), FIGURES, out=out)
    with pytest.raises(InputError, match="holds another sweep"):
        jb.sweep(SCENE.replace({"contact.friction": 0.11}), over, FIGURES, out=out)
    rest = jb.sweep(SCENE, over, FIGURES, out=out)
    assert rest.notes == "32 lanes were done before"
    same(whole, rest)
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.csv"]


@pytest.mark.slow
def test_a_sweep_of_a_strip_given_by_e_and_h_goes_on(tmp_path):
    """Given numbers stay given in the lanes of a store, and after an interruption."""
    given = {"strip.length": 120.0, "strip.half_height": 6.0, "strip.youngs_modulus": 210e3}
    given |= {"contact.friction": 0.2, "load.amplitude": 120.0, "load.cycles": 1}
    given |= {"model.section": "squeeze", "model.nodes": 9, "model.kinematics": "linear"}
    over = {
        "load.amplitude": np.linspace(20.0, 150.0, 12),
        "strip.half_height": np.linspace(4.0, 8.0, 4),
    }
    out = tmp_path / "sweep.csv"

    def cut(done, total):
        if done >= 16:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        jb.sweep(jb.Scene().replace(given), over, FIGURES, out=out, progress=cut)
    rest = jb.sweep(jb.Scene().replace(given), over, FIGURES, out=out)
    assert "16 lanes were done before" in rest.notes
    same(jb.sweep(jb.Scene().replace(given), over, FIGURES), rest)
    lane = jb.Scene().replace(given | {name: values[-1] for name, values in over.items()})
    assert float(lane.strip.youngs_modulus) == 210e3
    found = float(jb.solve(lane, throw=False).dissipation)
    assert float(rest["dissipation"][-1, -1]) == pytest.approx(found, rel=1e-6)


def test_other_files_in_the_store_are_left_alone(tmp_path):
    parts = tmp_path / "sweep.csv.parts"
    parts.mkdir()
    (parts / "thesis.tex").touch()
    jb.sweep(SCENE, OVER, FIGURES, out=tmp_path / "sweep.csv")
    assert [path.name for path in parts.iterdir()] == ["thesis.tex"]


def test_a_model_of_ones_own_is_not_kept_on_disk():
    scene = jb.Scene(energy=lambda e, g, k, psi, dpsi: e**2)
    with pytest.raises(InputError, match="sweep it without them"):
        job.Job(lanes_of(scene, OVER), scene, FIGURES).description()


def test_lanes_advance_together_as_far_as_they_share_a_body():
    """Grids share one body for each height; pairs at random are interpolated together."""
    shared = np.array([[1, 1, 1, 1, 1, 2, 2, 3]])
    np.testing.assert_array_equal(runner.places_in_chunks(shared, 3), [0, 1, 2, 3, 4, 6, 7, 9])
    count = runner.ABREAST
    pressures, heights = np.linspace(5.0, 9.0, count), np.linspace(0.05, 0.1, count)
    over = {"contact.pressure": pressures, "strip.height_ratio": heights}

    def chunks(section, over, paired=False):
        scene = jb.Scene().replace({"model.section": section, "model.nodes": 17})
        return job.Job(lanes_of(scene, over, paired), scene, ("dissipation",)).chunks

    assert chunks("squeeze", over).width == count
    assert chunks("squeeze", over, paired=True).width == 1
    pairs = over | {"strip.height_ratio": np.repeat(heights[: count // 2], 2)}
    assert chunks("squeeze", pairs, paired=True).width == 2
    assert chunks("squeeze", {"strip.height_ratio": heights}).width == 1
    assert chunks("squeeze", {"contact.pressure": pressures[:5]}).width == 8
    assert chunks("plane", over, paired=True) == runner.Chunks(runner.APART, alike=False)
    gap = {"strip.curvature": np.linspace(0.0, 1e-5, count)}  # of which each is condensed
    assert chunks("plane", over | gap, paired=True).width == 1


@pytest.mark.doubtful("few nodes")
def test_lanes_of_plane_elasticity_share_their_bodies():
    """A grid whose heights share a body, beside the same strips paired at random."""
    scene = jb.Scene().replace(PLANE)
    over = {"load.amplitude": [0.4, 0.8, 1.2], "strip.height_ratio": [0.05, 0.1]}
    grid = jb.sweep(scene, over, ["dissipation"])
    order = np.random.default_rng(0).permutation(6)
    pairs = np.array(np.meshgrid(*over.values(), indexing="ij")).reshape(2, -1)[:, order]
    mixed = jb.sweep(scene, dict(zip(over, pairs, strict=True)), ["dissipation"], paired=True)
    np.testing.assert_allclose(
        mixed["dissipation"], grid["dissipation"].values.ravel()[order], rtol=1e-12
    )
    alone = jb.solve(scene.replace({"load.amplitude": 1.2, "strip.height_ratio": 0.05}))
    np.testing.assert_allclose(grid["dissipation"][2, 0], alone.dissipation, rtol=1e-8)


ON_257_NODES = (  # height ratio, load and dissipation of strips of plane elasticity
    (0.4, 0.153447, 6.05986e-12),
    (0.4, 0.179814, 3.19883e-11),
    (0.4, 0.246919, 5.33496e-10),
    (0.4, 0.465602, 3.41438e-08),
    (0.1126, 0.050571, 6.29666e-13),
    (0.1126, 0.095359, 1.08674e-10),
    (0.1126, 0.465602, 8.57518e-07),
    (0.1126, 1.028824, 1.83096e-05),
    (0.03, 0.014223, 2.00681e-14),
    (0.03, 0.026819, 2.92243e-12),
    (0.03, 0.050571, 1.28813e-10),
    (0.03, 0.749222, 8.07911e-06),
)


def test_lanes_of_plane_elasticity_are_doubted_where_they_are_off():
    """At tall heights and small loads, where the corner matters, and far from there."""
    height, load, fine = np.array([*ON_257_NODES, (0.1126, 1e-9, np.nan)]).T
    over = {"strip.height_ratio": height, "load.amplitude": load}
    with pytest.warns(DoubtfulWarning, match=r"of 13 lanes may be off by more than 2 %"):
        every = jb.sweep(jb.Scene().replace({"model.section": "plane"}), over, paired=True)
    assert np.all(every["status"] == Outcome.CONVERGED)
    assert every["dissipation_error"][-1] == np.inf  # nothing slips
    assert every["doubtful"][-1]
    found, fine = every.isel(lane=slice(12)), fine[:12]
    off = np.abs(found["dissipation"] / fine - 1.0)
    assert np.all(off <= found["dissipation_error"])
    assert np.sum(off > 0.02) == 5
    assert np.all(found["doubtful"][off > 0.02])
    assert np.sum(found["doubtful"]) <= 7  # the other two are off by 1.6 %
