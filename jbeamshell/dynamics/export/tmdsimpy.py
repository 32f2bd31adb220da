"""Lines for tmdsimpy: a VectorJenkins force for each slider, and VectorIwan4 in place of them."""

from __future__ import annotations

from pathlib import Path

from jbeamshell.dynamics.export.element import Element, rows
from jbeamshell.dynamics.four_parameters import (
    ENOUGH,
    FRACTIONS,
    FourParameters,
    four_parameters,
)

SLIDERS = '''

def jenkins(Q, T):
    """Forces of the sliders; Q (1, N) takes u from the unknowns, T (N, 1) puts F there."""
    from tmdsimpy.nlforces.vector_jenkins import VectorJenkins

    return [VectorJenkins(Q, T, kt, Fs) for kt, Fs in SLIDERS]


def stiffness(Q, T):
    """Matrix (N, N) of the spring, to be added to that of the system."""
    return SPRING * (T @ Q)
'''
IWAN4 = '''

def iwan4(Q, T, sliders=1000):
    """Segalman's four-parameter model, in place of the sliders and the spring."""
    from tmdsimpy.nlforces.vector_iwan4 import VectorIwan4

    return VectorIwan4(Q, T, **IWAN4, Nsliders=sliders)
'''


def write(element: Element, draft: Path) -> None:
    """Write a module with `jenkins` and `stiffness`, and `iwan4` where gross slip is known."""
    notes = [
        "In a model: import this file, add each of jenkins(Q, T) by add_nl_force, and",
        "stiffness(Q, T) to K.  tmdsimpy samples the cycle: Nt = 2**10 gives the first harmonic",
        "within 1e-6.",
    ]
    joint = element.joint
    known = float(joint.forces[-1]) >= FRACTIONS[ENOUGH - 1] * float(joint.capacity)
    model = four_parameters(joint) if known else None
    draft.write_text(
        element.comment("#", notes)
        + "\n# kt and Fs of each slider\nSLIDERS = "
        + rows(element.sliders)
        + f"SPRING = {element.spring!r}\n"
        + _parameters(model)
        + SLIDERS
        + (IWAN4 if model is not None else ""),
        encoding="utf-8",
    )


def _parameters(model: FourParameters | None) -> str:
    """Lines of the four parameters, with their errors, or why there are none."""
    if model is None:
        return (
            "# No four-parameter Iwan model: the force of gross slip is not known, or far away.\n"
        )
    law = model.law
    named = {"kt": law.stiffness, "Fs": law.slip_force, "chi": law.chi, "beta": law.beta}
    errors = "".join(f"# {line}\n" for line in str(model).splitlines())
    return f"\n{errors}IWAN4 = { {name: float(x) for name, x in named.items()} }\n"
