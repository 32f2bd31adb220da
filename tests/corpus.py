"""Files as rigs write them, sound and faulty, made from fixed seeds; how a fit of each must end.

A file ends well in one of three ways: its parameters are those that were planted; the fit says
honestly that the model does not describe it; or it is refused by a sentence that names the fix.
"""

from __future__ import annotations

import csv
import functools
import io
import itertools
import json
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.io

import jbeamshell as jb
from jbeamshell.measured.example import example_loops
from jbeamshell.scene.dimensions import dimensions_of
from jbeamshell.scene.pressure import resultant
from jbeamshell.scene.toml import scene_from_values
from tests import rig

WIDTH, FRICTION = 0.05, 0.3
SPECIMEN = {
    "length": "120mm",
    "thickness": "12mm",
    "width": "50mm",
    "modulus": "210GPa",
    "bolts": "2x8kN@30mm,90mm",
}
GROSS = FRICTION * 16e3  # N
LENGTHS = [word for name, text in SPECIMEN.items() for word in (f"--{name}", text)]
KNOWN = [*LENGTHS, "--free", "contact.friction"]
ALONE: list[str] = []  # no word besides the file
UNITS = ["--unit", "force=kN", "--unit", "displacement=mm"]
NAMES = ("time [s]", "force [kN]", "displacement [mm]")
FITTING = 0.05  # misfit over the range up to which a loop of another law counts as described


class Ending(NamedTuple):
    """End of a fit of a file.

    Attributes
    ----------
    kind : "parameters", "not this model", "refused" or "silent"
    told : what was said, or the figures that count
    """

    kind: str
    told: str


class Case(NamedTuple):
    """A file, the words of the command besides it, and its ending.

    Attributes
    ----------
    name : name of the file
    write : writes the file to a path
    words : options of `jbeamshell fit`
    kinds : endings that are right
    told : regular expression that the text of a refusal or a doubt must match
    planted : value and relative tolerance by figure; "gross slip" is mu F_N L in N
    then : further options, which the text names and which lead to the planted parameters
    """

    name: str
    write: Callable[[Path], object]
    words: list[str]
    kinds: tuple[str, ...]
    told: str = ""
    planted: dict[str, tuple[float, float]] = {}  # noqa: RUF012 - never changed
    then: tuple[str, ...] = ()


# --- what is written ------------------------------------------------------------------------------


def table(
    columns: list[np.ndarray], names: tuple[str, ...] = NAMES, above: str = "", **dialect: str
) -> bytes:
    """Text of a table in a dialect: delimiter, decimal mark, encoding, and lines above it."""
    file = io.StringIO()
    writer = csv.writer(file, delimiter=dialect.get("delimiter", ","), lineterminator="\n")
    writer.writerow(names)
    for row in zip(*columns, strict=True):
        writer.writerow([f"{x:.8g}".replace(".", dialect.get("decimal", ".")) for x in row])
    return (above + file.getvalue()).encode(dialect.get("encoding", "utf-8"))


@functools.cache
def planted(
    amplitudes: tuple[float, ...], cycles: int, control: str
) -> tuple[np.ndarray, np.ndarray]:
    """Force [N] and displacement [m] of the specimen; amplitudes are parts of gross slip.

    Under displacement control they are parts of the displacement at .9 of gross slip.
    """
    values = dimensions_of(SPECIMEN).values | {"contact.friction": FRICTION}
    drive = rig.path(cycles, 80, amplitudes)
    size = GROSS
    if control == "displacement":
        force, displacement = planted((0.9,), 1, "force")
        size = float(np.max(displacement))
    scene = scene_from_values(
        values | {"load.control": control, "load.amplitude": size * max(amplitudes)}
    )
    history = jb.solve(scene, size * drive[1:])
    first = history.pressed + 1
    force = np.append(0.0, np.asarray(history.force)[first:])
    return force, np.append(0.0, np.asarray(history.displacement)[first:])


