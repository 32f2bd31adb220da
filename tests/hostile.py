"""Bad inputs by kind: words of the command line, objects of Python, files and their damage."""

import datetime
import io
import os
import pickle
import zipfile

import jax.numpy as jnp
import numpy as np
from scipy.io import savemat

# What no key takes, as written behind --set KEY=, or as a value in TOML where it is one.
WORDS = {
    "not a number": "nan",
    "minus infinity": "-inf",
    "a word": "abc",
    "a word of Python": "__class__",
    "nothing": "",
    "none": "None",
    "null": "null",
    "true": "true",
    "mixed": "[1, 'a']",
    "ragged": "[[1, 2], [3]]",
    "deep lists": "[[[1.0]]]",
    "a table": "{a = 1}",
    "a date": "2020-01-01",
    "a time": "07:32:00",
    "complex": "1j",
    "complexes": "[1j, 2]",
    "a set": "[{1, 2}]",
    "beyond floats": "1" + "0" * 400,
    "beyond Python's digits": "9" * 5000,
    "hexadecimal without end": "0x" + "f" * 5000,
    "nested without end": "[" * 3000 + "]" * 3000,
    "brackets without end": "[" + "(" * 3000,
    "more lines": "1\nx = 2",
    "another section": "1\n[strip]\nlength = 2",
    "NUL": "\0",
    "half of a letter": "\udcff",
    "a fraction": "½",
    "a quote": '"',
    "equal to": "=1",
    "a comma": ",",
    "very long": "a" * 10**6,
    "very many": "[" + "1," * 20000 + "]",
}

# What no number, no count and no word of a scene is.
OBJECTS = {
    "complex": 1j,
    "bytes": b"x",
    "a dictionary": {"a": 1},
    "a set": {1},
    "an object": object(),
    "ragged": [[1.0], [2.0, 3.0]],
    "of arrays": [np.array([1.0]), 2.0],
    "NaN": np.nan,
    "NaN of JAX": jnp.float32("nan"),
    "a function": len,
    "a type": float,
    "a date": datetime.date(2020, 1, 1),
    "a date of NumPy": np.datetime64("2020"),
    "complex array": np.array(1j),
    "array of objects": np.array([None]),
    "array of words": np.array("x"),
    "array of truths": np.array(True),
    "complex of JAX": jnp.asarray(1j),
    "truth of JAX": jnp.asarray(True),
    "no rows": np.zeros((0, 2)),
    "a row too long": np.zeros((2, 3)),
    "masked": np.ma.masked,
    "structured": np.zeros(2, [("a", float)]),
    "beyond floats": 10**400,
    "beyond Python's digits": 10**5000,
    "very long": "a" * 100_000,
}

TOML = {
    "UTF-16": "[strip]\nlength = 2\n".encode("utf-16"),
    "UTF-8 with a mark": b"\xef\xbb\xbf[strip]\nlength = 2\n",
    "Latin-1": b"# \xe9\n[strip]\n",
    "NUL": b"[strip]\nlength = 2\0\n",
    "noise": bytes(range(256)),
    "a program": b"\x7fELF" + bytes(100),
    "a key twice": b"[strip]\nlength = 2\nlength = 3\n",
    "a section twice": b"[strip]\n[strip]\n",
    "cut off": b"[strip]\nlen",
    "cut off in a list": b"[strip]\nlength = [1,",
    "nested without end": b"[strip]\nlength = " + b"[" * 5000 + b"]" * 5000,
    "sections without end": b"[strip." + b".".join([b"a"] * 3000) + b"]\n",
    "beyond Python's digits": b"[strip]\nlength = " + b"9" * 5000,
    "hexadecimal without end": b"[strip]\nlength = 0x" + b"f" * 5000,
    "a date": b"[strip]\nlength = 2020-01-01\n",
    "a moment": b"[strip]\nlength = 2020-01-01T00:00:00Z\n",
    "mixed": b"[strip]\nlength = [1, 'a', true]\n",
    "a name of Python": b"[strip]\n__class__ = 1\n",
    "a section of Python": b"[__class__]\na = 1\n",
    "a method": b"[strip.__init__]\na = 1\n",
    "an empty key": b"[strip]\n'' = 1\n",
    "a key of two lines": b'[strip]\n"a\\nb" = 1\n',
    "no section": b"strip = 1\n",
    "a list of sections": b"[[strip]]\nlength = 2\n",
    "a dotted key": b'"strip.length" = 2\n',
    "infinite": b"[strip]\nlength = inf\n",
    "not a number": b"[strip]\nlength = nan\n",
    "true": b"[strip]\nlength = true\n",
    "a table": b"[strip]\nlength = {a = 1}\n",
    "a number in quotes": b"[strip]\nlength = '2'\n",
    "a key without end": b"[strip]\n" + b"a" * 100_000 + b" = 1\n",
    "keys without end": b"[strip]\n" + b"".join(b"k%d = 1\n" % i for i in range(10_000)),
    "a list for a section": b"[model]\nsection = ['bar']\n",
    "a number for a section": b"[model]\nsection = 3\n",
    "a list for a law": b"[contact]\nlaw = ['elastic-slip']\n",
    "half a count": b"[load]\ncycles = 1e3\n",
    "load steps without end": b"[load]\ncycles = 1000000\nsteps_per_half_cycle = 1000000\n",
    "no pressure": b"[contact]\npressure = []\n",
    "half a table": b"[contact]\npressure = [[0, 1]]\n",
    "a table too wide": b"[contact]\npressure = [[0, 1, 2], [1, 2, 3]]\n",
    "a table of nothing": b"[contact]\npressure = [[0, 0], [2, 0]]\n",
    "half a layer": b"[strip]\nlayers = [[1, 2]]\n",
    "an escape": b'[strip]\nfar_end = "\\u001b[31m"\n',
    "half of a letter": b'[strip]\n"\\ud800" = 1\n',
    "ends of lines": b"[strip]\rlength = 2\r",
}

