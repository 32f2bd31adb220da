"""Standard strip as it is solved in the studies."""

import jbeamshell as jb


def in_load_steps() -> jb.Scene:
    """Standard strip in load steps with exact rotations; a study changes what it needs."""
    return jb.library.standard().replace(
        {"model.solution": "stepwise", "model.kinematics": "exact"}
    )
