"""The recorded study of laws in place of a strip is what the code gives."""

from pathlib import Path

import numpy as np
import pytest

from calibration.running import read
from calibration.studies import laws_of_a_strip as study


@pytest.mark.slow
def test_the_record_of_the_standard_strip_is_found_again(monkeypatch):
    monkeypatch.setattr(study, "MODELS", ("iwan4", "jenkins", "sliders8"))
    record = read(Path(study.__file__).with_suffix(".json"))
    known, found = record["heights"]["0.1126"], study.figures(0.1126)
    np.testing.assert_allclose(found["energy"], known["energy"], rtol=1e-4)
    for name, own in found["models"].items():
        assert own["misfit"] == pytest.approx(known["models"][name]["misfit"], rel=0.05)
    worst = {name: own["median"] for name, own in found["models"].items()}
    assert worst["sliders8"] < 0.03 < worst["iwan4"] < worst["jenkins"]