def strip(
    amplitudes: tuple[float, ...] = (0.7,),
    cycles: int = 4,
    control: str = "force",
    noise: float = 0.0,
    kind: str = "white",
    seed: int = 0,
) -> list[np.ndarray]:
    """Time [s], force [kN] and displacement [mm] of the planted specimen."""
    made = rig.recorded(*planted(amplitudes, cycles, control), noise, kind, seed, control)
    return [np.asarray(made.time), 1e-3 * made.force, 1e3 * made.displacement]


def other(force: np.ndarray, drive: np.ndarray, seed: int = 0) -> list[np.ndarray]:
    """Time, force [kN] and displacement [mm] of another law, of the specimen's size."""
    made = rig.recorded(3.0 * force, 0.01 * drive, 0.005, "white", seed, "displacement")
    return [np.asarray(made.time), made.force, made.displacement]


def text(columns: Callable[[], list[np.ndarray]], **dialect: Any) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(table(columns(), **dialect))


def with_column(place: int, change: Callable[[np.ndarray], np.ndarray]) -> list[np.ndarray]:
    """Columns of the planted strip of which one is changed."""
    columns = strip(noise=0.002)
    columns[place] = change(columns[place])
    return columns


def matlab_file(path: Path) -> None:
    time, force, displacement = strip()
    scipy.io.savemat(path, {"rig": {"t": time, "force_kN": force, "displacement_mm": displacement}})


def finite_elements() -> list[np.ndarray]:
    """Three cycles of finite elements of a strip that was not made by this model."""
    (loop,) = example_loops(0.1126, (1.3,))
    force, displacement = (np.tile(c[:-1], 3) for c in (loop.force, loop.displacement))
    return [0.01 * np.arange(force.size), force, displacement]


# --- the files ------------------------------------------------------------------------------------

RIGHT = ("parameters",)
REFUSED = ("refused",)
HONEST = ("parameters", "not this model")
MU = {"contact.friction": (FRICTION, 0.03)}
ROUGH = {"contact.friction": (FRICTION, 0.1)}
GERMAN = ("Zeit [s]", "Prüfkraft [kN]", "Kolbenweg [mm]")
ABOVE = "Prüfstand 3\nBediener: N. N.; 12.05.2024\n\n"
STANDARD = {"strip.length": 2.0, "strip.axial_stiffness": 3.4e4, "contact.pressure": 10.0}
OF_STANDARD = [w for key, value in STANDARD.items() for w in ("--set", f"{key}={value}")]


def sound() -> Iterator[Case]:
    """Loops of the planted strip, of finite elements, and of sliders that slide."""

    def case(name: str, write: Callable[[Path], object], **more: Any) -> Case:
        return Case(name, write, more.pop("words", KNOWN), RIGHT, **{"planted": MU, **more})

    yield case("plain.csv", text(strip), words=LENGTHS)
    german = {"delimiter": ";", "decimal": ",", "encoding": "cp1252"}
    yield case("german.csv", text(strip, names=GERMAN, above=ABOVE, **german))
    yield case("workspace.mat", matlab_file)
    for seed, kind in enumerate(rig.NOISES):
        columns = functools.partial(strip, noise=0.02, kind=kind, seed=seed)
        yield case(f"noise {kind}.csv", text(columns), planted=ROUGH)
    rising = functools.partial(strip, (0.3, 0.5, 0.7, 0.8), 1, noise=0.005)
    yield case("one cycle per level.csv", text(rising))
    levels = functools.partial(strip, (0.4, 0.7), 3, noise=0.005)
    yield case("three cycles per level.csv", text(levels))
    sliding = functools.partial(strip, (3.0,), 3, "displacement", noise=0.005)
    yield case("gross slip.csv", text(sliding))

    def drifting() -> list[np.ndarray]:
        return with_column(2, lambda u: u + 0.5 * np.ptp(u) * np.linspace(0.0, 1.0, u.size))

    yield case("drifting.csv", text(drifting), words=[*KNOWN, "--drift", "linear"])
    yield Case("drift kept.csv", text(drifting), KNOWN, HONEST, "--drift linear")

    def shaken() -> list[np.ndarray]:
        time, force, displacement = strip(cycles=12)
        speed = np.gradient(1e-3 * displacement, time)
        return [time, force, np.gradient(speed, time)]

    accelerations = ("time [s]", "force [kN]", "acceleration [m/s^2]")
    yield case("accelerations.csv", text(shaken, names=accelerations), planted=ROUGH)
    offset = text(lambda: with_column(2, lambda u: u + 3.0))
    yield case("offset.csv", offset, words=[*KNOWN, "--centre"])
    yield case(
        "finite elements.csv",
        text(finite_elements, names=("time", "force", "displacement")),
        words=[*OF_STANDARD, "--free", "contact.friction", "--set", "strip.height_ratio=0.1126"],
        planted={"contact.friction": (0.1, 0.05)},
    )
    jenkins = text(lambda: other(rig.jenkins(rig.path(3)), rig.path(3)))
    yield Case("jenkins.csv", jenkins, ALONE, RIGHT, planted={"gross slip": (900.0, 0.05)})


