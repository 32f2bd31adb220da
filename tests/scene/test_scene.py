"""Scenes: TOML to the last bit, clear refusals, and gradients that reach every number."""

import errno
import itertools
import pathlib
import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jbeamshell import Contact, InputError, Load, Scene, read_scene, scene_to_toml
from jbeamshell.common.files import parsed_toml, written_whole
from jbeamshell.mechanics.friction import (
    CappedTrial,
    ElasticSlip,
    FrictionLaw,
    SharpSlip,
    TanhIncrement,
)
from jbeamshell.scene import library
from jbeamshell.scene.keys import DERIVED, ENTRIES, FAR_ENDS, KEYS, NUMBERS
from jbeamshell.scene.keys import TABLE as TABLE_OF_KEYS
from jbeamshell.scene.parts import unit_path
from jbeamshell.scene.sections import SECTIONS
from jbeamshell.scene.toml import scene_from_values, write_scene

TABLE = [[0.0, 3.0], [0.7, 0.0], [0.7, 5.0], [2.0, 12.5]]  # with a step
LAYERS = [[0.1, 1e4, 0.3], [0.1252, 1e5, 0.2]]  # of the standard strip's height

# --- files --------------------------------------------------------------------------------------

positive = st.floats(1e-90, 1e90)
OF_JOINT = {key for key in KEYS if key.startswith("member.")}
OF_JOINT |= {"strip.overhang", "load.kind", "load.arm"}
OPTIONAL = {"strip.axial_stiffness", "strip.poisson_ratio", "strip.layers", "strip.curvature"}
OPTIONAL |= OF_JOINT - {"member.support", "load.kind"}
JOINT = {"member.support": "rolling", "strip.far_end": "free", "model.section": "plane"}


@st.composite
def tables(draw, length):
    parts = draw(st.lists(st.floats(0, 1), min_size=2, max_size=5, unique=True))
    steps = draw(st.sets(st.sampled_from(parts)))
    x = [length * part for part in sorted([*parts, *steps])]
    return [[at, draw(st.floats(0.5, 1e3))] for at in x]


@st.composite
def sections(draw, height):
    """A homogeneous section or layers, and whether they are layers."""
    if draw(st.booleans()):
        return {
            "strip.axial_stiffness": draw(positive),
            "strip.poisson_ratio": draw(st.floats(-0.99999, 0.49999)),
        }, False
    parts = draw(st.lists(st.floats(0.1, 1), min_size=1, max_size=3))
    stiffness = [(draw(positive), draw(st.floats(-0.99, 0.49))) for _ in parts]
    thickness = [height * part / sum(parts) for part in parts]
    return {"strip.layers": [[t, *s] for t, s in zip(thickness, stiffness, strict=True)]}, True


@st.composite
def values_of_all_keys(draw):
    length, ratio = draw(positive), draw(positive)
    material, layered = draw(sections(length * ratio))
    homogeneous = ("bar", "shell", "squeeze") if layered else SECTIONS[:-1]
    section = draw(st.sampled_from(homogeneous))
    bends = section != "bar"
    normal = draw(st.sampled_from(["rigid", "held"] + ["compliant", "none"] * bends))
    far_end = draw(st.sampled_from(["guided"] if normal == "none" else list(FAR_ENDS)))
    law = draw(st.sampled_from(["elastic-slip", "smooth-cap", "tanh-increment"]))
    smoothing = st.just("sharp") if law == "tanh-increment" else st.floats(1.01, 1e3)
    presses_up = positive | tables(length) if normal == "none" else st.just(0.0)
    curved = bends and normal != "held" and section[0] != "p" and draw(st.booleans())
    curvature = {"strip.curvature": draw(positive)} if curved else {}
    cycles = draw(st.integers(0, 1000))
    rough = far_end == "free" or not bends  # a bar in closed form needs friction
    friction = draw(positive if rough else positive | st.just(0.0))
    return (
        material
        | curvature
        | {
            "strip.length": length,
            "strip.width": draw(st.none() | positive),
            "strip.height_ratio": ratio,
            "strip.kappa_s": draw(positive),
            "strip.far_end": far_end,
            "member.loaded_end": "free",
            "strip.plane": draw(st.sampled_from(["strain", "stress"])),
            "contact.friction": friction,
            "contact.pressure": draw(positive | tables(length)),
            "contact.bottom_pressure": draw(presses_up),
            "contact.stick_stiffness": draw(positive),
            "contact.smoothing": draw(smoothing | st.just("sharp")),
            "contact.law": law,
            "contact.normal": normal,
            "member.assembly": "frictionless",
            "contact.normal_stiffness": draw(positive),
            "member.support": "none",
            "load.control": draw(st.sampled_from(["force", "displacement"])),
            "load.kind": "force",
            "load.entry": draw(st.sampled_from(ENTRIES)),
            "load.amplitude": draw(positive),
            "load.cycles": cycles,
            "load.steps_per_half_cycle": 2 * draw(st.integers(1, 1000)),
            "load.pressure_steps": draw(st.integers(1, 1000)),
            "model.section": section,
            "model.by": draw(st.sampled_from(["auto", "steps"])),
            "model.kinematics": draw(st.sampled_from(["exact", "linear"])),
            "model.grid": draw(st.sampled_from(["finite-difference", "collocation"])),
            "model.nodes": 2 * draw(st.integers(1, 1000)) + 1,
            "model.constants": draw(st.sampled_from(["consistent", "printed"])),
            "model.tolerance": draw(st.floats(1e-4, 0.1)),
        }
    )


