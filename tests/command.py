"""Settings and files that the tests of several commands share."""

# One shape for nearly everything, so that it compiles once.
COARSE = {
    "model.section": "squeeze",
    "model.nodes": 21,
    "model.kinematics": "linear",
    "load.steps_per_half_cycle": 8,
    "load.cycles": 1,
}


def options(values, name="--set"):
    return [word for key, value in values.items() for word in (name, f"{key}={value}")]


BASE = options(COARSE)


def names(folder):
    return {path.name for path in folder.iterdir()}


def is_png(path):
    return path.read_bytes().startswith(b"\x89PNG\r\n")
