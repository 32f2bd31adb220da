"""Body on its contact line: a linear elastic strip with everything but the contact eliminated.

A strip whose section stores a quadratic energy in its fields and their slopes couples each station
along X to the next one only.  All fields but the contact's (tangential displacement v, lift w) are
eliminated station by station from the far end, with the contact's fields and the end load as
right-hand sides.  What is left are dense matrices over the contact nodes.

The unknowns of a station are the steps of its fields from the next station.  A short element is
stiff against a step over its length, and soft if it moves as a whole.  With the fields themselves
as unknowns these two would have to cancel, and round-off would grow.
"""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from jbeamshell.common.numbers_of import numbers_of, pad, put, scan
from jbeamshell.common.pytrees import Tree
from jbeamshell.contact_line.ends import End
from jbeamshell.mechanics.section_form import Matrices, SectionForm
from jbeamshell.numerics.factors import inverse_cholesky

PARTS = 3  # of a strip, eliminated one after the other with as many contact nodes as they know
FEW = 100  # nodes up to which one part, which compiles in a third of the time, is as fast


class Body(Tree):
    """Matrices of a body over its n contact nodes, numbered from the loaded end.

    With v and w the tangential displacements and lifts since the pressure, F the end load and r the
    nodal forces of the base on the body,

        r_t = K_tt v + K_tn w - f_t F,    r_n = r_0 + K_tn' v + K_nn w - f_n F,
        u = c F + f_t.v + f_n.w.

    Attributes
    ----------
    x : (n,) positions X
    tributary : (n,) contact length of each node
    K_tt, K_tn, K_nn : (n, n) stiffness, force per width and length
    f_t, f_n : (n,) part of the end load that a clamped contact node carries
    r_0 : (n,) nodal forces of the base under the pressures alone
    t_0 : (k,) tangential ones, which are zero if the strip was pressed without friction
    c : displacement of the loaded end per end load with a clamped contact
    """

    x: Array
    tributary: Array
    K_tt: Array
    K_tn: Array
    K_nn: Array
    f_t: Array
    f_n: Array
    r_0: Array
    t_0: Array
    c: Array


class Elimination(NamedTuple):
    """Elimination of the fields between the contact's, station by station, to find them again.

    The right-hand sides are v and w of all stations, the end load, and p pressures.  The unknowns
    are the steps of the fields to a station from the next one, and at both ends the fields.

    Attributes
    ----------
    inverse : (n-2, m-2, m-2) inverses of the Cholesky factors
    sides : (n-2, m-2, 2n+1+p) right-hand sides, reduced
    onwards : (n-2, m-2, m-2) coupling to the fields of the next station, reduced
    first : (m-2, 2n+1+p), (m-2, m-2) fields of the first station from the sides and from its next
    last : (m-2, 2n+1+p) fields of the last station from the sides
    sizes : (p,) of the pressures that act as one
    """

    inverse: Array
    sides: Array
    onwards: Array
    first: tuple[Array, Array]
    last: Array
    sizes: Array

    @property
    def forgotten(self) -> Unknown:
        """Elimination by which the fields are not found again."""
        return Unknown.of(self.inverse.shape[0] + 2, self.inverse.shape[1] + 2)

    def pressed(self, sizes: Array) -> Elimination:
        """Elimination under pressures of some sizes (p,) that act as one."""
        return self._replace(sizes=sizes)

    def recovered(self, factors: Array) -> Array:
        """Fields (n, m-2, levels) from factors (2n+2, levels) of v, w, end load and pressure."""
        xp = numbers_of(self, factors)
        factors = xp.concatenate([factors[:-1], self.sizes[:, None] * factors[-1:]])

        def back(after: Array, station: tuple[Array, ...]) -> tuple[Array, Array]:
            inverse, sides, onwards = station
            here = after - inverse.T @ (sides + onwards @ after)
            return here, here

        last = self.last @ factors
        stations = (self.inverse, self.sides @ factors, self.onwards)
        second, inner = scan(back, last, stations, reverse=True)
        first = self.first[0] @ factors + self.first[1] @ second
        return xp.concatenate([first[None], inner, last[None]])


class Unknown(NamedTuple):
    """Elimination of a body whose inner fields nobody asks for: they are NaN.

    Attributes
    ----------
    nothing : (n, m-2, 0) no values: the shape alone says for which fields
    """

    nothing: Array | np.ndarray

    @classmethod
    def of(cls, nodes: int, fields: int) -> Unknown:
        """Elimination of a body of so many nodes whose form has so many fields."""
        return cls(np.zeros((nodes, fields - 2, 0)))

    @property
    def forgotten(self) -> Unknown:
        """The same."""
        return self

    def pressed(self, sizes: Array) -> Unknown:
        """The same."""
        del sizes
        return self

    def recovered(self, factors: Array) -> Array:
        """Fields (n, m-2, levels), see `Elimination.recovered`."""
        none: Any = np.full((*self.nothing.shape[:-1], factors.shape[1]), np.nan)
        return none