HUGE = b"[load]\ncycles = 99\nsteps_per_half_cycle = 998\n[model]\nnodes = 999999\n"

FREE = "[free.'contact.friction']\n"
DATA = "[[specimen]]\ndata = ['none.csv']\n"
LONG = "0x" + "f" * 5000
OF_DATA = [
    "kind = 1", "kind = ['loop']", "width = nan", "width = true", f"width = {LONG}", "centre = 1",
    "columns = 1", "columns = {force = 1}", "units = []", "decimal = 1", "set = 1", "driver = 3",
    "drift = {}", "cycles = 2", "nonsense = 1",
]  # fmt: skip
OF_PLAN = ["scene = 1", "scene = ''", "scene = 'none.toml'", "set = 1", "nonsense = 1"]
OF_FREE = [
    "low = 'a'", "low = nan", "high = true", "prior = [1, 2, 3]", "prior = 'a'", "each = 1",
    "scale = 1", "scale = ['log']", "start = [1]", "nonsense = 1", f"start = {LONG}",
]  # fmt: skip
PLANS = {
    "a number for specimens": "specimen = 1\n",
    "no specimens": "specimen = []\n",
    "numbers for specimens": "specimen = [1]\n",
    "no data": "[[specimen]]\nlabel = 'a'\n",
    "a number for data": "[[specimen]]\ndata = 1\n",
    "numbers for files": "[[specimen]]\ndata = [1]\n",
    "a word for data": "[[specimen]]\ndata = 'x.csv'\n",
    "no such file": DATA,
    "a folder": "[[specimen]]\ndata = ['.']\n",
    "a NUL": '[[specimen]]\ndata = ["a\\u0000b.csv"]\n',
    "a name too long": f"[[specimen]]\ndata = ['{'a' * 5000}.csv']\n",
    **{f"of data {i}": f"{DATA}{entry}\n" for i, entry in enumerate(OF_DATA)},
    **{f"of a plan {i}": f"{entry}\n{FREE}{DATA}" for i, entry in enumerate(OF_PLAN)},
    **{f"free {i}": f"{FREE}{entry}\n{DATA}" for i, entry in enumerate(OF_FREE)},
    "a number for free": "free = 1\n" + DATA,
    "a number for a free key": "[free]\n'contact.friction' = 1\n" + DATA,
}

# Of a fit's own options in a plan with good data.
OPTIONS = [
    "starts = 'a'", "starts = 0", "starts = 0x" + "f" * 5000, "noise = [1]", "noise = -1",
    "method = 'adam'", "max_iterations = 1e9", "max_iterations = 10000000000",
    "points = true", "points = 2", "tolerance = inf", "tolerance = 'a'",
]  # fmt: skip


