"""Other programs for the standard strip, to be timed beside jbeamshell.

Plane strain, length L, half height H = eta L/2, held at X = 0, pressed by F_N, loaded at X = L by
an end force F that is spread evenly over the face; any consistent units, per unit width.

Time them with one thread (OMP_NUM_THREADS=1): the matrices are small, and threads only wait.
"""

import numpy as np

LENGTH = 2.0
STIFFNESS = 3.4e4  # E' 2H
POISSON = 0.3
FRICTION = 0.1
PRESSURE = 10.0


def cubic_law(amplitude: float) -> float:
    """Dissipation of the bar per cycle, (2/3) A^3/(E'2H mu F_N)."""
    return 2.0 / 3.0 * amplitude**3 / (STIFFNESS * FRICTION * PRESSURE)


def load_path(amplitude: float, steps: int, cycles: int) -> np.ndarray:
    """Rows of end force and Masing's equivalent on first loading, after zero.

    To the amplitude A in half of ``steps`` (at least one), then ``cycles`` times to -A and back to
    A in ``steps`` each.
    """
    quarter = max(steps // 2, 1)
    first = np.arange(1, quarter + 1) / quarter
    gone = np.arange(1, steps + 1) / steps
    down = np.stack([1.0 - 2.0 * gone, -gone], axis=1)
    return amplitude * np.concatenate([np.stack([first, first], axis=1), *[down, -down] * cycles])


def first_guess(x: np.ndarray, eta: float, equivalent: float) -> np.ndarray:
    """Direction in which each node slips: the zone is F/(mu F_N) - 1.7 H long."""
    zone = abs(equivalent) / (FRICTION * PRESSURE) - 1.7 * 0.5 * eta * LENGTH
    return np.where(x > LENGTH - zone, np.sign(equivalent), 0.0)
