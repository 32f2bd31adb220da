"""Imports inside the package point downwards, and heavy libraries stay where they belong."""

import ast
from pathlib import Path

import pytest

import jbeamshell

PACKAGE = Path(jbeamshell.__file__).parent
# fmt: off
UPWARDS = [
    "errors", "files", "kinematics", "closed_form", "elasticity", "energy", "laminate", "friction",
    "contact", "grid", "parts", "scene", "scenes", "block_tridiagonal", "newton", "equilibrium",
    "cycles", "history", "quasistatic", "tables", "columns", "containers", "reversals",
    "recordings", "loops", "splitting", "steady", "example", "measurements", "curve_files",
    "observations", "parameters", "experiment", "problem", "search", "uncertainty", "results",
    "likelihood", "identify", "plan", "plotting", "fit_pictures", "output", "terminal",
    "fit_command", "__init__", "__main__",
]
# Inside a package of its own.
PLOTTING = ["style", "steps", "paths", "contacts", "fits", "__init__"]
# fmt: on
ONLY = {"matplotlib": "plotting", "jaxopt": "search", "optax": "search", "pint": "columns"}


def files(module):
    """The files of a module, or of a package."""
    file = PACKAGE / f"{module}.py"
    return [file] if file.exists() else sorted((PACKAGE / module).glob("*.py"))


def imports(*files):
    """What files import: (dotted name, whether at their top) each."""
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                yield from ((alias.name, node.col_offset == 0) for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{file}: relative import"
                yield from ((f"{node.module}.{a.name}", node.col_offset == 0) for a in node.names)


def test_every_module_has_its_place():
    rooms = [path.stem for path in PACKAGE.glob("*.py")]
    rooms += [path.parent.name for path in PACKAGE.glob("*/__init__.py")]
    assert sorted(UPWARDS) == sorted(rooms)


@pytest.mark.parametrize("module", UPWARDS)
def test_imports_point_downwards(module):
    below = UPWARDS[: UPWARDS.index(module)]
    for name, at_top in imports(*files(module)):
        package, *rest = name.split(".")
        if package == "jbeamshell" and at_top and rest[0] != module:
            assert (rest[0] if rest[0] in UPWARDS else "__init__") in below, name
        assert ONLY.get(package, module) == module, name


@pytest.mark.parametrize("module", PLOTTING)
def test_imports_inside_plotting_point_downwards(module):
    below = PLOTTING[: PLOTTING.index(module)]
    for name, _ in imports(PACKAGE / "plotting" / f"{module}.py"):
        if name.startswith("jbeamshell.plotting."):
            assert name.split(".")[2] in below, name


def test_what_the_order_rests_on_is_seen():
    assert ("jbeamshell.grid", True) in imports(*files("equilibrium"))
    assert ("jbeamshell.plotting", False) in imports(*files("history"))
    assert ("matplotlib.pyplot", True) in imports(*files("plotting"))
    assert ("jaxopt", True) in imports(*files("search"))
    assert ("optax", True) in imports(*files("search"))
    assert ("pint", False) in imports(*files("columns"))
