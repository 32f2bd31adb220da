import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scenes import PLANE, STEPPED

import jbeamshell as jb
from jbeamshell.history import contact_line
from jbeamshell.numerics.cycles import branch_work, closed_cycles, turning_points


def test_branch_work_is_exact_for_parabolas_and_beats_the_trapezoid():
    force = jnp.linspace(-1.0, 1.0, 9)
    displacement = 0.25 * (force + 1.0) ** 2 - 1.0
    exact = 1.0 / 3.0  # int F (F + 1)/2 dF over (-1, 1)
    assert float(branch_work(force, displacement)) == pytest.approx(exact, rel=1e-14)
    odd = float(branch_work(force[:-1], displacement[:-1]))
    assert odd == pytest.approx(float(np.trapezoid(force[:-1], displacement[:-1])), rel=0.2)


@pytest.mark.parametrize(
    ("path", "turns", "cycles"),
    [
        ([0, 1, 2, 1, 0, -1, -2, 0, 2], [0, 2, 6, 8], ((2, 6, 8),)),
        ([0, 1, 0, 1, 0], [0, 1, 2, 3, 4], ((0, 1, 2), (2, 3, 4))),
        ([0, 1, 2, 3], [0, 3], ()),
        ([0, 1, 1, 1, 0.5, 1], [0, 1, 4, 5], ((1, 4, 5),)),
    ],
)
def test_cycles_are_found_in_any_path(path, turns, cycles):
    path = np.array(path, dtype=float)
    assert turning_points(path) == turns
    assert closed_cycles(path) == cycles


def test_figures_of_the_standard_strip():
    history = jb.solve(PLANE.replace({"load.steps_per_half_cycle": 40}))
    force, displacement = map(np.asarray, history.loop)
    assert force.size == 81
    assert float(history.dissipation) == pytest.approx(
        abs(np.trapezoid(force, displacement)), rel=2e-3
    )
    amplitude = 0.5 * np.ptp(displacement)
    assert float(history.secant_stiffness) == pytest.approx(0.7855 / amplitude)
    assert float(history.loss_factor) == pytest.approx(
        float(history.dissipation) / (np.pi * 0.7855 * amplitude)
    )
    *_, stop = history.cycles[-1]
    last = np.zeros_like(history.slip_work)
    last[stop] = 1.0
    assert float(dataclasses.replace(history, slip_work=last).dissipation) == 1.0
    # Well past onset the slip zone is F - 1.7 eta long (mu F_N = 1).
    assert float(history.slip_length) == pytest.approx(0.7855 - 1.7 * 0.1126, abs=0.05)
    assert history.converged
    assert "dissipation ratio" in str(history)
    shown = history._repr_html_()
    assert "<td>dissipation ratio</td>" in shown
    assert shown.count("data:image/png;base64") == 1
    assert set(history.figures()) >= {"dissipation", "reaction_min", "status", "newton_iterations"}


def test_a_path_without_a_cycle_has_no_dissipation_per_cycle():
    history = jb.solve(STEPPED, np.linspace(0.1, 0.6, 20), throw=False)
    with pytest.raises(jb.InputError, match="no closed cycle"):
        _ = history.dissipation
    assert float(jnp.sum(history.slip_work)) > 0.0


def test_the_contact_ends_where_the_force_of_its_last_node_is_used_up():
    x, end = np.arange(8.0), 4.3
    tributary = np.where((x == 0.0) | (x == 7.0), 0.5, 1.0)
    reaction = np.where(x < 4.0, 10.0 - x, 0.0)  # it falls by 1 per length, and stops at the end
    reaction[4] = 10.0 * (end - 3.5) - 0.5 * (end**2 - 3.5**2)  # node 4 has its share from 3.5 on
    touching = reaction > 0.0
    found = contact_line._contact_ends((x, tributary, touching[None], reaction[None]))
    assert float(found[0]) == pytest.approx(end, abs=1e-3)
