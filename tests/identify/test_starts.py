"""Starts from the loops: near what made them, in any units, and never beyond gross slip."""

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.common.errors import InputError
from jbeamshell.identify.observations import observe
from jbeamshell.identify.plan import planned
from jbeamshell.identify.starts import _beyond_bar, _x, estimate, started
from jbeamshell.measured.example import HEIGHT_RATIOS, example_loops
from jbeamshell.measured.loops import make_loop
from jbeamshell.measured.steady import steady_loops
from jbeamshell.scene.toml import scene_from_values
from tests import rig

SI = {"force": "N/m", "displacement": "m"}
STRETCHING, FRICTION, PRESSURE, LENGTH = 3.4e4, 0.1, 10.0, 2.0  # of the finite elements
MU, ETA, STIFF, P, L = (
    "contact.friction",
    "strip.height_ratio",
    "strip.axial_stiffness",
    "contact.pressure",
    "strip.length",
)


def in_units(loop, random, noise=0.0, seed=0):
    """A loop of finite elements as a rig of another size would record it, and its true values."""
    force, displacement, length = 10.0 ** random.uniform((0.0, -2.0, -2.3), (6.0, 2.0, 0.3))
    columns = (
        scale * np.tile(column[:-1], 3)
        for scale, column in ((force, loop.force), (displacement, loop.displacement))
    )
    recording = rig.recorded(*columns, noise, "white", seed, "force").but(units=SI)
    truth = {
        MU: FRICTION,
        P: PRESSURE * LENGTH * force / length,
        STIFF: STRETCHING * force / displacement * length / LENGTH,
        L: length,
    }
    return recording, truth


def random_specimen(seed, noise=0.0):
    """Mean loops, what is known of the specimen, and the truth."""
    random = np.random.default_rng(seed)
    ratio = random.choice(HEIGHT_RATIOS)
    (loop,) = example_loops(ratio, (random.choice([0.5851, 0.7855, 1.0, 1.3, 1.6, 1.9]),))
    recording, truth = in_units(loop, random, noise, seed)
    truth[ETA] = ratio
    known = {key: truth[key] for key in (L, ETA, STIFF, P)[: [0, 1, 3, 4][seed % 4]]}
    return steady_loops(recording), known, truth


def test_work_and_displacement_of_finite_elements_lie_on_one_curve():
    for ratio in HEIGHT_RATIOS:
        for loop in example_loops(ratio, None):
            found = estimate([loop])
            x = found.force / ratio
            if found.work is None or x > 20.0:  # no work, or that of the bar
                continue
            assert _x(found) == pytest.approx(x, rel=0.15)
            bar = found.force**2 * LENGTH / (2.0 * STRETCHING * FRICTION * PRESSURE * LENGTH)
            assert found.displacement == pytest.approx(bar * _beyond_bar(x), rel=0.15)


@pytest.mark.parametrize("seed", range(12))
def test_no_start_is_beyond_gross_slip_whatever_is_known(seed):
    loops, known, truth = random_specimen(seed, 0.01)
    plan = planned(loops, known, [MU])
    scene = plan.cases[0].model.own
    for loop in loops:
        observe(loop, scene)  # raises beyond gross slip
    for key, value in known.items():
        assert float(scene.get(key)) == pytest.approx(value)
    if estimate(loops).work is None:  # a line tells no friction
        return
    if len(known) == 4:
        assert float(scene.contact.friction) == pytest.approx(FRICTION, rel=0.15)
    if len(known) < 3:  # of a bar, the loop tells this product and nothing else
        started_at, planted = (
            np.prod([float(value(key)) for key in (STIFF, MU, P)])
            for value in (scene.get, truth.get)
        )
        assert started_at == pytest.approx(planted, rel=0.15)


def test_a_plateau_tells_gross_slip_and_a_straight_way_to_it_soft_sliders():
    u = rig.path()
    force = 7.0 * rig.jenkins(u, 0.3) / 0.3
    made = rig.recorded(force, 1e-4 * u, 0.002, driver="displacement")
    made = made.but(units=SI, normal_force=np.full(u.size, 20.0))
    loops = steady_loops(made)
    assert loops[0].normal_force == pytest.approx(20.0)
    plan = planned(loops, None, [MU])
    scene = plan.cases[0].model.own
    length = float(scene.strip.length)
    assert scene.load.control == "displacement"
    assert scene.strip.far_end == "free"
    assert float(scene.contact.pressure) * length == pytest.approx(20.0)
    assert float(scene.contact.friction) == pytest.approx(7.0 / 20.0, rel=0.02)
    assert float(scene.slip_stiffness(length)) * length == pytest.approx(7.0 / 0.3e-4, rel=0.1)
    assert any("not given, so estimated" in note for note in plan.notes)
    # A bar that slides from its end: the force is a root of the displacement.
    way = np.clip((1.0 + np.cos(np.linspace(0.0, 2.0 * np.pi, 201))) / 0.4, 0.0, None)
    down = 7.0 - 14.0 * np.sqrt(np.minimum(way[0] - way[:101], 1.0))
    bar = make_loop(np.append(down, -down[1:]), 1e-4 * (0.4 * way - 1.0)).but(units=SI)
    root = planned([bar], None, [MU]).cases[0].model.own
    gross = float(root.contact.friction) * float(root.contact.pressure) * float(root.strip.length)
    assert gross == pytest.approx(7.0, rel=0.02)
    stretched = gross * float(root.strip.length) / float(root.strip.axial_stiffness)
    assert stretched == pytest.approx(0.4e-4, rel=0.1)
    assert root.contact.stick_stiffness is None


