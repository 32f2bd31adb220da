"""Scenes that tests share, so that a program is compiled once for all of them.

A program belongs to the words of a scene, its numbers of nodes and steps, and the shapes of its
tables; numbers are free.  So a test takes one of these scenes and changes numbers alone, also by a
path of `STEPS` loads.  Other numbers of nodes stand in slow studies of convergence.
"""

import numpy as np
from toy import STRIP

import jbeamshell as jb

# On the contact line, exact in time: two steps per half cycle say where the path is looked at.
FEW = {"model.nodes": 65, "load.steps_per_half_cycle": 2}
PLANE = jb.Scene().replace(FEW | {"model.section": "plane"})
SQUEEZE = jb.Scene().replace(FEW | {"model.section": "squeeze", "model.kinematics": "linear"})

# Load steps by Newton's method.
STEPS = 20  # loads of a path
EVEN = [[0.0, 10.0], [0.9, 10.0], [0.9, 10.0], [2.0, 10.0]]
UNEVEN = [[0.0, 8.0], [0.9, 12.0], [0.9, 9.0], [2.0, 11.0]]  # the same shape
OPEN = STRIP.replace(
    {
        "contact.pressure": EVEN,
        "model.nodes": 41,
        "model.kinematics": "linear",  # compiles in half the time
        "contact.stick_stiffness": 900.0,
        "load.steps_per_half_cycle": 8,  # first loading and one cycle
        "load.cycles": 1,
    }
)
EXACT = OPEN.replace({"model.kinematics": "exact"})
STEPPED = OPEN.pinned()  # names its section, as a scene of a file does
HELD = OPEN.replace({"contact.normal": "held", "model.section": "shell"})
MOVED = STEPPED.replace({"load.control": "displacement", "load.amplitude": 2e-5})


def held_at(loads):
    """Path (STEPS,) that holds its last load."""
    return np.append(loads, np.full(STEPS - np.size(loads), np.asarray(loads)[-1]))


def two_cycles(amplitude=1.0):
    """Path (STEPS,) to an amplitude and two cycles from there, in steps of a fourth of a branch."""
    branch = 1.0 - 0.5 * np.arange(1, 5)
    return amplitude * np.concatenate([np.arange(1, 5) / 4.0, *[branch, -branch] * 2])
