"""What was given last stays given: all pairs of keys of a size or a material, in both orders."""

import dataclasses
import itertools
import tomllib

import jax
import numpy as np
import pytest

from jbeamshell.common.errors import InputError
from jbeamshell.scene.parts import Strip
from jbeamshell.scene.scene import Scene
from jbeamshell.scene.toml import overridden, scene_from_values, scene_to_toml
from jbeamshell.sweeping.lanes import lanes_of

LENGTH, NU, PLANE = "strip.length", "strip.poisson_ratio", "strip.plane"
RATIO, HEIGHT = "strip.height_ratio", "strip.half_height"
STIFFNESS, MODULUS = "strip.axial_stiffness", "strip.youngs_modulus"
RATIO_2, STIFFNESS_2 = "member.height_ratio", "member.axial_stiffness"
NU_2 = "member.poisson_ratio"
TWIN = {RATIO: HEIGHT, HEIGHT: RATIO, STIFFNESS: MODULUS, MODULUS: STIFFNESS}
OF_STRIP = (LENGTH, NU, RATIO, HEIGHT, STIFFNESS, MODULUS)
JOINT = {"strip.far_end": "free", "member.support": "rolling"}
STARTS = [
    {LENGTH: 120.0, NU: 0.3, PLANE: "strain"} | height | stiffness
    for height in ({RATIO: 0.1}, {HEIGHT: 6.0})
    for stiffness in ({STIFFNESS: 2.7e6}, {MODULUS: 2.1e5})
]
NEW = {LENGTH: 150.0, NU: 0.2, PLANE: "stress", RATIO: 0.07, HEIGHT: 4.0, STIFFNESS: 1.3e6}
NEW |= {MODULUS: 7e4, RATIO_2: 0.13, STIFFNESS_2: 9.1e5, NU_2: 0.1}
PAIRS = [*itertools.permutations(NEW, 2), *((key, key) for key in NEW)]


def with_key(given, key, value):
    """Numbers that are given after one more."""
    return {name: old for name, old in given.items() if name != TWIN.get(key)} | {key: value}


def by_hand(given):
    """All numbers of both members from those that are given."""
    length, nu = given[LENGTH], given[NU]
    half = given[HEIGHT] if HEIGHT in given else given[RATIO] * length / 2
    ratio_2, nu_2 = given.get(RATIO_2, 2 * half / length), given.get(NU_2, nu)
    strain = given[PLANE] == "strain"
    share, share_2 = (1 - nu**2, 1 - nu_2**2) if strain else (1.0, 1.0)
    prime = given[MODULUS] / share if MODULUS in given else given[STIFFNESS] / (2 * half)
    prime_2 = given[MODULUS] / share_2 if MODULUS in given else prime
    return {
        LENGTH: length,
        NU: nu,
        RATIO: 2 * half / length,
        HEIGHT: half,
        STIFFNESS: prime * 2 * half,
        MODULUS: prime * share,
        RATIO_2: ratio_2,
        STIFFNESS_2: given.get(STIFFNESS_2, prime_2 * ratio_2 * length),
        NU_2: nu_2,
    }


def in_scene(scene):
    """The same numbers of a scene."""
    below = scene.member.beside(scene.strip)
    second = {RATIO_2: below.height_ratio, STIFFNESS_2: below.axial_stiffness}
    return {key: scene.get(key) for key in OF_STRIP} | second | {NU_2: below.poisson_ratio}


def in_file(scene):
    """Values of a scene's TOML text by dotted key."""
    tables = tomllib.loads(scene_to_toml(scene))
    return {f"{part}.{name}": v for part, table in tables.items() for name, v in table.items()}


def replaced(scene, key, given):
    return in_scene(scene.replace({key: NEW[key]}))


def written(scene, key, given):
    """By a file, which says what was given and nothing that follows from it."""
    said = in_file(scene.replace({key: NEW[key]}))
    assert {name: said.get(name) for name in given} == given
    assert not said.keys() & {TWIN.get(name) for name in given}
    return in_scene(scene_from_values(said))


