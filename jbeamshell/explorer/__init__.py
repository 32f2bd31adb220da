"""Explorer: a page of sliders and pictures of one scene, in a browser or a notebook."""

from __future__ import annotations

import importlib
import os
from collections.abc import Sequence
from typing import Any

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.measured.loop_files import read_loops
from jbeamshell.scene.scene import Scene


def explore(
    scene: Scene | None = None,
    data: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
) -> Any:
    """Page of sliders and pictures of a scene, to be shown in a notebook.

    Sliders move the height ratio, friction, load, pressure, Poisson's ratio and bolts; the loop,
    the contact, the dissipation and the deformed strip follow.  `jbeamshell explore` serves the
    same page to a browser.

    Parameters
    ----------
    scene : scene to start from; None is the standard strip
    data : file or files of measured loops, drawn over the model's; see
        `jbeamshell.measured.read_loops`

    Returns
    -------
    panel.viewable.Viewable
        the page, a Panel object; the last line of a cell shows it

    Raises
    ------
    InputError
        if Panel is not installed, or a file cannot be read

    Examples
    --------
    ::

        jb.explore(jb.library.single_lap())
    """
    known = scene is None or isinstance(scene, Scene)
    require("scene", scene, known, "give a jbeamshell.Scene")
    check_installed()
    import panel as pn

    from jbeamshell.explorer.page import Page

    pn.extension(inline=True)
    return Page(scene, read_loops(data) if data else ()).layout


def check_installed() -> None:
    """Raise `InputError` if Panel is not installed."""
    try:
        importlib.import_module("panel")
    except ImportError:
        fix = "pip install 'jbeamshell[explore]'"
        raise InputError(f"explore: needs panel, which is not installed: {fix}") from None
