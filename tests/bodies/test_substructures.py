"""Bodies of any origin: matrices in files, their condensation, and their contact."""

import functools
import json
import shutil
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.io
import scipy.sparse

import jbeamshell as jb
from calibration.finite_elements import body as calculix
from jbeamshell.cli.main import main
from jbeamshell.contact_line.section import section_form
from jbeamshell.contact_line.stations import stations
from jbeamshell.contact_line.strip import lap_members, pressing
from jbeamshell.measured.example import data_folder

# Few nodes are quick; their meshes are doubted.
pytestmark = pytest.mark.filterwarnings("ignore::jbeamshell.DoubtfulWarning")
DATA = Path(__file__).parent / "calculix"  # of strip.inp by CalculiX 2.20
SCENE = jb.Scene().replace(
    {
        "strip.far_end": "free",
        "member.support": "rolling",
        "member.height_ratio": 0.2,
        "member.axial_stiffness": 8e4,
        "model.section": "squeeze",
        "model.nodes": 25,
        "load.amplitude": 1.0,
        "load.steps_per_half_cycle": 8,
    }
)
LOAD = {"amplitude": 1.0, "steps_per_half_cycle": 8, "assembly": "frictionless"}


def as_body(hessian, fixed, x, signs):
    whole = np.append(np.tile(signs, x.size), [1.0, 1.0])
    hessian = np.asarray(hessian) * whole[:, None] * whole
    held = np.asarray(fixed).tolist()
    return jb.Substructure(x, hessian[:-2, :-2], -hessian[:-2, -2:], -hessian[-2:, -2:], fixed=held)


@jax.jit
def potentials(scene):
    """Stations, and of both members of a lap joint the Hessian and what is held."""
    x = stations(scene, scene.plan.nodes)
    down, up = pressing(scene, x)
    upper, lower, _ = lap_members(scene, section_form(scene), x, down[:, None], up[:, None])[-1]
    return x, (upper.line.hessian, upper.fixed), (lower.line.hessian, lower.fixed)


@functools.cache
def members():
    """Both members of the lap joint as bodies of a user's own."""
    x, upper, lower = potentials(SCENE)
    return as_body(*upper, x, [1.0, 1.0]), as_body(*lower, x, [1.0, -1.0])


def upper():
    return members()[0]


def lower():
    return members()[1]


def moved(body, signs):
    """Body mirrored, or turned by 180 degrees: X counts from the other end, directions turn."""
    nodes = np.arange(body.places.size)[::-1]
    places = np.stack([2 * nodes, 2 * nodes + 1], axis=1).ravel()
    sign = np.tile(signs, nodes.size)
    return jb.Substructure(
        2.0 - body.places[nodes],
        sign[:, None] * np.asarray(body.stiffness)[np.ix_(places, places)] * sign,
        sign[:, None] * np.asarray(body.forces)[places],
        body.flexibility,
        fixed=np.array(body.fixed)[places].tolist(),
    )


def slice_of(nodes=6, rows=3):
    return calculix.strip_slice(jb.Scene(), nodes, rows)


def strip_body():
    made = slice_of()
    model = jb.StiffnessModel.read(DATA / "strip.sti")
    return model.condensed(made.contact, pull=made.pull, press=[made.press])


