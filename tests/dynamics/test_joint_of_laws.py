"""Joints of laws: sliders in place of a fitted law, in a structure and on their own."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell import laws
from jbeamshell.dynamics import Attachment, Joint, Structure, modal_curve

MASING = {
    "sliders": laws.law_named("sliders3")(0.01, 0.05, 0.6, 0.9, 0.5),
    "iwan4": laws.Iwan4(2.0, 100.0, -0.5, 0.3),
    "iwan4, steep": laws.Iwan4(2.0, 100.0, -0.9, 0.0),
    "bar": laws.Bar(2.0, 0.05),
}


@pytest.mark.parametrize("name", MASING)
def test_a_joint_has_the_loops_of_its_law(name):
    law = MASING[name]
    joint = Joint.of(law).times(3.0)
    slides = float(joint.displacements[-2])
    size = slides * np.geomspace(1e-3, 4.0, 57)
    lost = 3.0 * np.asarray(law.dissipation(size))
    np.testing.assert_allclose(joint.dissipation(size), lost, rtol=1.01e-2, atol=1e-9 * lost[-1])
    np.testing.assert_allclose(joint.backbone(size), 3.0 * law.backbone(size), rtol=2e-3)
    path = slides * np.array([0.5, -0.3, 0.2, -0.1, 0.9, -1.2, 0.1, 1.3])
    forces = 3.0 * np.asarray(law.path_forces(path))
    np.testing.assert_allclose(joint.path_forces(path), forces, rtol=0.0, atol=1.2e-2)
    assert name != "sliders" or np.max(np.abs(np.asarray(joint.path_forces(path)) - forces)) < 1e-12
    u = joint.displacement(jnp.asarray([0.6, 3.0]))
    np.testing.assert_allclose(joint.backbone(u), [0.6, 3.0], rtol=1e-12)


def test_a_joint_has_the_slopes_of_its_law():
    """Relative changes of the energy with each number, between the points as well."""
    law = MASING["iwan4"]
    size = float(Joint.of(law).displacements[-2]) * np.geomspace(1e-3, 0.999, 57)
    lost = np.asarray(law.dissipation(size))[:, None]

    def slopes(of):
        keys = list(law.table())
        start = jnp.asarray([law.get(key) for key in keys])

        def loss(values):
            return of(law.replace(dict(zip(keys, values, strict=True)))).dissipation(size)

        return np.asarray(jax.jit(jax.jacfwd(loss))(start)) * np.asarray(start) / lost

    np.testing.assert_allclose(slopes(Joint.of), slopes(lambda law: law), rtol=0.03, atol=5e-3)


def test_a_structure_takes_a_law_as_its_joint_with_derivatives_to_its_numbers():
    """One mass on a Jenkins element: F(U)/U is omega^2, and 4 F (U - u_S) is lost per cycle."""

    def frequency(limit):
        law = laws.Jenkins(limit, 4.0)
        return modal_curve(Structure([[1.0]], [[0.0]], [Attachment(law, 0)]), [1.0]).frequency[0]

    found, slope = jax.jit(jax.value_and_grad(frequency))(1.5)
    assert float(found) == pytest.approx(1.5**0.5 / (2.0 * np.pi), rel=1e-9)
    assert float(slope) == pytest.approx(0.5 / 1.5**0.5 / (2.0 * np.pi), rel=1e-9)


def test_a_force_below_gross_slip_ends_the_joint_there():
    law = MASING["iwan4"]
    joint = Joint.of(law, 1.0)
    assert float(joint.forces[-1]) == pytest.approx(1.0, rel=1e-9)
    assert float(joint.reach) == pytest.approx(float(law.displacement(1.0)), rel=1e-9)
    with pytest.raises(jb.InputError, match=r"force of joint = 1\.5: is beyond the last point"):
        joint.displacement(1.5)


def test_a_law_without_masings_memory_is_refused():
    for name in ("bouc-wen", "dahl", "lugre", "jang-barber"):
        with pytest.raises(jb.InputError, match=f"^law = '{name}': has no Masing memory.*iwan4"):
            Structure([[1.0]], [[1.0]], [Attachment(laws.LAWS[name](), 0)])


class Held(laws.law_named("sliders2")):
    """Sliders beside a spring that never slips."""

    heading = "held"

    @property
    def spring(self):
        return jnp.asarray(2.0)


def test_a_law_that_rises_for_ever_needs_a_force():
    held = Held(0.1, 0.5)
    with pytest.raises(jb.InputError, match=r"^law = 'held': rises for ever"):
        Joint.of(held)
    assert float(Joint.of(held, 3.0).forces[-1]) == pytest.approx(3.0)


@pytest.mark.slow
def test_the_joint_of_a_plain_scene_loses_what_a_plain_call_does_at_small_amplitudes():
    # The squeeze section, which serves the scene's own amplitude, loses 18 times as much at .1.
    scene = jb.Scene()
    joint = Joint.of(scene)
    for force in (0.1, 0.3, 0.6):
        lost = jb.solve(scene.replace({"load.amplitude": force})).dissipation
        assert float(joint.dissipation(joint.displacement(force))) == pytest.approx(
            float(lost), rel=0.1
        )
