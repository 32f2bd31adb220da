"""Pictures of a contact face: where it sticks, slips and opens, its pressure, slip and gap."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from jbeamshell.plotting.style import FAINT, PALETTE, panels, style

STATES = ("open", "sticks", "slips")
WIDE = 0.75  # of the figure's width, that two panels take
SLIVER = 1e-3  # of the largest triangle, below which one on the rim is left out


def face_map(history: Any, step: int = -1) -> Figure:
    """Draw the state, pressure, slip and gap of a contact face at a step.

    Parameters
    ----------
    history : `jbeamshell.ContactHistory` on a face
    step : index into the path

    Returns
    -------
    matplotlib.figure.Figure
    """
    (x, y), names = _flat(np.asarray(history.places), np.asarray(history.normals))
    touching, known = np.asarray(history.touching)[step], history.tributary is not None
    pressed = history.reaction if known else history.normal_force
    state = np.where(touching, 1 + np.asarray(history.slipping)[step].astype(int), 0)
    fields = {
        "normal reaction" if known else "normal force": np.asarray(pressed)[step],
        "slip since the pressing": np.linalg.norm(np.asarray(history.slip)[step], axis=1),
        "gap": np.maximum(np.asarray(history.gap)[step], 0.0),
    }
    with style():
        grid = panels(2, 2).ravel()
        width = grid[0].figure.get_figwidth()
        tall = float(np.ptp(y) / max(np.ptp(x), np.finfo(float).tiny))
        grid[0].figure.set_figheight(width * np.clip(WIDE * tall + 0.25, 0.3, 1.2))
        colours = ListedColormap([FAINT, PALETTE[0], PALETTE[1]])
        grid[0].scatter(x, y, c=state, cmap=colours, vmin=0, vmax=2, s=36, edgecolor="0.4", lw=0.4)
        for k, name in enumerate(STATES):
            grid[0].plot([], [], "o", color=colours(k), markeredgecolor="0.4", label=name)
        keys, words = grid[0].get_legend_handles_labels()
        grid[0].figure.legend(keys, words, loc="upper left", bbox_to_anchor=(0.1, 1.0), ncols=3)
        grid[0].set_title(f"load {float(history.force[step]):.4g}")
        for panel, (name, values) in zip(grid[1:], fields.items(), strict=True):
            _field(panel, x, y, values)
            panel.set_title(name)
        for panel in grid:
            panel.set(xlabel=names[0], ylabel=names[1])
            panel.set_aspect("equal")
            panel.grid(False)
            panel.label_outer()
    return grid[0].figure


def _field(panel: Axes, x: np.ndarray, y: np.ndarray, values: np.ndarray) -> None:
    """Smooth colours of nodal values, with their scale."""
    mesh = Triangulation(x, y)
    corners = np.stack([x, y], axis=1)[mesh.triangles]
    (a, b), (c, d) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    size = np.abs(a * d - b * c)
    mesh.set_mask(size < SLIVER * np.max(size))
    shown = panel.tripcolor(mesh, values, shading="gouraud", cmap="viridis")
    panel.figure.colorbar(shown, ax=panel, shrink=0.5)


def _flat(places: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Coordinates (2, n) of nodes in the plane that lies nearest to the face, and their names."""
    away = int(np.argmax(np.abs(np.sum(normals, axis=0))))
    along = [axis for axis in range(3) if axis != away]
    return places[:, along].T, [f"${'XYZ'[axis]}$" for axis in along]