class TestContact:
    def test_two_members_are_a_lap_joint(self):
        joint = jb.solve(SCENE, throw=False)
        found = jb.solve_contact(upper(), lower(), **LOAD, cycles=2)
        assert found.converged
        for name in ("dissipation", "dissipation_loop", "secant_stiffness"):
            assert float(getattr(found, name)) == pytest.approx(
                float(getattr(joint, name)),
                rel=1e-8,  # a weak spring holds a body that slides
            )
        assert float(found.slip_extent) == pytest.approx(float(joint.slip_length), rel=1e-8)
        np.testing.assert_allclose(found.reaction, joint.reaction, atol=1e-8)
        np.testing.assert_allclose(found.traction, joint.traction, atol=1e-7)

    def test_displacements_that_forces_caused_cause_them(self):
        forces = jb.solve_contact(upper(), lower(), **LOAD)
        load = {"path": forces.displacement[1:], "assembly": "frictionless"}
        found = jb.solve_contact(upper(), lower(), control="displacement", **load)
        # Slip is spread evenly over the load, or over the displacement.
        np.testing.assert_allclose(found.force, forces.force, atol=1e-4)
        np.testing.assert_allclose(
            found.gap, forces.gap, atol=1e-6 * float(jnp.ptp(forces.displacement))
        )
        work = float(jnp.sum(forces.slip_work))
        assert float(jnp.sum(found.slip_work)) == pytest.approx(work, rel=1e-3)

    def test_a_mirrored_joint_under_a_mirrored_load_answers_alike(self):
        joint = jb.solve_contact(upper(), lower(), **LOAD)
        mirrored = jb.solve_contact(*(moved(body, [-1.0, 1.0]) for body in members()), **LOAD)
        # Turned by 180 degrees the pulled body is the one below.
        turned = jb.solve_contact(*(moved(body, [-1.0, -1.0]) for body in members()[::-1]), **LOAD)
        for other, sign in ((mirrored, -1.0), (turned, 1.0)):
            for name in ("dissipation", "secant_stiffness"):
                assert float(getattr(other, name)) == pytest.approx(
                    float(getattr(joint, name)), rel=1e-10
                )
            np.testing.assert_allclose(other.reaction[:, ::-1], joint.reaction, atol=1e-9)
            np.testing.assert_allclose(other.slip[:, ::-1], sign * joint.slip, atol=1e-14)

    def test_pressing_follows_the_bolts_and_friction_work_fills_the_loop(self):
        once = jb.solve_contact(upper(), lower(), **LOAD)
        twice = jb.solve_contact(upper(), lower(), **LOAD | {"amplitude": 2.0}, bolts=2.0)
        assert float(twice.dissipation) == pytest.approx(4.0 * float(once.dissipation), rel=1e-9)
        assert float(once.dissipation_loop) == pytest.approx(float(once.dissipation), rel=0.02)

    def test_an_even_gap_costs_nothing_to_a_body_that_nothing_holds_up(self):
        flat = jb.solve_contact(upper(), lower(), **LOAD)
        above = jb.solve_contact(upper(), lower(), **LOAD, gap=1e-4)
        assert float(above.dissipation) == pytest.approx(float(flat.dissipation), rel=1e-7)

    @pytest.mark.parametrize("assembly", ["frictional", "frictionless"])
    def test_a_curved_body_stands_off_where_the_pressure_does_not_flatten_it(self, assembly):
        gap = 5e-3 * (np.asarray(upper().places) / 2.0) ** 2
        load = LOAD | {"assembly": assembly, "amplitude": 0.2}
        found = jb.solve_contact(upper(), lower(), **load, gap=gap)
        pressed = np.asarray(found.reaction[0])
        assert 0.0 < float(found.gap[0, -1]) < gap[-1]
        assert pressed[-1] == 0.0
        assert not np.any(found.gap[0][pressed > 0.0])
        total = float(np.asarray(upper().tributary) @ pressed)
        assert total == pytest.approx(20.0, rel=1e-9)  # what presses is carried

    @pytest.mark.slow
    def test_a_held_body_answers_alike_within_a_derivative(self):
        body = strip_body()
        load = {"amplitude": 0.5, "steps_per_half_cycle": 8, "assembly": "frictionless"}

        def work(bolts):
            return jb.solve_contact(body, bolts=bolts, **load).dissipation

        assert float(jax.jvp(work, (1.0,), (1.0,))[0]) == pytest.approx(float(work(1.0)), rel=1e-9)

        one, other = members()

        def of_stiffness(k):
            stiffer = changed(one, stiffness=k * one.stiffness)
            return jb.solve_contact(stiffer, other, **LOAD).dissipation

        step = 1e-5
        slope = (of_stiffness(1.0 + step) - of_stiffness(1.0 - step)) / (2.0 * step)
        found = jax.jit(jax.grad(of_stiffness))(1.0)
        assert float(found) == pytest.approx(float(slope), rel=1e-4)

    @pytest.mark.slow
    def test_derivatives_have_slope_two(self):
        gap = jnp.asarray(1e-5 * (np.asarray(upper().places) / 2.0) ** 2)

        def work(numbers):
            friction, bolt, height = numbers
            load = LOAD | {"friction": friction, "bolts": bolt, "gap": height * gap}
            return jb.solve_contact(upper(), lower(), **load).dissipation

        at, way = jnp.array([0.1, 1.0, 1.0]), jnp.array([0.02, 0.1, 0.5])
        value, slope = jax.jvp(work, (at,), (way,))
        errors = [abs(work(at + h * way) - value - h * slope) for h in (4e-3, 2e-3)]
        assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.3)


