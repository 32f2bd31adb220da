"""Mesh of a CalculiX or Abaqus deck: its nodes, and the faces of its elements that it names.

What is read are ``*NODE``, ``*ELEMENT``, ``*ELSET``, ``*SURFACE``, ``*ELASTIC`` and ``*DENSITY`` of
a flat deck; all else is passed over.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jbeamshell.common.checks import require
from jbeamshell.common.errors import InputError
from jbeamshell.measured.tables import read_bytes

# Corners of the faces S1, S2, ... by the number of an element's corners, counter-clockwise as seen
# from outside.
FACES = {
    4: ("132", "124", "234", "143"),
    6: ("132", "456", "1254", "2365", "3146"),
    8: ("1432", "5678", "1265", "2376", "3487", "4158"),
}
# Ends of the edges whose middles are the nodes after the corners, in turn.
EDGES = {
    4: ("12", "23", "13", "14", "24", "34"),
    6: ("12", "23", "13", "45", "56", "46", "14", "25", "36"),
    8: ("12", "23", "34", "14", "56", "67", "78", "58", "15", "26", "37", "48"),
}
CORNERS = {4: 4, 6: 6, 8: 8, 10: 4, 15: 6, 20: 8}  # of an element by the number of its nodes
FLAT = ("PART", "INSTANCE", "ASSEMBLY")


class Card(NamedTuple):
    """Keyword of a deck, its parameters by name, and the words of its data lines."""

    keyword: str
    options: dict[str, str]
    rows: list[list[str]]


class Deck(NamedTuple):
    """Mesh of a deck.

    Attributes
    ----------
    places : X, Y and Z by node
    elements : nodes by element
    surfaces : by name, elements and the numbers of their faces
    elastic, densities : Young's modulus and Poisson's ratio, and the density, of each material
    """

    places: dict[int, list[float]]
    elements: dict[int, list[int]]
    surfaces: dict[str, list[tuple[int, int]]]
    elastic: list[tuple[float, float]]
    densities: list[float]

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Deck:
        """Mesh in a file.

        Raises
        ------
        InputError
            if the file cannot be read, is no deck or has parts, or one of its lines makes no sense
        """
        text = read_bytes(path).decode("latin-1")
        deck, sets = cls({}, {}, {}, [], []), dict[str, list[int]]()
        for card in _cards(text, Path(path).parent):
            try:
                _take(deck, sets, card)
            except (ValueError, IndexError, KeyError) as error:
                words = f"*{card.keyword}: a line makes no sense ({type(error).__name__}: {error})"
                raise InputError(f"{path}: {words}") from None
        found = len(deck.places), len(deck.elements)
        fix = "is no deck of nodes and elements"
        require(str(path), f"{found[0]} nodes, {found[1]} elements", min(found) > 0, fix)
        return deck

    def surface(self, name: str) -> tuple[NDArray[np.float64], list[list[int]]]:
        """Nodes and elements of a face, as `jbeamshell.face_surface` takes them.

        Its normals then point out of the body.

        Parameters
        ----------
        name : of a ``*SURFACE`` of faces of elements

        Raises
        ------
        InputError
            for a name that the deck does not have, or a face that its elements do not have
        """
        known = ", ".join(self.surfaces) or "none"
        faces = self.surfaces.get(name.upper())
        if faces is None:
            raise InputError(f"surface = {name!r}: is none of the deck's: {known}")
        rows = [self._corners(name, element, face) for element, face in faces]
        require("surface", name, bool(rows), "has no faces of elements")
        nodes = sorted({node for row in rows for node in row})
        for node in nodes:
            require("surface", f"{name}, node {node}", node in self.places, "has no *NODE line")
        return np.array([[node, *self.places[node]] for node in nodes]), rows

    def _corners(self, name: str, element: int, face: int) -> list[int]:
        """Nodes of a face of an element, its corners and then those on its edges, in turn."""
        key = f"{name}, element {element}"
        nodes = self.elements.get(element)
        if nodes is None:
            raise InputError(f"surface = {key}: is no element of the deck")
        corners = CORNERS.get(len(nodes), 0)
        fix = f"has {len(nodes)} nodes: give bricks, wedges or tetrahedra"
        require("surface", key, corners > 0, fix)
        sides = FACES[corners]
        fix = f"has the faces S1 to S{len(sides)}"
        require("surface", f"{key}, S{face}", 1 <= face <= len(sides), fix)
        around = [int(corner) for corner in sides[face - 1]]
        row = [nodes[corner - 1] for corner in around]
        if len(nodes) > corners:
            ends = zip(around, [*around[1:], around[0]], strict=True)
            middles = [EDGES[corners].index("".join(map(str, sorted(end)))) for end in ends]
            row += [nodes[corners + middle] for middle in middles]
        return row


def _cards(text: str, folder: Path) -> Iterator[Card]:
    """Keywords of a deck in turn, those of included files among them."""
    lines = (line.strip() for line in text.splitlines())
    card: Card | None = None
    head = ""
    for line in (line for line in lines if line and not line.startswith("**")):
        if line.startswith("*") or head:
            head += line
            if head.endswith(","):
                continue  # its parameters go on
            if card is not None:
                yield from _included(card, folder)
            card, head = _card(head), ""
        elif card is not None:
            card.rows.append([word.strip() for word in line.split(",")])
    if card is not None:
        yield from _included(card, folder)


def _included(card: Card, folder: Path) -> Iterator[Card]:
    """Card itself, or the cards of the file that it includes."""
    if card.keyword != "INCLUDE":
        yield card
        return
    name = card.options.get("INPUT", "").strip("\"'")
    text = read_bytes(folder / name).decode("latin-1")
    require("*INCLUDE", name, "*INCLUDE" not in text.upper(), "includes others: write one deck")
    yield from _cards(text, folder)


def _card(head: str) -> Card:
    """Card of a keyword line, without data."""
    keyword, *options = (word.strip() for word in head[1:].split(","))
    pairs = (option.partition("=") for option in options)
    return Card(keyword.upper(), {k.strip().upper(): v.strip() for k, _, v in pairs}, [])


def _take(deck: Deck, sets: dict[str, list[int]], card: Card) -> None:
    """Add what a card says to a mesh and to its sets of elements."""
    keyword, options, rows = card
    fix = "write a flat deck, without parts: their node numbers are not those of a matrix"
    require("deck", f"*{keyword}", keyword not in FLAT, fix)
    name = options.get("ELSET", options.get("NAME", "")).upper()
    if keyword == "NODE":
        for row in rows:
            places = [float(word) for word in row[1:4] if word]
            deck.places[int(row[0])] = places + [0.0] * (3 - len(places))
    elif keyword == "ELEMENT":
        words, numbers = [word for row in rows for word in row if word], list[int]()
        count = _nodes_of(options.get("TYPE", ""), rows)
        for start in range(0, len(words), count + 1):
            number, *nodes = (int(word) for word in words[start : start + count + 1])
            if len(nodes) != count:
                raise ValueError(f"element {number} has {len(nodes)} nodes, not {count}")
            deck.elements[number] = nodes
            numbers.append(number)
        sets.setdefault(name, []).extend(numbers)
    elif keyword == "ELSET":
        sets.setdefault(name, []).extend(_members(sets, rows, "GENERATE" in options))
    elif keyword == "SURFACE" and options.get("TYPE", "ELEMENT").upper() == "ELEMENT":
        faces = deck.surfaces.setdefault(name, [])
        for which, side, *_ in rows:
            elements = [int(which)] if which.isdigit() else sets[which.upper()]
            faces.extend((element, int(side.upper().removeprefix("S"))) for element in elements)
    elif keyword == "ELASTIC" and options.get("TYPE", "ISO").upper().startswith("ISO"):
        deck.elastic.append((float(rows[0][0]), float(rows[0][1])))
    elif keyword == "ELASTIC":
        deck.elastic.extend([(np.nan, np.nan), (0.0, 0.0)])  # of no use to check by
    elif keyword == "DENSITY":
        deck.densities.append(float(rows[0][0]))


def _nodes_of(kind: str, rows: list[list[str]]) -> int:
    """Number of nodes of a type of element such as C3D8I; else that of the first line."""
    digits = ""
    for letter in kind.upper().partition("3D")[2]:
        if not letter.isdigit():
            break
        digits += letter
    return int(digits) if digits else sum(map(bool, rows[0])) - 1


def _members(sets: dict[str, list[int]], rows: list[list[str]], generate: bool) -> list[int]:
    """Elements of the lines of a set."""
    if generate:
        ranges = [[int(word) for word in row if word] for row in rows]
        return [n for first, last, *step in ranges for n in range(first, last + 1, *step)]
    words = [word for row in rows for word in row if word]
    return [n for word in words for n in ([int(word)] if word.isdigit() else sets[word.upper()])]
