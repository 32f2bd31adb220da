"""Beamshells, laminates and a Phi of the user's own on their contact line."""

import sys
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import MOVED, STEPS

import jbeamshell as jb
from jbeamshell.contact_line import strip, walk
from jbeamshell.dynamics.structure.joint import Joint
from jbeamshell.load_steps.elastic_strip import ElasticStrip, V, W
from jbeamshell.load_steps.system import System
from jbeamshell.mechanics.elements import FAR_SIZE

# Elements at the loaded end are so large that slip zones are nested.
SCENE = jb.library.standard().on_grid(17, 1.0 / 6.0).replace({"load.steps_per_half_cycle": 2})
LAYERS = [[0.1, 2.0e4, 0.3], [0.1252, 1.5e5, 0.2]]
AMPLITUDE = float(SCENE.load.amplitude)
SOFT = {"contact.stick_stiffness": 50.0}  # load steps have no ideal friction
condensed = jax.jit(lambda scene: strip.condensed(scene, scene.plan.nodes))


@eqx.filter_jit
def derivatives(scene, q):
    """Second derivatives of the energy, first ones of u(L) and of the sinking, and the nodes."""
    elastic, system = ElasticStrip(scene), System(scene)
    conjugates = jax.grad(system.end_displacement)(q), jax.grad(elastic.sinking)(q)
    return jax.hessian(elastic.strain_energy)(q), *conjugates, elastic.x


@eqx.filter_jit
def system_of(scene):
    return System(scene)


def built_in(e, g, k, psi, dpsi):
    """Phi of the standard strip, written anew."""
    half, modulus, nu = 0.1126, 3.4e4 / 0.2252, 0.3
    shear, contraction = 0.5 * (1.0 - nu) * modulus, nu / (1.0 - nu)
    c11, kappa = modulus / (1.0 - contraction**2), 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu)
    kappa_s = jb.Scene().strip.kappa_s
    stretch = half * c11 * (e + contraction * psi) ** 2 + half * modulus * psi**2
    bend = half**3 / 3.0 * (modulus * k**2 + kappa_s * shear * dpsi**2)
    return stretch + kappa * shear * half * g**2 + bend


def linear(section, **values):
    return SCENE.replace({"model.section": section, "model.kinematics": "linear"} | values)


def of_phi(energy, section="squeeze"):
    """Standard strip with an energy of its own."""
    own = linear(section)
    return jb.Scene(own.strip, own.contact, own.load, own.model, energy)


def beside(scene, **values):
    """The same scene in load steps."""
    return scene.replace(values).by_load_steps()


BODIES = {
    "shell": linear("shell"),
    "squeeze": linear("squeeze"),
    "plane stress": linear("squeeze", **{"strip.plane": "stress"}),
    "guided": linear("squeeze", **{"load.entry": "guided"}),
    "laminate": linear("squeeze", **{"strip.layers": LAYERS}),
    "printed": linear("squeeze", **{"model.constants": "printed"}),
    "coupled": of_phi(
        lambda e, g, k, psi, dpsi: built_in(e + 0.02 * k, g + 0.1 * psi, k, psi, dpsi)
    ),
}


