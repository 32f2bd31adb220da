r"""Section of plane elasticity: layers that get thinner towards the contact.

Within a layer the displacements along X and across are polynomials of the height,

    u_x = sum a_j(X) phi_j(y),    u_y = sum b_j(X) phi_j(y),

with the two linear functions of the layer's faces and integrated Legendre polynomials of order 2 to
p between them (Szabo & Babuska 1991, section 6.2).  The energy is that of linear plane elasticity,
integrated over the height.  The loaded corner is singular: layers shrink geometrically towards it
and their order grows away from it, which converges exponentially (Schwab 1998, chapter 4).
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from jax import Array
from numpy.polynomial import legendre

from jbeamshell.common.numbers_of import numbers_of
from jbeamshell.mechanics.section_form import SectionForm

RATIO = 0.15  # of a layer's thickness to that of the layer above it
ORDERS = (1, 2, 3, 4, 4, 5, 6)  # of the layers of the lowest material, from the contact upwards
ORDER_ABOVE = 6  # of materials above the lowest one


class Material(NamedTuple):
    """Plane material, one value for each layer from the bottom up.

    Attributes
    ----------
    thickness : (layers,) lengths
    stiffness : (layers,) sigma_x per eps_x with eps_y held
    coupling : (layers,) sigma_x per eps_y
    shear : (layers,) G
    """

    thickness: Array
    stiffness: Array
    coupling: Array
    shear: Array


def layered_form(material: Material) -> SectionForm:
    """Quadratic energy of a section of plane elasticity.

    The fields are v and w (displacements of the bottom face), then the other displacements along X,
    then those across.  The end load is spread evenly over the height.
    """
    xp, count = numbers_of(material), material.thickness.shape[0]
    orders = (*ORDERS, *(ORDER_ABOVE,) * (count - 1))
    layers, fine = len(orders), len(ORDERS)
    share = RATIO ** np.arange(fine - 1, -1, -1.0)
    share = np.concatenate([share[:1], np.diff(share), np.ones(count - 1)])
    kind = np.append(np.zeros(fine, int), np.arange(1, count))
    h, c, lam, g = (material[k][kind] for k in range(4))
    h = h * share
    mass, mixed, slope, integral = _templates(orders)

    def summed(weight: Array, template: np.ndarray) -> Array:
        return xp.tensordot(weight, template, 1)

    size = layers + 1 + sum(order - 1 for order in orders)
    zero = xp.zeros((size, size), h.dtype)
    transpose = np.swapaxes(mixed, 1, 2)
    values = xp.block([[summed(g / h, slope), zero], [zero, summed(c / h, slope)]])
    mixed_form = xp.block([[zero, summed(g, transpose)], [summed(lam, transpose), zero]])
    slopes = xp.block([[summed(c * h, mass), zero], [zero, summed(g * h, mass)]])
    edges = xp.append(0.0, xp.cumsum(h))
    middle = 0.5 * edges[-1]
    even = xp.pad(xp.ones(layers + 1), (0, size - layers - 1))
    heights = xp.pad(edges - middle, (0, size - layers - 1))
    mean = summed(h, integral[0]) / edges[-1]
    moment = summed(h**2, integral[1]) + summed(h * (edges[:-1] - middle), integral[0])
    rotation = -moment / (2.0 * middle**3 / 3.0)
    top = np.zeros(size)
    top[layers] = 1.0
    squeeze = np.zeros(size)
    squeeze[[0, layers]] = -1.0, 1.0

    place = np.r_[0, size, 1:size, size + 1 : 2 * size]
    pick = np.ix_(place, place)

    def along(part: Array | np.ndarray) -> Array:
        return xp.append(part, xp.zeros(size))[place]

    def across(part: Array | np.ndarray) -> Array:
        return xp.append(xp.zeros(size), part)[place]

    def squares(layer: int) -> Array:
        block = summed(xp.where(kind == layer, h, 0.0), mass)
        return xp.block([[block, zero], [zero, block]])[pick]

    rest = xp.zeros(2 * size)
    modes = [
        (rest, along(even)),
        (rest, across(even)),
        (rest, along(-heights)),
        (across(heights), rest),
        (rest, across(heights)),
    ]
    return SectionForm(
        values=values[pick],
        mixed=mixed_form[pick],
        slopes=slopes[pick],
        pull=along(mean),
        turn=along(rotation),
        press=across(top),
        held=np.append(np.ones(size, bool), np.zeros(size, bool))[place],
        further=xp.stack([along(rotation), across(squeeze) / edges[-1]]),
        modes=xp.asarray([xp.stack(mode) for mode in modes]),
        spread=None,
        masses=xp.stack([squares(i) for i in range(count)]),
        top=int(np.flatnonzero(place == size + layers)[0]),
    )


@functools.cache
def _templates(orders: tuple[int, ...]) -> tuple[np.ndarray, ...]:
    """Integrals over each layer at unit height, at the places of the section's functions.

    Of phi phi, phi phi', phi' phi' (layers, size, size), and of phi and phi times the height above
    the layer's bottom (2, layers, size).
    """
    layers = len(orders)
    size = layers + 1 + sum(order - 1 for order in orders)
    mass, mixed, slope = (np.zeros((layers, size, size)) for _ in range(3))
    integral = np.zeros((2, layers, size))
    inner = layers + 1
    for layer, order in enumerate(orders):
        places = [layer, layer + 1, *range(inner, inner + order - 1)]
        inner += order - 1
        points, weights = legendre.leggauss(order + 1)
        phi = [0.5 * (1.0 - points), 0.5 * (1.0 + points)]
        dphi = [-np.ones_like(points), np.ones_like(points)]
        for j in range(2, order + 1):
            scale, basis = np.sqrt(0.5 * (2 * j - 1)), legendre.Legendre.basis(j - 1)
            phi.append(scale * basis.integ(lbnd=-1)(points))
            dphi.append(2.0 * scale * basis(points))
        values, slopes, w = np.array(phi), np.array(dphi), 0.5 * weights
        block = np.ix_(places, places)
        mass[layer][block] = (values * w) @ values.T
        mixed[layer][block] = (values * w) @ slopes.T
        slope[layer][block] = (slopes * w) @ slopes.T
        integral[:, layer, places] = values @ w, (values * 0.5 * (1.0 + points)) @ w
    return mass, mixed, slope, integral
