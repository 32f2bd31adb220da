"""Exported joints: what each file says, what comes back, what is refused; other programs' loops."""

import itertools
import json
import re
import shutil
import subprocess
import sys

import jax
import numpy as np
import pytest

from jbeamshell.common.errors import DoubtfulWarning, InputError
from jbeamshell.dynamics import Joint
from jbeamshell.dynamics.export import calculix
from jbeamshell.dynamics.export.targets import TARGETS

U = 3e-5 * np.geomspace(0.01, 1.0, 12)
JOINT = Joint(U, 50.0 * np.tanh(U / 2e-5), width=30.0)
REACH = float(U[-1])
TURNS = REACH * np.array([0.0, 0.9, -0.6, 0.4, -0.2, 0.9, -1.0, 0.3, 0.1, 0.8])  # nested reversals
PATH = np.concatenate([np.linspace(*ends, 12)[1:] for ends in itertools.pairwise(TURNS)])
FORCES = JOINT.path_forces(PATH)


def deviation(forces):
    """Largest difference from our forces, over the largest force."""
    return np.max(np.abs(np.asarray(forces) - FORCES)) / np.max(np.abs(FORCES))


@pytest.mark.parametrize("name", ["joint.csv", "joint.mat"])
def test_a_table_keeps_what_is_known_of_the_joint(tmp_path, name):
    sides = np.stack([0.98 * U, 1.02 * U])
    for capacity in (np.inf, 45.5):
        joint = Joint(U, JOINT.forces, 30.0, capacity, sides)
        back = Joint.read(joint.export("table", tmp_path / name))
        for one, other in zip(jax.tree.leaves(back), jax.tree.leaves(joint), strict=True):
            np.testing.assert_array_equal(one, other)
        assert np.isinf(back.reach) == (capacity == 45.5)


@pytest.mark.parametrize("to", [to for to in TARGETS if to != "fmu"])
def test_every_file_says_units_width_sign_and_range(tmp_path, to):
    path = tmp_path / f"joint{TARGETS[to].endings[0]}"
    text = JOINT.export(to, path, units=("mm", "N")).read_text("utf-8")
    for words in ("11 sliders", "u in mm, F in N", "Width: 30.0 mm", "positive in a pull"):
        assert words in text
    assert f"|F| <= {float(JOINT.forces[-1]):.6g}" in text
    assert "up to 0 % of u" in text


@pytest.mark.parametrize("to", ["opensees", "tmdsimpy"])
def test_the_sliders_of_a_module_follow_our_path(tmp_path, to):
    names = {}
    lines = JOINT.export(to, tmp_path / "joint.py").read_text("utf-8")
    exec(re.sub("^import openseespy.*$", "", lines, flags=re.MULTILINE), names)
    stiffness, limit = np.array(names["SLIDERS"]).T
    held, last, forces = 0.0 * limit, 0.0, []
    for u in PATH:
        held, last = np.clip(held + stiffness * (u - last), -limit, limit), u
        forces.append(np.sum(held) + names["SPRING"] * u)
    assert deviation(forces) < 1e-12


def test_a_strip_says_how_its_pull_and_push_differ(tmp_path):
    lopsided = Joint(U, JOINT.forces, sides=[0.79 * U, 1.21 * U])
    with pytest.warns(DoubtfulWarning, match="pull and push differ by 21%"):
        path = lopsided.export("table", tmp_path / "joint.csv")
    assert "differs from it by up to 21 %" in path.read_text("utf-8")


@pytest.mark.parametrize(
    ("to", "name", "words", "complaint"),
    [
        ("ansys", "joint.py", {}, "to = 'ansys': choose 'opensees' or"),
        ("opensees", "joint.txt", {}, "end the name of a file for 'opensees' in .py"),
        ("table", "joint", {}, ".csv or .mat"),
        ("tmdsimpy", "tmdsimpy.py", {}, "name the file otherwise"),
        ("table", "no/such/folder/joint.csv", {}, "cannot be written"),
        ("table", "joint.csv", {"units": "mm"}, "units = 'mm': name those of"),
        ("table", "joint.csv", {"units": ("m\nm", "N")}, "name those of length and force"),
    ],
)
def test_bad_input_is_one_line_and_leaves_no_file(tmp_path, to, name, words, complaint):
    with pytest.raises(InputError, match=re.escape(complaint)):
        JOINT.export(to, tmp_path / name, **words)
    assert not list(tmp_path.iterdir())


def test_without_pythonfmu_one_line_says_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'jbeamshell\[fmu\]'"):
        JOINT.export("fmu", tmp_path / "joint.fmu")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a,b\n1,2\n", "give columns displacement and force"),
        ("displacement,force\n1,2\n2,5\n", "softening throughout"),
        ("displacement,force\n1,x\n", "x"),
    ],
)
def test_a_table_that_is_no_joint_is_refused(tmp_path, text, complaint):
    path = tmp_path / "joint.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=complaint):
        Joint.read(path)


