"""Page of the explorer: sliders, figures, data and the scene's text, as a Panel object."""

from __future__ import annotations

import html
import io
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import panel as pn

from jbeamshell.common.errors import InputError, UnconvergedError
from jbeamshell.common.summary import in_words
from jbeamshell.explorer.controls import controls_of, scene_at
from jbeamshell.explorer.figures import Figures
from jbeamshell.explorer.views import FIGURES, View, curve_of, drawable, view_of
from jbeamshell.history.figures import units_of
from jbeamshell.measured.loop_files import read_loops
from jbeamshell.measured.loops import Loop
from jbeamshell.scene import library, mounting
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.toml import scene_to_toml

SOON, LATER = 2, 150  # milliseconds before a redraw, and before a slow curve
QUICK = 0.03  # seconds, up to which a curve is drawn with the rest
OWN = "own scene"
CARDS = """
.figures {display: flex; flex-wrap: wrap; gap: 4px 22px; margin: 0; font-size: 13px}
.figures div {white-space: nowrap} .figures b {font-size: 15px}
.figures span {color: #666}
.mounting {margin: 4px 0 0; font-size: 13px; color: #666}
"""
PAGE = """
:host {display: grid !important; grid-template-columns: minmax(240px, 320px) minmax(0, 1fr);
gap: 8px 24px; padding: 8px 16px; box-sizing: border-box}
.scroll-button {display: none}
@media (max-width: 760px) {:host {grid-template-columns: minmax(0, 1fr)}}
"""
PLOTS = """
.scroll-button {display: none}
:host {display: grid !important; gap: 12px 16px;
grid-template-columns: repeat(auto-fit, minmax(min(420px, 100%), 1fr))}
"""
LINE = "font-size: 13px; padding: 6px 10px; border-radius: 4px; margin: 0; min-height: 18px;"
TONES = {"": "color: #666", "busy": "background: #EEF4FA", "error": "background: #FDECE4"}


class _Handle(pn.widgets.FloatSlider):
    """Slider that tells its moves at once; Panel's own waits 50 ms, but `Page` gathers them."""

    _debounce = SOON


class _Slider(pn.widgets.EditableFloatSlider):
    """Slider beside a field for its number."""

    _slider_widget = _Handle


