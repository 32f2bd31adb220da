"""Sections of a strip by name, from a bar to plane elasticity.

| name | fields through the height |
|---|---|
| ``bar`` | v alone, Goodman's one-dimensional bar |
| ``shell`` | v, w and beta |
| ``squeeze`` | v, w, beta and psi, the beamshell with its squeeze strain |
| ``assumed`` | the same, with psi = -(F_N + R)/(2E) (Brink 2015, section 4.2) |
| ``plane`` | plane elasticity, see `jbeamshell.contact_line` |

The bar, and a strip that is held down (``contact.normal = held``), are without the lift w.
"""

from __future__ import annotations

_FIELDS = {"bar": ("v",), "shell": ("v", "w", "beta")}
_WHOLE = ("v", "w", "beta", "psi")
SECTIONS = ("bar", "shell", "squeeze", "assumed", "plane")


def fields_of(section: str, lifts: bool) -> tuple[str, ...]:
    """Fields of a section among v, w, beta and psi.

    Parameters
    ----------
    section : name of the section
    lifts : True if the strip may lift off

    Examples
    --------
    >>> fields_of("squeeze", lifts=False)
    ('v', 'beta', 'psi')
    """
    fields = _FIELDS.get(section, _WHOLE)
    return fields if lifts else tuple(field for field in fields if field != "w")
