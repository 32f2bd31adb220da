"""Fits: of a formula, where the answer is known, and of the model's own curves."""

import itertools
import json
import os

import matplotlib.pyplot as plt
import numpy as np
import pytest
import scipy.optimize
from toy import KEYS, START, STRIP, TRUTH, Formula, X, formula, readings, scene

import jbeamshell as jb
from jbeamshell import identify
from jbeamshell.identify.parameters import Parameter, as_parameters
from jbeamshell.identify.problem import Problem
from jbeamshell.identify.runs import Runs
from jbeamshell.identify.search_space import search_space
from jbeamshell.identify.specimens import Specimen
from jbeamshell.measured.curves import Backbone, DissipationCurve, SqueezeCurve, StiffnessCurve
from jbeamshell.measured.example import example_loops
from jbeamshell.measured.loops import Loop, make_loop

MU, ETA, KAPPA = KEYS
FREE = (MU, ETA)
MODEL = {
    "model.nodes": 21,
    "model.kinematics": "linear",
    "contact.normal": "held",
    "load.steps_per_half_cycle": 12,
    "load.cycles": 1,
    "load.amplitude": 1.0,
    "contact.smoothing": 8.0,
}


def case_of(model, item):
    return Specimen().case(model, [item])


def values_of(fit):
    return np.array(list(fit.values.values()))


# --- of a formula -------------------------------------------------------------------------------


def test_the_minimum_is_that_of_scipy():
    data = readings(5e-3, 1)
    free = [Parameter(key, low=0.02, high=2.0) for key in KEYS]
    fit = identify.fit(data, scene(), free, starts=1)
    weight = 1.0 / np.ptp(data.y)

    def residual(p):
        return (np.asarray(formula(X, *p)) - data.y) * weight

    tight = {"xtol": 1e-14, "ftol": 1e-14, "gtol": 1e-14}
    peer = scipy.optimize.least_squares(residual, list(START.values()), **tight)
    np.testing.assert_allclose(values_of(fit), peer.x, rtol=1e-6)
    assert fit.minima[0][1] == pytest.approx(2.0 * peer.cost, rel=1e-6)
    assert fit.converged


def test_specimens_share_some_values_and_have_others_of_their_own():
    heights = {"thin": 0.1, "thick": 0.4}
    specimens = [Specimen(scene(), readings(**{ETA: eta}), label) for label, eta in heights.items()]
    fit = identify.fit(specimens, free=[MU, Parameter(ETA, each=True), KAPPA])
    assert list(fit.values) == [MU, f"{ETA}[thin]", f"{ETA}[thick]", KAPPA]
    np.testing.assert_allclose(values_of(fit), [0.1, 0.1, 0.4, 0.44], rtol=1e-6)
    assert float(fit.scenes["thick"].strip.height_ratio) == pytest.approx(0.4, rel=1e-6)
    assert list(fit.figures()["misfits"]) == ["thin: toy", "thick: toy"]


def test_measurements_of_one_label_have_misfits_of_their_own():
    labels = ("a", "a (2)", "a")
    several = [readings(1e-3, seed, label=label) for seed, label in enumerate(labels)]
    fit = identify.fit(several, scene(), KEYS)
    assert list(fit.labels) == ["a", "a (2)", "a (3)"]
    assert len(fit.figures()["misfits"]) == 3


def test_a_parameter_without_influence_is_left_at_zero_in_few_steps():
    """A negative kappa_s would be best: on a scale of logarithms there is no way to it."""
    data = readings(1e-4, **{KAPPA: -0.05})
    fit = identify.fit(data, scene(), KEYS)
    assert fit.values[KAPPA] < 1e-3
    assert fit.model_runs < 40  # with the last ones, along the weakest direction
    edge = identify.fit(data, scene(), [MU, ETA, Parameter(KAPPA, scale="linear")])
    np.testing.assert_allclose(values_of(fit)[:2], values_of(edge)[:2], rtol=1e-3)


def test_several_starts_find_the_better_minimum():
    """From beyond the knee the fit of eta ends in a worse minimum, or nowhere."""
    data = readings(1e-3, 2)
    free = [Parameter(key, low=1e-2, high=20.0) for key in (MU, ETA)]
    fit = identify.fit(data, scene(**{KAPPA: 0.44, MU: 15.0, ETA: 0.011}), free)
    assert len(fit.minima) == 3
    np.testing.assert_allclose(values_of(fit), [0.1, 0.2], rtol=0.05)
    costs = [cost for _, cost in fit.minima]
    assert costs == sorted(costs)
    single = identify.fit(data, scene(**{KAPPA: 0.44}), KEYS[:2])
    assert len(single.minima) == 1