def same(one, other):
    """Equal structure, words and bits."""
    return jax.tree.structure(one) == jax.tree.structure(other) and all(
        a.dtype == b.dtype and np.array_equal(a, b)
        for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    )


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("scenes") / "scene.toml"


@given(values=values_of_all_keys())
def test_toml_keeps_every_bit(path, values):
    assert set(values) | OPTIONAL == set(KEYS) - set(DERIVED)
    scene = Scene().replace(values)
    write_scene(scene, path)
    again = read_scene(path)
    assert same(again, scene)
    for key, value in values.items():
        if key != "contact.smoothing":  # the traps have no sharp end
            got = again.get(key)
            total = scene.strip.width is not None  # which is divided, and multiplied again
            assert np.array_equal(got, value) or (total and np.allclose(got, value, 1e-15)), key


@given(height=positive, stiffness=positive, nu=st.floats(-0.99, 0.49), clamped=st.booleans())
def test_toml_keeps_a_lap_joint(path, height, stiffness, nu, clamped):
    values = JOINT | {"member.height_ratio": height, "member.axial_stiffness": stiffness}
    values |= {"member.poisson_ratio": nu, "member.assembly": "frictional"}
    if clamped:
        values |= {"member.support": "clamped", "member.loaded_end": "level"}
        values |= {"contact.bottom_pressure": 10.0}
    scene = Scene().replace(values)
    write_scene(scene, path)
    assert same(read_scene(path), scene)


def test_an_empty_file_is_the_default_strip_and_says_how_its_force_enters(path):
    path.write_text("")
    with pytest.warns(UserWarning, match=r"load.entry is not given and read as 'member'"):
        scene = read_scene(path)
    assert same(scene, Scene())


def test_a_readable_file(path):
    path.write_text(
        "[strip]\nhalf_height = 0.5\nlength = 4\n[contact]\nsmoothing = 8\n"
        f"pressure = {TABLE}\n[model]\nsection = 'shell'\n[load]\nentry = 'face'\n"
    )
    scene = read_scene(path)
    assert (scene.strip.height_ratio, scene.contact.smoothing) == (0.25, 8.0)
    assert scene.plan.fields == ("v", "w", "beta")
    np.testing.assert_array_equal(scene.contact.pressure, TABLE)


@pytest.mark.parametrize("name", library.NAMES)
def test_scenes_that_ship_survive_a_file(path, name):
    scene = library.named(name)
    write_scene(scene, path)
    assert same(read_scene(path), scene)
    assert same(getattr(library, name.replace("-", "_"))(), scene)
    assert same(scene_from_values(library.values_of(name)), scene)
    assert re.fullmatch(r"[A-Z].{20,90}\.", library.summary(name))


def test_the_scenes_that_ship_are_the_files():
    folder = pathlib.Path(library.__file__).parent / "shipped"
    assert sorted(library.NAMES) == sorted(path.stem for path in folder.glob("*.toml"))
    assert same(library.standard(), Scene().replace({"load.entry": "traction"}))


