"""Lines for tmdsimpy: a VectorJenkins force for each slider."""

from __future__ import annotations

from pathlib import Path

from jbeamshell.dynamics.export.element import Element, rows

CODE = '''

def jenkins(Q, T):
    """Forces of the sliders; Q (1, N) takes u from the unknowns, T (N, 1) puts F there."""
    from tmdsimpy.nlforces.vector_jenkins import VectorJenkins

    return [VectorJenkins(Q, T, kt, Fs) for kt, Fs in SLIDERS]


def stiffness(Q, T):
    """Matrix (N, N) of the spring, to be added to that of the system."""
    return SPRING * (T @ Q)
'''


def write(element: Element, draft: Path) -> None:
    """Write a module with `jenkins` and `stiffness`."""
    notes = [
        "In a model: import this file, add each of jenkins(Q, T) by add_nl_force, and",
        "stiffness(Q, T) to K.  tmdsimpy samples the cycle: Nt = 2**10 gives the first harmonic",
        "within 1e-6.",
    ]
    draft.write_text(
        element.comment("#", notes)
        + "\n# kt and Fs of each slider\nSLIDERS = "
        + rows(element.sliders)
        + f"SPRING = {element.spring!r}\n"
        + CODE,
        encoding="utf-8",
    )