def test_a_value_that_runs_into_its_bound_ends_on_it(monkeypatch):
    """The others are then those of SciPy with that value held: L-BFGS-B goes on to the bound."""
    data, low = readings(1e-3, 3), 0.3
    free = [MU, Parameter(ETA, low=low, high=2.0), KAPPA]
    fit = identify.fit(data, scene(**{ETA: 0.5}), free, starts=1)
    assert fit.values[ETA] == pytest.approx(low, rel=1e-6)
    weight = 1.0 / np.ptp(data.y)

    def residual(p):
        return (np.asarray(formula(X, p[0], low, p[1])) - data.y) * weight

    peer = scipy.optimize.least_squares(residual, [0.2, 0.3], xtol=1e-14, ftol=1e-14)
    assert fit.minima[0][1] == pytest.approx(2.0 * peer.cost, rel=1e-6)
    np.testing.assert_allclose(values_of(fit)[[0, 2]], peer.x, rtol=1e-3)


def test_a_search_goes_on_as_long_as_it_gains():
    """From far starts, 40 steps are too few; nobody limits them but who asks for it."""
    random = np.random.default_rng(0)
    starts = np.array(list(TRUTH.values())) * np.exp(random.uniform(-3.0, 3.0, (31, 3)))
    far, data = scene(**dict(zip(KEYS, starts[30].tolist(), strict=True))), readings(0.01, 30)
    hasty = identify.fit(data, far, KEYS, max_iterations=40, throw=False)
    assert hasty.status == jb.Status.MAX_ITERATIONS
    fit = identify.fit(data, far, KEYS)
    assert 40 < fit.model_runs < 60
    near = identify.fit(data, scene(), KEYS)
    np.testing.assert_allclose(values_of(fit), values_of(near), rtol=1e-3)


def test_progress_says_where_a_fit_is():
    told = []
    fit = identify.fit(readings(), scene(), KEYS, progress=told.append)
    assert [p.step for p in told] == list(range(1, len(told) + 1))
    assert all(p.cost >= q.cost for p, q in itertools.pairwise(told))
    assert told[-1].values == fit.values
    assert told[-1].left > 0.0
    assert "search 1 of 1, step 1, cost " in str(told[0])
    assert "s left: contact.friction = " in str(told[0])
    assert len(told) <= fit.model_runs


def test_an_interrupted_fit_goes_on_where_it_was(tmp_path, monkeypatch):
    state, runs = tmp_path / "fit.state", []

    whole_run = Runs.__call__

    def run(self, table):
        runs.append(table.ravel().tolist())
        return whole_run(self, table)

    monkeypatch.setattr(Runs, "__call__", run)

    def stop(progress):
        if progress.step == 3:
            raise KeyboardInterrupt

    def fit(**options):
        free = [Parameter(KAPPA, low=0.1, high=2.0), MU, ETA]
        return identify.fit(
            readings(1e-3),
            scene(),
            free,
            max_iterations=90,
            **options,
        )

    whole = fit()
    everything, runs[:] = len(runs), []
    with pytest.raises(KeyboardInterrupt, match=r"interrupted after \d+ model runs; all are in"):
        fit(save=state, progress=stop)
    assert 2 < len(runs) < everything
    resumed = fit(save=state)
    assert len(runs) == everything
    assert len({tuple(run) for run in runs}) == resumed.model_runs == whole.model_runs
    assert resumed.values == whole.values
    before = len(runs)
    assert fit(save=state).values == whole.values
    assert len(runs) == before


def test_without_a_file_an_interruption_says_so():
    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="nothing was saved: give save="):
        identify.fit(readings(), scene(), KEYS, progress=stop)


def test_a_state_cut_off_while_it_was_written(tmp_path):
    state = tmp_path / "fit.state"
    whole = identify.fit(readings(), scene(), KEYS, save=state)
    text = state.read_text()
    state.write_text(text[:-100])
    assert identify.fit(readings(), scene(), KEYS, save=state).values == whole.values
    assert state.read_text() == text


@pytest.mark.parametrize(
    ("text", "message"),
    [("", "is no state"), ("{}\n", "is no state"), ("[1]\n", "is no state"), ("\n\n", "no state")],
)
def test_files_that_are_no_state(text, message, tmp_path):
    state = tmp_path / "fit.state"
    state.write_text(text)
    with pytest.raises(jb.InputError, match=rf"save .*fit.state: {message}|is no state"):
        identify.fit(readings(), scene(), KEYS, save=state)
    assert state.read_text() == text


