"""Imports inside the package point downwards, and heavy libraries stay where they belong."""

import ast
from pathlib import Path

import pytest

import jbeamshell

PACKAGE = Path(jbeamshell.__file__).parent
# fmt: off
UPWARDS = [
    "errors", "runtime", "native", "files", "kinematics", "rungs", "closed_form", "elasticity",
    "energy",
    "sections", "laminate", "friction", "contact", "grid", "parts", "scene", "scenes",
    "block_tridiagonal", "newton", "equilibrium", "stiffness", "bands", "turning", "patterns",
    "cycles", "trust", "history", "stepping", "masing", "quasistatic", "histories",
    "response", "sweeping", "advice", "measured", "example", "identify", "dynamics", "plotting",
    "output", "terminal", "fit_command", "sweep_command", "ringdown_command", "__init__",
    "__main__",
]
INSIDE = {
    "measured": [
        "tables", "columns", "containers", "reversals", "recordings", "loops", "splitting",
        "steady", "curves", "curve_files", "__init__",
    ],
    "identify": [
        "observations", "parameters", "experiment", "problem", "search", "uncertainty", "results",
        "likelihood", "fitting", "plan", "__init__",
    ],
    "sweeping": ["lanes", "runner", "store", "job", "results", "processes", "worker", "__init__"],
    "dynamics": [
        "sliding", "excitation", "riders", "inertia", "equations", "modes", "motion", "banded",
        "stride", "midpoint", "stepsize", "transient", "ringdown", "joint", "structure", "modal",
        "shaking", "study", "__init__",
    ],
    "plotting": [
        "style", "steps", "failures", "motions", "paths", "contacts", "fits", "ladder", "speed",
        "discretisations", "methods", "sweeps", "__init__",
    ],
}
# fmt: on
ONLY = {
    "diffrax": "dynamics",
    "lineax": "dynamics",
    "optimistix": "dynamics",
    "matplotlib": "plotting",
    "jaxopt": "identify/search.py",
    "optax": "identify/search.py",
    "pint": "measured/columns.py",
}


def files(module):
    """The files of a module, or of a package."""
    file = PACKAGE / f"{module}.py"
    return [file] if file.exists() else sorted((PACKAGE / module).glob("*.py"))


def imports(file):
    """What a file imports: (dotted name, whether at its top) each."""
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
    for room, inside in INSIDE.items():
        assert sorted(inside) == sorted(path.stem for path in files(room))


@pytest.mark.parametrize("module", UPWARDS)
def test_imports_point_downwards(module):
    below = UPWARDS[: UPWARDS.index(module)]
    for file in files(module):
        for name, at_top in imports(file):
            package, *rest = name.split(".")
            if package == "jbeamshell" and at_top and rest[0] != module:
                assert (rest[0] if rest[0] in UPWARDS else "__init__") in below, (file, name)
            where = file.relative_to(PACKAGE).as_posix()
            assert where.startswith(ONLY.get(package, "")), name


@pytest.mark.parametrize(("room", "module"), [(r, m) for r, rest in INSIDE.items() for m in rest])
def test_imports_inside_a_package_point_downwards(room, module):
    below = INSIDE[room][: INSIDE[room].index(module)]
    for name, at_top in imports(PACKAGE / room / f"{module}.py"):
        package, *rest = name.split(".")
        if package == "jbeamshell" and rest[0] == room and at_top:
            assert rest[1] in below, name


@pytest.mark.parametrize(
    ("name", "at_top", "file"),
    [
        ("jbeamshell.grid", True, "equilibrium.py"),
        ("jbeamshell.plotting", False, "history.py"),
        ("matplotlib.pyplot", True, "plotting/style.py"),
        ("jaxopt", True, "identify/search.py"),
        ("pint", False, "measured/columns.py"),
    ],
)
def test_what_the_order_rests_on_is_seen(name, at_top, file):
    assert (name, at_top) in imports(PACKAGE / file)
