"""Closed forms of the literature beside the solvers, and what the dissertation prints."""

from __future__ import annotations

import functools

import numpy as np
from scipy.integrate import quad

import jbeamshell as jb
from calibration.comparisons import bodies
from calibration.comparisons.case import Case, Floats, Source
from calibration.comparisons.finite_elements import frictionless
from jbeamshell import reference

THROUGH = "Read through Brink 2015."
AGAIN = "Not opened: derived again."
BRINK = Source(
    "A. R. Brink, Modeling complex contact phenomena with nonlinear beamshells, dissertation, "
    "The University of Akron, 2015",
    "figures quoted",
)
GOODMAN = Source(
    "L. E. Goodman, A review of progress in analysis of interfacial slip damping, in: Structural "
    "Damping, ASME 1959, 35-48",
    opened=THROUGH,
)
METHERELL = Source(
    "A. F. Metherell and S. V. Diller, Instantaneous energy dissipation rate in a lap joint: "
    "uniform clamping pressure, J. Appl. Mech. 35 (1968) 123-128",
    opened=AGAIN,
)
KLUMPP = Source(
    "L. E. Goodman and J. H. Klumpp, Analysis of slip damping with reference to turbine-blade "
    "vibration, J. Appl. Mech. 23 (1956) 421-429",
    opened=AGAIN,
)
MINDLIN = Source(
    "R. D. Mindlin and H. Deresiewicz, Elastic spheres in contact under varying oblique forces, "
    "J. Appl. Mech. 20 (1953) 327-344",
    opened=THROUGH,
)
CATTANEO = Source(
    "C. Cattaneo, Sul contatto di due corpi elastici, Rend. Accad. Naz. Lincei 27 (1938) 342-348; "
    "M. Ciavarella, The generalized Cattaneo partial slip plane contact problem, Int. J. Solids "
    "Structures 35 (1998) 2349-2378",
    opened=AGAIN,
)
FILON = Source(
    "L. N. G. Filon, On an approximate solution for the bending of a beam of rectangular "
    "cross-section under any system of load, Phil. Trans. R. Soc. A 201 (1903) 63-155",
    opened=AGAIN,
)
BARBER = Source(
    "J. R. Barber, Contact Mechanics, Springer 2018, chapter 11 (its summary), on Filon 1903",
    "figure quoted",
    "Read in the publisher's summary.",
)
COKER = Source(
    "E. G. Coker and L. N. G. Filon, A Treatise on Photo-Elasticity, Cambridge 1931",
    "figure quoted",
    THROUGH,
)
GLADWELL = Source(
    "G. M. L. Gladwell, On some unbonded contact problems in plane elasticity theory, J. Appl. "
    "Mech. 43 (1976) 263-267",
    "figure quoted",
    THROUGH,
)
LAYER = Source(
    "Singular integral equation of the strip and the base, by Gauss-Chebyshev quadrature; this "
    "project's tests",
    "MIT",
)
TIMOSHENKO = Source(
    "S. Timoshenko, Analysis of bi-metal thermostats, J. Opt. Soc. Am. 11 (1925) 233-255",
    opened=AGAIN,
)
HEIGHTS = np.array([0.0305, 0.0716, 0.1126, 0.1537, 0.1947, 0.2358, 0.2768, 0.3179, 0.3589, 0.4])
LENGTH = 20.0  # half of a pressed strip, mm
WAVES = (1, 2, 3)  # over it
LAYERED = (2.0, 0.02, 3.4e4, 1.0)  # length, height, stretching stiffness, friction


def thin_strip() -> Floats:
    """Energy lost and largest displacement of a strip of eta = .005."""
    history = jb.solve(jb.Scene().replace({"strip.height_ratio": 0.005, "load.amplitude": 1.6}))
    return np.array([float(history.dissipation), float(history.peak_displacement)])


def thin_lap() -> Floats:
    """Energy lost and secant compliance of two thin members that lap."""
    thin = {"strip.height_ratio": 0.005, "member.height_ratio": 0.005, "load.amplitude": 1.6}
    history = jb.solve(jb.library.double_shear().replace(thin))
    return np.array([float(history.dissipation), 1.0 / float(history.secant_stiffness)])


def layered() -> Floats:
    """Energy lost and deflection of two layers that slip in bending, for two amplitudes."""
    found = []
    for ratio in (1.5, 4.0):
        amplitude = ratio * float(reference.layered_beam_slip_force(LAYERED[1], LAYERED[3]))
        history = jb.solve_contact(
            bodies.layer(*LAYERED[:3], side=1.0),
            bodies.layer(*LAYERED[:3], side=-1.0),
            friction=0.1,
            bolts=10.0,
            amplitude=amplitude,
        )
        found += [float(history.dissipation), float(history.peak_displacement)]
    return np.array(found)


def their_layered() -> Floats:
    """The same by the closed form."""
    found = []
    for ratio in (1.5, 4.0):
        amplitude = ratio * reference.layered_beam_slip_force(LAYERED[1], LAYERED[3])
        found.append(reference.layered_beam_dissipation(amplitude, *LAYERED))
        found.append(reference.layered_beam_deflection(amplitude, *LAYERED))
    return np.array(found, dtype=float)


