"""A fit of a scene with a width: forces of the data are totals, as measured."""

import numpy as np
import pytest

import jbeamshell as jb
from jbeamshell.measured.loops import Loop

STRIP = {
    "strip.length": 120.0,
    "strip.width": 50.0,
    "strip.half_height": 6.0,
    "strip.youngs_modulus": 210e3,
    "contact.friction": 0.2,
    "contact.pressure": 10.0,
    "load.amplitude": 7000.0,
}


def loop(scene):
    history = jb.solve(scene)
    force, displacement = map(np.asarray, history.loop)
    return Loop(force, displacement, label="total")


def test_totals_are_fitted_as_they_were_measured():
    truth = jb.Scene().replace(STRIP)
    data = loop(truth)
    assert np.max(data.force) == pytest.approx(7000.0)
    start = truth.replace({"contact.friction": 0.26})
    fit = jb.fit(data, start, ["contact.friction"])
    assert float(fit.scene.contact.friction) == pytest.approx(0.2, rel=0.01)
    assert float(fit.scene.strip.width) == 50.0


def test_a_width_is_given_once(tmp_path):
    scene = jb.Scene().replace(STRIP)
    data = loop(scene)
    for unit in ("N", "N/mm"):
        rows = zip(data.force.tolist(), data.displacement.tolist(), strict=True)
        text = [f"force [{unit}],displacement [mm]", *(f"{f!r},{u!r}" for f, u in rows)]
        (tmp_path / "rig.csv").write_text("\n".join(text), "utf-8")
        width, complaint = (50.0, "width = 50.0: divides forces, and the scene has a strip.width")
        if unit == "N/mm":
            width, complaint = (1.0, "is per width, and the scene has a strip.width")
        with pytest.raises(jb.InputError, match=complaint):
            jb.identify.Specimen(scene, "rig.csv", width=width).read(tmp_path)
