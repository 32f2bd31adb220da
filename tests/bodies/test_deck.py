"""Decks: closed surfaces of every element, the grammar, and the lap that ships."""

import shutil

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

import jbeamshell as jb
from calibration.finite_elements.bolted_lap import decks
from calibration.finite_elements.boxes import box
from calibration.finite_elements.bricks import run
from jbeamshell.measured.example import data_folder
from tests.damaged import damage

LAP = data_folder() / "bolted_lap"
NODES = """
*NODE, NSET=ALL
1, 0., 0., 0.
2, 2., 0., 0.
3, 2., 3., 0.
4, 0., 3., 0.
5, 0., 0., 1.
6, 2., 0., 1.
7, 2., 3., 1.
8, 0., 3., 1.
"""
BRICK = NODES + "*ELEMENT, TYPE=C3D8, ELSET=ONE\n10, 1, 2, 3, 4, 5, 6, 7, 8\n"


def read(text, folder):
    (folder / "deck.inp").write_text(text)
    return jb.Deck.read(folder / "deck.inp")


class TestElements:
    @pytest.mark.parametrize(
        ("kind", "nodes", "sides", "volume"),
        [
            ("C3D8", [1, 2, 3, 4, 5, 6, 7, 8], 6, 6.0),
            ("C3D8I", [1, 2, 3, 4, 5, 6, 7, 8], 6, 6.0),
            ("C3D6", [1, 2, 3, 5, 6, 7], 5, 3.0),
            ("C3D4", [1, 2, 4, 5], 4, 1.0),
        ],
    )
    def test_all_sides_are_a_closed_surface_that_faces_outwards(
        self, kind, nodes, sides, volume, tmp_path
    ):
        words = ", ".join(map(str, nodes))
        faces = "".join(f"7, S{k}\n" for k in range(1, sides + 1))
        text = f"{NODES}*ELEMENT, TYPE={kind}\n7, {words}\n*SURFACE, NAME=WHOLE\n{faces}"
        deck = read(text, tmp_path)
        flow, inside = np.zeros(3), 0.0
        for k in range(1, sides + 1):
            deck.surfaces["ONE"] = [(7, k)]
            table, elements = deck.surface("ONE")
            made = jb.face_surface(table, elements)
            flow += made.areas @ made.normals
            inside += np.sum(made.areas * np.sum(table[:, 1:] * made.normals, axis=1)) / 3.0
        np.testing.assert_allclose(flow, 0.0, atol=1e-12)
        assert inside == pytest.approx(volume)  # by the divergence theorem
        assert len(deck.surface("whole")[1]) == sides


class TestGrammar:
    def test_sets_included_files_and_long_lines_are_read(self, tmp_path):
        (tmp_path / "mesh.inc").write_text(NODES)
        text = """** a comment
        *Include, Input=mesh.inc
        *Element, type=C3D8R,
        elset=Bricks
        1, 1, 2, 3, 4,
        5, 6, 7, 8
        *ELSET, ELSET=Some, GENERATE
        1, 1, 1
        *ELSET, ELSET=MORE
        SOME
        *Surface, Name=Top, Type=ELEMENT
        More, S2
        *SURFACE, NAME=POINTS, TYPE=NODE
        5
        *STEP
        """
        deck = read(text, tmp_path)
        table, elements = deck.surface("TOP")
        assert elements == [[5, 6, 7, 8]]
        np.testing.assert_array_equal(table[:, 3], 1.0)
        assert list(deck.surfaces) == ["TOP"]

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("*HEADING\n", "0 nodes, 0 elements"),
            (BRICK.replace("2., 3., 0.", "2., x, 0."), r"\*NODE: a line makes no sense"),
            (BRICK.replace(", 8\n", "\n"), "has 7 nodes, not 8"),
            (BRICK + "*SURFACE, NAME=A\nTWO, S1\n", r"\*SURFACE: a line makes no sense"),
            ("*PART, NAME=P\n" + BRICK, "flat deck"),
            ("*INCLUDE, INPUT=nothing.inc\n", "nothing.inc"),
        ],
    )
    def test_a_deck_that_makes_no_sense_is_refused(self, text, words, tmp_path):
        with pytest.raises(jb.InputError, match=words):
            read(text, tmp_path)

    @pytest.mark.parametrize(
        ("lines", "words"),
        [
            ("", "surface = 'A': is none of the deck's: none"),
            ("*SURFACE, NAME=A\n11, S1\n", "element 11: is no element"),
            ("*SURFACE, NAME=A\n10, S7\n", "S7': has the faces S1 to S6"),
            ("*SURFACE, NAME=A\n", "has no faces"),
            ("*ELEMENT, TYPE=S4\n3, 1,2,3,4,5\n*SURFACE, NAME=A\n3, S1\n", "give bricks"),
            (
                "*ELEMENT, TYPE=C3D4\n3, 1,2,3,99\n*SURFACE, NAME=A\n3, S2\n",
                "node 99': has no \\*NODE",
            ),
        ],
    )
    def test_a_surface_that_cannot_be_is_refused(self, lines, words, tmp_path):
        deck = read(BRICK + lines, tmp_path)
        with pytest.raises(jb.InputError, match=words):
            deck.surface("A")


