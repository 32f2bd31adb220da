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
# fmt: on
ONLY = {"matplotlib": "plotting", "jaxopt": "search", "optax": "search", "pint": "columns"}


def imports(module):
    """What a module imports: (dotted name, whether at its top) each."""
    file = PACKAGE / f"{module}.py"
    file = file if file.exists() else PACKAGE / module / "__init__.py"
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.col_offset == 0) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            yield from ((f"{node.module}.{a.name}", node.col_offset == 0) for a in node.names)


def test_every_module_has_its_place():
    rooms = [path.stem for path in PACKAGE.glob("*.py")]
    rooms += [path.parent.name for path in PACKAGE.glob("*/__init__.py")]
    assert sorted(UPWARDS) == sorted(rooms)


@pytest.mark.parametrize("module", UPWARDS)
def test_imports_point_downwards(module):
    below = UPWARDS[: UPWARDS.index(module)]
    for name, at_top in imports(module):
        package, *rest = name.split(".")
        if package == "jbeamshell" and at_top:
            assert (rest[0] if rest[0] in UPWARDS else "__init__") in below, name
        assert ONLY.get(package, module) == module, name


def test_what_the_order_rests_on_is_seen():
    assert ("jbeamshell.grid", True) in imports("equilibrium")
    assert ("jbeamshell.plotting", False) in imports("history")
    assert ("jaxopt", True) in imports("search")
    assert ("optax", True) in imports("search")
    assert ("pint", False) in imports("columns")
