"""Comparisons of jbeamshell with closed forms, other programs and measurements.

Each `Case` of a family's file holds one source's numbers beside ours.  From the top of the
repository,

    python -m calibration.comparisons [NAME ...] [--data FOLDER]

computes the cases, all or those whose names hold a word, and prints a table.  All cases together
write results.json and table.md beside this file.  A folder with the files that sources.md lists
also takes the measurements again, and renews measured.json.
"""

from calibration.comparisons.case import Case as Case


def all_cases() -> tuple[Case, ...]:
    """All comparisons, family by family."""
    from calibration.comparisons import closed_forms, finite_elements, measured, programs

    return (*closed_forms.CASES, *finite_elements.CASES, *programs.CASES, *measured.CASES)
