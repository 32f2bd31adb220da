"""Status iteration: equal to Newton's method, for one strip and for lanes side by side."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from toy import STRIP

import jbeamshell as jb
from jbeamshell.quasistatic import slip_patterns
from jbeamshell.quasistatic.assembly import band, times
from jbeamshell.quasistatic.solver import solve
from jbeamshell.quasistatic.stepping import Method
from jbeamshell.quasistatic.system import System
from jbeamshell.quasistatic.tangent import initial_stiffness

SCENE = STRIP.replace(
    {
        "model.nodes": 21,
        "model.kinematics": "linear",
        "load.steps_per_half_cycle": 4,
        "load.cycles": 1,
        "load.pressure_steps": 2,
    }
)
DISPLACED = {"load.control": "displacement", "load.amplitude": 0.002}
STEPPED = {"contact.pressure": [[0.0, 20.0], [1.0, 5.0], [1.0, 12.0], [2.0, 8.0]]}
CASES = {
    "standard": {},
    "displacement": DISPLACED,
    "beyond gross slip": DISPLACED | {"load.amplitude": 0.02, "strip.far_end": "free"},
    "free": {"strip.far_end": "free"},
    "pinned and stepped": {"strip.far_end": "pinned"} | STEPPED,
    "bar": {"model.fields": ["v"]},
    "thick": {"strip.height_ratio": 0.4, "load.amplitude": 1.9, "model.end_size": 1.0 / 60.0},
    # Pressed evenly by a table, so that it shares the program of the stepped pressure.
    "gravel": {"strip.far_end": "pinned", "contact.friction": 0.9, "load.amplitude": 5.0}
    | {"contact.pressure": [[0.0, 10.0], [0.5, 10.0], [1.0, 10.0], [2.0, 10.0]]},
}
# Slow; others hold parts of them.
RARER = {"standard", "bar", "displacement", "free", "thick", "beyond gross slip"}


def same(one, other, rtol):
    """Fields, forces and energies over their largest."""
    for name in ("fields", "traction", "reaction", "force", "displacement", "stored_energy"):
        a, b = (np.asarray(getattr(history, name)) for history in (one, other))
        np.testing.assert_allclose(a, b, rtol=0.0, atol=rtol * np.max(np.abs(a)), err_msg=name)
    np.testing.assert_allclose(
        one.slip_work, other.slip_work, rtol=0.0, atol=rtol * one.dissipation
    )
    assert np.array_equal(one.slipping, other.slipping)


def marked(case):
    return pytest.param(case, marks=pytest.mark.slow) if case in RARER else case


@pytest.mark.parametrize("case", [marked(case) for case in CASES])
def test_status_iteration_finds_what_newton_finds(case, monkeypatch):
    scene = SCENE.replace(CASES[case])
    assert slip_patterns.applies(scene)
    # Without the check by the strip's energy, after which Newton's method would mend the steps.
    found = solve(scene, throw=False, method=Method.UNCHECKED_STATUS_ITERATION)
    assert found.converged
    assert int(np.max(np.asarray(found.iterations))) < slip_patterns.MOST
    monkeypatch.setattr(slip_patterns, "applies", lambda scene: False)
    newton = jb.solve(scene, throw=False, solver=jb.Newton(max_iterations=201))  # traced anew
    assert newton.converged
    assert int(np.sum(newton.iterations)) >= 4
    same(newton, found, 1e-8)


def test_the_band_is_the_stiffness_that_derivatives_say():
    for change in ({}, {"strip.far_end": "free", "model.fields": ["v", "beta"]}):
        system = System(SCENE.replace(change))
        assembled, derived = jax.jit(
            lambda: (
                band(system, system.section_stiffness(), rough=True),  # noqa: B023
                initial_stiffness(system, 1.0),  # noqa: B023
            )
        )()
        for mine, right in zip(assembled[:3], derived.entries, strict=True):
            size = float(np.max(np.abs(derived.entries)))
            np.testing.assert_allclose(np.array(mine), right, rtol=0.0, atol=1e-13 * size)
        weight = derived.response["traction"][0]
        np.testing.assert_allclose(assembled.rubbing, weight, rtol=1e-13)
        x = [jnp.sin((1.0 + i) * system.x) for i in range(len(system.model.active))]
        fields = system.embed(jnp.stack(x, axis=1))
        forces = jax.jit(lambda q: system.elastic_forces(q, 1.0)[:, 1])  # noqa: B023
        force = forces(fields) - forces(0.0 * fields)
        found = times(assembled.normal, x) * system.tributary
        np.testing.assert_allclose(found, force, rtol=0.0, atol=1e-12 * float(np.abs(force).max()))


@pytest.mark.slow
def test_lanes_side_by_side_answer_as_one_by_one():
    """Also for numbers that no lane varies, and lanes that need different numbers of guesses."""
    keys = ("load.amplitude", "strip.height_ratio")
    values = jnp.geomspace(0.2, 1.9, 5), jnp.array([0.3, 0.02, 0.1, 0.05, 0.2])
    ask = jb.response(
        SCENE, keys, ("dissipation", "peak_displacement"), method=Method.STATUS_ITERATION
    )
    together = jax.vmap(ask)(*values)
    assert np.all(np.asarray(together["status"]) == 0)
    for lane, (amplitude, height) in enumerate(zip(*values, strict=True)):
        alone = jb.solve(SCENE.replace({keys[0]: amplitude, keys[1]: height}), throw=False)
        for name in ("dissipation", "peak_displacement"):
            assert together[name][lane] == pytest.approx(float(getattr(alone, name)), rel=1e-9)
    rest = jax.vmap(jb.response(SCENE, keys[:1], method=Method.STATUS_ITERATION))(values[0])
    height = SCENE.strip.height_ratio
    again = jax.vmap(ask, in_axes=(0, None))(values[0], height)
    np.testing.assert_allclose(rest["dissipation"], again["dissipation"], rtol=1e-12)


@pytest.mark.parametrize(
    ("fault", "method"),
    [
        pytest.param("no guesses", Method.STATUS_ITERATION, marks=pytest.mark.slow),
        ("a wrong answer", Method.UNCHECKED_STATUS_ITERATION),
    ],
)
@pytest.mark.doubtful("few nodes", "the section shell")
def test_steps_that_do_not_settle_are_walked_by_newton(fault, method, monkeypatch):
    """The status says so with either check, and `solve` goes on."""
    scene = SCENE.replace({"model.fields": ["v", "beta"]})
    right = jb.solve(scene, throw=False)
    if fault == "no guesses":
        monkeypatch.setattr(slip_patterns, "MOST", 0)
        scene = scene.replace({"load.pressure_steps": 3})  # traced anew
    else:
        solved = slip_patterns._solve
        monkeypatch.setattr(
            slip_patterns, "_solve", lambda *given: [1.000001 * x for x in solved(*given)]
        )
        scene = scene.replace({"load.pressure_steps": 4})
    monkeypatch.setattr("jbeamshell.quasistatic.recovery.PIECES", ())
    assert not solve(scene, throw=False, method=method).converged
    # As many pieces as the path has steps: one shape to compile.
    steps = right.force.size + scene.load.pressure_steps - SCENE.load.pressure_steps
    monkeypatch.setattr("jbeamshell.quasistatic.recovery.PIECES", (steps,))
    walked = solve(scene, method=method)
    assert walked.converged
    assert float(walked.dissipation) == pytest.approx(float(right.dissipation), rel=1e-9)