class Page:
    """Sliders and figures of one scene.

    Attributes
    ----------
    scene : scene of the sliders as they are, with the settings that it left open
    view : what is drawn; None before anything is
    message : one line about what went wrong; empty if nothing did
    layout : Panel object that shows all of this

    Parameters
    ----------
    scene : scene to start from; None is the library's standard strip
    loops : measured loops to draw over the model's
    name : name of the scene in the list of scenes
    """

    def __init__(
        self, scene: Scene | None = None, loops: Sequence[Loop] = (), name: str = OWN
    ) -> None:
        self._loops = list(loops)
        self._own = library.standard() if scene is None else scene
        self.view: View | None = None
        self._waiting: dict[str, Any] = {}
        self._curve_seconds = 0.0
        self._curve_of: dict[str, float] | None = None
        self._head = pn.pane.HTML(sizing_mode="stretch_width", margin=0)
        self._cards = pn.pane.HTML(stylesheets=[CARDS], sizing_mode="stretch_width")
        self._text = pn.pane.HTML(sizing_mode="stretch_width")
        self._sliders = pn.Column(sizing_mode="stretch_width", margin=0)
        self._plots = pn.Column(stylesheets=[PLOTS], sizing_mode="stretch_width")
        self._make_widgets(name if scene is not None else library.NAMES[0])
        self.layout = self._arranged()
        self._begin(self._own)

    # --- widgets ----------------------------------------------------------------------------------

    def _make_widgets(self, name: str) -> None:
        wide: dict[str, Any] = {"sizing_mode": "stretch_width"}
        names = list(library.NAMES) if name in library.NAMES else [OWN, *library.NAMES]
        self._scenes = pn.widgets.Select(label="Scene", options=names, value=name, **wide)
        self._scenes.param.watch(self._choose, "value")
        self._reset = pn.widgets.Button(label="Reset", **wide)
        self._reset.on_click(lambda _: self.reset())
        self._keep = pn.widgets.Toggle(label="Keep this curve", **wide)
        self._keep.param.watch(lambda event: self._figures.keep(event.new), "value")
        self._moment = pn.widgets.Player(
            label="Moment of the cycle",
            start=0,
            end=1,
            interval=80,
            loop_policy="loop",
            show_loop_controls=False,
            visible_buttons=["previous", "pause", "play", "next"],
            scale_buttons=0.8,
            show_value=False,
            **wide,
        )
        self._moment.param.watch(lambda event: self._figures.at(event.new), "value")
        self._less = pn.widgets.Toggle(label="Loop less its stiffness", **wide)
        self._less.param.watch(
            lambda event: self._figures.less_stiffness(event.new, self._moment.value), "value"
        )
        self._file = pn.widgets.FileInput(accept=".csv,.txt,.tsv,.npz,.mat", **wide)
        self._file.param.watch(lambda _: self._read_file(), "value")
        words = pn.pane.HTML("<b>Your own loops</b> (CSV with columns force and displacement)")
        self._data = pn.Column(words, self._file, margin=0, **wide)
        self._take = pn.widgets.FileDownload(
            callback=lambda: io.StringIO(self.text),
            filename="scene.toml",
            label="Download scene.toml",
            **wide,
        )

    def _arranged(self) -> Any:
        side = pn.Column(
            self._scenes,
            self._sliders,
            pn.Row(self._reset, self._keep, sizing_mode="stretch_width"),
            self._less,
            self._moment,
            self._data,
            self._take,
            sizing_mode="stretch_width",
            margin=0,
        )
        text = pn.Card(self._text, title="The scene as TOML", collapsed=True, margin=(8, 0))
        text.sizing_mode = "stretch_width"
        main = pn.Column(self._head, self._cards, self._plots, text, margin=0)
        main.sizing_mode = "stretch_width"
        return pn.Column(side, main, sizing_mode="stretch_width", stylesheets=[PAGE], margin=0)

    # --- scenes -----------------------------------------------------------------------------------

    def _begin(self, scene: Scene) -> None:
        """Make sliders and figures of a scene, and draw it."""
        self._open, self._start = scene, drawable(scene)
        self._controls = controls_of(self._start)
        self._values = {control.name: control.value for control in self._controls}
        self.scene, self.view, self.message = scene, None, ""
        self._figures = Figures(scene.load, scene.strip.width is not None)
        for each in (self._moment, self._keep, self._less, self._data):
            each.visible = bool(scene.load.cycles)
        self._keep.value = self._less.value = False
        self.sliders = {
            control.name: _Slider(
                label=control.label,
                value=control.value,
                start=control.low,
                end=control.high,
                step=control.step,
                format="0[.]0[00000]",
                sizing_mode="stretch_width",
            )
            for control in self._controls
        }
        for name, slider in self.sliders.items():
            slider.param.watch(lambda event, name=name: self._move(name, event.new), "value")
        self._sliders[:] = list(self.sliders.values())
        self._plots[:] = [pn.pane.Bokeh(one, margin=0) for one in self._figures.all]
        self._curve_of = None
        self.redraw(at_end=True)
        self._figures.show_loops(self._loops)

    def _choose(self, event: Any) -> None:
        """Show another scene, after the page has said so."""
        self._tell(f"preparing {event.new} ...", "busy")

        def begin() -> None:
            self._begin(self._own if event.new == OWN else library.named(event.new))

        self._soon("scene", begin, 50)

    def reset(self) -> None:
        """Put all sliders back."""
        for control in self._controls:
            self.sliders[control.name].value = control.value

    def _move(self, name: str, value: float) -> None:
        self._values[name] = value
        self._soon("figures", self.redraw)

    # --- drawing ----------------------------------------------------------------------------------

    def redraw(self, at_end: bool = False) -> None:
        """Compute and draw the scene of the sliders; what goes wrong is said in one line."""
        moved = {c.name: self._values[c.name] for c in self._controls}
        moved = {c.name: moved[c.name] for c in self._controls if moved[c.name] != c.value}
        try:
            scene = scene_at(self._start, moved)
            view = view_of(scene)
            self.scene = scene_at(self._open, moved)
        except (InputError, UnconvergedError) as error:
            self._fail(error)
            return
        begin = time.perf_counter()
        failed, self.view, self.message = bool(self.message), view, ""
        last = view.steps.size - 1
        if self._moment.end != last:
            self._moment.end, at_end = last, True
        if at_end:
            self._moment.value = last
        self._figures.show(view, self._moment.value)
        self._figures.grey(False)
        self._follow(scene, moved)
        drawing = time.perf_counter() - begin

        def write() -> None:
            if not self.message:  # of a move since then
                self._show_numbers(view)
                self._say(view, drawing)

        if failed:
            write()
        else:  # words take the browser longer than the figures
            self._when_at_rest("words", write)

    def _follow(self, scene: Scene, moved: dict[str, float]) -> None:
        """Draw the curve of dissipation now if it is quick, else when the sliders rest."""
        moved = {name: value for name, value in moved.items() if name != "load.amplitude"}
        by_force = scene.load.control == "force"
        if not scene.load.cycles or (by_force and moved == self._curve_of):
            return

        def draw() -> None:
            begin = time.perf_counter()
            try:
                self._figures.show_curve(curve_of(scene))
            except (InputError, UnconvergedError):  # a gross slip of its own: the loop says so
                return
            self._curve_of, self._curve_seconds = moved, time.perf_counter() - begin

        if self._curve_seconds < QUICK:
            draw()
        else:
            self._figures.show_curve(None)
            self._when_at_rest("curve", draw)

    def _soon(self, name: str, action: Callable[[], None], wait: int = SOON) -> None:
        """Do something soon, and once: while it waits, calls of the same name change nothing."""
        document = _served_document()
        if document is None:
            action()
            return
        if name in self._waiting:
            return

        def run() -> None:
            del self._waiting[name]
            action()

        self._waiting[name] = document.add_timeout_callback(run, wait)

    def _when_at_rest(self, name: str, action: Callable[[], None]) -> None:
        """Do something after the last call of a name."""
        document = _served_document()
        if document is not None and name in self._waiting:
            document.remove_timeout_callback(self._waiting.pop(name))
        self._soon(name, action, LATER)

    # --- words ------------------------------------------------------------------------------------

    @property
    def text(self) -> str:
        """Scene of the sliders as TOML; the reason if it cannot be written."""
        try:
            return scene_to_toml(self.scene)
        except InputError as error:
            return f"# {_one_line(error)}\n"

    def _show_numbers(self, view: View) -> None:
        parts = []
        units = units_of(self.scene)
        for key, name in FIGURES.items():
            unit = units.get(key, "1")
            if key in view.figures:
                value = html.escape(in_words(view.figures[key]))
                parts.append(f"<div>{name} <b>{value}</b> <span>[{unit}]</span></div>")
        mounted = html.escape(mounting.in_words(self.scene))
        below = f'<p class="mounting">{mounted}</p>' if mounted else ""
        self._cards.object = f'<div class="figures">{"".join(parts)}</div>{below}'
        style = "font-size: 12px; margin: 0; white-space: pre-wrap; overflow-wrap: anywhere"
        self._text.object = f'<pre style="{style}">{html.escape(self.text)}</pre>'

    def _say(self, view: View, drawing: float) -> None:
        """Say what was computed, or why to doubt it."""
        plan, own = view.history.scene.plan, self.scene.plan.nodes
        if view.doubts:
            fewer = f" ({plan.nodes} nodes here, {own} in the scene)" if plan.nodes != own else ""
            self._tell(view.doubts[0] + fewer, "error")
            return
        self._tell(
            f"section {plan.section}, {plan.nodes} nodes: computed in {1e3 * view.seconds:.0f} ms, "
            f"drawn in {1e3 * drawing:.0f} ms"
        )

    def _fail(self, error: Exception) -> None:
        """Say what is wrong, and grey the pictures, which show the numbers of before."""
        self.message = _one_line(error)
        self._tell(self.message, "error")
        self._figures.grey(True)

    def _tell(self, words: str, tone: str = "") -> None:
        role = "alert" if tone == "error" else "status"
        look = f"{LINE} {TONES[tone]}"
        self._head.object = f'<p role="{role}" style="{look}">{html.escape(words)}</p>'

    # --- data -------------------------------------------------------------------------------------

    def _read_file(self) -> None:
        """Draw the loops of the file that was chosen."""
        if not self._file.value:
            return
        name = Path(self._file.filename).name
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / name
            path.write_bytes(self._file.value)
            try:
                self._loops = read_loops(path)
            except InputError as error:
                self._tell(_one_line(error).replace(f"{folder}/", ""), "error")
                return
        self._figures.show_loops(self._loops)
        points = sum(loop.force.size for loop in self._loops)
        self._tell(f"{name}: {len(self._loops)} loops of {points} points")


def _served_document() -> Any:
    """Document of the server's session; None in a notebook or a script, which draw at once."""
    document = pn.state.curdoc
    return None if document is None or document.session_context is None else document


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