def of_other_laws() -> Iterator[Case]:
    """Joints that are not this model, of which some answer like it."""
    u = rig.path(4)
    answers = {
        "iwan.csv": rig.iwan(u),
        "bouc-wen.csv": rig.bouc_wen(u),
        "viscous.csv": rig.viscous(u),
        "elastic.csv": u,
        "asymmetric.csv": rig.stops(u, [0.3], [1.0]) + 0.6 * np.maximum(u, 0.0) ** 2,
    }
    doubts = {"viscous.csv": "ellipse", "elastic.csv": "no friction", "asymmetric.csv": "differ"}
    for name, force in answers.items():
        columns = functools.partial(other, force, u)
        yield Case(name, text(columns), ALONE, HONEST, doubts.get(name, ""))
    falling = functools.partial(strip, (0.8, 0.6, 0.4), 1)
    yield Case("falling amplitudes.csv", text(falling), KNOWN, HONEST)

    def loading() -> list[np.ndarray]:
        return [column[:20] for column in strip()]

    yield Case("first loading.csv", text(loading), KNOWN, HONEST)

    def noise() -> list[np.ndarray]:
        time, _, _ = strip()
        return [time, *np.random.default_rng(1).standard_normal((2, time.size))]

    told = "noise|describe|cycle"
    yield Case("only noise.csv", text(noise), ALONE, ("refused", "not this model"), told)


def wrong() -> Iterator[Case]:
    """Files with which something is wrong."""

    def case(name: str, write: Callable[[Path], object], told: str, words: Any = KNOWN) -> Case:
        return Case(name, write, list(words), REFUSED, told)

    yield case("wrong sign.csv", text(lambda: with_column(1, np.negative)), "--reverse force")
    metres = ("time [s]", "force [kN]", "displacement [m]")
    yield case("wrong unit.csv", text(strip, names=metres), "--unit displacement=mm")
    newtons = ("time [s]", "force [MN]", "displacement [mm]")
    yield case("wrong force.csv", text(strip, names=newtons), "--unit force=")
    swapped = ("time [s]", "displacement [mm]", "force [kN]")
    yield case("swapped.csv", text(strip, names=swapped), "--column force=", ALONE)
    clipped = text(lambda: with_column(1, lambda f: np.minimum(f, 0.6 * np.max(f))))
    yield case("clipped.csv", clipped, "larger range")
    u = rig.path(4)
    for name, law in (("pinched.csv", rig.pinched), ("bearing.csv", rig.bearing)):
        told = "within the clearance"
        yield case(name, text(functools.partial(other, law(u), u)), told, ALONE)
    twins = ("time [s]", "force 1 [kN]", "force 2 [kN]", "displacement [mm]")

    def double() -> list[np.ndarray]:
        time, force, displacement = strip()
        return [time, force, force, displacement]

    yield case("two forces.csv", text(double, names=twins), "--column force=")


# --- other units, factors, offsets, headers and drives than a fit takes for granted ---------------

LOST = ("refused", "not this model")
NO_MODULUS = [w for w in LENGTHS if w not in ("--modulus", "210GPa")]
TWO = {"contact.friction": (MU["contact.friction"][0], 0.1)}  # of two numbers that were fitted