def test_a_line_starts_where_hardly_anything_slips():
    u = rig.path(4)
    loops = steady_loops(rig.recorded(7.0 * u, 1e-4 * u, 0.002).but(units=SI))
    scene = planned(loops, None, [STIFF]).cases[0].model.own
    gross = float(scene.contact.friction * scene.contact.pressure * scene.strip.length)
    assert gross == pytest.approx(70.0, rel=0.02)


def test_the_standard_strip_stays_where_its_loops_are_fitted():
    for ratio in HEIGHT_RATIOS:
        plan = planned(example_loops(ratio), None, [MU])
        scene, standard = plan.cases[0].model.own, jb.Scene()
        for key in (MU, ETA, STIFF, P, L):
            assert float(scene.get(key)) == float(standard.get(key))


def test_friction_and_pressure_that_cannot_resist_are_refused_by_their_names():
    (loop,) = example_loops(0.1126, (1.9,))
    known = {MU: 0.05, P: 10.0}
    with pytest.raises(InputError, match=r"contact.friction = 0.05: slides at mu F_N L = 1, but"):
        planned([loop], known, [ETA])
    with pytest.raises(InputError, match=r"start it above 0.095"):
        planned([loop], {P: 10.0}, [jb.identify.Parameter(MU, start=0.05)])
    found = estimate([loop])
    values, _ = started({P: 10.0}, found._replace(si=True))
    assert values[MU] * 20.0 > 1.9


def test_bolts_are_a_pressure_that_is_given():
    found = estimate(example_loops(0.1126))._replace(si=True)
    bolts = [[0.6, 7.0, 0.3], [1.4, 7.0, 0.3]]
    values, notes = started({"strip.length": 2.0, "contact.bolts": bolts}, found)
    assert P not in values
    assert "pressure" not in " ".join(notes)
    assert float(scene_from_values(values).gross_slip) == pytest.approx(14.0 * values[MU])


def test_a_first_loading_has_a_start_too():
    force = np.linspace(0.0, 4e3, 40)
    pull = make_loop(force, 1e-13 * force**2, "pull")
    scene = planned([make_loop(pull.force, pull.displacement)], None, [MU]).cases[0].model.own
    gross = (
        float(scene.contact.friction) * float(scene.contact.pressure) * float(scene.strip.length)
    )
    assert gross > 4e3


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_fits_of_random_specimens_converge_from_the_file_alone(seed):
    loops, known, _ = random_specimen(seed, 0.01)
    free = [MU] if STIFF in known else [ETA, STIFF]
    coarse = {"model.nodes": 41, "model.kinematics": "linear"}
    fit = jb.fit(loops, known | coarse, free, points=48)
    assert fit.converged
    assert fit.misfit < 0.02


SPECIMEN = {L: 0.12, "strip.half_height": 0.006, "strip.youngs_modulus": 210e9, P: 5e6}


@pytest.mark.parametrize(
    ("factors", "known", "told"),
    [
        ((1e3, 1e3), SPECIMEN, "force=N.*displacement=um.* --start contact.friction="),
        ((1e-3, 1e-3), SPECIMEN, "force=kN.*displacement=mm.* --start contact.friction="),
        ((1e3, 1.0), SPECIMEN, "force=N.*displacement=m.*displacement=mm"),
        ((1e-3, 1.0), SPECIMEN, "force=kN.*displacement=mm.*displacement=um"),
        ((1.0, 1e3), {k: v for k, v in SPECIMEN.items() if "modulus" not in k}, "give --modulus"),
    ],
)
def test_a_wrong_unit_is_named_where_no_surface_or_material_explains_it(factors, known, told):
    u = rig.path(4)
    made = rig.recorded(7.0e4 * rig.iwan(u), 1e-6 * u, 0.002, driver="displacement")
    right, wrong = (
        steady_loops(made.but(force=f * made.force, displacement=d * made.displacement, units=SI))
        for f, d in ((1.0, 1.0), factors)
    )
    planned(right, known, [MU])
    with pytest.raises(InputError, match=told):
        planned(wrong, known, [MU])


def test_numbers_without_units_whose_strip_would_stretch_as_none_does_are_doubted():
    """Millimetres and newtons beside lengths in millimetres, where nobody gives a modulus."""
    u, known = rig.path(4), {L: 120.0, "strip.half_height": 6.0, P: 5.0}
    made = rig.recorded(70.0 * rig.iwan(u), 1e-3 * u, 0.002, driver="displacement")

    def doubts(factor, given):
        loops = steady_loops(made.but(displacement=factor * made.displacement))
        return planned(loops, given, [MU, STIFF]).doubts

    assert doubts(1.0, known) == []
    (soft,), (stiff,) = doubts(1e3, known), doubts(1e-3, known)
    assert "displacement=um" in soft
    assert "--unit displacement=m)" in stiff
    assert doubts(1e3, {"strip.half_height": 6.0, P: 5.0}) == []  # no length is known
