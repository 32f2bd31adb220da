"""Fits of a joint's law in place of a strip: planted numbers, intervals, doubts, bad input."""

import numpy as np
import pytest

from jbeamshell import identify, laws
from jbeamshell.common.errors import InputError
from jbeamshell.dynamics import Joint
from jbeamshell.identify.data_checks import feature_doubts, inspected
from jbeamshell.identify.models import LawModel, StripModel
from jbeamshell.identify.specimens import Specimen
from jbeamshell.measured.curves import Backbone, DissipationCurve, SqueezeCurve, StiffnessCurve
from jbeamshell.measured.inspection import inspect
from jbeamshell.measured.loops import Loop
from jbeamshell.scene.library import standard

SIZES = (0.006, 0.012, 0.03)
PLANTED = {
    "jenkins": laws.Jenkins(1.0, 100.0),
    "iwan4": laws.Iwan4(1.0, 100.0, -0.5, 0.4),
    "bar": laws.Bar(1.0, 0.02),
    "mindlin": laws.Mindlin(1.0, 100.0),
    "bouc-wen": laws.BoucWen(1.0, 100.0, 1.6, 0.6, 0.05),
    "dahl": laws.Dahl(1.0, 100.0),
    "lugre": laws.LuGre(1.0, 100.0, 0.05),
    "sliders4": laws.law_named("sliders4")(0.001, 0.02, 0.2, 0.3, 0.3, 0.2),
}
NOISE = 0.01


def loops(law, random=None, sizes=SIZES, points=64):
    """Steady loops of a law, the third cycle of each, with noise of 1 % of the force's range."""
    found = []
    for size in sizes:
        way = np.cos(2.0 * np.pi * np.arange(points + 1) / points)
        path = size * np.concatenate([np.linspace(0.0, 1.0, 17)[1:], way, way, way])
        force = np.asarray(law.path_forces(path))[-points - 1 :]
        if random is not None:
            force = force + NOISE * np.ptp(force) * random.normal(size=force.size)
        found.append(Loop(force, size * way, label=f"U = {size:g}", driver="displacement"))
    return found


def test_the_four_parameters_of_iwan_are_found_with_their_intervals():
    data = loops(PLANTED["iwan4"], np.random.default_rng(1))
    fit = identify.fit(data, "iwan4", noise=NOISE, starts=1)
    assert fit.describes
    for key, (low, high) in fit.intervals.items():
        truth = float(PLANTED["iwan4"].get(key))
        assert low - 0.5 * (high - low) < truth < high + 0.5 * (high - low)
    assert float(fit.law.dissipation(0.01)) == pytest.approx(
        float(PLANTED["iwan4"].dissipation(0.01)), rel=0.02
    )
    table = fit.to_dataframe()
    assert list(table.index) == list(fit.values)
    for key, row in table.iterrows():
        assert (row["low"], row["high"]) == fit.intervals[key]
        assert (row["value"], row["error"]) == (fit.values[key], fit.errors[key])


def test_a_law_fitted_below_gross_slip_does_not_claim_to_know_it():
    """Slip force and beta are one number there; beyond the data the law's form alone speaks."""
    law, said = PLANTED["iwan4"], "the data do not reach gross slip of iwan4"
    below = identify.fit(loops(law, sizes=SIZES[:2]), "iwan4", starts=1)
    low, high = below.intervals["iwan4.slip_force"]
    assert low < 1.0 < high
    assert any(doubt.startswith(said) for doubt in below.doubts)
    joint = Joint.of(below.law)
    assert float(joint.reach) == pytest.approx(SIZES[1], rel=1e-6)
    with pytest.raises(InputError, match="of a law, a larger force"):
        joint.backbone(SIZES[2])
    assert np.isinf(Joint.of(below.law, 0.999 * below.law.capacity).reach)
    noisy = loops(law, np.random.default_rng(1), sizes=(0.004, 0.0153))
    corner = laws.Iwan4(0.87, 100.0, -0.5, 0.6)  # slides where the data end
    told = LawModel(corner).fitted(noisy)
    assert np.isfinite(float(Joint.of(told.law).reach))
    whole = identify.fit(loops(law), "iwan4", starts=1)
    assert not any(doubt.startswith(said) for doubt in whole.doubts)
    assert np.isinf(Joint.of(whole.law).reach)
    assert np.isinf(Joint.of(below.law.replace(whole.values)).reach)


def test_a_first_loading_leaves_out_what_bends_unloading_alone():
    law = laws.BoucWen(2.0, 30.0, 1.4, 0.4, 0.05)
    u = np.linspace(0.01, 0.3, 15)
    fit = identify.fit(Backbone(np.asarray(law.backbone(u)), u), "bouc-wen", starts=1)
    assert set(fit.values) == set(laws.BoucWen.free()) - {"bouc-wen.unloading"}
    for key, value in fit.values.items():
        assert value == pytest.approx(float(law.get(key)), rel=1e-5)
    assert any("bouc-wen.unloading stays as it is" in note for note in fit.notes)


