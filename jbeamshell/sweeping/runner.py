"""Blocks of lanes: one compiled shape, chunks, and lanes that fail solved alone."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.common.small import quick_options
from jbeamshell.common.threads import on_processor
from jbeamshell.contact_line.interpolation import Range
from jbeamshell.contact_line.shared import Layout, shared
from jbeamshell.history.history import FIGURES, History
from jbeamshell.numerics.newton import Newton
from jbeamshell.scene.planning import turning
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.template import Template
from jbeamshell.solving.response import Response, figures, response
from jbeamshell.solving.solve import run
from jbeamshell.sweeping.lanes import Lanes, Outcome

ABREAST = 128  # most lanes of a chunk on a core, where they share a condensed body
APART = 32  # lanes of a chunk whose bodies are interpolated together
FEW = 8  # lanes that a chunk may have even if there are less than `BLOCKS` chunks then
BLOCKS = 32  # least number of blocks of a large sweep, for equal shares of all processes
BLOCK = 1024  # lanes of the largest block, for which the program is compiled
KEPT = 4  # compiled models that are kept
PER_LANE = ("load.amplitude", "contact.pressure")
"""Numbers in which lanes of one body may differ on a contact line: its tableaux are the same."""
BODY = (
    8.0  # lanes that take as long as a condensed body; one of those interpolated together takes 1
)

OF_A_CYCLE = {*FIGURES, "dissipation_error"}  # figures that are numbers


class Block(NamedTuple):
    """Figures of some lanes.

    Attributes
    ----------
    values : figures, (figures, lanes); NaN where there is none
    status : codes of `Outcome`, (lanes,)
    """

    values: np.ndarray
    status: np.ndarray

    def fits(self, figures: int, lanes: int) -> bool:
        """True if the arrays are numbers of so many figures and lanes."""
        sizes = np.shape(self.values), np.shape(self.status)
        kinds = np.asarray(self.values).dtype.kind, np.asarray(self.status).dtype
        return sizes == ((figures, lanes), (lanes,)) and kinds == ("f", np.int8)


class Chunks(NamedTuple):
    """Chunks of lanes that advance together.

    Attributes
    ----------
    width : lanes of a chunk
    alike : True if those of a chunk share a body
    """

    width: int
    alike: bool


def chunks_of(scene: Scene, groups: np.ndarray, together: bool) -> Chunks:
    """Chunks of a sweep, by which all lanes cost least.

    Elsewhere than on a contact line a chunk is a whole block on a GPU.  On a core each lane runs
    alone: a wide chunk would wait for its slowest lane, and vector instructions run over the nodes.

    Parameters
    ----------
    groups : (groups,) numbers of lanes that may share a body
    together : True if bodies are interpolated, many at once
    """
    if not scene.plan.on_contact_line:
        return Chunks(1 if on_processor() else BLOCK, alike=False)
    most = min(ABREAST, max(FEW, int(np.sum(groups)) // BLOCKS))
    widths = 2 ** np.arange(most.bit_length())
    costs = [np.sum(-(-groups // width)) * (BODY + width) for width in widths]
    if together and 2.0 * np.sum(groups) < min(costs):
        return Chunks(APART, alike=False)
    return Chunks(int(widths[np.argmin(costs)]), alike=True)


def shared_keys(scene: Scene, keys: Sequence[str]) -> list[int]:
    """Places of the keys whose numbers lanes with one condensed body share."""
    if not scene.plan.on_contact_line:
        return []
    return [place for place, key in enumerate(keys) if key not in PER_LANE]


def places_in_chunks(shared: np.ndarray, width: int) -> np.ndarray:
    """Place of every lane in chunks laid end to end, (lanes,); a chunk shares some numbers.

    Parameters
    ----------
    shared : (keys, lanes) numbers that are the same in all lanes of a chunk
    width : lanes of a chunk
    """
    lanes = np.arange(shared.shape[1])
    begins = np.append(True, np.any(shared[:, 1:] != shared[:, :-1], axis=0))
    inside = lanes - np.maximum.accumulate(np.where(begins, lanes, 0))
    chunk = np.cumsum(inside % width == 0) - 1
    return chunk * width + inside % width


def check_figures(
    scene: Scene, keys: Sequence[str], figures: Sequence[str], solver: Newton | None
) -> None:
    """Raise `InputError` for figures that are no numbers, and for keys that the scene refuses."""
    require("figures", list(figures), len(figures) > 0, "name at least one")
    require("figures", list(figures), len(set(figures)) == len(figures), "names one twice")
    number = jax.ShapeDtypeStruct((), scene.strip.length.dtype)
    if OF_A_CYCLE.issuperset(figures) and scene.load.cycles > 0:  # numbers, without a trace
        jax.eval_shape(lambda at: scene.replace(at).strip, dict.fromkeys(keys, number))
        return
    try:
        ask = response(scene, keys, figures, solver=solver)
        shapes = jax.eval_shape(ask, *[number] * len(keys))
    except (jax.errors.ConcretizationTypeError, TypeError) as error:
        name = ", ".join(figures)
        raise InputError(f"figures = {name!r}: give numbers of a cycle ({error})") from None
    for name in figures:
        shape = getattr(shapes[name], "shape", None)
        number_like = shape is not None and len(shape) <= 1
        fix = "is no number, nor one of every step: give one such as 'dissipation'"
        require(
            "figures", name, number_like and jnp.issubdtype(shapes[name].dtype, jnp.floating), fix
        )


class Runner:
    """Compiled model, from the numbers of lanes to their figures.

    Attributes
    ----------
    scene, open : scene with the settings that serve all lanes, and with those that were given
    chunks : see `chunks_of`
    ranges : least and most height ratio and Poisson's ratio, by key, if strips may be interpolated
    """

    def __init__(
        self,
        scenes: tuple[Scene, Scene],
        keys: Sequence[str],
        figures: Sequence[str],
        chunks: Chunks,
        solver: Newton | None = None,
        *,
        ranges: Mapping[str, Range] | None = None,
    ) -> None:
        self.scene, self.open = scene, _ = scenes
        self.keys, self.figures = tuple(keys), tuple(figures)
        self.solver, self.dtype = solver, np.dtype(scene.strip.length.dtype)
        self.width = chunks.width
        template, self._numbers = Template.of(scene)
        strips = None if ranges is None else shared(scene, self.keys, self.figures, ranges)
        layout: Layout | None = None
        self._strips: Array | np.ndarray = np.zeros(0, self.dtype)
        if strips is not None:
            layout, self._strips = strips.layout, strips.numbers
        self._shared = shared_keys(scene, self.keys) if chunks.alike and chunks.width > 1 else []
        axes = tuple(None if place in self._shared else 0 for place in range(len(self.keys)))
        asked = self.keys, axes, self.figures, solver
        given = self._shape, self._strips.size
        self._about = template, layout, asked, given, self.dtype

    def compile(self) -> None:
        """Compile the model without running a lane, unless it was compiled before."""
        _compiled(*self._about)

    def __call__(self, columns: np.ndarray) -> Block:
        """Block of lanes, whose numbers are (keys, lanes)."""
        found = jax.device_get(self._answers(columns))
        places = places_in_chunks(columns[self._shared], self.width)
        values, status = (f.reshape(*f.shape[:-2], -1)[..., places] for f in found)
        block = Block(np.array(values), status.astype(np.int8))
        self._mend(columns, block)
        return block

    @property
    def _shape(self) -> tuple[int, int, int]:
        chunks = BLOCK if self._shared else BLOCK // self.width  # each lane may need its own
        return len(self.keys), chunks, self.width

    def _answers(self, columns: np.ndarray) -> tuple[Array, Array]:
        # Chunks without lanes are not computed; a part-filled chunk repeats its last lane.
        filled = np.ones(self._shape, self.dtype)
        places = places_in_chunks(columns[self._shared], self.width)
        count = places[-1] // self.width + 1
        last = np.searchsorted(places, np.arange(count * self.width), side="right") - 1
        filled[:, :count] = columns[:, last].reshape(len(self.keys), count, self.width)
        program = _compiled(*self._about)
        return program(self._numbers, self._strips, filled, np.int32(count))

    def _mend(self, columns: np.ndarray, block: Block) -> None:
        """Solve failed lanes alone, where long load steps are divided; mark what still fails.

        Lanes that need exact rotations have a plan of their own.
        """
        values, status = block
        unclear = (status != Outcome.CONVERGED) | ~np.all(self._known(values.T), axis=1)
        lanes = Lanes(self.open, dict(zip(self.keys, columns, strict=True)), paired=True)
        turns = np.broadcast_to(turning(self.open, lanes.value), lanes.shape)
        for lane in np.flatnonzero(unclear | turns):
            scene = self.open if turns[lane] else self.scene
            values[:, lane], status[lane] = self._alone(scene, columns[:, lane])

    def _known(self, values: np.ndarray) -> np.ndarray:
        """True for numbers (..., figures); an estimated error is infinite where nothing slips."""
        errors = np.array([name == "dissipation_error" for name in self.figures])
        return np.isfinite(values) | (errors & np.isposinf(values))

    def _alone(self, scene: Scene, numbers: np.ndarray) -> tuple[np.ndarray, int]:
        given = (jnp.asarray(number, self.dtype) for number in numbers)
        try:
            scene = scene.replace(dict(zip(self.keys, given, strict=True)))
            history = run(scene, throw=False, solver=self.solver)
        except InputError:
            return np.full(len(self.figures), np.nan), Outcome.OUTSIDE
        status = Outcome(int(np.max(np.asarray(history.status))))
        values = np.asarray(_figures(history, self.figures))
        if status != Outcome.CONVERGED:
            return np.full_like(values, np.nan), status
        values = np.where(self._known(values), values, np.nan)
        return values, Outcome.UNDEFINED if np.any(np.isnan(values)) else status


@functools.lru_cache(KEPT)
def _compiled(
    template: Template,
    layout: Layout | None,
    asked: tuple[tuple[str, ...], tuple[int | None, ...], tuple[str, ...], Newton | None],
    given: tuple[tuple[int, ...], int],
    dtype: np.dtype,
) -> Callable[..., tuple[Array, Array]]:
    """Compiled program that runs one block.

    It takes the scene's numbers, those of the strips that lanes share, those of the lanes (keys,
    chunks, width) and the count of filled chunks.  Only filled chunks run, one after the other, so
    that one shape serves sweeps of all sizes.
    """
    keys, axes, names, solver = asked
    shape, size = given

    def chunk(ask: Response, lanes: Array) -> tuple[Array, Array]:
        width = lanes.shape[-1]
        numbers = [row if axis == 0 else row[0] for row, axis in zip(lanes, axes, strict=True)]
        answer = jax.vmap(ask, axes)(*numbers) if width > 1 else ask(*lanes[:, 0])
        last = [answer[name].reshape(width, -1)[:, -1] for name in names]
        return jnp.stack(last), answer["status"].astype(jnp.int32)

    def block(fixed: list[Array], strips: Array, lanes: Array, count: Array) -> tuple[Array, Array]:
        _, chunks, width = lanes.shape
        scene = template.scene(fixed)

        def ask(*values: Array) -> dict[str, Array]:
            own = scene.replace(dict(zip(keys, values, strict=True)))
            strip = None if layout is None else layout.strip(strips, own)
            return figures(own, names, strip, solver)

        def step(i: Array, found: tuple[Array, Array]) -> tuple[Array, Array]:
            values, status = chunk(ask, lanes[:, i])
            return found[0].at[:, i].set(values), found[1].at[i].set(status)

        nothing = jnp.full((len(names), chunks, width), jnp.nan, lanes.dtype)
        return lax.fori_loop(0, count, step, (nothing, jnp.zeros((chunks, width), jnp.int32)))

    about = (
        [jax.ShapeDtypeStruct((), dtype)] * template.numbers,
        jax.ShapeDtypeStruct((size,), dtype),
        jax.ShapeDtypeStruct(shape, dtype),
        jax.ShapeDtypeStruct((), np.int32),
    )
    small = template.scene(about[0]).plan.on_contact_line
    options = quick_options() if small else None
    return jax.jit(block, compiler_options=options).lower(*about).compile()


@eqx.filter_jit
def _figures(history: History, figures: tuple[str, ...]) -> Array:
    """Figures of the last cycle; a figure of every step is that of the last step."""
    return jnp.stack([jnp.ravel(getattr(history, name))[-1] for name in figures])
