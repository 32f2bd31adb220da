"""Files with other units, factors, offsets, headers and drives than a fit takes for granted.

Each ends in the planted parameters, or in a text with options that lead there.
"""

import functools
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tests.corpus import HONEST, KNOWN, LENGTHS, MU, REFUSED, RIGHT, WIDTH, Case, strip, text

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


def bare(separator: str, decimal: str = ".", above: str = "", columns: tuple[int, ...] = (0, 1, 2)):
    """Writer of a table without a header."""

    def write(path: Path) -> None:
        made = strip(noise=0.002)
        rows = zip(*(made[i] for i in columns), strict=True)
        lines = [separator.join(f"{x:.8g}" for x in row).replace(".", decimal) for row in rows]
        path.write_text(above + "\n".join(lines) + "\n")

    return write


def ramps(amplitude: float, cycles: int = 3, noise: float = 0.0) -> list[np.ndarray]:
    """Columns of the planted strip, whose displacement is driven at a constant rate."""
    made = strip((amplitude,), cycles, "displacement", noise)
    return made


def units_and_factors() -> Iterator[Case]:
    """Units that titles name wrongly or not at all, and sensors' factors."""

    def right(name: str, columns: Callable[[], Any], words: Any = (), **dialect: Any) -> Case:
        return Case(name, text(columns, **dialect), [*KNOWN, *words], RIGHT, planted=MU)

    def lost(name: str, columns: Callable[[], Any], then: Any, **more: Any) -> Case:
        known = more.pop("words", KNOWN)
        told, planted = more.pop("told", ""), more.pop("planted", MU)
        return Case(name, text(columns, **more), list(known), LOST, told, planted, tuple(then))

    def misnamed(
        name: str,
        columns: Callable[[], Any],
        *true: str,
        force: str = "kN",
        displacement: str = "mm",
        **more: Any,
    ) -> Case:
        """File whose titles have wrong units, which the text must name rightly."""
        then = units(*true)
        told = ".*".join(
            re.escape(f"({word} {unit})") for word, unit in zip(then[::2], then[1::2], strict=True)
        )
        names = ("time [s]", f"force [{force}]", f"displacement [{displacement}]")
        return lost(name, columns, then, names=names, told=told, **more)

    of = functools.partial
    volts = ("time [s]", "force [kN]", "displacement [V]")
    plain = ("time [s]", "force", "displacement")
    amplified = of(scaled, displacement=20.0)
    yield right("factor.csv", amplified, units("", "0.05mm"))
    yield right("volts.csv", amplified, units("", "0.05mm/V"), names=volts)
    millivolts = ("time [s]", "force [kN]", "displacement [mV]")
    yield right(
        "millivolts.csv", of(scaled, displacement=2e4), units("", "0.05mm/V"), names=millivolts
    )
    counts = of(scaled, 500.0, 1e4)
    yield right("counts.csv", counts, units("0.002kN", "1e-4mm"), names=plain)
    yield lost("volts without a factor.csv", amplified, units("", "0.05mm/V"), names=volts)
    signals = ("t", "force [V]", "displacement [V]")
    both = units("10kN/V", "0.05mm/V")
    yield right("two signals.csv", of(scaled, 0.1, 20.0), both, names=signals)
    turned = of(scaled, displacement=-20.0)
    negative = [*KNOWN, *units("", "-0.05mm")]
    then = (*units("", "0.05mm"), "--reverse", "displacement")
    yield lost("negative factor.csv", turned, then, words=negative, told="--reverse displacement")

    thousand, soft = of(scaled, 1e3, 1e3), of(scaled, 1.0, 1e3)
    yield misnamed("newtons called kilonewtons.csv", of(scaled, 1e3), "N", "")
    yield misnamed("kilonewtons called newtons.csv", scaled, "kN", "", force="N")
    yield misnamed("micrometres called millimetres.csv", soft, "", "um")
    yield misnamed("millimetres called micrometres.csv", scaled, "", "mm", displacement="um")
    yield misnamed("both too large.csv", thousand, "N", "um")
    yield misnamed("both too small.csv", scaled, "kN", "mm", force="N", displacement="um")
    start = [*KNOWN, "--start", "contact.friction=0.3"]
    yield misnamed("both too large from a start.csv", thousand, "N", "um", words=start)
    unknown = {"words": NO_MODULUS, "planted": TWO}
    yield misnamed("no modulus and micrometres.csv", soft, "", "um", **unknown)

    inches = of(scaled, 1.0 / 4.4482216152605e-3, 1.0 / 25.4e-3)
    yield right(
        "pounds and thousandths.csv", inches, names=("time [s]", "load [lbf]", "slip [mil]")
    )
    kilograms = of(scaled, 1.0 / 9.80665e-3)
    yield right(
        "kilograms of force.csv", kilograms, names=("time (s)", "Load (kgf)", "Stroke (mm)")
    )
    per_width = of(scaled, 1.0 / (1e3 * WIDTH))
    yield right(
        "force per width.csv", per_width, names=("time [s]", "force [kN/mm]", "displacement [mm]")
    )
    micro = ("Zeit [s]", "Kraft [kN]", "Weg [\u00b5m]")
    yield right("micro sign.csv", soft, names=micro, encoding="cp1252")
    one = ("time [s]", "force [kN]", "displacement")
    yield lost("one unit only.csv", scaled, units("", "mm"), names=one)


