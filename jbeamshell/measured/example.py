"""Example data that ship with the library: loops of finite elements, and of a bolted joint."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from jbeamshell.common.errors import InputError
from jbeamshell.measured.loop_files import read_loops
from jbeamshell.measured.loops import Loop

EXAMPLE_AMPLITUDES = (0.3247, 0.5851, 1.0, 1.6)
HEIGHT_RATIOS = (0.0305, 0.0511, 0.1126, 0.2358, 0.4)


def data_folder() -> Path:
    """Folder of the example data, in the installed package or in the source tree."""
    installed = Path(str(resources.files("jbeamshell"))) / "example_data"
    source = Path(__file__).resolve().parents[2] / "calibration" / "data"
    for folder in (installed, source):
        if folder.is_dir():
            return folder
    raise InputError(f"{source}: the example data are missing: reinstall jbeamshell")


def example_loops(
    height_ratio: float = 0.1126, amplitudes: tuple[float, ...] | None = EXAMPLE_AMPLITUDES
) -> list[Loop]:
    """Read steady loops of the standard strip by plane-strain finite elements (mu = .1, F_N = 10).

    The force enters as an even traction, load.entry = traction.

    Parameters
    ----------
    height_ratio : eta, one of 0.0305, 0.0511, 0.1126, 0.2358, 0.4
    amplitudes : amplitudes of the force, among 0.1, 0.2, 0.3247, 0.4359, 0.5851, 0.7855, 1, 1.3,
        1.6 and 1.9; None for all

    Raises
    ------
    InputError
        if there are no such data
    """
    if height_ratio not in HEIGHT_RATIOS:
        raise InputError(f"height_ratio = {height_ratio}: choose one of {HEIGHT_RATIOS}")
    loops = read_loops(data_folder() / f"loops_eta{height_ratio:.4f}.csv")
    if amplitudes is None:
        return loops
    by_label = {loop.label: loop for loop in loops}
    wanted = [f"A = {amplitude:g}" for amplitude in amplitudes]
    for label in wanted:
        if label not in by_label:
            raise InputError(f"amplitudes: there is no {label}; there are {', '.join(by_label)}")
    return [by_label[label] for label in wanted]


def bolt_files() -> list[Path]:
    """Files of the measured loops of a bolted joint, by strokes of .03, .05 and .1 mm.

    Steel plates under an M12 bolt with a preload of 10 kN, moved across the bolt: displacement in
    mm, transverse force in kN, some three cycles each.

    References
    ----------
    Rousseau, R. I. and Bouzid, A.-H. (2025). Effect of clamped member material and thickness on
    bolt self-loosening under transverse loads. Materials 18, 462, figure 10 (CC BY 4.0).  Digitised
    by L. R. R. da Silva and N. de Souza da Silva, bolt-analysis-studio (MIT).
    """
    return sorted((data_folder() / "bolt_m12").glob("*.csv"))
