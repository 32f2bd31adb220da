"""Campaign of random scenes of all kinds: true errors, doubts, and whether failures are silent.

Solves every scene of verification/random_scenes.py as it is and against two references: the same
model on a fine mesh with twice as many load steps, and another solver where one applies (load steps
against events on the contact line).  A reference by another solver that disagrees and doubts itself
is refined, and left out if it still does.

Where a kind of scene leaves the section open it is the beamshell, and the tolerance is .5 % to its
own fine mesh; verification/plain_call.py has plain calls beside elements and plane elasticity.

A run is wrong if its dissipation is off by more than 2 % from a reference; its failure is silent if
it neither raised nor doubted itself.  campaign.jsonl beside this file gets a row after each scene,
and a second run goes on where the first was cut.  again=true solves the scenes of the record once
more, and keeps the errors of those whose result is the same; kind, share and seed choose scenes.
"""

import json
import time
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from tqdm import tqdm

import jbeamshell as jb
from calibration.charts import OFF
from calibration.provenance import provenance
from calibration.strip import changed
from jbeamshell.common.files import write_text
from jbeamshell.history.reliability import TOLERANCE
from verification.outcomes import OUTCOMES
from verification.random_scenes import KINDS, Kind, Values

RECORD = Path(__file__).with_suffix(".jsonl")
SEED = 22
MANY_NODES = 129  # from which on a fine mesh has half as many more elements, else twice as many
SAME = 1e-7  # relative change of a result that is the same
BEAMSHELL: Values = {"model.section": "squeeze"}
TO_ITSELF: Values = {"model.tolerance": 0.005}
OF_SECTION = "typically loses"  # a doubt about the section, to which no reference belongs
HATCHES = dict(zip(OUTCOMES, ("", "", "..", "//", "xx", "**", ""), strict=True))
MARKERS = {"right": "o", "right, but doubted": "s", "wrong, and says so": "^"}
SMALLEST, LARGEST = 1e-5, 10.0  # errors and estimates that are drawn
Row = dict[str, Any]


def drawn(kind: str, seed: int, number: int) -> Values:
    """Values of one scene of a kind."""
    random = np.random.default_rng([seed, zlib.crc32(kind.encode()), number])
    return KINDS[kind].make(random)


def finer(scene: jb.Scene) -> jb.Scene:
    """Scene with the same model on a fine mesh, and with more load steps."""
    its, scene = scene.plan, scene.pinned()
    elements = its.nodes - 1
    elements = 2 * elements if its.nodes <= MANY_NODES else elements + elements // 4 * 2
    if not its.on_contact_line:
        scene = scene.replace({"load.steps_per_half_cycle": 2 * its.steps})
    return scene.on_grid(elements + 1, 0.5 * its.end_size)


def made(values: Values) -> jb.Scene:
    """Scene of these values, which is the beamshell if they name no section."""
    return changed(jb.library.standard(), TO_ITSELF | BEAMSHELL | values)


def run(scene: jb.Scene) -> jb.History:
    """Result of a scene, without the doubt that other overhangs make another scene of it."""
    return jb.solve(scene, throw=False).but(overhung=None)


def solved(scene: jb.Scene) -> jb.History | None:
    """Result of a scene; None if it has none."""
    try:
        history = run(scene)
    except jb.InputError:
        return None
    return history if history.converged else None


def by_the_other(values: Values, scene: jb.Scene, other: Values) -> jb.Scene:
    """Scene with the same model and another solver; elastic sliders keep their last element."""
    its: Values = {"model.section": scene.plan.section}
    if scene.plan.on_contact_line and scene.contact.stick_stiffness is not None:
        its["end_size"] = scene.plan.end_size
    return changed(jb.library.standard(), TO_ITSELF | values | its | other)


def off(value: float, reference: float) -> float:
    """Relative error of a number; of one whose reference is zero, 0 if it is zero too, else 1."""
    return abs(value / reference - 1.0) if reference else float(value != 0.0)


