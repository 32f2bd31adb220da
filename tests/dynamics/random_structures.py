"""Random structures with joints, and what brute force says of them.

References are sums over cycles of sliders, and leapfrog integration in time with
the exact law of the sliders, in NumPy.
"""

import warnings

import jax.numpy as jnp
import numpy as np

import jbeamshell as jb
from jbeamshell import dynamics, laws
from jbeamshell.dynamics import Attachment, Joint, Structure

ALLOWED = 0.02
POINTS = 24  # of a backbone, so that structures share compiled programs
STEPS = 500  # of the shortest period
LAWS = [laws.Jenkins, laws.Iwan4, laws.Bar, laws.Mindlin, laws.Dahl, laws.LuGre, laws.JangBarber]
STRIP = {"model.section": "plane", "model.nodes": 17}


def random_law(draw):
    """Law of random numbers, and a displacement at which it nearly slides."""
    kind = LAWS[draw.integers(len(LAWS))]
    limit, stiffness = draw.uniform(0.5, 2.0), draw.uniform(1.0, 4.0)
    law = kind.started(limit, 2.0 * limit / stiffness, 0.5 * limit**2 / stiffness, stiffness)
    far = 8.0 * float(law.capacity) / stiffness
    return law, far


def random_joint(draw):
    """Joint of a law up to gross slip or below it, or of a strip."""
    if draw.random() < 0.2:
        scene = jb.Scene().replace(STRIP | {"contact.friction": draw.uniform(0.08, 0.3)})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of few nodes
            strip = Joint.of(scene, draw.choice([0.6, 0.995, 0.995]) * float(jb_gross_slip(scene)))
        size = float(strip.forces[-1]) / float(strip.stiffness)
        stretch = draw.uniform(0.2, 0.6) / size
        u, f = np.asarray(strip.displacements) * stretch, np.asarray(strip.forces)
        scale = draw.uniform(0.5, 2.0) / f[-1]
        return Joint(*resampled(u, f * scale), capacity=float(strip.capacity) * scale)
    law, far = random_law(draw)
    u = np.append(0.0, far * np.geomspace(0.02, 1.0, 400))
    capacity = float(law.capacity)
    f = np.asarray(law.backbone(u))
    known = f < draw.choice([0.7, 1.0, 1.0, 1.0]) * capacity
    known[np.argmin(known)] = True
    return Joint(*resampled(u[known][1:], f[known][1:]), capacity=capacity)


def jb_gross_slip(scene):
    contact = scene.contact
    return contact.friction * jnp.asarray(contact.pressure) * scene.strip.length


def resampled(u, f):
    """`POINTS` points of a backbone, softening throughout."""
    at = np.append(np.geomspace(0.03, 0.97, POINTS - 1), 1.0) * u[-1]
    force = np.interp(at, np.append(0.0, u), np.append(0.0, f))
    slopes = np.minimum.accumulate(np.diff(force, prepend=0.0) / np.diff(at, prepend=0.0))
    return at, np.cumsum(np.maximum(slopes, 0.0) * np.diff(at, prepend=0.0))


def random_structure(draw):
    """One to three masses in a chain, with one or two joints."""
    size = int(draw.integers(1, 4))
    mass = np.diag(draw.uniform(0.5, 2.0, size))
    springs = draw.uniform(1.0, 5.0, size - 1)
    stiffness = np.diag(np.append(springs, 0.0) + np.append(0.0, springs))
    stiffness -= np.diag(springs, 1) + np.diag(springs, -1)
    stiffness[-1, -1] += draw.uniform(0.0, 1.0)
    attached = [Attachment(random_joint(draw), 0)]
    if draw.random() < 0.4:
        second = None if size == 1 else int(draw.integers(1, size))
        ends = (0, None) if second is None else (second, draw.choice([None, 0]))
        attached.append(Attachment(random_joint(draw), *ends))
    damping = draw.choice([0.0, 0.01]) * (mass + stiffness)
    return Structure(mass, stiffness, attached, damping=damping)


class Brute:
    """Sliders and springs of a structure, in NumPy."""

    def __init__(self, structure):
        self.mass, self.damping = np.diag(structure.mass), structure.damping
        self.stiffness, self.b = structure.stiffness, structure.directions
        joints = structure.joints
        self.springs = np.concatenate([np.asarray(j.springs) for j in joints])
        self.limits = np.concatenate([np.asarray(j.limits) for j in joints])
        self.joint = np.repeat(np.arange(len(joints)), [j.limits.size for j in joints])
        self.remaining = np.array([float(j.spring) for j in joints])
        stuck = structure.modes(9).frequency
        self.longest, self.shortest = 1.0 / stuck[0], 1.0 / stuck[-1]
        self.sliders = np.zeros(self.springs.size)

    def follow(self, u):
        """Forces (J,) of the joints after displacements (J,) of them."""
        moved = (u - self.u)[self.joint]
        self.u = u
        self.sliders = np.clip(self.sliders + self.springs * moved, -self.limits, self.limits)
        return np.bincount(self.joint, self.sliders, u.size) + self.remaining * u

    def motion(self, x, v, span, force=None, extra=0.0, step=None):
        """Displacements (T, n) of a leapfrog; ``extra`` is a damping per mass."""
        step = self.shortest / STEPS if step is None else step
        count = int(np.ceil(span / step - 1e-9))
        h = span / count
        drag = self.damping + extra * np.diag(self.mass)
        left = np.linalg.inv(np.diag(self.mass) / h**2 + drag / (2.0 * h))

        def inner(x, time):
            outer = 0.0 if force is None else force(time)
            return outer - self.stiffness @ x - self.b @ self.follow(self.b.T @ x)

        begin = inner(x, 0.0)
        before = x - h * v + 0.5 * h**2 * (begin - drag @ v) / self.mass
        path = [x]
        for number in range(count):
            pull = begin if number == 0 else inner(x, number * h)
            old = drag @ before / (2.0 * h) - self.mass * before / h**2
            x, before = left @ (pull + 2.0 * self.mass * x / h**2 + old), x
            path.append(x)
        return np.array(path)