class TestBody:
    @pytest.mark.parametrize(
        "name",
        [
            pytest.param(n, marks=[pytest.mark.slow] if n in ("plane stress", "printed") else [])
            for n in BODIES
        ],
    )
    def test_it_is_the_strip_of_the_load_steps_without_its_inner_fields(self, name):
        """Elimination station by station is that of the whole potential's second derivatives."""
        scene = BODIES[name].replace({"model.nodes": 5})
        zero = np.zeros((5, 4))
        free = np.zeros(zero.shape, bool)
        free[:, list(scene.plan.active)] = True
        for (node, field), _ in system_of(scene).supports(True).items():
            free[node, field] &= field in (0, 1)  # the contact's own are held later
        matrix, pull, press, x = map(np.asarray, derivatives(scene, zero))
        whole = np.zeros((zero.size + 2,) * 2)
        whole[:-2, :-2] = matrix.reshape(zero.size, -1)
        whole[:-2, -2] = whole[-2, :-2] = -pull.ravel()
        whole[:-2, -1] = whole[-1, :-2] = press.ravel()
        places = np.arange(zero.size).reshape(zero.shape)
        kept = np.append(places[:, [V, W]].ravel(), [zero.size, zero.size + 1])
        gone = np.setdiff1d(places[free], kept)
        known = np.linalg.solve(whole[np.ix_(gone, gone)], whole[np.ix_(gone, kept)])
        schur = whole[np.ix_(kept, kept)] - whole[np.ix_(kept, gone)] @ known
        body = condensed(scene)
        np.testing.assert_allclose(body.x, x, atol=1e-15)
        size = np.sqrt(np.abs(np.diag(schur)))
        size = np.where(size > 0.0, size, 1.0)  # a shell is not squeezed
        np.testing.assert_allclose(
            body.pressed.hessian / size / size[:, None], schur / size / size[:, None], atol=1e-12
        )

    def test_a_phi_written_anew_is_the_built_in_one(self):
        one, other = condensed(of_phi(built_in)), condensed(BODIES["squeeze"])
        for name in ("K_tt", "K_tn", "K_nn", "f_t", "r_0", "c"):
            known = getattr(other.body, name)
            close = 1e-12 * float(jnp.abs(known).max())
            np.testing.assert_allclose(getattr(one.body, name), known, atol=close, err_msg=name)


def check_against_load_steps(exact, steps, tolerance=1e-9):
    """All that a history holds at its reversals, and the energy that it stores."""
    assert exact.converged
    every = (steps.force.size - 1) // (exact.force.size - 1)
    at = slice(0, None, every)
    for name in ("displacement", "force", "traction", "reaction", "stored_energy", "sinking"):
        known = np.asarray(getattr(steps, name))[at]
        close = tolerance * np.abs(known).max()
        np.testing.assert_allclose(getattr(exact, name), known, atol=close, err_msg=name)
    for one, other in zip(exact.fields.T, steps.fields[at].T, strict=True):
        np.testing.assert_allclose(one, other, atol=tolerance * np.abs(steps.fields).max())
    for one, other in zip(exact.sections, steps.sections, strict=True):
        known = np.asarray(other)[at]
        np.testing.assert_allclose(one, known, atol=1e-9 * np.abs(known).max() + 1e-12)
    assert steps.dissipation == pytest.approx(float(exact.dissipation), rel=2e-5)


@pytest.fixture
def polygon(monkeypatch):
    """Paths are read on the polygon of their events, whose nodes slip whole as in load steps."""
    jax.clear_caches()
    exact = partial(walk.walk, rounded=False)
    monkeypatch.setattr(sys.modules["jbeamshell.contact_line.solve"], "walk", exact)
    yield
    jax.clear_caches()