class TestTables:
    def test_bodies_without_decks_are_paired_by_their_places(self, tmp_path):
        sides, tables = {"upper": 0.0, "lower": -1.0}, {}
        draw = np.random.default_rng(0)
        for name, z in sides.items():
            model, places = box((3, 2, 1), (3.0, 2.0, 1.0), at=(0.0, 0.0, z))
            matrices = {"stiffness": model.matrix.toarray(), "mass": model.mass.toarray()}
            np.savez(tmp_path / f"{name}.npz", dofs=model.dofs, **matrices)
            nodes = 1 + draw.permutation(np.flatnonzero(places[:, 2] == 0.0))
            tables[name] = np.column_stack([nodes, places[nodes - 1]])
        np.savetxt(tmp_path / "face.csv", tables["upper"], delimiter=",", header="node,x,y,z")
        number = np.arange(1, 25, 2).reshape(4, 3)
        quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]])
        text = f"""
        bolts = 2.0
        [upper]
        file = "upper.npz"
        mass = "upper.npz"
        face = "face.csv"
        elements = {quads.reshape(4, -1).T.tolist()}
        pull = [[2, 1, 1.0]]
        press = [[[2, 3, -1.0]]]
        [lower]
        file = "lower.npz"
        mass = "lower.npz"
        face = {tables["lower"].tolist()}
        held = [[1, 1], [1, 2], [1, 3]]
        press = [[[3, 3, 1.0]]]
        """
        (tmp_path / "joint.toml").write_text(text)
        upper, lower, options = jb.read_parts(tmp_path / "joint.toml")
        assert options == {"bolts": 2.0}
        np.testing.assert_array_equal(upper.contact[:, 1:], lower.contact[:, 1:])
        above = upper.body()
        assert float(np.sum(above.tributary)) == pytest.approx(6.0)
        np.testing.assert_allclose(lower.tributary, above.tributary)
        assert upper.model.mass is not None
        assert len(lower.model.dofs) == 3 * 24 - 3


class TestLap:
    def test_its_parts_have_the_areas_and_the_resultants_of_its_surfaces(self):
        upper, lower, options = jb.read_parts(LAP / "joint.toml")
        assert options["bolts"] == [8e3, 8e3]
        for part, sign in ((upper, -1.0), (lower, 1.0)):
            made = jb.face_surface(part.contact, part.elements, part.normals)
            assert np.sum(made.areas) == pytest.approx(60.0 * 30.0)
            np.testing.assert_allclose(part.normals[:, 2], 1.0)
            assert len(part.press) == 2
            for bolt in part.press:
                assert set(bolt[:, 1]) == {3.0}
                assert np.sum(bolt[:, 2]) == pytest.approx(sign)
        np.testing.assert_allclose(upper.contact[:, 1:], lower.contact[:, 1:])
        assert set(upper.pull[:, 1]) == {1.0}
        assert np.sum(upper.pull[:, 2]) == pytest.approx(1.0)

    @pytest.mark.skipif(shutil.which("ccx") is None, reason="needs CalculiX")
    def test_calculix_writes_the_matrices_that_ship(self, tmp_path):
        deck = decks()["lower"]
        assert deck == (LAP / "lower.inp").read_text()
        run(deck, tmp_path, "lower")
        files = (LAP / "lower.npz",) * 2, (tmp_path / "lower.sti", tmp_path / "lower.mas")
        shipped, fresh = (
            np.sort(eigsh(model.matrix, 4, model.mass, sigma=-1.0, return_eigenvectors=False))
            for model in (jb.StiffnessModel.read(k, mass=m) for k, m in files)
        )
        np.testing.assert_allclose(shipped, fresh, rtol=1e-3)  # inner displacements are eliminated
        with_modes = deck.replace("*FREQUENCY, SOLVER=MATRIXSTORAGE\n1", "*FREQUENCY\n4")
        lines = run(with_modes, tmp_path, "modes").splitlines()
        rows = [line.split() for line in lines if len(line.split()) == 5][:4]
        np.testing.assert_allclose(fresh, [float(row[1]) for row in rows], rtol=1e-6)

    def test_a_damaged_deck_is_refused_or_read(self, tmp_path):
        good, path = (LAP / "upper.inp").read_bytes(), tmp_path / "deck.inp"
        refused = 0
        for seed in range(100):
            path.write_bytes(damage(good, [b"*NODE\n1, 2"], np.random.default_rng(seed))[1])
            try:
                deck = jb.Deck.read(path)
                for name in ("FACE", "BOLT_1", "BOLT_2", "END"):
                    jb.face_surface(*deck.surface(name))
            except jb.InputError:
                refused += 1
        assert refused > 50  # the others changed what none of these surfaces has
