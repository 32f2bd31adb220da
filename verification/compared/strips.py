"""The scenes on which methods are compared, and what of a run is recorded."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jbeamshell as jb
from calibration.strip import in_load_steps

LINEAR = {"model.kinematics": "linear"}
# What is changed of the standard strip, on whose nodes they all are.
STRIPS: dict[str, dict[str, Any]] = {
    "standard": {},
    "thick": {"strip.height_ratio": 0.4, "load.amplitude": 1.6},
    "stiff slider": {"contact.stick_stiffness": 1e4},
    "printed constants": {
        "strip.height_ratio": 0.4,
        "load.amplitude": 1.6,
        "model.constants": "printed",
    },
    "near gross slip": {"load.amplitude": 1.98},
}


def scene_of(name: str, nodes: int = 81, **load: int) -> jb.Scene:
    """One of the scenes, with linear kinematics; ``load`` sets counts of its load path."""
    counts = {f"load.{key}": value for key, value in load.items()}
    return in_load_steps().replace(STRIPS[name] | LINEAR | {"model.nodes": nodes} | counts)


@eqx.filter_jit
def _second_derivatives(scene: jb.Scene) -> jax.Array:
    energy = scene.strain_energy()
    return jax.hessian(lambda strains: energy(*strains))(jnp.zeros(5))


def stiffness_of_section(scene: jb.Scene) -> np.ndarray:
    """Matrix C (5, 5) of Phi = E.C E/2, E the strains (e, g, k, psi, psi')."""
    return np.asarray(_second_derivatives(scene))


def number(value: Any) -> float | None:
    """A number as a record holds it, to nine digits; None is what is not finite."""
    return float(f"{float(value):.9g}") if np.isfinite(float(value)) else None