class Line(NamedTuple):
    """Strip on its contact line.

    Attributes
    ----------
    elimination : what finds the eliminated fields again
    hessian : (2n+1+p, 2n+1+p) of the potential in v and w of all stations, end load and p pressures
    """

    elimination: Elimination
    hessian: Array


def eliminate(form: SectionForm, x: Array, loads: Array, far: End, *last: End) -> tuple[Line, ...]:
    """Strips of linear elements that differ at their last station alone, on their contact line.

    Parameters
    ----------
    form : energy of the section, m fields
    x : (n,) stations, increasing, the loaded end last; three or more
    loads : (n, p) nodal forces of p pressures on the top face
    far : conditions at the first station; where v and w of the contact are held is left to the
        caller
    last : conditions at the last station of each strip
    """
    xp, n, count = numbers_of(form, x, loads), x.size, 1 + loads.shape[1]
    columns = 2 * n + count

    def go(
        carry: tuple[Array, Array], station: tuple[Array, ...]
    ) -> tuple[tuple[Array, Array], tuple[Array, Array, Array]]:
        before, forces = carry
        i, load, length, start, across = station
        stays, follows = form.moved(length)
        forces = _add(forces, form.press[2:, None] * load, -loads.shape[1])
        contacts = xp.concatenate([start[2:, :2], across[2:, :2]], axis=1)
        inverse = inverse_cholesky(before + start[2:, 2:])
        sides = inverse @ _add(forces, contacts, 2 * i)
        onwards = inverse @ (before + stays.T[2:, 2:])
        contacts = xp.concatenate([stays[2:, :2], follows[2:, :2]], axis=1)
        forces = _add(forces - onwards.T @ sides, contacts, 2 * i)
        whole = (stays + follows)[2:, 2:]
        return (before + whole - onwards.T @ onwards, forces), (inverse, sides, onwards)

    lengths = xp.diff(x)
    start, end, across = form.element(lengths)
    carry, first, hessian = _begin(form, (start[0], end[0], across[0]), loads[0], far)
    hessian, parts = _wider(_wider(hessian, columns, count).T, columns, count), []
    stations = (xp.arange(1, n - 1), loads[1:-1], lengths[1:], start[1:], across[1:])
    # No station knows a contact node beyond its next one: the right-hand sides grow part by part.
    several = PARTS if n > FEW else 1
    for begin, stop in itertools.pairwise(np.linspace(0, n - 2, several + 1).astype(int)):
        carry = carry[0], _wider(carry[1], 2 * stop + 4 + count, count)
        carry, part = scan(go, carry, tuple(values[begin:stop] for values in stations))
        parts.append(part)
        hessian = hessian - _products(part[1], columns, count)
    inverse, sides, onwards = (
        xp.concatenate([part[0] for part in parts]),
        xp.concatenate([_wider(part[1], columns, count) for part in parts]),
        xp.concatenate([part[2] for part in parts]),
    )
    first = _wider(first[0], columns, count), first[1]
    hessian = hessian + _contacts(form, (start, end, across), loads)
    sizes = xp.ones(loads.shape[1], x.dtype)
    ends = [_finish(form, loads[-1], carry, end) for end in last]
    return tuple(
        Line(Elimination(inverse, sides, onwards, first, fields, sizes), hessian + change)
        for fields, change in ends
    )


def _begin(
    form: SectionForm, element: Matrices, load: Array, far: End
) -> tuple[tuple[Array, Array], tuple[Array, Array], Array]:
    """Elimination of the first station; the sides are v and w of two stations, and the loads.

    Parameters
    ----------
    element : matrices (m, m) of the first element, see `SectionForm.element`
    load : (p,) nodal forces of the pressures

    Returns
    -------
    carry : stiffness (m-2, m-2) of the second station's fields, and their sides (m-2, 5 + p)
    first : fields of the first station from the sides (m-2, 5 + p) and from the next (m-2, m-2)
    hessian : (5 + p, 5 + p) of the energy of the first station's fields in the sides
    """
    start, end, across = element
    xp, none = numbers_of(start, load), 0.0 * start[:, :1]
    forces = [none, none, across[:, :2], none, load * form.press[:, None]]
    fields, back, hessian = _of_end(start, xp.concatenate(forces, axis=1), far, 0)
    onwards = back.T @ across[:, 2:]
    sides = across.T @ fields + pad(end[:, :2], (0, 0), (2, 1 + load.size))
    carry = end[2:, 2:] - onwards.T @ onwards, sides[2:]
    return carry, (fields[2:], -(back @ onwards)[2:]), hessian