def offsets() -> Iterator[Case]:
    """Sensors that do not show zero where nothing acts."""

    def case(name: str, columns: Callable[[], Any], then: tuple[str, ...] = ()) -> Case:
        kinds = LOST if then else RIGHT
        return Case(name, text(columns), KNOWN, kinds, "", MU, then)

    of, centre = functools.partial, ("--centre",)
    yield case("displacement off.csv", of(shifted, 0.0, 0.26))
    yield case("displacement little off.csv", of(shifted, 0.0, 0.06), centre)
    yield case("force off.csv", of(shifted, 0.15), centre)
    yield case("both off.csv", of(shifted, -0.2, 0.7), centre)
    once = {"cycles": 1, "noise": 0.0}
    yield case("one cycle off.csv", of(shifted, 0.0, 0.5, **once))
    yield case("one cycle and both off.csv", of(shifted, 0.2, 0.5, **once), centre)
    by_displacement = {"amplitudes": (0.9,), "cycles": 3, "control": "displacement"}
    yield case("force off, displacement drives.csv", of(shifted, 0.3, 0.0, **by_displacement))
    yield case("drive off.csv", of(shifted, 0.0, -0.4, **by_displacement), centre)


def headers() -> Iterator[Case]:
    """Tables of numbers alone."""
    chosen = ("--column", "force=2", "--column", "displacement=3", *units("kN", "mm"))
    remarks = "Rig 3\nOperator: N. N.\n12.05.2024\n\n"
    writers = {
        "no header.csv": bare(","),
        "no header, decimal commas.csv": bare(";", ","),
        "no header, blanks.txt": bare(" "),
        "no header, tabs below remarks.txt": bare("\t", above=remarks),
        "no header, comments.txt": bare(" ", above="# a b c\n% exported\n"),
    }
    for name, write in writers.items():
        yield Case(name, write, KNOWN, REFUSED, "has no header", MU, chosen)
    two = ("--column", "force=1", "--column", "displacement=2", *units("kN", "mm"))
    yield Case("no header, two columns.csv", bare(",", columns=(1, 2)), KNOWN, REFUSED, "", MU, two)


def drives() -> Iterator[Case]:
    """Tests whose displacement drives, and drives that are told wrongly."""

    def case(name: str, columns: Callable[[], Any], words: Any = (), then: Any = ()) -> Case:
        kinds = HONEST if then else RIGHT
        return Case(name, text(columns), [*KNOWN, *words], kinds, "", MU, tuple(then))

    by = functools.partial
    for part in (0.5, 1.0, 1.2):
        yield case(f"displacement drives to {part}.csv", by(ramps, part))
    yield case("displacement drives, noise.csv", by(ramps, 1.0, noise=0.01))
    told = ("--set", "load.control=displacement")
    yield case("force drives, told displacement.csv", scaled, told)
    told = ("--set", "load.control=force")
    then = ("--set", "load.control=displacement")
    sliding = by(ramps, 3.0, noise=0.002)
    yield Case("slides, told force.csv", text(sliding), [*KNOWN, *told], LOST, "", MU, then)


def foreign() -> list[Case]:
    """All files."""
    return [*units_and_factors(), *offsets(), *headers(), *drives()]
