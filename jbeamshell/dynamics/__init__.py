"""Dynamics of strips, and of structures that have strips as joints.

Strips: `simulate` computes the transient of a scene, `modes` its natural modes, and `let_go` the
ring-down of a mass on it; `ring_down` finds frequency and damping over amplitude from any decaying
signal.

Structures: `Joint` makes a force element of a strip, `Structure` takes the matrices of any
finite-element code, `modal_curve` finds frequency and damping over amplitude without a transient,
and `shake` computes the transient.

The names are loaded on first use; ``__init__.pyi`` says where each of them lives.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
