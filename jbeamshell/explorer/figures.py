"""Figures of a page: Bokeh figures whose data are replaced in place while a slider moves."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import (
    BoxAnnotation,
    ColumnDataSource,
    FixedTicker,
    LinearColorMapper,
    PrintfTickFormatter,
    Range1d,
    Span,
)
from bokeh.plotting import figure

from jbeamshell.explorer.views import Curve, Numbers, View
from jbeamshell.history.history import History
from jbeamshell.measured.loops import Loop
from jbeamshell.plotting.shapes import KINDS, pressure_arrows, reach_of, shape_of
from jbeamshell.plotting.style import SLIPS, STICKS
from jbeamshell.scene.keys import unit_of
from jbeamshell.scene.parts import Load

COLOURS = (STICKS, SLIPS, "#E4E4E4")  # of KINDS
INK, MODEL, MEASURED, KEPT = "#222222", "#0072B2", "#222222", "#A8A8A8"
FILL = ("#E8EEF4", "#F4EFE6")  # upper and lower member
LABELS = {  # of the load and of what it moves, by load.kind
    "force": ("F  [force/width]", "u(L)  [length]"),
    "moment": ("M  [force length/width]", "rotation  [rad]"),
}
PIXELS = 240  # of the contact map along X
LOOSE = 0.45  # part of a range below which the data are shown larger
MARGIN = 0.06
AMPLITUDES = [float(f"{first}e{power}") for power in range(-12, 13) for first in (1, 2, 5)]
HEIGHT = 300
ARROW = 0.03  # of the picture's width, from the pulled end to its arrow
GREY = 0.35  # opacity of a picture that is out of date
LESS = "{} less F/K"
NOTHING = np.zeros(0), np.zeros(0)


class Figures:
    """Four figures of a scene, and the data in them.

    A scene without a load cycle has profiles of its contact in place of loop and dissipation.

    Parameters
    ----------
    load : load of the scene, for what the figures hold and their labels
    whole : True where forces are totals, those of the scene's width
    """

    def __init__(self, load: Load, whole: bool = False) -> None:
        self.cyclic, self._turns = bool(load.cycles), load.kind == "moment"
        self._load, self._moved = LABELS[load.kind]
        self._work, self._amplitude = "force", unit_of("load.amplitude", load, whole)
        if whole:
            self._load, self._work = self._load.replace("/width", ""), "force length"
        self._sources: dict[str, ColumnDataSource] = {}
        self._factor = 0.0
        self._view: View | None = None
        self._less, self._loops = False, dict.fromkeys(("loop", "kept", "measured"), NOTHING)
        self.contact = self._contact_figure() if self.cyclic else self._profile_figure()
        self.deformed = self._deformed_figure()
        self.loop = self._loop_figure() if self.cyclic else self._gap_figure()
        self.curve = self._curve_figure() if self.cyclic else None

    @property
    def all(self) -> list[Any]:
        """Figures in the order of the page."""
        return [one for one in (self.loop, self.contact, self.curve, self.deformed) if one]

    def source(self, name: str) -> ColumnDataSource:
        """Data of a name; made empty on first use."""
        if name not in self._sources:
            self._sources[name] = ColumnDataSource(name=name)
        return self._sources[name]

    def put(self, name: str, **columns: Any) -> None:
        """Replace the data of a name."""
        self.source(name).data = columns

    # --- the figures ------------------------------------------------------------------------------

    def _new(self, title: str, x: str, y: str, **options: Any) -> Any:
        made = figure(
            title=title,
            x_axis_label=x,
            y_axis_label=y,
            height=HEIGHT,
            sizing_mode="stretch_width",
            tools="pan,box_zoom,wheel_zoom,reset,save",
            active_drag=None,
            active_scroll=None,
            min_border_right=16,
            **options,
        )
        made.toolbar.logo = None
        made.toolbar.autohide = True
        made.title.text_font_size = "11pt"
        made.title.text_color = INK
        made.axis.axis_label_text_font_style = "normal"
        made.axis.axis_label_text_color = made.axis.major_label_text_color = "#444444"
        made.grid.grid_line_color = "#EBEBEB"
        made.outline_line_color = None
        if "x_axis_type" not in options:
            made.axis.formatter = PrintfTickFormatter(format="%.3g")
        return made

    def _own_ranges(self) -> dict[str, Any]:
        return {"x_range": Range1d(0.0, 1.0), "y_range": Range1d(0.0, 1.0)}

    def _loop_figure(self) -> Any:
        made = self._new("Hysteresis loop", self._moved, self._load, **self._own_ranges())
        look = {"line_color": KEPT, "line_width": 2, "line_dash": "dashed"}
        made.line("u", "F", source=self._empty("kept", u=[], F=[]), **look)
        look = {"line_color": MEASURED, "line_alpha": 0.7}
        made.line("u", "F", source=self._empty("measured", u=[], F=[]), **look)
        made.line("u", "F", source=self._empty("loop", u=[], F=[]), line_color=MODEL, line_width=2)
        here = self._empty("here", u=[], F=[])
        made.scatter("u", "F", source=here, size=10, color=MODEL, line_color="white")
        return made

    def _contact_figure(self) -> Any:
        words = "Contact over the cycle", "X  [length]", f"{self._load}, time upwards"
        made = self._new(*words, **self._own_ranges())
        mapper = LinearColorMapper(palette=list(COLOURS), low=-0.5, high=2.5)
        source = self._empty("states", image=[], x=[], y=[], dw=[], dh=[])
        made.image("image", "x", "y", "dw", "dh", source=source, color_mapper=mapper)
        self._now = Span(dimension="width", line_color=INK, line_width=2, location=0.0)
        made.add_layout(self._now)
        made.grid.visible = False
        self._legend(made)
        return made

    def _profile_figure(self) -> Any:
        words = "Normal reaction", "X  [length]", "R  [stress]"
        made = self._new(*words, **self._own_ranges())
        pressure = self._empty("pressure", X=[], p=[])
        look = {"line_color": KEPT, "line_width": 2, "legend_label": "pressure on top"}
        made.line("X", "p", source=pressure, **look)
        look = {"line_color": MODEL, "line_width": 2, "legend_label": "reaction"}
        made.line("X", "R", source=self._empty("reaction", X=[], R=[]), **look)
        return made

    def _gap_figure(self) -> Any:
        words = "Gap under the strip", "X  [length]", "gap  [length]"
        made = self._new(*words, **self._own_ranges())
        source = self._empty("gap", X=[], gap=[])
        made.line("X", "gap", source=source, line_color=MODEL, line_width=2)
        return made

    def _curve_figure(self) -> Any:
        words = (
            "Dissipation over amplitude",
            f"amplitude A of the load  [{self._amplitude}]",
            f"D, work per cycle  [{self._work}]",
        )
        made = self._new(*words, x_axis_type="log", y_axis_type="log")
        made.xaxis.ticker = FixedTicker(ticks=AMPLITUDES)
        made.xaxis.formatter = PrintfTickFormatter(format="%g")
        look = {"line_color": KEPT, "line_width": 2, "line_dash": "dashed"}
        made.line("A", "D", source=self._empty("kept curve", A=[], D=[]), **look)
        curve = self._empty("curve", A=[], D=[])
        self._line = made.line("A", "D", source=curve, line_color=MODEL, line_width=2)
        works = self._empty("measured works", A=[], D=[])
        made.scatter("A", "D", source=works, size=6, color=MEASURED)
        point = self._empty("point", A=[], D=[])
        made.scatter("A", "D", source=point, size=10, color=MODEL, line_color="white")
        return made

    def _deformed_figure(self) -> Any:
        words = "Deformed", "X  [length]", "height  [length]"
        made = self._new(*words, **self._own_ranges())
        made.grid.visible = False
        bodies = self._empty("bodies", xs=[], ys=[], fill=[])
        made.patches("xs", "ys", fill_color="fill", line_color=INK, source=bodies)
        arrows = self._empty("arrows", x=[], y=[], tail=[], way=[])
        made.segment("x", "y", "x", "tail", source=arrows, line_color="#999999")
        made.scatter(
            "x", "y", source=arrows, marker="triangle", size=6, angle="way", color="#999999"
        )
        line = self._empty("line", xs=[], ys=[], colour=[])
        made.multi_line("xs", "ys", source=line, line_color="colour", line_width=5)
        pull = self._empty("pull", x=[], y=[], angle=[])
        look = {"marker": "triangle", "size": 16, "color": INK}
        made.scatter("x", "y", angle="angle", source=pull, **look)
        made.add_layout(BoxAnnotation(top=0.0, fill_color="#F5F5F5", visible=False))
        self._base = made.center[-1]
        if not self.cyclic:
            self._legend(made)
        return made

    def _legend(self, made: Any) -> None:
        """Colours of what the contact does, beside the figure."""
        for name, colour in zip(KINDS, COLOURS, strict=True):
            nothing = {"x": [0.0], "y": [0.0], "color": colour, "legend_label": name}
            made.scatter(**nothing, marker="square", size=0)
        made.legend.orientation = "horizontal"
        made.legend.border_line_color = None
        made.legend.padding = made.legend.margin = 0
        made.add_layout(made.legend[0], "above")

    def _empty(self, name: str, **columns: Any) -> ColumnDataSource:
        self.put(name, **columns)
        return self.source(name)

    # --- what is in them --------------------------------------------------------------------------

    def show(self, view: View, moment: int) -> None:
        """Draw a view at one of its moments."""
        self._view = view
        history, scene = view.history, view.history.scene
        x = np.asarray(history.x)
        if self.cyclic:
            self._loops["loop"] = view.displacement, view.force
            self.loop.title.text = f"Hysteresis loop: D = {view.figures['dissipation']:.4g}"
            self._draw_loops()
            self._show_states(view, x)
            amplitude = float(scene.get("load.amplitude"))
            work = view.figures["dissipation"]
            some = [amplitude] if work > 0.0 else []
            self.put("point", A=some, D=[work] * len(some))
        else:
            last = int(view.steps[-1])
            reaction, gap = np.asarray(history.reaction[last]), np.asarray(history.gap[last])
            top = _pressure_along(history)
            self.put("pressure", X=top[0], p=top[1])
            self.put("reaction", X=x, R=reaction)
            self.put("gap", X=x, gap=gap)
            size = float(scene.contact.largest_pressure)
            _fit(self.contact.y_range, np.append(np.clip(reaction, -size, 4.0 * size), top[1]))
            _fit(self.loop.y_range, np.append(gap, [0.0, 1e-6 * float(scene.strip.half_height)]))
            for one in (self.contact, self.loop):
                _fit(one.x_range, x)
        low, high = reach_of(history, 0.04, 0.12)
        self.deformed.x_range.update(start=low, end=high)
        if self.cyclic:
            self.contact.x_range.update(start=low, end=high)
        self._scale(view)
        self.at(moment)

    def at(self, moment: int) -> None:
        """Draw the members, and mark the load, at a moment of the view."""
        view = self._view
        if view is None:
            return
        moment = min(moment, view.steps.size - 1)
        history, step = view.history, int(view.steps[moment])
        shape = shape_of(history, step, self._factor)
        outlines = [outline.T for outline in shape.outlines]
        xs, ys = ([outline[i] for outline in outlines] for i in (0, 1))
        self.put("bodies", xs=xs, ys=ys, fill=list(FILL[: len(xs)]))
        x, head, tail = pressure_arrows(history, shape).T
        self.put("arrows", x=x, y=head, tail=tail, way=np.where(tail > head, np.pi, 0.0))
        founded = history.scene.contact.normal != "none"
        xs, ys, kinds = _runs(shape.inner[0], shape.kinds) if founded else ([], [], [])
        self.put("line", xs=xs, ys=ys, colour=[COLOURS[kind] for kind in kinds])
        force = float(view.force[moment])
        beside = ARROW * (self.deformed.x_range.end - self.deformed.x_range.start)
        pulled = [shape.tip[0] + beside] if force and not self._turns else []
        angle = [-np.sign(force) * np.pi / 2.0] * len(pulled)
        middle = [float(shape.tip[1]) - 0.5 * shape.heights[0]] * len(pulled)
        self.put("pull", x=pulled, y=middle, angle=angle)
        times = f"Displacements x {self._factor:g}"
        load = f"{times} at {self._load[0]} = {force:.4g}"
        self.deformed.title.text = load if self.cyclic else times
        if self.cyclic:
            here = view.displacement[[moment]] - self._flexibility * view.force[[moment]]
            self.put("here", u=here, F=view.force[[moment]])
            self._now.location = moment

    def show_curve(self, curve: Curve | None) -> None:
        """Draw the dissipation over the amplitude; None greys what is out of date."""
        if curve is None:
            self._line.glyph.line_alpha = GREY
            return
        good = curve.dissipation > 0.0
        self.put("curve", A=curve.amplitude[good], D=curve.dissipation[good])
        self._line.glyph.line_alpha = 1.0

    def show_loops(self, loops: list[Loop]) -> None:
        """Draw measured loops, and the work of the closed ones."""
        gap = np.array([np.nan])
        u = [part for loop in loops for part in (loop.displacement, gap)]
        force = [part for loop in loops for part in (loop.force, gap)]
        self._loops["measured"] = np.concatenate([gap, *u]), np.concatenate([gap, *force])
        driver = "force" if self._view is None else self._view.history.scene.load.control
        closed = [loop for loop in loops if loop.closed and loop.work > 0.0]
        sizes = [0.5 * float(np.ptp(getattr(loop, driver, loop.force))) for loop in closed]
        self.put("measured works", A=sizes, D=[loop.work for loop in closed])
        self._draw_loops()

    def keep(self, kept: bool) -> None:
        """Keep the loop and the curve of now as grey lines to compare with, or drop them."""
        self._loops["kept"] = self._loops["loop"] if kept else NOTHING
        self.put(
            "kept curve", **{k: v if kept else [] for k, v in self.source("curve").data.items()}
        )
        self._draw_loops()

    def less_stiffness(self, wanted: bool, moment: int) -> None:
        """Draw loops less F/K of the model's secant stiffness K, or as they are.

        The loop of a joint that hardly slips is as thin as a line otherwise.
        """
        self._less = wanted
        self.loop.xaxis.axis_label = LESS.format(self._moved) if wanted else self._moved
        self._draw_loops()
        self.at(moment)

    @property
    def _flexibility(self) -> float:
        """Displacement for each unit of load that is taken from the loops."""
        if self._view is None or not self._less:
            return 0.0
        return 1.0 / self._view.figures["secant_stiffness"]

    def grey(self, stale: bool) -> None:
        """Grey the figures whose numbers are out of date, or not."""
        for one in self.all:
            one.background_fill_color = "#EEEEEE" if stale else "white"
            one.border_fill_alpha = 1.0

    def _scale(self, view: View) -> None:
        """Factor of the displacements, which changes only if they are hardly or too well seen."""
        found = shape_of(view.history, int(view.steps[-1])).factor
        if not self._factor or not 0.4 <= self._factor / found <= 2.5:
            self._factor = found
        high = 2.0 * float(view.history.scene.strip.half_height)
        member = view.history.member is not None
        below = view.history.scene.member.beside(view.history.scene.strip) if member else None
        low = 0.0 if below is None else -2.0 * float(below.half_height)
        pressed = -0.8 * high if below is not None and low else 0.0
        _fit(self.deformed.y_range, np.array([low + pressed - 0.2 * high, 1.8 * high]))

    def _show_states(self, view: View, x: Numbers) -> None:
        """Contact over X and the steps of the cycle, on even pixels."""
        even = (np.arange(PIXELS) + 0.5) / PIXELS * float(x[-1])
        nearest = np.searchsorted(0.5 * (x[1:] + x[:-1]), even)
        count = view.steps.size
        place = {"x": [0.0], "y": [-0.5], "dw": [float(x[-1])], "dh": [float(count)]}
        self.put("states", image=[view.states[:, nearest]], **place)
        self.contact.y_range.update(start=-0.5, end=count - 0.5)
        ticks = [0, count // 4, count // 2, 3 * count // 4, count - 1]
        self.contact.yaxis.ticker = ticks
        labels = {tick: f"{view.force[tick] + 0.0:.4g}" for tick in ticks}
        self.contact.yaxis.major_label_overrides = labels

    def _draw_loops(self) -> None:
        """Draw the loops of the model, the one that is kept, and those that were measured."""
        if not self.cyclic:
            return
        for name, (moved, force) in self._loops.items():
            self.put(name, u=moved - self._flexibility * force, F=force)
        for axis, column in ((self.loop.x_range, "u"), (self.loop.y_range, "F")):
            names = ("loop", "kept", "measured")
            _fit(axis, np.concatenate([np.asarray(self.source(n).data[column]) for n in names]))


def _fit(axis: Range1d, values: Numbers) -> None:
    """Move a range only if values leave it, or fill little of it: the eye sees what moves."""
    values = values[np.isfinite(values)]
    if not values.size:
        return
    low, high = float(np.min(values)), float(np.max(values))
    size = high - low
    inside = axis.start <= low and high <= axis.end
    if inside and size >= LOOSE * (axis.end - axis.start):
        return
    margin = MARGIN * size or MARGIN * abs(high) or 1.0
    axis.update(start=low - 2.0 * margin, end=high + 2.0 * margin)


def _runs(points: Numbers, kinds: Any) -> tuple[list[Numbers], list[Numbers], list[int]]:
    """Parts of a line (n, 2) whose points are of one kind: their x, y and kinds."""
    ends = np.flatnonzero(np.diff(kinds)) + 1
    middle = 0.5 * (points[ends - 1] + points[ends])
    parts = np.split(points, ends)
    begins, stops = [points[:1], *middle[:, None]], [*middle[:, None], points[-1:]]
    lines = [np.concatenate(part) for part in zip(begins, parts, stops, strict=True)]
    firsts = np.append(0, ends)
    return [line[:, 0] for line in lines], [line[:, 1] for line in lines], kinds[firsts].tolist()


def _pressure_along(history: History) -> tuple[Numbers, Numbers]:
    """X and pressure on the top face."""
    table, length = np.asarray(history.scene.contact.pressure), float(history.x[-1])
    if table.ndim == 0:
        return np.array([0.0, length]), np.full(2, float(table))
    x = np.concatenate([[0.0], table[:, 0], [length]])
    return x, np.pad(table[:, 1], 1, mode="edge")
