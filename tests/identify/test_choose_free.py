"""Choice of the parameters where nobody names any: the loops tell them, what is given stays."""

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.identify.plan import planned
from jbeamshell.identify.plan_file import plan_from_values
from jbeamshell.measured.curves import DissipationCurve, SqueezeCurve
from jbeamshell.measured.example import example_loops
from jbeamshell.measured.loops import make_loop
from tests import rig

SI = {"force": "N/m", "displacement": "m"}
MU, ETA, STIFF = "contact.friction", "strip.height_ratio", "strip.axial_stiffness"
SLIDERS, PRESSURE, LENGTH = "contact.stick_stiffness", "contact.pressure", "strip.length"
MODULUS = "strip.youngs_modulus"


def chosen(data, known=None):
    plan = planned(data, known or {})
    (note,) = [note for note in plan.notes if note.startswith("Fitted: ")]
    assert all(p.key in note for p in plan.free)
    return [p.key for p in plan.free]


def sliding(reach):
    """Closed loop beyond gross slip of a slider behind a spring."""
    u = rig.path(cycles=1)
    force = 7.0 * rig.jenkins(u, reach) / reach
    return make_loop(force[-201:], 1e-4 * u[-201:]).but(units=SI, driver="displacement")


def root():
    """Closed loop beyond gross slip of a bar that slides from its end."""
    way = np.clip((1.0 + np.cos(np.linspace(0.0, 2.0 * np.pi, 201))) / 0.4, 0.0, None)
    down = 7.0 - 14.0 * np.sqrt(np.minimum(way[0] - way[:101], 1.0))
    return make_loop(np.append(down, -down[1:]), 1e-4 * (0.4 * way - 1.0)).but(units=SI)


def in_si(amplitude=1.3):
    """A loop of finite elements below gross slip, in units that the standard strip has not."""
    (loop,) = example_loops(0.1126, (amplitude,))
    return loop.but(force=1e5 * loop.force, displacement=10.0 * loop.displacement, units=SI)


def test_a_plateau_tells_friction_and_the_stiffness_before_it():
    assert chosen([sliding(0.3)]) == [MU, SLIDERS]
    assert chosen([root()]) == [MU, STIFF]


def test_below_gross_slip_work_and_displacement_tell():
    assert chosen([in_si()]) == [MU, STIFF]
    assert chosen([in_si()], known={STIFF: 3.4e8, LENGTH: 2.0}) == [MU, ETA]
    assert chosen(example_loops()) == [MU, ETA]


def test_what_is_given_is_not_fitted():
    assert chosen([sliding(0.3)], known={SLIDERS: 1e-3}) == [MU]
    dimensions = {LENGTH: 2.0, STIFF: 3.4e8, "strip.half_height": 0.1126}
    assert chosen([in_si()], known=dimensions) == [MU]
    friction = {MU: 0.1, PRESSURE: 1e6, LENGTH: 2.0, STIFF: 3.4e8}
    assert chosen([in_si()], known=friction) == [ETA]
    assert chosen([in_si()], known=friction | {ETA: 0.1}) == [MU, ETA]  # what is given starts there


def test_beside_youngs_modulus_friction_and_height_are_one_number():
    """In units of A/E' nothing but A/(mu F_N H) is left, so that loops tell one of the two."""
    scene = jb.Scene().replace({MODULUS: 2e5, "model.section": "plane", "model.nodes": 33})
    one, other = (jb.solve(scene.replace({MU: mu, ETA: 0.01 / mu})) for mu in (0.1, 0.2))
    assert float(other.dissipation) == pytest.approx(float(one.dissipation), rel=0.03)
    assert float(other.peak_displacement) == pytest.approx(float(one.peak_displacement), rel=0.03)
    steel = {MODULUS: 1.4e9, LENGTH: 2.0, PRESSURE: 1e6}
    assert chosen([in_si()], known=steel) == [MU]
    assert chosen([in_si()], known=steel | {MU: 0.1}) == [ETA]
    assert chosen([in_si()], known=steel | {ETA: 0.1}) == [MU]
    assert chosen([in_si()], known=steel | {ETA: 0.1, MU: 0.1}) == [MU, MODULUS]
    assert chosen([in_si()], known=scene) == [MU, MODULUS]
    assert chosen([root()], known=scene) == [MU, MODULUS]
    amplitude = np.array([0.3, 0.6, 1.2])
    assert chosen([DissipationCurve(amplitude, amplitude**3)], known=scene) == [MU, MODULUS]


def test_the_numbers_of_a_whole_scene_are_starts():
    assert chosen([in_si()], known=jb.Scene()) == [MU, ETA]
    assert chosen([root()], known=jb.Scene()) == [MU, STIFF]
    sticky = jb.Scene().replace({SLIDERS: 1e-3})
    assert chosen([sliding(0.3)], known=sticky) == [MU, SLIDERS]
    x = np.linspace(0.0, 2.0, 9)
    assert chosen([SqueezeCurve(x, -np.exp(-x))], known=jb.Scene()) == ["strip.kappa_s"]


def test_a_line_tells_a_stiffness_and_no_friction():
    u = 1e-6 * np.sin(np.linspace(0.0, 6.0 * np.pi, 301))
    line = make_loop(2e9 * u, u).but(units=SI)
    assert chosen([line]) == [STIFF]


def test_other_curves_tell_what_they_can():
    amplitude = np.array([0.3, 0.6, 1.2])
    assert chosen([DissipationCurve(amplitude, amplitude**3)]) == [MU, ETA]
    x = np.linspace(0.0, 2.0, 9)
    assert chosen([SqueezeCurve(x, -np.exp(-x))]) == ["strip.kappa_s"]


@pytest.mark.parametrize(("centre", "middle"), [(None, 0.0), (True, 0.0), (False, 3e-4)])
def test_a_contact_that_slides_forgets_its_zero(tmp_path, centre, middle):
    loop, rows = sliding(0.3), []
    for force, displacement in zip(loop.force, loop.displacement, strict=True):
        rows.append(f"{force!s},{displacement + 3e-4!s}")
    (tmp_path / "rig.csv").write_text("\n".join(["force [N],displacement [m]", *rows]))
    specimen = {"data": ["rig.csv"]} | ({} if centre is None else {"centre": centre})
    plan = plan_from_values({"specimen": [specimen]}, tmp_path)
    (taken,) = plan.cases[0].measurements
    found = 0.5 * (np.max(taken.displacement) + np.min(taken.displacement))
    assert found == pytest.approx(middle, abs=1e-9)


@pytest.mark.slow
def test_a_planted_slider_is_found_from_the_file_alone():
    fit = jb.fit(sliding(0.3))
    scene = fit.scene
    gross = float(scene.contact.friction * scene.contact.pressure * scene.strip.length)
    assert gross == pytest.approx(7.0, rel=0.005)
    assert fit.describes
    assert fit.misfit < 0.02