def checked_joint(draw):
    """Errors of backbone and dissipation of a joint at an amplitude."""
    joint = random_joint(draw)
    size = draw.uniform(0.2, 2.5) * float(joint.displacements[-2])
    part = np.linspace(-1.0, 1.0, 801)
    path = size * np.concatenate([part[400:], -part[1:], part[1:], -part[1:]])
    sliders, last, forces = 0.0, 0.0, []
    springs, limits = np.asarray(joint.springs), np.asarray(joint.limits)
    for u in path:
        sliders = np.clip(sliders + springs * (u - last), -limits, limits)
        last = u
        forces.append(np.sum(sliders) + float(joint.spring) * u)
    loop, way = np.array(forces)[-1601:], path[-1601:]
    area = np.sum(0.5 * (loop[1:] + loop[:-1]) * np.diff(way))
    # Beyond what the joint knows, any value is wrong.
    known = float(joint.reach) >= size
    backbone, loss = (float(f(size)) for f in (joint.backbone, joint.dissipation))
    scale = forces[400] * size
    return max(abs(backbone / forces[400] - 1.0), abs(loss - area) / scale, 9.0 * (not known))


def checked_law(draw):
    """Errors of a law's energy per cycle, beside the area of its own path."""
    law, far = random_law(draw)
    size = draw.uniform(0.05, 1.5) * far
    part = np.linspace(-1.0, 1.0, 2001)
    path = size * np.concatenate([part[1000:], *[-part[1:], part[1:]] * 3])
    forces, way = np.asarray(law.path_forces(path))[-4001:], path[-4001:]
    area = np.sum(0.5 * (forces[1:] + forces[:-1]) * np.diff(way))
    top = float(np.max(forces))
    limit = max(top / float(law.capacity) - 1.0, 0.0)
    return max(abs(float(law.dissipation(size)) - area) / (top * size), limit)


def amplitudes(draw, structure):
    """Modal displacements up to and beyond gross slip."""
    reach = min(float(j.displacements[-2]) for j in structure.joints)
    moved = np.max(np.abs(structure.directions.T @ structure.modes(1).shapes[:, 0]))
    return draw.uniform(0.3, 3.0) * reach / moved * np.geomspace(0.2, 1.0, 5)


def checked_mode(draw):
    """Error of a period of a nonlinear mode, integrated in time."""
    structure = random_structure(draw)
    found = dynamics.nonlinear_mode(structure, amplitudes(draw, structure))
    worst = 0.0
    for k in (2, -1):
        omega, rate = found.omega[k], 1j * found.harmonics[:, None]
        shape = found.coefficients[k] @ found.basis.T
        start = shape.real.sum(axis=0), omega * (rate * shape).real.sum(axis=0)
        motion = np.concatenate([*start, [omega, -found_excess(found, k, structure)]])

        def missed(motion, shape=shape):
            return period_missed(structure, shape, found.harmonics, motion)

        off = missed(motion)[: structure.size]
        error = np.max(np.abs(off)) / np.max(np.abs(shape[0]))
        if error > ALLOWED:  # the negative damping makes small errors grow through a period
            error = moved_to_close(missed, motion, shape)
        worst = max(worst, error)
    return worst


def period_missed(structure, shape, harmonic, motion):
    """Misses of a period in time: its ends (2n,), and the first harmonic of the mode (2,)."""
    size = structure.size
    x, v, (omega, extra) = motion[:size], motion[size : 2 * size], motion[2 * size :]
    span = 2.0 * np.pi / omega
    brute = steady(structure, shape, harmonic)
    step = span / np.ceil(span / brute.shortest * STEPS)
    path = brute.motion(x, v, span + step, extra=extra, step=step)
    ended = (path[-1] - path[-3]) / (2.0 * step)
    turn = np.exp(-2j * np.pi * np.arange(len(path) - 2) / (len(path) - 2))
    modal = structure.modes(1).shapes[:, 0] @ structure.mass
    first = modal @ (2.0 * np.mean(path[:-2] * turn[:, None], axis=0) - shape[0])
    return np.concatenate([path[-2] - x, (ended - v) / omega, [first.real, first.imag]])