def units(force: str, displacement: str) -> tuple[str, ...]:
    """Options of units; an empty one is left out."""
    given = {"force": force, "displacement": displacement}
    return tuple(w for name, unit in given.items() if unit for w in ("--unit", f"{name}={unit}"))


def scaled(force: float = 1.0, displacement: float = 1.0, **more: Any) -> list[np.ndarray]:
    """Columns of the planted strip, in kN and mm, times factors."""
    time, f, u = strip(noise=0.002, **more)
    return [time, force * f, displacement * u]


def shifted(force: float = 0.0, displacement: float = 0.0, **more: Any) -> list[np.ndarray]:
    """Columns of the planted strip with offsets in parts of their ranges."""
    time, f, u = strip(**{"noise": 0.002, **more})
    return [time, f + force * np.ptp(f), u + displacement * np.ptp(u)]


def units_and_factors() -> Iterator[Case]:
    """Units that titles name wrongly or not at all, and sensors' factors."""

    def lost(name: str, columns: Callable[[], Any], then: Any, **more: Any) -> Case:
        known = more.pop("words", KNOWN)
        told, planted = more.pop("told", ""), more.pop("planted", MU)
        return Case(name, text(columns, **more), list(known), LOST, told, planted, tuple(then))

    def misnamed(
        name: str,
        columns: Callable[[], Any],
        true: tuple[str, str],
        titled: str = "kN mm",
        **more: Any,
    ) -> Case:
        """File whose titles have wrong units, which the text must name rightly."""
        then, (force, displacement) = units(*true), titled.split()
        told = ".*".join(
            re.escape(f"({word} {unit})") for word, unit in zip(then[::2], then[1::2], strict=True)
        )
        names = ("time [s]", f"force [{force}]", f"displacement [{displacement}]")
        return lost(name, columns, then, names=names, told=told, **more)

    of = functools.partial
    volts = ("time [s]", "force [kN]", "displacement [V]")
    amplified = text(of(scaled, displacement=20.0), names=volts)
    factor = units("", "0.05mm/V")
    yield Case("volts.csv", amplified, [*KNOWN, *factor], RIGHT, planted=MU)
    yield Case("volts without a factor.csv", amplified, KNOWN, LOST, "", MU, factor)
    then = (*units("", "0.05mm"), "--reverse", "displacement")
    negative = [*KNOWN, *units("", "-0.05mm")]
    turned = of(scaled, displacement=-20.0)
    yield lost("negative factor.csv", turned, then, words=negative, told="--reverse displacement")
    thousand, soft = of(scaled, 1e3, 1e3), of(scaled, 1.0, 1e3)
    yield misnamed("newtons called kilonewtons.csv", of(scaled, 1e3), ("N", ""))
    yield misnamed("millimetres called micrometres.csv", scaled, ("", "mm"), "kN um")
    yield misnamed("both too small.csv", scaled, ("kN", "mm"), "N um")
    start = [*KNOWN, "--start", "contact.friction=0.3"]
    yield misnamed("both too large from a start.csv", thousand, ("N", "um"), words=start)
    unknown = {"words": NO_MODULUS, "planted": TWO}
    yield misnamed("no modulus and micrometres.csv", soft, ("", "um"), **unknown)
    per_width = ("time [s]", "force [kN/mm]", "displacement [mm]")
    along = text(of(scaled, 1.0 / (1e3 * WIDTH)), names=per_width)
    yield Case("force per width.csv", along, KNOWN, RIGHT, planted=MU)