def sphere_loop() -> Floats:
    """Work of a cycle of two spheres along the path of the law, for three forces."""
    law, work = reference.sphere_law(3.0, 0.7, 0.02), []
    for peak in (0.3, 1.5, 2.9):
        way = peak * np.cos(np.pi * np.arange(801) / 400)
        shift = np.asarray(law.path_displacements(np.append(1e-9, way)))[1:]
        work.append(-np.sum(0.5 * (shift[1:] + shift[:-1]) * np.diff(way)))
    return np.array(work)


@functools.cache
def cylinder() -> jb.ContactHistory:
    """Two equal cylinders: pressed, sheared to half of gross slip, and to and fro."""
    body, gap = bodies.cylinder()
    half = 0.5 * bodies.FRICTION
    return jb.solve_contact(body, friction=bodies.FRICTION, bolts=1.0, gap=gap, amplitude=half)


def stuck_parts() -> Floats:
    """Parts of the contact without slip and, back at no force, without counter-slip."""
    history = cylinder()
    start, turn, _ = history.cycles[-1]
    middle = history.places.size // 2
    peak = bodies.FRICTION * float(history.reaction[start, middle])
    shear = np.abs(np.asarray(history.traction[start : turn + 1, middle])) / peak
    signed = np.asarray(history.traction[start : turn + 1, middle])
    signed = signed / signed[0] * shear[0]
    stuck = 1.0 - shear[0]
    at_rest = signed[np.argmin(np.abs(np.asarray(history.force[start : turn + 1])))]
    return np.array([stuck, 1.0 - 0.5 * (shear[0] - at_rest)])


def cylinder_energy() -> float:
    """Energy lost in a cycle: shear is the change of the normal approach, times the friction."""
    friction, peak = bodies.FRICTION, 0.5 * bodies.FRICTION

    def approach(load: float) -> float:
        return -(load * np.log(load) - load) / np.pi  # and what is linear, which loses nothing

    def shift(force: float) -> float:
        return friction * (approach(1.0) - approach(1.0 - force / friction))

    return 4.0 * peak * shift(peak) - 8.0 * quad(shift, 0.0, peak)[0]


def waves() -> Floats:
    """Amplitude of the reaction of a frictionless base under waves of pressure on the strip."""
    found = []
    for count in WAVES:
        wave = 2.0 * np.pi * count / LENGTH
        x = np.linspace(0.0, LENGTH, 401)
        history = jb.solve(pressed(np.column_stack([x, 100.0 + 50.0 * np.cos(wave * x)]).tolist()))
        at = np.linspace(0.0, min(0.7 * LENGTH, LENGTH / count), 1001)  # away from the free end
        reaction = np.interp(at, np.asarray(history.x), np.asarray(history.reaction[0]))
        basis = np.column_stack([np.ones_like(at), np.cos(wave * at)])
        found.append(np.linalg.lstsq(basis, reaction, rcond=None)[0][1] / 50.0)
    return np.array(found)


def pressed(pressure: list[list[float]]) -> jb.Scene:
    """Strip 20 x 2 mm, half modelled, on a rigid frictionless base."""
    return frictionless(pressure, LENGTH)


def their_waves() -> Floats:
    """Filon's symbol for the wavenumbers over the whole height."""
    return np.asarray(reference.filon_midplane(2.0 * 2.0 * np.pi * np.array(WAVES) / LENGTH))


def pressed_at_a_point() -> float:
    """Half of the length of contact over the height, under a narrow patch of pressure."""
    history = jb.solve(pressed([[0.0, 100.0], [0.05, 100.0], [0.05, 0.0], [LENGTH, 0.0]]))
    return 0.5 * float(history.contact_end[0])


def bimetal(plane: str) -> float:
    """Curvature of two layers under an even squeeze."""
    return float(jb.solve(jb.library.bimaterial().replace({"strip.plane": plane})).curvature[0])


def their_bimetal(plane: str) -> float:
    """The same by the closed form."""
    scene = jb.library.bimaterial()
    layers, height = scene.strip.layers, 2.0 * float(scene.strip.half_height)
    pressed = float(np.max(np.asarray(scene.contact.pressure)))
    low, high = (float(layer[1]) for layer in layers)
    return float(reference.bimetal_curvature(pressed, height, low, high, 0.3, plane))