@pytest.mark.slow
def test_curves_over_the_force_amplitude_tell_a_law():
    law = laws.Mindlin(2.0, 50.0)
    force = np.linspace(0.2, 1.9, 9)
    size = np.asarray(law.displacement(force))
    curves = [
        DissipationCurve(force, np.asarray(law.dissipation(size))),
        StiffnessCurve(force, np.asarray(law.secant_stiffness(size))),
    ]
    fit = identify.fit(curves, "mindlin", starts=1)
    assert set(fit.controls) == {"force"}
    assert fit.values["mindlin.slip_force"] == pytest.approx(2.0, rel=1e-6)
    assert fit.values["mindlin.stiffness"] == pytest.approx(50.0, rel=1e-6)


@pytest.mark.slow
def test_a_model_that_cannot_follow_the_data_says_so():
    data = loops(PLANTED["dahl"])
    fit = identify.fit(data, "bar", starts=1)
    assert not fit.describes
    assert "this model does not describe these data" in fit.doubts[0]


def test_asymmetry_and_memory_that_a_law_lacks_are_doubts():
    loop = loops(PLANTED["mindlin"], sizes=(0.03,))[0]
    lopsided = loop.but(force=loop.force + 0.15 * np.abs(loop.force))
    jenkins, dahl = LawModel(PLANTED["jenkins"]), LawModel(PLANTED["dahl"])
    (text,) = feature_doubts(jenkins, inspect([loop, lopsided]).views)
    assert "pull and push differ by" in text
    ends = ((1.0, -1.0), (-1.0, 0.4), (0.4, -0.4), (-0.4, 1.0))
    u = 0.01 * np.concatenate([np.linspace(a, b, 20)[1:] for a, b in ends])
    strip = StripModel(standard())
    nested = Loop(u.copy(), u, label="nested")
    views = inspect(nested).views
    (text,) = feature_doubts(dahl, views)
    assert "dahl forgets where: its minor loops do not close" in text
    assert feature_doubts(jenkins, views) == feature_doubts(strip, views) == []
    assert text in inspected([Specimen().case(dahl, [nested])], [], unchecked=True)


@pytest.mark.slow
def test_a_law_is_driven_by_force_where_it_has_masings_memory():
    law = PLANTED["mindlin"]
    path = 0.8 * np.cos(np.pi * np.arange(65) / 32)
    u = np.asarray(law.path_displacements(np.append(np.linspace(0, 0.8, 9)[1:], path)))[-65:]
    data = Loop(path, u, label="by force")
    by_force = {"load.control": "force"}
    fit = identify.fit(Specimen(laws.Mindlin(1.2, 80.0), data, set=by_force))
    assert fit.values["mindlin.stiffness"] == pytest.approx(100.0, rel=1e-6)
    said = r"^law driven by the force = 'dahl': follows displacements alone"
    with pytest.raises(InputError, match=said):
        identify.fit(Specimen(laws.Dahl(1.2, 80.0), data, set=by_force))
    with pytest.raises(
        InputError, match=r"^force = 0.8: reaches gross slip of mindlin at the star"
    ):
        identify.fit(Specimen(laws.Mindlin(0.7, 80.0), data, set=by_force))


def test_bad_input_is_one_clear_line():
    data = loops(PLANTED["jenkins"])
    with pytest.raises(InputError, match=r"^scene = 'iwan5': choose a law .jenkins, iwan4"):
        identify.fit(data, "iwan5")
    with pytest.raises(InputError, match=r"^scene = 3: give a jbeamshell.Scene, values by"):
        identify.fit(data, 3)
    with pytest.raises(InputError, match=r"^unknown key 'contact.friction': the numbers of this l"):
        identify.fit(data, "iwan4", ["contact.friction"])
    with pytest.raises(InputError, match=r"^free 'iwan4.chi': low = -2.0: must lie between -1 and"):
        identify.Parameter("iwan4.chi", low=-2.0)
    squeeze = SqueezeCurve(np.linspace(0.0, 1.0, 9), np.linspace(-1.0, -0.1, 9))
    with pytest.raises(InputError, match=r"^squeeze: squeeze stress: a law of a joint has none"):
        identify.fit([squeeze, *data], "jenkins")


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANTED)
def test_intervals_of_planted_numbers_hold_as_often_as_they_say(name):
    random = np.random.default_rng(11)
    held = []
    for _ in range(50):
        fit = identify.fit(loops(PLANTED[name], random), name, noise=NOISE, starts=1)
        for key, (low, high) in fit.intervals.items():
            held.append(low < float(PLANTED[name].get(key)) < high)
    assert 0.9 <= np.mean(held) <= 0.99
