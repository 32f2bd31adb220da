"""Cycles of `Joint.of` beside those of `jbeamshell.solve`: random strips, three amplitudes.

A joint is a law of sliders, whose loops follow Masing's rule; those of a strip do so only nearly.
Strips are drawn as for `verification.plain_slopes`, under all entries of the force.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

import jbeamshell as jb
from calibration.running import as_text
from verification.plain_slopes import SLIPS, strips

COUNT, SEED = 200, 63
SHARES = 1.0, 0.6, 0.1  # of the joint's largest force
LOAD = "load.amplitude"
Record = dict[str, Any]


def row(values: Record) -> Record:
    """Relative errors of a joint's energy and displacement in the cycles of a scene."""
    scene, cycles = jb.Scene().replace(values), []
    joint = jb.dynamics.Joint.of(scene)
    for part in SHARES:
        force = part * values[LOAD]
        history, u = jb.solve(scene.replace({LOAD: force})), float(joint.displacement(force))
        loss, reach = float(history.dissipation), 0.5 * float(np.ptp(history.loop[1]))
        cycles.append(
            {
                "part": part,
                "of_goodman": float(history.dissipation_ratio),
                "D": float(joint.dissipation(u)) / loss - 1.0 if loss > 0.0 else None,
                "u": u / reach - 1.0,
            }
        )
    return {"values": values, "cycles": cycles}


def measure() -> Record:
    """Errors of all strips, those that hardly slip left out of the summary."""
    drawn, rows = strips(np.random.default_rng(SEED)), []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jb.DoubtfulWarning)
        for number in range(COUNT):
            rows.append(row(next(drawn)))
            if number % 50 == 49:
                print(f"joint {number + 1} of {COUNT}", flush=True)
    return {"summary": [summary(rows, i) for i in range(len(SHARES))], "rows": rows}


def summary(rows: list[Record], at: int) -> Record:
    """Median, 98 % and largest size of the errors at one of the amplitudes, in per cent."""
    cycles = [row["cycles"][at] for row in rows]
    found: Record = {"part": SHARES[at]}
    for name in ("D", "u"):
        own = [abs(c[name]) for c in cycles if name == "u" or c["of_goodman"] > SLIPS]
        sizes = 100.0 * np.percentile(own, [50.0, 98.0, 100.0])
        found |= {"slipping": len(own)} if name == "D" else {}
        found[name] = dict(zip(("median", "percent_98", "largest"), sizes.tolist(), strict=True))
    return found


def tell(record: Record) -> str:
    """Errors at each amplitude."""
    return as_text({f"at {each['part']} of the force": each for each in record["summary"]})
