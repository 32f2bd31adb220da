"""Loops with noise in both columns: turns and noise as planted, and fits without a bias."""

import equinox as eqx
import numpy as np
import pytest

from jbeamshell import identify, laws
from jbeamshell.identify.models import LawModel
from jbeamshell.identify.observations import observe
from jbeamshell.identify.specimens import Specimen
from jbeamshell.measured.loops import make_loop
from jbeamshell.measured.steady import steady_loops
from jbeamshell.numerics.newton import Newton

LAW = laws.Mindlin(1.0, 100.0)
SIZE, NOISE = 0.012, 0.02
FORCES = 2.0 * float(LAW.backbone(SIZE))  # range of the force


def recording(seed, sine=True, cycles=3, samples=80, noise=(NOISE, NOISE)):
    """Steady cycles of the law with noise of force and displacement over their ranges."""
    random, time = np.random.default_rng(seed), np.arange(samples * cycles + 1) / samples
    way = np.cos(2.0 * np.pi * time) if sine else np.abs(4.0 * (time % 1.0) - 2.0) - 1.0
    approach = np.append(np.linspace(0.0, 1.0, 17)[1:-1], way[:samples])
    columns = [
        np.asarray(LAW.path_forces(SIZE * np.append(approach, way)))[-way.size :],
        SIZE * way,
    ]
    noisy = [
        c + n * np.ptp(c) * random.standard_normal(c.size)
        for c, n in zip(columns, noise, strict=True)
    ]
    return make_loop(*noisy)


@pytest.fixture(scope="module")
def fits():
    """Fits of single cycles that the force drives, whose largest sample is far beyond its turn."""
    return [
        identify.fit(
            Specimen("mindlin", recording(seed, True, 1, 400), set={"load.control": "force"}),
            starts=1,
        )
        for seed in range(12)
    ]


@pytest.mark.parametrize("sine", [True, False])
@pytest.mark.parametrize("cycles", [1, 3])
def test_turns_and_noise_are_those_that_were_planted(sine, cycles):
    off, noises = [], []
    for seed in range(12):
        (loop,) = steady_loops(recording(seed, sine, cycles), "displacement")
        errors = loop.errors_of("displacement")
        for i, truth in ((0, SIZE), (loop.middle, -SIZE)):
            off.append((loop.displacement[i] - truth) / errors[i])
        noises.append((loop.drive_noise / SIZE / 2.0, loop.noise / FORCES))
    assert abs(np.mean(off)) < 0.5  # the largest sample lies 2 to 4 of these errors beyond
    assert 0.6 < np.std(off) < 1.5
    np.testing.assert_allclose(np.mean(noises, axis=0), NOISE, rtol=0.15)


@pytest.mark.parametrize("noise", [(0.0, 0.0), (NOISE, 0.0)])
@pytest.mark.parametrize("samples", [40, 200])
def test_a_drive_without_noise_is_taken_as_it_is(noise, samples):
    for seed in range(5):
        (loop,) = steady_loops(recording(seed, samples=samples, noise=noise), "displacement")
        assert loop.drive_noise is None
        assert np.max(loop.displacement) == pytest.approx(SIZE, rel=1e-9)


def test_uneven_times_are_no_noise():
    """Samples at random times: displacement and force are as rough as noisy ones."""
    random = np.random.default_rng(3)
    clean = recording(0, samples=400, noise=(0.0, 0.0))
    some = np.sort(np.append(random.choice(clean.force.size, 600, replace=False), [0]))
    (loop,) = steady_loops(clean.part(some), "displacement")
    assert loop.drive_noise is None


def test_a_fit_has_no_bias_and_its_intervals_hold(fits):
    inside = []
    for key, truth in {key: float(LAW.get(key)) for key in LAW.free()}.items():
        off = [(fit.values[key] - truth) / fit.errors[key] for fit in fits]
        assert abs(np.mean(off)) < 0.87  # three standard errors of 12; it was 1.6
        inside += [low < truth < high for low, high in (fit.intervals[key] for fit in fits)]
    assert np.mean(inside) > 0.87


def test_a_fit_tells_both_noises_in_one_line(fits):
    (line,) = [line for line in str(fits[0]).splitlines() if "noise of a sample" in line]
    assert "% of the force and " in line
    assert fits[0].figures()["noise"]["displacement"] == pytest.approx(NOISE, rel=0.3)
    for low, high in fits[0].bands():
        assert 0.0 < np.max(high.displacement - low.displacement) < 0.1 * SIZE


@eqx.filter_jit
def answer(seen, model):
    """Weighted distances from a model, its response, and whether it converged."""
    return seen.residual(model, Newton())


def test_points_of_the_model_have_no_distance_from_it():
    """Wherever noise of the drive moves them along the loop."""
    (loop,) = steady_loops(recording(1), "displacement")
    model = LawModel(LAW)
    seen = observe(loop, model)
    column = np.asarray(answer(seen, model)[1])[np.asarray(seen.weight) > 0.0]
    turns = [0, loop.middle - 1, column.size]
    moved = loop.but(force=np.insert(column, turns, loop.force[[0, loop.middle, -1]]))
    rows, *_ = answer(observe(moved, model), model)
    np.testing.assert_allclose(rows, 0.0, atol=1e-9)