CASES = (
    Case(
        "bar on a rough base",
        "closed form",
        GOODMAN,
        "energy lost in a cycle, and largest displacement, of a thin strip",
        "eta = .005, plane strain, member that goes on; the closed form is a bar",
        lambda: [
            float(reference.cubic_law(1.6, 3.4e4, 1.0)),
            float(reference.bar_backbone(1.6, 3.4e4, 1.0)),
        ],
        thin_strip,
        0.01,
    ),
    Case(
        "two bars that lap",
        "closed form",
        METHERELL,
        "energy lost in a cycle, and secant compliance, of two thin members",
        "eta = .005, plane strain, even traction; the closed form is bars",
        lambda: [
            float(reference.lap_cubic_law(1.6, 3.4e4, 3.4e4, 1.0)),
            float(reference.lap_backbone(1.6, 3.4e4, 3.4e4, 2.0, 1.0)) / 1.6,
        ],
        thin_lap,
        0.02,
        explained="elements of up to 10 heights; .7 % on 193 nodes, .2 % on 385",
    ),
    Case(
        "two layers that slip in bending",
        "closed form",
        KLUMPP,
        "energy lost in a cycle, and deflection, for two amplitudes",
        "Euler's layers as a user's own bodies, on 40 nodes; even pressure",
        their_layered,
        layered,
        0.02,
    ),
    Case(
        "spheres sheared to and fro",
        "closed form",
        MINDLIN,
        "energy lost in a cycle, three forces up to .97 of gross slip",
        "the area of a loop that the law walks",
        lambda: np.asarray(reference.mindlin_energy(np.array([0.3, 1.5, 2.9]), 3.0, 0.7, 0.02)),
        sphere_loop,
        0.001,
    ),
    Case(
        "spheres under small forces",
        "closed form",
        GOODMAN,
        "energy lost in a cycle at .005 of gross slip: Goodman's cube",
        "the law; its next term is 2/3 of the ratio of forces",
        lambda: float(reference.goodman_energy(0.005, 1.0, 1.0, 1.0)),
        lambda: float(reference.sphere_law(1.0, 1.0, 1.0).dissipation_at_force(0.005)),
        0.005,
    ),
    Case(
        "cylinder, parts that stick",
        "closed form",
        CATTANEO,
        "part that sticks at half of gross slip, and part without counter-slip back at no force",
        "half-planes of equal material as a user's own bodies, 161 nodes; read from the traction",
        [float(np.sqrt(0.5)), float(np.sqrt(0.75))],
        stuck_parts,
        0.01,
    ),
    Case(
        "cylinder, energy",
        "closed form",
        CATTANEO,
        "energy lost in a cycle up to half of gross slip",
        "half-planes of equal material as a user's own bodies, 161 nodes",
        cylinder_energy,
        lambda: float(cylinder().dissipation),
        0.02,
    ),
    Case(
        "strip under waves of pressure",
        "closed form",
        FILON,
        "reaction of a frictionless base over the pressure, three wavelengths",
        "plane strain; the closed form is an endless strip",
        their_waves,
        waves,
        0.05,
        explained="the shortest wave is 3.3 heights long, 12 elements of the plain grid",
    ),
    Case(
        "squeezed strip, where it pulls",
        "second-hand",
        BARBER,
        "distance from a force at which the mid-plane's stress changes sign, over the height",
        "Filon's transform, integrated; a glued base",
        1.35,
        lambda: float(reference.strip_contact_length(1.0, "bilateral")),
        0.01,
    ),
    Case(
        "point load, rigid base",
        "closed form",
        LAYER,
        "half of the length of contact over the height",
        "plane strain; no friction; patch of 1/20 of the half height",
        lambda: float(reference.strip_contact_length(1.0, "rigid")),
        pressed_at_a_point,
        0.02,
    ),
    Case(
        "point load, elastic base",
        "second-hand",
        COKER,
        "half of the length of contact over the height, base of the same material",
        "theirs measured in polarised light; ours computed, no friction",
        1.35,
        lambda: float(reference.strip_contact_length(1.0, "elastic")),
        0.03,
        explained="1.35 is also Filon's value for a glued strip",
    ),
    Case(
        "beam on a half-plane",
        "second-hand",
        GLADWELL,
        "half of the length of contact over the height, equal moduli",
        "Euler's beam; no friction",
        1.845,
        lambda: float(reference.beam_contact_length(1.0, 1.0, 0.3, 1.0, 0.3)),
        0.35,
        explained="two methods of ours find 1.2245; the article itself was not opened",
    ),
    *(
        Case(
            f"bi-metal in plane {plane}",
            "closed form",
            TIMOSHENKO,
            "curvature of two layers under an even squeeze",
            f"plane {plane}; stiffness 1 to 100",
            functools.partial(their_bimetal, plane),
            functools.partial(bimetal, plane),
            0.001,
        )
        for plane in ("stress", "strain")
    ),
    Case(
        "force that starts slip, as printed",
        "dissertation",
        BRINK,
        "eq. 3.65, a line over ten heights",
        "a stuck shell with the printed bending stiffness and end condition",
        1.767 * HEIGHTS - 0.0013,
        lambda: np.asarray(reference.first_slip_force(HEIGHTS, constants="printed")),
        0.01,
        each=False,
    ),
    Case(
        "force that starts slip",
        "dissertation",
        BRINK,
        "eq. 3.65, a line over ten heights",
        "a stuck shell with the bending stiffness and the end condition of the energy",
        1.767 * HEIGHTS - 0.0013,
        lambda: np.asarray(reference.first_slip_force(HEIGHTS)),
        0.55,
        each=False,
        explained="eq. 3.45 prints a sixteenth of the bending stiffness; elasticity slips at once",
    ),
)