class TestMatrices:
    def test_a_slice_of_calculix_stretches_as_a_bar(self):
        made, body = slice_of(), strip_body()
        assert made.deck == (DATA / "strip.inp").read_text("ascii")
        free = ~np.array(body.fixed)
        free[1] = False  # nothing else holds its height
        pull = np.asarray(body.forces)[free, 0]
        stiffness = np.asarray(body.stiffness)[np.ix_(free, free)]
        u = float(body.flexibility[0, 0]) + pull @ np.linalg.solve(stiffness, pull)
        assert u == pytest.approx(2.0 / 3.4e4, rel=1e-6)
        assert float(body.forces[1::2, 1].sum()) == pytest.approx(-20.0, rel=1e-9)

    @pytest.mark.parametrize("kind", ["npz", "dense.npz", "mat", "mtx"])
    def test_every_file_holds_the_same_model(self, tmp_path, kind):
        model = jb.StiffnessModel.read(DATA / "strip.sti")
        path, dofs = tmp_path / f"strip.{kind}", model.dofs
        if kind == "npz":
            scipy.sparse.save_npz(path, model.matrix)
        elif kind == "dense.npz":
            np.savez(path, K=model.matrix.toarray(), dofs=dofs)
            dofs = None
        elif kind == "mat":
            scipy.io.savemat(path, {"K": model.matrix, "dofs": dofs})
            dofs = None
        else:
            scipy.io.mmwrite(path, model.matrix, symmetry="symmetric", precision=17)
        again = jb.StiffnessModel.read(path, dofs=dofs)
        np.testing.assert_allclose(again.matrix.toarray(), model.matrix.toarray(), rtol=1e-14)
        np.testing.assert_array_equal(again.dofs, model.dofs)

    def test_a_matrix_that_was_condensed_before_gives_the_same_body(self):
        body, made = strip_body(), slice_of()
        model = jb.StiffnessModel.read(DATA / "strip.sti")
        numbers = {tuple(dof): i for i, dof in enumerate(model.dofs.tolist())}
        loaded = [tuple(row) for row in [*made.contact[:, :1], *made.pull, *made.press]]
        nodes = {int(row[0]) for row in loaded}
        kept = [i for dof, i in numbers.items() if dof[0] in nodes]
        gone = np.setdiff1d(np.arange(len(numbers)), kept)
        full = model.matrix.toarray()
        parts = [full[np.ix_(a, b)] for a, b in ((kept, kept), (gone, gone), (gone, kept))]
        small = parts[0] - parts[2].T @ np.linalg.solve(parts[1], parts[2])
        again = jb.StiffnessModel(small, model.dofs[kept]).condensed(
            made.contact, pull=made.pull, press=[made.press]
        )
        scale = float(jnp.max(jnp.abs(body.stiffness)))
        np.testing.assert_allclose(again.stiffness, body.stiffness, atol=1e-10 * scale)
        np.testing.assert_allclose(again.forces, body.forces, atol=1e-10)

    def test_abaqus_text_is_read(self, tmp_path):
        text = "**\n*USER ELEMENT,NODES= 2,LINEAR\n** ELEMENT NODES\n**  7,  9,\n  1\n 2,  1\n"
        text += "*MATRIX,TYPE=STIFFNESS\n 2.0,\n-1.0, 3.0,\n"
        (tmp_path / "small.mtx").write_text(text)
        model = jb.StiffnessModel.read(tmp_path / "small.mtx")
        np.testing.assert_array_equal(model.matrix.toarray(), [[2.0, -1.0], [-1.0, 3.0]])
        np.testing.assert_array_equal(model.dofs, [[7, 1], [9, 1]])

    @pytest.mark.parametrize("kind", ["npz", "mat", "mtx"])
    def test_a_file_of_stiffness_and_mass_gives_both(self, tmp_path, kind):
        stiffness, mass = np.array([[2.0, -1.0], [-1.0, 3.0]]), np.array([[0.5, 0.1], [0.1, 0.25]])
        path, dofs = tmp_path / f"both.{kind}", [[7, 1], [9, 0]]  # the second one of a mode
        if kind == "npz":
            np.savez(path, stiffness=stiffness, mass=mass)
        elif kind == "mat":
            scipy.io.savemat(path, {"K": scipy.sparse.csc_array(stiffness), "M": mass})
        else:
            text = "*USER ELEMENT,NODES= 2\n** ELEMENT NODES\n** 7, 9\n  1\n 2, 1\n"
            text += "*MATRIX,TYPE=STIFFNESS\n 2.0,\n-1.0, 3.0\n*MATRIX,TYPE=MASS\n .5,\n.1, .25\n"
            path.write_text(text)
        model = jb.StiffnessModel.read(path, mass=path, dofs=dofs)
        np.testing.assert_array_equal(model.matrix.toarray(), stiffness)
        np.testing.assert_array_equal(model.mass.toarray(), mass)
        np.testing.assert_array_equal(model.dofs, dofs)

    def test_a_file_without_masses_is_no_file_of_masses(self, tmp_path):
        np.savez(tmp_path / "body.npz", stiffness=np.eye(2), dofs=[[1, 1], [2, 1]])
        with pytest.raises(jb.InputError, match=r"body.npz: holds no mass among .* \(stiffness\)"):
            jb.StiffnessModel.read(tmp_path / "body.npz", mass=tmp_path / "body.npz")

    def test_a_saved_body_is_read_again(self, tmp_path):
        lower().save(tmp_path / "lower.npz")
        again = jb.Substructure.read(tmp_path / "lower.npz")
        assert again.fixed == lower().fixed
        for name in ("places", "stiffness", "forces", "flexibility", "tributary"):
            np.testing.assert_array_equal(getattr(again, name), getattr(lower(), name))

    @pytest.mark.slow
    @pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
    def test_from_a_mesh_of_calculix_to_a_loop(self, tmp_path):
        scene = jb.Scene().replace({"model.section": "plane", "model.nodes": 49})
        body = calculix.body_of(calculix.strip_slice(scene, 49), tmp_path)
        found = jb.solve_contact(body, amplitude=scene.load.amplitude, assembly="frictionless")
        plane = jb.solve(scene)
        assert float(found.dissipation) == pytest.approx(float(plane.dissipation), rel=0.01)
        assert float(found.secant_stiffness) == pytest.approx(
            float(plane.secant_stiffness), rel=0.003
        )