def _finish(
    form: SectionForm, load: Array, carry: tuple[Array, Array], loaded: End
) -> tuple[Array, Array]:
    """Elimination of the last station, on which the pressures have forces (p,).

    Returns
    -------
    last : (m-2, 2n+1+p) its fields from the sides
    hessian : (2n+1+p, 2n+1+p) of the energy of its fields in the sides
    """
    xp = numbers_of(carry, loaded)
    before, sides = (pad(part, (2, 0), (0, 0)) for part in carry)
    ends = xp.column_stack([-loaded.pull, form.press[:, None] * load])
    count = ends.shape[1]
    forces = _add(sides, ends, -count)
    before = pad(before, (0, 0), (2, 0))
    fields, _, hessian = _of_end(before, forces, loaded, sides.shape[1] - count - 2)
    return fields[2:], put(hessian, (-count, -count), hessian[-count, -count] - loaded.softness)


def _of_end(stiffness: Array, forces: Array, end: End, place: int) -> tuple[Array, Array, Array]:
    """Elimination of the fields of a station at an end.

    Parameters
    ----------
    stiffness : (m, m) of its fields, without what lies beyond
    forces : (m, sides) on its fields
    end : its conditions
    place : column of its v and w among the sides

    Returns
    -------
    fields : (m, sides) its fields
    back : (m, k) inverse factor of its free fields' stiffness
    hessian : (sides, sides) of the energy in the sides
    """
    contact, free = end.span[:, :2], end.span[:, 2:]
    whole = stiffness + end.stiffness
    contacts = pad(contact, (0, 0), (place, forces.shape[1] - 2 - place))
    back = free @ inverse_cholesky(free.T @ whole @ free).T
    reduced = back.T @ (forces + whole @ contacts)
    hessian = contacts.T @ forces
    hessian = hessian + hessian.T + contacts.T @ whole @ contacts - reduced.T @ reduced
    return contacts - back @ reduced, back, hessian


def _add(sides: Array, block: Array, column: ArrayLike) -> Array:
    """Sum of sides and a block (rows, k) at some of their columns; -k stands for the last ones."""
    if numbers_of(sides, block) is np:
        total: Any = np.array(sides)
        total[:, np.arange(block.shape[1]) + column] += block
        return total
    old = lax.dynamic_slice(sides, (0, column), block.shape)
    return lax.dynamic_update_slice(sides, old + block, (0, column))


def _wider(sides: Array, columns: int, count: int) -> Array:
    """Sides with empty columns before the last ones, so many loads'."""
    if columns == sides.shape[-1]:
        return sides
    empty = [(0, 0)] * (sides.ndim - 1) + [(0, columns - sides.shape[-1])]
    parts = pad(sides[..., :-count], *empty), sides[..., -count:]
    return numbers_of(sides).concatenate(parts, axis=-1)


def _contacts(form: SectionForm, elements: Matrices, loads: Array) -> Array:
    """Stiffness (2n+1+p, 2n+1+p) of the elements among v and w, and the forces of the pressures.

    The parts of the fields of both ends are left out, which have conditions of their own.
    """
    xp, n, dtype = numbers_of(form, loads), loads.shape[0], loads.dtype
    start, end, across = (part[:, :2, :2] for part in elements)
    inner = (np.arange(n) > 0) & (np.arange(n) < n - 1)
    start, across = (xp.where(inner[:-1, None, None], part, 0.0) for part in (start, across))
    diagonal = pad(start, (0, 1), (0, 0), (0, 0)) + pad(end, (1, 0), (0, 0), (0, 0))
    coupling = pad(across, (0, 1), (0, 0), (0, 0))
    here, following = (np.eye(n, k=k)[..., None, None] for k in (0, 1))
    blocks = here * diagonal[:, None] + following * coupling[:, None]
    blocks = blocks + np.swapaxes(following, 0, 1) * xp.swapaxes(coupling, 1, 2)
    stiffness = xp.moveaxis(blocks, 2, 1).reshape(2 * n, 2 * n)
    inner_loads = xp.where(inner[:, None], loads, 0.0)
    press = (inner_loads[:, None] * form.press[:2, None]).reshape(2 * n, -1)
    sides = xp.column_stack([xp.zeros(2 * n, dtype), press])
    return xp.block([[stiffness, sides], [sides.T, xp.zeros((sides.shape[1],) * 2, dtype)]])


def _products(sides: Array, columns: int, count: int) -> Array:
    """Sum of sides' sides over the stations and their fields, (columns, columns)."""
    sides = sides.reshape(-1, sides.shape[-1])
    return _wider(_wider(sides.T @ sides, columns, count).T, columns, count).T


def local_compliance(stiffness: Array, pull: Array) -> Array:
    """Compliance of the contact's own fields against the load, which is never zero.

    A load on a contact node, or on a rigid face whose edge is one, has none beside it: c = 0.

    Parameters
    ----------
    stiffness : (fields,) diagonal of the stiffness
    pull : (fields,) part of the load that each clamped contact field carries
    """
    xp, square = numbers_of(stiffness, pull), pull**2
    whole = xp.sum(square * stiffness)
    return xp.sum(square) / xp.where(whole > 0.0, whole, 1.0)
