"""One command for all studies of a folder: list them, run some or all, draw from their records.

A study is a module with the function ``measure``, whose keyword arguments are those of the command
line and which returns its record, or with the table ``PARTS`` of such functions by name, each of
which returns one entry of the record.  The record is the JSON file beside the module; its entry
"about" tells machine, versions and date, by part if there are parts.  If the study has a function
``draw`` of the record, the figure that this returns is the picture beside it (or several, by name);
``tell`` of the record returns what is printed; ``ship`` of the record writes what the package keeps
of it.  A study that writes its own record returns None.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import inspect
import json
import os
import re
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

ROOT = Path(__file__).parents[1]
DIGITS = 9  # of the numbers of a record
Record = dict[str, Any]


def studies(folder: str) -> dict[str, tuple[Path, str]]:
    """File and first line of every study of a folder, by name; nothing is imported."""
    found = {}
    for path in sorted((ROOT / folder).rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = {getattr(node, "name", None) for node in tree.body}
        for node in tree.body:
            if isinstance(node, ast.Assign | ast.AnnAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                names |= {target.id for target in targets if isinstance(target, ast.Name)}
        if path.parent.name != "__pycache__" and names & {"measure", "PARTS"}:
            lines = (ast.get_docstring(tree) or "").splitlines()
            found[path.stem] = path, lines[0] if lines else ""
    return found


def main(folder: str, arguments: Sequence[str] | None = None) -> int:
    """Run the command line of a folder; returns the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    known = studies(folder)
    parser = argparse.ArgumentParser(
        prog=f"python -m {folder}",
        description="Without a name, lists the studies.  With names, or with 'all', runs them and "
        "writes their records and pictures beside them.",
    )
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help="studies, and WORD=VALUE for their own arguments"
    )
    parser.add_argument("--draw", action="store_true", help="draw the record that is there")
    parser.add_argument("--only", nargs="+", metavar="PART", help="parts of the study to renew")
    parser.add_argument("--missing", action="store_true", help="parts that the record lacks")
    asked = parser.parse_intermixed_args(arguments)
    words = dict(name.split("=", 1) for name in asked.names if "=" in name)
    names = [name for name in asked.names if "=" not in name]
    if not names:
        width = max(map(len, known), default=0)
        print("\n".join(f"{name:{width}}  {line}" for name, (_, line) in known.items()))
        return 0
    unknown = set(names) - set(known) - {"all"}
    if unknown:
        parser.error(f"{', '.join(sorted(unknown))}: there is {', '.join(known)}")
    chosen = list(known) if "all" in names else list(dict.fromkeys(names))
    if len(chosen) > 1 and not asked.draw:  # each in a process of its own
        command = [sys.executable, "-m", folder]
        rest = [word for word in arguments if word not in names]
        return max(subprocess.call([*command, name, *rest], cwd=ROOT) for name in chosen)
    timed = known[chosen[0]][0].parent.name == "benchmarks"
    if timed:
        _take_one_core()
    import jax

    jax.config.update("jax_enable_x64", True)
    modules = {known[name][0]: load(known[name][0]) for name in chosen}
    import jbeamshell as jb

    jb.configure(cache=not timed)
    if timed:  # first calls are to be compiled, whatever an earlier process has left
        jax.config.update("jax_enable_compilation_cache", False)
    warnings.simplefilter("ignore", jb.DoubtfulWarning)  # doubts are for the records
    try:
        for path, study in modules.items():
            run(study, path, words, asked.draw, asked.only, asked.missing)
    except jb.InputError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _take_one_core() -> None:
    """Take one core and one thread, before NumPy is imported: other threads only wait."""
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def run(
    study: ModuleType,
    path: Path,
    words: Mapping[str, str],
    draw: bool = False,
    only: Sequence[str] | None = None,
    missing: bool = False,
) -> None:
    """Renew the record of a study, or the parts of it that are asked for, and draw it."""
    target = path.with_suffix(".json")
    record = read(target)
    if not draw:
        _renew(study, target, record, words, only, missing)
    if hasattr(study, "tell"):
        print(study.tell(record))
    if hasattr(study, "draw"):
        save(study.draw(record), target)


def load(path: Path) -> ModuleType:
    """Module of a study."""
    return importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))


def read(path: Path) -> Record:
    """Record; empty where there is none yet."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def _renew(
    study: ModuleType,
    target: Path,
    record: Record,
    words: Mapping[str, str],
    only: Sequence[str] | None,
    missing: bool,
) -> None:
    """Measure, and write the record, of a study in parts after each of them."""
    from calibration.provenance import provenance
    from jbeamshell.common.errors import InputError

    if not hasattr(study, "PARTS"):
        found = study.measure(**_arguments(study.measure, words))
        if found is not None:
            record.clear()
            record |= {"about": provenance()} | found
            _write(study, target, record)
        return
    parts: dict[str, Callable[..., Any]] = study.PARTS
    if unknown := set(only or ()) - set(parts):
        raise InputError(f"--only {', '.join(sorted(unknown))}: choose of {', '.join(parts)}")
    for name in only or [name for name in parts if not (missing and name in record)]:
        import jax

        begin = time.perf_counter()
        record[name] = parts[name](**_arguments(parts[name], words))
        record.setdefault("about", {})[name] = provenance()
        _write(study, target, record)
        jax.clear_caches()
        print(f"{name}: {time.perf_counter() - begin:.0f} s", file=sys.stderr, flush=True)


def _arguments(function: Callable[..., Any], words: Mapping[str, str]) -> dict[str, Any]:
    """Arguments of the command line that a function takes, as numbers where they are."""
    from jbeamshell.common.errors import InputError

    taken = list(inspect.signature(function).parameters)
    for word in words:
        if word not in taken:
            raise InputError(f"{word}: the study takes {', '.join(taken) or 'no argument'}")

    def value(text: str) -> Any:
        try:
            return json.loads(text)
        except ValueError:
            return text

    return {word: value(text) for word, text in words.items()}


def as_text(record: Record) -> str:
    """Record as JSON, every innermost list or row on one line."""
    text = json.dumps(_short(record), indent=1, allow_nan=False)
    return re.sub(r"[\[{][^][{}]*[\]}]", lambda row: " ".join(row[0].split()), text) + "\n"


def _short(value: Any) -> Any:
    """The same with nine digits of every number; what is not finite is None."""
    if isinstance(value, dict):
        return {key: _short(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_short(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") if abs(value) < float("inf") else None
    return value


def _write(study: ModuleType, path: Path, record: Record) -> None:
    """Write a record whole, or not at all, and what the package keeps of it."""
    from jbeamshell.common.files import write_text

    write_text(path, as_text(record))
    if hasattr(study, "ship"):
        study.ship(record)


def save(figures: Any, target: Path) -> None:
    """Save the picture of a study, or several by their names, beside its record."""
    from jbeamshell.plotting.style import close, save

    several = figures if isinstance(figures, Mapping) else {"": figures}
    for name, figure in several.items():
        path = target.with_name(f"{target.stem}_{name}.png" if name else f"{target.stem}.png")
        save(figure, path)
        close(figure)
        print(path.relative_to(ROOT), file=sys.stderr)