@pytest.mark.parametrize("ask", [library.named, library.values_of, library.summary])
def test_unknown_scenes_name_the_nearest(ask):
    with pytest.raises(InputError, match=r"unknown scene 'recedng': did you mean 'receding'\? \("):
        ask("recedng")
    with pytest.raises(InputError, match=r"unknown scene 'xyz': scenes are standard, calibrated,"):
        ask("xyz")


def test_own_functions_stay_in_code():
    for own in (Scene(energy=lambda *strains: strains[0] ** 2), Scene(contact=Contact(law=Own()))):
        with pytest.raises(InputError, match="cannot be written to TOML"):
            scene_to_toml(own)


class Own(FrictionLaw):
    """A user's law."""

    def traction(self, dv, t_n, cap, k_t):
        return t_n


def test_written_whole_or_not_at_all(tmp_path):
    target = tmp_path / "scene.toml"
    target.write_text("old")

    def interrupted(error):
        with written_whole(target) as draft:
            draft.write_text("half a")
            assert target.read_text() == "old"
            assert draft.parent == tmp_path  # so that the renaming stays on one file system
            raise error

    for error in (RuntimeError("no picture"), KeyboardInterrupt()):
        with pytest.raises(type(error)):
            interrupted(error)
        assert target.read_text() == "old"
        assert list(tmp_path.iterdir()) == [target]
    with written_whole(target) as draft:
        draft.write_text("new")
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


def test_a_renaming_that_fails_leaves_the_old_file(tmp_path, monkeypatch):
    target = tmp_path / "scene.toml"
    target.write_text("old")

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(pathlib.Path, "replace", refuse)
    with pytest.raises(InputError, match="cannot be written"):
        write_scene(Scene(), target)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("name", ["missing/scene.toml", "."])
def test_places_that_cannot_be_written(tmp_path, name):
    with pytest.raises(InputError, match=r"cannot be written \((No such file|Is a dir)"):
        write_scene(Scene(), tmp_path / name)
    assert not list(tmp_path.iterdir())


# --- keys ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("derived", [key for key in DERIVED if not TABLE_OF_KEYS[key].table])
@pytest.mark.parametrize("value", [0.37, 5e4])
def test_derived_keys_are_read_back(derived, value):
    before = Scene().replace({"strip.length": 3.0, "strip.poisson_ratio": 0.2})
    scene = before.replace({derived: value})
    np.testing.assert_allclose(scene.get(derived), value, rtol=1e-15)
    assert scene.get(DERIVED[derived]) != before.get(DERIVED[derived])
    for key in set(NUMBERS) - {*DERIVED, DERIVED[derived], "contact.smoothing"}:
        assert scene.get(key) == before.get(key)


def test_derived_keys_apply_after_what_they_depend_on():
    values = {"strip.youngs_modulus": 7e4, "strip.half_height": 0.2, "strip.poisson_ratio": 0.1}
    scene = Scene().replace(values | {"strip.length": 5.0})
    for key, value in values.items():
        np.testing.assert_allclose(scene.get(key), value, rtol=1e-15)
    np.testing.assert_allclose(scene.strip.axial_stiffness, 7e4 / (1 - 0.01) * 0.4, rtol=1e-15)


@pytest.mark.parametrize(
    ("values", "law"),
    [
        ({}, SharpSlip()),
        ({"contact.smoothing": 8}, ElasticSlip(8.0)),
        ({"contact.smoothing": np.inf}, SharpSlip()),
        ({"contact.law": "smooth-cap"}, CappedTrial()),
        ({"contact.law": "smooth-cap", "contact.smoothing": 8}, CappedTrial(8.0)),
        ({"contact.law": "tanh-increment"}, TanhIncrement()),
        ({"contact.law": Own()}, Own()),
    ],
)
def test_friction_laws_by_name(values, law):
    got = Scene().replace(values).contact.law
    assert type(got) is type(law)
    assert jax.tree.leaves(got) == jax.tree.leaves(law)


def test_a_law_keeps_its_exponent():
    smooth = Scene().replace({"contact.smoothing": 8})
    assert smooth.replace({"contact.friction": 0.2}).contact.smoothing == 8
    assert smooth.replace({"contact.law": "smooth-cap"}).contact.law.smoothing == 8
    assert smooth.replace({"contact.smoothing": "sharp"}).contact.smoothing == np.inf


# --- bad input ----------------------------------------------------------------------------------


