"""Refusals of scenes: one line names the key, the value and the fix."""

import tomllib
from pathlib import Path

import jax
import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.mechanics.friction import CappedTrial, FrictionLaw
from jbeamshell.scene.keys import FORMER, NUMBERS, TABLE

ROWS = Path(__file__).with_name("refusals.txt").read_text("utf-8").splitlines()


def values_of(text):
    tables = tomllib.loads(text.replace("; ", "\n")).items()
    return {f"{table}.{name}": value for table, own in tables for name, value in own.items()}


def refusals():
    for row in ROWS:
        if row.startswith("## "):
            how, base = row[3:].split(":", 1)
        elif row and row[0] != "#":
            values, words = row.split(" ==> ")
            yield pytest.param(how, values_of(base), values_of(values), words, id=values)


@pytest.mark.parametrize(("how", "base", "values", "words"), list(refusals()))
def test_it_is_refused(how, base, values, words):
    scene = jb.Scene().replace(base) if how == "replace" else None
    with pytest.raises(jb.InputError) as caught:
        scene.replace(values) if scene else jb.solve(jb.Scene().replace(base | values))
    told = str(caught.value)
    assert all(part in told for part in words.split(" .. ")), told
    assert "\n" not in told
    (key, value), *more = values.items()
    if how == "replace" and not more and words[0] != key[0]:
        assert key in told
        assert isinstance(value, list) or f"{key} = {value!r}" in told or str(float(value)) in told


SIZES = ["length", "height_ratio", "half_height", "axial_stiffness", "youngs_modulus", "kappa_s"]
POSITIVE = [f"strip.{name}" for name in SIZES]
POSITIVE += ["contact.stick_stiffness", "contact.normal_stiffness", "load.amplitude"]
NO_NUMBERS = ["2.0", True, [1.0, 2.0], np.array([1.0, 2.0]), None, {"a": 1}, 10**400, 1j]


@pytest.mark.parametrize("key", POSITIVE)
def test_sizes_are_positive_and_finite(key):
    for value in (-2.0, 0.0, float("nan"), float("inf")):
        with pytest.raises(jb.InputError, match=f"{key} = {value}: must be a positive number"):
            jb.Scene().replace({key: value})


@pytest.mark.parametrize("key", NUMBERS)
def test_what_is_no_number_is_refused(key):
    for value in NO_NUMBERS:
        if (value is None and TABLE[key].optional) or (
            key == "member.layers" and isinstance(value, list | np.ndarray)
        ):
            continue
        with pytest.raises(jb.InputError, match=r"number|thickness, E") as caught:
            jb.Scene().replace({key: value})
        shown = repr(value.tolist() if isinstance(value, np.ndarray) else value)
        assert str(caught.value).startswith(f"{key} = ")
        assert shown in str(caught.value)


class Own(FrictionLaw):
    """A user's law."""

    def traction(self, dv, t_n, cap, k_t):
        return t_n


def traced(key, value, **base):
    scene = jb.Scene().replace({name.replace("__", "."): given for name, given in base.items()})
    return jax.jit(lambda given: scene.replace({key: given}))(value)


LAYERS = [[0.1, 1e4, 0.3], [0.1252, 1e5, 0.2]]
TRACED = {f"strip.{name}" for name in ("axial_stiffness", "youngs_modulus", "poisson_ratio")}


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: jb.Strip(length="long"), "strip.length = 'long': must be a number"),
        (lambda: jb.Strip(kappa_s=-1), "strip.kappa_s = -1.0: must be a positive"),
        (lambda: jb.Contact(pressure="high"), "contact.pressure = 'high': give a number or a t"),
        (lambda: jb.Contact(law=CappedTrial(0.5)), "contact.smoothing = 0.5: must be a number a"),
        (lambda: jb.Contact(friction=None), r"contact\.friction"),
        (lambda: jb.Load(amplitude=True), "load.amplitude = True: must be a number"),
        (lambda: jb.Load("displacement"), "load.amplitude = None: give the amplitude"),
        (lambda: jb.Load(kind="moment"), "give the amplitude of a moment under force control"),
        (lambda: jb.Load("arc-length"), "load.amplitude = None: give the amplitude under arc"),
        (lambda: jb.Model(section="beam"), "model.section = 'beam': choose 'bar'"),
        (lambda: jb.Model(end_size=-1.0), "end_size = -1.0: must be a positive number"),
        (lambda: jb.Model(end_size="small"), "end_size = 'small': must be a positive number"),
        (lambda: jb.Model(by="newton"), r"model\.by = 'newton': choose 'steps' or 'auto'"),
        (lambda: jb.solve(jb.Scene(), by="newton"), "by = 'newton': choose None or 'steps'"),
        (
            lambda: jb.Scene().replace({"contact.law": Own(), "contact.smoothing": 8.0}),
            "contact.smoothing = 8.0: contact.law",
        ),
        *[
            (
                lambda key=key: traced(key, 0.3, strip__layers=LAYERS),
                f"{key} = a traced value: strip.layers say it already",
            )
            for key in sorted(TRACED)
        ],
    ],
)
def test_parts_and_calls_check_themselves(make, told):
    with pytest.raises(jb.InputError, match=told):
        make()