def test_a_state_of_another_fit(tmp_path):
    state = tmp_path / "fit.state"
    identify.fit(readings(), scene(), KEYS, save=state)
    before = state.read_text()
    others = (
        (readings(1e-3), scene(), KEYS),
        (readings(), scene().replace({"strip.length": 3.0}), KEYS),
        (readings(), scene(), KEYS[:2]),
    )
    for other in others:
        with pytest.raises(jb.InputError, match="is the state of another fit: delete it, or save"):
            identify.fit(*other, save=state)
    assert state.read_text() == before
    with pytest.raises(jb.InputError, match=r"save .*: cannot be (read|written)"):
        identify.fit(readings(), scene(), KEYS, save=tmp_path)
    with pytest.raises(jb.InputError, match="cannot be written"):
        identify.fit(readings(), scene(), KEYS, save=tmp_path / "nowhere" / "fit.state")


def test_a_state_that_can_no_longer_be_written(tmp_path):
    state = tmp_path / "fit.state"

    def forbid(_):
        state.unlink()
        os.mkdir(state)

    with pytest.raises(jb.InputError, match=r"fit.state: cannot be written"):
        identify.fit(readings(), scene(), KEYS, save=state, progress=forbid)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"free": (MU, "contact.stick_stiffness")}, "no value for it; give a start"),
        ({"free": (MU, "contact.normal_stiffness")}, "'contact.normal_stiffness'.*do not depend"),
        (
            {"free": (MU, Parameter("contact.normal_stiffness", prior=(50, 1.0))), "noise": 0.01},
            "do not depend",
        ),
        ({"free": Parameter(MU, high=0.15)}, "start = 0.2.*must lie between"),
        ({"free": Parameter(MU, prior=(0.1, 0.01))}, "prior .* give noise"),
        ({"free": Parameter(MU, start=60.0)}, "no equilibrium at the start values"),
        ({"starts": 0}, "starts = 0: must be a whole number"),
        ({"starts": 1.5}, "starts = 1.5"),
        ({"noise": -0.01}, "noise = -0.01: give a positive part"),
        ({"weights": (1.0, 2.0)}, r"weights = \[1.0, 2.0\]: give one positive number for each"),
        ({"weights": (0.0,)}, r"weights = \[0.0\]: give one positive"),
        ({"data": []}, "no measurement given"),
        ({"data": [Specimen(STRIP, [], "a")], "scene": None}, "data of specimen 'a': no meas"),
        ({"data": np.arange(9.0)}, "a ndarray is no measurement: give a Loop, a Squeeze"),
        ({"data": [Specimen(scene(), readings())]}, "the specimens bring their own"),
        ({"data": [Specimen(scene(), readings()), readings()]}, "mixes specimens with measure"),
        (
            {"data": [Specimen(scene(), readings(), "a")] * 2, "scene": None},
            "two have the label 'a'",
        ),
        ({"data": [readings(), readings(0.1, known=True, label="b")]}, "toy: carries no noise but"),
    ],
)
def test_what_cannot_be_fitted(options, message):
    given = {"data": readings(), "scene": scene(), "free": (MU, ETA)} | options
    with pytest.raises((jb.InputError, jb.UnconvergedError), match=message):
        identify.fit(**given)


def test_an_unfinished_fit_is_loud():
    with pytest.raises(jb.UnconvergedError, match="not converged after 2 iterations"):
        identify.fit(readings(), scene(), KEYS, max_iterations=2)
    fit = identify.fit(readings(), scene(), KEYS, max_iterations=2, throw=False)
    assert fit.status == jb.Status.MAX_ITERATIONS


def test_filling_up_adds_nothing(monkeypatch):
    def answer():
        space, cases = search_space(as_parameters((MU, ETA)), [case_of(scene(), readings(1e-3))])
        return Problem(cases, space, points=96)(np.array([0.1, -0.2]))

    alone = answer()
    monkeypatch.setattr(Formula, "length_step", 32)
    for one, other in zip(alone, answer(), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-14)


# --- of the model's own curves --------------------------------------------------------------------


@pytest.fixture(scope="module")
def planted():
    """A loop of the contact line, and where a fit of it starts."""
    coarse = {"model.section": "squeeze", "model.nodes": 17}
    start = jb.Scene().replace(coarse | {"load.amplitude": 0.6})
    return jb.solve(start.replace({MU: 0.27, ETA: 0.13}), throw=False), start


@pytest.mark.slow
def test_planted_parameters_come_back_from_load_steps():
    truth = STRIP.replace(MODEL)
    history, start = jb.solve(truth), truth.replace({MU: 0.13, ETA: 0.09})
    fit = identify.fit(make_loop(*history.loop), start, FREE)
    np.testing.assert_allclose(values_of(fit), [0.1, 0.1126], rtol=1e-5)
    assert fit.misfit < 1e-6
    assert fit.model_runs < 12


