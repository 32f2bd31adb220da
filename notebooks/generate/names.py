"""Public names of the package, as its faces list them."""

import ast
import importlib
import inspect
from pathlib import Path

import jbeamshell

PACKAGE = Path(jbeamshell.__file__).parent
FACES = {  # heading of the page of each face
    "jbeamshell": "jbeamshell: scenes, runs, sweeps",
    "jbeamshell.scene.library": "jb.library: scenes that ship",
    "jbeamshell.contact_line": "jb.contact_line: exact cycles on the contact line",
    "jbeamshell.measured": "jb.measured: recordings, loops, curves",
    "jbeamshell.identify": "jb.identify: fits and their uncertainty",
    "jbeamshell.dynamics": "jb.dynamics: ring-down, structures, export",
    "jbeamshell.laws": "jb.laws: joints of a few numbers",
    "jbeamshell.reference": "jb.reference: exact solutions",
    "jbeamshell.plotting": "jb.plotting: pictures",
}
EXTENSIONS = (  # what one's own laws, energies and readers build on, and formats told in docstrings
    "jbeamshell.mechanics.friction",
    "jbeamshell.mechanics.kinematics",
    "jbeamshell.mechanics.homogeneous",
    "jbeamshell.mechanics.laminate",
    "jbeamshell.scene.keys",
    "jbeamshell.scene.rows",
    "jbeamshell.scene.dimensions",
    "jbeamshell.scene.bolts",
    "jbeamshell.identify.plan_file",
    "jbeamshell.identify.rig",
    "jbeamshell.identify.parameters",
    "jbeamshell.history.record",
)


def public(face: str) -> list[str]:
    """Public names of a face: those that it imports under their own name, or defines."""
    folder = PACKAGE.joinpath(*face.split(".")[1:])
    stub, init = folder / "__init__.pyi", folder / "__init__.py"
    source = next(path for path in (stub, init, folder.with_suffix(".py")) if path.exists())
    names: list[str] = []
    own = source.suffix == ".py"
    for node in ast.parse(source.read_text("utf-8")).body:
        if isinstance(node, ast.ImportFrom):
            names += [alias.name for alias in node.names if alias.asname == alias.name]
        elif own and isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.append(node.name)
        elif own and isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.append(node.target.id)
    module = importlib.import_module(face)
    return [
        name
        for name in names
        if not name.startswith("_") and not inspect.ismodule(getattr(module, name))
    ]


def home(face: str, name: str) -> str:
    """Face on whose page a name is described: the package's own where it has the same object."""
    item = getattr(importlib.import_module(face), name)
    return "jbeamshell" if getattr(jbeamshell, name, None) is item else face


def kind(face: str, name: str) -> str:
    """Autodoc's word for a name: class, exception, function or data."""
    item = getattr(importlib.import_module(face), name)
    if inspect.isclass(item):
        return "exception" if issubclass(item, BaseException) else "class"
    return "function" if callable(item) else "data"
