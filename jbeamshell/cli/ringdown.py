"""`jbeamshell ringdown`: a mass on a strip let go, its frequency and damping over amplitude."""

from __future__ import annotations

import argparse
import contextlib
from pathlib import Path
from typing import Any

from jbeamshell.cli.terminal import assignments, put, say, say_written
from jbeamshell.common.errors import InputError

ROWS = 12  # of the table that a person reads


def add_to(commands: Any) -> argparse.ArgumentParser:
    """Add the command's options to a parser."""
    ringing = commands.add_parser(
        "ringdown",
        help="let a mass on a strip ring down",
        description="Pull a mass on a strip, let it go, and report frequency and damping over "
        "amplitude beside the quasi-static prediction by Masing's rule.",
    )
    ringing.add_argument("scene", nargs="?", metavar="NAME|SCENE.toml", help="as of run")
    ringing.add_argument(
        "--force", type=float, metavar="F", help="pull per width (default load.amplitude)"
    )
    ringing.add_argument(
        "--payload", type=float, metavar="MASS", help="per width (default 50 strips)"
    )
    ringing.add_argument(
        "--density", type=float, default=1.0, metavar="RHO", help="mass per volume (default 1)"
    )
    ringing.add_argument(
        "--cycles", type=float, default=20.0, metavar="N", help="to follow (default 20)"
    )
    ringing.set_defaults(run=run)
    return ringing


def run(options: argparse.Namespace) -> int:
    """Simulate, report and write; returns the exit code."""
    from jbeamshell.common import files
    from jbeamshell.dynamics.let_go import let_go
    from jbeamshell.dynamics.strip.inertia import Inertia
    from jbeamshell.plotting.folder import check_folder
    from jbeamshell.scene import library
    from jbeamshell.scene.toml import overridden, scene_from_values

    given = {} if options.scene is None else library.values_from(options.scene)
    scene = scene_from_values(overridden(given, assignments(options.set)))
    folder = None if options.out is None else check_folder(options.out)
    say("compiling ...")
    study = let_go(
        scene,
        options.force,
        payload=options.payload,
        inertia=Inertia(options.density),
        cycles=options.cycles,
    )
    figures = study.figures()
    put(files.as_json(figures) if options.json else f"{_table(figures)}\n")
    if folder is not None:
        say_written(_write(folder, study, figures))
    return 0


def _table(figures: dict[str, Any]) -> str:
    """What a person reads."""
    lists = {name: column for name, column in figures.items() if isinstance(column, list)}
    lines = [f"{name:24s} {value}" for name, value in figures.items() if name not in lists]
    lines += ["", "".join(f"{name:>21s}" for name in lists)]
    rows = list(zip(*lists.values(), strict=True))
    lines += ["".join(f"{x:21.5g}" for x in row) for row in rows[:: max(1, len(rows) // ROWS)]]
    return "\n".join(lines)


def _write(folder: Path, study: Any, figures: dict[str, Any]) -> list[Path]:
    """Tables, the scene, the figures as JSON and a picture, each whole or not at all."""
    import numpy as np

    from jbeamshell import plotting
    from jbeamshell.common import files
    from jbeamshell.common.files import write_text
    from jbeamshell.scene.toml import scene_to_toml

    motion = study.motion
    names = ("time", "force", "displacement", "velocity", "kinetic", "stored")
    names += ("external_work", "friction_work")
    history = np.column_stack([np.asarray(getattr(motion, name)) for name in names])
    lists = {name: column for name, column in figures.items() if isinstance(column, list)}
    texts = {
        "motion.csv": _csv(names, history.tolist()),
        "ringdown.csv": _csv(tuple(lists), zip(*lists.values(), strict=True)),
        "result.json": files.as_json(figures),
    }
    with contextlib.suppress(InputError):
        texts["scene.toml"] = scene_to_toml(motion.scene)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        write_text(folder / name, text)
    sheet = plotting.ring_down_sheet(study)
    plotting.save(sheet, folder / "ringdown.png")
    plotting.close(sheet)
    return [folder / name for name in (*texts, "ringdown.png")]


def _csv(header: tuple[str, ...], rows: Any) -> str:
    lines = [",".join(header), *(",".join(map(repr, row)) for row in rows)]
    return "\n".join(lines) + "\n"