def test_planted_parameters_come_back(planted, tmp_path):
    """The sliders of a fit are as rigid as those of the run."""
    history, start = planted
    loop = make_loop(*history.loop, "a long name of a loop: the first")
    fit = identify.fit(loop, start, FREE)
    np.testing.assert_allclose(values_of(fit), [0.27, 0.13], rtol=1e-9)
    shown = fit._repr_html_()
    assert f"<td>{MU}</td><td>0.27 +- " in shown
    assert shown.count("data:image/png;base64") == 1
    # The legend of its picture covers no loop, and a long name loses its middle.
    panel = fit.plot()
    panel.figure.canvas.draw()
    legend = panel.get_legend()
    assert legend.get_window_extent().y1 < panel.get_window_extent().y0
    assert legend.get_texts()[0].get_text() == "model, a long … first"
    plt.close("all")
    # What it leaves behind says the same, to the last bit.
    paths = fit.save(tmp_path / "out")
    names = {"overlay.csv", "scene.toml", "result.json", "overlay.png", "residuals.png"}
    assert {path.name for path in paths} == names
    figures = json.loads((tmp_path / "out" / "result.json").read_text())
    assert figures == json.loads(json.dumps(fit.figures()))
    assert {key: entry["value"] for key, entry in figures["values"].items()} == fit.values
    again = jb.read_scene(tmp_path / "out" / "scene.toml")
    assert {key: float(again.get(key)) for key in FREE} == fit.values
    assert jb.scene_to_toml(again) == jb.scene_to_toml(fit.scene)


def test_the_jacobian_is_the_derivative_of_the_residual(planted):
    """Taylor: what is left of a linear prediction falls with the step squared."""
    history, start = planted
    space, cases = search_space(as_parameters(FREE), [case_of(start, make_loop(*history.loop))])
    problem = Problem(cases, space, points=96)
    base, way = problem(np.zeros(2)), np.array([0.5, -0.3])
    sizes = np.array([1e-3, 5e-4, 2.5e-4])
    rest = [
        np.linalg.norm(problem(h * way).residual - base.residual - h * base.jacobian @ way)
        for h in sizes
    ]
    assert np.polyfit(np.log(sizes), np.log(rest), 1)[0] == pytest.approx(2.0, abs=0.05)


def test_loops_of_like_length_share_what_is_compiled(planted):
    history, start = planted
    for points in (25, 22, 20):
        loop = make_loop(*(np.append(column[: points - 1], column[-1]) for column in history.loop))
        space, cases = search_space(as_parameters(FREE), [case_of(start, loop)])
        ((run, _),) = Problem(cases, space, points=96).runs.pairs
        assert run.path.shape == (64,)
        waiting = np.asarray(run.weight)[8 + 2 * points :]
        np.testing.assert_array_equal(waiting, 0.0)


@pytest.mark.slow
def test_a_mixture_of_everything(tmp_path):
    """Loops of one strip under prescribed displacements, clamped harder at its far part."""
    clamped = [[0.0, 10.0], [1.4, 10.0], [1.4, 6.0], [2.0, 6.0]]
    drive = {"load.control": "displacement", "load.amplitude": 1.5e-5}
    truth = STRIP.replace(MODEL | {"contact.pressure": clamped} | drive)
    history = jb.solve(truth)
    x = np.linspace(1.0, 1.9, 19)
    stress = np.interp(x, history.middles, history.squeeze_stress[history.pressed])
    work = [
        float(jb.solve(truth.replace({"load.amplitude": a})).dissipation) for a in (1e-5, 1.5e-5)
    ]
    pull = slice(history.pressed + 1, history.cycles[0][0] + 1)
    other = jb.solve(truth.replace({"load.amplitude": 1.2e-5}))
    half = make_loop(*(column[:13] for column in other.loop), "half cycle")
    assert not half.closed
    data = [
        make_loop(*history.loop, "loop"),
        SqueezeCurve(x, stress),
        half,  # from a reversal on, as after a first loading
        Backbone(history.force[pull], history.displacement[pull]),
        DissipationCurve([1e-5, 1.5e-5], work),
        StiffnessCurve([1.5e-5], [float(history.secant_stiffness)]),
    ]
    wanted = dict.fromkeys((*KEYS, "strip.youngs_modulus"))
    wanted = {key: float(truth.get(key)) for key in wanted}
    factors = (1.2, 0.9, 1.4, 1.1)
    start = {key: factor * wanted[key] for key, factor in zip(wanted, factors, strict=True)}
    fit = identify.fit(data, truth.replace(start), list(start))
    np.testing.assert_allclose(values_of(fit), list(wanted.values()), rtol=1e-4)
    names = ["loop", "squeeze", "half cycle", "backbone", "dissipation", "stiffness"]
    assert list(fit.figures()["misfits"]) == names
    assert [type(model) for model in fit.model] == [type(given) for given in data]
    np.testing.assert_allclose(fit.model[1].stress, stress, rtol=1e-4)
    np.testing.assert_allclose(fit.model[4].dissipation, work, rtol=1e-4)
    for low, high in fit.bands():
        assert type(low) is type(high)
    panels = fit.plot()
    assert len(panels) == len(fit.plot_residuals()) == 4
    assert len(panels[0].lines) == 6
    plt.close("all")
    names = {path.name for path in fit.save(tmp_path)}
    assert {"overlay.csv", "squeeze.csv", "dissipation.csv", "stiffness.csv"} < names
    with pytest.raises(jb.InputError, match="forms of measurement need 4, not 1"):
        fit.plot(plt.figure().subplots())
    plt.close("all")


