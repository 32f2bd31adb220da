"""Harmonic balance beside time integration, on structures that random strips join.

Two masses hang on a spring; the first is held by the sliders of a random scene of
verification/campaign.py (`jbeamshell.dynamics.Joint.of`).  A harmonic force acts on the second one
below, at and above the resonance.  Central differences begin on the motion that the balance finds,
take the exact law of the sliders, and after many periods end on their own steady motion.
The record has the amplitudes of both, and that of the joint over its largest displacement.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import jbeamshell as jb
from jbeamshell.dynamics import Attachment, Joint, Structure, steady_response
from verification.campaign import SEED, drawn

KINDS = ("plain", "ramps", "pinned and free", "elastic sliders", "layers that lift")
BESIDE = (0.7, 1.0, 1.4)  # frequencies over the first natural one
STEPS, PERIODS, HARMONICS = 600, 120, 21  # steps of a period
Floats = NDArray[np.float64]


class Case(NamedTuple):
    """One structure, the force on it, and its steady motions at some frequencies."""

    structure: Structure
    joint: Joint
    force: float
    omega: Floats
    shapes: NDArray[np.complex128]


def case(kind: str, number: int) -> Case:
    """Random structure on the joint of a scene of the campaign."""
    joint = Joint.of(jb.Scene().replace(drawn(kind, SEED, number)))
    random = np.random.default_rng([SEED, KINDS.index(kind), number])
    stiffness = float(joint.stiffness)
    mass = stiffness * np.diag(random.uniform(0.5, 2.0, 2))
    spring = stiffness * random.uniform(0.3, 2.0) * np.array([[1.0, -1.0], [-1.0, 1.0]])
    ratio = random.uniform(0.02, 0.04)
    structure = Structure(mass, spring, [Attachment(joint, 0)], damping_ratio=ratio)
    force = float(joint.forces[-1]) * random.uniform(1.0, 5.0) * ratio
    omega = structure.modes(1).omega[0] * np.array(BESIDE)
    while True:
        try:
            found = steady_response(
                structure, [0.0, force], omega / (2.0 * np.pi), harmonics=HARMONICS
            )
        except jb.InputError:  # the joint leaves its backbone
            force *= 0.7
        else:
            return Case(structure, joint, force, omega, found.coefficients)


def integrated(cases: list[Case]) -> NDArray[np.complex128]:
    """First harmonics (cases, frequencies) of the second mass after many periods."""
    lanes = [(one, k) for one in cases for k in range(len(BESIDE))]
    most = max(one.joint.limits.size for one in cases)
    springs, limits = (
        np.stack([np.pad(each, (0, most - each.size)) for each in values])
        for values in zip(*(_sliders(one.joint) for one, _ in lanes), strict=True)
    )
    last = np.array([float(one.joint.spring) for one, _ in lanes])
    stiffness = np.stack([np.asarray(one.structure.stiffness) for one, _ in lanes])
    stiffness[:, 0, 0] += last
    mass, damping = (
        np.stack([np.asarray(getattr(one.structure, name)) for one, _ in lanes])
        for name in ("mass", "damping")
    )
    force = np.array([one.force for one, _ in lanes])
    omega = np.array([one.omega[k] for one, k in lanes])
    shapes = np.stack([one.shapes[k] for one, k in lanes])
    orders = np.arange(1, HARMONICS + 1, 2)

    def on_balance(angle: float) -> Floats:
        return np.einsum("h,lhn->ln", np.exp(1j * angle * orders), shapes).real

    def slid(held: Floats, moved: Floats) -> Floats:
        return np.clip(held + springs * moved[:, :1], -limits, limits)

    turn = 2.0 * np.pi / STEPS
    held = np.zeros_like(springs)
    for number in range(STEPS):  # memory of the cycle before
        held = slid(held, on_balance((number + 1) * turn) - on_balance(number * turn))
    x, before = on_balance(0.0), on_balance(-turn)
    step = (turn / omega)[:, None, None]
    advance = np.linalg.inv(mass / step**2 + damping / (2.0 * step))
    inertia, drag = 2.0 * mass / step**2 - stiffness, mass / step**2 - damping / (2.0 * step)
    sums = np.zeros(len(lanes), complex)
    for number in range(PERIODS * STEPS):
        angle = turn * number
        pushed = (inertia @ x[:, :, None] - drag @ before[:, :, None])[:, :, 0]
        pushed[:, 0] -= held.sum(axis=1)
        pushed[:, 1] += force * np.cos(angle)
        after = (advance @ pushed[:, :, None])[:, :, 0]
        held = slid(held, after - x)
        before, x = x, after
        if number >= (PERIODS - 1) * STEPS:
            sums += 2.0 / STEPS * x[:, 1] * np.exp(-1j * (angle + turn))
    return sums.reshape(len(cases), len(BESIDE))


def _sliders(joint: Joint) -> tuple[Floats, Floats]:
    """Springs and limits of a joint's sliders, without the spring that never slips."""
    return np.asarray(joint.springs), np.asarray(joint.limits)


def measure(scenes: int = 25) -> dict[str, Any]:
    """Compare all structures."""
    names = [(KINDS[i % len(KINDS)], i // len(KINDS)) for i in range(scenes)]
    cases = [case(*name) for name in names]
    ends = integrated(cases)
    rows: list[dict[str, Any]] = []
    for (kind, number), one, end in zip(names, cases, ends, strict=True):
        balance = one.shapes[:, 0, 1]
        errors = abs(end / balance - 1.0)
        row = {"kind": kind, "number": number, "amplitude": abs(balance).tolist()}
        joint = abs(one.shapes[:, 0, 0]) / float(one.joint.displacements[-1])
        row |= {"joint": joint.tolist(), "in_time": abs(end).tolist(), "error": errors.tolist()}
        rows.append(row)
    return {"seed": SEED, "beside": BESIDE, "rows": rows}
