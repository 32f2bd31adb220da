"""Recordings of a rig that is made up: joints of many kinds, cycles, noise of several kinds."""

import itertools

import numpy as np

from jbeamshell.measured.loops import make_loop


def path(cycles=4, points=200, amplitudes=(1.0,), shape="sine"):
    """A first loading and cycles of every amplitude, (n,), to and fro."""
    turns = [0.0]
    for amplitude in amplitudes:
        turns += [amplitude, -amplitude] * cycles
    turns.append(turns[1] if len(amplitudes) == 1 else amplitudes[-1])
    parts = []
    for here, there in itertools.pairwise(turns):
        count = points // 4 if here == 0.0 else points // 2
        way = np.arange(count) / count
        if shape == "sine":
            way = np.sin(0.5 * np.pi * way) if here == 0.0 else 0.5 - 0.5 * np.cos(np.pi * way)
        parts.append(here + (there - here) * way)
    return np.append(np.concatenate(parts), turns[-1])


def stops(drive, reach, stiffness):
    """Sum of springs in series with sliders under a displacement (n,)."""
    reach, stiffness = np.asarray(reach, float), np.asarray(stiffness, float)
    force, slider = np.empty(drive.size), np.zeros(reach.size)
    for i, level in enumerate(drive):
        slider = np.clip(slider, level - reach, level + reach)
        force[i] = stiffness @ (level - slider)
    return force


def plays(drive, reach, compliance):
    """Sum of plays under a force (n,)."""
    reach, slid = np.asarray(reach, float), np.empty(drive.size)
    position = np.zeros(reach.size)
    for i, level in enumerate(drive):
        position = np.clip(position, level - reach, level + reach)
        slid[i] = compliance @ position
    return slid


def jenkins(u, reach=0.3):
    """One slider: gross slip."""
    return stops(u, [reach], [1.0])


def iwan(u, widest=2.5, stuck=0.3):
    """Many sliders, of which some never slide at |u| = 1: micro-slip."""
    reach = np.linspace(0.05, widest, 16)
    return stops(u, reach, np.full(16, 1.0 / 16.0)) + stuck * u


def iwan_by_force(f, widest=1.2):
    """Displacement of many plays under a force: micro-slip."""
    reach = np.linspace(0.02, widest, 16)
    return 0.6 * f + plays(f, reach, np.full(16, 0.05))


def bouc_wen(u, smoothness=2.0, reach=0.3, stuck=0.1):
    """Bouc-Wen: dz = (1 - |z|^n (1 + sign(z du))/2) du."""
    force, z, fine = np.empty(u.size), 0.0, 20
    force[0] = 0.0
    for i in range(1, u.size):
        step = (u[i] - u[i - 1]) / fine / reach
        for _ in range(fine):
            z += (1.0 - abs(z) ** smoothness * (0.5 + 0.5 * np.sign(z * step))) * step
        force[i] = z
    return force + stuck * u


def sliding_bar():
    """Closed loop of a bar that slides from its end, whose force is a root of the displacement."""
    way = np.clip((1.0 + np.cos(np.linspace(0.0, 2.0 * np.pi, 201))) / 0.4, 0.0, None)
    down = 7.0 - 14.0 * np.sqrt(np.minimum(way[0] - way[:101], 1.0))
    return np.append(down, -down[1:]), 1e-4 * (0.4 * way - 1.0)


def viscous(u, loss=0.3):
    """Spring and dashpot, for a path of sines."""
    rate = np.gradient(u)
    return u + loss * rate / np.max(np.abs(rate))


def bearing(u, clearance=0.5, reach=0.1, stiffness=4.0, friction=1.0):
    """Slider, and a bolt that bears on its hole beyond the clearance."""
    beyond = np.sign(u) * np.maximum(np.abs(u) - clearance, 0.0)
    return friction * stops(u, [reach], [1.0 / reach]) + stiffness * beyond


def pinched(u, clearance=0.4):
    """Friction that grows beyond the clearance, and little of it in the middle."""
    beyond = np.maximum(np.abs(u) - clearance, 0.0)
    return 2.0 * np.sign(u) * beyond + (0.1 + beyond) * jenkins(u, 0.1) / 0.1


SOUND = {
    "jenkins": "displacement",
    "iwan": "displacement",
    "iwan by force": "force",
    "bouc-wen": "displacement",
}


def sound(name, random):
    """Force and displacement of a joint without fault, with random properties and path."""
    u = path(
        cycles=int(random.integers(1, 7)),
        points=int(random.choice([40, 80, 200])),
        shape=random.choice(["sine", "ramp"]),
    )
    if name == "jenkins":
        return jenkins(u, random.uniform(0.05, 0.8)) + random.choice([0.0, 0.05]) * u, u
    if name == "iwan":
        return iwan(u, random.uniform(1.2, 8.0), random.uniform(0.05, 0.5)), u
    if name == "iwan by force":
        return u, iwan_by_force(u, random.uniform(1.02, 4.0))
    shape = random.choice([1.0, 2.0, 4.0]), random.uniform(0.1, 1.0), random.uniform(0.02, 0.3)
    return bouc_wen(u, *shape), u


def white(n, random):
    return random.standard_normal(n)


def pink(n, random):
    """Noise that forgets over about thirty samples."""
    made, level = np.empty(n), 0.0
    for i, kick in enumerate(random.standard_normal(n)):
        level = 0.97 * level + np.sqrt(1.0 - 0.97**2) * kick
        made[i] = level
    return made


def hum(n, random):
    """Mains hum of some seven periods in a hundred samples."""
    return np.sqrt(2.0) * np.sin(0.43 * np.arange(n) + random.uniform(0.0, 6.0))


def steps(n, random):
    """White noise of which the converter shows few levels; rounding is done by `recorded`."""
    return random.standard_normal(n)


NOISES = {"white": white, "pink": pink, "hum": hum, "steps": steps}


def with_noise(column, share, kind, random):
    """The column with noise of a share of its range (standard deviation)."""
    if share == 0.0:
        return column
    size = share * np.ptp(column)
    noisy = column + size * NOISES[kind](column.size, random)
    if kind == "steps":
        noisy = size * np.round(column / size + 0.3 * random.standard_normal(column.size))
    return noisy


def recorded(force, displacement, noise=0.0, kind="white", seed=0, driver=None, label="rig"):
    """Recording with noise on the column that does not drive, and a tenth of it on the drive."""
    random = np.random.default_rng(seed)
    shares = {"force": noise, "displacement": noise}
    if driver is not None:
        shares[driver] *= 0.1
    return make_loop(
        with_noise(force, shares["force"], kind, random),
        with_noise(displacement, shares["displacement"], kind, random),
        label,
        time=0.01 * np.arange(force.size),
    )
