"""Values that only a wrong unit explains are said, beside a misfit that tells nothing."""

import re

import jax.numpy as jnp
import numpy as np
import pytest
from toy import Formula, Readings, X, scene

from jbeamshell import identify
from jbeamshell.identify.doubts import doubt_of_units
from jbeamshell.identify.observations import run_of
from jbeamshell.identify.parameters import Parameter
from jbeamshell.identify.search_space import search_space
from jbeamshell.identify.specimens import Specimen

STIFF, MU = "strip.axial_stiffness", "contact.friction"
TRUE = 2.0e4


class Pull(Readings):
    """Displacements of a bar under forces X below gross slip."""


class Bar(Formula):
    def predict(self, model, solver):
        return self.x**2 / model.get(STIFF), jnp.asarray(True)


@run_of.register
def _(measurement: Pull, model):
    weight = np.broadcast_to(1.0 / np.ptp(measurement.y), measurement.x.shape)
    return Bar(*map(jnp.asarray, (measurement.y, weight, measurement.x)))


def fitted(factor, start=TRUE, **options):
    """Fit of the stiffness to displacements that a wrong unit multiplies by a factor."""
    data = Pull(X, factor * X**2 / TRUE)
    return identify.fit(data, scene(), [Parameter(STIFF, start=start, **options)])


@pytest.mark.parametrize(
    ("factor", "told"),
    [(1e3, "1000 times below its start.*=um"), (1e-3, "times above its start.*force=N")],
)
def test_a_free_stiffness_takes_a_wrong_unit_and_says_so(factor, told):
    found = fitted(factor)
    assert found.values[STIFF] == pytest.approx(TRUE / factor, rel=1e-3)
    assert found.misfit < 1e-6
    (doubt,) = [warning for warning in found.doubts if "--unit" in warning]
    assert re.search(told, doubt)


def test_a_start_that_is_only_far_off_says_nothing():
    for start in (TRUE / 5.0, 5.0 * TRUE):
        assert not [warning for warning in fitted(1.0, start).doubts if "--unit" in warning]


def test_a_bound_that_a_wrong_unit_meets_says_so():
    found = fitted(1e3, low=5e3, high=1e5)
    assert any("at its bound: are kilonewtons taken" in warning for warning in found.doubts)


def test_friction_that_no_surface_has_is_said_unless_the_stiffness_tells_more():
    strip = scene()
    keys = [Parameter(MU), Parameter(STIFF)]
    space, _ = search_space(keys, [Specimen().case(strip, [])])
    stiffness = float(strip.get(STIFF))
    assert doubt_of_units(space, [0.2, stiffness]) == []
    (both,) = doubt_of_units(space, [200.0, stiffness])
    assert "which no surface has: are newtons taken for kilonewtons" in both
    (force,) = doubt_of_units(space, [2e-4, 1e-3 * stiffness])
    assert STIFF in force
    assert "kilonewtons taken for newtons" in force
