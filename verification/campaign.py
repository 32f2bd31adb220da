"""Campaign of random scenes of all kinds: true errors, doubts, and whether failures are silent.

    python calibration/campaign.py [--only KIND ...] [--share 1.0] [--seed 22] [--again]

solves every scene of calibration/random_scenes.py as it is and against two references: the same
model on a fine mesh with twice as many load steps, and another solver where one applies (load steps
against events on the contact line).  A reference by another solver that disagrees and doubts itself
is refined, and left out if it still does.

Where a kind of scene leaves the section open it is the beamshell, and the tolerance is .5 % to its
own fine mesh; calibration/plain_call.py has plain calls beside elements and plane elasticity.

A run is wrong if its dissipation is off by more than 2 % from a reference; its failure is silent if
it neither raised nor doubted itself.  campaign.jsonl beside this file gets a row after each scene,
and a second run goes on where the first was cut.  --again solves the scenes of the record once
more, and keeps the errors of those whose result is the same.
"""

import argparse
import json
import time
import warnings
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from provenance import provenance  # noqa: E402
from random_scenes import KINDS, Kind, Values  # noqa: E402
from strip import changed  # noqa: E402
from tqdm import tqdm  # noqa: E402

import jbeamshell as jb  # noqa: E402
from jbeamshell.common.files import write_text  # noqa: E402
from jbeamshell.history.reliability import TOLERANCE  # noqa: E402

RECORD = Path(__file__).parent / "campaign.jsonl"
SEED = 22
MANY_NODES = 129  # from which on a fine mesh has half as many more elements, else twice as many
SAME = 1e-7  # relative change of a result that is the same
DIGITS = 8  # of the numbers of the record
BEAMSHELL: Values = {"model.section": "squeeze"}
TO_ITSELF: Values = {"model.tolerance": 0.005}
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


def solved(scene: jb.Scene) -> jb.History | None:
    """Result of a scene; None if it has none."""
    try:
        history = jb.solve(scene, throw=False)
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
    if other is not None and not scene.plan.elastic:
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
        found = jb.solve(scene, throw=False)
    except jb.InputError as error:
        return {"outcome": "fails, and says so", "reason": str(error)}
    if not found.converged:
        return {"outcome": "fails, and says so"}
    its = found.scene.plan
    row: Row = {
        "dissipation": float(found.dissipation),
        "bar_ratio": float(found.dissipation_ratio),
        "estimate": float(found.dissipation_error),
        "doubts": [doubt.partition("; ")[0] for doubt in found.doubts],
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


def rounded(value: Any) -> Any:
    """Value with its numbers rounded, as the record has them."""
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, dict):
        return {key: rounded(each) for key, each in value.items()}
    return value


def read(path: Path = RECORD) -> list[Row]:
    """Rows of a record, the first of which tells its provenance."""
    if not path.exists():
        return [{"about": provenance(), "tolerance": TOLERANCE}]
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def places(kinds: dict[str, Kind], share: float) -> Iterator[tuple[str, int]]:
    """Kinds and numbers of all scenes, in an order in which any beginning holds all kinds."""
    found = [
        ((number + 0.5) / kind.scenes, name, number)
        for name, kind in kinds.items()
        for number in range(max(1, round(share * kind.scenes)))
    ]
    for _, name, number in sorted(found):
        yield name, number


def main() -> None:
    """Solve the scenes asked for, and add a row to the record after each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", default=list(KINDS), choices=list(KINDS))
    parser.add_argument("--share", type=float, default=1.0, help="part of each kind's scenes")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--again", action="store_true", help="solve recorded scenes once more")
    parser.add_argument("--record", type=Path, default=RECORD)
    asked = parser.parse_args()
    jb.configure()
    about, *rows = read(asked.record)
    known = {(row["seed"], row["kind"], row["number"]): row for row in rows}

    def line(row: Row) -> str:
        return json.dumps(rounded(row)) + "\n"

    def write() -> None:
        write_text(asked.record, "".join(map(line, (about, *known.values()))))

    write()
    warnings.simplefilter("ignore", jb.DoubtfulWarning)
    kinds = {name: KINDS[name] for name in asked.only}
    for name, number in tqdm(list(places(kinds, asked.share)), disable=None):
        key = asked.seed, name, number
        before = known.get(key)
        if before is not None and not asked.again:
            continue
        found = compared(drawn(name, asked.seed, number), KINDS[name].other, before)
        known[key] = dict(zip(("seed", "kind", "number"), key, strict=True)) | found
        with asked.record.open("a", encoding="utf-8") as record:
            record.write(line(known[key]))
    write()
    print(Counter(row["outcome"] for row in known.values()))


if __name__ == "__main__":
    main()