def offsets() -> Iterator[Case]:
    """Sensors that do not show zero where nothing acts."""

    def case(name: str, columns: Callable[[], Any], then: tuple[str, ...] = ()) -> Case:
        kinds = LOST if then else RIGHT
        return Case(name, text(columns), KNOWN, kinds, "", MU, then)

    of, centre = functools.partial, ("--centre",)
    yield case("displacement off.csv", of(shifted, 0.0, 0.26))
    yield case("displacement little off.csv", of(shifted, 0.0, 0.06), centre)
    yield case("both off.csv", of(shifted, -0.2, 0.7), centre)
    once = {"cycles": 1, "noise": 0.0}
    yield case("one cycle and both off.csv", of(shifted, 0.2, 0.5, **once), centre)
    by_displacement = {"amplitudes": (0.9,), "cycles": 3, "control": "displacement"}
    yield case("drive off.csv", of(shifted, 0.0, -0.4, **by_displacement), centre)


def headers_and_drives() -> Iterator[Case]:
    """Tables of numbers alone; displacements that drive, and drives that are told wrongly."""

    def bare(path: Path) -> None:
        rows = zip(*strip(noise=0.002), strict=True)
        lines = ["\t".join(f"{x:.8g}" for x in row) for row in rows]
        path.write_text("Rig 3\nOperator: N. N.\n12.05.2024\n\n" + "\n".join(lines) + "\n")

    chosen = ("--column", "force=2", "--column", "displacement=3", *units("kN", "mm"))
    yield Case("no header below remarks.txt", bare, KNOWN, REFUSED, "has no header", MU, chosen)

    def ramps(part: float, noise: float) -> Callable[[Path], object]:
        return text(functools.partial(strip, (part,), 3, "displacement", noise))

    yield Case("displacement drives.csv", ramps(1.2, 0.01), KNOWN, RIGHT, planted=MU)
    told = [*KNOWN, "--set", "load.control=displacement"]
    yield Case("force drives, told displacement.csv", text(scaled), told, RIGHT, planted=MU)
    told = [*KNOWN, "--set", "load.control=force"]
    then = ("--set", "load.control=displacement")
    yield Case("slides, told force.csv", ramps(3.0, 0.002), told, LOST, "", MU, then)


def corpus() -> list[Case]:
    """All files."""
    foreign = [*units_and_factors(), *offsets(), *headers_and_drives()]
    return [*sound(), *of_other_laws(), *wrong(), *foreign]


# --- how they end ---------------------------------------------------------------------------------


def words(case: Case, folder: Path, then: Sequence[str] = ()) -> list[str]:
    """Words of the command line that fits a case, whose file is written to the folder."""
    case.write(folder / case.name)
    options = [*case.words, *then, "--json", "--out", str(folder / "out")]
    return ["fit", str(folder / case.name), *options]


def named(then: Sequence[str]) -> Iterator[str]:
    """Options as a text names them: each with the quantity or key that it sets, if any."""
    for option, value in itertools.zip_longest(then, then[1:], fillvalue=""):
        if option.startswith("--"):
            key, mark, _ = value.partition("=")
            yield f"{option} {key}{mark}" if mark else option


def ended(code: int, out: str, err: str, case: Case, folder: Path) -> Ending:
    """Ending of the command from its exit code, what it printed and what it wrote."""
    if not out:  # refused, or a fit that failed
        line = err.strip().splitlines()[-1] if err.strip() else ""
        fix = re.search(r"--\w|give|record|write|keep|name|remove|leave", line)
        return Ending("refused" if fix and line.startswith("jbeamshell: ") else "silent", line)
    figures = json.loads(out)
    said = " ".join([*figures["doubts"], *figures["notes"]])
    values = {key: one["value"] for key, one in figures["values"].items()}
    scene = jb.read_scene(folder / "out" / "scene.toml")
    normal, _ = resultant(scene.contact.pressure, scene.contact.bottom_pressure, scene.strip.length)
    values["gross slip"] = float(scene.contact.friction) * float(normal)
    shown = ", ".join(f"{key} = {value:.4g}" for key, value in values.items())
    told = f"misfit {100.0 * figures['misfit']:.2g} %; {shown}; {said}"
    if code == 3:
        return Ending("not this model" if "does not describe" in said else "silent", told)
    near = [abs(values[key] - goal) <= close * goal for key, (goal, close) in case.planted.items()]
    described = all(near) if near else figures["misfit"] < FITTING
    return Ending("parameters" if code == 0 and described else "silent", told)