def beside_a_file(scene, key, given):
    """By a file with one more key, as on the command line."""
    return in_scene(scene_from_values(overridden(in_file(scene), {key: NEW[key]})))


def swept(scene, key, given):
    lanes = lanes_of(scene, {key: [NEW[key]]}) if key != PLANE else None
    return {} if lanes is None else {name: lanes.value(name) for name in OF_STRIP}


def differentiated(scene, key, given):
    """By a traced number, whose derivatives are those of the numbers by hand."""
    if key == PLANE:
        return {}
    at = NEW[key]
    found, slopes = jax.jvp(lambda x: in_scene(scene.replace({key: x})), (at,), (1.0,))
    low, high = (by_hand(given | {key: at * (1.0 + step)}) for step in (-1e-5, 1e-5))
    for name, slope in slopes.items():
        per_part = (high[name] - low[name]) / (2e-5 * abs(found[name]))
        np.testing.assert_allclose(slope * at / found[name], per_part, atol=1e-8, err_msg=name)
    return found


DOORS = (replaced, swept, written, beside_a_file, differentiated)


@pytest.mark.parametrize(
    ("start", "door"),
    [  # each start by some of the doors, each door from the ratio and from the height
        pytest.param(start, door, id=f"{' '.join(list(start)[3:])}-{door.__name__}")
        for place, start in enumerate(STARTS)
        for door in (DOORS if place in (0, 3) else DOORS[:2])
    ],
)
def test_what_was_given_last_stays_given(start, door):
    begun = Scene().replace(JOINT | start)
    for first, second in PAIRS:
        given = with_key(with_key(start, first, NEW[first]), second, NEW[second])
        scene, wanted = begun.replace({first: NEW[first]}), by_hand(given)
        for name, value in door(scene, second, given).items():
            told = f"{name} after {first}, {second}"
            np.testing.assert_allclose(value, wanted[name], rtol=1e-13, err_msg=told)


def test_layers_keep_the_height_that_was_given():
    layers = [[4.0, 7e4, 0.3], [8.0, 2.1e5, 0.2]]
    scene = Scene().replace({LENGTH: 120.0, HEIGHT: 6.0, MODULUS: 2.1e5})
    layered = scene.replace({"strip.layers": layers})
    assert layered.get(MODULUS) is layered.get(STIFFNESS) is None
    assert float(layered.replace({LENGTH: 150.0}).get(HEIGHT)) == 6.0
    with pytest.raises(InputError, match=r"strip.youngs_modulus = 70000.0: strip.layers say it"):
        layered.replace({MODULUS: 7e4})
    assert float(layered.replace({"strip.layers": None, MODULUS: 7e4}).get(MODULUS)) == 7e4
    with pytest.raises(InputError, match=r"add up to 12, but the height 2H is 15"):
        layered.replace({RATIO: 0.1}).replace({LENGTH: 150.0})


def test_a_strip_by_itself_takes_either_key():
    steel = Strip(length=120.0, half_height=6.0, youngs_modulus=2.1e5)
    for key, value in {"height_ratio": 0.1, "axial_stiffness": 2.1e5 / 0.91 * 12.0}.items():
        assert float(getattr(steel, key)) == pytest.approx(value, rel=1e-14)
    with pytest.raises(InputError, match=r"height_ratio and strip.half_height say the same"):
        Strip(height_ratio=0.1, half_height=6.0)
    with pytest.raises(InputError, match=r"take Scene.replace\(.* in place of dataclasses.replace"):
        dataclasses.replace(steel, length=150.0)
    with pytest.raises(InputError, match=r"strip.half_height = 6e\+250: overflows beside the"):
        Strip(length=1e-100, half_height=6e250)


def test_a_text_names_what_was_given():
    scene = Scene().replace({LENGTH: 120.0, HEIGHT: 6.0, MODULUS: 2.1e5})
    told = str(scene.replace({LENGTH: 150.0}))
    assert HEIGHT in told
    assert MODULUS in told
    assert RATIO not in told
    assert STIFFNESS not in told
