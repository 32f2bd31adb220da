"""Scenes that ship: the standard strip and the contact problems of Brink (2015), ready to run.

Every scene is a TOML file, and a function here with the same name.  ``named("receding")`` is the
scene ``receding()``.  ``values_of("receding")`` are its values by dotted key, which may be changed
before a scene is made of them.  On the command line: ``jbeamshell scenes`` and ``jbeamshell run
receding``.

References
----------
Brink, A. R. (2015). Modeling complex contact phenomena with nonlinear beamshells. Dissertation,
    The University of Akron.
"""

from __future__ import annotations

import difflib
import inspect
import os
from pathlib import Path
from typing import Any

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.common.files import as_path
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.toml import read_values, scene_from_values


def standard() -> Scene:
    """The standard strip: a thin bar on a rough base, pulled to and fro at its end.

    It is ``Scene()`` under an even traction, as the dissertation's finite elements are: held at
    X = 0, two cycles of the end force (after chapter III).  Units are any
    consistent ones.  Gross slip begins at F = 2.
    """
    return named("standard")


def calibrated() -> Scene:
    """The standard strip with constants fitted to finite elements, for thick strips too.

    One kappa_s, one alpha and m = 8 serve all heights, so the height may be set freely.  With
    nu = .3 the dissipation is within 11 % (rms) of finite elements for eta = .03 to .4 and A from
    .3 up, and within 2 % where it exceeds .3 of the cubic law
    (`calibration/studies/fit_universal.py`).
    """
    return named("calibrated")


def bimaterial() -> Scene:
    """Two layers, squeezed evenly on both faces: the strip bends towards the stiffer one.

    Layers of 1 mm with E = 2090 and 209000 MPa in plane stress, no foundation (section 4.7.1).
    Its ``curvature`` and ``tip_deflection`` have a closed form, `Laminate.uniform_squeeze`.
    Millimetres, newtons, megapascals.
    """
    return named("bimaterial")


def squeezed() -> Scene:
    """A strip squeezed on both faces over its middle: the squeeze ends soon after the load.

    Steel of 200 x 2 mm under 100 MPa over 100 mm, half of it modelled, no foundation (section
    4.7.2).  Beyond the load the squeeze decays over about 0.23 H.  Millimetres, newtons,
    megapascals.
    """
    return named("squeezed")


def receding() -> Scene:
    """A strip pressed onto a frictionless base over its middle: beyond the load it lifts off.

    The strip of `squeezed` with a rigid base in place of the pressure from below (section 4.7.3).
    ``contact_end`` lies just beyond X = 50, and is the same under any pressure.  Millimetres,
    newtons, megapascals.
    """
    return named("receding")


def receding_rough() -> Scene:
    """The receding strip on a rough base, its free end pulled to and fro.

    The strip is clamped over its middle half, as if by a bolt.  It slips outside of the clamp, and
    slip moves the end of the contact.  Millimetres, newtons, megapascals.
    """
    return named("receding-rough")


def receding_421() -> Scene:
    """Receding contact by the earlier theory, whose squeeze strain is assumed.

    The squeeze strain is psi = -(F_N + R)/(2E) instead of a field with its own balance (section
    4.2, example 4.2.1).  The strip is 10 x 0.1 in, half of it modelled; its pressure falls to zero
    between X = 2.405 and 2.5 in.  Inches, pounds, pounds per square inch.
    """
    return named("receding-421")


def point_load() -> Scene:
    """A strip on a frictionless base under a point load: it lifts off within its height.

    The load is a patch of 1/40 of the height h = 2 at the middle, X = 0; half of the strip is
    modelled.  Elasticity ends the contact 0.855 h from the load.  Millimetres, newtons,
    megapascals.
    """
    return named("point-load")


def advancing() -> Scene:
    """A curved strip, its ends up, flattened onto a frictionless base: the contact advances.

    The pressure grows in 20 steps (figure 2.5a), and ``contact_end`` with it.  Millimetres,
    newtons, megapascals.
    """
    return named("advancing")


def block() -> Scene:
    """A block as long as it is high, pressed over its whole top face: the contact stays.

    The base is frictionless (figure 2.5b), and R is uniform and equal to the pressure.
    Millimetres, newtons, megapascals.
    """
    return named("block")


def double_shear() -> Scene:
    """Half of a lap joint in double shear: a strip on an inner member, slipping at both ends.

    The inner member lies on the symmetry plane and is held at X = 0; pressure is uniform.  Units
    are any consistent ones.  Gross slip begins at F = 2.
    """
    return named("double-shear")


def single_lap() -> Scene:
    """A single lap joint: two members pressed together as if by a bolt, which bend and lift off.

    The lower member is clamped at X = 0, the upper one pulled and kept level at X = L.  Units are
    any consistent ones.  Gross slip begins near F = 2.
    """
    return named("single-lap")


_FUNCTIONS = {
    function.__name__.replace("_", "-"): function
    for function in (
        standard,
        calibrated,
        bimaterial,
        squeezed,
        receding,
        receding_rough,
        receding_421,
        point_load,
        advancing,
        block,
        double_shear,
        single_lap,
    )
}
NAMES = tuple(_FUNCTIONS)


def named(name: str) -> Scene:
    """Scene of a name; raises `InputError` with the nearest name if there is none."""
    return scene_from_values(values_of(name))


def values_of(name: str) -> dict[str, Any]:
    """Values of the scene of a name by dotted key; other keys have their defaults."""
    return read_values(_file(name))


def values_from(word: str, folder: Path = Path()) -> dict[str, Any]:
    """Values by dotted key of the scene of a name, or of a TOML file in a folder."""
    path = as_path(word)
    is_file = path.suffix == ".toml" or path.name != word or os.path.isfile(folder / path)
    return read_values(folder / path) if is_file else values_of(word)


def summary(name: str) -> str:
    """One line that describes the scene of a name."""
    _file(name)
    return inspect.getdoc(_FUNCTIONS[name]).splitlines()[0]  # type: ignore[union-attr]


def _file(name: str) -> Path:
    require("scene", name, isinstance(name, str), "give a name")
    if name not in NAMES:
        matches = difflib.get_close_matches(name, NAMES, 1)
        hint = f"did you mean {matches[0]!r}?" if matches else f"scenes are {', '.join(NAMES)}"
        raise InputError(
            f"unknown scene {name!r}: {hint} (`jbeamshell scenes` lists them; a file of your own "
            "ends in .toml)"
        )
    return Path(__file__).parent / "shipped" / f"{name}.toml"
