"""Measurements: what laws and models fitted to one part say of the part that was held out.

The numbers of measured.json are derived by `comparisons.measurements` from the owners' files.
"""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import numpy as np

from calibration.comparisons.case import Case, Floats, Source
from calibration.comparisons.measurements import RECORD
from calibration.running import read
from calibration.studies import brake_reuss
from jbeamshell import laws, reference

BOLT = Source(
    "R. I. Rousseau and A.-H. Bouzid, Effect of clamped member material and thickness on bolt "
    "self-loosening under transverse loads, Materials 18 (2025) 462, figure 10; digitised by L. R. "
    "R. da Silva, https://github.com/leonardorrs190891/bolt-analysis-studio",
    "CC BY 4.0 (article), MIT (digitised); derived figures only",
    "Read as digitised curves, with notes on the article.",
)
DAMPER = Source(
    "D. Coble, P. Huggins, L. Cao, J. Ricles and A. Downey, Dataset-Friction-Damper-with-Backlash, "
    "2022, https://github.com/ARTS-Laboratory/Dataset-Friction-Damper-with-Backlash at 0e09aa9",
    "CC BY-SA 4.0; derived figures only",
)
CONTACT = Source(
    "J. Christopherson, FrictionModels.jl, examples/test_data_2.txt, "
    "https://github.com/jchristopherson/FrictionModels.jl at e60a4bd, its first 34 s",
    "MIT; derived figures only",
)
CABLE = Source(
    "RTE, pallas-stranded-cable, FLEXION_CARDINAL_H40kN_mu0.7_FOTI.csv, "
    "https://github.com/rte-france/pallas-stranded-cable at a502723; a curve of the literature",
    "MPL-2.0; derived figures only",
    "Read as digitised there.",
)
SCREWS = Source(
    "F. Tao, R. Cole and C. D. Moen, CE/VPI-ST-16/01, 2016; K. D. Peterman, N. Nakata and B. W. "
    "Schafer, J. Constr. Steel Res. 101 (2014) 254-264; https://github.com/EngineerWithData/"
    "FastenerConnectionTests at e23afa9",
    "none stated; derived figures only",
)
BEAM = Source(
    "W. Chen et al. and M. Jin et al., Mech. Syst. Signal Process. 166 (2022) 108401, 108402; "
    "https://github.com/mattiacenedese/BRBtesting at 2d42d3a",
    "GPL-3.0; derived figures only",
)
ORION = Source(
    "E. Fuzaro de Almeida, Vibrations of Assembled Structures, final project, 2022, "
    "https://github.com/estevaofuzaro98/AssembledStructures",
    "MIT, five numbers quoted",
)
TORQUES, GROWTH = np.array([80.0, 30.0, 20.0, 10.0]), np.array([3.4628, 7.0892, 16.4968, 46.1316])


@functools.cache
def recorded(study: str) -> dict[str, Any]:
    """Record of one study."""
    found: dict[str, Any] = json.loads(RECORD.read_text("utf-8"))[study]
    return found


def law_of(study: str, name: str | None = None) -> laws.Law:
    """Law with its fitted numbers; the one that the fit chose if none is named."""
    found = recorded(study)
    name = found["chosen"] if name is None else name
    values = found["models"][name]["values"]
    return laws.law_named(name)(**{key.split(".")[1]: value for key, value in values.items()})


def held_out(study: str, name: str) -> Floats:
    """Figures that were not fitted."""
    return np.array(recorded(study)["held_out"][name])


def energy(study: str) -> Floats:
    """Energy that the fitted law loses at the amplitudes that were not fitted."""
    return np.asarray(law_of(study).dissipation(held_out(study, "amplitude")))


def force(study: str) -> Floats:
    """Largest force of the fitted law there."""
    return np.asarray(law_of(study).backbone(held_out(study, "amplitude")))


def moment() -> Floats:
    """Bending moment of the fitted law at the curvatures that were not fitted."""
    return np.asarray(law_of("cable").backbone(held_out("cable", "curvature")))


def honest() -> int:
    """Number of tests of screws that the plain line refuses, or says not to describe."""
    return sum(answer["exit_code"] in (2, 3) for answer in recorded("screws")["answers"].values())


@functools.cache
def bolted() -> dict[str, Any]:
    """Record of the study of the bolted beam."""
    return read(Path(brake_reuss.__file__).with_suffix(".json"))


def swept() -> Floats:
    """Amplitudes at resonance, m, of the sweeps that the fitted joint reaches."""
    rows = bolted()["found"]["predictions"]
    return np.sort([row["amplitude"] for row in rows if "predicted_amplitude" in row])


def by_decay() -> Floats:
    """The same by the joint that the study fitted to the decay, solved again."""
    model = brake_reuss.start(bolted()["modal_mass"]).replace(bolted()["found"]["values"])
    rows = brake_reuss.predicted(model, bolted())
    known = sorted((r for r in rows if "predicted_amplitude" in r), key=lambda r: r["amplitude"])
    return np.array([row["predicted_amplitude"] for row in known])


def restoring(amplitude: Floats, frequency: Floats) -> Floats:
    """Amplitude of the restoring force of the beam's mode."""
    return np.asarray(bolted()["modal_mass"] * (2.0 * np.pi * frequency) ** 2 * amplitude)


def shaken() -> tuple[Floats, Floats]:
    """Restoring force and energy of a cycle of the sweeps with controlled response."""
    rows = bolted()["resonances"]["ResponseControl"]
    force, amplitude, frequency = (
        np.array([row[name] for row in rows]) for name in ("force", "amplitude", "frequency")
    )
    return restoring(amplitude, frequency), np.pi * force * amplitude