@pytest.mark.slow
def test_planted_parameters_come_back_where_pairs_of_nodes_are_open():
    """Loops of a lap joint that a gap keeps open beyond X = 1."""
    gap = [[0.0, 0.0], [1.0, 0.0], [2.0, 1e-3]]
    lap = {"strip.far_end": "free", "member.support": "rolling", "member.gap": gap}
    planted = {MU: 0.27, "strip.axial_stiffness": 1.3e5}
    start = jb.Scene().replace(lap | {"model.nodes": 33, "model.section": "squeeze"})
    loops = []
    for amplitude in (0.6, 1.2):
        drive = {"load.amplitude": amplitude}
        history = jb.solve(start.replace(planted | drive), throw=False)
        assert np.any(history.gap[-1] > 0.0)
        loops.append(make_loop(*history.loop))
    fit = identify.fit(loops, start, list(planted), starts=1)
    assert fit.values == pytest.approx(planted, rel=1e-4)


@pytest.mark.slow
def test_finite_element_loops_are_recovered_with_small_bias():
    """True values mu = 0.1, eta = 0.1126; what remains is the model's error, not noise."""
    start = STRIP.replace(
        MODEL | {"model.nodes": 81, "contact.smoothing": "sharp", MU: 0.15, ETA: 0.2}
    )
    fit = identify.fit(example_loops(), start, FREE)
    problem, space = fit.problem, fit.uncertainty.space
    theirs = scipy.optimize.least_squares(
        lambda point: problem(point).residual,
        fit.uncertainty.point + 0.02,
        jac=lambda point: problem(point).jacobian,
        xtol=1e-12,
        ftol=1e-12,
    )
    np.testing.assert_allclose(space.values(theirs.x), list(fit.values.values()), rtol=1e-6)
    assert fit.values[MU] == pytest.approx(0.1, rel=0.01)
    assert fit.values[ETA] == pytest.approx(0.1126, rel=0.03)
    assert fit.misfit < 0.01


def test_what_a_scene_cannot_answer(planted):
    history, start = planted
    force, displacement = history.loop
    too_much = make_loop(5.0 * force, displacement)
    with pytest.raises(jb.InputError, match="must stay below gross slip"):
        identify.fit(too_much, start, FREE)
    noisy = Loop(np.asarray(force), np.asarray(displacement), label="rig", noise=1.0)
    with pytest.raises(jb.InputError, match="rig: noise = 1 is more than the range of disp"):
        identify.fit(noisy, start, FREE)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"points": 3}, "points = 3: must be a whole number, 8 to 1000000"),
        ({"max_iterations": "a"}, "max_iterations = 'a': must be a whole number, 1 to 1000000"),
        ({"starts": True}, "starts = True: must be a whole number, 1 to 1000000"),
        ({"tolerance": -1.0}, r"tolerance = -1\.0: give a positive number, such as 1e-7"),
        ({"noise": "a"}, "noise = 'a': give a positive part of the range"),
    ],
)
def test_options_that_make_no_sense(options, told):
    with pytest.raises(jb.InputError, match=told):
        identify.fit(readings(), scene(), KEYS, **options)


def test_a_profile_says_that_the_others_did_not_converge():
    fit = identify.fit(readings(1e-3), scene(), KEYS)
    assert fit.profile(KEYS[0]).settled
    hasty = fit.profile(KEYS[0], max_iterations=1, tolerance=1e-12)
    assert not hasty.settled
    assert "did not converge everywhere" in str(hasty)
