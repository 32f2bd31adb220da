"""Two layers that slip in bending: the closed form of Goodman and Klumpp, and who meets it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.contact_line.body import eliminate
from jbeamshell.contact_line.ends import end_section
from jbeamshell.contact_line.section import section_form

LENGTH, STRETCHING, SHEAR = 2.0, 3.4e4, 1.0


def layer(section, eta, side, nodes=41):
    """Layer above or below the contact (side 1 or -1), clamped at X = 0, bent by half the force."""
    values = {"model.section": section, "model.kinematics": "linear", "strip.height_ratio": eta}
    form = section_form(jb.Scene().replace(values))
    x = jnp.linspace(0.0, LENGTH, nodes)
    weights = np.full(nodes, LENGTH / (nodes - 1))
    weights[[0, -1]] *= 0.5
    pull = jnp.zeros_like(form.pull).at[1].set(0.5 * side)
    form = form._replace(pull=pull)
    ends = end_section(form, "guided", level=True), end_section(form)
    (made,) = eliminate(form, x, jnp.asarray(10.0 * weights)[:, None], *ends)
    sign = np.append(np.tile([1.0, side], nodes), [1.0, 1.0])
    hessian = (np.asarray(made.hessian) * sign[:, None] * sign)[2:, 2:]  # without the clamped node
    return jb.Substructure(x[1:], hessian[:-2, :-2], -hessian[:-2, -2:], -hessian[-2:, -2:])


def compared(section, eta, ratio):
    """Dissipation and largest deflection of two layers over those of the closed form."""
    height = LENGTH * eta
    amplitude = ratio * jb.reference.layered_beam_slip_force(height, SHEAR)
    layers = (layer(section, eta, side) for side in (1.0, -1.0))
    load = {"amplitude": amplitude, "steps_per_half_cycle": 8, "assembly": "frictionless"}
    found = jb.solve_contact(*layers, friction=0.1, **load)
    beam = amplitude, LENGTH, height, STRETCHING, SHEAR
    lost, deflection = (
        float(each(*beam))
        for each in (jb.reference.layered_beam_dissipation, jb.reference.layered_beam_deflection)
    )
    return float(found.dissipation) / lost, float(found.peak_displacement) / deflection


def test_the_loop_of_the_backbone_holds_the_dissipation():
    beam, peak = (LENGTH, 0.1, STRETCHING, SHEAR), 0.5
    force = jnp.linspace(0.0, peak, 2001)
    w = jb.reference.layered_beam_deflection(force, *beam)
    backbone = float(jnp.trapezoid(force, w))
    end = float(w[-1])
    masing = 8.0 * backbone - 4.0 * peak * end
    lost = float(jb.reference.layered_beam_dissipation(peak, *beam))
    assert masing == pytest.approx(lost, rel=1e-5)
    assert float(jb.reference.layered_beam_dissipation(0.1, *beam)) == 0.0
    cap = 3.0 * peak / (8.0 * 0.1)
    slope = jax.grad(lambda q: jb.reference.layered_beam_dissipation(peak, *beam[:3], q))(cap)
    assert float(slope) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_thin_layers_meet_it():
    for ratio in (1.5, 4.0):
        lost, deflection = compared("shell", 0.01, ratio)
        assert lost == pytest.approx(1.0, abs=5e-4)
        assert deflection == pytest.approx(1.0, abs=5e-4)


@pytest.mark.slow
def test_thick_layers_leave_it_by_their_shear():
    lost, deflection = zip(
        *(compared("squeeze", eta, 1.5) for eta in (0.01, 0.1126, 0.2358)), strict=True
    )
    assert lost == pytest.approx([1.0, 1.0, 1.0], abs=0.025)
    assert deflection == pytest.approx([1.0, 1.026, 1.122], abs=0.002)