def decayed() -> tuple[Floats, Floats]:
    """The same of the decay, at every other amplitude that the sweeps reach."""
    columns = (np.array(bolted()["ring_down"][n]) for n in ("amplitude", "frequency", "damping"))
    amplitude, frequency, damping = (column[13::2] for column in columns)
    force = restoring(amplitude, frequency)
    return force, 2.0 * np.pi * damping * force * amplitude


def by_sweeps() -> Floats:
    """Energy of a cycle of the decay by a power law that is fitted to the sweeps."""
    line = np.polynomial.Polynomial.fit(*np.log(shaken()), 1)
    return np.exp(line(np.log(decayed()[0])))


def pair(
    study: str,
    title: str,
    source: Source,
    condition: str,
    fitted: str,
    share: float,
    bounds: tuple[float, float],
    explained: tuple[str, str],
) -> tuple[Case, Case]:
    """Cases of the energy and the force of one study."""
    made = [
        Case(
            f"{title}, {name}",
            "measured",
            source,
            f"{words} of the tests that were not fitted",
            condition,
            functools.partial(held_out, study, name),
            functools.partial(figure, study),
            bound,
            explained=why,
            fitted=fitted,
            held_out=share,
        )
        for name, words, figure, bound, why in (
            ("energy", "energy lost in a cycle", energy, bounds[0], explained[0]),
            ("force", "largest force", force, bounds[1], explained[1]),
        )
    ]
    return made[0], made[1]


CASES = (
    *pair(
        "bolt",
        "preloaded M12 bolt",
        BOLT,
        "one clamped member rolls and is moved by .03 to .14 mm across the bolt; slip under head "
        "and nut; 10 kN preload",
        "the loop of .14 mm, by five laws; the criterion chose Iwan's four parameters",
        2 / 3,
        (0.10, 0.20),
        (
            "Iwan's law was fitted at 3 to 5 times the amplitude",
            "the loop of .05 mm reaches the force of that of .14 mm, which no law of one slip "
            "force does",
        ),
    ),
    *pair(
        "damper",
        "friction damper with backlash",
        DAMPER,
        "band brake on a drum, moved by .5, 1 and 1.5 in at .5 Hz, 36 lb of band tension; no "
        "elastic micro-slip, backlash after each turn",
        "the loop of 1 in, by five laws; the criterion chose the bar",
        2 / 3,
        (0.06, 0.25),
        (
            "backlash loses length, not force; the bar's rounded shoulder stands for it",
            "one direction sticks and slips with peaks, which the law averages",
        ),
    ),
    *pair(
        "contact",
        "reciprocating contact",
        CONTACT,
        "displacement imposed beyond gross slip; elastic branch of rig and specimen",
        "the mean of the first half of 8 cycles, by five laws; the criterion chose Bouc-Wen",
        0.5,
        (0.02, 0.05),
        ("", "the measured friction changes along the stroke and with the direction"),
    ),
    Case(
        "bending of a stranded conductor",
        "measured",
        CABLE,
        "moment at every other point of a first bending",
        "Cardinal conductor under 40 kN of tension; wires slip layer by layer",
        functools.partial(held_out, "cable", "moment"),
        moment,
        0.06,
        each=False,
        explained="the moment goes on rising, by the bending of the wires, which laws of slip lack",
        fitted="every other point, by four laws",
        held_out=0.5,
    ),
    Case(
        "bolted beam, ring-down to sweeps",
        "measured",
        BEAM,
        "amplitude at resonance under six forces of a shaker",
        "first bending of the Brake-Reuss beam; the joint of a study's record, solved again; six "
        "larger forces are beyond the joint that the decay tells, and refused",
        swept,
        by_decay,
        0.20,
        explained="with the shaker the beam is softer and damps less from the smallest force on",
        fitted="the ring-down's frequency and damping, by a strip between springs",
        held_out=0.5,
    ),
    Case(
        "bolted beam, sweeps to ring-down",
        "measured",
        BEAM,
        "energy lost in a cycle of the decay, four amplitudes that the sweeps reach too",
        "first bending of the Brake-Reuss beam; a power law of the mode's restoring force",
        lambda: decayed()[1],
        by_sweeps,
        0.45,
        explained="the shaken beam damps 15 % less than the free one at the same amplitude, and a "
        "power law has no damping of the beam's own",
        fitted="eight sweeps with controlled response, by a power law",
        held_out=0.5,
    ),
    Case(
        "shear tests of screwed sheets",
        "measured",
        SCREWS,
        "tests that a plain fit refuses, or says that it does not describe",
        "cyclic shear up to failure: holes widen, screws tilt, loops pinch",
        lambda: len(recorded("screws")["answers"]),
        honest,
        0.0,
    ),
    Case(
        "damping over torque, Orion beam",
        "second-hand",
        ORION,
        "exponent over the bolts' torque, 10 to 80 cNm, of the growth of damping with amplitude",
        "their model damps by the square of the amplitude; ours is the bar, friction by torque",
        float(np.polyfit(np.log(TORQUES), np.log(GROWTH), 1)[0]),
        lambda: float(
            np.log(reference.cubic_law(1.0, 1.0, 80.0) / reference.cubic_law(1.0, 1.0, 10.0))
            / np.log(8.0)
        ),
        0.3,
        explained="theirs damps by the square of the amplitude, a bar by its first power",
    ),
)