MANY = 2_000_000  # numbers in a file that is small until it is unpacked


class Evil:
    """Makes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def npy(array):
    file = io.BytesIO()
    np.save(file, array, allow_pickle=True)
    return file.getvalue()


def npz(compression=zipfile.ZIP_STORED, **members):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return file.getvalue()


def mat(compressed=False, **columns):
    file = io.BytesIO()
    savemat(file, columns, do_compression=compressed)
    return file.getvalue()


def data_files(evil):
    """Files that hold no loop, by name; what is pickled in some would make a file."""
    t = np.arange(41.0)
    good = {"force": npy(np.sin(t)), "displacement": npy(np.cos(t))}
    objects = npy(np.array([Evil(evil)] * 9, dtype=object))
    shape = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
    endless = b"\x93NUMPY\x01\x00v\x00" + shape.ljust(117) + b"\n"
    head = b"force,displacement\n"
    numbers = b"".join(b"%d,%d\n" % (i % 5, i % 3) for i in range(20))
    matlab, squeezed = (
        mat(compressed, force=np.sin(t), displacement=np.cos(t)) for compressed in (False, True)
    )
    zeros = npy(np.zeros(MANY))
    return {
        "empty.csv": b"",
        "noise.csv": bytes(range(256)) * 9,
        "nul.csv": head + b"1,\0\n",
        "cut.csv": head + b"1,2\n1,",
        "words.csv": b"a,b\nc,d\n",
        "one column.csv": b"force\n1\n2\n",
        "infinite.csv": head + b"inf,1\n" * 20,
        "missing.csv": head + b"nan,nan\n" * 20,
        "constant.csv": head + b"1,1\n" * 20,
        "huge.csv": head + b"".join(b"%de300,%d\n" % (i, i) for i in range(20)),
        "quote.csv": head + b'"1,2\n',
        "long line.csv": head + (b"1" * 10**6 + b",2\n") * 3,
        "long title.csv": b"a" * 10**6 + b",displacement\n" + numbers,
        "wide.csv": b",".join(b"c%d" % i for i in range(20_000)) + b"\n" + b"1," * 20_000,
        "half utf-16.csv": (head + numbers).decode().encode("utf-16")[:-1],
        "digits.csv": head + b"9" * 5000 + b",2\n" + numbers,
        "thousands.csv": b'force;displacement\n"1,234";2\n"1,235";3\n',
        "pdf.csv": b"%PDF-1.4\n" + bytes(range(256)),
        "zip.csv": npz(**good),
        "sheet.csv": b"PK\3\4" + bytes(range(256)),
        "text.npz": b"force,displacement\n",
        "objects.npy": objects,
        "objects.npz": npz(force=objects, displacement=objects),
        "half objects.npz": npz(force=good["force"], displacement=objects),
        "pickle.npy": pickle.dumps(Evil(evil)),
        "pickle.npz": pickle.dumps(Evil(evil)),
        "pickle.mat": pickle.dumps(Evil(evil)),
        "pickle.csv": pickle.dumps(Evil(evil), 0),
        "endless.npy": endless,
        "endless.npz": npz(force=endless, displacement=endless),
        "bomb.npz": npz(zipfile.ZIP_DEFLATED, force=zeros, displacement=good["displacement"]),
        "bomb.mat": mat(True, force=np.zeros(MANY), displacement=np.cos(t)),
        "complex.npz": npz(force=npy(1j * t), displacement=good["displacement"]),
        "truths.npz": npz(force=npy(t > 9.0), displacement=good["displacement"]),
        "words.npz": npz(force=npy(np.array(["a"] * 41)), displacement=good["displacement"]),
        "solid.npy": npy(np.zeros((9, 9, 9))),
        "cut.npz": npz(**good)[:300],
        "cut.mat": matlab[: len(matlab) // 2],
        "header.mat": matlab[:140],
        "cut squeezed.mat": squeezed[:-30],
        "new.mat": b"MATLAB 7.3".ljust(512) + b"\x89HDF\r\n\x1a\n",
    }


def giants(folder):
    """Files of a gigabyte that take no room on the disk."""
    paths = [folder / f"giant.{end}" for end in ("toml", "csv", "npz", "npy", "mat", "state")]
    for path in paths:
        with path.open("wb") as file:
            os.truncate(file.fileno(), 10**9)
    return paths
