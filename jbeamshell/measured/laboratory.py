"""Arrays in files of laboratory software: HDF5, MATLAB 7.3, TDMS and universal files.

Each reader gives titles with units in brackets, where the file tells them, and arrays.  The
libraries are optional: nothing here is imported before such a file is read.
"""

from __future__ import annotations

import importlib
import io
import tempfile
from collections.abc import Iterator
from typing import Any

import numpy as np

from jbeamshell.common.errors import InputError
from jbeamshell.measured.tables import LARGEST

Arrays = Iterator[tuple[str, Any]]

TIME = "time [s]"
UNIT_NAMES = ("unit", "units", "Unit", "Units", "unit_string")  # attributes that tell a unit
FUNCTIONS = (58,)  # kinds of sets in a universal file that hold functions; 58b is binary
UNIVERSAL = {  # kinds of ordinates, by their codes
    8: "displacement",
    9: "force",
    11: "velocity",
    12: "acceleration",
    13: "force",
    17: "time",
}


def hdf5(data: bytes) -> Arrays:
    """Data sets of an HDF5 file, those of a MATLAB 7.3 file as MATLAB shows them."""
    with _library("h5py").File(io.BytesIO(data)) as file:
        found: list[tuple[str, Any]] = []
        file.visititems(lambda name, item: found.append((name, item)))
        sets = [(name, item) for name, item in found if hasattr(item, "dtype") and item.shape]
        kept = [(name, item) for name, item in sets if not name.startswith("#refs#")]
        if sum(item.nbytes for _, item in kept) > LARGEST:
            raise ValueError(f"more than {LARGEST // 10**6} MB when unpacked")
        for name, item in kept:
            matlab = _text(item.attrs.get("MATLAB_class", ""))
            if matlab in ("char", "cell"):
                continue
            array = item[()].T if matlab else item[()]
            title = name.replace("/", ".")
            if array.dtype.names:
                yield from ((f"{title}.{field}", array[field]) for field in array.dtype.names)
            else:
                yield _titled(title, item.attrs), array


def tdms(data: bytes) -> Arrays:
    """Channels of a TDMS file, and the time of waveforms."""
    groups = _library("nptdms").TdmsFile.read(io.BytesIO(data)).groups()
    timed = False
    for group in groups:
        for channel in group.channels():
            own = channel.name if len(groups) == 1 else f"{group.name}.{channel.name}"
            yield _titled(own, channel.properties), channel[:]
            if not timed and len(channel) and "wf_increment" in channel.properties:
                timed = True
                yield TIME, channel.time_track()


def universal(data: bytes) -> Arrays:
    """Functions of time in a universal file, sets 58 and 58b."""
    with tempfile.NamedTemporaryFile(suffix=".uff") as file:
        file.write(data)
        file.flush()
        opened = _library("pyuff").UFF(file.name)
        kinds = list(opened.get_set_types())
        sets = [opened.read_sets(i) for i, kind in enumerate(kinds) if kind in FUNCTIONS]
    timed = False
    for number, one in enumerate(sets, 1):
        kind = UNIVERSAL.get(int(one["ordinate_spec_data_type"]), "")
        told = [one["ordinate_axis_lab"], one["id1"], one["rsp_ent_name"]]
        words = [word for word in map(str.strip, map(_text, told)) if word not in ("", "NONE")]
        name = next((word for word in words if kind in word.lower()), None)
        own = name or " ".join([kind, *words[:1]]).strip() or f"set {number}"
        yield _titled(own, {"unit": one["ordinate_axis_units_lab"]}), np.asarray(one["data"])
        if not timed and int(one["abscissa_spec_data_type"]) == 17:
            timed = True
            yield TIME, np.asarray(one["x"])


def _library(name: str) -> Any:
    """Optional library; raises `InputError` if it is not installed."""
    try:
        return importlib.import_module(name)
    except ImportError:
        package = {"nptdms": "npTDMS"}.get(name, name)
        raise InputError(
            f"needs {package}, which is not installed: pip install {package}, or "
            "'jbeamshell[formats]'"
        ) from None


def _titled(name: str, attributes: Any) -> str:
    """Name with the unit that attributes tell, in brackets."""
    for key in UNIT_NAMES:
        unit = _text(attributes.get(key, "")).strip()
        if unit and unit != "NONE" and "[" not in name and "(" not in name:
            return f"{name} [{unit}]"
    return name


def _text(value: Any) -> str:
    """Text of an attribute, which may be bytes or an array of one element."""
    if isinstance(value, np.ndarray):
        value = value.ravel()[0] if value.size else ""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