def loop_error(found: jb.History, fine: jb.History) -> float:
    """Largest difference of two loops at the same loads, over their range."""
    driven = "force" if found.scene.load.control == "displacement" else "displacement"
    loop, best = (
        np.asarray(getattr(history, driven))[history.pressed + 1 :] for history in (found, fine)
    )
    same = best[:: -round(best.size / loop.size)][::-1]  # both end at the same load
    width = np.ptp(best)
    return float(np.max(np.abs(loop - same)) / width) if width else 0.0


def errors_of(values: Values, found: jb.History, other: Values | None) -> Row:
    """Errors of a run: of the dissipation against each reference, of the loop, of the stiffness."""
    scene, errors = found.scene, {}
    fine = solved(finer(scene))
    if fine is not None:
        errors["refined"] = off(float(found.dissipation), float(fine.dissipation))
        errors["loop"] = loop_error(found, fine)
        errors["stiffness"] = off(float(found.secant_stiffness), float(fine.secant_stiffness))
    if other is not None:
        unlike = by_the_other(values, scene, other)
        beside = solved(unlike)
        if beside is not None and beside.doubts and differs(found, beside):
            beside = solved(finer(unlike))
            beside = None if beside is None or beside.doubts else beside
        if beside is not None:
            errors["other"] = off(float(found.dissipation), float(beside.dissipation))
    return errors


def differs(found: jb.History, reference: jb.History) -> bool:
    """True if a dissipation is off by more than a doubt allows."""
    return off(float(found.dissipation), float(reference.dissipation)) > TOLERANCE


def outcome(row: Row) -> str:
    """Outcome of a run that was solved."""
    known = [row["errors"][name] for name in ("refined", "other") if name in row["errors"]]
    if not known:
        return "no reference"
    if max(known) > TOLERANCE:
        return "wrong, and says so" if row["doubts"] else "wrong, silently"
    return "right, but doubted" if row["doubts"] else "right"


def compared(values: Values, other: Values | None, before: Row | None = None) -> Row:
    """Outcome of one scene, its figures, errors, estimate, doubts and cost.

    Parameters
    ----------
    before : row of the same scene, whose errors are kept if its dissipation is the same
    """
    begun = time.process_time()
    try:
        scene = made(values)
        found = run(scene)
    except jb.InputError as error:
        return {"outcome": "fails, and says so", "reason": str(error)}
    if not found.converged:
        return {"outcome": "fails, and says so"}
    its = found.scene.plan
    row: Row = {
        "dissipation": float(found.dissipation),
        "bar_ratio": float(found.dissipation_ratio),
        "estimate": float(found.dissipation_error),
        "doubts": [doubt.partition("; ")[0] for doubt in found.doubts if OF_SECTION not in doubt],
        "section": its.section,
        "engine": its.engine,
        "kinematics": its.kinematics,
        "nodes": its.nodes,
        "chosen": scene.model.nodes == scene.load.steps_per_half_cycle == "auto",
    }
    if before is None or off(row["dissipation"], before.get("dissipation", 0.0)) > SAME:
        row["errors"] = errors_of(values, found, other)
        row["cpu_s"] = time.process_time() - begun
    else:
        row |= {name: before[name] for name in ("errors", "cpu_s")}
    return {"outcome": outcome(row)} | row


def _rounded(value: Any) -> Any:
    """Value with nine digits of its numbers; an estimate may be infinite."""
    if isinstance(value, float):
        return float(f"{value:.9g}")
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    return value


def read() -> list[Row]:
    """Rows of the record; the line before them tells its provenance."""
    if not RECORD.exists():
        return []
    return [json.loads(line) for line in RECORD.read_text(encoding="utf-8").splitlines()][1:]


def places(kinds: dict[str, Kind], share: float) -> Iterator[tuple[str, int]]:
    """Kinds and numbers of all scenes, in an order in which any beginning holds all kinds."""
    found = [
        ((number + 0.5) / kind.scenes, name, number)
        for name, kind in kinds.items()
        for number in range(max(1, round(share * kind.scenes)))
    ]
    for _, name, number in sorted(found):
        yield name, number


