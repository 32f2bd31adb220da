"""The order of the folders, no circle of imports, and the homes of the heavy libraries.

All imports count: those at the top of a module, inside its functions and under TYPE_CHECKING.  The
face, `jbeamshell/__init__.pyi`, is a stub and imports nothing.
"""

import ast
from pathlib import Path

import jbeamshell

PACKAGE = Path(jbeamshell.__file__).parent
# A folder may import itself and the folders before it.
ORDER = [
    "common",
    "numerics",
    "mechanics",
    "measured",
    "scene",
    "laws",
    "reference",
    "plotting",
    "history",
    "contact_line",
    "bodies",
    "load_steps",
    "solving",
    "sweeping",
    "dynamics",
    "identify",
    "explorer",
    "cli",
]
# Imports that point up all the same: (importer, imported), with the reason beside it.
EXCEPTIONS: set[tuple[str, str]] = set()
ROOT = {"__init__.py", "__init__.pyi", "__main__.py", "py.typed"}
HOMES = {
    "diffrax": "dynamics/",
    "matplotlib": "plotting/",
    "pint": "measured/columns.py",
    "distributed": "cli/sweep.py",
    "panel": "explorer/",
    "bokeh": "explorer/",
    "tqdm": "common/progress.py",
    "xarray": ("common/frames.py", "plotting/sweeps.py", "sweeping/"),
    "lazy_loader": ("__init__.py", "dynamics/__init__.py", "scene/__init__.py"),
}


def name_of(file):
    """Dotted name of a file below the package; a folder's for its `__init__.py`."""
    parts = file.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_names(source):
    """Dotted names that a module imports, wherever it does."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import: write the whole name"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def inside(name, modules):
    """Module of the package that a dotted name belongs to; None outside the package."""
    package, *rest = name.split(".")
    if package != "jbeamshell":
        return None
    while ".".join(rest) not in modules:  # "" is the package itself
        rest.pop()
    return ".".join(rest)


def circles(graph):
    """Sets of nodes that reach each other: the strongly connected components with an edge."""

    def reached(start):
        found, ahead = set(), [start]
        while ahead:
            fresh = set(graph[ahead.pop()]) - found
            found |= fresh
            ahead += fresh
        return found

    reach = {node: reached(node) for node in graph}
    return {
        frozenset(other for other in reach[node] if node in reach[other])
        for node in graph
        if node in reach[node]
    }


def points_up(importer, imported):
    """True if a module imports a folder above its own; the package's root is above all."""
    above = [*ORDER, ""]
    return above.index(importer.split(".")[0]) < above.index(imported.split(".")[0])


FILES = {name_of(file): file for file in PACKAGE.rglob("*.py")}
NAMES = {name: set(imported_names(file.read_text("utf-8"))) for name, file in FILES.items()}
GRAPH = {
    importer: {inside(name, FILES) for name in names} - {None} for importer, names in NAMES.items()
}


def test_the_root_holds_the_face_and_folders_alone():
    entries = {path.name for path in PACKAGE.iterdir()} - {"__pycache__"}
    assert entries == ROOT | set(ORDER)


def test_no_module_imports_a_folder_above_its_own():
    up = {
        (importer, imported)
        for importer, imports in GRAPH.items()
        if importer not in ("", "__main__")
        for imported in imports
        if points_up(importer, imported)
    }
    assert up == EXCEPTIONS


def test_no_modules_import_each_other():
    assert circles(GRAPH) == set()


def test_heavy_libraries_stay_at_home():
    for library, home in HOMES.items():
        users = {
            FILES[module].relative_to(PACKAGE).as_posix()
            for module, names in NAMES.items()
            if library in {name.split(".")[0] for name in names}
        }
        assert users, library
        assert all(user.startswith(home) for user in users), users


def test_no_module_takes_what_jax_does_not_publish():
    private = {name for names in NAMES.values() for name in names if name.startswith("jax._src")}
    assert not private


def test_the_package_needs_nothing_of_its_clone():
    tops = {name.split(".")[0] for names in NAMES.values() for name in names}
    assert not tops & {"calibration", "verification", "tests"}