def test_a_curvature_of_zero_is_a_straight_strip():
    for bend in (0, 0.0, jnp.zeros(())):
        assert Scene().replace({"strip.curvature": bend}).strip.curvature is None


def test_an_amplitude_does_not_outlive_its_control():
    moved = Scene().replace({"load.control": "displacement", "load.amplitude": 1e-5})
    assert moved.replace({"contact.friction": 0.2}).load.amplitude == 1e-5
    assert moved.replace({"load.control": "force"}).load.amplitude == Load().amplitude


@pytest.mark.parametrize(("name", "reason"), [("no.toml", "No such file"), (".", "Is a directory")])
def test_files_that_cannot_be_read(tmp_path, name, reason):
    with pytest.raises(InputError, match=rf"cannot be read \({reason}"):
        read_scene(tmp_path / name)


# --- gradients and batches ----------------------------------------------------------------------

FULL = {
    "contact.smoothing": 16.0,
    "contact.bottom_pressure": 1.0,
    "contact.stick_stiffness": 50.0,
    "strip.curvature": 0.1,
}


@pytest.mark.parametrize("key", NUMBERS)
def test_gradients_and_batches_reach_every_number(key):
    layers = {key: LAYERS} if key.endswith(".layers") else {}
    bolts = np.array([[0.5, 8.0, 0.4], [1.5, 6.0, 0.3]])
    beside = {} if layers else {key: bolts if key == "contact.bolts" else 0.2}
    beside |= {"member.bearing_stiffness": 1.0} if key == "member.clearance" else {}
    scene = Scene().replace(
        JOINT | layers | beside
        if key in {*OF_JOINT, "contact.bolts"}
        else FULL | layers | ({key: 0.2} if key == "strip.width" else {})
    )
    value = scene.get(key)

    def weight(factor):
        leaves = jax.tree.leaves(scene.replace({key: value * factor}))
        some = (jnp.where((leaf > 0.0) & (leaf < jnp.inf), leaf, 1.0) for leaf in leaves)
        return sum((i + 1.0) * jnp.sum(jnp.log(leaf)) for i, leaf in enumerate(some))

    below, here, above = jax.vmap(weight)(jnp.array([0.999999, 1.0, 1.000001]))
    np.testing.assert_allclose(here, weight(1.0), rtol=1e-14)
    slope = jax.grad(weight)(1.0)
    np.testing.assert_allclose(slope, (above - below) / 2e-6, rtol=1e-7)
    assert abs(slope) > 0.5


def test_gradients_reach_a_pressure_table():
    def pressure(table):
        return jnp.sum(Scene().replace({"contact.pressure": table}).contact.pressure ** 2)

    slope = jax.jit(jax.grad(pressure))(jnp.asarray(TABLE))
    np.testing.assert_allclose(slope, 2.0 * np.array(TABLE), rtol=1e-12)


def test_the_load_path_turns_at_the_amplitude():
    path = unit_path(cycles=3, steps=4)
    once = [0.5, 0, -0.5, -1, -0.5, 0, 0.5, 1]
    np.testing.assert_allclose(path, [0.5, 1, *once * 3])
    assert unit_path(cycles=0, steps=4).size == 0


def test_a_full_disk_leaves_the_old_file_and_one_clear_line(tmp_path):
    target = tmp_path / "result.json"
    target.write_text("old")
    with (
        pytest.raises(InputError, match=r"result\.json: cannot be written \(No space left"),
        written_whole(target),
    ):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert [p.name for p in tmp_path.iterdir()] == ["result.json"]
    assert target.read_text() == "old"


def test_a_scene_is_printed_short_with_units():
    table = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [2.0, 2.0]]
    changed = {"contact.bottom_pressure": table, "strip.far_end": "free", "model.nodes": 33}
    assert str(Scene().replace(changed)).splitlines() == [
        "Strip: section plane on its contact line, linear kinematics, 33 nodes",
        "  strip.length                 2  [length]",
        "  strip.height_ratio           0.1126",
        "  strip.axial_stiffness        34000  [force/width]",
        "  strip.poisson_ratio          0.3",
        "  strip.far_end                free",
        "  contact.friction             0.1",
        "  contact.pressure             10  [stress]",
        "  contact.bottom_pressure      table of 4 rows  [stress]",
        "  load.control                 force",
        "  load.amplitude               0.7855  [force/width]",
    ]