def moved_to_close(missed, motion, shape):
    """Change of displacements, frequency and negative damping that closes a period in time."""
    half = (motion.size - 2) // 2
    reach, omega = np.max(np.abs(shape[0])), motion[-2]
    sizes = np.concatenate([np.full(half, reach), np.full(half, omega * reach), motion[-2:]])
    moved = np.zeros(motion.size)
    for _ in range(4):
        at = motion + sizes * moved
        off = missed(at)
        slopes = [(missed(at + 1e-6 * sizes * row) - off) / 1e-6 for row in np.eye(motion.size)]
        moved -= np.linalg.solve(np.array(slopes).T, off)
    return np.max(np.abs(np.delete(moved, np.arange(half, 2 * half))))


def found_excess(found, k, structure):
    """Negative damping per mass that holds a nonlinear mode."""
    return 2.0 * found.damping[k] * found.omega[k]


def steady(structure, shape, harmonic):
    """Brute force whose sliders have gone through a cycle of a motion."""
    brute = Brute(structure)
    angle = np.linspace(0.0, 4.0 * np.pi, 4001)
    path = np.einsum("tk,kn->tn", np.exp(1j * np.outer(angle, harmonic)), shape).real
    brute.u = np.zeros(structure.directions.shape[1])
    for x in path:
        brute.follow(structure.directions.T @ x)
    return brute


def checked_curve(draw):
    """Error of frequency and damping of a modal curve, beside the nonlinear mode."""
    structure = random_structure(draw)
    sizes = amplitudes(draw, structure)
    curve = dynamics.modal_curve(structure, sizes)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mode = dynamics.nonlinear_mode(structure, sizes)
    felt = mode.damping > 1e-4
    off = np.abs(curve.damping / mode.damping - 1.0)[felt]
    return max(np.max(off, initial=0.0), np.max(np.abs(curve.frequency / mode.frequency - 1.0)))


def checked_response(draw):
    """Error of a steady response after ten periods in time."""
    structure = random_structure(draw)
    force = np.zeros(structure.size)
    force[-1] = draw.uniform(0.05, 0.6)
    top = draw.uniform(0.5, 1.2) * structure.modes(1).frequency[0]
    if np.allclose(structure.damping, 0.0):
        damping = 0.01 * (structure.mass + structure.stiffness)
        structure = Structure(structure.mass, structure.stiffness, structure.attachments, damping)
    response = dynamics.forced_response(structure, force, (0.3 * top, top))
    shape = response.coefficients[-1] @ response.basis.T
    brute = steady(structure, shape, response.harmonics)
    omega, rate = response.omega[-1], 1j * response.harmonics[:, None]
    start = shape.real.sum(axis=0), omega * (rate * shape).real.sum(axis=0)
    path = brute.motion(*start, 10 * 2.0 * np.pi / omega, lambda t: force * np.cos(omega * t))
    last = path[-(len(path) - 1) // 10 - 1 :]
    angle = np.linspace(0.0, 2.0 * np.pi, len(last))
    first = 2.0 * np.mean((last * np.exp(-1j * angle)[:, None])[1:], axis=0)
    return np.max(np.abs(first - shape[0])) / np.max(np.abs(shape[0]))


def checked_motion(draw):
    """Error of a transient, over its largest displacement."""
    structure = random_structure(draw)
    brute = Brute(structure)
    brute.u = np.zeros(structure.directions.shape[1])
    span = draw.uniform(3.0, 8.0) * brute.longest
    speed = draw.normal(size=structure.size) * draw.uniform(0.1, 2.0)
    force, rate = draw.uniform(0.0, 0.5), draw.uniform(0.3, 2.0) * 2.0 * np.pi / brute.longest
    push = np.append(np.zeros(structure.size - 1), force)
    motion = dynamics.shake(
        structure, span, velocity=speed, force=lambda t: push * jnp.cos(rate * t), samples=201
    )
    path = brute.motion(np.zeros_like(speed), speed, span, lambda t: push * np.cos(rate * t))
    at = np.linspace(0.0, len(path) - 1, 201)
    wanted = np.stack([np.interp(at, np.arange(len(path)), x) for x in path.T], 1)
    return np.max(np.abs(motion.displacement - wanted)) / np.max(np.abs(wanted))


CHECKS = {
    "joint": checked_joint,
    "law": checked_law,
    "mode": checked_mode,
    "curve": checked_curve,
    "response": checked_response,
    "motion": checked_motion,
}


def verdict(name, seed):
    """Error of a case, and if it was right, silent, doubted, doubted in vain, or refused."""
    draw = np.random.default_rng([seed, list(CHECKS).index(name)])
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        try:
            error = CHECKS[name](draw)
        except (jb.InputError, jb.UnconvergedError) as refusal:
            return np.nan, f"refused ({type(refusal).__name__})"
    doubted = any(issubclass(each.category, jb.DoubtfulWarning) for each in found)
    off = not error <= ALLOWED
    return error, {
        (True, True): "doubted",
        (True, False): "SILENT",
        (False, True): "doubted in vain",
        (False, False): "right",
    }[off, doubted]
