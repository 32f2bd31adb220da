"""Tables of results, for the terminal and for the page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibration.comparisons.case import Floats, Result, Source

KINDS = {
    "closed form": "Closed forms",
    "dissertation": "The dissertation",
    "finite elements": "Finite elements",
    "other program": "Other programs",
    "second-hand": "Second-hand numbers",
    "measured": "Measurements",
}
EXPLAINED = 0.01  # difference from which on it is explained


def as_text(results: Sequence[Result]) -> str:
    """Lines for the terminal: name, number of values, difference, bound and seconds."""
    width = max(len(result.case.name) for result in results)
    lines = [f"{'case':{width}}  values  difference    bound  seconds"]
    for result in results:
        mark = "" if result.within else "  OUTSIDE"
        lines.append(
            f"{result.case.name:{width}}  {result.theirs.size:6d}  "
            f"{percent(result.difference):>10}  {percent(result.case.bound):>7}  "
            f"{result.seconds:7.1f}{mark}"
        )
    return "\n".join([*lines, summary(results)])


def summary(results: Sequence[Result]) -> str:
    """Counts: comparisons, measured, held out, within their bounds; and the largest difference."""
    measured = [r for r in results if r.case.kind == "measured"]
    held = [r for r in measured if r.case.held_out >= 0.5]
    inside = sum(r.within for r in results)
    worst = max(results, key=lambda r: r.difference)
    return (
        f"{len(results)} comparisons, {len(measured)} of them with measurements, {len(held)} of "
        f"these with half of the data or more held out; {inside} within their bounds; the largest "
        f"difference is {percent(worst.difference)}: {worst.case.name}"
    )


def as_page(results: Sequence[Result]) -> str:
    """Tables for the page, one for each kind, with their sources below."""
    parts = [summary(results) + "."]
    for kind, title in KINDS.items():
        own = [result for result in results if result.case.kind == kind]
        if not own:
            continue
        parts.append(f"## {title}")
        rows = [
            "| case | what is compared | what decides | theirs | ours | difference | source |",
            "|---|---|---|---|---|---|---|",
        ]
        sources = list(dict.fromkeys(result.case.source for result in own))
        rows += [_row(result, sources.index(result.case.source) + 1) for result in own]
        parts.append("\n".join(rows))
        parts.append("\n".join(_source(i, source) for i, source in enumerate(sources, 1)))
    return "\n\n".join(parts) + "\n"


def _row(result: Result, number: int) -> str:
    case = result.case
    difference = percent(result.difference) + ("" if result.within else ", outside")
    notes = [case.compared]
    notes += [f"Fitted: {case.fitted}"] if case.fitted else []
    notes += [f"Set: {case.settings}"] if case.settings else []
    why = f": {case.explained}" if case.explained else ""
    cells = (
        case.name,
        ". ".join(notes),
        case.condition,
        _numbers(result.theirs),
        _numbers(result.ours),
        difference + why,
        f"{number}",
    )
    return "| " + " | ".join(cells) + " |"


def _source(number: int, source: Source) -> str:
    licence = source.licence[0].upper() + source.licence[1:]
    return f"{number}. {source.citation}. {licence}. {source.opened}".rstrip()


def _numbers(values: Floats) -> str:
    """One number, or the least and the largest of several."""
    if values.size == 1:
        return f"{values[0]:.5g}"
    return f"{values.size}: {np.min(values):.4g} to {np.max(values):.4g}"


def percent(part: float) -> str:
    """Part of one as per cent, of two digits."""
    return f"{100.0 * part:.2g} %"
