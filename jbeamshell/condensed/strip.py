"""Strip of a scene on its contact line: its section's form, its stations, its condensed body."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from jbeamshell.condensed.body import Body, Elimination, eliminate
from jbeamshell.condensed.pressing import press as press_down
from jbeamshell.mechanics import elements
from jbeamshell.mechanics.homogeneous import plane_stiffness
from jbeamshell.mechanics.layered import Material, layered_form
from jbeamshell.mechanics.section_form import SectionForm
from jbeamshell.numerics.factors import solve
from jbeamshell.scene.keys import FAR_ENDS
from jbeamshell.scene.scene import Scene

PLANE_END_SIZE = 1e-4  # of H, the element at the loaded end
PLANE_GROWTH = 0.3  # of the element size over the distance from there
PLANE_FAR_SIZE = 0.15  # of L, elements away from it
STEP_SIZE = 0.05  # of H, elements at a step of the pressure
RULE = elements.element_rule("finite-difference")


class Strip(NamedTuple):
    """Strip of a scene, condensed.

    Attributes
    ----------
    body : contact line, numbered from the loaded end
    form : energy of the section
    elimination : what finds the fields above the contact again
    hessian : (2n+2, 2n+2) of the potential in v and w of all stations, end load and pressure
    x, tributary, load : (n,) stations from the far end, contact lengths, forces of the top pressure
    settled, lift : (k,) tangential displacements and (n,) lifts under the pressures, frictionless
    """

    body: Body
    form: SectionForm
    elimination: Elimination
    hessian: Array
    x: Array
    tributary: Array
    load: Array
    settled: Array
    lift: Array


def condensed(scene: Scene, nodes: int) -> Strip:
    """Strip of a scene as plane elasticity, condensed to its contact nodes."""
    far_end = scene.strip.far_end
    form, x = plane_form(scene), plane_stations(scene, nodes)
    down, up = pressing(scene, x)
    tributary = elements.tributary_lengths(RULE, x)
    elimination, hessian = eliminate(form, x, down, "beta" in FAR_ENDS[far_end])
    hessian = hessian.at[1:-2:2, -1].add(-up).at[-1, 1:-2:2].add(-up)
    last = 2 * x.size - 2
    v = slice(last, 0 if "v" in FAR_ENDS[far_end] else None, -2)
    w = slice(last + 1, None, -2)
    k_tt, k_tn, press = hessian[v, v], hessian[v, w], hessian[:-2, -1]
    based = scene.contact.normal == "rigid"
    if is_pressed_evenly(scene) and based:
        lift, reaction = jnp.zeros_like(x), (down - up)[::-1]
        settled = solve(k_tt, -press[v])
    else:
        stiffness = k_tt, k_tn, hessian[w, w]
        lift, settled, reaction = press_down(*stiffness, press[v], press[w], based)
    body = Body(
        x=x[::-1],
        tributary=tributary[::-1],
        K_tt=k_tt,
        K_tn=k_tn,
        K_nn=hessian[w, w],
        f_t=-hessian[v, -2],
        f_n=-hessian[w, -2],
        r_0=reaction,
        c=-hessian[-2, -2],
    )
    return Strip(body, form, elimination, hessian, x, tributary, down, settled, lift)


def pressing(scene: Scene, x: Array) -> tuple[Array, Array]:
    """Forces (n,) of the pressures on the top face, downwards, and the bottom face, upwards."""
    down = elements.nodal_loads(RULE, x, scene.contact.pressure)
    return down, elements.nodal_loads(RULE, x, scene.contact.bottom_pressure)


def is_pressed_evenly(scene: Scene) -> bool:
    """True if neither pressure is a table."""
    return scene.contact.pressure.ndim == scene.contact.bottom_pressure.ndim == 0


def plane_stations(scene: Scene, nodes: int) -> Array:
    """Stations (nodes,) along X, dense at the singular loaded corner and at steps of pressure."""
    length, half_height = scene.strip.length, scene.strip.half_height
    if is_pressed_evenly(scene):
        grading = (PLANE_END_SIZE, None, PLANE_GROWTH, PLANE_FAR_SIZE)
        return elements.vertices(nodes - 1, length, half_height, *grading)
    tables = [p for p in (scene.contact.pressure, scene.contact.bottom_pressure) if p.ndim]
    steps = jnp.sort(jnp.concatenate([elements.table_steps(table, length) for table in tables]))
    inside = jnp.append(steps < length, False)
    sizes = jnp.where(inside, STEP_SIZE, PLANE_END_SIZE)
    growths = jnp.where(inside, elements.GROWTH, PLANE_GROWTH)
    return elements.vertices(nodes - 1, length, half_height, sizes, steps, growths, PLANE_FAR_SIZE)


def spring_stiffness(scene: Scene, strip: Strip) -> Array:
    """Stiffness (k,) of the elastic slip of each node, k_t times its contact length."""
    alpha, shear = scene.contact.stick_stiffness, scene.strip.shear_modulus
    return (alpha * shear / scene.strip.half_height * strip.body.tributary)[: strip.body.f_t.size]


def moving_volume(scene: Scene, strip: Strip) -> Array:
    """Integral of |u|^2/u(L)^2 over each layer, (layers,), under an end load, all nodes stuck."""
    n = strip.x.size
    given = jnp.zeros((2 * n + 2, 1)).at[-2, 0].set(1.0 / strip.body.c)
    fields = jnp.pad(strip.elimination.recovered(given)[..., 0], ((0, 0), (2, 0)))
    layers = scene.strip.layers
    thickness = jnp.reshape(2.0 * scene.strip.half_height, 1) if layers is None else layers[:, 0]

    def one(layer: Array) -> Array:
        squares = layered_form(Material(thickness, layer, 0.0 * layer, layer)).slopes
        return jnp.einsum("i,ij,ik,jk", strip.tributary, fields, fields, squares)

    return jnp.stack([one(layer) for layer in jnp.eye(thickness.size)])


def plane_form(scene: Scene) -> SectionForm:
    """Section of plane elasticity, homogeneous or layered."""
    strip = scene.strip
    if strip.layers is None:
        nu = jnp.asarray(strip.poisson_ratio)
        coupling, stiffness = plane_stiffness(strip.plane_modulus, nu, strip.plane)
        thickness = 2.0 * strip.half_height
        columns = thickness, stiffness, coupling * stiffness, strip.shear_modulus
        return layered_form(Material(*(jnp.reshape(value, 1) for value in columns)))
    thickness, modulus, nu = strip.layers.T
    if strip.plane == "strain":
        modulus, contraction = modulus / (1.0 - nu**2), nu / (1.0 - nu)
    else:
        contraction = nu
    stiffness = modulus / (1.0 - contraction**2)
    shear = strip.layers[:, 1] / (2.0 * (1.0 + nu))
    return layered_form(Material(thickness, stiffness, contraction * stiffness, shear))
