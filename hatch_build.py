"""Build of the walk in C where there is a C compiler; jbeamshell installs without one, too."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import platform_tags

FOLDER = Path("jbeamshell", "contact_line")
SOURCES = "walk.c", "slopes.c"
LIBRARY = "libwalk.so"
FLAGS = (
    *("-std=c11", "-O3", "-fvisibility=hidden", "-shared", "-fPIC"),
    "-ffp-contract=off",  # the same result on every processor
    *("-fno-trapping-math", "-fno-math-errno"),  # else loops with choices have no vectors
)
COMPILERS = "cc", "gcc", "clang"


class WalkHook(BuildHookInterface):
    """Adds the library of the walk to a wheel, which is then one of this platform."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the library before a wheel or an editable install is built."""
        # An editable install stays on the machine that builds it.
        own = ["-march=native"] if version == "editable" else []
        library = built(Path(self.root) / FOLDER, own)
        if library is not None:
            build_data["force_include"][str(library)] = str(FOLDER / LIBRARY)
            build_data["pure_python"] = False
            build_data["tag"] = f"py3-none-{next(platform_tags())}"


def built(folder: Path, flags: list[str]) -> Path | None:
    """Library in a folder with the sources; None where no compiler makes it."""
    library = folder / LIBRARY
    library.unlink(missing_ok=True)
    sources = [str(folder / name) for name in SOURCES]
    given = shlex.split(os.environ.get("CC", ""))
    for compiler in [given] if given else [[name] for name in COMPILERS]:
        if shutil.which(compiler[0]) is None:
            continue
        for own in (flags, []) if flags else ([],):
            command = [*compiler, *FLAGS, *own, *sources, "-lm", "-o", str(library)]
            if subprocess.run(command, capture_output=True).returncode == 0:
                return library
    return None