def measure(kind: str = "", share: float = 1.0, seed: int = SEED, again: bool = False) -> None:
    """Solve the scenes asked for, and add a row to the record after each.

    Parameters
    ----------
    kind : name of one kind of scenes; empty for all
    share : part of each kind's scenes
    again : True to solve recorded scenes once more
    """
    known = {(row["seed"], row["kind"], row["number"]): row for row in read()}

    def line(row: Row) -> str:
        return json.dumps(_rounded(row)) + "\n"

    def write() -> None:
        about = {"about": provenance(), "tolerance": TOLERANCE}
        write_text(RECORD, "".join(map(line, (about, *known.values()))))

    write()
    kinds = {name: KINDS[name] for name in ([kind] if kind else KINDS)}
    for name, number in tqdm(list(places(kinds, share)), disable=None):
        key = seed, name, number
        before = known.get(key)
        if before is not None and not again:
            continue
        found = compared(drawn(name, seed, number), KINDS[name].other, before)
        known[key] = dict(zip(("seed", "kind", "number"), key, strict=True)) | found
        with RECORD.open("a", encoding="utf-8") as record:
            record.write(line(known[key]))
    write()


def tell(record: Row) -> str:
    """Number of scenes of each outcome."""
    return str(counts(read()))


# --- charts ---------------------------------------------------------------------------------------


def counts(rows: Iterable[Row]) -> Counter[str]:
    """Number of scenes of each outcome."""
    return Counter(row["outcome"] for row in rows)


class Choice(NamedTuple):
    """Run whose grid and load steps were chosen.

    Attributes
    ----------
    kind : kind of its scene
    error : that of the dissipation or of the loop to a fine mesh, whichever is larger
    doubted : True if it doubts itself
    """

    kind: str
    error: float
    doubted: bool


def chosen(rows: Iterable[Row]) -> list[Choice]:
    """Runs whose grid and load steps were chosen, and that have a fine mesh beside them."""
    return [
        Choice(
            row["kind"], max(row["errors"]["refined"], row["errors"]["loop"]), any(row["doubts"])
        )
        for row in rows
        if row.get("chosen") and "refined" in row["errors"]
    ]


def draw_outcomes(rows: list[Row], axes: Axes) -> Axes:
    """Draw the part of each outcome, by kind of scene."""
    kinds = {
        kind: [r for r in rows if r["kind"] == kind] for kind in sorted({r["kind"] for r in rows})
    }
    names = [f"{kind} ({len(found)})" for kind, found in kinds.items()]
    left = np.zeros(len(kinds))
    for outcome, colour in OUTCOMES.items():
        parts = np.array([counts(found)[outcome] / len(found) for found in kinds.values()])
        if parts.any():
            look = {"color": colour, "edgecolor": "0.3", "hatch": HATCHES[outcome]}
            axes.barh(names, parts, left=left, label=outcome, linewidth=0.4, **look)
            left += parts
    axes.invert_yaxis()
    axes.set(xlabel="part of the scenes", xlim=(0.0, 1.0))
    axes.tick_params(axis="y", labelsize=7)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=7)
    return axes


def draw_estimates(rows: list[Row], axes: Axes) -> Axes:
    """Draw the error of the dissipation against the run's own estimate."""
    for outcome, marker in MARKERS.items():
        found = [r for r in rows if r["outcome"] == outcome and "refined" in r["errors"]]
        x, y = (
            np.clip(values, SMALLEST, LARGEST)
            for values in zip(
                *((r["estimate"], r["errors"]["refined"]) for r in found), strict=True
            )
        )
        look = {"color": OUTCOMES[outcome], "edgecolor": "0.3", "linewidth": 0.2}
        axes.scatter(x, y, 9.0, marker=marker, label=outcome, **look)
    for line in (axes.axhline, axes.axvline):
        line(TOLERANCE, color="0.5", linestyle="--", linewidth=0.8)
    axes.set(xscale="log", yscale="log", xlabel="estimate of the run  [1]", ylabel=OFF)
    axes.legend(fontsize=7)
    return axes