def test_a_file_of_two_bodies_is_solved_by_the_command(tmp_path, capsys):
    made = slice_of()
    for name in ("contact", "pull"):
        np.savetxt(tmp_path / f"{name}.csv", getattr(made, name), delimiter=",", header="node")
    shutil.copy(DATA / "strip.sti", tmp_path)
    shutil.copy(DATA / "strip.dof", tmp_path)
    press = [row.tolist() for row in made.press]
    text = f"""
    amplitude = 0.4
    cycles = 1
    steps_per_half_cycle = 8
    [upper]
    file = "strip.sti"
    contact = "contact.csv"
    pull = "pull.csv"
    press = [{press}]
    """
    (tmp_path / "joint.toml").write_text(text)
    words = [str(tmp_path / "joint.toml"), "--friction", "0.2", "--json"]
    assert main(["bodies", *words, "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr()
    figures = json.loads(said.out)
    assert f"jbeamshell: warning: {figures['doubts'][0]}" in said.err
    load = {"amplitude": 0.4, "cycles": 1, "steps_per_half_cycle": 8, "friction": 0.2}
    own = jb.solve_contact(strip_body(), **load)
    assert figures["dissipation"] == pytest.approx(float(own.dissipation), rel=1e-9)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "loop.csv",
        "contact.csv",
        "result.json",
        "loop.png",
        "contact.png",
    }
    (tmp_path / "joint.toml").write_text(text.replace("cycles", "bicycles"))
    assert main(["bodies", words[0]]) == 2
    assert "key bicycles" in capsys.readouterr().err
    (tmp_path / "joint.toml").write_text("path = [0.1, -0.1, 0.1]\n" + text)
    assert main(["bodies", words[0]]) == 2
    assert "amplitude = 0.4: is given beside path" in capsys.readouterr().err
    (tmp_path / "joint.toml").write_text(text.replace('contact = "contact.csv"', ""))
    assert main(["bodies", words[0]]) == 2
    assert "upper.pull, press = 'without contact'" in capsys.readouterr().err


def changed(body, **arrays):
    names = ("places", "stiffness", "forces", "flexibility", "tributary", "fixed")
    return jb.Substructure(**{name: getattr(body, name) for name in names} | arrays)


@pytest.mark.parametrize(
    ("what", "said"),
    [
        (
            lambda: jb.solve_contact(upper(), changed(lower(), places=lower().places * 1.01)),
            "lower.places\\[24\\]",
        ),
        (lambda: jb.solve_contact(upper(), upper()), "with the other one: hold"),
        (lambda: changed(upper(), stiffness=-upper().stiffness), "has a negative mode"),
        (lambda: changed(upper(), stiffness=jnp.triu(upper().stiffness)), "is not symmetric"),
        (lambda: changed(upper(), forces=upper().forces[:-1]), "forces.shape"),
        (lambda: jb.solve_contact(changed(upper(), forces=upper().forces[:, :1])), "flexibility"),
        (lambda: jb.solve_contact(upper(), lower(), bolts=[1.0, 2.0]), "bolts"),
        (lambda: jb.solve_contact(upper(), lower(), bolts=np.nan), "bolts = .*NaN"),
        (lambda: jb.solve_contact(upper(), lower(), bolts=-1.0), "bolts = -1.0: must not be neg"),
        (lambda: jb.solve_contact(upper(), lower(), gap=-1.0), "gap = -1.0: must not be negative"),
        (lambda: jb.solve_contact(upper(), lower(), gap=np.nan), "gap = nan: holds NaN"),
        (lambda: jb.solve_contact(upper(), lower(), gap=np.inf), "gap = inf: holds NaN or inf"),
        (lambda: jb.solve_contact(upper(), lower(), path=[0.1, np.nan]), "path = .*finite"),
        (lambda: jb.solve_contact(upper(), lower(), path=[0.1], cycles=2), "beside path"),
        (lambda: jb.solve_contact(upper(), lower(), cycles=0), "cycles = 0: must be a whole"),
        (lambda: jb.solve_contact(upper(), lower(), cycles=2.5), "cycles = 2.5: must be a whole"),
        (lambda: jb.solve_contact(unpulled(), lower()), "nothing pulls the bodies"),
        (
            lambda: changed(upper(), tributary=0.0 * upper().places),
            "tributary = .*must be positive",
        ),
        (lambda: changed(upper(), tributary=-upper().tributary), "tributary = .*positive"),
        (lambda: changed(upper(), tributary=np.nan * upper().places), "tributary = .*NaN"),
        (lambda: changed(upper(), places=np.inf * upper().places), "places = .*NaN or infinity"),
        (lambda: changed(upper(), fixed=[3] * 50), "fixed\\[0\\] = 3: choose False or True"),
        (lambda: changed(upper(), flexibility=-np.eye(2)), "flexibility = .*negative mode"),
        (lambda: jb.StiffnessModel(np.eye(2), [[14.7, 1], [14, 2]]), "dofs = .*14.7.*whole"),
        (lambda: jb.StiffnessModel(np.eye(2), [[14, 0], [14, 1]]), "directions are 1 to 6"),
        (lambda: jb.solve_contact("upper"), "give a jbeamshell.Substructure"),
        (lambda: jb.StiffnessModel(np.eye(3)[:2], [[1, 1], [1, 2]]), "must be square"),
        (lambda: jb.StiffnessModel(np.eye(2), [[1, 1]]), "each of its 2 rows"),
        (lambda: jb.StiffnessModel(np.tri(2), [[1, 1], [1, 2]]), "is not symmetric"),
        (lambda: jb.StiffnessModel.read("upper.xyz"), "it must end in .npz"),
        (lambda: jb.StiffnessModel.read("upper.op4"), "upper.op4: .*anew, by scipy.io.mmwrite"),
        (lambda: jb.Substructure.read(DATA / "strip.sti"), "is no .npz file"),
    ],
)
def test_what_is_no_body_is_refused(what, said):
    with pytest.raises(jb.InputError, match=said):
        what()


def unpulled():
    return changed(
        upper(),
        forces=upper().forces.at[:, 0].set(0.0),
        flexibility=upper().flexibility.at[0].set(0.0).at[:, 0].set(0.0),
    )


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"held": [[999, 1]]}, "held = node 999, direction 1: is not in the model"),
        ({"held": [[5, 3]]}, "held = node 5, direction 3: is not in the model"),
        ({"held": [[5.5, 1]]}, "held = .*5.5.*whole numbers"),
        ({"held": [5, 1]}, "held = \\(2,\\): give rows of node and direction"),
        ({"contact": [[1.5, 0.0], [2, 1.0]]}, "contact = .*1.5.*whole numbers"),
        ({"contact": [[1, 0.0], [2, np.nan]]}, "contact = .*NaN or infinity"),
        ({"contact": [["left", 0.0], [2, 1.0]]}, "contact = .*no table of numbers"),
        ({"pull": [[5.5, 1, 1.0]]}, "pull = .*5.5.*whole numbers"),
        ({"pull": [[5, 1.5, 1.0]]}, "pull = .*1.5.*whole numbers"),
        ({"pull": [[5, 1]]}, "pull = \\(1, 2\\): give rows of node, direction and force"),
        ({"press": [[[5, 2, np.inf]]]}, "press\\[0\\] = .*NaN or infinity"),
        ({"tangential": 3}, "tangential = 3: is a direction that no node of the contact has"),
        ({"tangential": 1.5}, "tangential = 1.5: must be a whole number"),
        ({"normal": 1}, "normal = 1: must differ from tangential"),
        ({"tributary": [-1.0] * 6}, "tributary = .*must be positive"),
    ],
)
def test_numbers_of_tables_are_checked(tables, said):
    model, made = jb.StiffnessModel.read(DATA / "strip.sti"), slice_of()
    with pytest.raises(jb.InputError, match=said):
        model.condensed(
            **{"contact": made.contact, "pull": made.pull, "press": [made.press]} | tables
        )


