"""Single precision: what is computed at once is computed in double, and doubts name the rest."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jbeamshell as jb

FINE = {"model.nodes": 129}


@pytest.fixture
def single() -> Any:
    with jax.enable_x64(False):
        yield


def in_double(ask: Callable[[], Any]) -> Any:
    with jax.enable_x64(True):
        return ask()


def fine() -> jb.Scene:
    return jb.Scene().replace(FINE)


class TestSinglePrecision:
    """Elimination of a fine grid in single precision is off by 3 %."""

    def test_a_run_is_that_of_double_precision(self, single: None) -> None:
        history = jb.solve(fine())
        expected = in_double(lambda: float(jb.solve(fine()).dissipation))
        assert history.force.dtype == np.float32
        assert float(history.dissipation) == pytest.approx(expected, rel=2e-6)

    @pytest.mark.parametrize("amplitude", [0.1, 0.7855])
    def test_the_plan_is_that_of_double_precision(self, single: None, amplitude: float) -> None:
        def planned() -> tuple[str, str, int]:
            plan = jb.Scene().replace({"load.amplitude": amplitude}).plan
            return plan.section, plan.kinematics, plan.nodes

        assert planned() == in_double(planned)

    @pytest.mark.slow
    def test_so_are_a_response_and_a_sweep(self, single: None) -> None:
        amplitude = float(fine().load.amplitude)

        def asked() -> float:
            return float(jb.response(fine(), ["load.amplitude"])(amplitude)["dissipation"])

        def swept() -> float:
            return float(jb.sweep(fine(), {"load.amplitude": [amplitude]})["dissipation"][0])

        for ask in (asked, swept):
            assert ask() == pytest.approx(in_double(ask), rel=2e-6)

    def test_scenes_made_before_double_precision_is_switched_on(self, single: None) -> None:
        scene = fine()
        expected = in_double(lambda: float(jb.solve(fine()).dissipation))
        assert in_double(lambda: float(jb.solve(scene).dissipation)) == pytest.approx(
            expected, rel=2e-6
        )

    @pytest.mark.slow
    def test_gradients_of_a_section_are_right(self, single: None) -> None:
        def slope() -> float:
            squeeze = jb.Scene().replace({"model.section": "squeeze"})
            ask = jb.response(squeeze, ["contact.friction"])
            return float(jax.grad(lambda mu: ask(mu)["dissipation"])(jnp.asarray(0.1)))

        assert slope() == pytest.approx(in_double(slope), rel=2e-3)

    def test_a_transformation_of_a_fine_grid_is_doubted(self, single: None) -> None:
        ask = jb.response(fine(), ["contact.friction"])
        with pytest.warns(jb.DoubtfulWarning, match="single precision in a JAX transformation"):
            jax.eval_shape(lambda mu: ask(mu)["dissipation"], jnp.asarray(0.1))