def test_numbers_that_are_traced_are_printed_as_such():
    printed = []

    def run(friction):
        printed.append(str(Scene().replace({"contact.friction": friction})))
        return friction

    jax.jit(run)(0.2)
    assert "contact.friction             traced" in printed[0]


def test_only_patches_of_pressure_are_bolts():
    bolts = [[0.4, 3.0, 0.2], [1.2, 5.0, 0.3]]
    scene = Scene().replace({"contact.bolts": bolts})
    np.testing.assert_allclose(scene.get("contact.bolts"), bolts, rtol=1e-12)
    step = [[0.0, 30.0], [0.6, 30.0], [0.6, 0.0], [2.0, 0.0]]
    assert Scene().replace({"contact.pressure": step}).get("contact.bolts") is None


SPECIMENS = {
    "dimensions": {
        "strip.length": 0.12855,
        "strip.half_height": 0.0009513,
        "strip.youngs_modulus": 3.2851e9,
        "contact.bolts": [[0.03856, 31.0, 0.0257], [0.08998, 2290.7, 0.0193]],
    },
    "clamped": {
        "strip.half_height": 0.1127,
        "strip.youngs_modulus": 210e9,
        "contact.bolts": [[1.0, 20.0, 0.5]],
        "member.support": "clamped",
        "strip.far_end": "free",
        "member.loaded_end": "level",
        "load.entry": "traction",
        "model.section": "plane",
    },
    "numbers of the model": {
        "strip.height_ratio": 0.0937,
        "strip.axial_stiffness": 2.71e8,
        "contact.pressure": 4.31,
    },
}


@pytest.mark.parametrize("values", SPECIMENS.values(), ids=SPECIMENS)
def test_a_file_says_what_was_given_and_means_the_same(values):
    scene = scene_from_values(values)
    text = scene_to_toml(scene)
    said = {
        f"{section}.{name}": number
        for section, table in parsed_toml(text).items()
        for name, number in table.items()
    }
    assert {key: said[key] for key in values} == values
    again = scene_from_values(said)
    for here, there in zip(jax.tree.leaves(scene), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(here, there)


LAP_STEPS = (  # a single lap, a key at a time
    {"contact.bolts": [[0.5, 20.0, 0.5]]},
    {"strip.far_end": "free"},
    {"member.support": "clamped"},
    {"load.entry": "face"},
    {"member.loaded_end": "level"},
)


def in_steps(steps):
    """Scene of steps one after the other; None where one of them is no scene."""
    scene = Scene()
    try:
        for step in steps:
            scene = scene.replace(step)
    except InputError:
        return None
    return scene


def test_the_order_of_the_keys_of_a_joint_does_not_matter():
    whole = Scene().replace({key: value for step in LAP_STEPS for key, value in step.items()})
    assert np.array_equal(whole.contact.bottom_pressure, whole.contact.pressure)
    found = [in_steps(steps) for steps in itertools.permutations(LAP_STEPS)]
    scenes = [scene for scene in found if scene is not None]
    assert len(scenes) >= 5
    for scene in scenes:
        assert eqx.tree_equal(scene, whole)


@pytest.mark.parametrize(
    ("steps", "bottom"),
    [
        (({"member.support": "rolling"},), 0.0),  # after a clamped one
        (({"contact.bottom_pressure": 3.0}, {"load.entry": "face"}), 3.0),
        (({"contact.bottom_pressure": 0.0}, {"member.support": "clamped"}), 0.0),
        (({"contact.pressure": 5.0},), 0.0),  # in place of the bolts
    ],
)
def test_the_pressure_below_follows_the_bolts_until_it_is_given(steps, bottom, tmp_path):
    scene = in_steps(LAP_STEPS)
    for step in steps:
        scene = scene.replace(step)
    assert float(scene.contact.bottom_pressure) == bottom
    write_scene(scene, tmp_path / "scene.toml")
    assert eqx.tree_equal(read_scene(tmp_path / "scene.toml"), scene)


def test_bolts_whose_patches_touch_make_one_step():
    scene = Scene().replace({"contact.bolts": [[0.5, 4.0, 0.4], [0.9, 2.0, 0.4]]})
    table = [[0.3, 0.0], [0.3, 10.0], [0.7, 10.0], [0.7, 5.0], [1.1, 5.0], [1.1, 0.0]]
    np.testing.assert_allclose(scene.contact.pressure, table, atol=1e-12)
