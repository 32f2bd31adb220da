"""The command line: a scene by finite elements, and by the beamshell beside it."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

import jbeamshell as jb
from calibration.finite_elements import solve
from calibration.finite_elements.mesh import ORDERS
from calibration.finite_elements.solving import check_reach
from jbeamshell.cli.arguments import add_folder, add_json, add_scene, add_settings, scene_of
from jbeamshell.cli.terminal import BAD_INPUT, INTERRUPTED, UNCONVERGED, put, say_written
from jbeamshell.common.files import as_json
from jbeamshell.history.report import turning_steps, write_run
from jbeamshell.plotting.folder import check_folder

COUNTS = ("newton_iterations", "wall_s")  # of which a difference says nothing
PICTURE = "finite_elements.png"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    jax.config.update("jax_enable_x64", True)
    try:
        return _run(options)
    except (jb.InputError, jb.UnconvergedError) as error:
        code = BAD_INPUT if isinstance(error, jb.InputError) else UNCONVERGED
        print(f"finite_elements: {' '.join(str(error).split())}", file=sys.stderr)
        return code
    except KeyboardInterrupt:
        print("finite_elements: interrupted; CalculiX is stopped", file=sys.stderr)
        return INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m calibration.finite_elements",
        description="A scene by finite elements (CalculiX), and by the beamshell beside it.",
        epilog="exit codes: 0 done, 2 bad input, 3 a load step did not converge",
    )
    add_scene(parser)
    add_settings(parser)
    parser.add_argument("--elements", choices=tuple(ORDERS), default="quadratic")
    parser.add_argument(
        "--refinement", type=float, default=1.0, metavar="R", help="divides all element sizes"
    )
    parser.add_argument("--keep", metavar="DIR", help="keep CalculiX's files in this folder")
    add_folder(parser)
    add_json(parser)
    return parser


def _run(options: argparse.Namespace) -> int:
    scene = scene_of(options)
    folder = check_folder(options.out) if options.out else None
    check_reach(scene)
    begin = time.perf_counter()
    reduced = jax.block_until_ready(jb.solve(scene))
    middle = time.perf_counter()
    full = solve(
        scene, elements=options.elements, refinement=options.refinement, folder=options.keep
    )
    figures = full.figures() | {"wall_s": time.perf_counter() - middle}
    beside = reduced.figures() | {"wall_s": middle - begin}  # it compiles too
    both = {"finite_elements": figures, "beamshell": beside}
    both["difference_percent"] = differences(figures, beside)
    put(as_json(both) if options.json else table(both))
    if folder is not None:
        written = write_run(folder, full, figures)
        say_written([*written, picture(full, reduced, folder / PICTURE)])
    return 0


def differences(figures: dict[str, Any], beside: dict[str, Any]) -> dict[str, float]:
    """Differences of the beamshell's figures, in per cent of those of the finite elements."""
    return {
        name: 100.0 * (beside[name] / value - 1.0)
        for name, value in figures.items()
        if isinstance(value, float) and value != 0.0 and name not in (*COUNTS, "closure")
    }


def table(both: dict[str, dict[str, Any]]) -> str:
    """The figures side by side, as text."""
    lines = [f"{'':20s} {'finite elements':>16s} {'beamshell':>14s} {'difference':>12s}"]
    for name, value in both["finite_elements"].items():
        words = [
            f"{v:.6g}" if isinstance(v, float) else str(v) for v in (value, both["beamshell"][name])
        ]
        percent = both["difference_percent"].get(name)
        last = "" if percent is None else f"{percent:+.2f} %"
        lines.append(f"{name.replace('_', ' '):20s} {words[0]:>16s} {words[1]:>14s} {last:>12s}")
    return "\n".join(line.rstrip() for line in lines) + "\n"


def picture(full: jb.History, reduced: jb.History, path: Path) -> Path:
    """Both paths, and traction and reaction along the base at the turning points."""
    import matplotlib.pyplot as plt

    from jbeamshell import plotting

    steps = turning_steps(full)[-3:]
    with plotting.style():
        figure, (left, middle, right) = plt.subplots(1, 3, figsize=(13.0, 4.0))
        # Finite elements are lines, the beamshell is dashed over them.
        for history, look, name in ((full, "-", "finite elements"), (reduced, "--", "beamshell")):
            u, force = np.asarray(history.displacement), np.asarray(history.force)
            colour = plotting.PALETTE[0 if history is full else 1]
            left.plot(u, force, look, color=colour, label=name)
            for step, shade in zip(steps, plotting.PALETTE, strict=False):
                label = f"$F$ = {force[step]:.3g}" if history is full else None
                x = np.asarray(history.x)
                middle.plot(x, np.asarray(history.traction[step]), look, color=shade, label=label)
                right.plot(x, np.asarray(history.reaction[step]), look, color=shade)
        left.set(xlabel=plotting.DISPLACEMENT, ylabel=plotting.FORCE)
        middle.set(xlabel=plotting.POSITION, ylabel="friction traction  $t$  [stress]")
        right.set(xlabel=plotting.POSITION, ylabel="normal reaction  $R$  [stress]")
        left.legend()
        middle.legend()
    plotting.save(figure, path)
    plotting.close(figure)
    return path


if __name__ == "__main__":
    sys.exit(main())
