"""Tables made from the recorded figures in calibration and verification."""

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from verification.campaign import chosen, counts, read
from verification.outcomes import OUTCOMES, outcome

Rows = Iterable[Sequence[Any]]
HEIGHTS = (0.01, 0.0511, 0.1126, 0.2358, 0.4)
LOADS = (0.3247, 0.7855, 1.6)
NAMES = {  # of programs in the record of the speed
    "dissipation": "jbeamshell, dissipation alone",
    "loop": "jbeamshell, loop",
    "exact kinematics": "jbeamshell, exact kinematics",
    "with lift": "jbeamshell, contact may open",
    "m = 16": "jbeamshell, smooth friction",
    "History": "jbeamshell, whole history",
    "patterns in NumPy": "guessed slip patterns in NumPy",
    "Iwan's network": "Iwan's network, fitted before",
}


def tables(root: Path) -> dict[str, str]:
    """Included pages by their file names."""
    verification, studies = root / "verification", root / "calibration" / "studies"
    benchmarks = verification / "benchmarks"
    speed = _read(benchmarks / "speed.json")
    return {
        "table_single.md": single(speed),
        "table_sweeps.md": sweeps(_read(benchmarks / "sweeps.json")),
        "table_gradients.md": gradients(speed),
        "table_starting.md": starting(speed),
        "table_condensed.md": condensed(_read(benchmarks / "condensed.json")),
        "table_peer.md": peer(_read(benchmarks / "condensed.json")["peer"]),
        "table_entries.md": entries(_read(root / "jbeamshell" / "scene" / "section_errors.json")),
        "table_sections.md": sections(_read(benchmarks / "sections.json")),
        "table_identification.md": identification(_read(benchmarks / "identification.json")),
        "table_motion.md": motion(_read(benchmarks / "dynamics.json")),
        "table_laws.md": laws(_read(studies / "laws_of_a_strip.json")),
        "table_squeeze.md": squeeze(_read(verification / "squeezed_sections.json")),
        "table_plain.md": plain_calls(_read(verification / "plain_random.json")),
        "table_random.md": random_strips(_read(verification / "failure_map.json")),
        "table_derivatives.md": derivatives(_read(verification / "gradients.json")),
        "table_smooth_slopes.md": smooth_slopes(_read(verification / "smooth_slopes.json")),
        "table_campaign.md": campaign(read()),
        "table_defaults.md": defaults(read()),
        "table_balance.md": balance(_read(verification / "balance_in_time.json")),
    }


def single(record: dict) -> str:
    """Cost and error of one cycle by several programs."""
    rows = (
        (NAMES.get(what := row["what"].split(",")[0], what), row["steps"], time(row["median_us"]),
         percent(row["error"]), percent(row["error_to_elements"]), row["returns"].split(";")[0])
        for row in record["one"]["rows"]
    )  # fmt: skip
    heads = ("what", "steps per half cycle", "time", "error of D", "to elements", "returns")
    return table(heads, rows) + machine(record["about"]["one"])


def plain_calls(record: dict) -> str:
    """Plain calls of random scenes beside a fine grid, by kind."""
    kept = {name: part["summary"] for name, part in record.items() if "summary" in part}
    whole = ("scenes", "wrong", "wrong and not doubted", "doubted in vain")
    rows = [
        (name, *(part[key] for key in whole),
         percent(part["D, 50 %"] / 100.0), percent(part["D, 95 %"] / 100.0))
        for name, part in kept.items()
    ]  # fmt: skip
    total = [sum(part[key] for part in kept.values()) for key in whole]
    heads = ("scenes", "number", "off by 2 % and more", "of these undoubted", "doubted in vain",
             "error of D, median", "95 % below")  # fmt: skip
    return table(heads, [*rows, ("all", *total, "", "")]) + machine(record["about"])


def smooth_slopes(record: dict) -> str:
    """Errors of D and of its slopes over the number of nodes."""
    rows = [
        (name, *(percent(row[key] / 100.0) for key in
                 ("D_largest_percent", "slope_median_percent", "slope_largest_percent")))
        for name, row in record["summary"].items()
    ]  # fmt: skip
    heads = ("read on", "error of D, largest", "of slopes, median", "of slopes, largest")
    return table(heads, rows) + machine(record["about"])


def sweeps(record: dict) -> str:
    """Strips a second of sweeps of plane elasticity, and their errors."""
    kinds = {"grid": "heights x loads", "own": "each strip its own height, material and load"}
    rows = [
        (entry, words, f"{row['nodes']:d}", f"{row['lanes_per_s']:,.0f}",
         percent(row["median_error"]), percent(row["worst_error_above_a_thousandth"]))
        for entry in ("member", "traction")
        for words, row in ((words, record[entry][kind]) for kind, words in kinds.items())
    ]  # fmt: skip
    heads = ("`load.entry`", "strips", "nodes", "strips a second", "error, median",
             "worst where D is above a thousandth of the bar's")  # fmt: skip
    return table(heads, rows) + machine(record["about"])


