"""Writer of the generated pages: settings, commands, names and recorded figures."""

import argparse
import importlib
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path

from generate import names, records
from jbeamshell.cli.main import COMMANDS
from jbeamshell.scene.keys import TABLE

SECTIONS = {
    "strip": "Strip",
    "contact": "Contact",
    "load": "Load",
    "model": "Model",
    "member": "Second member of a lap joint",
}


def write(folder: Path, root: Path) -> None:
    """Write all pages; a page that did not change keeps its time, so that builds stay short."""
    pages = {
        "settings.md": settings(),
        "commands.md": commands(),
        "names.md": index_of_names(),
        "names_extensions.md": extensions(),
        **{f"names_{face.replace('.', '_')}.md": names_of(face) for face in names.FACES},
        **records.tables(root),
    }
    folder.mkdir(parents=True, exist_ok=True)
    for stale in set(folder.glob("*.md")) - {folder / name for name in pages}:
        stale.unlink()
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")


def settings() -> str:
    """Page of all keys of a scene."""
    lines = [
        "# Settings",
        "",
        "Every number and word of a scene has a key. Keys are the same in `Scene.replace`, in TOML",
        "files, after `--set` on the command line, and in sweeps, fits and derivatives.",
        "`jbeamshell keys` prints this list. Units are your own, as long as they agree. A key that",
        "is `auto` is chosen by the scene for `model.tolerance`; `print(history)` says the choice.",
        "",
    ]
    for section, heading in SECTIONS.items():
        lines += [f"## {heading}", "", "| key | default | unit | meaning |", "|---|---|---|---|"]
        for key in TABLE.values():
            if key.name.startswith(f"{section}."):
                cells = f"`{key.name}` | {key.shown_default} | {key.shown_unit} | {key.sentence}"
                lines.append(f"| {cells} |")
        lines.append("")
    return "\n".join(lines)


def commands() -> str:
    """Page of the command line, from its own parsers."""
    parser = argparse.ArgumentParser(prog="jbeamshell")
    known = parser.add_subparsers()
    for command in COMMANDS:
        command.add_to(known)
    lines = [
        "# Command line",
        "",
        "`jbeamshell COMMAND --help` prints each of these. Exit codes: 0 done; 2 bad input; 3 a",
        "load step, a fit or a strip of a sweep did not converge, or the model does not describe",
        "the data of a fit; 130 interrupted. Commands with results take `--json`.",
        "",
    ]
    for name, child in known.choices.items():
        description = re.sub(r"(?<!`)(--\w+)", r"`\1`", child.description or "")
        lines += [f"## jbeamshell {name}", "", description, ""]
        rows = list(option_rows(child))
        if rows:
            lines += ["| option | meaning |", "|---|---|", *rows, ""]
    return "\n".join(lines)


def option_rows(parser: argparse.ArgumentParser) -> Iterator[str]:
    """Rows of a table: each option of a command with its meaning."""
    for action in parser._actions:
        if "--help" in action.option_strings:
            continue
        words = ", ".join(action.option_strings)
        value = action.metavar or (action.dest.upper() if action.nargs != 0 else "")
        if action.choices:
            value = "{" + ",".join(map(str, action.choices)) + "}"
        shown = f"{words} {value}".strip() if words else value
        meaning = (action.help or "") % {**vars(action), "prog": parser.prog}
        yield (
            f"| `{shown}` | {meaning} |".replace("|TOML", "\\|TOML")
            .replace("NAME|SCENE", "NAME\\|SCENE")
            .replace("DATA|PLAN", "DATA\\|PLAN")
        )


def index_of_names() -> str:
    """Page that leads to the pages of all public names."""
    pages = [f"names_{face.replace('.', '_')}" for face in names.FACES]
    lines = [
        "# All names",
        "",
        "`import jbeamshell as jb` gives all of these; parts are loaded when they are first used.",
        "",
        "```{toctree}",
        *pages,
        "names_extensions",
        "```",
        "",
    ]
    return "\n".join(lines)


def names_of(face: str) -> str:
    """Page of one face: a table of its names, then each of them."""
    found = sorted(names.public(face), key=str.lower)
    kinds = {name: names.kind(face, name) for name in found}
    lines = [f"# {names.FACES[face]}", "", "```{eval-rst}", f".. automodule:: {face}", ""]
    own = [name for name in found if names.home(face, name) == face]
    documented = [name for name in own if kinds[name] != "data"]
    lines += [".. autosummary::", "", *(f"   {name}" for name in documented), ""]
    if elsewhere := [f"`jbeamshell.{name}`" for name in found if name not in own]:
        lines += [f"Here too: {', '.join(elsewhere)}.", ""]
    for name in own:
        lines += [*described(face, name, kinds[name]), ""]
    return "\n".join([*lines, "```", ""])


def described(face: str, name: str, kind: str) -> list[str]:
    """Directive that describes a name; a constant is shown with its value."""
    if kind != "data":
        return [f".. auto{kind}:: {face}.{name}", *options(kind)]
    value = textwrap.shorten(repr(getattr(importlib.import_module(face), name)), 200)
    return [f".. py:data:: {name}", f"   :module: {face}", "", f"   ``{value}``"]


def options(kind: str) -> list[str]:
    """Options of autodoc for a class: its members, and those of this project's own parents."""
    if kind != "class":
        return []
    parents = "Module,tuple,Tree,NamedTuple,int,dict,Exception,UserWarning"
    return ["   :members:", "   :show-inheritance:", f"   :inherited-members: {parents}"]


def extensions() -> str:
    """Page of modules that are no face, but that own laws and files build on."""
    lines = [
        "# To build on",
        "",
        "Modules behind the faces above: base classes for laws and energies of your own, the",
        "table of keys, the format of plans, and what pictures read.",
        "",
        "```{eval-rst}",
    ]
    for module in names.EXTENSIONS:
        lines += [module, "-" * len(module), "", f".. automodule:: {module}", "   :members:", ""]
    return "\n".join([*lines, "```", ""])
