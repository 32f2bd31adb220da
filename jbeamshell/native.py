"""Functions that a core runs as one piece of native code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
from jax.experimental.xla_metadata import set_xla_metadata

# The compiler's own mark of calls that become one function: it ignores what it does not know.
MARK = {"inlineable": "false", "xla_cpu_small_call": "true"}
REFUSED = ("custom_call", "stablehlo.sort", "stablehlo.fft")  # they need the runtime around them


class Native:
    """A function of arrays that a CPU runs as one native function.

    Otherwise each of its operations is a call of its own, and they take turns on several threads,
    which takes longer than the arithmetic of a strip of some dozen nodes.

    Attributes
    ----------
    compiled : the function; not for transformations
    fits : whether it is one that can be had in this form; None is not tried yet
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._inside = jax.jit(function)
        self.compiled = jax.jit(self._marked)
        self.fits: bool | None = None

    def _marked(self, *given: Any) -> Any:
        leaves, tree = jax.tree.flatten(self._inside(*given))
        leaves[0] = set_xla_metadata(leaves[0], **MARK)  # the call that makes it
        return jax.tree.unflatten(tree, leaves)

    def now(self, *given: Any) -> Any | None:
        """The function's value, or None where it is not to be had: the caller has another way."""
        if self.fits is False or any(isinstance(each, jax.core.Tracer) for each in given):
            return None
        try:
            with jax.ensure_compile_time_eval():  # now, even while another function is traced
                if self.fits is None:
                    self.fits = _may_fit(self.compiled, given)
                return self.compiled(*given) if self.fits else None
        except jax.errors.JaxRuntimeError:  # the compiler found something that it cannot take in
            self.fits = False
            return None


def _may_fit(compiled: Any, given: tuple[Any, ...]) -> bool:
    if jax.default_backend() != "cpu":
        return False
    text = compiled.lower(*given).as_text()
    return not any(word in text for word in REFUSED)