def test_supports_may_be_none_and_may_hold_contact_nodes():
    model, made = jb.StiffnessModel.read(DATA / "strip.sti"), slice_of()
    given = {"contact": made.contact, "pull": made.pull, "press": [made.press]}
    none = model.condensed(**given, held=[])
    np.testing.assert_array_equal(none.stiffness, strip_body().stiffness)
    first = [(int(node), way) for node, x in made.contact if x == 0.0 for way in (1, 2)]
    rows = set(map(tuple, model.dofs.tolist()))
    held = model.condensed(**given, held=[dof for dof in first if dof in rows])
    assert held.fixed[:2] == (True, True)


def test_a_pressing_that_only_friction_holds_along_x_is_refused_without_friction():
    forces = upper().forces.at[::2, 1].add(0.01)
    pushed = changed(upper(), forces=forces)
    with pytest.raises(jb.InputError, match="only friction holds the body"):
        jb.solve_contact(pushed, lower(), **LOAD)
    assert jb.solve_contact(pushed, lower(), **LOAD | {"assembly": "frictional"}).converged


def test_the_result_says_how_the_bodies_were_pressed():
    for assembly in ("frictionless", "frictional"):
        found = jb.solve_contact(upper(), lower(), **LOAD | {"assembly": assembly})
        assert found.figures()["assembly"] == assembly
        words = {"frictionless": "without friction", "frictional": "with friction"}
        assert f"pressed {words[assembly]}" in str(found).splitlines()[0]
    plain = jb.solve_contact(upper(), lower(), amplitude=1.0, steps_per_half_cycle=8)
    assert plain.assembly == jb.Scene().member.assembly