class TestHistory:
    """Many load steps of the same section on the same nodes come to the same states."""

    @pytest.fixture(autouse=True)
    def _same_nodes(self, monkeypatch):
        """Each engine has a grid of its own far from the loaded end."""
        monkeypatch.setattr("jbeamshell.scene.plan.CONTACT_LINE_FAR_SIZE", FAR_SIZE)

    @pytest.mark.slow
    @pytest.mark.usefixtures("polygon")
    def test_a_face_that_may_not_turn(self):
        scene = BODIES["guided"].replace(SOFT | {"load.amplitude": 0.4})
        steps = jb.solve(beside(scene, **{"load.steps_per_half_cycle": 160}))
        check_against_load_steps(jb.solve(scene), steps)

    @pytest.mark.slow
    @pytest.mark.usefixtures("polygon")
    def test_plane_stress_and_its_file(self, tmp_path):
        scene = BODIES["plane stress"].replace(SOFT)
        exact = jb.solve(scene)
        steps = jb.solve(beside(scene, **{"load.steps_per_half_cycle": 160}))
        check_against_load_steps(exact, steps)
        exact.save(tmp_path / "run.npz")
        again = jb.read_history(tmp_path / "run.npz")
        assert again.scene.plan == exact.scene.plan
        np.testing.assert_array_equal(again.fields, exact.fields)

    def test_a_strip_that_lifts_while_its_end_is_moved(self):
        lifting = {
            "strip.height_ratio": 0.4,
            "contact.friction": 0.4,
            "contact.stick_stiffness": 50.0,
        }
        scene = MOVED.replace(lifting)
        path = 1e-4 * np.append(np.arange(1, 5) / 4.0, 1.0 - np.arange(1, STEPS - 3) / 8.0)
        steps = jb.solve(scene, path, throw=False)
        line = scene.replace({"model.by": "auto"}).on_grid(41, scene.plan.end_size)
        exact = jb.solve(line, path, throw=False)
        assert exact.scene.plan.on_contact_line
        assert not steps.scene.plan.on_contact_line
        assert float(exact.gap.max()) > 1e-7
        # Slip spreads evenly from node to node on the contact line; in load steps nodes slip whole.
        np.testing.assert_allclose(exact.force, steps.force, atol=5e-3 * np.max(steps.force))
        assert np.sum(exact.slip_work) == pytest.approx(float(np.sum(steps.slip_work)), rel=0.02)
        assert float(exact.gap.max()) == pytest.approx(float(steps.gap.max()), rel=0.02)


class TestFigures:
    @pytest.mark.slow
    def test_sweeps_and_joints_take_them(self):
        scene = BODIES["shell"].replace({"load.steps_per_half_cycle": 1})
        table = jb.sweep(scene, {"load.amplitude": [0.5, AMPLITUDE]})
        assert np.all(table.status == 0)
        history = jb.solve(scene)
        np.testing.assert_allclose(table["dissipation"][1], history.dissipation, rtol=1e-10)
        joint = Joint.of(scene, 1.2)
        moved = history.displacement - history.displacement[history.pressed]
        steps = slice(history.pressed + 1, None)
        # On 17 nodes: a joint is driven by displacements.
        np.testing.assert_allclose(joint.path_forces(moved[steps]), history.force[steps], rtol=1e-5)


class TestEngine:
    @pytest.mark.parametrize("section", ["squeeze", "shell"])
    @pytest.mark.parametrize(
        "values",
        [
            {"model.kinematics": "exact"},
            {"contact.smoothing": 16.0},
            {"contact.normal": "compliant"},
            {"contact.normal": "held"},
            {"model.grid": "collocation"},
            {"load.control": "arc-length", "load.amplitude": 1e-5},
        ],
        ids=lambda values: next(iter(values)),
    )
    def test_what_is_not_linear_takes_load_steps(self, section, values):
        assert linear(section).plan.on_contact_line
        assert not linear(section, **values).plan.on_contact_line

    @pytest.mark.parametrize(
        "energy",
        [
            lambda *s: built_in(*s) + 10.0 * s[0] ** 3,
            lambda *s: built_in(*s) + jnp.abs(s[3]),
            lambda *s: built_in(*s) + 3.0 * s[2],
            lambda *s: built_in(*s) + 5e4 * jnp.maximum(s[0], 0.0) ** 2,
            lambda *s: built_in(*s) * jnp.nan,
            lambda e, g, k, psi, dpsi: e**2 + g**2 + psi**2,
            lambda *s: built_in(*s) - 1e9 * s[4] ** 2,
            lambda e, *s: -built_in(e, *s),
        ],
    )
    def test_so_does_a_phi_that_is_no_positive_quadratic_form(self, energy):
        assert not of_phi(energy).plan.on_contact_line

    def test_a_quadratic_phi_is_on_the_contact_line(self):
        assert of_phi(built_in).plan.on_contact_line
        shell = of_phi(lambda e, g, k, psi, dpsi: e**2 + g**2 + k**2, "shell")
        assert shell.plan.on_contact_line  # it needs no stiffness against the squeeze
