"""`jbeamshell ringdown`: a mass on a strip let go, its frequency and damping over amplitude."""

from __future__ import annotations

import argparse
import contextlib
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jbeamshell.cli.arguments import (
    add_folder,
    add_json,
    add_scene,
    add_settings,
    assignments,
    scene_of,
)
from jbeamshell.cli.terminal import doubts_in_lines, put, say, say_written, warn
from jbeamshell.common.errors import InputError

if TYPE_CHECKING:
    from jbeamshell.scene.scene import Scene

SMALL = 0.05  # part of gross slip below which the default amplitude is no pull of a ring-down
LOW, HIGH = "_low", "_high"  # endings of the names of an interval's ends
ROWS = 12  # rows of the printed table, about


def add_to(commands: Any) -> None:
    """Add the command and its options to the parser."""
    parser = commands.add_parser(
        "ringdown",
        help="let a mass on a strip ring down",
        description="Pull a mass on a strip, let it go, and report its frequency and damping over "
        "the amplitude, beside the quasi-static prediction by Masing's rule.",
    )
    add_scene(parser)
    parser.add_argument(
        "--force",
        type=float,
        metavar="F",
        help="pull before it is let go, force per width (default: load.amplitude, or half of gross "
        "slip where that is no force below it)",
    )
    parser.add_argument(
        "--payload",
        type=float,
        metavar="MASS",
        help="mass on the strip's end, per width (default: 50 times the strip's own)",
    )
    parser.add_argument(
        "--density",
        type=float,
        default=1.0,
        metavar="RHO",
        help="mass of the strip per volume (default 1)",
    )
    parser.add_argument(
        "--cycles",
        type=float,
        default=20.0,
        metavar="N",
        help="duration, in periods of the stuck strip (default 20)",
    )
    parser.add_argument(
        "--strip",
        choices=("auto", "whole", "sliders"),
        default="auto",
        help="follow the whole strip in time steps, or the sliders of its contact without inertia "
        "(plane elasticity's, unless model.section is given); auto takes the sliders where inertia "
        "matters little (default)",
    )
    add_settings(parser)
    add_folder(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Simulate, report and write; returns the exit code."""
    from jbeamshell.common import files
    from jbeamshell.dynamics.release import let_go
    from jbeamshell.dynamics.strip.inertia import Inertia

    scene, folder = scene_of(options), None
    if options.out is not None:
        from jbeamshell.plotting.folder import check_folder

        folder = check_folder(options.out)
    chosen = options.scene is not None or "load.amplitude" in assignments(options.set)
    say("compiling ...")
    with doubts_in_lines():
        study = let_go(
            scene,
            _pull(scene, chosen) if options.force is None else options.force,
            payload=options.payload,
            inertia=Inertia(options.density),
            cycles=options.cycles,
            whole={"auto": None, "whole": True, "sliders": False}[options.strip],
        )
    if study.light:
        follows = scene.member.support == "none" and scene.model.section != "plane"
        other = " (--strip whole follows it)" if follows else ""
        say(
            "the strip is a network of sliders: its own mass, which adds "
            f"{study.share:.2g} of the payload, is left out{other}"
        )
    figures = study.figures()
    put(files.as_json(figures) if options.json else f"{_table(figures)}\n")
    if folder is not None:
        say_written(_write(folder, study, figures))
    return 0


def _pull(scene: Scene, chosen: bool) -> float:
    """Pull of a scene: its amplitude, or half of gross slip.

    The latter is taken where the amplitude is no force below gross slip, or where nobody chose it
    and it is a small part of gross slip.
    """
    from jbeamshell.dynamics.structure.joint import largest_force

    limit = float(scene.gross_slip)
    with contextlib.suppress(InputError):
        force = float(largest_force(scene))
        if chosen or not SMALL * limit > force:
            return force
    if not 0.0 < limit < math.inf:
        return float(largest_force(scene))
    warn(
        f"load.amplitude is no force between {SMALL:g} and 1 of gross slip, {limit:.4g}: the mass "
        "is pulled with half of it; --force takes another"
    )
    return 0.5 * limit


def _table(figures: dict[str, Any]) -> str:
    """Figures as text to read: single ones by name, then some rows of the lists."""
    lists = _lists(figures)
    lines = [f"{name:24s} {value}" for name, value in figures.items() if name not in lists]
    if any(name.endswith(LOW) for name in lists):
        lines.append(f"{'+-':24s} half of the 95 % interval")
    shown = [name for name in lists if not name.endswith((LOW, HIGH))]
    lines += ["", "".join(f"{name:>22s}" for name in shown)]
    count = len(lists["amplitude"])
    for row in range(0, count, max(1, count // ROWS)):
        lines.append("".join(f"{_cell(lists, name, row):>22s}" for name in shown))
    return "\n".join(lines)


def _cell(lists: dict[str, list[float]], name: str, row: int) -> str:
    """Number of a table, with half of its interval if that is known."""
    text = f"{lists[name][row]:.5g}"
    if name + LOW not in lists:
        return text
    return f"{text} +- {0.5 * (lists[name + HIGH][row] - lists[name + LOW][row]):.2g}"


def _lists(figures: dict[str, Any]) -> dict[str, list[float]]:
    """Figures that are lists over the amplitude."""
    return {name: column for name, column in figures.items() if isinstance(column, list)}


def _write(folder: Path, study: Any, figures: dict[str, Any]) -> list[Path]:
    """Write tables, the scene, the figures as JSON and a picture; returns the files."""
    import numpy as np

    from jbeamshell import plotting
    from jbeamshell.common.files import as_json, csv_text
    from jbeamshell.plotting.folder import write_folder
    from jbeamshell.scene.toml import scene_to_toml

    motion, lists = study.motion, _lists(figures)
    names = ["time", "force", "displacement", "velocity", "kinetic", "stored"]
    names += ["external_work", "friction_work"]
    columns = np.column_stack([np.asarray(getattr(motion, name)) for name in names])
    texts = {
        "motion.csv": csv_text(names, columns.tolist()),
        "ringdown.csv": csv_text(tuple(lists), zip(*lists.values(), strict=True)),
        "result.json": as_json(figures),
    }
    with contextlib.suppress(InputError):  # a scene with a user's own law has no text
        texts["scene.toml"] = scene_to_toml(motion.scene)
    return write_folder(folder, texts, {"ringdown.png": plotting.ring_down_sheet(study)})