def test_the_unit_steps_as_we_do(tmp_path):
    """The unit is packed; its slave runs here without the wrapper of FMI."""
    pytest.importorskip("pythonfmu", reason="needs pythonfmu: pip install 'jbeamshell[fmu]'")
    path = JOINT.export("fmu", tmp_path / "joint.fmu", units=("mm", "N"))
    shutil.unpack_archive(path, tmp_path / "unit", "zip")
    from jbeamshell.dynamics.export.fmu_slave import JointOfSliders

    slave = JointOfSliders(instance_name="joint", resources=tmp_path / "unit" / "resources")
    forces, states = [], []
    for u in PATH:
        slave.displacement = u
        slave.do_step(0.0, 1.0)
        forces.append(slave.force)
        states.append(slave._get_fmu_state())
    assert deviation(forces) < 1e-12
    work = np.trapezoid([0.0, *forces], [0.0, *PATH])
    held = np.array(states[-1]["tractions"])
    spring = 0.5 * float(JOINT.spring) * PATH[-1] ** 2
    stored = 0.5 * np.sum(held**2 / np.asarray(JOINT.springs)) + spring
    assert slave.dissipated == pytest.approx(work - stored, rel=0.1)  # coarse steps
    slave._set_fmu_state(states[40])
    slave.displacement = PATH[41]
    slave.do_step(0.0, 1.0)
    assert slave.force == forces[41]


@pytest.mark.slow
class TestPrograms:
    """Loops of the real programs; ``pip install '.[round-trips]'`` brings the first two."""

    def test_opensees(self, tmp_path):
        loads = subprocess.run([sys.executable, "-c", "import openseespy.opensees"])
        if loads.returncode:
            pytest.skip("openseespy does not load: pip install '.[round-trips]', and libblas3")
        JOINT.export("opensees", tmp_path / "joint.py")
        script = "import json, joint; print(json.dumps(joint.forces(json.loads(input()))))"
        ran = subprocess.run(
            [sys.executable, "-c", script],
            cwd=tmp_path,
            input=json.dumps(PATH.tolist()),
            capture_output=True,
            text=True,
            check=True,
        )
        assert deviation(json.loads(ran.stdout)) < 1e-10
        printed = subprocess.run(
            [sys.executable, "joint.py"], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        loop = np.array([line.split(",") for line in printed.stdout.split()], float)
        np.testing.assert_allclose(JOINT.path_forces(loop[:, 0]), loop[:, 1], rtol=0, atol=1e-8)

    def test_fmi(self, tmp_path):
        fmpy = pytest.importorskip("fmpy", reason="needs fmpy: pip install '.[round-trips]'")
        path = JOINT.export("fmu", tmp_path / "joint.fmu", units=("mm", "N"))
        from fmpy.validation import validate_fmu

        assert validate_fmu(str(path)) == []
        time = np.arange(PATH.size + 1.0)
        signal = np.zeros(time.size, dtype=[("time", float), ("displacement", float)])
        signal["time"], signal["displacement"][:-1] = time, PATH
        found = fmpy.simulate_fmu(
            str(path),
            start_time=0.0,
            stop_time=float(PATH.size),
            step_size=1.0,
            output_interval=1.0,
            input=signal,
            output=["force", "dissipated"],
        )
        assert deviation(found["force"][1:]) < 1e-10
        assert np.all(np.diff(found["dissipated"]) >= 0.0)

    def test_calculix(self, tmp_path):
        if shutil.which("ccx") is None:
            pytest.skip("needs CalculiX: apt-get install calculix-ccx")
        JOINT.export("calculix", tmp_path / "joint.inp")
        base, end = calculix.FIRST + 8, calculix.FIRST + 9
        cards = ["*INCLUDE, INPUT=joint.inp", "*BOUNDARY", f"{base},1,1"]
        for u in TURNS[1:]:
            cards += ["*STEP, INC=100", "*STATIC, DIRECT", "0.25,1.", "*BOUNDARY"]
            cards += [f"{end},1,1,{u:.13e}", "*EL PRINT, ELSET=EALL", "S"]
            cards += ["*END STEP"]
        elements = range(calculix.FIRST, calculix.FIRST + 12)
        cards[1:1] = ["*ELSET, ELSET=EALL", *(f"{number}," for number in elements)]
        (tmp_path / "run.inp").write_text("\n".join(cards) + "\n")
        subprocess.run(["ccx", "run"], cwd=tmp_path, check=True, capture_output=True, timeout=120)
        rows = re.findall(r"^ +(9\d+) +1 +(.*)$", (tmp_path / "run.dat").read_text(), re.MULTILINE)
        shear = np.array([line.split()[4] for _, line in rows], float).reshape(-1, len(elements))
        side = float(re.search(r"^90003,([^,]+),", (tmp_path / "joint.inp").read_text(), re.M)[1])
        forces = side**2 * np.sum(shear, axis=1)
        path = np.concatenate([np.linspace(*ends, 5)[1:] for ends in itertools.pairwise(TURNS)])
        ours = JOINT.path_forces(path)
        assert np.max(np.abs(forces - ours)) / np.max(np.abs(ours)) < 1e-5