def test_tables_that_do_not_fit_the_model_are_refused():
    model, made = jb.StiffnessModel.read(DATA / "strip.sti"), slice_of()
    with pytest.raises(jb.InputError, match="contact = 999: is no node"):
        model.condensed([[999, 0.0], [1, 1.0]])
    with pytest.raises(jb.InputError, match="node 999, direction 2: is not in the model"):
        model.condensed(made.contact, press=[[[999, 2, 1.0]]])
    loose = jb.StiffnessModel(
        np.diag([1.0, 1.0, 1.0, 1.0, 0.0]), [[1, 1], [1, 2], [2, 1], [2, 2], [3, 1]]
    )
    with pytest.raises(jb.InputError, match="a part moves freely"):
        loose.condensed([[1, 0.0], [2, 1.0]])


@pytest.mark.parametrize(
    ("friction", "amplitude", "assembly", "points"),
    [
        (0.9, 0.2, "frictional", True),
        (5.0, 0.1, "frictionless", True),
        (1.0, 0.01, "frictionless", False),
    ],
)
def test_a_line_on_which_nothing_slips_loses_exactly_nothing(friction, amplitude, assembly, points):
    body = jb.Substructure.read(data_folder() / "calculix_body.npz")
    choices = {"assembly": assembly, "points": points, "throw": False}
    history = jb.solve_contact(body, friction=friction, amplitude=amplitude, **choices)
    lost = [history.figures()[name] for name in ("dissipation", "dissipation_loop", "loss_factor")]
    assert lost == [0.0, 0.0, 0.0]
    little = jb.solve_contact(body, friction=0.1, amplitude=0.05, **choices)
    assert float(little.dissipation) > 1e-14  # of a loop of 7e-8, which is no rounding
    assert float(little.dissipation_loop) == pytest.approx(float(little.dissipation), rel=0.01)


def test_gross_slip_is_told():
    with pytest.raises(jb.UnconvergedError, match="all of the contact slides"):
        jb.solve_contact(upper(), lower(), **LOAD | {"amplitude": 3.0})


def test_bodies_need_double_precision():
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(jb.InputError, match="need double precision"):
            jb.Substructure(np.arange(2.0), np.eye(4), np.ones((4, 2)))
    finally:
        jax.config.update("jax_enable_x64", True)