def gradients(record: dict) -> str:
    """Cost of derivatives over that of the run."""
    rows = [
        (
            row["what"],
            time(row["median_us"]),
            f"{row['median_runs']:.1f}",
            f"{row['compile_s']:.0f} s",
        )
        for row in record["gradient"]["rows"]
    ]
    return table(("derivative by 4 numbers", "time", "runs", "compiled in"), rows) + machine(
        record["about"]["gradient"]
    )


def derivatives(record: dict) -> str:
    """Verdicts on derivatives by the kind of scene."""
    kinds = ("right", "kink", "jump", "undefined", "wrong")
    rows = [
        (
            name,
            len(kind["numbers"]),
            len(kind["figures"]),
            *(kind["counts"].get(k, 0) for k in kinds),
        )
        for name, kind in record.items()
        if name != "about"
    ]
    return table(("scene", "numbers", "figures", *kinds), rows)


def starting(record: dict) -> str:
    """Processor time until the first result."""
    rows = [
        (row["what"], f"{row['cold_cpu_s']:.1f} s", f"{row['warm_cpu_s']:.1f} s")
        for row in record["start"]["rows"]
    ]
    heads = ("processor time of a new process", "nothing compiled yet", "compiled programs kept")
    return table(heads, rows) + machine(record["about"]["start"])


def condensed(record: dict) -> str:
    """Error of plane elasticity over its nodes, and its cost."""
    times = {row["nodes"]: row for row in record["peer"]["ours"]}
    rows = [
        (row["nodes"], percent(row["above_tenth"]), percent(row["above_ten_thousandth"]),
         time(times[row["nodes"]]["kept_us"]), time(times[row["nodes"]]["built_us"]))
        for row in record["error"]
    ]  # fmt: skip
    heads = ("contact nodes", "largest error of D where D exceeds .1 of the bar's",
             "1e-4 of the bar's", "cycles, body kept", "cycles, new body")  # fmt: skip
    return table(heads, rows) + machine(record["about"])


def peer(record: dict) -> str:
    """Time at equal error, beside condensed finite elements in load steps."""
    rows = []
    for row in record["at_equal_error"]:
        for cost, words in (("kept_us", "prepared once"), ("built_us", "from nothing")):
            ours, theirs = row["ours"][cost], row["theirs"][cost]
            rows.append((percent(row["error"]), words, time(ours[cost]), time(theirs[cost]),
                         f"{row['times'][cost]:,.0f}"))  # fmt: skip
    heads = ("error of D up to", "cycle", "jbeamshell, plane", "condensed elements", "times faster")
    return table(heads, rows)


def sections(record: dict) -> str:
    """Dissipation of each section over that of finite elements."""
    cells = {(cell["eta"], cell["A"]): cell for cell in record["cells"]}
    rows = [
        (
            eta,
            load,
            f"{load / eta:.1f}",
            *(f"{cells[eta, load][section]:.3g}" for section in record["sections"]),
        )
        for eta in HEIGHTS
        for load in LOADS
    ]
    names = (f"`{section}`" for section in record["sections"])
    heads = ("height ratio", "A", "A over height ratio", *names)
    return table(heads, rows)


def entries(record: dict) -> str:
    """Slip length from which on each section is near plane elasticity, by entry of the force."""

    def reach(curve: dict, level: float) -> str:
        within = np.abs(curve["typical"]) <= level
        first = within.size - int(np.argmin(within[::-1])) if not within.all() else 0
        return f"{curve['slip_over_H'][first]:.2g} H" if first < within.size else "never"

    names = list(record["even"])
    sections = list(record["even"][names[0]])
    rows = [
        (
            f"`{section}`",
            *(
                ", ".join(reach(record["even"][name][section], level) for level in (0.05, 0.01))
                for name in names
            ),
        )
        for section in sections
    ]
    return table(("section: 5 %, 1 %", *(f"`{name}`" for name in names)), rows)


def identification(record: dict) -> str:
    """Cost of a fit of four parameters to five loops."""
    rows = [
        (name, method, found["model_runs"], f"{found['wall_s']:.1f} s")
        for name, methods in record["scenes"].items()
        for method, found in methods.items()
        if "model_runs" in found
    ]
    return table(("model", "search", "runs of the model", "time, compiled"), rows) + machine(
        record["about"]
    )


def motion(record: dict) -> str:
    """Cost and error of time steps."""
    rows = [
        (row["steps"], f"{row['seconds']:.2f} s", percent(row["error"])) for row in record["steps"]
    ]
    return table(("time steps", "time", "error of the motion"), rows)


