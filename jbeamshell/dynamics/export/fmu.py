"""FMI 2 co-simulation unit: pythonfmu packs `fmu_slave` with the sliders of a joint."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from jbeamshell.common.errors import InputError
from jbeamshell.dynamics.export.element import Element

NAME = "jbeamshell_joint"  # of the module in the unit
LONGEST = 120.0  # seconds to pack


def write(element: Element, draft: Path) -> None:
    """Write the unit: input displacement; outputs force, stiffness and dissipated.

    It steps in its own copy of Python code, so the importing program needs a Python on its path.

    Raises
    ------
    InputError
        without pythonfmu, or if it fails
    """
    if importlib.util.find_spec("pythonfmu") is None:
        raise InputError("export to 'fmu': needs pythonfmu: pip install 'jbeamshell[fmu]'")
    numbers = {
        "about": " ".join([element.title, *element.facts]),
        "sliders": element.sliders,
        "spring": element.spring,
        "reach": element.reach,
        "units": element.units,
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        script, data = folder / f"{NAME}.py", folder / "joint.json"
        shutil.copyfile(Path(__file__).with_name("fmu_slave.py"), script)
        data.write_text(json.dumps(numbers), encoding="utf-8")
        call = [sys.executable, "-m", "pythonfmu", "build", "-f", str(script), "-d", str(folder)]
        call += ["--handle-state", "--serialize-state", str(data)]
        try:  # a process of its own: the builder keeps modules and paths in its interpreter
            ended = subprocess.run(call, capture_output=True, text=True, timeout=LONGEST)
            error = ended.stderr.strip() if ended.returncode else ""
        except subprocess.TimeoutExpired:
            error = f"not ready within {LONGEST:.0f} s"
        found = list(folder.glob("*.fmu"))
        if error or len(found) != 1:
            reason = error.splitlines()[-1] if error else "no unit was written"
            raise InputError(f"export to 'fmu': pythonfmu failed ({reason})")
        shutil.copyfile(found[0], draft)
