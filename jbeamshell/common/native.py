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
    """A function of numbers that runs as one native function on a CPU, where that can be had.

    Otherwise each of its operations is a call of its own, and they take turns on several threads,
    which takes longer than the arithmetic of a strip of some dozen nodes.

    Attributes
    ----------
    ordinary : the compiled function
    whole : another form of it: one call, which is marked
    fits : whether that can be had; None is not tried yet
    """

    def __init__(self, function: Callable[..., Any], *, worth: bool = True) -> None:
        self.ordinary = jax.jit(function)
        self.whole = jax.jit(self._marked)
        self.fits = None if worth else False

    def _marked(self, *given: Any) -> Any:
        leaves, tree = jax.tree.flatten(self.ordinary(*given))
        leaves[0] = set_xla_metadata(leaves[0], **MARK)  # the call that makes it
        return jax.tree.unflatten(tree, leaves)

    def now(self, *given: Any) -> Any | None:
        """The function's value, or None if it is asked by a transformation: it is for numbers."""
        if any(isinstance(each, jax.core.Tracer) for each in given):
            return None
        with jax.ensure_compile_time_eval():  # now, even while another function is traced
            if self.fits is None:
                self.fits = _may_fit(self.whole, given)
            if self.fits:
                try:
                    return self.whole(*given)
                except jax.errors.JaxRuntimeError:  # the compiler cannot take something in
                    self.fits = False
            return self.ordinary(*given)


def _may_fit(whole: Any, given: tuple[Any, ...]) -> bool:
    if jax.default_backend() != "cpu":
        return False
    text = whole.lower(*given).as_text()
    return not any(word in text for word in REFUSED)
