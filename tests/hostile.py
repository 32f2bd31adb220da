"""Bad inputs by kind: words of the command line, objects of Python, scene files and plans."""

import datetime
import os

import jax.numpy as jnp
import numpy as np

# What no key takes, as written behind --set KEY=, or as a value in TOML where it is one.
WORDS = {
    "not a number": "nan",
    "a word": "abc",
    "nothing": "",
    "true": "true",
    "mixed": "[1, 'a']",
    "ragged": "[[1, 2], [3]]",
    "a table": "{a = 1}",
    "a date": "2020-01-01",
    "complex": "1j",
    "a set": "[{1, 2}]",
    "beyond floats": "1" + "0" * 400,
    "beyond Python's digits": "9" * 5000,
    "hexadecimal without end": "0x" + "f" * 5000,
    "nested without end": "[" * 3000 + "]" * 3000,
    "more lines": "1\nx = 2",
    "another section": "1\n[strip]\nlength = 2",
    "NUL": "\0",
    "half of a letter": "\udcff",
    "very long": "a" * 10**6,
    "very many": "[" + "1," * 20000 + "]",
}

# What no number, no count and no word of a scene is.
OBJECTS = {
    "complex": 1j,
    "bytes": b"x",
    "a dictionary": {"a": 1},
    "a set": {1},
    "ragged": [[1.0], [2.0, 3.0]],
    "NaN": np.nan,
    "a function": len,
    "a date": datetime.date(2020, 1, 1),
    "complex array": np.array(1j),
    "array of objects": np.array([None]),
    "array of words": np.array("x"),
    "complex of JAX": jnp.asarray(1j),
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
    "a key twice": b"[strip]\nlength = 2\nlength = 3\n",
    "cut off": b"[strip]\nlen",
    "nested without end": b"[strip]\nlength = " + b"[" * 5000 + b"]" * 5000,
    "sections without end": b"[strip." + b".".join([b"a"] * 3000) + b"]\n",
    "beyond Python's digits": b"[strip]\nlength = " + b"9" * 5000,
    "hexadecimal without end": b"[strip]\nlength = 0x" + b"f" * 5000,
    "a date": b"[strip]\nlength = 2020-01-01\n",
    "mixed": b"[strip]\nlength = [1, 'a', true]\n",
    "a name of Python": b"[strip]\n__class__ = 1\n",
    "a key of two lines": b'[strip]\n"a\\nb" = 1\n',
    "no section": b"strip = 1\n",
    "a list of sections": b"[[strip]]\nlength = 2\n",
    "true": b"[strip]\nlength = true\n",
    "a table": b"[strip]\nlength = {a = 1}\n",
    "a key without end": b"[strip]\n" + b"a" * 100_000 + b" = 1\n",
    "keys without end": b"[strip]\n" + b"".join(b"k%d = 1\n" % i for i in range(10_000)),
    "a list for a section": b"[model]\nsection = ['bar']\n",
    "a list for a law": b"[contact]\nlaw = ['elastic-slip']\n",
    "load steps without end": b"[load]\ncycles = 1000000\nsteps_per_half_cycle = 1000000\n",
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


class Evil:
    """Makes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def giants(folder):
    """Files of a gigabyte that take no room on the disk."""
    paths = [folder / f"giant.{end}" for end in ("toml", "csv", "npz", "npy", "mat", "state")]
    for path in paths:
        with path.open("wb") as file:
            os.truncate(file.fileno(), 10**9)
    return paths
