"""Sections by name, keys that they replaced, the bar beside its closed form."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import STEPPED, UNEVEN
from toy import STRIP

import jbeamshell as jb
from jbeamshell import reference
from jbeamshell.history.reliability import doubts_of_scene
from jbeamshell.scene.plan import LINE, STEPS
from jbeamshell.scene.sections import SECTIONS
from jbeamshell.scene.toml import overridden, scene_from_values

SMALL = {"model.nodes": 41, "load.steps_per_half_cycle": 8, "model.kinematics": "linear"}


def on(section, **more):
    return jb.Scene().replace(SMALL | {"model.section": section} | more)


@pytest.mark.parametrize("section", SECTIONS)
def test_names_come_back(section, tmp_path):
    scene = on(section)
    assert scene.plan.section == scene.get("model.section") == section
    jb.write_scene(scene, tmp_path / "scene.toml")
    again = jb.read_scene(tmp_path / "scene.toml")
    assert again.model == scene.model
    assert again.plan == scene.plan
    assert f"section {section} " in str(scene)


def test_a_section_keeps_the_lift():
    lifting = STRIP.replace({"model.section": "squeeze"})
    assert lifting.replace({"model.section": "shell"}).plan.fields == ("v", "w", "beta")
    assert lifting.replace({"model.section": "bar"}).plan.fields == ("v",)
    held = lifting.replace({"contact.normal": "held"})
    assert held.replace({"model.section": "shell"}).plan.fields == ("v", "beta")
    merged = overridden({"model.section": "squeeze"}, {"model.section": "plane"})
    assert scene_from_values(merged).plan.section == "plane"


BAR = jb.Scene().replace({"model.section": "bar"})
EVEN = BAR.on_grid(41, 2.0 / 15.0 / 0.1126)  # the smallest elements are as long as the largest
STRETCH, RESISTANCE = 3.4e4, 1.0  # E' 2H and mu p of the standard strip, whose gross slip is 2


@pytest.mark.parametrize("part", [pytest.param(0.05, marks=pytest.mark.slow), 0.19, 0.5, 0.95])
@pytest.mark.parametrize("control", ["force", "displacement"])
@pytest.mark.doubtful("the section bar")
def test_the_bar_is_the_cubic_law(part, control):
    """Its planned grid leaves less than a tenth of the tolerance of D, and a third of that of u."""
    force = 2.0 * part
    u = float(reference.bar_backbone(force, STRETCH, RESISTANCE))
    amplitude = {"force": force, "displacement": u}[control]
    history = jb.solve(BAR.replace({"load.control": control, "load.amplitude": amplitude}))
    assert history.scene.plan.engine == LINE
    exact = float(reference.cubic_law(force, STRETCH, RESISTANCE))
    assert float(history.dissipation) == pytest.approx(exact, rel=1e-3)
    assert float(history.secant_stiffness) == pytest.approx(force / u, rel=3.5e-4)
    # Parabolas miss some of a loop over the displacement, which is vertical where it turns.
    missed = {"force": 1e-3, "displacement": 1e-2}[control]
    assert float(history.dissipation_loop / history.dissipation) == pytest.approx(1.0, rel=missed)
    assert history.converged
    assert float(history.reaction_min) == pytest.approx(10.0, rel=1e-14)
    assert float(jnp.max(jnp.abs(history.gap))) == 0.0


@pytest.mark.doubtful("the section bar", "few nodes")
def test_on_even_elements_the_bar_is_exact():
    """A node slips half an element ahead, which the spline of the events takes back wholly.

    Where a load turns between two events the next branch begins within a corner of the spline.
    Loads such as 1.54 leave some millionths of D by that, and ten times as much of u.
    """
    force = np.linspace(0.02, 1.9, 95)
    first = jb.solve(EVEN, force)
    np.testing.assert_allclose(np.diff(first.x), 0.05, rtol=1e-12)
    expected = reference.bar_backbone(force, STRETCH, RESISTANCE)
    np.testing.assert_allclose(first.displacement[-force.size :], expected, rtol=1e-12)
    for amplitude, error in ((1.0, 1e-12), (1.54, 1e-5)):
        history = jb.solve(EVEN.replace({"load.amplitude": amplitude}))
        exact = float(reference.cubic_law(amplitude, STRETCH, RESISTANCE))
        assert float(history.dissipation) == pytest.approx(exact, rel=error)
    loop = reference.bar_hysteresis(1.54, STRETCH, RESISTANCE, history.scene.plan.steps + 1)
    np.testing.assert_allclose(history.loop[0], loop[0], atol=1e-15)
    np.testing.assert_allclose(history.loop[1], loop[1], atol=1e-4 * float(np.max(loop[1])))


UNLIKE = {"load.amplitude": 0.8, "contact.bottom_pressure": 4.0, "contact.pressure": UNEVEN}


@pytest.mark.parametrize(
    "more",
    [
        UNLIKE,
        *(
            pytest.param(values, marks=pytest.mark.slow)
            for values in (
                {"strip.layers": [[0.1, 1e5, 0.3], [0.1252, 2e5, 0.3]]},
                {"load.entry": "face"},
                {"load.control": "displacement", "load.amplitude": 1e-5},
                {"load.control": "displacement", "load.amplitude": 1e-3},
                {
                    "contact.pressure": [
                        [0.0, 10.0],
                        [1.0, 10.0],
                        [1.0, 0.0],
                        [1.5, 0.0],
                        [1.5, 10.0],
                    ]
                },
                {"contact.stick_stiffness": 1.0},
            )
        ),
    ],
    ids=lambda values: next(reversed(values)),
)
def test_the_bar_is_the_limit_of_load_steps(more):
    scene = STEPPED.replace({"model.section": "bar"} | more)
    stepped = jb.solve(scene, throw=False)
    line = jb.solve(scene.replace({"model.by": "auto"}), throw=False)
    assert (line.scene.plan.engine, stepped.scene.plan.engine) == (LINE, STEPS)
    assert float(stepped.dissipation) == pytest.approx(float(line.dissipation), rel=4e-3)
    size = float(np.max(np.abs(line.force)))
    np.testing.assert_allclose(stepped.force, line.force, atol=8e-3 * size)
    moved = float(np.max(np.abs(line.displacement)))
    np.testing.assert_allclose(stepped.displacement, line.displacement, atol=8e-3 * moved)
    pull, *others = line.sections
    assert not any(np.any(other) for other in others)  # a bar has a normal force alone
    profiles = [
        (line.x, line.v, stepped.x, stepped.v),
        (line.middles, pull, stepped.middles, stepped.sections[0]),
    ]
    for at, values, there, expected in profiles:
        found = np.interp(there, at, values[-1])
        np.testing.assert_allclose(found, expected[-1], atol=0.03 * float(np.max(np.abs(found))))


@pytest.mark.doubtful("the section bar", "few nodes")
def test_gradients_pass_through_the_bar():
    """D falls as 1/mu; on even elements it does so exactly, between corners of the spline."""

    def dissipation(mu):
        return jb.solve(EVEN.replace({"contact.friction": mu, "load.amplitude": 1.0})).dissipation

    slope, step = jax.jit(jax.jacfwd(dissipation))(0.1), 1e-7
    differences = (dissipation(0.1 + step) - dissipation(0.1 - step)) / (2.0 * step)
    assert float(slope) == pytest.approx(float(differences), rel=1e-5)
    assert float(slope) == pytest.approx(-float(dissipation(0.1)) / 0.1, rel=1e-12)


@pytest.mark.parametrize(
    "more",
    [
        {"load.cycles": 0},
        {"contact.normal": "held"},
        {"model.kinematics": "exact"},
    ],
    ids=["pressing", "held", "exact"],
)
def test_a_bar_without_a_contact_line_takes_load_steps(more):
    assert on("bar", **more).plan.engine == STEPS


def test_a_bar_never_turns():
    """Linear kinematics are no doubt of a bar, however much presses."""
    much = {"contact.pressure": 5e3, "load.amplitude": 200.0}
    bar, shell = (doubts_of_scene(on(section, **much)) for section in ("bar", "shell"))
    assert not any("kinematics are linear" in doubt for doubt in bar)
    assert any("kinematics are linear" in doubt for doubt in shell)


def test_the_bar_follows_pressures_that_change():
    """Friction is less where less presses; without a move, less pressure lets nothing slip on."""
    loads = np.append(np.linspace(0.1, 0.5, 5), np.append([0.5] * 5, np.linspace(0.43, -0.2, 10)))
    path = np.stack([loads, np.append([1.0] * 5, np.append(np.linspace(0.9, 0.5, 5), [0.5] * 10))])
    bar = STEPPED.replace({"model.section": "bar"})
    stepped = jb.solve(bar, path.T, throw=False)
    ideal = {"model.by": "auto", "contact.stick_stiffness": None}
    line = jb.solve(bar.replace(ideal), path.T, throw=False)
    assert (line.scene.plan.engine, stepped.scene.plan.engine) == (LINE, STEPS)
    exact, near = (np.asarray(run.displacement)[[5, 10, 20]] for run in (line, stepped))
    np.testing.assert_allclose(exact, near, atol=1e-3 * exact[1])
    assert exact[1] == pytest.approx(2.0 * exact[0], rel=0.01)
