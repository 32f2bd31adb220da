"""Time of a cycle at its error, beside other programs for it.

An error stands beside every time: against the same model on 321 nodes in 40 steps per half cycle,
and against finite elements.  The parts are

- one: a run of the standard strip by all variants and rivals, interleaved;
- gradient: gradients in four parameters beside a run;
- start: fresh processes, with and without compiled programs at hand.
"""

from typing import Any

from verification.benchmarks.speeds import gradients, single, starting

PARTS = {"one": single.one, "gradient": gradients.gradient, "start": starting.start}


def tell(record: dict[str, Any]) -> str:
    """Rows of all parts."""
    lines = []
    for name in PARTS:
        lines.append(name)
        for row in record[name]["rows"]:
            words = (
                f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
                for key, value in row.items()
                if key != "returns"
            )
            lines.append("    " + ", ".join(words))
    return "\n".join(lines)