@pytest.mark.parametrize(
    "values",
    [
        {"contact.friction": 0.0},
        {"contact.friction": 0.0, "strip.far_end": "pinned"},
        {"contact.bottom_pressure": [[0.0, 19.0], [1.0, 0.0]]},
        {"strip.layers": None, "strip.curvature": None},
        {"contact.bottom_pressure": 20.0, "contact.normal": "none"},
        {"strip.layers": [[0.1, 1e4, 0.5], [0.1252, 1e5, 0.5]], "strip.plane": "stress"},
        {"strip.layers": [[0.2, 1e4, 0.499], [0.2, 1e5, 0]], "strip.half_height": 0.2},
        {"contact.pressure": [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]},
        {"load.cycles": 0},
    ],
)
def test_what_goes_together_is_taken(values):
    scene = jb.Scene().replace(values)
    again = scene.replace(values)
    assert jax.tree.structure(again) == jax.tree.structure(scene)
    jax.tree.map(np.testing.assert_array_equal, again, scene)


@pytest.mark.parametrize(
    ("key", "near"),
    [
        ("strip.hight_ratio", "strip.height_ratio"),
        ("contact.mu_friction", "contact.friction"),
        ("friction", "contact.friction"),
        ("model.node", "model.nodes"),
        ("load.steps", "load."),
    ],
)
def test_unknown_keys_name_the_nearest(key, near):
    for ask in (jb.Scene().get, lambda k: jb.Scene().replace({k: 1.0})):
        with pytest.raises(jb.InputError, match=rf"unknown key '{key}': did you mean '{near}"):
            ask(key)


NOW = {
    "strip.deviation": "leave it out",
    "model.fields": "model.section",
    "model.rung": "model.section",
    "model.order": "model.section",
    "model.solution": "model.by = steps",
    "model.squeeze": "model.section = assumed",
    "model.end_size": "model.nodes",
    "strip.loaded_end": "member.loaded_end",
    "member.holes": "contact.pressure, a table that is zero over the hole",
    "contact.holes": "contact.pressure, a table that is zero over the hole",
}


@pytest.mark.parametrize("key", FORMER)
def test_a_former_key_is_told_the_new_one(key, tmp_path):
    (path := tmp_path / "scene.toml").write_text(f"{key} = 0.1\nload.entry = 'face'\n", "utf-8")
    for ask in (
        lambda: jb.Scene().replace({key: 0.1}),
        lambda: jb.Scene().get(key),
        lambda: jb.read_scene(path),
    ):
        with pytest.raises(jb.InputError, match=rf"^{key}: is no key any more; ") as caught:
            ask()
        assert NOW.get(key, key.replace("contact", "member")) in str(caught.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (b"[strip\n", "is not a TOML file"),
        (b"\xff\xfe", "is not a TOML file"),
        (b"[stripe]\nlength = 2.0", "unknown section 'stripe'; sections are strip, contact"),
        (b"strip = 3", r"strip must be a table: write \[strip\]"),
        (b"[strip]\nlenght = 2.0", "unknown key 'strip.lenght': did you mean 'strip.length'"),
        (b"[strip]\nlength = 'two'", "strip.length = 'two': must be a number"),
        (b"[strip]\nlength = 2024-01-01", "strip.length = .*: must be a number"),
        (b"[load]\ncontrol = 'displacement'", "load.amplitude = None: give the amplitude"),
    ],
)
def test_bad_files(tmp_path, text, told):
    (path := tmp_path / "scene.toml").write_bytes(text)
    with pytest.raises(jb.InputError, match=told):
        jb.read_scene(path)