def laws(record: dict) -> str:
    """Error of the dissipation by laws of a joint fitted to a strip."""
    names = list(next(iter(record["heights"].values()))["models"])
    rows = []
    for name in names:
        errors = [height["models"][name]["error"] for height in record["heights"].values()]
        cells = (
            f"{percent(median(map(abs, row)), 2)}, {percent(max(map(abs, row)), 2)}"
            for row in errors
        )
        rows.append((f"`{name}`", *cells))
    heads = ("D: median, worst", *(f"height ratio {height}" for height in record["heights"]))
    return table(heads, rows)


def squeeze(record: dict) -> str:
    """Receding contact and Filon's tension by the beamshell and by plane elasticity."""
    exact = record["finite_elements"]
    finest = {row["section"]: row for row in record["sections"]}
    rows = [
        (f"`{name}`", f"{row['receding']['contact_end_mm']:.3f}",
         f"{row['receding']['reaction_max_MPa']:.2f}", f"{row['receding']['lift_slope']:.4g}",
         f"{row['squeezed']['tension_MPa']:.2f}")
        for name, row in finest.items()
    ]  # fmt: skip
    rows.append(
        ("finite elements", exact["contact_end_mm"], exact["reaction_max_MPa"],
         f"{exact['lift_slope']:.4g}", f"{exact['tension_MPa']:.2f}")
    )  # fmt: skip
    heads = ("section", "contact ends beyond the load, mm", "largest reaction, MPa",
             "slope of the lifted end", "Filon's tension, MPa")  # fmt: skip
    return table(heads, rows)


def random_strips(record: dict) -> str:
    """Outcomes of random strips in load steps."""
    kinds = {"2,000 strips": "scenes", "300 fresh strips": "fresh scenes"}
    found = {words: Counter(map(outcome, record[key])) for words, key in kinds.items()}
    return outcomes(found)


def campaign(rows: list[dict]) -> str:
    """Outcomes of random scenes of all kinds, and of fresh ones of another seed."""
    first, fresh = dict.fromkeys(row["seed"] for row in rows)
    begun = [row for row in rows if row["seed"] == first]
    kinds = dict.fromkeys(row["kind"] for row in begun)
    found = {kind: counts(row for row in begun if row["kind"] == kind) for kind in kinds}
    found["all"] = counts(begun)
    found["all, fresh"] = counts(row for row in rows if row["seed"] == fresh)
    return outcomes(found)


def outcomes(found: dict[str, Counter]) -> str:
    """Table of counts, without columns that hold none."""
    shown = [name for name in OUTCOMES if any(counts[name] for counts in found.values())]
    rows = [
        (name, sum(counts.values()), *(counts[word] or "" for word in shown))
        for name, counts in found.items()
    ]
    return table(("scenes", "number", *shown), rows)


def defaults(rows: list[dict]) -> str:
    """Errors of the settings that scenes chose, by kind."""
    found, lines = chosen(rows), []
    for kind in (*dict.fromkeys(run.kind for run in found), "all"):
        runs = [run for run in found if kind in (run.kind, "all")]
        errors = [run.error for run in runs]
        within = sum(run.error <= 0.005 for run in runs)
        doubted = sum(run.error > 0.005 and run.doubted for run in runs)
        beyond = max((run.error for run in runs if not run.doubted), default=0.0)
        lines.append(
            (kind, len(runs), within, doubted, len(runs) - within - doubted,
             percent(median(errors)), percent(beyond))
        )  # fmt: skip
    heads = ("scenes", "number", "within .5 % in D and loop", "beyond, doubted",
             "beyond, undoubted", "median error", "largest undoubted")  # fmt: skip
    return table(heads, lines)


def balance(record: dict) -> str:
    """Difference of harmonic balance and time integration, below, at and above the resonance."""
    columns = zip(*(row["error"] for row in record["rows"]), strict=True)
    lines = [
        (f"{beside:g}", len(errors), percent(median(errors)), percent(max(errors)))
        for beside, errors in zip(record["beside"], columns, strict=True)
    ]
    heads = ("frequency over the first natural one", "structures", "median", "largest")
    return table(heads, lines)


def table(heads: Sequence[str], rows: Rows) -> str:
    """Table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines) + "\n"


def machine(about: dict) -> str:
    """Line that says where and when figures were taken."""
    words = [about.get("cpu"), about["machine"], f"jax {about['jax']}", about.get("date")]
    return f"\n*{', '.join(word for word in words if word)}*\n"


def time(microseconds: float) -> str:
    """Time with a unit that suits it."""
    for unit, size in (("s", 1e6), ("ms", 1e3)):
        if microseconds >= size:
            return f"{microseconds / size:.3g} {unit}"
    return f"{microseconds:.3g} µs"


def percent(share: float, digits: int = 2) -> str:
    """Share in per cent; two digits, or as many as asked."""
    shown = 100.0 * share
    return f"{shown:.0f} %" if abs(shown) >= 100.0 else f"{shown:.{digits}g} %"


def _read(path: Path) -> dict:
    return json.loads(path.read_text("utf-8"))
